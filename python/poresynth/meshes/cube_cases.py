"""The 256 cases of marching cubes, derived instead of listed.

A cube has solid and pore corners, and each of its edges between the two carries a vertex. On each
face, lines separate the pore corners from the solid ones; where two solid corners face each other
across a diagonal they are joined. Both cubes at a face follow that rule, so that the lines close to
loops and the surface has no holes. A loop is filled with a fan of triangles, whose inner edges do
not lie in a face of the cube: an edge there could meet one of the neighbouring cube's, and four
triangles would share it. Other fillings than fans cross themselves for some places of the vertices.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

__all__ = ["EDGES", "CubeCases", "cube_cases"]

# Corners are numbered by their offsets (z, y, x), the bits of 0 to 7. An edge is its lower corner
# and the axis (0 z, 1 y, 2 x) along which the other one lies.
EDGES = tuple(
    (corner, axis) for axis in range(3) for corner in range(8) if not corner >> (2 - axis) & 1
)
_INDEX = {frozenset((c, c | 1 << (2 - axis))): i for i, (c, axis) in enumerate(EDGES)}

_Loop = list[int]
_Triangle = tuple[int, int, int]


class CubeCases(NamedTuple):
    """The triangles of each case; bit c of a case says whether corner c is solid.

    Attributes
    ----------
    triangles : numpy.ndarray of int64
        Triangles of each case, shape (256,), at most 5.
    start : numpy.ndarray of int64
        Where they begin in ``edges``, shape (256,).
    edges : numpy.ndarray of uint8
        The edges of the cube that carry the vertices of triangles 0, 1, …, three each, shape (n,);
        anticlockwise seen from the pore.
    """

    triangles: npt.NDArray[np.int64]
    start: npt.NDArray[np.int64]
    edges: npt.NDArray[np.uint8]


@cache
def cube_cases() -> CubeCases:
    """Return the table."""
    triangles = [[t for loop in _loops(case) for t in _fan(loop)] for case in range(256)]
    count = np.array([len(each) for each in triangles])
    edges = np.array([edge for each in triangles for t in each for edge in t], dtype=np.uint8)
    return CubeCases(count, 3 * (np.cumsum(count) - count), edges)


def _faces() -> Iterator[tuple[int, int, int, int]]:
    """Yield the corners of each face, anticlockwise seen from outside."""
    for axis in range(3):
        own, (first, second) = 4 >> axis, (4 >> (axis + 1) % 3, 4 >> (axis + 2) % 3)
        # The axes (z, y, x) are left-handed as (x, y, z) are right-handed.
        ring = (0, second, first | second, first)
        yield ring
        yield (own, *(own | corner for corner in reversed(ring[1:])))


_FACES = tuple(_faces())
_EDGES_OF_FACES = tuple(
    {_INDEX[frozenset((face[i - 1], face[i]))] for i in range(4)} for face in _FACES
)


def _loops(case: int) -> Iterator[_Loop]:
    """Yield the loops of edges that part the solid corners from the pore."""
    solid = [bool(case >> corner & 1) for corner in range(8)]
    after = {}
    for face in _FACES:
        for i in range(4):
            if solid[face[i]] and not solid[face[(i + 1) % 4]]:
                # Past the pore corners that follow, to the next solid one.
                j = i + 1
                while not solid[face[(j + 1) % 4]]:
                    j += 1
                out = _INDEX[frozenset((face[i], face[i + 1 - 4]))]
                after[out] = _INDEX[frozenset((face[j % 4], face[(j + 1) % 4]))]
    while after:
        edge, follower = after.popitem()
        loop = [edge]
        while follower != loop[0]:
            loop.append(follower)
            follower = after.pop(follower)
        yield loop


def _fan(loop: _Loop) -> list[_Triangle]:
    """Fill a loop with triangles around one of its vertices."""
    for turn in range(len(loop)):
        hub, *others = loop[turn:] + loop[:turn]
        inner = ({hub, other} for other in others[1:-1])
        if not any(pair <= face for pair in inner for face in _EDGES_OF_FACES):
            return [(hub, others[i], others[i + 1]) for i in range(len(others) - 1)]
    raise AssertionError(f"no fan fills {loop}")
