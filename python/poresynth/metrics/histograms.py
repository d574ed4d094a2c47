"""Gray values of each channel: histograms, moments, and matching one distribution to another."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from poresynth import _core
from poresynth.errors import ParameterError
from poresynth.metrics.arguments import as_scalar_volume, whole_number
from poresynth.volume import Volume

__all__ = [
    "ChannelStatistics",
    "IntensityHistogram",
    "channel_statistics",
    "intensity_histogram",
    "match_histogram",
]

Ties = Literal["alike", "random"]
_Voxels = npt.NDArray[Any]
_Curve = npt.NDArray[np.float64]

BINS = 256
"""Bins of values that have no levels of their own."""


@dataclass(frozen=True, eq=False)
class IntensityHistogram:
    """How often each gray value occurs.

    Attributes
    ----------
    edges : numpy.ndarray
        Edges of the bins, ascending, shape (n + 1,); the last bin holds its upper edge.
    counts : numpy.ndarray of int64
        Voxels in each bin of each channel, shape (channels, n).
    """

    edges: _Curve
    counts: npt.NDArray[np.int64]

    @property
    def centres(self) -> _Curve:
        """Centres of the bins: the gray levels themselves if each has a bin, shape (n,)."""
        return np.asarray((self.edges[:-1] + self.edges[1:]) / 2)

    @property
    def density(self) -> _Curve:
        """Probability density of the gray values of each channel, shape (channels, n)."""
        totals = self.counts.sum(axis=1, keepdims=True) * np.diff(self.edges)
        with np.errstate(invalid="ignore"):
            return np.asarray(self.counts / totals)


@dataclass(frozen=True, eq=False)
class ChannelStatistics:
    """Mean, spread and range of each channel; all arrays of shape (channels,).

    Attributes
    ----------
    mean, standard_deviation : numpy.ndarray
        In gray levels; the deviation is that of all voxels (divided by their number).
    minimum, maximum : numpy.ndarray
        In gray levels.
    """

    mean: _Curve
    standard_deviation: _Curve
    minimum: _Curve
    maximum: _Curve


def intensity_histogram(
    volume: Volume | npt.ArrayLike,
    bins: int | None = None,
    *,
    value_range: tuple[float, float] | None = None,
    threads: int = 0,
) -> IntensityHistogram:
    """Return the histogram of the gray values of each channel.

    Parameters
    ----------
    volume : Volume or array_like
        Shape (z, y, x) or (z, y, x, channel), any data type.
    bins : int, optional
        Number of equal bins. If not given, integers of at most 16 bits have a bin for each level
        of the range, and other types 256.
    value_range : (float, float), optional
        Lower edge of the first bin and upper edge of the last; values outside do not count. If not
        given, the range of the volume over all channels.
    threads : int, default 0
        Number of threads; 0 takes all cores. The counts do not depend on it.

    Returns
    -------
    IntensityHistogram
        With a bin for each level, the edges lie halfway between levels; else they are those of
        `numpy.histogram`, and so are the counts.

    Raises
    ------
    ParameterError
        If the volume is empty, not a volume or not finite, or a parameter is outside its range.

    Notes
    -----
    Integers beyond 2⁵³ are counted as their nearest doubles. Peak memory: 1 MB, and the voxels of
    one channel if they do not lie one after the other.
    """
    channels = _channels(volume, "volume")
    if bins is not None:
        bins = whole_number("bins", bins, 1)
    if value_range is None:
        moments = [_core.gray_moments(_flat(c)[0], threads=threads) for c in channels]
        low, high = min(m[2] for m in moments), max(m[3] for m in moments)
    else:
        low, high = (float(edge) for edge in value_range)
        if not (np.isfinite([low, high]).all() and low < high):
            raise ParameterError("value_range", value_range, "must be finite and ascend")
    first = channels[0]
    if bins is None and first.dtype.kind in "bui" and first.dtype.itemsize <= 2:
        start, end = int(np.ceil(low)), int(np.floor(high))
        if start > end:
            raise ParameterError("value_range", value_range, "must hold a level")
        edges = np.arange(start, end + 2, dtype=float) - 0.5
        offset = -int(np.iinfo(first.dtype).min) if first.dtype.kind == "i" else 0
        counts = np.zeros((len(channels), end - start + 1), np.int64)
        for count, channel in zip(counts, channels, strict=True):
            levels = _core.level_counts(
                _bits(_flat(channel)[0]), channel.dtype.kind, threads=threads
            )
            inside = np.arange(start, end + 1) + offset
            known = (inside >= 0) & (inside < len(levels))
            count[known] = levels[inside[known]]
        return IntensityHistogram(edges, counts)
    if low == high:  # as numpy.histogram does
        low, high = low - 0.5, high + 0.5
    edges = np.linspace(low, high, (bins or BINS) + 1)
    if not (np.diff(edges) > 0).all():
        raise ParameterError("bins", bins or BINS, f"must leave a width to bins of {low} … {high}")
    return IntensityHistogram(
        edges,
        np.array(
            [_core.binned_counts(_flat(c)[0], edges, threads=threads) for c in channels], np.int64
        ),
    )


def channel_statistics(volume: Volume | npt.ArrayLike, *, threads: int = 0) -> ChannelStatistics:
    """Return mean, standard deviation and range of the gray values of each channel.

    Parameters
    ----------
    volume : Volume or array_like
        Shape (z, y, x) or (z, y, x, channel), any data type.
    threads : int, default 0
        Number of threads; 0 takes all cores. The values do not depend on it.

    Returns
    -------
    ChannelStatistics

    Raises
    ------
    ParameterError
        If the volume is empty, not a volume or not finite.

    Notes
    -----
    Sums in double precision, the deviation in a pass of its own. Peak memory: the voxels of one
    channel if they do not lie one after the other.
    """
    moments = np.array(
        [_core.gray_moments(_flat(c)[0], threads=threads) for c in _channels(volume, "volume")]
    )
    mean, variance, minimum, maximum = moments.T
    return ChannelStatistics(mean, np.sqrt(variance), minimum, maximum)


def match_histogram(
    source: Volume | npt.ArrayLike,
    reference: Volume | npt.ArrayLike,
    *,
    ties: Ties = "alike",
    seed: int = 0,
    threads: int = 0,
) -> _Voxels:
    """Give a volume the gray values of another, voxel by voxel of the same rank.

    Parameters
    ----------
    source : Volume or array_like
        The volume whose order of gray values is kept, shape (z, y, x) or (z, y, x, channel), any
        data type.
    reference : Volume or array_like
        The volume whose distribution is wanted, of any shape and data type, with as many channels;
        each channel is matched by itself.
    ties : {"alike", "random"}, default "alike"
        What voxels of the same value become. Alike: the same value, that in the middle of their
        ranks, so that the result is a function of the gray value and flat regions stay flat.
        Random: values of their own, dealt by random numbers, so that the distribution is the
        reference's however few levels the source has.
    seed : int, default 0
        Of the random numbers.
    threads : int, default 0
        Number of threads; 0 takes all cores. The values do not depend on it.

    Returns
    -------
    numpy.ndarray
        Shape of the source, data type of the reference, and no value that the reference does not
        have. If both have the same number of voxels and the source has no ties, or they are dealt
        at random, the result has the reference's values exactly, each as often.

    Raises
    ------
    ParameterError
        If a volume is empty, not a volume or not finite, or the numbers of channels differ.

    Notes
    -----
    Rank r of n becomes rank ⌊(2 r + 1) m / 2 n⌋ of m. Integers of at most 16 bits whose ties stay
    alike go through a table; all else is sorted. Peak memory beyond the result: the reference's
    size, and for a sort the source's too; for a value that occurs oftener than 32 000 times, 16
    bytes for each time.
    """
    if ties not in ("alike", "random"):
        raise ParameterError("ties", ties, "must be 'alike' or 'random'")
    seed = whole_number("seed", seed, 0)
    ours, theirs = _channels(source, "source"), _channels(reference, "reference")
    if len(ours) != len(theirs):
        allowed = f"must be the source's number of channels ({len(ours)})"
        raise ParameterError("reference.channels", len(theirs), allowed)
    results = []
    for number, (channel, wanted) in enumerate(zip(ours, theirs, strict=True)):
        # Random numbers follow the position, not the memory order.
        flat, order = _flat(channel, "C" if ties == "random" else None)
        target = _flat(wanted)[0]
        found = np.empty(flat.size, target.dtype)
        _core.match_histogram(
            _bits(flat),
            flat.dtype.kind,
            _bits(target),
            target.dtype.kind,
            _bits(found),
            seed=(seed + number) % 2**64 if ties == "random" else None,
            threads=threads,
        )
        kind = wanted.dtype.newbyteorder("=")
        voxels = found.view(bool) if kind.kind == "b" else found.astype(kind, copy=False)
        results.append(voxels.reshape(channel.shape, order=order))
    several = np.ndim(source.array if isinstance(source, Volume) else source) == 4
    return np.stack(results, axis=-1) if several else results[0]


def _channels(volume: Volume | npt.ArrayLike, name: str) -> list[_Voxels]:
    """Return the channels of a volume, checked, each of shape (z, y, x)."""
    array = volume.array if isinstance(volume, Volume) else np.asanyarray(volume)
    if array.ndim == 4 and array.shape[3] > 0:
        return [as_scalar_volume(array[..., c], name) for c in range(array.shape[3])]
    return [as_scalar_volume(array, name)]


def _flat(array: _Voxels, order: Literal["C"] | None = None) -> tuple[_Voxels, Literal["C", "F"]]:
    """Return the voxels in one row, of a type that the kernels take, and in which order they are.

    They are copied only if they do not lie one after the other in the machine's byte order.
    """
    kind = array.dtype
    if kind.kind == "f" and kind.itemsize not in (4, 8):
        kind = np.dtype(np.float32 if kind.itemsize < 4 else np.float64)
    array = array.astype(kind.newbyteorder("="), copy=False)
    taken: Literal["C", "F"] = "C"
    if order is None and array.flags.f_contiguous and not array.flags.c_contiguous:
        taken = "F"
    flat = array.ravel(order=taken)
    return (flat.view(np.uint8) if flat.dtype.kind == "b" else flat), taken


def _bits(flat: _Voxels) -> _Voxels:
    """Return the voxels as unsigned integers of the same bits."""
    return flat.view(f"u{flat.dtype.itemsize}")
