"""Local thickness: how thick a phase is at each voxel, and how wide the pores are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from poresynth import _core
from poresynth.errors import ParameterError
from poresynth.metrics.arguments import PhaseLike, as_phase, scale_of

__all__ = [
    "PoreSizeDistribution",
    "Thickness",
    "local_thickness",
    "pore_size_distribution",
    "thickness",
    "trabecular_separation",
    "trabecular_thickness",
]

Boundary = Literal["open", "periodic"]
_Size = float | tuple[float, float, float]
_Numbers = npt.NDArray[np.float64]

MOST_BINS = 1_000_000
"""Finer histograms are a mistake of the unit."""


@dataclass(frozen=True, eq=False)
class Thickness:
    """Distribution of the local thickness of a phase; every voxel of it counts alike.

    Attributes
    ----------
    mean : float
        Mean thickness in ``unit``: a diameter. NaN if the phase is empty, infinite if it fills the
        volume.
    sd : float
        Standard deviation in ``unit``; NaN if the phase is empty or fills the volume.
    max : float
        Largest thickness in ``unit``; NaN if the phase is empty, infinite if it fills the volume.
    edges : numpy.ndarray
        Edges of the histogram's bins in ``unit``, shape (n + 1,), from 0; a bin holds its lower
        edge. Without a finite thickness there is no bin.
    voxels : numpy.ndarray
        Voxels in each bin, shape (n,).
    unit : str
        Unit of lengths.
    """

    mean: float
    sd: float
    max: float
    edges: _Numbers
    voxels: npt.NDArray[np.int64]
    unit: str

    @property
    def shares(self) -> _Numbers:
        """Share of the phase's voxels in each bin, shape (n,)."""
        return np.asarray(self.voxels / max(int(self.voxels.sum()), 1))


@dataclass(frozen=True, eq=False)
class PoreSizeDistribution:
    """Distribution of the pore's volume over the pore size, the local thickness of the pore.

    Attributes
    ----------
    edges : numpy.ndarray
        Edges of the bins in ``unit``, shape (n + 1,), from 0; a bin holds its lower edge. Without a
        finite pore size there is no bin.
    shares : numpy.ndarray
        Share of the pore's volume in each bin, shape (n,).
    density : numpy.ndarray
        Shares divided by the width of the bins, in 1/``unit``, shape (n,).
    cumulative : numpy.ndarray
        Share of the pore's volume that is narrower than each edge, shape (n + 1,), from 0 to 1.
    mean : float
        Mean pore size in ``unit``, a diameter.
    d10, d50, d90 : float
        Diameters in ``unit`` that 10, 50 and 90 % of the pore's volume do not exceed, from the
        voxels themselves, not the bins. NaN if there is no pore, infinite if there is nothing else.
    unit : str
        Unit of lengths.
    """

    edges: _Numbers
    shares: _Numbers
    density: _Numbers
    cumulative: _Numbers
    mean: float
    d10: float
    d50: float
    d90: float
    unit: str


