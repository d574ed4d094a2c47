"""Cropping, down-sampling and thresholds, and the one check of voxels that all engines share."""

from __future__ import annotations

import importlib
import operator
from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from poresynth.errors import ParameterError
from poresynth.volume import Volume, as_volume

__all__ = [
    "MOST_LABELS",
    "as_image",
    "binarize",
    "crop",
    "downsample",
    "is_two_valued",
    "label_values",
    "threshold",
    "validate_voxels",
]

MOST_LABELS = 16
"""An integer volume of three to so many values is taken for labels, one of more for gray."""

# Volume in, Volume out; array in, array out.
_Voxels = TypeVar("_Voxels", Volume, npt.NDArray[Any])


def crop(volume: _Voxels, start: Sequence[int], shape: Sequence[int]) -> _Voxels:
    """Cut a box out of a volume.

    Parameters
    ----------
    volume : Volume or numpy.ndarray
        Shape (z, y, x) or (z, y, x, channel).
    start : (int, int, int)
        First voxel of the box along (z, y, x).
    shape : (int, int, int)
        Edge lengths of the box in voxels.

    Returns
    -------
    Volume or numpy.ndarray
        Of the kind that was given; a view, with its scale and metadata.

    Raises
    ------
    ParameterError
        If the box is empty or reaches beyond the volume.

    Notes
    -----
    Peak memory: none.
    """
    whole = as_volume(volume)
    corner, edges = _three(start, "start"), _three(shape, "shape")
    for name, values, low in (("start", corner, 0), ("shape", edges, 1)):
        if min(values) < low:
            raise ParameterError(name, values, f"must be at least {low} along each axis")
    end = tuple(c + e for c, e in zip(corner, edges, strict=True))
    if any(e > n for e, n in zip(end, whole.shape, strict=True)):
        allowed = f"the box from {corner} must end inside the volume of shape {whole.shape}"
        raise ParameterError("shape", edges, allowed)
    box = tuple(slice(c, e) for c, e in zip(corner, end, strict=True))
    return _like(volume, whole.array[box], whole.voxel_size)


def as_image(volume: _Voxels) -> _Voxels:
    """Turn a volume that is one voxel thick, along whichever axis, into an image.

    Parameters
    ----------
    volume : Volume or numpy.ndarray
        Shape (z, y, x) or (z, y, x, channel), with an edge of one voxel.

    Returns
    -------
    Volume or numpy.ndarray
        Of the kind that was given; a view of shape (1, y, x[, channel]). The two long axes keep
        their order, and the edges of a voxel go with their axes.

    Raises
    ------
    ParameterError
        If no edge is one voxel long.

    Notes
    -----
    Peak memory: none.
    """
    whole = as_volume(volume)
    if 1 not in whole.shape:
        raise ParameterError("volume.shape", whole.shape, "must be one voxel thick along an axis")
    axis = whole.shape.index(1)
    size = list(whole.voxel_size)
    size.insert(0, size.pop(axis))
    z, y, x = size
    return _like(volume, np.moveaxis(whole.array, axis, 0), (z, y, x))


