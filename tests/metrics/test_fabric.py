"""Mean intercept length and fabric against a slow twin and known shapes."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage
from tests.metrics.shapes import ball, overlapping_spheres, plates
from tests.metrics.strategies import ORDERS, boundaries, phases
from tests.references import secants

from poresynth import metrics
from poresynth.errors import ParameterError
from poresynth.volume import Volume

REACH = {13: 1, 49: 2, 145: 3}
NORMALS = [(1, 0, 0), (1, 1, 0), (1, -1, 1), (1, 2, 3), (0.2, -1, 0.35)]
thick_phases = phases.filter(lambda a: min(a.shape) > 1)


def same(a: metrics.Fabric, b: metrics.Fabric) -> None:
    for field in dataclasses.fields(metrics.Fabric):
        np.testing.assert_array_equal(getattr(a, field.name), getattr(b, field.name))


@settings(max_examples=30)
@given(
    thick_phases,
    st.sampled_from(list(REACH)),
    st.tuples(*[st.sampled_from([0.5, 1.0, 3.0])] * 3),
    boundaries,
)
def test_intercepts_are_those_of_the_twin(
    solid: np.ndarray, directions: int, size: tuple[float, float, float], boundary: str
) -> None:
    steps = secants.steps(REACH[directions])
    changes, pairs = np.transpose([secants.changes(solid, s, boundary) for s in steps])
    steps, changes, pairs = (a[pairs > 0] for a in (steps, changes, pairs))
    vectors = steps * np.array(size)
    lengths = np.linalg.norm(vectors, axis=1)
    found = metrics.mean_intercept_length(
        solid, directions=directions, voxel_size=size, boundary=boundary
    )
    np.testing.assert_allclose(found.directions, vectors / lengths[:, None])
    np.testing.assert_allclose(1 / found.mil, changes / (pairs * lengths))
    np.testing.assert_allclose(found.weights, secants.weights(vectors), atol=1e-7)


@given(thick_phases, boundaries, st.sampled_from(list(ORDERS)))
def test_memory_order_and_threads_do_not_matter(
    solid: np.ndarray, boundary: str, order: str
) -> None:
    expected = metrics.mean_intercept_length(solid, boundary=boundary, threads=1)
    for threads in (2, 8):
        array = ORDERS[order](solid)
        same(metrics.mean_intercept_length(array, boundary=boundary, threads=threads), expected)


def test_types_and_phases(rng: np.random.Generator) -> None:
    labels = rng.integers(0, 3, (8, 9, 10), np.uint8)
    expected = metrics.mean_intercept_length(labels == 2)
    same(metrics.mean_intercept_length(labels, phase=2), expected)
    same(metrics.mean_intercept_length((labels == 2) * np.float32(7)), expected)
    same(metrics.mean_intercept_length(labels != 2), expected)


@pytest.mark.parametrize("normal", NORMALS)
@pytest.mark.parametrize(("thickness", "period"), [(2.5, 6), (4, 9)])
def test_tilted_plates(normal: tuple[float, float, float], thickness: float, period: float) -> None:
    found = metrics.mean_intercept_length(plates(80, thickness, period, normal))
    unit = np.array(normal) / np.linalg.norm(normal)
    cosine = np.abs(found.directions @ unit)
    # How many plates a volume of this size holds is a matter of luck: one surface more or less.
    np.testing.assert_allclose(1 / found.mil, 2 * cosine / period, atol=1 / 80)
    assert abs(found.eigenvectors[:, 2] @ unit) > 0.9999
    assert found.principal_mil[2] == pytest.approx(period / 2, rel=0.04)
    assert found.degree_of_anisotropy > 0.999
    for mil, c in zip((found.mil_z, found.mil_y, found.mil_x), np.abs(unit), strict=True):
        assert 1 / mil == pytest.approx(2 * c / period, abs=1 / 80)


def test_plates_of_stretched_voxels() -> None:
    size, normal = (1.0, 0.7, 1.5), np.array([1, 2, -0.5])
    solid = plates(96, 5, 13, tuple(normal), size)
    found = metrics.mean_intercept_length(Volume(solid, size, "µm"))
    assert found.unit == "µm"
    assert abs(found.eigenvectors[:, 2] @ normal) / np.linalg.norm(normal) > 0.9995
    assert found.principal_mil[2] == pytest.approx(6.5, rel=0.02)
    assert found.degree_of_anisotropy > 0.995


def test_a_path_through_every_voxel_cannot_see_the_tilt() -> None:
    # Such a line enters and leaves at faces of voxels, so that only the faces along each axis
    # count: Σ |u| · faces. Plates at 45° and their mirror images then look alike.
    solid = plates(64, 4, 9, (0, 1, 1))
    faces = [1 / getattr(metrics.mean_intercept_length(solid), f"mil_{axis}") for axis in "zyx"]
    along, across = np.array([0, 1, -1]) / np.sqrt(2), np.array([0, 1, 1]) / np.sqrt(2)
    assert np.abs(along) @ faces == pytest.approx(np.abs(across) @ faces)
    assert np.abs(along) @ faces == pytest.approx(2 / 9, rel=0.05)
    found = metrics.mean_intercept_length(solid)
    densities = 1 / found.mil
    exact = [densities[np.abs(found.directions @ u).argmax()] for u in (along, across)]
    assert exact == pytest.approx([0, 2 / 9], abs=0.01)


def test_straight_rods() -> None:
    n = 64
    y, x = np.meshgrid(np.arange(n) % 16 - 7.6, np.arange(n) % 16 - 7.3, indexing="ij")
    solid = np.repeat((y**2 + x**2 < 25)[None], n, axis=0)
    found = metrics.mean_intercept_length(solid, boundary="periodic")
    assert found.mil_z == np.inf
    assert found.mil_y == pytest.approx(16 * 16 / 20, rel=0.05)
    assert abs(found.eigenvectors[0, 0]) > 0.9999
    assert found.degree_of_anisotropy > 0.99
    assert found.principal_mil[1] == pytest.approx(found.principal_mil[2], rel=0.05)


@pytest.mark.parametrize(("radius", "most"), [(5, 0.08), (8, 0.06), (12, 0.04)])
@pytest.mark.parametrize("directions", [13, 49])
def test_balls_have_no_direction(radius: int, most: float, directions: int) -> None:
    solid = np.pad(ball(radius), 8)
    found = metrics.mean_intercept_length(solid, directions=directions, boundary="periodic")
    assert found.degree_of_anisotropy < most
    surface = 2 / found.mil_mean * solid.size
    assert surface == pytest.approx(4 * np.pi * radius**2, rel=0.03)


def test_a_cubic_lattice_has_no_direction() -> None:
    solid = np.zeros((48, 48, 48), bool)
    z, y, x = (np.arange(48) % 12 < 4 for _ in range(3))
    solid |= z[:, None, None] & y[:, None]
    solid |= z[:, None, None] & x
    solid |= y[:, None] & x
    for directions in REACH:
        found = metrics.mean_intercept_length(solid, directions=directions, boundary="periodic")
        assert found.degree_of_anisotropy == pytest.approx(0, abs=1e-9)
        assert found.mil_z == found.mil_y == found.mil_x


def test_overlapping_spheres() -> None:
    n, radius, count = 128, 10.0, 150
    void = overlapping_spheres(n, radius, count, seed=2)
    found = metrics.mean_intercept_length(void, boundary="periodic")
    exact = 4 * np.pi * radius**2 * count / n**3 * void.mean()
    assert 2 / found.mil_mean == pytest.approx(exact, rel=0.03)
    np.testing.assert_allclose(found.mil, found.mil_mean, rtol=0.06)
    assert found.degree_of_anisotropy < 0.08


def test_the_mean_of_thirteen_directions_is_the_surface(rng: np.random.Generator) -> None:
    solid = ndimage.gaussian_filter(rng.standard_normal((40, 41, 42)), (4, 3, 2)) > 0
    found = metrics.mean_intercept_length(solid, directions=13)
    surface = metrics.surface_area(solid)
    assert 2 / found.mil_mean == pytest.approx(surface.specific_surface)


@settings(max_examples=25)
@given(st.integers(0, 99), st.permutations(range(3)), st.tuples(*[st.booleans()] * 3))
def test_a_turned_volume_has_a_turned_fabric(
    seed: int, axes: list[int], mirrored: tuple[bool, ...]
) -> None:
    noise = np.random.default_rng(seed).standard_normal((24, 25, 26))
    solid = ndimage.gaussian_filter(noise, (3, 2, 1)) > 0
    size = np.array([1.0, 0.8, 1.3])
    before = metrics.mean_intercept_length(solid, voxel_size=tuple(size))
    turned = np.flip(solid, [a for a in range(3) if mirrored[a]]).transpose(axes)
    after = metrics.mean_intercept_length(turned, voxel_size=tuple(size[axes]))
    signs = np.where(mirrored, -1, 1)
    tensor = (before.tensor * np.outer(signs, signs))[np.ix_(axes, axes)]
    np.testing.assert_allclose(after.tensor, tensor, atol=1e-9 * np.abs(tensor).max())
    np.testing.assert_allclose(after.principal_mil, before.principal_mil, rtol=1e-6)
    assert after.degree_of_anisotropy == pytest.approx(before.degree_of_anisotropy)
    lengths = np.array([before.mil_z, before.mil_y, before.mil_x])[axes]
    np.testing.assert_allclose([after.mil_z, after.mil_y, after.mil_x], lengths)


def test_the_tensor_is_made_of_its_axes(rng: np.random.Generator) -> None:
    solid = ndimage.gaussian_filter(rng.standard_normal((32, 32, 32)), (5, 3, 2)) > 0
    found = metrics.mean_intercept_length(solid)
    again = found.eigenvectors @ np.diag(found.eigenvalues) @ found.eigenvectors.T
    np.testing.assert_allclose(again, found.tensor, atol=1e-12)
    assert (np.diff(found.eigenvalues) >= 0).all()
    np.testing.assert_allclose(found.principal_mil, 1 / np.sqrt(found.eigenvalues))
    assert abs(found.eigenvectors[0, 0]) > 0.9
    assert found.degree_of_anisotropy == pytest.approx(1 - found.axis_ratio**-2)
    assert found.weights.sum() == pytest.approx(1)


@given(thick_phases, st.tuples(*[st.integers(0, 9)] * 3))
def test_a_periodic_volume_may_be_rolled(solid: np.ndarray, shift: tuple[int, int, int]) -> None:
    rolled = np.roll(solid, shift, axis=(0, 1, 2))
    same(*(metrics.mean_intercept_length(s, boundary="periodic") for s in (solid, rolled)))


@pytest.mark.parametrize("fill", [False, True])
def test_nothing_to_intercept(fill: bool) -> None:
    found = metrics.mean_intercept_length(np.full((4, 5, 6), fill))
    assert (found.mil == np.inf).all()
    assert found.mil_z == found.mil_y == found.mil_x == found.mil_mean == np.inf
    assert not found.tensor.any()
    assert np.isnan(found.degree_of_anisotropy)
    assert np.isnan(found.axis_ratio)


@pytest.mark.parametrize(
    ("shape", "options", "parameter"),
    [
        ((4, 4, 4), {"directions": 100}, "directions"),
        ((4, 4, 4), {"boundary": "mirror"}, "boundary"),
        ((4, 4, 4), {"voxel_size": -1.0}, "voxel_size"),
        ((1, 4, 4), {}, "solid.shape"),
    ],
)
def test_bad_parameters_are_named(
    shape: tuple[int, int, int], options: dict[str, object], parameter: str
) -> None:
    with pytest.raises(ParameterError, match=rf"^{parameter} = .*: must be "):
        metrics.mean_intercept_length(np.ones(shape, bool), **options)