def local_thickness(
    solid: PhaseLike,
    *,
    phase: int | None = None,
    voxel_size: _Size | None = None,
    boundary: Boundary = "open",
    threads: int = 0,
) -> npt.NDArray[np.float32]:
    """Return the diameter of the largest ball inside a phase that contains each voxel.

    Parameters
    ----------
    solid : Volume or array_like
        The phase, shape (z, y, x): bool, or at most 16 values of which 0 is not in it.
    phase : int, optional
        The value that is the phase, instead of all but 0: a label, or 0 for the pore.
    voxel_size : float or (float, float, float), optional
        Edges of a voxel along (z, y, x); those of the volume unless given, 1 for a plain array.
    boundary : {"open", "periodic"}, default "open"
        Open: nothing is known beyond the border, which is no wall: a ball may reach beyond it.
        Periodic: the volume goes on at the opposite face.
    threads : int, default 0
        Number of threads; 0 takes all cores. The values do not depend on it.

    Returns
    -------
    numpy.ndarray of float32
        Shape (z, y, x), in the memory order of the phase: diameters, not radii, in the unit of the
        voxel size; 0 outside the phase. Infinite if no voxel is outside.

    Raises
    ------
    ParameterError
        If a parameter is outside its range.

    Notes
    -----
    The local thickness of Hildebrand and Rüegsegger (J. Microsc. 185, 67 (1997)), for all radii
    that occur, not rounded:

    - The ball of voxel c holds the voxels nearer to its centre than the nearest voxel outside,
      whose centre lies at the distance D(c).
    - The surface lies half a voxel before that centre, so that a ball centred at m has the diameter
      2 D(m) − 1 voxels. The thickest wall of an even number of voxels has its middle between two
      voxels: the diameter of c's ball is the largest of those for m = c and for the 26 places half
      a voxel beside it (centres of its faces, edges, corners). Such a place is level with both of
      the voxels that it lies between, so that a flat wall is as far from it as from them.
    - A voxel gets the largest diameter of the balls that hold it.

    A slab of t voxels across an axis thus has the thickness t, odd or even, in either phase. A
    curved or slanted surface has voxels outside that lie closer than half a voxel: a ball of 24
    voxels across measures about 4 % less, one of 12 voxels 8 %. Measures with 2 D instead make an
    odd slab one voxel thicker; those with 2 D − 1 at voxels only make an even slab one voxel
    thinner.

    If voxels are no cubes, half a voxel is D / 2K, where K is the distance counted in voxels: half
    an edge along an axis, something between for other directions.

    Peak memory besides the result: 2 bytes a voxel of blobs and of foams, for 10 are taken by a
    ball that is not part of a neighbour's; 6 to 8 where a radius is above 127 voxels or voxels are
    no cubes.
    """
    size = scale_of(solid, voxel_size).voxel_size
    array = as_phase(solid, phase=phase)
    return _core.local_thickness(array, size, boundary=boundary, threads=threads)


def thickness(
    solid: PhaseLike,
    *,
    phase: int | None = None,
    voxel_size: _Size | None = None,
    boundary: Boundary = "open",
    bin_width: float | None = None,
    threads: int = 0,
) -> Thickness:
    """Return the distribution of the local thickness of a phase: mean, deviation, histogram.

    Parameters
    ----------
    solid, phase, voxel_size, boundary, threads
        As for `local_thickness`.
    bin_width : float, optional
        Width of the histogram's bins in the unit of the voxel size; the shortest edge of a voxel
        unless given.

    Returns
    -------
    Thickness

    Raises
    ------
    ParameterError
        If a parameter is outside its range.

    Notes
    -----
    Peak memory: as for `local_thickness`.
    """
    scale = scale_of(solid, voxel_size)
    array = as_phase(solid, phase=phase)
    return _distribution(array, scale.voxel_size, scale.unit, boundary, bin_width, threads)[0]


def trabecular_thickness(
    solid: PhaseLike,
    *,
    phase: int | None = None,
    voxel_size: _Size | None = None,
    boundary: Boundary = "open",
    bin_width: float | None = None,
    threads: int = 0,
) -> Thickness:
    """Return Tb.Th: the distribution of the local thickness of the bone, or any solid.

    Parameters
    ----------
    solid, phase, voxel_size, boundary, bin_width, threads
        As for `thickness`.

    Returns
    -------
    Thickness
        Tb.Th is its mean.

    Raises
    ------
    ParameterError
        If a parameter is outside its range.

    Notes
    -----
    Tb.Th of Bouxsein et al. (J. Bone Miner. Res. 25, 1468 (2010)), measured directly in three
    dimensions without a model. Peak memory: as for `local_thickness`.
    """
    return thickness(
        solid,
        phase=phase,
        voxel_size=voxel_size,
        boundary=boundary,
        bin_width=bin_width,
        threads=threads,
    )


