"""Surfaces of fields: closed, oriented, of the right size, whatever the field."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from tests.references.marching_cubes import surface_pieces

from poresynth.errors import ParameterError
from poresynth.meshes import Mesh, check, isosurface
from poresynth.meshes.isosurface import NEAREST


def ball(radius: float, edge: int, centre: float | None = None) -> np.ndarray:
    """Return the signed distance to a sphere, positive inside, in voxels."""
    z, y, x = np.mgrid[:edge, :edge, :edge] - (edge / 2 - 0.5 if centre is None else centre)
    return np.asarray(radius - np.sqrt(z**2 + y**2 + x**2))


fields = hnp.arrays(
    np.float32,
    hnp.array_shapes(min_dims=3, max_dims=3, min_side=1, max_side=6),
    elements=st.sampled_from([-3.0, -1.0, -0.001, 0.0, 0.002, 0.5, 4.0]),
)


@given(fields)
@settings(max_examples=200)
def test_any_field_has_a_closed_oriented_surface_without_crossings(field: np.ndarray) -> None:
    mesh = isosurface(field)
    assert (len(mesh.faces) > 0) == bool((field > 0).any())
    if not len(mesh.faces):
        return
    report = check(mesh)
    assert (report.open_edges, report.crowded_edges, report.twisted_edges) == (0, 0, 0)
    assert report.printable
    assert report.crossings == 0
    # Another library says so, too, of the vertices as files without numbers of them have them.
    merged = trimesh.Trimesh(mesh.vertices, mesh.faces, process=True)
    assert len(merged.vertices) == len(mesh.vertices)
    assert merged.is_volume
    assert merged.volume == pytest.approx(report.volume, rel=1e-5)
    assert merged.area == pytest.approx(report.area, rel=1e-5)


@given(fields)
def test_shells_are_the_parts_of_the_voxels(field: np.ndarray) -> None:
    from scipy import ndimage

    solid = field > 0
    parts = ndimage.label(solid, ndimage.generate_binary_structure(3, 2))[1]
    _, pores = ndimage.label(np.pad(~solid, 1, constant_values=True))
    assert check(isosurface(field), find_crossings=False).shells == parts + pores - 1


@given(fields)
def test_vertices_between_voxels_are_those_of_a_plain_loop(field: np.ndarray) -> None:
    mesh = isosurface(field)
    wanted = surface_pieces(field, NEAREST)
    points = mesh.vertices[:, ::-1]
    inside = ((points > 0) & (points < field.shape)).all(axis=1)
    expected = np.array(wanted).reshape(-1, 3)
    order = [np.lexsort(np.round(p, 4).T) for p in (points[inside], expected)]
    np.testing.assert_allclose(points[inside][order[0]], expected[order[1]], atol=1e-4)


@given(fields, st.integers(1, 200))
def test_slabs_change_nothing(field: np.ndarray, slab_voxels: int) -> None:
    whole, slabs = isosurface(field), isosurface(field, slab_voxels=slab_voxels)
    np.testing.assert_array_equal(whole.vertices, slabs.vertices)
    np.testing.assert_array_equal(whole.faces, slabs.faces)


@pytest.mark.parametrize("shape", [(1, 1, 1), (1, 1, 5), (2, 3, 4), (7, 1, 2)])
def test_a_full_volume_is_a_box_of_its_size(shape: tuple[int, int, int]) -> None:
    z, y, x = shape
    report = check(isosurface(np.ones(shape), voxel_size=(0.5, 2.0, 1.0)))
    assert report.volume == pytest.approx(z * y * x)
    sides = np.array([x, 2 * y, 0.5 * z])
    assert report.size == pytest.approx(tuple(sides))
    assert report.area == pytest.approx(
        2 * (sides[0] * sides[1] + sides[1:].prod() + sides[0] * sides[2])
    )
    assert (report.shells, report.euler_characteristic) == (1, 2)


@pytest.mark.parametrize("shape", [(1, 1, 1), (4, 3, 2)])
def test_an_empty_volume_has_no_surface(shape: tuple[int, int, int]) -> None:
    mesh = isosurface(np.full(shape, -1.0))
    assert mesh.vertices.shape == mesh.faces.shape == (0, 3)
    report = check(mesh)
    assert (report.volume, report.area, report.shells) == (0, 0, 0)


def test_one_voxel_inside_is_an_octahedron() -> None:
    field = np.full((3, 3, 3), -1.0)
    field[1, 1, 1] = 1.0
    report = check(isosurface(field))
    assert (report.vertices, report.triangles) == (6, 8)
    assert report.volume == pytest.approx(1 / 6)


@pytest.mark.parametrize("radius", [8.0, 14.3])
def test_a_ball_has_its_volume_and_area(radius: float) -> None:
    report = check(isosurface(ball(radius, 36)))
    assert report.volume == pytest.approx(4 / 3 * np.pi * radius**3, rel=0.01)
    assert report.area == pytest.approx(4 * np.pi * radius**2, rel=0.01)
    assert (report.shells, report.euler_characteristic) == (1, 2)


def test_two_balls_are_two_shells_and_a_hollow_one_too() -> None:
    two = np.concatenate([ball(6, 16), ball(4, 16)])
    report = check(isosurface(two))
    assert (report.shells, report.euler_characteristic) == (2, 4)
    hollow = np.minimum(ball(12, 32), -ball(6, 32))
    report = check(isosurface(hollow))
    assert (report.shells, report.euler_characteristic) == (2, 4)
    assert report.volume == pytest.approx(4 / 3 * np.pi * (12**3 - 6**3), rel=0.02)


def test_a_ring_has_a_handle() -> None:
    z, y, x = np.mgrid[:16, :40, :40] - np.array([7.5, 19.5, 19.5])[:, None, None, None]
    ring = 4.0 - np.hypot(z, np.hypot(y, x) - 12)
    report = check(isosurface(ring))
    assert (report.shells, report.euler_characteristic) == (1, 0)
    assert report.volume == pytest.approx(2 * np.pi**2 * 12 * 16, rel=0.02)


def test_anisotropic_voxels_and_an_origin() -> None:
    """A ball of radius 9 in voxels of 1 × 1.5 × 0.75."""
    size, shape = (1.0, 1.5, 0.75), (24, 18, 32)
    axes = [(np.arange(n) + 0.5) * s - n * s / 2 for n, s in zip(shape, size, strict=True)]
    z, y, x = np.meshgrid(*axes, indexing="ij")
    mesh = isosurface(
        9 - np.sqrt(z**2 + y**2 + x**2), voxel_size=size, origin=(100.0, 20.0, -5.0), unit="µm"
    )
    report = check(mesh)
    assert report.volume == pytest.approx(4 / 3 * np.pi * 9**3, rel=0.02)
    assert report.size == pytest.approx((18, 18, 18), rel=0.01)
    assert mesh.bounds.mean(axis=0) == pytest.approx([-5 + 12, 20 + 13.5, 100 + 12], abs=0.01)
    assert report.unit == "µm"


def test_what_touches_a_border_is_cut_flat_there() -> None:
    """A half ball: the cut is a disc in the plane of the voxels' outer faces."""
    mesh = isosurface(ball(10, 24, centre=11.5)[12:])
    assert mesh.bounds[0, 2] == 0
    flat = (mesh.vertices[mesh.faces][:, :, 2] == 0).all(axis=1)
    disc = Mesh(mesh.vertices, mesh.faces[flat])
    report = check(disc)
    assert report.area == pytest.approx(np.pi * 10**2, rel=0.02)
    assert report.open_edges > 0
    assert check(mesh).volume == pytest.approx(2 / 3 * np.pi * 10**3, rel=0.02)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.int32, np.float64])
def test_gray_types_give_the_same_surface(dtype: type) -> None:
    gray = np.round(100 + 10 * ball(5, 14)).clip(0, 255)
    expected = isosurface(gray.astype(np.float32), 100.0)
    found = isosurface(np.asfortranarray(gray.astype(dtype)), 100.0)
    np.testing.assert_array_equal(found.vertices, expected.vertices)
    np.testing.assert_array_equal(found.faces, expected.faces)


def test_progress_ends_at_the_whole_and_can_stop_the_work() -> None:
    said: list[float] = []
    isosurface(ball(5, 14), slab_voxels=400, progress=lambda stage, share: said.append(share))
    assert said == sorted(said)
    assert said[-1] == 1
    assert len(said) > 3

    def stop(stage: str, share: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        isosurface(ball(5, 14), progress=stop)


def test_an_image_is_refused() -> None:
    with pytest.raises(ParameterError, match=r"field\.shape"):
        isosurface(np.ones((4, 4)))
