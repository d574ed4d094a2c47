"""A phase that is being measured: what several metrics need is computed once."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from poresynth.metrics.chords import ChordLengths, chord_lengths
from poresynth.metrics.connectivity import component_sizes
from poresynth.metrics.correlation import TwoPointCorrelation, two_point_correlation
from poresynth.metrics.fabric import Fabric, mean_intercept_length
from poresynth.metrics.morphometry import Morphometry, morphometry
from poresynth.metrics.parts import Percolation, percolation
from poresynth.metrics.skeleton import MARGIN, EndPoints, end_points, skeletonize
from poresynth.metrics.skeleton_graph import SkeletonGraph, skeleton_graph
from poresynth.metrics.thickness import Thickness, thickness
from poresynth.metrics.topology import (
    BettiNumbers,
    Connectivity,
    betti_numbers,
    connectivity_density,
    euler_number,
)
from poresynth.metrics.transport import (
    Axis,
    Diffusivity,
    Permeability,
    effective_diffusivity,
    permeability,
)

__all__ = ["AXES", "Specimen", "Transport"]


AXES: tuple[Axis, ...] = ("z", "y", "x")


class Transport(NamedTuple):
    """Transport through the pore, by axis.

    Attributes
    ----------
    diffusion : dict of str to Diffusivity
        By ``"z"``, ``"y"``, ``"x"``.
    flow : dict of str to Permeability
        The same.
    """

    diffusion: dict[Axis, Diffusivity]
    flow: dict[Axis, Permeability]


@dataclass(frozen=True, eq=False)
class Specimen:
    """The solid of a volume, with what is found out about it.

    Parameters
    ----------
    solid : numpy.ndarray of bool
        Shape (z, y, x).
    voxel_size : (float, float, float), default (1.0, 1.0, 1.0)
        Edges of a voxel along (z, y, x).
    threads : int, default 0
        Number of threads; 0 takes all cores.
    progress : callable, optional
        Called by the solvers of `transport` with what is being done and the share that is done.

    Notes
    -----
    Lengths are in the edge of a cube of a voxel's volume, so that those of cubic voxels are in
    voxels. Peak memory: what the metrics state, and 5 bytes a voxel for what is kept.
    """

    solid: npt.NDArray[np.bool_]
    voxel_size: tuple[float, float, float] = (1.0, 1.0, 1.0)
    threads: int = 0
    progress: Callable[[str, float], object] | None = None

    @cached_property
    def options(self) -> dict[str, Any]:
        """What functions of lengths take: the voxel size in its mean edge, and the threads."""
        edge = math.prod(self.voxel_size) ** (1 / 3)
        return {
            "voxel_size": tuple(size / edge for size in self.voxel_size),
            "threads": self.threads,
        }

    @cached_property
    def pore(self) -> npt.NDArray[np.bool_]:
        """What is not solid."""
        return ~self.solid

    @cached_property
    def solid_sizes(self) -> npt.NDArray[np.uint64]:
        """Voxels of the 26-connected parts of the solid."""
        return component_sizes(self.solid, threads=self.threads)

    @cached_property
    def pore_sizes(self) -> npt.NDArray[np.uint64]:
        """Voxels of the 6-connected parts of the pore."""
        return component_sizes(self.pore, connectivity=6, threads=self.threads)

    @cached_property
    def euler(self) -> int:
        """Euler number of the solid, 26-connected."""
        return euler_number(self.solid, threads=self.threads)

    @cached_property
    def connectivity(self) -> Connectivity:
        """Connectivity of the solid with the correction of the border."""
        return connectivity_density(self.solid, **self.options)

    @cached_property
    def betti(self) -> BettiNumbers:
        """Parts, tunnels and cavities of the solid."""
        return betti_numbers(self.solid, threads=self.threads)

    @cached_property
    def solid_percolation(self) -> Percolation:
        """Axes along which the solid spans the volume."""
        return percolation(self.solid, threads=self.threads)

    @cached_property
    def pore_percolation(self) -> Percolation:
        """Axes along which the pore spans the volume, 6-connected."""
        return percolation(self.pore, connectivity=6, threads=self.threads)

    @cached_property
    def thickness(self) -> Thickness:
        """Local thickness of the solid."""
        return thickness(self.solid, **self.options)

    @cached_property
    def separation(self) -> Thickness:
        """Local thickness of the pore."""
        return thickness(self.pore, **self.options)

    @cached_property
    def morphometry(self) -> Morphometry:
        """Surface and what follows of it, with the thickness and the separation."""
        lengths = (self.thickness.mean, self.separation.mean)
        solid, pore = (length if math.isfinite(length) else None for length in lengths)
        return morphometry(self.solid, thickness=solid, separation=pore, **self.options)

    @cached_property
    def fabric(self) -> Fabric | None:
        """Mean intercept lengths of the solid; a single plane has none."""
        if min(self.solid.shape) < 2:
            return None
        return mean_intercept_length(self.solid, **self.options)

    @cached_property
    def skeleton(self) -> npt.NDArray[np.bool_]:
        """Curve skeleton of the solid."""
        return skeletonize(self.solid, threads=self.threads)

    @cached_property
    def end_points(self) -> EndPoints:
        """End points of the skeleton, without those near the border."""
        margin = min(MARGIN, min(self.solid.shape) // 4)
        return end_points(self.solid, skeleton=self.skeleton, margin=margin, **self.options)

    @cached_property
    def graph(self) -> SkeletonGraph:
        """Graph of the skeleton."""
        return skeleton_graph(self.skeleton, solid=self.solid, **self.options)

    @cached_property
    def two_point(self) -> TwoPointCorrelation:
        """Two-point correlation of the solid."""
        return two_point_correlation(self.solid, threads=self.threads)

    @cached_property
    def solid_chords(self) -> ChordLengths:
        """Chords of the solid."""
        return chord_lengths(self.solid, **self.options)

    @cached_property
    def pore_chords(self) -> ChordLengths:
        """Chords of the pore."""
        return chord_lengths(self.pore, **self.options)

    @cached_property
    def transport(self) -> Transport:
        """Diffusion and flow through the pore along each axis: minutes."""
        solvers = (("diffusion", effective_diffusivity), ("flow", permeability))
        steps = [(what, solve, axis) for what, solve in solvers for axis in AXES]
        found: dict[tuple[str, str], Any] = {}
        for i, (what, solve, axis) in enumerate(steps):

            def report(stage: str, share: float, i: int = i, step: str = f"{what} {axis}") -> None:
                if self.progress is not None:
                    self.progress(f"{step}: {stage}", (i + share) / len(steps))

            found[what, axis] = solve(self.solid, axis=axis, progress=report, **self.options)
        return Transport(*({axis: found[what, axis] for axis in AXES} for what, _ in solvers))
