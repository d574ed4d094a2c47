"""The parts of a phase: what they are like, which span the volume, and the phase without some."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from poresynth import _core
from poresynth.metrics.arguments import PhaseLike, as_phase, whole_number

__all__ = [
    "ComponentStatistics",
    "Percolation",
    "component_statistics",
    "largest_part",
    "percolation",
    "remove_small_parts",
]

Boundary = Literal["open", "periodic"]
Neighbours = Literal[6, 18, 26]


@dataclass(frozen=True, eq=False)
class ComponentStatistics:
    """Connected components, in C order of their first voxels; positions are voxel indices.

    In a periodic volume a component is seen in one piece: its box starts inside the volume and may
    end beyond the border, and its centroid is in that frame (modulo the shape it is a place in the
    volume). Along an axis on which it goes round the volume it has neither end nor middle: there
    its box is the whole edge and its centroid NaN.

    Attributes
    ----------
    sizes : numpy.ndarray of uint64
        Voxels of each component, shape (n,).
    bounding_boxes : numpy.ndarray of int64
        Start and end (exclusive) along (z, y, x), shape (n, 3, 2).
    centroids : numpy.ndarray of float64
        Mean positions (z, y, x) of the voxels' centres, shape (n, 3).
    spans : numpy.ndarray of bool
        Whether the component spans the volume along (z, y, x), shape (n, 3). Open: it touches both
        opposite faces. Periodic: it goes round, so that its copies in the tiled volume hang
        together.
    labels : numpy.ndarray of uint32 or None
        Shape (z, y, x); 0 outside the phase, else 1, 2, …; None unless asked for.
    """

    sizes: npt.NDArray[np.uint64]
    bounding_boxes: npt.NDArray[np.int64]
    centroids: npt.NDArray[np.float64]
    spans: npt.NDArray[np.bool_]
    labels: npt.NDArray[np.uint32] | None


@dataclass(frozen=True)
class Percolation:
    """Whether a phase spans the volume along (z, y, x), and how much of it does.

    Attributes
    ----------
    percolates : (bool, bool, bool)
        Whether a component spans the volume along each axis.
    fractions : (float, float, float)
        Share of the phase in components that span the volume along each axis; 0 for an empty phase.
    """

    percolates: tuple[bool, bool, bool]
    fractions: tuple[float, float, float]


def component_statistics(
    solid: PhaseLike,
    *,
    phase: int | None = None,
    connectivity: Neighbours = 26,
    boundary: Boundary = "open",
    labels: bool = False,
    threads: int = 0,
) -> ComponentStatistics:
    """Return sizes, bounding boxes and centroids of the connected components of a phase.

    Parameters
    ----------
    solid : Volume or array_like
        The phase, shape (z, y, x): bool, or at most 16 values of which 0 is not in it.
    phase : int, optional
        The value that is the phase, instead of all but 0.
    connectivity : {26, 18, 6}, default 26
        Neighbours that touch: those that share a corner, an edge or a face. If the solid is
        measured with 26, its pore goes with 6.
    boundary : {"open", "periodic"}, default "open"
        Whether components go on at the opposite face.
    labels : bool, default False
        Whether to label the voxels, too; the statistics do not need it.
    threads : int, default 0
        Number of threads; 0 takes all cores. The results do not depend on it.

    Returns
    -------
    ComponentStatistics

    Raises
    ------
    ParameterError
        If a parameter is outside its range.

    Notes
    -----
    Peak memory: 1 bit a voxel, 12 bytes a run of voxels along the rows, 400 bytes a component, and
    4 bytes a voxel for labels.
    """
    array = as_phase(solid, phase=phase)
    return ComponentStatistics(
        *_core.component_statistics(
            array, connectivity=connectivity, boundary=boundary, labels=labels, threads=threads
        )
    )


def percolation(
    solid: PhaseLike,
    *,
    phase: int | None = None,
    connectivity: Neighbours = 26,
    boundary: Boundary = "open",
    threads: int = 0,
) -> Percolation:
    """Tell along which axes a phase spans the volume, and how much of it does.

    Parameters
    ----------
    solid, phase, connectivity, threads
        As for `component_statistics`. For a pore beside a solid of 26 neighbours take 6.
    boundary : {"open", "periodic"}, default "open"
        Open: a component spans an axis if it touches both opposite faces. Periodic: if it goes
        round the volume along the axis, that is, if it has no end there in the tiled volume;
        touching both faces is not enough.

    Returns
    -------
    Percolation

    Raises
    ------
    ParameterError
        If a parameter is outside its range.

    Notes
    -----
    Peak memory: 1 bit a voxel, 12 bytes a run of voxels along the rows and 400 bytes a component.
    """
    found = component_statistics(
        solid, phase=phase, connectivity=connectivity, boundary=boundary, threads=threads
    )
    total = max(int(found.sizes.sum()), 1)
    z, y, x = (float(found.sizes[spans].sum() / total) for spans in found.spans.T)
    return Percolation((z > 0, y > 0, x > 0), (z, y, x))


def remove_small_parts(
    solid: PhaseLike,
    size: int,
    *,
    phase: int | None = None,
    connectivity: Neighbours = 26,
    boundary: Boundary = "open",
    threads: int = 0,
) -> npt.NDArray[np.bool_]:
    """Return a phase without its connected components of fewer than ``size`` voxels.

    Parameters
    ----------
    solid, phase, connectivity, boundary, threads
        As for `component_statistics`.
    size : int
        Voxels of the smallest component that stays; at least 0.

    Returns
    -------
    numpy.ndarray of bool
        Shape (z, y, x), in the memory order of the phase.

    Raises
    ------
    ParameterError
        If a parameter is outside its range.

    Notes
    -----
    Peak memory: 9 bits a voxel (8 for the result) and 12 bytes a run of voxels along the rows.
    """
    size = whole_number("size", size, 0)
    array = as_phase(solid, phase=phase)
    return _core.keep_parts(
        array,
        min(size, array.size + 1),
        connectivity=connectivity,
        boundary=boundary,
        threads=threads,
    )


def largest_part(
    solid: PhaseLike,
    *,
    phase: int | None = None,
    connectivity: Neighbours = 26,
    boundary: Boundary = "open",
    threads: int = 0,
) -> npt.NDArray[np.bool_]:
    """Return the largest connected component of a phase.

    Parameters
    ----------
    solid, phase, connectivity, boundary, threads
        As for `component_statistics`.

    Returns
    -------
    numpy.ndarray of bool
        Shape (z, y, x), in the memory order of the phase. Of several largest components, the one
        whose first voxel comes first in C order; all false for an empty phase.

    Raises
    ------
    ParameterError
        If a parameter is outside its range.

    Notes
    -----
    Peak memory: 9 bits a voxel (8 for the result) and 12 bytes a run of voxels along the rows.
    """
    return _core.keep_parts(
        as_phase(solid, phase=phase),
        None,
        connectivity=connectivity,
        boundary=boundary,
        threads=threads,
    )
