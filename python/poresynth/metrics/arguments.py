"""What the metrics take: phases, gray volumes, the size of a voxel, whole numbers."""

from __future__ import annotations

import operator
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from poresynth.errors import ParameterError
from poresynth.preprocess import MOST_LABELS
from poresynth.volume import Volume, voxel_edges

__all__ = [
    "PhaseLike",
    "Scale",
    "as_mask",
    "as_phase",
    "as_scalar_volume",
    "scale_of",
    "whole_number",
]

PhaseLike = Volume | npt.ArrayLike
"""A phase: bool, two-valued or labels, shape (z, y, x); see `as_phase`."""


def as_scalar_volume(volume: Volume | npt.ArrayLike, name: str) -> npt.NDArray[Any]:
    """Return the voxels of a volume of one channel.

    Parameters
    ----------
    volume : Volume or array_like
        Shape (z, y, x), any memory order; bool, integer or floating point, finite, not empty.
    name : str
        What the caller names it, for the message.

    Returns
    -------
    numpy.ndarray
        Shape (z, y, x); not copied.

    Raises
    ------
    ParameterError
        If the volume is something else.
    """
    array = volume.array if isinstance(volume, Volume) else np.asanyarray(volume)
    what = f"array of shape {array.shape} and type {array.dtype}"
    if array.ndim != 3:
        raise ParameterError(name, what, "must be (z, y, x), one channel")
    if array.size == 0:
        raise ParameterError(name, what, "must hold voxels")
    if array.dtype.kind not in "buif":
        raise ParameterError(name, what, "must be bool, integer or floating point")
    if array.dtype.kind == "f" and not all(bool(np.isfinite(plane).all()) for plane in array):
        raise ParameterError(name, "NaN or infinite voxels", "must be finite")
    return array


def as_phase(
    solid: PhaseLike, name: str = "solid", phase: int | None = None
) -> npt.NDArray[np.bool_]:
    """Return where a phase is.

    Parameters
    ----------
    solid : Volume or array_like
        Shape (z, y, x), any memory order. bool: the phase itself. Numbers of at most 16 different
        values, such as {0, 255} or labels: the phase is what is not 0.
    name : str, default "solid"
        What the caller names it, for the message.
    phase : int, optional
        The value that is the phase, instead of all but 0: a label, or 0 for the pore of a bool
        array.

    Returns
    -------
    numpy.ndarray of bool
        Shape (z, y, x), in the memory order that was given; bool arrays, and uint8 of 0 and 1, are
        not copied.

    Raises
    ------
    ParameterError
        If the array is empty, not (z, y, x), does not hold the phase, or is a gray volume: which of
        its values are the phase is for `poresynth.binarize` to say.
    """
    array = as_scalar_volume(solid, name)
    if array.dtype == bool and phase in (None, 0, 1):
        return ~array if phase == 0 else array
    # Most gray volumes say so in their first planes.
    values = np.empty(0, array.dtype)
    for plane in array:
        values = np.union1d(values, plane)
        if len(values) > MOST_LABELS:
            what = f"gray volume of more than {MOST_LABELS} values"
            raise ParameterError(name, what, "must be a phase; cut it with poresynth.binarize")
    if phase is not None:
        if phase not in values:
            raise ParameterError("phase", phase, f"must be one of the values {values.tolist()}")
        return np.asarray(array == phase)
    if array.dtype == np.uint8 and values[-1] <= 1:
        return array.view(bool)
    return np.asarray(array != 0)


def as_mask(
    name: str, mask: npt.NDArray[np.bool_] | None, shape: tuple[int, ...]
) -> npt.NDArray[np.bool_] | None:
    """Return a mask of a volume, or none where there is none.

    Parameters
    ----------
    name : str
        What the caller names it, for the message.
    mask : numpy.ndarray of bool, optional
        The mask.
    shape : (int, int, int)
        Shape of the volume.

    Returns
    -------
    numpy.ndarray of bool or None

    Raises
    ------
    ParameterError
        If it is not bool, or of another shape.
    """
    if mask is None:
        return None
    found = np.asarray(mask)
    if found.shape != shape or found.dtype != bool:
        what = f"array of shape {found.shape} and type {found.dtype}"
        raise ParameterError(name, what, f"must be bool, of the shape {shape}")
    return found


class Scale(NamedTuple):
    """The size of a voxel.

    Attributes
    ----------
    voxel_size : (float, float, float)
        Edges of a voxel along (z, y, x), in ``unit``.
    unit : str
        Unit of lengths; ``"voxel"`` if the scale is unknown.
    """

    voxel_size: tuple[float, float, float]
    unit: str


def scale_of(
    volume: Volume | npt.ArrayLike, voxel_size: float | tuple[float, float, float] | None = None
) -> Scale:
    """Return the size of the voxels to measure with.

    Parameters
    ----------
    volume : Volume or array_like
        A `Volume` knows the size of its voxels; those of a plain array have the edge 1.
    voxel_size : float or (float, float, float), optional
        Edges along (z, y, x), instead of the volume's own; in the volume's unit.

    Returns
    -------
    Scale

    Raises
    ------
    ParameterError
        If a voxel size is not positive.
    """
    size, unit = (1.0, 1.0, 1.0), "voxel"
    if isinstance(volume, Volume):
        size, unit = volume.voxel_size, volume.unit
    if voxel_size is not None:
        size = voxel_edges(voxel_size)
    return Scale(size, unit)


def whole_number(name: str, value: Any, low: int) -> int:
    """Return an integer parameter.

    Parameters
    ----------
    name : str
        Its name, for the message.
    value : int
        Any integer type.
    low : int
        The smallest that is allowed.

    Returns
    -------
    int

    Raises
    ------
    ParameterError
        If it is not an integer, or smaller.
    """
    try:
        number = operator.index(value)
    except TypeError:
        raise ParameterError(name, value, "must be a whole number") from None
    if number < low:
        raise ParameterError(name, value, f"must be at least {low}")
    return number