def downsample(volume: _Voxels, factor: int, labels: bool | None = None) -> _Voxels:
    """Replace blocks of ``factor``³ voxels by one voxel each.

    Parameters
    ----------
    volume : Volume or numpy.ndarray
        Shape (z, y, x) or (z, y, x, channel). An image, one slice thick, is down-sampled within
        its plane.
    factor : int
        Edge of a block in voxels. Voxels beyond the last whole block are dropped.
    labels : bool, optional
        True: the voxels are phases, and the most frequent of a block is taken, the lowest of
        those if several are. False: they are intensities, and the mean is taken, rounded to an
        integer for integer types. Default: True for volumes of at most two values and for
        integers of at most 16, which are taken for labels everywhere.

    Returns
    -------
    Volume or numpy.ndarray
        Of the kind and data type that were given; a ``voxel_size`` larger by ``factor``.

    Raises
    ------
    ParameterError
        If the factor is less than 1 or larger than an edge of the volume.

    Notes
    -----
    Peak memory beside the result, in bytes per voxel of one slice: about ``70 * factor`` for
    labels, ``16 * factor`` for intensities.
    """
    whole = as_volume(volume)
    try:
        factor = operator.index(factor)
    except TypeError:
        raise ParameterError("factor", factor, "must be a whole number") from None
    bz, by, bx = (factor if whole.shape[0] > 1 else 1), factor, factor
    limit = min(n for n, b in zip(whole.shape, (bz, by, bx), strict=True) if b == factor)
    if not 1 <= factor <= limit:
        raise ParameterError("factor", factor, f"must be 1 to {limit}, the shortest edge")
    if labels is None:
        labels = is_two_valued(whole) or bool(label_values(whole))
    pick = _majority if labels else _mean
    nz, ny, nx = (n // b for n, b in zip(whole.shape, (bz, by, bx), strict=True))
    channels: tuple[int, ...] = whole.array.shape[3:]
    out = np.empty((nz, ny, nx, *channels), whole.dtype)
    for i in range(nz):
        slab = whole.array[i * bz : (i + 1) * bz, : ny * by, : nx * bx]
        grouped = slab.reshape(bz, ny, by, nx, bx, *channels)
        out[i] = pick(np.moveaxis(grouped, (0, 2, 4), (-3, -2, -1)), whole.dtype)
    z, y, x = whole.voxel_size
    return _like(volume, out, (z * bz, y * by, x * bx))


def threshold(volume: Volume | npt.ArrayLike, value: float | None = None) -> float:
    """Return the intensity that parts the dark phase from the bright one.

    Parameters
    ----------
    volume : Volume or array_like
        Shape (z, y, x), one channel.
    value : float, optional
        Taken instead, if it parts the volume. Default: Otsu's threshold (scikit-image); halfway
        between the two values of a volume that has only two.

    Returns
    -------
    float
        Voxels above it are bright, voxels at it or below it are dark.

    Raises
    ------
    ParameterError
        If the volume has channels, NaN or one value only, or all of it is on one side of
        ``value``.

    Notes
    -----
    Peak memory: about 10 bytes per voxel (scikit-image's).
    """
    array = _single(validate_voxels(volume)).array
    low, high = float(array.min()), float(array.max())
    if value is not None:
        if not low <= float(value) < high:
            allowed = f"must be at least {low:g} and below {high:g}, or one phase is empty"
            raise ParameterError("threshold", value, allowed)
        return float(value)
    if is_two_valued(array):
        return (low + high) / 2
    otsu: Any = importlib.import_module("skimage.filters").threshold_otsu
    return float(otsu(array))


def binarize(
    volume: Volume | npt.ArrayLike, threshold: float | None = None, solid: str = "bright"
) -> npt.NDArray[np.bool_]:
    """Return where a volume is solid.

    Parameters
    ----------
    volume : Volume or array_like
        Shape (z, y, x), one channel.
    threshold : float, optional
        See `threshold`, whose default is this one's.
    solid : {"bright", "dark"}, default "bright"
        Which phase is solid: the one above the threshold (in CT what absorbs is bright), or the
        other.

    Returns
    -------
    numpy.ndarray of bool
        Shape (z, y, x); True is solid.

    Raises
    ------
    ParameterError
        As `threshold` does, and if ``solid`` is something else.

    Notes
    -----
    Peak memory: as `threshold`.
    """
    if solid not in ("bright", "dark"):
        raise ParameterError("solid", solid, "must be 'bright' or 'dark'")
    array = as_volume(volume).array
    bright: npt.NDArray[np.bool_] = array > _cut(array, threshold)
    return bright if solid == "bright" else ~bright


def is_two_valued(volume: Volume | npt.ArrayLike) -> bool:
    """Return whether the voxels have at most two values; peak memory a few slices."""
    array = np.asarray(volume)
    if array.dtype == bool or array.size == 0:
        return True
    low, high = array.min(), array.max()
    # Most gray volumes say no in their first slice.
    return all(bool(((part == low) | (part == high)).all()) for part in np.atleast_1d(array))


def label_values(volume: Volume | npt.ArrayLike) -> tuple[int, ...]:
    """Return the labels of a volume, ascending; none for one that is binary or gray.

    Integers of 3 to 16 different values are labels. Peak memory: a few slices.
    """
    array = np.asarray(volume)
    if array.dtype.kind not in "ui":
        return ()
    values = np.empty(0, array.dtype)
    for plane in np.atleast_1d(array):
        values = np.union1d(values, plane)
        if len(values) > MOST_LABELS:  # Most gray volumes say so in their first slice.
            return ()
    return tuple(int(v) for v in values) if len(values) > 2 else ()


def validate_voxels(volume: Volume | npt.ArrayLike, name: str = "volume") -> Volume:
    """Return a volume that engines and metrics can work on, or say what is wrong with it.

    Parameters
    ----------
    volume : Volume or array_like
        Shape (z, y, x) or (z, y, x, channel).
    name : str, default "volume"
        What the caller names it, for the message.

    Returns
    -------
    Volume
        ``volume`` itself, or the array as a volume.

    Raises
    ------
    ParameterError
        If it does not have 3 or 4 dimensions, is no more than a line of voxels, has another type
        than bool, integer or floating point, holds NaN or infinite voxels, or is constant.

    Notes
    -----
    Peak memory: 3 bytes per voxel of one slice.
    """
    array = volume.array if isinstance(volume, Volume) else np.asanyarray(volume)
    if array.ndim not in (3, 4):
        raise ParameterError(
            name, f"array of shape {array.shape}", "must be (z, y, x) or (z, y, x, channel)"
        )
    if array.size == 0:
        raise ParameterError(name, f"array of shape {array.shape}", "must hold voxels")
    if sum(n > 1 for n in array.shape[:3]) < 2:
        allowed = "must have at least two edges longer than one voxel"
        raise ParameterError(name, f"array of shape {array.shape}", allowed)
    if array.dtype.kind not in "buif":
        raise ParameterError(name, f"array of {array.dtype}", "must be bool, integer or float")
    if array.dtype.kind == "f":
        _check_finite(array, name)
    if all(bool((part == array[0, 0, 0]).all()) for part in array):
        value = np.array2string(array[0, 0, 0])
        raise ParameterError(name, f"{value} everywhere", "must not be constant")
    return as_volume(volume)


def _check_finite(array: npt.NDArray[Any], name: str) -> None:
    count, first = 0, None
    for z, part in enumerate(array):
        wrong = ~np.isfinite(part)
        found = int(np.count_nonzero(wrong))
        if found and first is None:
            first = (z, *(int(i) for i in np.argwhere(wrong)[0]))
        count += found
    if first is not None:
        what = f"{count} NaN or infinite voxels, the first at {first}"
        raise ParameterError(name, what, "must be finite")


def _cut(array: npt.NDArray[Any], value: float | None) -> float:
    # `binarize` has a parameter of the name of the function.
    return threshold(array, value)


def _single(volume: Volume) -> Volume:
    if volume.array.ndim == 4:
        allowed = "must have one channel; take one, volume.array[..., 0], or the mean of them"
        raise ParameterError("volume.channels", volume.channels, allowed)
    return volume


def _three(values: Sequence[int], name: str) -> tuple[int, int, int]:
    try:
        z, y, x = (operator.index(v) for v in values)
    except (TypeError, ValueError):
        raise ParameterError(name, values, "must be three whole numbers (z, y, x)") from None
    return z, y, x


def _like(
    given: _Voxels, array: npt.NDArray[Any], voxel_size: tuple[float, float, float]
) -> _Voxels:
    if isinstance(given, Volume):
        # A plain volume: what a subclass knows of the whole does not hold for the part.
        return Volume(array, voxel_size, given.unit, given.metadata)
    return array


def _mean(blocks: npt.NDArray[Any], dtype: np.dtype[Any]) -> npt.NDArray[Any]:
    """Return the mean over the last three axes."""
    mean: npt.NDArray[Any] = blocks.mean(axis=(-3, -2, -1), dtype=np.float64)
    return mean if dtype.kind == "f" else np.rint(mean)


def _majority(blocks: npt.NDArray[Any], dtype: np.dtype[Any]) -> npt.NDArray[Any]:
    """Return the most frequent value over the last three axes, the lowest of several."""
    shape = blocks.shape[:-3]
    values, index = np.unique(blocks, return_inverse=True)
    index = index.reshape(int(np.prod(shape)), -1)
    block = np.arange(len(index))[:, np.newaxis] * len(values)
    # Sorted, so that the labels of a block lie together, from the lowest to the highest.
    keys, counts = np.unique(block + index, return_counts=True)
    owner, label = np.divmod(keys, len(values))
    first = np.flatnonzero(np.diff(owner, prepend=-1))
    best = np.maximum.reduceat(counts * len(values) + (len(values) - 1 - label), first)
    winners: npt.NDArray[Any] = values[len(values) - 1 - best % len(values)]
    return winners.reshape(shape)
