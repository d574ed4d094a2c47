"""Component statistics, percolation and removal of parts, against libraries and a walk."""

from __future__ import annotations

from collections.abc import Callable

import cc3d
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from porespy.metrics import is_percolating
from scipy import ndimage
from skimage import morphology
from tests.metrics.strategies import ORDERS, TYPES, boundaries, phases
from tests.references.topology import periodic_components

from poresynth import metrics
from poresynth.errors import ParameterError

connectivities = st.sampled_from([6, 18, 26])
sparse = hnp.arrays(
    bool,
    hnp.array_shapes(min_dims=3, max_dims=3, min_side=1, max_side=7),
    elements=st.sampled_from([False, False, False, True]),
)


def assert_same(a: metrics.ComponentStatistics, b: metrics.ComponentStatistics) -> None:
    for name in ("sizes", "bounding_boxes", "centroids", "spans", "labels"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))


@given(phases, connectivities)
def test_statistics_are_those_of_scipy(solid: np.ndarray, connectivity: int) -> None:
    found = metrics.component_statistics(solid, connectivity=connectivity)
    assert found.labels is None
    labels = metrics.label(solid, connectivity=connectivity).labels
    n = int(labels.max())
    boxes = [[(s.start, s.stop) for s in box] for box in ndimage.find_objects(labels)]
    centres = ndimage.center_of_mass(labels > 0, labels, np.arange(1, n + 1))
    np.testing.assert_array_equal(found.sizes, np.bincount(labels.ravel())[1:])
    np.testing.assert_array_equal(found.bounding_boxes, np.reshape(boxes, (n, 3, 2)))
    np.testing.assert_allclose(found.centroids, np.reshape(centres, (n, 3)), rtol=1e-12)
    shape = np.array(solid.shape)
    touches = (found.bounding_boxes[:, :, 0] == 0) & (found.bounding_boxes[:, :, 1] == shape)
    np.testing.assert_array_equal(found.spans, touches)


@given(phases, connectivities)
def test_statistics_are_those_of_cc3d(solid: np.ndarray, connectivity: int) -> None:
    found = metrics.component_statistics(solid, connectivity=connectivity, labels=True)
    theirs = cc3d.statistics(found.labels)
    n = len(found.sizes)
    np.testing.assert_array_equal(found.sizes, theirs["voxel_counts"][1:])
    np.testing.assert_allclose(found.centroids, theirs["centroids"][1:], rtol=1e-5)
    boxes = [[(s.start, s.stop) for s in box] for box in theirs["bounding_boxes"][1:]]
    np.testing.assert_array_equal(found.bounding_boxes, np.reshape(boxes, (n, 3, 2)))


@settings(max_examples=200)
@given(st.one_of(phases, sparse), connectivities)
def test_periodic_components_are_walked_through(solid: np.ndarray, connectivity: int) -> None:
    options = {"connectivity": connectivity, "boundary": "periodic"}
    found = metrics.component_statistics(solid, **options, labels=True)
    expected = periodic_components(solid, connectivity)
    assert found.sizes.tolist() == [size for size, *_ in expected]
    assert found.bounding_boxes.tolist() == [box for _, box, *_ in expected]
    assert found.spans.tolist() == [spans for *_, spans in expected]
    centroids = np.reshape([centroid for *_, centroid, _ in expected], (-1, 3))
    np.testing.assert_allclose(found.centroids, centroids, rtol=1e-12)
    labels = metrics.label(solid, **options)
    np.testing.assert_array_equal(found.labels, labels.labels)
    np.testing.assert_array_equal(found.sizes, labels.sizes)


@given(phases, connectivities, boundaries, st.sampled_from(list(ORDERS)))
def test_memory_order_and_threads_do_not_matter(
    solid: np.ndarray, connectivity: int, boundary: str, order: str
) -> None:
    options = {"connectivity": connectivity, "boundary": boundary}
    expected = metrics.component_statistics(solid, **options, labels=True, threads=1)
    kept = metrics.remove_small_parts(solid, 3, **options)
    for threads in (2, 8):
        array = ORDERS[order](solid)
        found = metrics.component_statistics(array, **options, labels=True, threads=threads)
        assert_same(found, expected)
        again = metrics.remove_small_parts(array, 3, **options, threads=threads)
        np.testing.assert_array_equal(again, kept)


