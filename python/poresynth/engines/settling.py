"""New voxels led up to the known ones that they meet."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from poresynth.engines.seam import border_steps, expected_steps

__all__ = ["settle"]

_Floats = npt.NDArray[np.float32]

FURTHEST = 6.0
"""Most distance, voxels, over which a difference fades to 1/e: about the radius of a strut."""
HALVINGS = 5
"""Steps in which that distance is found: to a fifth of a voxel."""


def settle(
    field: _Floats,
    exemplar: npt.NDArray[Any],
    known: npt.NDArray[np.bool_],
    domain: npt.NDArray[np.bool_] | None = None,
    *,
    cut: float | None = None,
) -> _Floats:
    """Move a field beside the known voxels until its steps across the border are ordinary ones.

    A lone slice, or a line of voxels, is so small a part of a window that the windows beside it may
    fit it badly. What the known voxels differ by from what their neighbours lead to expect is added
    to the voxels around, fading with the distance; how fast is chosen so that the steps across the
    border are as large as those in the exemplar, or as many of them are from phase to phase. Where
    they are not larger, nothing changes.

    Parameters
    ----------
    field : numpy.ndarray of float32
        Shape (channel, z, y, x), with the known values in place.
    exemplar : numpy.ndarray
        The same field of the exemplar.
    known : numpy.ndarray of bool
        Where values are known, shape (z, y, x).
    domain : numpy.ndarray of bool, optional
        Where the volume matters, same shape.
    cut : float, optional
        Value of the exemplar's field that parts its phases: steps from phase to phase are then
        counted, not the size of all steps.

    Returns
    -------
    numpy.ndarray of float32

    Notes
    -----
    Peak memory: 30 bytes a voxel.
    """
    free = ~known if domain is None else ~known & domain
    edge = known & ndimage.binary_dilation(free)
    if not edge.any():
        return field
    distance = ndimage.distance_transform_edt(~edge).astype(np.float32)
    settled: _Floats = field.copy()
    for channel, own in enumerate(field):
        model = exemplar[channel] if cut is None else exemplar[channel] > cut
        wanted = expected_steps(model, known, domain)
        lead = _lead(own, free, edge)

        def moved(reach: float, own: _Floats = own, lead: _Floats = lead) -> _Floats:
            fading = np.exp(-distance / np.float32(reach))
            return np.asarray(own + np.where(free, lead * fading, np.float32(0)), np.float32)

        def steps(values: _Floats, model: npt.NDArray[Any] = model) -> float:
            if cut is None:
                return border_steps(values, known, domain)
            # The volume is cut at a quantile, not at a value.
            level = np.quantile(values[free], 1 - model.mean())
            return border_steps(values > np.where(known, np.float32(cut), level), known, domain)

        if steps(own) <= wanted:
            continue
        low, high = 0.0, FURTHEST
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            low, high = (low, middle) if steps(moved(middle)) <= wanted else (middle, high)
        settled[channel] = moved(high)
    return settled


def _lead(values: _Floats, free: npt.NDArray[np.bool_], edge: npt.NDArray[np.bool_]) -> _Floats:
    """Return by how much the nearest known voxels differ from what the new ones lead to expect."""
    share = ndimage.gaussian_filter(free.astype(np.float32), 1.0)
    expected = ndimage.gaussian_filter(np.where(free, values, np.float32(0)), 1.0)
    difference = np.where(edge, values - expected / np.maximum(share, np.float32(1e-3)), 0)
    spread = ndimage.gaussian_filter(difference, 2.0)
    weight = ndimage.gaussian_filter(edge.astype(np.float32), 2.0)
    return np.asarray(spread / np.maximum(weight, 1e-3), dtype=np.float32)
