"""Whether a mesh is the surface of a solid, and how large that solid is."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from poresynth.meshes.crossings import Progress, crossings
from poresynth.meshes.mesh import Mesh

__all__ = ["EdgeCounts", "MeshReport", "area", "check", "count_edges", "volume"]

# Triangles that are worked on at a time.
_BLOCK = 1 << 20


@dataclass(frozen=True)
class EdgeCounts:
    """How triangles meet at the edges of a mesh.

    Attributes
    ----------
    edges : int
        Edges.
    open : int
        Edges of one triangle: a hole is there.
    crowded : int
        Edges of three triangles or more: surfaces meet there.
    twisted : int
        Edges of two triangles that look to opposite sides.
    """

    edges: int
    open: int
    crowded: int
    twisted: int


@dataclass(frozen=True)
class MeshReport:
    """What was found of a mesh.

    Attributes
    ----------
    vertices, triangles : int
        Their numbers.
    watertight : bool
        Whether every edge is shared by two triangles.
    oriented : bool
        Whether triangles look to the same side as their neighbours, and on the whole outwards.
    open_edges, crowded_edges, twisted_edges : int
        See `EdgeCounts`.
    crossings : int or None
        Pairs of triangles that pass through each other; None if not looked for.
    shells : int
        Separate surfaces: outer ones and those of cavities.
    euler_characteristic : int
        Vertices − edges + triangles: 2 for each shell less 2 for each handle.
    volume : float
        Volume inside in ``unit``³.
    area : float
        Area in ``unit``².
    size : (float, float, float)
        Extent along (x, y, z) in ``unit``.
    unit : str
        Unit of length.
    """

    vertices: int
    triangles: int
    watertight: bool
    oriented: bool
    open_edges: int
    crowded_edges: int
    twisted_edges: int
    crossings: int | None
    shells: int
    euler_characteristic: int
    volume: float
    area: float
    size: tuple[float, float, float]
    unit: str

    @property
    def printable(self) -> bool:
        """Whether the mesh bounds a solid: closed, oriented, and without crossings if tested."""
        return self.watertight and self.oriented and not self.crossings

    def to_dict(self) -> dict[str, Any]:
        """Return the fields by name, JSON-compatible."""
        return {**asdict(self), "size": list(self.size), "printable": self.printable}


def check(
    mesh: Mesh, *, find_crossings: bool = True, progress: Progress | None = None
) -> MeshReport:
    """Check a mesh.

    Parameters
    ----------
    mesh : Mesh
        The mesh.
    find_crossings : bool, default True
        Whether to look for triangles that pass through each other: some 10 s a million triangles.
        `isosurface` and `smooth` leave none; simplification may.
    progress : callable, optional
        ``progress(stage, fraction)``; what it raises ends the work.

    Returns
    -------
    MeshReport

    Notes
    -----
    Volume by the divergence theorem: the sum over triangles of a · (b × c) / 6. Peak memory: 50
    bytes a triangle, and as for `crossings`.
    """
    edges = count_edges(mesh.faces)
    inside = volume(mesh)
    extent = np.ptp(mesh.bounds, axis=0) if len(mesh.vertices) else np.zeros(3)
    x, y, z = (float(n) for n in extent)
    return MeshReport(
        vertices=len(mesh.vertices),
        triangles=len(mesh.faces),
        watertight=not (edges.open or edges.crowded),
        oriented=not edges.twisted and inside >= 0,
        open_edges=edges.open,
        crowded_edges=edges.crowded,
        twisted_edges=edges.twisted,
        crossings=len(crossings(mesh, progress=progress)) if find_crossings else None,
        shells=_shells(mesh),
        euler_characteristic=len(mesh.vertices) - edges.edges + len(mesh.faces),
        volume=inside,
        area=area(mesh),
        size=(x, y, z),
        unit=mesh.unit,
    )


def count_edges(faces: npt.NDArray[np.int32]) -> EdgeCounts:
    """Count edges by how triangles meet there.

    Parameters
    ----------
    faces : numpy.ndarray
        Shape (m, 3): vertices of each triangle.

    Returns
    -------
    EdgeCounts

    Notes
    -----
    Peak memory: 40 bytes a triangle.
    """
    keys = np.empty(3 * len(faces), dtype=np.int64)
    for i in range(3):
        start, end = faces[:, i].astype(np.int64), faces[:, (i + 1) % 3].astype(np.int64)
        # The last bit is the direction; equal edges come to lie together, one direction first.
        keys[i * len(faces) : (i + 1) * len(faces)] = (
            np.minimum(start, end) << 32 | np.maximum(start, end) << 1 | (start < end)
        )
    keys.sort()
    new = np.empty(len(keys), dtype=bool)
    new[:1] = True
    np.not_equal(keys[1:] >> 1, keys[:-1] >> 1, out=new[1:])
    first = np.flatnonzero(new)
    members = np.diff(first, append=len(keys))
    pairs = first[members == 2]
    return EdgeCounts(
        edges=len(first),
        open=int(np.count_nonzero(members == 1)),
        crowded=int(np.count_nonzero(members > 2)),
        twisted=int(np.count_nonzero(keys[pairs] == keys[pairs + 1])),
    )


def volume(mesh: Mesh) -> float:
    """Return the volume inside a closed mesh, negative if it is inside out."""
    # Around the middle: far from the origin large numbers would cancel.
    middle = mesh.bounds.mean(axis=0) if len(mesh.vertices) else np.zeros(3)
    return sum(
        float(np.einsum("ij,ij->", a - middle, np.cross(b - middle, c - middle))) / 6
        for a, b, c in _corners(mesh)
    )


def area(mesh: Mesh) -> float:
    """Return the area of a mesh."""
    return sum(
        float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()) / 2
        for a, b, c in _corners(mesh)
    )


def _corners(mesh: Mesh) -> Iterator[list[npt.NDArray[np.float64]]]:
    """Yield the corners of the triangles of each block, three arrays of shape (n, 3)."""
    for start in range(0, len(mesh.faces), _BLOCK):
        block = mesh.faces[start : start + _BLOCK]
        yield [mesh.vertices[block[:, i]].astype(np.float64) for i in range(3)]


def _shells(mesh: Mesh) -> int:
    from scipy import sparse

    count = len(mesh.vertices)
    if not len(mesh.faces):
        return 0
    a, b, c = mesh.faces.T
    ones = np.ones(2 * len(a), dtype=bool)
    pairs = (np.concatenate([a, a]), np.concatenate([b, c]))
    graph = sparse.coo_array((ones, pairs), shape=(count, count))
    _, labels = sparse.csgraph.connected_components(graph, directed=False)
    # Vertices that no triangle uses are no shells.
    return len(np.unique(labels[a]))
