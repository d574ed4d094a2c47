"""What the metrics take: phases, gray volumes, whole numbers."""

from __future__ import annotations

import operator
from typing import Any

import numpy as np
import numpy.typing as npt

from poresynth.errors import ParameterError
from poresynth.preprocess import MOST_LABELS
from poresynth.volume import Volume

__all__ = ["PhaseLike", "as_phase", "as_scalar_volume", "whole_number"]

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


def as_phase(solid: PhaseLike, name: str = "solid") -> npt.NDArray[np.bool_]:
    """Return where a phase is.

    Parameters
    ----------
    solid : Volume or array_like
        Shape (z, y, x), any memory order. bool: the phase itself. Numbers of at most 16 different
        values, such as {0, 255} or labels: the phase is what is not 0.
    name : str, default "solid"
        What the caller names it, for the message.

    Returns
    -------
    numpy.ndarray of bool
        Shape (z, y, x), in the memory order that was given; bool arrays are not copied.

    Raises
    ------
    ParameterError
        If the array is empty, not (z, y, x), or a gray volume: which of its values are the phase
        is for `poresynth.binarize` to say.
    """
    array = as_scalar_volume(solid, name)
    if array.dtype == bool:
        return array
    # Most gray volumes say so in their first planes.
    values = np.empty(0, array.dtype)
    for plane in array:
        values = np.union1d(values, plane)
        if len(values) > MOST_LABELS:
            what = f"gray volume of more than {MOST_LABELS} values"
            raise ParameterError(name, what, "must be a phase; cut it with poresynth.binarize")
    return np.asarray(array != 0)


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
