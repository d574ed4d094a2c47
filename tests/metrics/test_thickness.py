"""Local thickness against its definition, and shapes of known thickness."""

from __future__ import annotations

import numpy as np
import porespy
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.metrics.strategies import ORDERS, TYPES, boundaries, phases
from tests.references import thickness as twin

from poresynth import metrics
from poresynth.errors import ParameterError
from poresynth.volume import Volume

sizes = st.sampled_from([(1.0, 1.0, 1.0), (0.3, 0.3, 0.3), (2.0, 1.0, 1.0), (1.5, 1.1, 0.7)])


def ball(radius: float, edge: int) -> np.ndarray:
    z, y, x = (axis - (edge - 1) / 2 for axis in np.ogrid[:edge, :edge, :edge])
    return np.asarray(z**2 + y**2 + x**2 <= radius**2)


def rod(diameter: int, edge: int) -> np.ndarray:
    y, x = (axis - (edge - 1) / 2 for axis in np.ogrid[:edge, :edge])
    return np.broadcast_to(y**2 + x**2 <= (diameter / 2) ** 2, (edge,) * 3)


@given(phases, sizes, boundaries)
@settings(deadline=None)
def test_every_voxel_gets_its_largest_ball(
    solid: np.ndarray, size: tuple[float, float, float], boundary: str
) -> None:
    found = metrics.local_thickness(solid, voxel_size=size, boundary=boundary)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, twin.local_thickness(solid, size, boundary), rtol=1e-5)


@pytest.mark.parametrize("size", [(1.0, 1.0, 1.0), (1.5, 1.1, 0.7)])
@pytest.mark.parametrize("boundary", ["open", "periodic"])
def test_larger_balls(size: tuple[float, float, float], boundary: str) -> None:
    solid = np.ones((11, 12, 14), bool)
    solid[np.random.default_rng(0).random(solid.shape) < 0.005] = False
    found = metrics.local_thickness(solid, voxel_size=size, boundary=boundary)
    np.testing.assert_allclose(found, twin.local_thickness(solid, size, boundary), rtol=1e-5)


@given(phases, boundaries, st.sampled_from(list(ORDERS)))
def test_memory_order_and_threads_do_not_matter(
    solid: np.ndarray, boundary: str, order: str
) -> None:
    options = {"boundary": boundary}
    expected = metrics.local_thickness(solid, **options, threads=1)
    for threads in (2, 8):
        found = metrics.local_thickness(ORDERS[order](solid), **options, threads=threads)
        np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("dtype", [t for t in TYPES if "float" not in t])
def test_every_type_and_label(dtype: str, rng: np.random.Generator) -> None:
    labels = rng.integers(0, 2 if dtype == "bool" else 4, (6, 7, 8)).astype(dtype)
    for phase in np.unique(labels):
        expected = metrics.local_thickness(labels == phase)
        found = metrics.local_thickness(Volume(labels), phase=int(phase))
        np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("t", [1, 2, 3, 4, 7, 10, 31, 40])
def test_a_slab_is_as_thick_as_it_is_in_either_phase(axis: int, t: int) -> None:
    size = (0.5, 1.5, 2.0)
    slab = np.zeros((48, 48, 48), bool)
    np.moveaxis(slab, axis, 0)[3 : 3 + t] = True
    for phase, array in ((1, slab), (0, ~slab)):
        for edges in (1.0, size):
            found = metrics.thickness(array, phase=phase, voxel_size=edges)
            wanted = t * np.broadcast_to(edges, 3)[axis]
            assert found.mean == pytest.approx(wanted, rel=1e-5)
            assert found.sd == pytest.approx(0, abs=1e-4)
            assert found.max == pytest.approx(wanted, rel=1e-5)


def test_plates_of_two_thicknesses() -> None:
    # Solid of 4 and pores of 6, again and again.
    plates = np.zeros((40, 12, 12), bool)
    plates[np.arange(40) % 10 < 4] = True
    volume = Volume(plates, voxel_size=0.02, unit="mm")
    solid = metrics.trabecular_thickness(volume, boundary="periodic")
    space = metrics.trabecular_separation(volume, boundary="periodic")
    assert (solid.unit, space.unit) == ("mm", "mm")
    assert (solid.mean, space.mean) == pytest.approx((0.08, 0.12), rel=1e-5)
    np.testing.assert_array_equal(solid.voxels, [0, 0, 0, 0, plates.sum()])
    np.testing.assert_allclose(solid.edges, 0.02 * np.arange(6))
    assert solid.shares.tolist() == [0, 0, 0, 0, 1]


