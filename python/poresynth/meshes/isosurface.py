"""The surface of a solid at sub-voxel level: marching cubes in slabs, closed at the borders."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from poresynth.errors import ParameterError
from poresynth.meshes.cube_cases import EDGES, cube_cases
from poresynth.meshes.mesh import Mesh

__all__ = ["isosurface"]

NEAREST = 1 / 256
"""A vertex keeps so far from the centres of voxels, in voxels.

Else the vertices around a voxel just at the level fall onto one place: needles in the mesh, and in
files that know vertices by their positions (STL) surfaces that touch there. It moves a surface by
less than noise does.
"""

SLAB_VOXELS = 1 << 21
"""Voxels of a slab: a few hundred MB of intermediate arrays; larger slabs are no quicker."""

# Empty and repeated planes around the volume, on each side.
_RIM = 2

# What carries vertices, in the order in which those of a plane are numbered: its edges along axis 1
# (y) and axis 2 (x), its nodes on the outer faces, the edges along axis 0 to the next plane.
_KINDS = (1, 2, None, 0)

Progress = Callable[[str, float], object]
_Ids = npt.NDArray[np.int32]


def isosurface(
    field: npt.NDArray[Any],
    level: float = 0.0,
    *,
    voxel_size: tuple[float, float, float] = (1.0, 1.0, 1.0),
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0),
    unit: str = "voxel",
    slab_voxels: int = SLAB_VOXELS,
    progress: Progress | None = None,
) -> Mesh:
    """Lay the surface at which a field crosses a level.

    Parameters
    ----------
    field : numpy.ndarray
        Shape (z, y, x), any real type, finite; solid is what is above the level.
    level : float, default 0.0
        The level.
    voxel_size : (float, float, float), default (1.0, 1.0, 1.0)
        Edges of a voxel along (z, y, x), in ``unit``.
    origin : (float, float, float), default (0.0, 0.0, 0.0)
        Position (z, y, x) of the first voxel's outer corner, in ``unit``.
    unit : str, default "voxel"
        Unit of length.
    slab_voxels : int
        Voxels that are worked on at a time. The mesh does not depend on it.
    progress : callable, optional
        ``progress(stage, fraction)``; what it raises ends the work.

    Returns
    -------
    Mesh
        float32 vertices. Empty where nothing is above the level.

    Raises
    ------
    ParameterError
        If the field does not have three dimensions, or the mesh would have more than 2³¹ vertices.

    Notes
    -----
    Marching cubes (Lorensen and Cline, 1987) with the vertices placed by linear interpolation
    between the centres of voxels. The mesh is closed, consistently oriented, and every edge is
    shared by two triangles, for whatever field: cubes agree on their common face. It does not cross
    itself, since triangles stay in their cube and those of a cube do not cross. Its parts are those
    of the voxels, where solid voxels touch by faces and edges, and pore voxels by faces.

    At the borders the solid is cut flat along the outer faces of the voxels, with sharp edges: a
    block that is solid everywhere gives a box of exactly its size. To this end the outermost voxels
    are repeated on the outer face, and an empty layer lies on the same plane; vertices between the
    two are one per place.

    Peak memory: 24 bytes a vertex, 24 bytes a triangle, and some 150 bytes a voxel of a slab.
    """
    if field.ndim != 3:
        raise ParameterError("field.shape", field.shape, "must be (z, y, x)")
    places = [
        _places(n, size, start)
        for n, size, start in zip(field.shape, voxel_size, origin, strict=True)
    ]
    depth, plane = len(places[0]), len(places[1]) * len(places[2])
    thick = max(1, slab_voxels // plane)
    vertices, faces, known = [], [], 0
    for low in range(0, depth - 1, thick):
        high = min(low + thick, depth - 1)
        slab = _Slab(field, level, low, high)
        points, triangles = slab.mesh(places, known)
        vertices.append(points)
        faces.append(triangles)
        known += len(points)
        if known > np.iinfo(np.int32).max:
            raise ParameterError("field", "its surface", "must have fewer than 2³¹ vertices")
        if progress is not None:
            progress("surface", high / (depth - 1))
    return Mesh(np.concatenate(vertices), np.concatenate(faces), unit)


def _places(edge: int, size: float, start: float) -> npt.NDArray[np.float64]:
    """Return where the nodes along an axis are: centres of voxels, and twice each outer face."""
    inner = np.arange(edge) + 0.5
    return start + size * np.concatenate([[0.0, 0.0], inner, [edge, edge]])


class _Slab:
    """Planes ``low`` to ``high`` of the nodes, both included, and the cubes between them."""

    def __init__(self, field: npt.NDArray[Any], level: float, low: int, high: int) -> None:
        planes = np.clip(np.arange(low, high + 1) - _RIM, 0, field.shape[0] - 1)
        inner = field[planes].astype(np.float32, copy=False)
        self.level = np.float32(level)
        self.low = low
        self.values = np.pad(inner, ((0, 0), (_RIM, _RIM), (_RIM, _RIM)), mode="edge")
        solid = self.values > self.level
        # What lies beyond the repeated planes is empty.
        solid[:, [0, -1]] = solid[:, :, [0, -1]] = False
        depth = field.shape[0] + 2 * _RIM
        self.first, self.last = low == 0, high == depth - 1
        if self.first:
            solid[0] = False
        if self.last:
            solid[-1] = False
        self.solid = solid
        # On the outer faces of the volume, where vertices are at the nodes themselves.
        outer = np.zeros(solid.shape, dtype=bool)
        outer[:, [1, -2]] = outer[:, :, [1, -2]] = True
        for node in (1, depth - 2):
            if low <= node <= high:
                outer[node - low] = True
        self.outer = outer & solid

    def mesh(
        self, places: list[npt.NDArray[np.float64]], known: int
    ) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int32]]:
        """Return the vertices of all planes but the last, and the triangles."""
        carries = np.zeros((len(self.solid), len(_KINDS), *self.solid.shape[1:]), dtype=bool)
        y, x, node, z = (carries[:, kind] for kind in range(len(_KINDS)))
        y[:, 1:-2] = self.solid[:, 1:-2] != self.solid[:, 2:-1]
        x[:, :, 1:-2] = self.solid[:, :, 1:-2] != self.solid[:, :, 2:-1]
        z[:-1] = self.solid[:-1] != self.solid[1:]
        if self.first:
            z[0] = False
        if self.last:
            z[-2] = False
        node[:] = self.outer
        ids = np.cumsum(carries, dtype=np.int32).reshape(carries.shape)
        ids += np.int32(known - 1)
        points = self._points(carries[:-1], places)
        self._share_nodes(ids)
        return points, self._triangles(ids)

    def _points(
        self, carries: npt.NDArray[np.bool_], places: list[npt.NDArray[np.float64]]
    ) -> npt.NDArray[np.float32]:
        plane, kind, row, column = np.unravel_index(np.flatnonzero(carries), carries.shape)
        node = np.ravel_multi_index((plane, row, column), self.values.shape)
        _, stride_y, stride_x = (stride // self.values.itemsize for stride in self.values.strides)
        stride_z = stride_y * self.values.shape[1]
        stride = np.array([stride_y, stride_x, 0, stride_z])[kind]
        flat = self.values.ravel()
        start = flat[node]
        with np.errstate(divide="ignore", invalid="ignore"):
            share = (self.level - start) / (flat[node + stride] - start)
        np.clip(share, NEAREST, 1 - NEAREST, out=share)
        points = np.empty((len(plane), 3), dtype=np.float32)
        for axis, index in enumerate((plane + self.low, row, column)):
            along = np.where(kind == _KINDS.index(axis), share, np.float32(0))
            place = places[axis]
            points[:, 2 - axis] = place[index] + along * np.diff(place, append=place[-1])[index]
        return points

    def _share_nodes(self, ids: npt.NDArray[np.int32]) -> None:
        """Give the edges that leave the volume the vertices of the nodes on its outer faces."""
        y, x, node, z = (ids[:, kind] for kind in range(len(_KINDS)))
        y[:, 0], y[:, -2] = node[:, 1], node[:, -2]
        x[:, :, 0], x[:, :, -2] = node[:, :, 1], node[:, :, -2]
        if self.first:
            z[0] = node[1]
        if self.last:
            z[-2] = node[-2]

    def _triangles(self, ids: npt.NDArray[np.int32]) -> npt.NDArray[np.int32]:
        table = cube_cases()
        near, far = slice(None, -1), slice(1, None)
        cases = np.zeros([n - 1 for n in self.solid.shape], dtype=np.uint8)
        for bit in range(8):
            at = tuple(far if bit >> (2 - axis) & 1 else near for axis in range(3))
            cases |= self.solid[at].view(np.uint8) << np.uint8(bit)
        cubes = np.flatnonzero((cases != 0) & (cases != 255))
        case = cases.ravel()[cubes]
        count = 3 * table.triangles[case]
        # Where each vertex of each triangle stands in the table.
        shift = table.start[case] - (np.cumsum(count) - count)
        entry = np.arange(int(count.sum())) + np.repeat(shift, count)
        # And where its number stands among the ids.
        z, y, x = np.unravel_index(cubes, cases.shape)
        corner = np.ravel_multi_index((z, np.zeros_like(z), y, x), ids.shape)
        offsets = [
            np.ravel_multi_index((c >> 2, _KINDS.index(axis), c >> 1 & 1, c & 1), ids.shape)
            for c, axis in EDGES
        ]
        place = np.repeat(corner, count) + np.array(offsets)[table.edges][entry]
        faces: npt.NDArray[np.int32] = ids.ravel()[place].reshape(-1, 3)
        # Cubes at the edges of the volume are flat.
        a, b, c = faces.T
        flat = (a == b) | (b == c) | (c == a)
        return faces[~flat] if flat.any() else faces
