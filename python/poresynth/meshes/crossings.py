"""Triangles of a mesh that pass through each other."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import numpy.typing as npt

from poresynth.meshes.mesh import Mesh

__all__ = ["Progress", "crossings"]

Progress = Callable[[str, float], object]

# Pairs that are tested at a time.
_BLOCK = 1 << 20
# Sides of a plane nearer than this, relative to the size of the triangles, count as on it: float32
# coordinates are no more exact.
_FLAT = 1e-6

_Indices = npt.NDArray[np.int64]
_Corners = npt.NDArray[np.float64]


def crossings(mesh: Mesh, *, progress: Progress | None = None) -> npt.NDArray[np.int64]:
    """Return the pairs of triangles of which an edge of one passes through the other.

    Parameters
    ----------
    mesh : Mesh
        The mesh.
    progress : callable, optional
        ``progress(stage, fraction)``; what it raises ends the work.

    Returns
    -------
    numpy.ndarray of int64
        Shape (n, 2). Triangles that share an edge are not tested: they could only lie on each
        other.

    Notes
    -----
    Triangles are sorted into grids by their size, a grid for each power of two, so that a triangle
    touches at most eight cells of its own grid; pairs in a common cell whose boxes overlap are
    tested. Contact without passing through, up to rounding, is no crossing. Peak memory: about 400
    bytes a triangle, and some 300 MB.
    """
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    low, high = corners.min(axis=1), corners.max(axis=1)
    extent = (high - low).max(axis=1)
    smallest = extent[extent > 0].min(initial=np.inf)
    if not np.isfinite(smallest):
        return np.zeros((0, 2), dtype=np.int64)
    grid = np.ceil(np.log2(np.maximum(extent, smallest) / smallest)).astype(np.int64)
    found = [np.zeros((0, 2), dtype=np.int64)]
    sizes = np.unique(grid)
    for step, size in enumerate(sizes):
        for first, second in _neighbours(low, high, grid, size, float(smallest * 2.0**size)):
            found.append(np.stack(_crossing(mesh.faces, corners, first, second), axis=1))
            if progress is not None:
                progress("self-intersections", step / len(sizes))
    return np.concatenate(found)


def _neighbours(
    low: _Corners, high: _Corners, grid: _Indices, size: np.int64, edge: float
) -> Iterator[tuple[_Indices, _Indices]]:
    """Yield pairs with overlapping boxes, the larger of which belongs to a grid."""
    members = np.flatnonzero(grid <= size)
    base = low[members].min(axis=0)
    start = np.floor((low[members] - base) / edge).astype(np.int64)
    end = np.floor((high[members] - base) / edge).astype(np.int64)
    span = end - start + 1
    count = span.prod(axis=1)
    entry = np.repeat(np.arange(len(members)), count)
    rank = np.arange(len(entry)) - np.repeat(np.cumsum(count) - count, count)
    cell = np.empty((len(entry), 3), dtype=np.int64)
    for axis in range(3):
        rank, cell[:, axis] = np.divmod(rank, span[entry, axis])
    cell += start[entry]
    del start, end, span, count, rank
    edges = cell.max(axis=0) + 1
    key = (cell[:, 0] * edges[1] + cell[:, 1]) * edges[2] + cell[:, 2]
    order = np.argsort(key, kind="stable")
    key, cell, triangle = key[order], cell[order], members[entry[order]]
    del order, entry
    own = np.flatnonzero(grid[triangle] == size)
    # Everything in the cell of each owner; of two owners the later one takes the pair.
    first = np.searchsorted(key, key[own], side="left")
    last = np.searchsorted(key, key[own], side="right")
    total = np.cumsum(last - first)
    for begin in range(0, int(total[-1]), _BLOCK):
        i, j = np.searchsorted(total, [begin, min(begin + _BLOCK, total[-1])], side="right")
        some = slice(i, j)
        if i == j:
            continue
        pairs = last[some] - first[some]
        a = np.repeat(own[some], pairs)
        b = np.arange(int(pairs.sum())) + np.repeat(first[some] - np.cumsum(pairs) + pairs, pairs)
        kept = (grid[triangle[b]] < size) | (b < a)
        a, b = a[kept], b[kept]
        t, u = triangle[a], triangle[b]
        lower, upper = np.maximum(low[t], low[u]), np.minimum(high[t], high[u])
        kept = (lower <= upper).all(axis=1)
        # Only in the cell of the overlap's lower corner, not in each that both touch.
        here = np.floor((lower - base) / edge).astype(np.int64)
        kept &= (here == cell[a]).all(axis=1)
        yield t[kept], u[kept]


def _crossing(
    faces: npt.NDArray[np.int32], corners: _Corners, first: _Indices, second: _Indices
) -> tuple[_Indices, _Indices]:
    """Return those of the pairs that cross."""
    shared = (faces[first][:, :, None] == faces[second][:, None, :]).any(axis=2)
    kept = shared.sum(axis=1) < 2
    first, second = first[kept], second[kept]
    # Most triangles lie on one side of the other's plane.
    for one, other in ((0, 1), (1, 0)):
        pair = (first, second)
        sides = _sides(corners[pair[one]], corners[pair[other]])
        split = (sides.min(axis=1) < 0) & (sides.max(axis=1) > 0)
        first, second = first[split], second[split]
    a, b = corners[first], corners[second]
    crossed = np.zeros(len(first), dtype=bool)
    for edges, triangle in ((a, b), (b, a)):
        for i in range(3):
            crossed |= _passes(edges[:, i], edges[:, (i + 1) % 3], triangle)
    return first[crossed], second[crossed]


def _sides(plane: _Corners, points: _Corners) -> _Corners:
    """Return on which side of a triangle's plane three points are; 0 on it."""
    a = plane[:, 0]
    normal = np.cross(plane[:, 1] - a, plane[:, 2] - a)
    sides: _Corners = np.einsum("ij,ikj->ik", normal, points - a[:, None])
    size = np.linalg.norm(normal, axis=1) * np.abs(points - a[:, None]).max(axis=(1, 2))
    sides[np.abs(sides) <= _FLAT * size[:, None]] = 0
    return sides


def _passes(start: _Corners, end: _Corners, triangle: _Corners) -> npt.NDArray[np.bool_]:
    """Return whether a segment passes through the inside of a triangle."""
    sides = _sides(triangle, np.stack([start, end, end], axis=1))
    along = end - start
    turns = []
    for i in range(3):
        a, b = triangle[:, i] - start, triangle[:, (i + 1) % 3] - start
        turn = np.einsum("ij,ij->i", along, np.cross(a, b))
        size = np.linalg.norm(along, axis=1) * np.linalg.norm(b - a, axis=1)
        size *= np.abs(triangle - start[:, None]).max(axis=(1, 2))
        turns.append(np.where(np.abs(turn) <= _FLAT * size, 0, turn))
    low, high = np.minimum.reduce(turns), np.maximum.reduce(turns)
    through: npt.NDArray[np.bool_] = (low > 0) | (high < 0)
    return through & (sides[:, 0] * sides[:, 1] < 0)
