"""Connected components against independent libraries and known shapes."""

from __future__ import annotations

import cc3d
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage, stats
from tests.metrics.strategies import ORDERS, TYPES, boundaries, phases

from poresynth import metrics
from poresynth.errors import ParameterError
from poresynth.volume import Volume

CONNECTIVITIES = [6, 18, 26]
STRUCTURES = {
    n: ndimage.generate_binary_structure(3, order) for order, n in enumerate(CONNECTIVITIES, 1)
}


def in_c_order(labels: np.ndarray) -> np.ndarray:
    """Number labels anew by their first voxels."""
    values, first = np.unique(labels, return_index=True)
    order = values[np.argsort(first)]
    rank = np.zeros(int(values.max(initial=0)) + 1, int)
    rank[order[order > 0]] = np.arange(1, np.count_nonzero(values) + 1)
    return rank[labels]


@given(phases, st.sampled_from(CONNECTIVITIES))
def test_labels_are_those_of_scipy(solid: np.ndarray, connectivity: int) -> None:
    expected = in_c_order(ndimage.label(solid, STRUCTURES[connectivity])[0])
    found = metrics.label(solid, connectivity=connectivity)
    np.testing.assert_array_equal(found.labels, expected)
    np.testing.assert_array_equal(found.sizes, np.bincount(expected.ravel())[1:])


@given(phases)
def test_periodic_labels_are_those_of_cc3d(solid: np.ndarray) -> None:
    expected = cc3d.connected_components(
        np.ascontiguousarray(solid), connectivity=6, periodic_boundary=True
    )
    found = metrics.label(solid, connectivity=6, boundary="periodic")
    np.testing.assert_array_equal(found.labels, in_c_order(np.asarray(expected, int)))


@given(phases, st.sampled_from(CONNECTIVITIES), st.tuples(*[st.integers(0, 9)] * 3))
def test_a_periodic_volume_may_be_rolled(
    solid: np.ndarray, connectivity: int, shift: tuple[int, int, int]
) -> None:
    options = {"connectivity": connectivity, "boundary": "periodic"}
    rolled = np.roll(solid, shift, axis=(0, 1, 2))
    before, after = (metrics.component_sizes(s, **options) for s in (solid, rolled))
    np.testing.assert_array_equal(np.sort(before), np.sort(after))


@given(phases, st.sampled_from(CONNECTIVITIES), boundaries, st.sampled_from(list(ORDERS)))
def test_memory_order_and_threads_do_not_matter(
    solid: np.ndarray, connectivity: int, boundary: str, order: str
) -> None:
    options = {"connectivity": connectivity, "boundary": boundary}
    expected = metrics.label(solid, **options, threads=1)
    found = metrics.label(ORDERS[order](solid), **options, threads=3)
    np.testing.assert_array_equal(found.labels, expected.labels)
    np.testing.assert_array_equal(found.sizes, expected.sizes)
    sizes = metrics.component_sizes(ORDERS[order](solid), **options)
    np.testing.assert_array_equal(sizes, expected.sizes)


@pytest.mark.parametrize("dtype", [t for t in TYPES if "float" not in t])
def test_every_type(dtype: str, rng: np.random.Generator) -> None:
    solid = rng.random((5, 6, 7)) < 0.4
    expected = metrics.label(solid)
    for value in (1, 100):
        found = metrics.label(Volume((solid * value).astype(dtype)))
        np.testing.assert_array_equal(found.labels, expected.labels)


@pytest.mark.parametrize(("n", "sizes"), [(6, [1, 1]), (18, [2]), (26, [2])])
def test_two_voxels_that_share_an_edge(n: int, sizes: list[int]) -> None:
    solid = np.zeros((2, 2, 2), bool)
    solid[0, 0, 0] = solid[0, 1, 1] = True
    assert metrics.component_sizes(solid, connectivity=n).tolist() == sizes


@pytest.mark.parametrize(("n", "sizes"), [(6, [1, 1]), (18, [1, 1]), (26, [2])])
def test_two_voxels_that_share_a_corner(n: int, sizes: list[int]) -> None:
    solid = np.zeros((2, 2, 2), bool)
    solid[0, 0, 0] = solid[1, 1, 1] = True
    assert metrics.component_sizes(solid, connectivity=n).tolist() == sizes


def test_no_voxel_and_all_voxels() -> None:
    empty, full = np.zeros((3, 4, 5), bool), np.ones((3, 4, 5), bool)
    assert not metrics.label(empty).labels.any()
    assert metrics.components(empty) == metrics.floating_parts(empty) == 0
    assert metrics.largest_component_fraction(empty) == 0
    assert metrics.component_sizes(full).tolist() == [60]
    assert metrics.components(full) == metrics.largest_component_fraction(full) == 1


def test_parts_of_fewer_than_ten_voxels_float() -> None:
    solid = np.zeros((9, 9, 30), bool)
    solid[0, 0, :9] = solid[4, 4, :10] = solid[8, 8] = True
    assert metrics.components(solid) == 3
    assert metrics.floating_parts(solid) == 1
    assert metrics.largest_component_fraction(solid) == 30 / 49


def test_the_distance_of_the_paper_for_a_giant_and_specks() -> None:
    # A giant of 20 % alone, and one of 30 % with a speck of 1 %: means differ by 20 − 15.5.
    exemplar, volume = np.zeros((2, 10, 10, 10), bool)
    exemplar[:2] = volume[:3] = True
    volume[5, 0] = True
    assert metrics.component_wasserstein(exemplar, exemplar) == 0
    found = metrics.component_wasserstein(exemplar, volume)
    assert found == pytest.approx((30 - 20) / 2 + (20 - 1) / 2)
    assert metrics.component_wasserstein(volume, exemplar) == pytest.approx(found)


def test_an_empty_phase_counts_as_a_part_of_no_voxels() -> None:
    empty, full = np.zeros((3, 4, 5), bool), np.ones((6, 4, 5), bool)
    assert metrics.component_wasserstein(empty, full) == 100
    assert metrics.component_wasserstein(empty, empty) == 0


@given(phases, phases)
def test_the_distance_of_sizes_is_that_of_scipy(a: np.ndarray, b: np.ndarray) -> None:
    shares = [100 * metrics.component_sizes(s) / s.size if s.any() else [0.0] for s in (a, b)]
    expected = stats.wasserstein_distance(*shares)
    assert metrics.component_wasserstein(a, b) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("options", "parameter"),
    [
        ({"connectivity": 8}, "connectivity"),
        ({"connectivity": -6}, "connectivity"),
        ({"boundary": "mirror"}, "boundary"),
    ],
)
def test_bad_parameters_are_named(options: dict[str, object], parameter: str) -> None:
    for function in (metrics.label, metrics.component_sizes):
        with pytest.raises(ParameterError, match=rf"^{parameter} = .*: must be "):
            function(np.ones((2, 2, 2), bool), **options)
