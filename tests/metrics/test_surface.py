"""Surface area against slow twins, scikit-image and known shapes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from skimage.measure import marching_cubes, mesh_surface_area
from tests.metrics.shapes import ball, overlapping_spheres, plates
from tests.metrics.strategies import ORDERS, TYPES, boundaries, phases
from tests.references import secants

from poresynth import metrics
from poresynth.errors import ParameterError
from poresynth.volume import Volume

METHODS = ["crofton", "marching_cubes", "faces"]
methods = st.sampled_from(METHODS)
sizes = st.tuples(*[st.sampled_from([0.5, 1.0, 3.0])] * 3)


def measured(solid: np.ndarray, method: str, **options: object) -> tuple[float, float]:
    found = metrics.surface_area(solid, method=method, **options)
    return found.area, found.specific_surface


@settings(max_examples=30)
@given(phases.filter(lambda a: min(a.shape) > 1), sizes, boundaries)
def test_crofton_is_that_of_the_twin(
    solid: np.ndarray, size: tuple[float, float, float], boundary: str
) -> None:
    steps = secants.steps(1)
    vectors = steps * np.array(size)
    weights, lengths = secants.weights(vectors), np.linalg.norm(vectors, axis=1)
    changes, pairs = np.transpose([secants.changes(solid, s, boundary) for s in steps])
    expected = (
        2 * np.sum(weights * changes / lengths) * np.prod(size),
        2 * np.sum(weights * changes / pairs / lengths),
    )
    found = measured(solid, "crofton", voxel_size=size, boundary=boundary)
    assert found == pytest.approx(expected, rel=1e-7)


@settings(max_examples=60)
@given(phases.filter(lambda a: min(a.shape) > 1 and a.any() and not a.all()), sizes)
def test_marching_cubes_is_that_of_scikit_image(
    solid: np.ndarray, size: tuple[float, float, float]
) -> None:
    vertices, faces, _, _ = marching_cubes(solid.astype(np.float32), 0.5, spacing=size)
    expected = mesh_surface_area(vertices, faces)
    cubes = np.prod([n - 1 for n in solid.shape]) * np.prod(size)
    found = measured(solid, "marching_cubes", voxel_size=size)
    assert found == pytest.approx((expected, expected / cubes), rel=1e-4)


@pytest.mark.parametrize("size", [(1.0, 1.0, 1.0), (0.7, 1.3, 2.9)])
def test_marching_cubes_of_every_pattern(
    size: tuple[float, float, float], rng: np.random.Generator
) -> None:
    # Noise holds all 256 patterns of eight voxels many times.
    solid = rng.random((40, 41, 70)) < 0.5
    vertices, faces, _, _ = marching_cubes(solid.astype(np.float32), 0.5, spacing=size)
    expected = mesh_surface_area(vertices, faces)
    assert measured(solid, "marching_cubes", voxel_size=size)[0] == pytest.approx(expected, 1e-5)


@given(phases, sizes, boundaries)
def test_faces_are_counted(
    solid: np.ndarray, size: tuple[float, float, float], boundary: str
) -> None:
    area, specific = 0.0, 0.0
    for axis, edge in enumerate(size):
        differ = solid ^ np.roll(solid, -1, axis)
        if boundary == "open":
            differ = np.delete(differ, -1, axis)
        count = np.count_nonzero(differ)
        area += count * np.prod(size) / edge
        specific += count / max(differ.size, 1) / edge
    found = measured(solid, "faces", voxel_size=size, boundary=boundary)
    assert found[0] == pytest.approx(area)
    if boundary == "periodic" or solid.size > 1:
        assert found[1] == pytest.approx(specific)


@given(phases, methods, boundaries, st.sampled_from(list(ORDERS)))
def test_memory_order_and_threads_do_not_matter(
    solid: np.ndarray, method: str, boundary: str, order: str
) -> None:
    expected = measured(solid, method, boundary=boundary, threads=1)
    for threads in (2, 8):
        found = measured(ORDERS[order](solid), method, boundary=boundary, threads=threads)
        # Reversed axes are summed in another order.
        assert found == pytest.approx(expected, rel=1e-12, nan_ok=True)
        again = measured(solid, method, boundary=boundary, threads=threads)
        np.testing.assert_array_equal(again, expected)


@pytest.mark.parametrize("dtype", [t for t in TYPES if "float" not in t])
def test_every_type(dtype: str, rng: np.random.Generator) -> None:
    solid = rng.random((5, 6, 7)) < 0.4
    for method in METHODS:
        expected = metrics.surface_area(solid, method=method)
        for value in (1, 100):
            labels = (solid * value).astype(dtype)
            assert metrics.surface_area(labels, method=method) == expected


def test_a_phase_is_named_by_its_label(rng: np.random.Generator) -> None:
    labels = rng.integers(0, 4, (7, 8, 9), np.uint8)
    for method in METHODS:
        found = metrics.surface_area(labels, phase=2, method=method)
        assert found == metrics.surface_area(labels == 2, method=method)


@given(phases, methods, boundaries, st.permutations(range(3)), st.tuples(*[st.booleans()] * 3))
def test_turned_and_mirrored(
    solid: np.ndarray, method: str, boundary: str, axes: list[int], mirrored: tuple[bool, ...]
) -> None:
    size = np.array([1.0, 0.5, 3.0])
    expected = measured(solid, method, boundary=boundary, voxel_size=tuple(size))
    turned = np.flip(solid, [a for a in range(3) if mirrored[a]]).transpose(axes)
    found = measured(turned, method, boundary=boundary, voxel_size=tuple(size[axes]))
    assert found == pytest.approx(expected, rel=1e-9, nan_ok=True)


@given(phases, methods, st.integers(1, 3))
def test_void_around_a_shape_changes_nothing(solid: np.ndarray, method: str, width: int) -> None:
    padded = np.pad(solid, 1)
    expected = measured(padded, method)[0]
    assert measured(np.pad(padded, width), method)[0] == pytest.approx(expected, rel=1e-9)


@given(phases, boundaries, st.sampled_from(["crofton", "faces"]))
def test_the_rest_has_the_same_surface(solid: np.ndarray, boundary: str, method: str) -> None:
    found = measured(~solid, method, boundary=boundary)
    np.testing.assert_array_equal(found, measured(solid, method, boundary=boundary))


@given(phases, methods, st.tuples(*[st.integers(0, 9)] * 3))
def test_a_periodic_volume_may_be_rolled(
    solid: np.ndarray, method: str, shift: tuple[int, int, int]
) -> None:
    expected = measured(solid, method, boundary="periodic")
    rolled = np.roll(solid, shift, axis=(0, 1, 2))
    np.testing.assert_array_equal(measured(rolled, method, boundary="periodic"), expected)
    area, specific = expected
    assert area == pytest.approx(specific * solid.size)


@pytest.mark.parametrize("method", METHODS)
def test_no_voxel_and_all_voxels(method: str) -> None:
    for shape in ((3, 4, 5), (1, 5, 6), (1, 1, 65)):
        for fill in (False, True):
            solid = np.full(shape, fill)
            for boundary in ("open", "periodic"):
                area, specific = measured(solid, method, boundary=boundary)
                assert area == 0
                cubes = method != "marching_cubes" or min(shape) > 1 or boundary == "periodic"
                assert specific == 0 if cubes else np.isnan(specific)
    found = metrics.surface_area(np.ones((1, 1, 1), bool), method=method)
    assert found.area == 0
    assert np.isnan(found.specific_surface)


@pytest.mark.parametrize("method", METHODS)
def test_the_border_is_no_surface(method: str) -> None:
    # ITK's bone morphometry counts the border of the region, so that a half full box has six
    # walls; it has one.
    solid = np.zeros((10, 12, 14), bool)
    solid[:5] = True
    area, specific = measured(solid, method)
    lines = {"crofton": 12 * 14, "marching_cubes": 11 * 13, "faces": 12 * 14}[method]
    if method == "crofton":
        # A face along an axis is where 13 directions are least right, and those across it leave
        # the volume.
        assert 0.8 * lines < area < lines
    else:
        assert area == pytest.approx(lines)
        assert specific == pytest.approx(1 / 9)


@pytest.mark.parametrize("radius", [5, 6.5, 8, 12, 20])
@pytest.mark.parametrize("size", [(1.0, 1.0, 1.0), (0.8, 1.0, 0.6)])
def test_balls(radius: float, size: tuple[float, float, float]) -> None:
    exact = 4 * np.pi * radius**2
    solid = ball(radius, size)
    assert measured(solid, "crofton", voxel_size=size)[0] == pytest.approx(exact, rel=0.015)
    assert measured(solid, "faces", voxel_size=size)[0] == pytest.approx(1.5 * exact, rel=0.03)
    mesh = measured(solid, "marching_cubes", voxel_size=size)[0]
    assert 1.04 * exact < mesh < 1.12 * exact


def test_overlapping_spheres_have_the_surface_of_the_exact_law() -> None:
    n, radius, count = 128, 10.0, 150
    void = overlapping_spheres(n, radius, count, seed=2)
    exact = 4 * np.pi * radius**2 * count / n**3 * void.mean()
    periodic, opened = (
        metrics.surface_area(void, boundary=b).specific_surface for b in ("periodic", "open")
    )
    assert periodic == pytest.approx(exact, rel=0.02)
    # The same medium: what is looked at is divided by its own volume.
    assert opened == pytest.approx(periodic, rel=0.01)


def test_an_open_sample_is_not_biased_by_its_border() -> None:
    plane = plates(96, 4, 9, (1, 2, 3))
    whole = metrics.surface_area(plane).specific_surface
    parts = [
        metrics.surface_area(plane[z : z + 12, y : y + 12, x : x + 12]).specific_surface
        for z in range(0, 96, 12)
        for y in range(0, 96, 12)
        for x in range(0, 96, 12)
    ]
    assert np.mean(parts) == pytest.approx(whole, rel=0.01)
    assert whole == pytest.approx(2 / 9, rel=0.02)


@pytest.mark.parametrize("seed", range(3))
def test_the_slope_of_the_two_point_correlation_is_the_surface(seed: int) -> None:
    # −4 S₂'(0) over the axes is two thirds of the faces, to the last digit; for an isotropic medium
    # it is the surface.
    void = overlapping_spheres(64, 9.0, 30, seed)
    found = metrics.two_point_correlation(void, 1, boundary="periodic")
    slope = np.mean([curve[0] - curve[1] for curve in (found.z, found.y, found.x)])
    faces, crofton = (
        metrics.surface_area(void, boundary="periodic", method=m).specific_surface
        for m in ("faces", "crofton")
    )
    assert 4 * slope == pytest.approx(2 / 3 * faces, rel=1e-9)
    assert crofton == pytest.approx(2 / 3 * faces, rel=0.02)


def test_units(rng: np.random.Generator) -> None:
    solid = rng.random((6, 7, 8)) < 0.5
    plain = metrics.surface_area(solid)
    assert plain.unit == "voxel"
    scaled = metrics.surface_area(Volume(solid, 0.5, "mm"))
    assert scaled.unit == "mm"
    assert scaled.area == pytest.approx(plain.area / 4)
    assert scaled.specific_surface == pytest.approx(plain.specific_surface * 2)
    assert metrics.surface_area(Volume(solid, 0.5, "mm"), voxel_size=1).area == plain.area


@pytest.mark.parametrize(
    ("options", "parameter"),
    [
        ({"method": "cauchy"}, "method"),
        ({"boundary": "mirror"}, "boundary"),
        ({"voxel_size": 0.0}, "voxel_size"),
        ({"phase": 7}, "phase"),
    ],
)
def test_bad_parameters_are_named(options: dict[str, object], parameter: str) -> None:
    with pytest.raises(ParameterError, match=rf"^{parameter} = .*: must be "):
        metrics.surface_area(np.ones((2, 2, 2), bool), **options)
    with pytest.raises(ParameterError, match="must hold voxels"):
        metrics.surface_area(np.ones((2, 0, 2), bool))
