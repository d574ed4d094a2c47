"""Two-point correlation of one phase, of two and of clusters, and the error D2 made of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from poresynth import _core
from poresynth.errors import ParameterError
from poresynth.metrics.arguments import (
    PhaseLike,
    as_phase,
    as_scalar_volume,
    scale_of,
    whole_number,
)
from poresynth.metrics.connectivity import Connectivity, label
from poresynth.preprocess import MOST_LABELS

__all__ = [
    "R_MAX",
    "TwoPointCorrelation",
    "TwoPointMap",
    "TwoPointMatrix",
    "relative_error",
    "two_point_cluster",
    "two_point_correlation",
    "two_point_cross",
    "two_point_error",
    "two_point_map",
    "two_point_matrix",
]

Boundary = Literal["open", "periodic"]
VoxelSize = float | tuple[float, float, float] | None
_Curve = npt.NDArray[np.float64]

R_MAX = 50
"""Longest distance of the two-point error, voxels (zhang_2017 §5, scaffoldgan_2021 §6.2)."""

R_MAX_MAP = 25
"""Longest lag of a map, voxels: (2 · 25 + 1)³ values are 1 MB, which a plot still shows."""


@dataclass(frozen=True, eq=False)
class TwoPointCorrelation:
    """Two-point correlation S₂(r); all arrays of shape (r_max + 1,).

    Attributes
    ----------
    r : numpy.ndarray
        Distances 0, 1, … in voxels; of `radial`, in smallest edges of a voxel.
    radial : numpy.ndarray
        Chance that both ends of a segment lie in the phase, over all segments whose length rounds
        to r; NaN where the volume holds no such segment. The first value is the volume fraction.
    z, y, x : numpy.ndarray
        The same for segments of r voxels along one axis.
    voxel_size : (float, float, float)
        Edges of a voxel along (z, y, x), in ``unit``.
    unit : str
        Unit of lengths; ``"voxel"`` if the scale is unknown.
    """

    r: npt.NDArray[np.int64]
    radial: _Curve
    z: _Curve
    y: _Curve
    x: _Curve
    voxel_size: tuple[float, float, float] = (1.0, 1.0, 1.0)
    unit: str = "voxel"

    @property
    def distance(self) -> _Curve:
        """Distances of `radial` in ``unit``: r times the smallest edge of a voxel."""
        return np.asarray(self.r * min(self.voxel_size), dtype=float)


@dataclass(frozen=True, eq=False)
class TwoPointMap:
    """Two-point correlation S₂ of every lag.

    Attributes
    ----------
    values : numpy.ndarray
        Chance that a segment which begins in the phase ends in it (in the other phase) a lag
        (dz, dy, dx) further on, at ``values[dz + r_max, dy + r_max, dx + r_max]``; NaN where the
        volume holds no such segment. Shape (2 r_max + 1,) * 3.
    lag : numpy.ndarray
        Lags −r_max … r_max along an axis, in voxels, shape (2 r_max + 1,).
    voxel_size : (float, float, float)
        Edges of a voxel along (z, y, x), in ``unit``.
    unit : str
        Unit of lengths; ``"voxel"`` if the scale is unknown.
    """

    values: _Curve
    lag: npt.NDArray[np.int64]
    voxel_size: tuple[float, float, float]
    unit: str


@dataclass(frozen=True, eq=False)
class TwoPointMatrix:
    """Radial two-point correlations between all phases.

    Attributes
    ----------
    phases : numpy.ndarray
        Values of the phases, ascending, shape (n,).
    r : numpy.ndarray
        Distances 0, 1, … in smallest edges of a voxel, shape (r_max + 1,).
    radial : numpy.ndarray
        ``radial[i, j]`` is the chance that one end of a segment lies in phase i and the other in
        phase j, shape (n, n, r_max + 1); symmetric, and 1 at every r in total.
    voxel_size : (float, float, float)
        Edges of a voxel along (z, y, x), in ``unit``.
    unit : str
        Unit of lengths; ``"voxel"`` if the scale is unknown.
    """

    phases: npt.NDArray[np.generic]
    r: npt.NDArray[np.int64]
    radial: _Curve
    voxel_size: tuple[float, float, float]
    unit: str

    @property
    def distance(self) -> _Curve:
        """Distances in ``unit``: r times the smallest edge of a voxel."""
        return np.asarray(self.r * min(self.voxel_size), dtype=float)


def two_point_correlation(
    solid: PhaseLike,
    r_max: int = R_MAX,
    *,
    phase: int | None = None,
    voxel_size: VoxelSize = None,
    boundary: Boundary = "open",
    threads: int = 0,
) -> TwoPointCorrelation:
    """Return the two-point correlation of a phase, over all directions and along the axes.

    Parameters
    ----------
    solid : Volume or array_like
        The phase, shape (z, y, x): bool, or at most 16 values of which 0 is not in it.
    r_max : int, default 50
        Longest distance, in voxels. With a periodic boundary at most half of the smallest edge.
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
    TwoPointCorrelation

    Raises
    ------
    ParameterError
        If a parameter is outside its range.

    Notes
    -----
    S₂ as in Torquato, *Random Heterogeneous Materials* (2002), §2.2. If voxels are not cubic,
    radial distances are counted in their smallest edge, so that a bin holds the segments whose
    length divided by that edge rounds to r.

    Counts of pairs are exact up to about 128³ voxels; beyond, single precision limits S₂ to a
    relative error of 10⁻⁶. Peak memory: 4 to 5 bytes a voxel.
    """
    r_max, scale = whole_number("r_max", r_max, 0), scale_of(solid, voxel_size)
    radial, z, y, x = _core.two_point(
        as_phase(solid, phase=phase),
        r_max,
        boundary=boundary,
        voxel_size=scale.voxel_size,
        threads=threads,
    )
    return TwoPointCorrelation(np.arange(r_max + 1), radial, z, y, x, *scale)


def two_point_cross(
    first: PhaseLike,
    second: PhaseLike,
    r_max: int = R_MAX,
    *,
    voxel_size: VoxelSize = None,
    boundary: Boundary = "open",
    threads: int = 0,
) -> TwoPointCorrelation:
    """Return the two-point cross-correlation of two phases.

    Parameters
    ----------
    first, second : Volume or array_like
        The phases, of the same shape (z, y, x), as for `two_point_correlation`; of labels
        ``labels == 1`` and ``labels == 2``, for instance. They may overlap.
    r_max, voxel_size, boundary, threads
        As for `two_point_correlation`; the voxel size is the first phase's unless given.

    Returns
    -------
    TwoPointCorrelation
        The chance that one end of a segment lies in the first phase and the other in the second,
        over both directions: swapping the phases changes nothing.

    Raises
    ------
    ParameterError
        If a parameter is outside its range, or the shapes differ.

    Notes
    -----
    S₂ of two phases as in Torquato (2002), §2.2; exact as `two_point_correlation` is. Peak memory:
    9 to 10 bytes a voxel.
    """
    r_max, scale = whole_number("r_max", r_max, 0), scale_of(first, voxel_size)
    radial, z, y, x = _core.two_point(
        as_phase(first, "first"),
        r_max,
        boundary=boundary,
        voxel_size=scale.voxel_size,
        second=as_phase(second, "second"),
        threads=threads,
    )
    return TwoPointCorrelation(np.arange(r_max + 1), radial, z, y, x, *scale)


def two_point_matrix(
    labels: PhaseLike,
    r_max: int = R_MAX,
    *,
    voxel_size: VoxelSize = None,
    boundary: Boundary = "open",
    threads: int = 0,
) -> TwoPointMatrix:
    """Return the radial two-point correlations of all phases of a labelled volume.

    Parameters
    ----------
    labels : Volume or array_like
        Shape (z, y, x), at most 16 values; each is a phase, 0 too.
    r_max, voxel_size, boundary, threads
        As for `two_point_correlation`.

    Returns
    -------
    TwoPointMatrix

    Raises
    ------
    ParameterError
        If a parameter is outside its range, or there are too many values.

    Notes
    -----
    Takes the time of a `two_point_correlation` for each phase and about two for each pair of
    phases. Peak memory: 11 to 12 bytes a voxel.
    """
    r_max, scale = whole_number("r_max", r_max, 0), scale_of(labels, voxel_size)
    array = as_scalar_volume(labels, "labels")
    phases = np.empty(0, array.dtype)
    for plane in array:
        phases = np.union1d(phases, plane)
        if len(phases) > MOST_LABELS:
            what = f"more than {MOST_LABELS} values"
            raise ParameterError("labels", what, f"must have at most {MOST_LABELS} values")
    radial = np.empty((len(phases), len(phases), r_max + 1))
    for i, one in enumerate(phases):
        first = np.asarray(array == one)
        for j in range(i + 1):
            curves = _core.two_point(
                first,
                r_max,
                boundary=boundary,
                voxel_size=scale.voxel_size,
                second=np.asarray(array == phases[j]) if j < i else None,
                threads=threads,
            )
            radial[i, j] = radial[j, i] = curves[0]
    return TwoPointMatrix(phases, np.arange(r_max + 1), radial, *scale)


def two_point_map(
    solid: PhaseLike,
    r_max: int = R_MAX_MAP,
    *,
    other: PhaseLike | None = None,
    phase: int | None = None,
    voxel_size: VoxelSize = None,
    boundary: Boundary = "open",
    threads: int = 0,
) -> TwoPointMap:
    """Return the two-point correlation for every lag (dz, dy, dx).

    Parameters
    ----------
    solid : Volume or array_like
        The phase, as for `two_point_correlation`.
    r_max : int, default 25
        Longest lag along each axis, in voxels; the map holds (2 r_max + 1)³ values.
    other : Volume or array_like, optional
        The phase in which segments end, of the same shape; the same phase without it.
    phase, voxel_size, boundary, threads
        As for `two_point_correlation`; ``phase`` is the value in ``solid``.

    Returns
    -------
    TwoPointMap

    Raises
    ------
    ParameterError
        If a parameter is outside its range, or the shapes differ.

    Notes
    -----
    Exact as `two_point_correlation` is. The map of one phase is the same at opposite lags; that of
    two phases is not, its opposite is the map of the phases swapped. Peak memory: 4 to 5 bytes a
    voxel, twice that with ``other``, and 24 bytes a lag.
    """
    r_max, scale = whole_number("r_max", r_max, 0), scale_of(solid, voxel_size)
    values = _core.two_point_map(
        as_phase(solid, phase=phase),
        r_max,
        boundary=boundary,
        second=None if other is None else as_phase(other, "other"),
        threads=threads,
    )
    return TwoPointMap(values, np.arange(-r_max, r_max + 1), *scale)


def two_point_cluster(
    solid: PhaseLike,
    r_max: int = R_MAX,
    *,
    connectivity: Connectivity = 26,
    phase: int | None = None,
    voxel_size: VoxelSize = None,
    boundary: Boundary = "open",
    threads: int = 0,
) -> TwoPointCorrelation:
    """Return the two-point cluster function: the chance that both ends hang together.

    Parameters
    ----------
    solid : Volume or array_like
        The phase, as for `two_point_correlation`.
    r_max : int, default 50
        Longest distance, in voxels. With a periodic boundary at most half of the smallest edge.
    connectivity : {26, 18, 6}, default 26
        Neighbours that touch, as for `label`.
    phase, voxel_size, boundary, threads
        As for `two_point_correlation`. With a periodic boundary clusters go on at the opposite
        face too.

    Returns
    -------
    TwoPointCorrelation
        C₂: at most S₂, and equal to it if all of the phase is one cluster.

    Raises
    ------
    ParameterError
        If a parameter is outside its range.

    Notes
    -----
    C₂ as in Torquato (2002), §2.5, which tells apart media of one S₂ that conduct and that do not.
    Clusters of few runs are counted pair of runs by pair of runs, those of many by Fourier
    transforms of their bounding boxes. Exact as `two_point_correlation` is. Peak memory: 4 bytes a
    voxel (the labels), 5 bytes a voxel of the largest bounding box, 16 bytes a run of voxels along
    the rows, and 32 r_max³ bytes for each thread.
    """
    r_max, scale = whole_number("r_max", r_max, 0), scale_of(solid, voxel_size)
    labels, sizes = label(
        as_phase(solid, phase=phase),
        connectivity=connectivity,
        boundary=boundary,
        threads=threads,
    )
    radial, z, y, x = _core.two_point_cluster(
        labels,
        len(sizes),
        r_max,
        boundary=boundary,
        voxel_size=scale.voxel_size,
        threads=threads,
    )
    return TwoPointCorrelation(np.arange(r_max + 1), radial, z, y, x, *scale)


def two_point_error(
    exemplar: PhaseLike,
    volume: PhaseLike,
    r_max: int = R_MAX,
    *,
    boundary: Boundary = "open",
    threads: int = 0,
) -> float:
    """Return D2, the relative difference of two radial two-point correlations in percent.

    Parameters
    ----------
    exemplar, volume : Volume or array_like
        The phase in the two volumes, shapes (z, y, x), as for `two_point_correlation`.
    r_max, boundary, threads
        As for `two_point_correlation`.

    Returns
    -------
    float
        100 · ‖P_S − P_E‖ / ‖P_E‖ over r = 1 … r_max voxels (zhang_2017 Table 1 times 100,
        scaffoldgan_2021 Table 1), as far as both volumes hold such distances. NaN if the exemplar
        is empty.

    Raises
    ------
    ParameterError
        If a parameter is outside its range.

    Notes
    -----
    Peak memory: 4 to 5 bytes a voxel of the larger volume.
    """
    theirs, ours = (
        two_point_correlation(as_phase(phase, name), r_max, boundary=boundary, threads=threads)
        for name, phase in (("exemplar", exemplar), ("volume", volume))
    )
    return relative_error(ours.radial, theirs.radial)


def normalised(curve: _Curve, fraction: float) -> _Curve:
    """Return the autocovariance over the variance of a curve of S₂ and its volume fraction."""
    return np.asarray((curve - fraction**2) / (fraction - fraction**2))


def relative_error(curve: _Curve, reference: _Curve) -> float:
    """Return 100 · ‖curve − reference‖ / ‖reference‖ without their first values, where both are."""
    both = np.isfinite(curve) & np.isfinite(reference)
    both[0] = False
    norm = float(np.linalg.norm(reference[both]))
    return 100 * float(np.linalg.norm((curve - reference)[both])) / norm if norm else float("nan")
