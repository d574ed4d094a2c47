"""The graph of a skeleton: nodes, branches, loops."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from poresynth import _core
from poresynth.errors import MissingExtraError, ParameterError
from poresynth.metrics.arguments import PhaseLike, as_phase, scale_of
from poresynth.metrics.distance import distance_transform

__all__ = ["Branches", "Nodes", "SkeletonGraph", "skeleton_graph"]

_Floats = npt.NDArray[np.float64]
_Ints = npt.NDArray[np.int64]

# In the order of the numbers that `_core.skeleton_graph` gives.
_KINDS = np.array(["isolated", "end", "junction", "ring"])


@dataclass(frozen=True, eq=False)
class Nodes:
    """The nodes of a skeleton graph; n is their number.

    Attributes
    ----------
    centroid : numpy.ndarray of float64
        Centroid (z, y, x) of the node's voxels, in voxels, shape (n, 3).
    kind : numpy.ndarray of str
        "end": a voxel with one neighbour. "junction": touching voxels with more than two
        neighbours. "isolated": a voxel without neighbours. "ring": the first voxel of a closed
        curve that has no junction. Shape (n,).
    degree : numpy.ndarray of int64
        Branches that end here; one that starts and ends here counts twice. Shape (n,).
    size : numpy.ndarray of int64
        Number of voxels, shape (n,).
    component : numpy.ndarray of int64
        The connected component of the skeleton, from 0, shape (n,).
    """

    centroid: _Floats
    kind: npt.NDArray[np.str_]
    degree: _Ints
    size: _Ints
    component: _Ints


@dataclass(frozen=True, eq=False)
class Branches:
    """The branches of a skeleton graph; m is their number.

    Attributes
    ----------
    nodes : numpy.ndarray of int64
        The nodes at both ends, shape (m, 2).
    type : numpy.ndarray of int64
        As skan's: 0 from end to end, 1 from end to junction, 2 from junction to junction, 3 a
        closed curve without a junction. Shape (m,).
    length : numpy.ndarray of float64
        Length along the voxel centres, from centroid to centroid of the nodes, in ``unit``, shape
        (m,).
    euclidean : numpy.ndarray of float64
        Straight distance between the nodes, in ``unit``, shape (m,).
    tortuosity : numpy.ndarray of float64
        ``length / euclidean``, at least 1; NaN for a branch that returns to its node. Shape (m,).
    thickness : numpy.ndarray of float64
        Mean thickness (diameter) along the branch's voxels, in ``unit``; NaN if neither a solid nor
        a thickness was given. Shape (m,).
    thickness_deviation : numpy.ndarray of float64
        Standard deviation of the same, shape (m,).
    voxels : numpy.ndarray of uint32
        Voxels (z, y, x) of all branches one after another, each from its first node to its second,
        shape (k, 3). The voxel of an end belongs to its branch, those of a junction to none.
    starts : numpy.ndarray of int64
        Where each branch's voxels begin, and k, shape (m + 1,).
    """

    nodes: _Ints
    type: _Ints
    length: _Floats
    euclidean: _Floats
    tortuosity: _Floats
    thickness: _Floats
    thickness_deviation: _Floats
    voxels: npt.NDArray[np.uint32]
    starts: _Ints


@dataclass(frozen=True, eq=False)
class SkeletonGraph:
    """The graph of a skeleton.

    Attributes
    ----------
    nodes : Nodes
        Ends and junctions.
    branches : Branches
        What runs between them.
    shape : (int, int, int)
        Shape of the volume in voxels.
    voxel_size : (float, float, float)
        Edges of a voxel along (z, y, x), in ``unit``.
    unit : str
        Unit of lengths.
    """

    nodes: Nodes
    branches: Branches
    shape: tuple[int, int, int]
    voxel_size: tuple[float, float, float]
    unit: str

    @property
    def components(self) -> int:
        """Number of connected components."""
        return int(self.nodes.component.max(initial=-1)) + 1

    @property
    def loops(self) -> int:
        """Number of independent loops: branches − nodes + components, b₁ of the graph."""
        return len(self.branches.nodes) - len(self.nodes.kind) + self.components

    @property
    def junctions(self) -> int:
        """Number of junctions."""
        return int(np.count_nonzero(self.nodes.kind == "junction"))

    @property
    def end_points(self) -> int:
        """Number of end points, those at the border too; see `end_points` for a margin."""
        return int(np.count_nonzero(self.nodes.kind == "end"))

    @property
    def end_point_density(self) -> float:
        """End points per unit of volume, 1/``unit``³."""
        return self.end_points / float(np.prod(self.shape) * np.prod(self.voxel_size))

    def path(self, branch: int) -> npt.NDArray[np.uint32]:
        """Return the voxels of a branch.

        Parameters
        ----------
        branch : int
            Its number.

        Returns
        -------
        numpy.ndarray of uint32
            Voxels (z, y, x), shape (k, 3).

        Raises
        ------
        ParameterError
            If there is no such branch.
        """
        count = len(self.branches.nodes)
        if not 0 <= branch < count:
            raise ParameterError("branch", branch, f"must be from 0 to {count - 1}")
        return self.branches.voxels[self.branches.starts[branch] : self.branches.starts[branch + 1]]

    def to_table(self) -> dict[str, npt.NDArray[Any]]:
        """Return one row a branch, with the names of skan's ``summarize(…, separator="-")``.

        Returns
        -------
        dict of str to numpy.ndarray
            Columns; ``pandas.DataFrame(graph.to_table())`` makes a table of them. The pixel values
            are the thickness. Image coordinates are in voxels, coordinates and distances in
            ``unit``. A node is one number, where skan counts each voxel of a junction.
        """
        source, target = self.branches.nodes.T
        table: dict[str, npt.NDArray[Any]] = {
            "skeleton-id": self.nodes.component[source],
            "node-id-src": source,
            "node-id-dst": target,
            "branch-distance": self.branches.length,
            "branch-type": self.branches.type,
            "mean-pixel-value": self.branches.thickness,
            "stdev-pixel-value": self.branches.thickness_deviation,
        }
        for prefix, size in (("image-coord", (1.0, 1.0, 1.0)), ("coord", self.voxel_size)):
            for name, nodes in (("src", source), ("dst", target)):
                places = self.nodes.centroid[nodes] * size
                table |= {f"{prefix}-{name}-{axis}": places[:, axis] for axis in range(3)}
        return table | {"euclidean-distance": self.branches.euclidean}

    def to_networkx(self) -> Any:
        """Return the graph as networkx knows it.

        Returns
        -------
        networkx.MultiGraph
            Nodes have ``centroid``, ``kind``, ``size`` and ``component``; edges, whose keys are the
            numbers of the branches, have ``length``, ``euclidean``, ``tortuosity``, ``thickness``
            and ``type``; the graph has ``unit`` and ``voxel_size``.

        Raises
        ------
        MissingExtraError
            If networkx is not installed.
        """
        try:
            import networkx
        except ImportError as error:
            raise MissingExtraError("a networkx graph", "graph") from error
        graph = networkx.MultiGraph(unit=self.unit, voxel_size=self.voxel_size)
        nodes, branches = self.nodes, self.branches
        for i, place in enumerate(nodes.centroid.tolist()):
            size, component = int(nodes.size[i]), int(nodes.component[i])
            kind = str(nodes.kind[i])
            graph.add_node(i, centroid=tuple(place), kind=kind, size=size, component=component)
        names = ("length", "euclidean", "tortuosity", "thickness", "type")
        columns = [getattr(branches, name).tolist() for name in names]
        for i, (source, target) in enumerate(branches.nodes.tolist()):
            values = {name: column[i] for name, column in zip(names, columns, strict=True)}
            graph.add_edge(source, target, key=i, **values)
        return graph


def skeleton_graph(
    skeleton: PhaseLike,
    *,
    solid: PhaseLike | None = None,
    phase: int | None = None,
    thickness: npt.ArrayLike | None = None,
    voxel_size: float | tuple[float, float, float] | None = None,
    threads: int = 0,
) -> SkeletonGraph:
    """Return the graph of a skeleton.

    Parameters
    ----------
    skeleton : Volume or array_like
        A thin phase, shape (z, y, x), as `skeletonize` makes it.
    solid : Volume or array_like, optional
        What the skeleton was made of, shape (z, y, x). Gives the branches their thickness, and the
        size of the voxels if it is a volume.
    phase : int, optional
        The value that is the phase in ``solid``, instead of all but 0.
    thickness : array_like of float, optional
        Thickness (diameter) at each voxel, in the unit of the voxel size, instead of that of
        ``solid``; shape (z, y, x), looked at where branches are. Any other map may be averaged
        along the branches in the same way.
    voxel_size : float or (float, float, float), optional
        Edges of a voxel along (z, y, x), instead of the volume's own.
    threads : int, default 0
        Number of threads; 0 takes all cores. The graph does not depend on it.

    Returns
    -------
    SkeletonGraph

    Raises
    ------
    ParameterError
        If a parameter is outside its range, or shapes differ.

    Notes
    -----
    Voxels that share a corner touch. A voxel with more than two neighbours belongs to a junction,
    and so does one whose two neighbours touch each other; junction voxels that touch are one node.
    The graph then has the loops of the skeleton, which has those of the solid if it was thinned
    strictly, unless a junction itself encloses a hole.

    The thickness at a voxel of ``solid`` is twice its distance to the nearest void, less the mean
    edge of a voxel, because the void begins half a voxel before the void voxel's centre: exact
    where a flat strut is an odd number of cubic voxels thick, one too little where it is even. It
    is infinite in a volume without void. Other than at the border, void lies only inside the
    volume.

    Peak memory: ⅛ byte a voxel and about 100 bytes a voxel of the skeleton; with ``solid``, 50
    bytes a voxel.
    """
    scale = scale_of(skeleton if solid is None else solid, voxel_size)
    thin = as_phase(skeleton, "skeleton")
    values = None
    if thickness is not None:
        values = np.asanyarray(thickness)
        if values.dtype.kind not in "buif":
            raise ParameterError("thickness", f"array of type {values.dtype}", "must be numbers")
        _check_shape("thickness", values.shape, thin.shape)
    elif solid is not None:
        thick = as_phase(solid, "solid", phase)
        _check_shape("solid", thick.shape, thin.shape)
        distance = distance_transform(thick, voxel_size=scale.voxel_size, threads=threads)
        values = 2 * distance - float(np.mean(scale.voxel_size))
    centroid, kinds, size, ends, length, voxels, starts = _core.skeleton_graph(
        thin, scale.voxel_size, threads=threads
    )
    kind = _KINDS[kinds]
    degree = np.bincount(ends.ravel(), minlength=len(kind))
    nodes = Nodes(centroid, kind, degree, size, _components(ends, len(kind)))
    steps = (centroid[ends[:, 0]] - centroid[ends[:, 1]]) * scale.voxel_size
    euclidean = np.sqrt((steps**2).sum(axis=1))
    tortuosity = np.full(len(ends), np.nan)
    np.divide(length, euclidean, out=tortuosity, where=euclidean > 0)
    type_ = 2 - (kind[ends] == "end").sum(axis=1, dtype=np.int64)
    type_[kind[ends[:, 0]] == "ring"] = 3
    branches = Branches(
        ends, type_, length, euclidean, tortuosity, *_along(values, voxels, starts), voxels, starts
    )
    z, y, x = thin.shape
    return SkeletonGraph(nodes, branches, (z, y, x), scale.voxel_size, scale.unit)


def _check_shape(name: str, shape: tuple[int, ...], wanted: tuple[int, ...]) -> None:
    if shape != wanted:
        raise ParameterError(f"{name}.shape", shape, f"must be that of the skeleton, {wanted}")


def _components(ends: _Ints, count: int) -> _Ints:
    """Return the component of each node, numbered by the components' first nodes."""
    from scipy import sparse

    if count == 0:
        return np.zeros(0, np.int64)
    links = sparse.coo_array((np.ones(len(ends), bool), tuple(ends.T)), (count, count))
    labels = sparse.csgraph.connected_components(links, directed=False)[1]
    _, first, labels = np.unique(labels, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[labels].astype(np.int64)


def _along(
    values: npt.NDArray[Any] | None, voxels: npt.NDArray[np.uint32], starts: _Ints
) -> tuple[_Floats, _Floats]:
    """Return mean and standard deviation of a map along each branch."""
    count = len(starts) - 1
    if values is None or count == 0:
        return np.full(count, np.nan), np.full(count, np.nan)
    found = values[tuple(voxels.T)].astype(np.float64)
    lengths = np.diff(starts)
    mean = np.add.reduceat(found, starts[:-1]) / lengths
    with np.errstate(invalid="ignore"):  # infinite thickness
        squares = (found - np.repeat(mean, lengths)) ** 2
    return mean, np.sqrt(np.add.reduceat(squares, starts[:-1]) / lengths)
