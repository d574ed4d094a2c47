"""Linear interpolation between the nodes of a coarser grid, centre to centre."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

__all__ = ["interpolated", "places"]

_Floats = npt.NDArray[np.float32]


def places(
    n: int, nodes: int, *, beyond: bool = False
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.float64]]:
    """Return the node before each of ``n`` voxels, and how far on the way to the next it lies.

    Parameters
    ----------
    n, nodes : int
        Voxels and nodes of an axis; both grids fill it.
    beyond : bool, default False
        Whether voxels outside the outermost nodes continue the slope there, instead of taking the
        value of the node.

    Returns
    -------
    numpy.ndarray of intp, numpy.ndarray of float64
        Shape (n,) each.
    """
    place = (np.arange(n) + 0.5) * nodes / n - 0.5
    if not beyond:
        place = np.clip(place, 0, nodes - 1)
    low = np.clip(np.floor(place).astype(np.intp), 0, max(nodes - 2, 0))
    return low, place - low if nodes > 1 else np.zeros(n)


def interpolated(
    values: npt.NDArray[Any],
    shape: tuple[int, ...],
    *,
    box: tuple[slice, ...] = (),
    beyond: bool = False,
) -> _Floats:
    """Return a field at the voxels of a volume.

    Parameters
    ----------
    values : numpy.ndarray
        Values at the nodes, shape (a, b, c).
    shape : (int, int, int)
        Shape (z, y, x) of the volume.
    box : tuple of slice, optional
        Voxels that are wanted along the first axes; all by default.
    beyond : bool, default False
        As for `places`.

    Returns
    -------
    numpy.ndarray of float32
        Shape (z, y, x), of the box.
    """
    found = np.asarray(values, np.float32)
    for axis, n in enumerate(shape):
        low, part = places(n, found.shape[axis], beyond=beyond)
        if axis < len(box):
            low, part = low[box[axis]], part[box[axis]]
        weight = part.astype(np.float32).reshape([-1 if i == axis else 1 for i in range(3)])
        first = np.take(found, low, axis)
        last = np.take(found, np.minimum(low + 1, found.shape[axis] - 1), axis)
        found = first + weight * (last - first)
    return np.ascontiguousarray(found)
