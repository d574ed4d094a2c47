"""Branches with a free end, and the cells that they protrude into (zhang_2017 §4.4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from poresynth import _core
from poresynth.metrics import SkeletonGraph, distance_transform, skeleton_graph, skeletonize
from poresynth.metrics.skeleton import MARGIN

__all__ = ["Network", "Spurs"]

_Floats = npt.NDArray[np.float64]
_Ints = npt.NDArray[np.int64]

NEAR_BORDER = 2.0
"""Voxels beyond its radius that an end must lie inside the volume; the border cuts struts there."""


@dataclass(frozen=True, eq=False)
class Network:
    """A solid with its skeleton.

    Attributes
    ----------
    skeleton : numpy.ndarray of bool
        Shape (z, y, x).
    graph : SkeletonGraph
        Its graph.
    radius : numpy.ndarray of float32
        Distance of each voxel to the pore, in voxels, shape (z, y, x).
    """

    skeleton: npt.NDArray[np.bool_]
    graph: SkeletonGraph
    radius: npt.NDArray[np.float32]

    @classmethod
    def of(
        cls,
        solid: npt.NDArray[np.bool_],
        voxel_size: tuple[float, float, float],
        *,
        threads: int = 0,
    ) -> Network:
        """Thin a solid; peak memory 10 bytes a voxel."""
        skeleton = skeletonize(solid, threads=threads)
        graph = skeleton_graph(skeleton, voxel_size=voxel_size, threads=threads)
        radius = distance_transform(solid, threads=threads)
        # A volume without pore is infinitely far from it.
        np.minimum(radius, sum(solid.shape), out=radius)
        return cls(skeleton, graph, radius.astype(np.float32, copy=False))

    def without(
        self,
        solid: npt.NDArray[np.bool_],
        paths: list[npt.NDArray[np.uint32]],
        manner: str,
        free: npt.NDArray[np.bool_] | None,
        *,
        threads: int = 0,
    ) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.uint64]]:
        """Return the solid without branches, and how many voxels each of them had.

        Parameters
        ----------
        solid : numpy.ndarray of bool
            The solid.
        paths : list of numpy.ndarray of uint32
            Voxels (z, y, x) of each branch, from its free end on.
        manner : {"prune", "cut"}
            Keep the topology, as is right for a free end, or cut the branch in its middle.
        free : numpy.ndarray of bool or None
            Voxels that may change.
        """
        rest = self.skeleton.copy()
        for path in paths:
            rest[tuple(path.T)] = False
        stays = np.argwhere(rest).astype(np.uint32)
        places = np.concatenate([*paths, stays])
        owner = np.repeat(np.arange(len(paths)), [len(path) for path in paths])
        owner = np.concatenate([owner, np.full(len(stays), -1)])
        return _core.remove_branches(
            solid,
            np.ascontiguousarray(places),
            self.radius[tuple(places.T)],
            owner,
            manner=manner,
            free=free,
            threads=threads,
        )


@dataclass(frozen=True, eq=False)
class Spurs:
    """The branches with a free end, those that are shortest beside their cells first.

    Attributes
    ----------
    paths : list of numpy.ndarray of uint32
        Voxels (z, y, x) of each, from the free end to the junction, shape (k, 3).
    length : numpy.ndarray of float64
        Length |b| along the skeleton, from the end to the junction, shape (n,).
    perimeter : numpy.ndarray of float64
        Perimeter L of the cell: the shortest loop through the junction. Where the junction is in no
        loop, the median of the others; infinite if there is none at all. Shape (n,).
    inner : int
        How many have their end where `poresynth.metrics.end_points` counts it.
    """

    paths: list[npt.NDArray[np.uint32]]
    length: _Floats
    perimeter: _Floats
    inner: int

    @property
    def ratio(self) -> _Floats:
        """|b| / L, what θ is compared with, shape (n,)."""
        return self.length / self.perimeter

    @classmethod
    def of(
        cls,
        network: Network,
        *,
        inside: npt.NDArray[np.float32] | None = None,
        threads: int = 0,
    ) -> Spurs:
        """Find the branches of a network that run from a free end to a junction.

        Ends that the border cuts are none, nor are those at the surface of a body, from which
        ``inside`` gives the distance of each voxel.
        """
        graph = network.graph
        ends, kind = graph.branches.nodes, graph.nodes.kind
        is_end = kind[ends] == "end"
        found = np.flatnonzero(is_end.sum(axis=1) == 1)
        found = found[(kind[ends[found]] == "junction").any(axis=1)]
        paths = []
        for branch in found:
            path = graph.path(branch)
            paths.append(path if is_end[branch, 0] else path[::-1])
        tips = np.array([path[0] for path in paths], np.int64).reshape(-1, 3)
        border = np.minimum(tips, np.array(graph.shape) - 1 - tips).min(axis=1, initial=2**31)
        if inside is not None:
            border = np.minimum(border, inside[tuple(tips.T)])
        away = border > network.radius[tuple(tips.T)] + NEAR_BORDER
        found, border = found[away], border[away]
        paths = [path for path, keep in zip(paths, away, strict=True) if keep]
        roots = np.where(is_end[found, 0], ends[found, 1], ends[found, 0])
        perimeter = cell_perimeters(graph, roots, threads=threads)
        length = graph.branches.length[found]
        # Equal ratios come in the order of the graph, which is that of the voxels.
        order = np.argsort(length / perimeter, kind="stable")
        paths = [paths[i] for i in order]
        return cls(paths, length[order], perimeter[order], int((border >= MARGIN).sum()))


def cell_perimeters(graph: SkeletonGraph, nodes: _Ints, *, threads: int = 0) -> _Floats:
    """Return the perimeter of the cell at each of some nodes, shape (n,)."""
    branches = graph.branches
    found = _core.cell_perimeters(
        len(graph.nodes.kind),
        branches.nodes.astype(np.uint32),
        branches.length,
        np.asarray(nodes, np.uint32),
        threads=threads,
    )
    known = found[np.isfinite(found)]
    return np.where(np.isfinite(found), found, np.median(known)) if len(known) else found
