"""The porosity that a volume is asked for: a number, a map, or a function of position."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from poresynth.engines.interpolation import interpolated
from poresynth.errors import ParameterError
from poresynth.volume import Volume

__all__ = ["PorosityLike", "as_porosity"]

PorosityLike = float | Volume | npt.ArrayLike | Callable[..., npt.ArrayLike]
"""Pore fraction: a number; a map of the output's shape or coarser; or a function that takes the
coordinates z, y, x of the voxels' centres, arrays that broadcast, in the unit of the voxel size."""

_Map = npt.NDArray[np.float32]


def as_porosity(
    porosity: PorosityLike | None,
    shape: tuple[int, int, int],
    voxel_size: tuple[float, float, float],
) -> tuple[float | None, _Map | None]:
    """Return a porosity as a number, or as a map of the output's shape.

    Parameters
    ----------
    porosity : float, Volume, array_like or callable, optional
        See `PorosityLike`.
    shape : (int, int, int)
        Shape (z, y, x) of the output.
    voxel_size : (float, float, float)
        Edges of a voxel.

    Returns
    -------
    float or None, numpy.ndarray of float32 or None
        One of the two, or neither: the exemplar's own.

    Raises
    ------
    ParameterError
        If a value is not between 0 and 1, or a map is finer than the output or not a volume.
    """
    if porosity is None:
        return None, None
    if callable(porosity):
        places = [(np.arange(n) + 0.5) * edge for n, edge in zip(shape, voxel_size, strict=True)]
        z, y, x = np.meshgrid(*places, indexing="ij", sparse=True)
        try:
            values = np.broadcast_to(np.asarray(porosity(z, y, x), np.float32), shape)
        except (TypeError, ValueError) as error:
            allowed = f"must give an array that broadcasts to {shape} ({error})"
            raise ParameterError("porosity", porosity, allowed) from error
        return None, _checked(values)
    values = np.asarray(porosity)
    if values.ndim == 0 and values.dtype.kind in "buif":
        number = float(values)
        if not 0 < number < 1:
            raise ParameterError("porosity", number, "must be above 0 and below 1")
        return number, None
    if values.ndim != 3 or values.size == 0 or values.dtype.kind not in "buif":
        what = f"array of shape {values.shape} and type {values.dtype}"
        raise ParameterError("porosity", what, "must be a number or a map of numbers (z, y, x)")
    if any(n > m for n, m in zip(values.shape, shape, strict=True)):
        allowed = f"must not be finer than the output, {shape}"
        raise ParameterError("porosity", f"map of shape {values.shape}", allowed)
    found = _checked(values.astype(np.float32))
    return None, found if found.shape == shape else interpolated(found, shape)


def _checked(values: npt.NDArray[Any]) -> _Map:
    low, high = float(np.min(values)), float(np.max(values))
    if not (low > 0 and high < 1):
        what = f"map from {low:.3g} to {high:.3g}"
        raise ParameterError("porosity", what, "must be above 0 and below 1 everywhere")
    return np.ascontiguousarray(values, np.float32)
