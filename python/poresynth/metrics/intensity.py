"""Gray values: their distribution, their sharpness, and planes that show a seam."""

from __future__ import annotations

import itertools
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from poresynth.metrics.arguments import as_scalar_volume
from poresynth.metrics.wasserstein import wasserstein
from poresynth.volume import Volume

__all__ = ["HistogramDistance", "gradient_ratio", "histogram_distance", "mean_gradient", "seam"]

_Voxels = npt.NDArray[Any]
_Curve = npt.NDArray[np.float64]

# Bins of values that are not integers of at most 16 bits.
BINS = 1 << 16
# Keeps a ratio finite for an exemplar whose planes are all alike.
SMALLEST = 1e-9


class HistogramDistance(NamedTuple):
    """Distance between two distributions of gray values.

    Attributes
    ----------
    gray_levels : float
        In gray levels: 1 means that values of the same rank differ by 1 on average.
    percent : float
        In percent of the exemplar's standard deviation; NaN for a constant exemplar.
    """

    gray_levels: float
    percent: float


def histogram_distance(
    exemplar: Volume | npt.ArrayLike, volume: Volume | npt.ArrayLike
) -> HistogramDistance:
    """Return the 1-Wasserstein distance between the gray values of two volumes.

    Parameters
    ----------
    exemplar, volume : Volume or array_like
        Shapes (z, y, x), any data type.

    Returns
    -------
    HistogramDistance
        Exact for integers of at most 16 bits; other types are counted in 65536 bins over the
        range of both volumes.

    Raises
    ------
    ParameterError
        If a volume is empty, not (z, y, x) or not finite.

    Notes
    -----
    Peak memory: 1 MB and 16 bytes per voxel of one plane.
    """
    counts = count_levels(exemplar, volume)
    gray_levels = wasserstein(counts.levels, counts.exemplar, counts.volume)
    deviation = float(as_scalar_volume(exemplar, "exemplar").std(dtype=float))
    percent = 100 * gray_levels / deviation if deviation else float("nan")
    return HistogramDistance(gray_levels, percent)


class LevelCounts(NamedTuple):
    """How often each gray level occurs in two volumes.

    Attributes
    ----------
    levels : numpy.ndarray
        Equidistant, ascending, shape (n,).
    exemplar, volume : numpy.ndarray of int64
        Voxels at each level, shape (n,).
    """

    levels: npt.NDArray[np.floating[Any]]
    exemplar: npt.NDArray[np.int64]
    volume: npt.NDArray[np.int64]


def count_levels(exemplar: Volume | npt.ArrayLike, volume: Volume | npt.ArrayLike) -> LevelCounts:
    """Count the gray levels of two volumes.

    Parameters
    ----------
    exemplar, volume : Volume or array_like
        Shapes (z, y, x), any data type.

    Returns
    -------
    LevelCounts
        Every level for integers of at most 16 bits, else 65536 levels over the range of both.

    Raises
    ------
    ParameterError
        If a volume is empty, not (z, y, x) or not finite.
    """
    e, v = as_scalar_volume(exemplar, "exemplar"), as_scalar_volume(volume, "volume")
    low = min(float(e.min()), float(v.min()))
    high = max(float(e.max()), float(v.max()))
    integers = all(a.dtype.kind in "bui" and a.dtype.itemsize <= 2 for a in (e, v))
    bins = int(high - low) + 1 if integers else BINS
    counts = np.zeros((2, bins), np.int64)
    for count, array in zip(counts, (e, v), strict=True):
        for plane in array:
            flat = plane.ravel()
            if integers:
                index = flat.astype(np.intp) - int(low)
            else:
                # A share first: the width of a bin is 0 where the range is of the smallest floats.
                share = (flat.astype(float) - low) / ((high - low) or 1.0)
                index = np.rint(share * (bins - 1)).astype(np.intp)
            count += np.bincount(index, minlength=bins)
    return LevelCounts(np.linspace(low, high, bins), counts[0], counts[1])


