"""Runs along the axes: lineal path and chord lengths."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from poresynth import _core
from poresynth.errors import ParameterError
from poresynth.metrics.arguments import PhaseLike, as_phase, scale_of, whole_number

__all__ = ["ChordDistribution", "ChordLengths", "LinealPath", "chord_lengths", "lineal_path"]

Boundary = Literal["open", "periodic"]
Border = Literal["exclude", "include"]
_Curve = npt.NDArray[np.float64]
_Counts = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class LinealPath:
    """Lineal path L(r); all arrays of shape (r_max + 1,).

    Attributes
    ----------
    r : numpy.ndarray
        Distances 0, 1, … in voxels; of `mean`, in smallest edges of a voxel.
    mean : numpy.ndarray
        Mean of the three axes; NaN where an axis is too short.
    z, y, x : numpy.ndarray
        Chance that a segment from one voxel to the r-th after it, along one axis, lies in the
        phase as a whole; NaN where the volume holds no such segment. The first value is the volume
        fraction.
    voxel_size : (float, float, float)
        Edges of a voxel along (z, y, x), in ``unit``.
    unit : str
        Unit of lengths; ``"voxel"`` if the scale is unknown.
    """

    r: npt.NDArray[np.int64]
    mean: _Curve
    z: _Curve
    y: _Curve
    x: _Curve
    voxel_size: tuple[float, float, float]
    unit: str

    @property
    def distance(self) -> _Curve:
        """Distances of `mean` in ``unit``: r times the smallest edge of a voxel."""
        return np.asarray(self.r * min(self.voxel_size), dtype=float)


@dataclass(frozen=True, eq=False)
class ChordDistribution:
    """Lengths of the chords along one axis.

    Attributes
    ----------
    lengths : numpy.ndarray
        1, 2, … voxels up to the volume's edge, in the unit of the voxel size, shape (n,).
    counts : numpy.ndarray of int64
        Chords of each length, shape (n,).
    cut : numpy.ndarray of int64
        Pieces of chords that the border cuts, by the length that is inside, shape (n,). With a
        periodic boundary: lines that lie in the phase as a whole. They are part of `counts` only
        if they were to be included.
    number : int
        Chords in `counts`.
    mean, standard_deviation : float
        Of the lengths in `counts`; NaN without a chord.
    """

    lengths: _Curve
    counts: _Counts
    cut: _Counts
    number: int
    mean: float
    standard_deviation: float

    @property
    def density(self) -> _Curve:
        """Probability density of the lengths, per unit of length; NaN without a chord."""
        if not self.number:
            return np.full(len(self.lengths), np.nan)
        return np.asarray(self.counts / (self.number * self.lengths[0]))


@dataclass(frozen=True, eq=False)
class ChordLengths:
    """Lengths of the chords of a phase.

    Attributes
    ----------
    z, y, x : ChordDistribution
        Chords along each axis.
    mean : float
        Mean of the axes' mean lengths, in ``unit``; NaN if an axis has no chord.
    unit : str
        Unit of lengths; ``"voxel"`` if the scale is unknown.
    """

    z: ChordDistribution
    y: ChordDistribution
    x: ChordDistribution
    mean: float
    unit: str


def lineal_path(
    solid: PhaseLike,
    r_max: int | None = None,
    *,
    phase: int | None = None,
    voxel_size: float | tuple[float, float, float] | None = None,
    boundary: Boundary = "open",
    threads: int = 0,
) -> LinealPath:
    """Return the lineal path of a phase along the axes, and the mean of them.

    Parameters
    ----------
    solid : Volume or array_like
        The phase, shape (z, y, x): bool, or at most 16 values of which 0 is not in it.
    r_max : int, optional
        Longest distance in voxels; the shortest edge less 1 if not given, which every axis has.
    phase : int, optional
        The value that is the phase, instead of all but 0.
    voxel_size : float or (float, float, float), optional
        Edges of a voxel along (z, y, x), instead of the volume's own.
    boundary : {"open", "periodic"}, default "open"
        Open: segments inside the volume, each distance divided by its own number of segments.
        Periodic: segments go on at the opposite face.
    threads : int, default 0
        Number of threads; 0 takes all cores. The values do not depend on it.

    Returns
    -------
    LinealPath

    Raises
    ------
    ParameterError
        If a parameter is outside its range.

    Notes
    -----
    L(r) as in Torquato, *Random Heterogeneous Materials* (2002), §2.4: at most S₂(r), and equal to
    it at r = 0 and 1. Exact. If voxels are not cubic, the mean is taken at multiples of their
    smallest edge, where longer edges are interpolated linearly. Peak memory: 1/8 byte a voxel.
    """
    array, scale = as_phase(solid, phase=phase), scale_of(solid, voxel_size)
    r_max = min(array.shape) - 1 if r_max is None else whole_number("r_max", r_max, 0)
    r = np.arange(r_max + 1)
    curves = []
    for n, (inner, cut) in zip(
        array.shape, _core.run_lengths(array, boundary=boundary, threads=threads), strict=True
    ):
        runs = inner.astype(np.int64)
        endless = int(cut[n]) if boundary == "periodic" else 0
        if not endless:
            runs += cut.astype(np.int64)
        # A run of l voxels holds l − r segments.
        longer = runs.sum() - np.cumsum(runs)
        paths = np.cumsum(longer[::-1])[::-1][:n] + n * endless
        segments = np.full(n, n) if boundary == "periodic" else n - np.arange(n)
        curve = np.full(r_max + 1, np.nan)
        defined = min(n, r_max + 1)
        curve[:defined] = (paths / (array.size // n * segments))[:defined]
        curves.append(curve)
    smallest = min(scale.voxel_size)
    common = [
        _at(r * smallest, r * edge, curve)
        for edge, curve in zip(scale.voxel_size, curves, strict=True)
    ]
    z, y, x = curves
    return LinealPath(r, np.mean(common, axis=0), z, y, x, *scale)


def _at(wanted: _Curve, distance: _Curve, curve: _Curve) -> _Curve:
    """Return a curve at other distances, NaN beyond its own."""
    known = np.isfinite(curve)
    return np.interp(wanted, distance[known], curve[known], right=np.nan)


def chord_lengths(
    solid: PhaseLike,
    *,
    border: Border = "exclude",
    phase: int | None = None,
    voxel_size: float | tuple[float, float, float] | None = None,
    boundary: Boundary = "open",
    threads: int = 0,
) -> ChordLengths:
    """Return the distribution of the chord lengths of a phase along the axes.

    A chord is a run of voxels of the phase along an axis, as long as it can be.

    Parameters
    ----------
    solid : Volume or array_like
        The phase, shape (z, y, x): bool, or at most 16 values of which 0 is not in it.
    border : {"exclude", "include"}, default "exclude"
        What becomes of chords that the border cuts. Their full length is unknown: included, they
        count with the length that is inside, which makes the mean too small; excluded, long chords
        are missed more often than short ones, which does too, but leaves no length that is none.
    phase : int, optional
        The value that is the phase, instead of all but 0.
    voxel_size : float or (float, float, float), optional
        Edges of a voxel along (z, y, x), instead of the volume's own.
    boundary : {"open", "periodic"}, default "open"
        Periodic: chords go on at the opposite face, so that only lines that lie in the phase as a
        whole, which have no end, count as cut.
    threads : int, default 0
        Number of threads; 0 takes all cores. The counts do not depend on it.

    Returns
    -------
    ChordLengths

    Raises
    ------
    ParameterError
        If a parameter is outside its range.

    Notes
    -----
    Torquato, *Random Heterogeneous Materials* (2002), §2.5. Along each axis the lengths of all
    chords, cut ones included, add up to the volume of the phase. Peak memory: 1/8 byte a voxel.
    """
    if border not in ("exclude", "include"):
        raise ParameterError("border", border, "must be 'exclude' or 'include'")
    array, scale = as_phase(solid, phase=phase), scale_of(solid, voxel_size)
    axes = []
    for edge, (inner, cut) in zip(
        scale.voxel_size,
        _core.run_lengths(array, boundary=boundary, threads=threads),
        strict=True,
    ):
        pieces = cut[1:].astype(np.int64)
        counts = inner[1:].astype(np.int64) + (pieces if border == "include" else 0)
        lengths = edge * np.arange(1, len(counts) + 1, dtype=float)
        number = int(counts.sum())
        mean = deviation = float("nan")
        if number:
            mean = float(counts @ lengths) / number
            deviation = float(np.sqrt(counts @ (lengths - mean) ** 2 / number))
        axes.append(ChordDistribution(lengths, counts, pieces, number, mean, deviation))
    z, y, x = axes
    return ChordLengths(z, y, x, float(np.mean([axis.mean for axis in axes])), scale.unit)