@pytest.mark.parametrize("edge", [40, 41])
def test_a_ball_and_a_rod_are_as_thick_as_they_are(edge: int) -> None:
    # Between −6 % and +1 %: some voxels outside lie closer to the surface than half a voxel.
    for shape, across in ((ball(12, edge), 24), (rod(16, edge), 16)):
        found = metrics.thickness(shape)
        assert 0.94 * across < found.mean < 1.01 * across
        assert 0.94 * across < found.max < 1.01 * across


def test_radii_are_not_rounded() -> None:
    # Rounded radii lose up to a voxel, and with it more than a tenth of the rod.
    solid = rod(16, 40)
    rounded = 2 * porespy.filters.local_thickness(solid, method="dt")[solid].mean()
    assert rounded < 15 < metrics.thickness(solid).mean


@given(phases, st.permutations([0, 1, 2]), st.sampled_from([0, 1, 2]))
def test_a_volume_may_be_turned_and_flipped(
    solid: np.ndarray, axes: list[int], flipped: int
) -> None:
    found = metrics.local_thickness(solid)
    again = metrics.local_thickness(np.flip(solid.transpose(axes), flipped))
    np.testing.assert_array_equal(again, np.flip(found.transpose(axes), flipped))


def test_void_around_does_not_matter_to_a_phase_that_does_not_touch_the_border(
    rng: np.random.Generator,
) -> None:
    solid = np.pad(rng.random((14, 15, 16)) < 0.9, 1)
    expected, found = metrics.thickness(solid), metrics.thickness(np.pad(solid, 5))
    assert (found.mean, found.sd, found.max) == (expected.mean, expected.sd, expected.max)


def test_no_voxel_and_all_voxels() -> None:
    empty, full = np.zeros((3, 4, 5), bool), np.ones((3, 4, 5), bool)
    assert not metrics.local_thickness(empty).any()
    assert np.isinf(metrics.local_thickness(full)).all()
    nothing, everything = metrics.thickness(empty), metrics.thickness(full)
    assert np.isnan([nothing.mean, nothing.sd, nothing.max, everything.sd]).all()
    assert (everything.mean, everything.max) == (np.inf, np.inf)
    for found in (nothing, everything):
        assert (found.edges.tolist(), found.voxels.tolist()) == ([0], [])
    no_pore, all_pore = metrics.pore_size_distribution(full), metrics.pore_size_distribution(empty)
    assert np.isnan([no_pore.d10, no_pore.d50, no_pore.d90, no_pore.mean]).all()
    assert all_pore.d50 == np.inf
    assert no_pore.cumulative.tolist() == all_pore.cumulative.tolist() == [0]


def test_the_pore_size_distribution_of_two_slits() -> None:
    solid = np.ones((30, 20, 20), bool)
    solid[2:4] = solid[10:18] = False
    found = metrics.pore_size_distribution(solid, voxel_size=0.5)
    assert (found.d10, found.d50, found.d90) == pytest.approx((1, 4, 4))
    assert found.mean == pytest.approx(0.2 * 1 + 0.8 * 4)
    np.testing.assert_allclose(found.shares, [0, 0, 0.2, 0, 0, 0, 0, 0, 0.8])
    np.testing.assert_allclose(found.density, found.shares / 0.5)
    np.testing.assert_allclose(found.cumulative, [0, 0, 0, 0.2, 0.2, 0.2, 0.2, 0.2, 0.2, 1])
    wide = metrics.pore_size_distribution(solid, voxel_size=0.5, bin_width=2.5)
    np.testing.assert_allclose(wide.shares, [0.2, 0.8])


def test_the_histogram_counts_every_voxel(rng: np.random.Generator) -> None:
    solid = rng.random((12, 13, 14)) < 0.95
    found = metrics.thickness(solid, bin_width=0.37)
    values = metrics.local_thickness(solid)[solid]
    assert found.voxels.sum() == solid.sum()
    assert found.mean == pytest.approx(values.mean())
    assert found.sd == pytest.approx(values.std(), rel=1e-4)
    expected = np.histogram(values, found.edges - 1e-4)[0]
    np.testing.assert_array_equal(found.voxels, expected)


@pytest.mark.parametrize(
    ("options", "parameter"),
    [
        ({"boundary": "mirror"}, "boundary"),
        ({"voxel_size": -1.0}, "voxel_size"),
        ({"bin_width": 0.0}, "bin_width"),
        ({"bin_width": float("nan")}, "bin_width"),
        ({"bin_width": 1e-9}, "bin_width"),
        ({"phase": 3}, "phase"),
    ],
)
def test_bad_parameters_are_named(options: dict[str, object], parameter: str) -> None:
    solid = np.ones((3, 3, 3), bool)
    solid[0] = False
    for function in (metrics.thickness, metrics.pore_size_distribution):
        with pytest.raises(ParameterError, match=rf"^{parameter} = .*: must "):
            function(solid, **options)
