"""The period of an exemplar, from its autocorrelation."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy import fft

from poresynth.errors import ParameterError

__all__ = ["WAVELENGTHS", "Period", "estimate_period", "starting_period"]

CLEAR = 0.25
"""Autocovariance over the variance that a peak of a period has, and by which it stands above the
lowest value before it. Independent crops of spinodal
structures and of bone have peaks up to 0.09, lattices 0.4 and more; honeycombs as nature makes them
lie between."""

WAVELENGTHS = 4
"""Wavelengths in a period of a medium that has none of its own: the encoding then repeats less
often than the eye sees, and its octaves still reach the wavelength."""

FADED = 0.1
"""Autocovariance over the variance at which a structure has been left."""

SPREAD = 2.2
"""Wavelengths of a structure over the distance at which it has faded: that of sin(x)/x, the
autocovariance of a shell of wavelengths in all directions."""

SHORTEST = 8
"""Shortest period that is looked for, pixels or voxels: what repeats faster is a grain."""

FINEST = 2
"""Shortest wavelength of the encoding, pixels or voxels: Nyquist's."""

Curve = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Period:
    """What an exemplar repeats after.

    Attributes
    ----------
    length : tuple of float
        Along each axis, pixels or voxels.
    clear : tuple of bool
        Whether it is a peak of the autocorrelation, or, where there is none, four wavelengths.
    """

    length: tuple[float, ...]
    clear: tuple[bool, ...]


def starting_period(
    field: npt.NDArray[np.float32],
    asked: Literal["exemplar", "crop"] | float | tuple[float, ...],
    crop: int,
    bandwidth: int,
) -> Period:
    """Return the period that a training starts from.

    Parameters
    ----------
    field : numpy.ndarray
        As of `estimate_period`.
    asked : {"exemplar", "crop"}, float or tuple of float
        That of the exemplar, that of a crop (a = 1 on the paper's coordinates, which go from −1 to
        1), or so many pixels or voxels.
    crop : int
        Edge of a crop.
    bandwidth : int
        Of the encoding. A multiple of a period is one, too: that of the exemplar is doubled and so
        on until the shortest wavelength of the encoding has two pixels or voxels.

    Raises
    ------
    ParameterError
        If there is not one number an axis.
    """
    axes = field.ndim - 1
    if asked == "crop":
        return Period((float(crop - 1),) * axes, (True,) * axes)
    if asked == "exemplar":
        found = estimate_period(field)
        least = FINEST << bandwidth
        whole = [max(1, math.ceil(least / length)) for length in found.length]
        return Period(tuple(n * t for n, t in zip(whole, found.length, strict=True)), found.clear)
    given = asked if isinstance(asked, tuple) else (asked,) * axes
    if len(given) != axes:
        raise ParameterError("period", asked, f"must be one number, or {axes}")
    return Period(tuple(float(t) for t in given), (True,) * axes)


def estimate_period(field: npt.NDArray[np.float32]) -> Period:
    """Estimate the period along each axis.

    Parameters
    ----------
    field : numpy.ndarray
        Shape (channel, y, x) or (channel, z, y, x).

    Returns
    -------
    Period
        The highest peak of the autocovariance along the axis, refined by a parabola. Where no peak
        is clear, four wavelengths, which are known from the distance at which it fades.

    Notes
    -----
    Lags up to half of the edge are looked at. Peak memory: 16 bytes a voxel.
    """
    found = [_axis(autocovariance(field, axis + 1)) for axis in range(field.ndim - 1)]
    return Period(tuple(length for length, _ in found), tuple(clear for _, clear in found))


def autocovariance(field: npt.NDArray[np.float32], axis: int) -> Curve:
    """Return the autocovariance along an axis over the variance, at lags 0 … half of the edge.

    Each lag is divided by its own number of pairs; channels are summed.
    """
    lines = np.moveaxis(field, axis, -1).astype(np.float64)
    lines = lines - lines.mean(axis=tuple(range(1, lines.ndim)), keepdims=True)
    edge = lines.shape[-1]
    lags = edge // 2 + 1
    size = fft.next_fast_len(edge + lags, real=True)
    total = np.zeros(lags)
    for channel in lines:
        power = np.abs(fft.rfft(channel.reshape(-1, edge), size)) ** 2
        total += fft.irfft(power.sum(0), size)[:lags]
    total /= edge - np.arange(lags)
    return np.asarray(total / total[0])


def _axis(curve: Curve) -> tuple[float, bool]:
    """Return the period along one axis, and whether it is clear."""
    inner = np.arange(SHORTEST, len(curve) - 1)
    peaks = inner[(curve[inner] > curve[inner - 1]) & (curve[inner] >= curve[inner + 1])]
    lowest = np.minimum.accumulate(curve)
    peaks = peaks[(curve[peaks] >= CLEAR) & (curve[peaks] - lowest[peaks] >= CLEAR)]
    if not len(peaks):
        below = np.flatnonzero(curve < FADED)
        faded = int(below[0]) if len(below) else len(curve)
        return WAVELENGTHS * SPREAD * faded, False
    # Multiples of a period are peaks, too: of those about as high as the highest, the nearest.
    peak = int(peaks[curve[peaks] >= 0.8 * curve[peaks].max()][0])
    before, here, after = (float(c) for c in curve[peak - 1 : peak + 2])
    return peak + 0.5 * (before - after) / (before - 2 * here + after), True
