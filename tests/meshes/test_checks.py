"""Checks of meshes: what is wrong with one is found and counted."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from poresynth.errors import ParameterError
from poresynth.meshes import Mesh, check, isosurface, simplify, smooth
from poresynth.meshes.crossings import crossings


def box(size: float = 2.0, shift: float = 0.0) -> Mesh:
    whole = trimesh.creation.box((size, size, size))
    return Mesh(np.array(whole.vertices) + shift, np.array(whole.faces, dtype=np.int32))


def joined(*meshes: Mesh) -> Mesh:
    starts = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    faces = [m.faces + np.int32(s) for m, s in zip(meshes, starts[:-1], strict=True)]
    return Mesh(np.concatenate([m.vertices for m in meshes]), np.concatenate(faces))


def test_a_box() -> None:
    report = check(box())
    assert report.printable
    assert (report.volume, report.area) == pytest.approx((8, 24))
    assert (report.shells, report.euler_characteristic, report.crossings) == (1, 2, 0)
    assert report.size == (2, 2, 2)
    assert report.to_dict()["printable"] is True


def test_far_from_the_origin_the_volume_is_as_exact() -> None:
    assert check(box(shift=1e6)).volume == pytest.approx(8, rel=1e-8)


def test_a_missing_triangle_opens_three_edges() -> None:
    mesh = box()
    report = check(Mesh(mesh.vertices, mesh.faces[1:]))
    assert (report.open_edges, report.watertight, report.printable) == (3, False, False)


def test_a_turned_triangle_twists_three_edges() -> None:
    mesh = box()
    faces = mesh.faces.copy()
    faces[0] = faces[0, ::-1]
    report = check(Mesh(mesh.vertices, faces))
    assert (report.twisted_edges, report.watertight, report.oriented) == (3, True, False)


def test_inside_out_is_not_oriented() -> None:
    mesh = box()
    report = check(Mesh(mesh.vertices, mesh.faces[:, ::-1]))
    assert report.volume == pytest.approx(-8)
    assert (report.twisted_edges, report.oriented, report.printable) == (0, False, False)


def test_boxes_that_share_an_edge_crowd_it() -> None:
    mesh = joined(box(), box(shift=2.0))  # They touch at a corner only:
    assert check(mesh).crowded_edges == 0
    whole = trimesh.creation.box((2, 2, 2))
    beside = whole.copy()
    beside.apply_translation((2, 2, 0))
    both = trimesh.util.concatenate([whole, beside])
    both.merge_vertices()
    report = check(Mesh(np.array(both.vertices), both.faces.astype(np.int32)))
    assert (report.crowded_edges, report.watertight) == (1, False)


@pytest.mark.parametrize("shift", [0.7, 1.3])
def test_boxes_that_overlap_cross(shift: float) -> None:
    mesh = joined(box(), box(shift=shift))
    report = check(mesh)
    assert report.crossings
    assert not report.printable
    assert check(mesh, find_crossings=False).crossings is None


@pytest.mark.parametrize("shift", [2.0, 2.5])
def test_boxes_beside_each_other_do_not(shift: float) -> None:
    assert len(crossings(joined(box(), box(shift=shift)))) == 0


def test_crossings_are_those_of_a_plain_loop(rng: np.random.Generator) -> None:
    """Triangles of very different sizes, tested pair by pair with exact fractions."""
    from fractions import Fraction
    from itertools import combinations

    corners = rng.integers(0, 64, (40, 1, 3)) + rng.integers(-1, 2, (40, 3, 3)) * 2 ** rng.integers(
        0, 6, (40, 1, 1)
    )
    corners = corners[[len({tuple(p) for p in t.tolist()}) == 3 for t in corners]]

    def side(a: list[int], b: list[int], c: list[int], d: list[int]) -> Fraction:
        u, v, w = ([Fraction(p[i] - a[i]) for i in range(3)] for p in (b, c, d))
        return (
            u[0] * (v[1] * w[2] - v[2] * w[1])
            - u[1] * (v[0] * w[2] - v[2] * w[0])
            + u[2] * (v[0] * w[1] - v[1] * w[0])
        )

    def passes(p: list[int], q: list[int], t: list[list[int]]) -> bool:
        if side(*t, p) * side(*t, q) >= 0:
            return False
        turns = [side(p, q, t[i], t[(i + 1) % 3]) for i in range(3)]
        return all(n > 0 for n in turns) or all(n < 0 for n in turns)

    wanted = 0
    for s, t in combinations(corners.tolist(), 2):
        edges = [(s[i], s[i - 1], t) for i in range(3)] + [(t[i], t[i - 1], s) for i in range(3)]
        wanted += any(passes(p, q, other) for p, q, other in edges)
    faces = np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3)
    assert wanted > 5
    assert len(crossings(Mesh(corners.reshape(-1, 3).astype(float), faces))) == wanted


def test_crossings_can_be_stopped() -> None:
    def stop(stage: str, share: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        check(joined(box(), box(shift=1.0)), progress=stop)


@pytest.mark.parametrize(
    ("vertices", "faces", "named"),
    [
        (np.zeros((3, 2)), np.zeros((1, 3), int), r"vertices\.shape"),
        (np.zeros((3, 3)), np.zeros((1, 4), int), r"faces\.shape"),
        (np.zeros((3, 3)), np.array([[0, 1, 3]]), "faces"),
        (np.zeros((3, 3), int), np.array([[0, 1, 2]]), r"vertices\.dtype"),
    ],
)
def test_arrays_that_are_no_mesh(vertices: np.ndarray, faces: np.ndarray, named: str) -> None:
    with pytest.raises(ParameterError, match=named):
        Mesh(vertices, faces)


def test_units() -> None:
    mesh = Mesh(box().vertices, box().faces, "µm")
    assert np.ptp(mesh.in_unit("mm").bounds, axis=0) == pytest.approx([2e-3] * 3)
    assert mesh.in_unit("um") is mesh
    with pytest.raises(ParameterError, match="furlong"):
        mesh.in_unit("furlong")
    with pytest.raises(ParameterError, match=r"mesh\.unit = voxel"):
        box().in_unit("mm")


# Smoothing and simplification


def rough_ball() -> Mesh:
    z, y, x = np.mgrid[:30, :30, :30] - 14.5
    return isosurface(np.where(np.sqrt(z**2 + y**2 + x**2) < 10, 0.5, -0.5))


def test_smoothing_takes_steps_away_and_keeps_the_volume() -> None:
    rough = rough_ball()
    before, after = check(rough), check(smooth(rough, 20))
    assert after.printable
    assert after.volume == pytest.approx(before.volume, rel=0.01)
    perfect = 4 * np.pi * (3 * before.volume / (4 * np.pi)) ** (2 / 3)
    assert after.area - perfect < 0.35 * (before.area - perfect)


def test_smoothing_keeps_cut_faces_flat() -> None:
    z, y, x = np.mgrid[:15, :30, :30] - np.array([0, 14.5, 14.5])[:, None, None, None]
    half = isosurface(10 - np.sqrt(z**2 + y**2 + x**2))
    flat = half.vertices[:, 2] == 0
    assert (smooth(half, 10).vertices[flat, 2] == 0).all()
    corner = isosurface(np.ones((2, 2, 2)))
    assert (smooth(corner, 5).bounds == corner.bounds).all()


def test_smoothing_leaves_no_crossings() -> None:
    """Thin walls and gaps, where plain smoothing makes some."""
    from scipy import ndimage

    from poresynth.meshes.smoothing import GROW, SHRINK, _neighbour_mean

    noise = np.random.default_rng(0).standard_normal((20, 20, 20))
    mesh = isosurface(ndimage.gaussian_filter(noise, 0.8))
    plain, mean = mesh.vertices.copy(), _neighbour_mean(mesh)
    for _ in range(20):
        for step in (SHRINK, GROW):
            plain += np.float32(step) * (mean @ plain - plain)
    assert len(crossings(mesh.with_vertices(plain)))
    smoothed = smooth(mesh, 20)
    assert check(smoothed).printable
    assert check(smoothed).area < 0.95 * check(mesh).area


def test_smoothing_by_nothing_and_by_less() -> None:
    mesh = rough_ball()
    assert smooth(mesh, 0) is mesh
    with pytest.raises(ParameterError, match="iterations"):
        smooth(mesh, -1)


@pytest.mark.parametrize("tolerance", [0.05, 0.2])
def test_simplification_stays_near_its_tolerance(tolerance: float) -> None:
    mesh = smooth(rough_ball(), 20)
    less = simplify(mesh, tolerance)
    report = check(less)
    assert report.printable
    assert report.triangles < 0.8 * len(mesh.faces)
    for one, other in ((mesh, less), (less, mesh)):
        surface = trimesh.Trimesh(other.vertices, other.faces, process=False)
        points = one.vertices[one.faces].mean(axis=1)
        _, distance, _ = trimesh.proximity.closest_point_naive(surface, points[::5])
        assert distance.max() <= 1.5 * tolerance


def test_a_box_is_simplified_to_twelve_triangles() -> None:
    less = simplify(isosurface(np.ones((6, 5, 4)), unit="mm"), 0.01)
    assert len(less.faces) == 12
    assert less.unit == "mm"


def test_what_cannot_be_simplified() -> None:
    mesh = box()
    with pytest.raises(ParameterError, match="tolerance"):
        simplify(mesh, 0.0)
    with pytest.raises(ParameterError, match="watertight"):
        simplify(Mesh(mesh.vertices, mesh.faces[1:]), 0.1)
    empty = Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32))
    assert simplify(empty, 0.1) is empty