@given(phases, st.integers(0, 2), boundaries)
def test_rotation_and_flips_turn_the_statistics(
    solid: np.ndarray, axis: int, boundary: str
) -> None:
    before = metrics.component_statistics(solid, boundary=boundary)
    after = metrics.component_statistics(np.flip(solid, axis), boundary=boundary)
    assert sorted(before.sizes) == sorted(after.sizes)
    assert sorted(before.spans.tolist()) == sorted(after.spans.tolist())
    turned = metrics.percolation(solid.transpose(1, 2, 0), boundary=boundary)
    z, y, x = metrics.percolation(solid, boundary=boundary).fractions
    assert turned.fractions == (y, x, z)
    if boundary == "open":
        edge = solid.shape[axis]
        flipped = edge - before.bounding_boxes[:, axis, ::-1]
        ours = np.c_[before.sizes, flipped].tolist()
        assert sorted(ours) == sorted(np.c_[after.sizes, after.bounding_boxes[:, axis]].tolist())
        padded = metrics.component_statistics(np.pad(solid, 1))
        np.testing.assert_array_equal(padded.bounding_boxes, before.bounding_boxes + 1)
        np.testing.assert_allclose(padded.centroids, before.centroids + 1)
        assert not padded.spans.any()


def test_a_ball_across_the_corner_is_one_piece() -> None:
    grid = np.stack(np.meshgrid(*[np.arange(20)] * 3, indexing="ij"))
    ball = (((grid - 10) ** 2).sum(axis=0) <= 16).astype(bool)
    solid = np.roll(ball, (-9, -10, 8), axis=(0, 1, 2))
    assert len(metrics.component_statistics(solid).sizes) == 8
    found = metrics.component_statistics(solid, boundary="periodic")
    assert found.bounding_boxes.tolist() == [[[17, 26], [16, 25], [14, 23]]]
    np.testing.assert_allclose(found.centroids, [[21, 20, 18]])
    assert not found.spans.any()


def test_touching_both_faces_is_not_going_round() -> None:
    # A bar from face to face that continues beside itself: in the tiled volume it ends nowhere
    # only if its two ends meet.
    solid = np.zeros((5, 5, 5), bool)
    solid[1, 1, :3] = solid[1, 1:4, 2] = solid[1, 3, 2:] = True
    assert metrics.percolation(solid, connectivity=6).percolates == (False, False, True)
    periodic = metrics.percolation(solid, connectivity=6, boundary="periodic")
    assert periodic.percolates == (False, False, False)
    solid[1, 1, 3:] = True
    periodic = metrics.percolation(solid, connectivity=6, boundary="periodic")
    assert periodic.percolates == (False, False, True)
    assert periodic.fractions == (0, 0, 1)


def test_a_helix_goes_round_two_axes_at_once() -> None:
    solid = np.zeros((4, 6, 6), bool)
    solid[1, np.arange(6), np.arange(6)] = True
    found = metrics.component_statistics(solid, boundary="periodic")
    assert found.spans.tolist() == [[False, True, True]]
    assert found.bounding_boxes.tolist() == [[[1, 2], [0, 6], [0, 6]]]
    np.testing.assert_array_equal(found.centroids, [[1, np.nan, np.nan]])


def test_shares_of_spanning_parts() -> None:
    solid = np.zeros((6, 6, 6), bool)
    solid[0, 0] = solid[3] = solid[5, 5, 5] = True
    found = metrics.percolation(solid)
    assert found.percolates == (False, True, True)
    assert found.fractions == pytest.approx((0, 36 / 43, 42 / 43))


@settings(max_examples=40)
@given(phases)
def test_percolation_is_that_of_porespy(solid: np.ndarray) -> None:
    found = metrics.percolation(solid, connectivity=6)
    if min(solid.shape) > 1 and solid.any():
        assert list(found.percolates) == [bool(is_percolating(solid, axis)) for axis in range(3)]