def mean_gradient(volume: Volume | npt.ArrayLike) -> float:
    """Return the mean absolute difference of neighbouring voxels, a mean of the three axes.

    Parameters
    ----------
    volume : Volume or array_like
        Shape (z, y, x), any data type.

    Returns
    -------
    float
        In gray levels a voxel. An axis of one voxel does not count.

    Raises
    ------
    ParameterError
        If the volume is empty, not (z, y, x) or not finite.

    Notes
    -----
    Peak memory: 12 bytes per voxel of one plane.
    """
    profiles = _gradient_profiles(as_scalar_volume(volume, "volume"))
    means = [profile.mean() for profile in profiles if len(profile)]
    return float(np.mean(means)) if means else 0.0


def gradient_ratio(exemplar: Volume | npt.ArrayLike, volume: Volume | npt.ArrayLike) -> float:
    """Return the sharpness of a volume relative to its exemplar: the ratio of mean gradients.

    Parameters
    ----------
    exemplar, volume : Volume or array_like
        Shapes (z, y, x), any data type.

    Returns
    -------
    float
        Below 1 the volume is blurred, above 1 it is noisier or finer. NaN for a constant exemplar.

    Raises
    ------
    ParameterError
        If a volume is empty, not (z, y, x) or not finite.

    Notes
    -----
    Peak memory: 12 bytes per voxel of one plane.
    """
    e, v = as_scalar_volume(exemplar, "exemplar"), as_scalar_volume(volume, "volume")
    own = mean_gradient(e)
    return mean_gradient(v) / own if own else float("nan")


def seam(exemplar: Volume | npt.ArrayLike, volume: Volume | npt.ArrayLike) -> float:
    """Return how far a plane stands out of a volume, relative to the exemplar.

    The mean absolute difference between two neighbouring planes is a profile along an axis; a seam
    makes it jump. The figure is the largest jump between neighbours in the profile, relative to
    the profile's mean, over the three axes, divided by the same of the exemplar. Larger planes have
    steadier means: planes are cut to the exemplar's smallest edge, and where the volume is smaller
    than the exemplar, the exemplar's figure is the mean of its eight corners of that size.

    Parameters
    ----------
    exemplar, volume : Volume or array_like
        Shapes (z, y, x), any data type.

    Returns
    -------
    float
        1 is as even as the exemplar. A larger volume has more planes, so that 1.3 is no seam.

    Raises
    ------
    ParameterError
        If a volume is empty, not (z, y, x) or not finite.

    Notes
    -----
    Peak memory: 12 bytes per voxel of one plane.
    """
    e, v = as_scalar_volume(exemplar, "exemplar"), as_scalar_volume(volume, "volume")
    edge = min(*e.shape, *v.shape)
    own = [_largest_jump(corner, edge) for corner in _corners(e, edge)]
    return _largest_jump(v, edge) / max(float(np.mean(own)), SMALLEST)


def _corners(array: _Voxels, edge: int) -> list[_Voxels]:
    """Return the corners of this edge; the volume itself if it is no larger."""
    if edge == min(array.shape):
        return [array]
    ends = (slice(edge), slice(-edge, None))
    return [array[corner] for corner in itertools.product(ends, repeat=3)]


def _largest_jump(array: _Voxels, edge: int) -> float:
    jumps = [0.0]
    for profile in _gradient_profiles(array, edge):
        if len(profile) > 1 and profile.any():
            jumps.append(float(np.abs(np.diff(profile)).max() / profile.mean()))
    return max(jumps)


def _gradient_profiles(array: _Voxels, edge: int | None = None) -> list[_Curve]:
    """Return the mean absolute differences of neighbouring planes, for each axis.

    ``edge`` cuts the planes. Works plane by plane, so that no copy of the volume is made.
    """
    cut = slice(edge)
    kind = np.result_type(array.dtype, np.float32)
    sums: list[_Curve] = [np.zeros(max(n - 1, 0)) for n in array.shape]
    below: _Voxels | None = None
    for z, voxels in enumerate(array):
        plane = voxels.astype(kind)
        if below is not None:
            sums[0][z - 1] = np.abs(plane - below)[cut, cut].sum(dtype=float)
        if edge is None or z < edge:
            sums[1] += np.abs(np.diff(plane, axis=0))[:, cut].sum(axis=1, dtype=float)
            sums[2] += np.abs(np.diff(plane, axis=1))[cut].sum(axis=0, dtype=float)
        below = plane
    nz, ny, nx = (n if edge is None else min(n, edge) for n in array.shape)
    return [total / size for total, size in zip(sums, (ny * nx, nz * nx, nz * ny), strict=True)]
