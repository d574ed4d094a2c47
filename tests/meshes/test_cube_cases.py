"""The table of marching cubes: what makes every surface closed, oriented and free of crossings."""

from __future__ import annotations

from collections import Counter
from itertools import combinations

import numpy as np
import pytest

from poresynth.meshes import Mesh
from poresynth.meshes.crossings import crossings
from poresynth.meshes.cube_cases import EDGES, cube_cases
from poresynth.meshes.isosurface import NEAREST


def triangles(case: int) -> np.ndarray:
    table = cube_cases()
    start = table.start[case]
    return table.edges[start : start + 3 * table.triangles[case]].reshape(-1, 3).astype(np.int32)


def ends(edge: int) -> tuple[int, int]:
    corner, axis = EDGES[edge]
    return corner, corner | 1 << (2 - axis)


def positions(shares: np.ndarray) -> np.ndarray:
    """Return the places (z, y, x) of the vertices, shape (12, 3)."""
    places = np.array([[c >> 2 & 1, c >> 1 & 1, c & 1] for c, _ in EDGES], dtype=float)
    places[np.arange(12), [axis for _, axis in EDGES]] += shares
    return places


def on_one_face(edges: tuple[int, ...]) -> bool:
    corners = [c for edge in edges for c in ends(edge)]
    return any(len({c >> bit & 1 for c in corners}) == 1 for bit in range(3))


@pytest.mark.parametrize("case", range(256))
def test_a_vertex_lies_on_each_edge_between_solid_and_pore(case: int) -> None:
    wanted = {e for e in range(12) if len({case >> c & 1 for c in ends(e)}) == 2}
    assert set(triangles(case).ravel().tolist()) == wanted


@pytest.mark.parametrize("case", range(256))
def test_only_rims_lie_in_faces_of_the_cube(case: int) -> None:
    """Each inner edge has two triangles; each edge of one triangle lies in a face of the cube."""
    count = Counter(
        frozenset(pair) for t in triangles(case).tolist() for pair in combinations(t, 2)
    )
    for pair, triangles_there in count.items():
        assert triangles_there == (1 if on_one_face(tuple(pair)) else 2)


@pytest.mark.parametrize("case", range(1, 255))
def test_neighbouring_cubes_agree_on_their_face(case: int) -> None:
    """The lines on a face depend on its four corners, and cubes run along them in turn."""

    def lines(case: int, bit: int, side: int) -> set[tuple[int, int]]:
        found = set()
        for t in triangles(case).tolist():
            for a, b in zip(t, t[1:] + t[:1], strict=True):
                corners = (*ends(a), *ends(b))
                if all(c >> bit & 1 == side for c in corners):
                    # Named by the corners within the face, as seen from the neighbour.
                    named = [tuple(c & ~(1 << bit) for c in ends(e)) for e in (a, b)]
                    found.add((named[0], named[1]))
        return found

    for bit in range(3):
        far = [c for c in range(8) if c >> bit & 1]
        mirrored = sum(1 << (c & ~(1 << bit)) for c in far if case >> c & 1)
        there = lines(case, bit, 1)
        here = lines(mirrored, bit, 0)
        assert here == {(b, a) for a, b in there}


@pytest.mark.parametrize("case", range(256))
def test_triangles_of_a_cube_do_not_cross(case: int, rng: np.random.Generator) -> None:
    faces = triangles(case)
    if len(faces) < 2:
        return
    shares = rng.random((300, 12))
    shares[::2] = rng.random((150, 12)) < 0.5
    shares = np.clip(shares, NEAREST, 1 - NEAREST)
    cubes = [positions(each) + 3.0 * i for i, each in enumerate(shares)]
    many = np.concatenate([faces + 12 * i for i in range(len(cubes))])
    assert len(crossings(Mesh(np.concatenate(cubes), many))) == 0
