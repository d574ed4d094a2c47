"""Values for voxels that changed phase."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from poresynth import _core

__all__ = ["repaint"]

DEPTHS = 3
"""Layers from the surface on in which gray values differ: blur of scans reaches no further."""

TRIM = 0.05
"""Highest and lowest ranks that are not given: faint remains of structures below the threshold."""


def repaint(
    array: npt.NDArray[Any],
    before: npt.NDArray[np.bool_],
    after: npt.NDArray[np.bool_],
    *,
    gray: bool,
    keep: npt.NDArray[np.bool_] | None = None,
) -> npt.NDArray[Any]:
    """Return the values of a volume whose solid changed.

    Parameters
    ----------
    array : numpy.ndarray
        The values, shape (z, y, x).
    before, after : numpy.ndarray of bool
        The solid that they show, and the one that they are to show, same shape.
    gray : bool
        Gray values: a voxel that came to lie at another depth below or above the surface keeps its
        rank among the values of its depth, so that noise stays noise. Otherwise each voxel that
        changed takes the value of the nearest voxel of its new phase.
    keep : numpy.ndarray of bool, optional
        Voxels whose values stay.

    Returns
    -------
    numpy.ndarray
        Of the same dtype; where nothing changed, the same values.

    Notes
    -----
    Peak memory: 20 bytes a voxel, of nearest values 40.
    """
    values: npt.NDArray[Any] = array.copy()
    if np.array_equal(before, after):
        return values
    if not gray:
        _take_nearest(values, before, after)
        return values
    old, new = (_depth(solid) for solid in (before, after))
    moved = old != new
    if keep is not None:
        moved &= ~keep
    steady = old == new
    ranks = np.zeros(int(moved.sum()))
    was, is_now, levels = old[moved], new[moved], array[moved]
    stock = {depth: np.sort(array[steady & (old == depth)]) for depth in np.union1d(was, is_now)}
    for depth in np.unique(was):
        here, among = was == depth, stock[depth]
        if len(among):
            low, high = (np.searchsorted(among, levels[here], side) for side in ("left", "right"))
            ranks[here] = np.clip((low + high) / (2 * len(among)), TRIM, 1 - TRIM)
    painted = levels.copy()
    for depth in np.unique(is_now):
        here, among = is_now == depth, stock[depth]
        if len(among) == 0:  # No other voxel is as deep: the next layer of the same phase.
            side = [d for d in stock if (d > 0) == (depth > 0) and len(stock[d])]
            among = stock[min(side, key=lambda d: abs(int(d) - int(depth)))] if side else levels
        place = np.minimum((ranks[here] * len(among)).astype(np.int64), len(among) - 1)
        painted[here] = among[place]
    values[moved] = painted
    return values


def _depth(solid: npt.NDArray[np.bool_]) -> npt.NDArray[np.int8]:
    """Return the layer of each voxel: 1, 2, … below the surface, −1, −2, … above it."""
    distance = _core.signed_distance(solid, DEPTHS, boundary="open")
    return np.where(solid, np.ceil(distance), np.floor(distance)).astype(np.int8)


def _take_nearest(
    values: npt.NDArray[Any], before: npt.NDArray[np.bool_], after: npt.NDArray[np.bool_]
) -> None:
    from scipy.ndimage import distance_transform_edt

    for phase in (False, True):
        changed = (before != after) & (after == phase)
        steady = (before == phase) & (after == phase)
        if changed.any() and steady.any():
            index = distance_transform_edt(~steady, return_distances=False, return_indices=True)
            values[changed] = values[tuple(i[changed] for i in index)]