@given(phases, st.integers(0, 30), connectivities, boundaries)
def test_small_parts_are_removed(
    solid: np.ndarray, size: int, connectivity: int, boundary: str
) -> None:
    options = {"connectivity": connectivity, "boundary": boundary}
    labels, sizes = metrics.label(solid, **options)
    expected = np.append(False, sizes >= size)[labels]
    found = metrics.remove_small_parts(solid, size, **options)
    assert found.dtype == bool
    np.testing.assert_array_equal(found, expected)
    largest = metrics.largest_part(solid, **options)
    if solid.any():
        np.testing.assert_array_equal(largest, labels == 1 + np.argmax(sizes))
    else:
        assert not largest.any()


@given(phases)
def test_small_parts_are_those_of_scikit_image(solid: np.ndarray) -> None:
    # max_size is the largest that goes.
    expected = morphology.remove_small_objects(solid, max_size=9, connectivity=3)
    np.testing.assert_array_equal(metrics.remove_small_parts(solid, 10), expected)


def test_no_voxel_one_voxel_all_voxels() -> None:
    empty, full = np.zeros((3, 4, 5), bool), np.ones((3, 4, 5), bool)
    for boundary in ("open", "periodic"):
        none = metrics.component_statistics(empty, boundary=boundary)
        assert none.sizes.shape == (0,)
        assert none.bounding_boxes.shape == (0, 3, 2)
        assert none.centroids.shape == none.spans.shape == (0, 3)
        assert metrics.percolation(empty, boundary=boundary).fractions == (0, 0, 0)
        assert not metrics.remove_small_parts(empty, 1, boundary=boundary).any()
        assert metrics.percolation(full, boundary=boundary).fractions == (1, 1, 1)
        assert metrics.remove_small_parts(full, 60, boundary=boundary).all()
        assert not metrics.remove_small_parts(full, 10**30, boundary=boundary).any()
    one = metrics.component_statistics(np.ones((1, 1, 1), bool))
    assert one.centroids.tolist() == [[0, 0, 0]]
    assert one.spans.all()
    whole = metrics.component_statistics(full, boundary="periodic")
    assert np.isnan(whole.centroids).all()


@pytest.mark.parametrize("dtype", [t for t in TYPES if "float" not in t])
def test_every_type_and_phase(dtype: str, rng: np.random.Generator) -> None:
    solid = rng.random((5, 6, 7)) < 0.3
    expected = metrics.component_statistics(solid)
    assert_same(metrics.component_statistics((solid * 1).astype(dtype)), expected)
    if dtype != "bool":
        labels = (solid * 3 + 1).astype(dtype)
        assert_same(metrics.component_statistics(labels, phase=4), expected)
        assert metrics.percolation(labels, phase=4) == metrics.percolation(solid)
        kept = metrics.remove_small_parts(labels, 4, phase=4)
        np.testing.assert_array_equal(kept, metrics.remove_small_parts(solid, 4))
        largest = metrics.largest_part(labels, phase=4)
        np.testing.assert_array_equal(largest, metrics.largest_part(solid))


@pytest.mark.parametrize(
    "function",
    [
        metrics.component_statistics,
        metrics.percolation,
        metrics.largest_part,
        lambda solid, **options: metrics.remove_small_parts(solid, 3, **options),
    ],
)
@pytest.mark.parametrize(
    ("options", "parameter"),
    [({"connectivity": 8}, "connectivity"), ({"boundary": "mirror"}, "boundary")],
)
def test_bad_parameters_are_named(
    function: Callable[..., object], options: dict[str, object], parameter: str
) -> None:
    with pytest.raises(ParameterError, match=rf"^{parameter} = .*: must be "):
        function(np.ones((2, 2, 2), bool), **options)


@pytest.mark.parametrize("size", [-1, 2.5])
def test_a_bad_size_is_named(size: object) -> None:
    with pytest.raises(ParameterError, match=r"^size = .*: must be "):
        metrics.remove_small_parts(np.ones((2, 2, 2), bool), size)