def trabecular_separation(
    solid: PhaseLike,
    *,
    phase: int | None = None,
    voxel_size: _Size | None = None,
    boundary: Boundary = "open",
    bin_width: float | None = None,
    threads: int = 0,
) -> Thickness:
    """Return Tb.Sp: the distribution of the local thickness of what is not the solid.

    Parameters
    ----------
    solid, phase, voxel_size, boundary, bin_width, threads
        As for `thickness`; they name the solid, not the space between.

    Returns
    -------
    Thickness
        Tb.Sp is its mean.

    Raises
    ------
    ParameterError
        If a parameter is outside its range.

    Notes
    -----
    Tb.Sp of Bouxsein et al. (J. Bone Miner. Res. 25, 1468 (2010)). Peak memory: as for
    `local_thickness`, and 1 byte a voxel.
    """
    scale = scale_of(solid, voxel_size)
    array = ~as_phase(solid, phase=phase)
    return _distribution(array, scale.voxel_size, scale.unit, boundary, bin_width, threads)[0]


def pore_size_distribution(
    solid: PhaseLike,
    *,
    phase: int | None = None,
    voxel_size: _Size | None = None,
    boundary: Boundary = "open",
    bin_width: float | None = None,
    threads: int = 0,
) -> PoreSizeDistribution:
    """Return how the volume of the pore, which is all but the solid, is spread over pore sizes.

    Parameters
    ----------
    solid, phase, voxel_size, boundary, bin_width, threads
        As for `thickness`; they name the solid, not the pore.

    Returns
    -------
    PoreSizeDistribution

    Raises
    ------
    ParameterError
        If a parameter is outside its range.

    Notes
    -----
    The geometric pore size distribution of Gelb and Gubbins (Langmuir 15, 305 (1999)): the share
    of the pore that balls of a diameter can cover. Peak memory: as for `trabecular_separation`.
    """
    scale = scale_of(solid, voxel_size)
    array = ~as_phase(solid, phase=phase)
    found, values = _distribution(array, scale.voxel_size, scale.unit, boundary, bin_width, threads)
    shares = found.shares
    d10 = d50 = d90 = float("nan")
    if len(values):
        ranks = [-(-share * len(values) // 10) - 1 for share in (1, 5, 9)]
        d10, d50, d90 = (float(v) for v in np.partition(values, ranks)[ranks])
    return PoreSizeDistribution(
        edges=found.edges,
        shares=shares,
        density=np.asarray(shares / np.diff(found.edges)),
        cumulative=np.concatenate([[0.0], np.cumsum(found.voxels) / max(found.voxels.sum(), 1)]),
        mean=found.mean,
        d10=d10,
        d50=d50,
        d90=d90,
        unit=found.unit,
    )


def _distribution(
    array: npt.NDArray[np.bool_],
    size: tuple[float, float, float],
    unit: str,
    boundary: Boundary,
    bin_width: float | None,
    threads: int,
) -> tuple[Thickness, npt.NDArray[np.float32]]:
    """Return the distribution, and the thickness of each voxel of the phase, shape (n,)."""
    width = min(size) if bin_width is None else float(bin_width)
    if not (np.isfinite(width) and width > 0):
        raise ParameterError("bin_width", bin_width, "must be positive")
    local = _core.local_thickness(array, size, boundary=boundary, threads=threads)
    values = local[array]
    del local
    if not len(values) or np.isinf(values[0]):
        value = float("inf") if len(values) else float("nan")
        nothing = np.zeros(0, np.int64)
        return Thickness(value, float("nan"), value, np.zeros(1), nothing, unit), values
    largest = float(values.max())
    # Rounding must not push a thickness of whole bins into the bin below.
    bins = np.floor(values / np.float32(width) + np.float32(1e-4))
    if largest / width >= MOST_BINS:
        allowed = f"must give fewer than {MOST_BINS} bins up to {largest:g} {unit}"
        raise ParameterError("bin_width", width, allowed)
    voxels = np.bincount(bins.astype(np.int32))
    edges = width * np.arange(len(voxels) + 1, dtype=float)
    mean, deviation = float(values.mean(dtype=float)), float(values.std(dtype=float))
    return Thickness(mean, deviation, largest, edges, voxels, unit), values
