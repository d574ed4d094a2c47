"""Skeletons: topology against scikit-image's Euler number, voxels against its thinning."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage
from skimage import measure, morphology
from tests.metrics.strategies import ORDERS, TYPES, phases

from poresynth import metrics
from poresynth.errors import ParameterError
from poresynth.volume import Volume

KINDS = ["curve", "surface"]
METHODS = ["strict", "lee"]
CORNERS = np.ones((3, 3, 3))


def topology(solid: np.ndarray) -> tuple[int, int, int]:
    """Euler number, components of the solid (26), components of the void round it (6)."""
    padded = np.pad(solid, 1)
    euler = round(measure.euler_number(padded, connectivity=3))
    return euler, ndimage.label(padded, CORNERS)[1], ndimage.label(~padded)[1]


def smooth(shape: tuple[int, int, int], sigma: float, seed: int = 0) -> np.ndarray:
    noise = np.random.default_rng(seed).standard_normal(shape)
    return ndimage.gaussian_filter(noise, sigma) > 0


def box_frame(edge: int, thickness: int) -> np.ndarray:
    """The twelve edges of a cube."""
    rim = np.zeros(edge, bool)
    rim[:thickness] = rim[-thickness:] = True
    z, y, x = rim[:, None, None], rim[:, None], rim
    return np.pad(z & y | y & x | z & x, 2)


def torus() -> np.ndarray:
    z, y, x = np.mgrid[-4:5, -12:13, -12:13]
    return (np.hypot(y, x) - 8) ** 2 + z**2 < 9


def block(shape: tuple[int, ...]) -> np.ndarray:
    return np.pad(np.ones(shape, bool), 2)


SHAPES = {
    "voxel": (block((1, 1, 1)), 1),
    "cube": (block((8, 8, 8)), 1),
    "hollow cube": (block((9, 9, 9)) & ~np.pad(np.ones((3, 3, 3), bool), 5), 2),
    "torus": (torus(), 0),
    "box frame": (box_frame(20, 4), -4),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", SHAPES)
def test_known_shapes_keep_their_topology(name: str, kind: str) -> None:
    solid, euler = SHAPES[name]
    skeleton = metrics.skeletonize(solid, kind=kind)
    assert topology(skeleton) == topology(solid)
    assert topology(skeleton)[0] == euler
    assert not np.any(skeleton & ~solid)


@given(phases, st.sampled_from(KINDS))
def test_topology_stays(solid: np.ndarray, kind: str) -> None:
    assert topology(metrics.skeletonize(solid, kind=kind)) == topology(solid)


@pytest.mark.parametrize("sigma", [0.7, 1, 2, 3])
def test_topology_of_blobs_stays(sigma: float) -> None:
    solid = smooth((50, 60, 70), sigma)
    for kind in KINDS:
        assert topology(metrics.skeletonize(solid, kind=kind)) == topology(solid)


@settings(max_examples=50)
@given(phases)
def test_lee_is_that_of_scikit_image(solid: np.ndarray) -> None:
    expected = morphology.skeletonize(solid, method="lee").astype(bool)
    np.testing.assert_array_equal(metrics.skeletonize(solid, method="lee"), expected)


@pytest.mark.parametrize("sigma", [0.7, 2, 4])
def test_lee_is_that_of_scikit_image_for_blobs(sigma: float) -> None:
    solid = smooth((50, 60, 70), sigma, seed=1)
    expected = morphology.skeletonize(solid, method="lee").astype(bool)
    np.testing.assert_array_equal(metrics.skeletonize(solid, method="lee"), expected)


@pytest.mark.parametrize(
    "shape", [*itertools.permutations((2, 2, 30)), *itertools.permutations((4, 4, 30))]
)
def test_bars_of_even_thickness_stay_where_scikit_image_loses_them(
    shape: tuple[int, int, int],
) -> None:
    # scikit-image #3757: it looks again at neighbours one after another, and only at components.
    solid = block(shape)
    assert not morphology.skeletonize(solid, method="lee").any()
    skeleton = metrics.skeletonize(solid)
    assert np.count_nonzero(skeleton) >= 22
    graph = metrics.skeleton_graph(skeleton)
    assert graph.branches.type.tolist() == [0]


@pytest.mark.parametrize("shape", [(5, 40, 40), (40, 5, 40), (40, 40, 5)])
def test_a_plate_stays_where_scikit_image_loses_it(shape: tuple[int, int, int]) -> None:
    solid = block(shape)
    lost = not morphology.skeletonize(solid, method="lee").any()
    assert lost == (shape != (40, 5, 40))
    assert topology(metrics.skeletonize(solid)) == (1, 1, 1)
    # As a surface it is a plate one voxel thick, with rims.
    surface = metrics.skeletonize(solid, kind="surface")
    middle = surface.take(4, axis=shape.index(5))
    assert topology(surface) == (1, 1, 1)
    assert np.count_nonzero(middle) >= 35**2


def test_a_long_plate_becomes_a_line() -> None:
    for shape in itertools.permutations((4, 20, 60)):
        graph = metrics.skeleton_graph(metrics.skeletonize(block(shape)))
        assert graph.branches.type.tolist() == [0]
        assert graph.branches.length[0] >= 34


def test_a_bar_of_odd_thickness_becomes_its_axis() -> None:
    skeleton = metrics.skeletonize(block((5, 5, 30)))
    z, y, x = np.nonzero(skeleton)
    assert set(z) == set(y) == {4}
    assert len(x) >= 25


@given(phases, st.sampled_from(KINDS), st.sampled_from(METHODS), st.sampled_from(list(ORDERS)))
def test_memory_order_and_threads_do_not_matter(
    solid: np.ndarray, kind: str, method: str, order: str
) -> None:
    expected = metrics.skeletonize(solid, kind=kind, method=method, threads=1)
    found = metrics.skeletonize(ORDERS[order](solid), kind=kind, method=method, threads=2)
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("order", ORDERS)
def test_memory_order_and_threads_do_not_matter_for_blobs(method: str, order: str) -> None:
    solid = smooth((70, 65, 66), 2)
    expected = metrics.skeletonize(solid, method=method, threads=1)
    for threads in (2, 8):
        found = metrics.skeletonize(ORDERS[order](solid), method=method, threads=threads)
        np.testing.assert_array_equal(found, expected)


@settings(max_examples=50)
@given(
    phases,
    st.permutations(range(3)),
    st.tuples(*[st.booleans()] * 3),
    st.tuples(*[st.integers(0, 2)] * 6),
)
def test_topology_does_not_depend_on_the_pose(
    solid: np.ndarray, axes: list[int], flips: tuple[bool, ...], pads: tuple[int, ...]
) -> None:
    # The voxels may differ: sides are taken in turn, and a middle lies on one side or the other.
    turned = np.flip(solid.transpose(axes), [a for a in range(3) if flips[a]])
    turned = np.pad(turned, np.reshape(pads, (3, 2)))
    assert topology(metrics.skeletonize(turned)) == topology(metrics.skeletonize(solid))


def test_a_skeleton_is_its_own_skeleton() -> None:
    for kind, method in itertools.product(KINDS, METHODS):
        once = metrics.skeletonize(smooth((40, 40, 40), 2), kind=kind, method=method)
        again = metrics.skeletonize(once, kind=kind, method=method)
        np.testing.assert_array_equal(again, once)


@pytest.mark.parametrize("dtype", [t for t in TYPES if "float" not in t])
def test_every_type_and_phase(dtype: str) -> None:
    solid = smooth((12, 13, 14), 1)
    expected = metrics.skeletonize(solid)
    assert expected.dtype == bool
    np.testing.assert_array_equal(metrics.skeletonize(Volume(solid.astype(dtype))), expected)
    labels = np.where(solid, 1, 0).astype(dtype)
    np.testing.assert_array_equal(metrics.skeletonize(labels, phase=1), expected)
    pore = metrics.skeletonize(labels, phase=0)
    np.testing.assert_array_equal(pore, metrics.skeletonize(~solid))


def test_nothing_one_voxel_and_everything() -> None:
    for method, kind in itertools.product(METHODS, KINDS):
        options = {"method": method, "kind": kind}
        assert not metrics.skeletonize(np.zeros((3, 4, 5), bool), **options).any()
        assert metrics.skeletonize(np.ones((1, 1, 1), bool), **options).all()
    for shape in [(3, 4, 5), (1, 9, 9), (9, 1, 9), (1, 1, 9)]:
        full = np.ones(shape, bool)
        assert topology(metrics.skeletonize(full)) == (1, 1, 1)


def test_a_margin_hides_the_ends_of_struts_that_the_border_cuts() -> None:
    solid = np.zeros((41, 41, 41), bool)
    solid[18:23, 18:23] = True  # a strut from face to face
    solid[18:23, 21:33, 18:23] = True  # one that ends inside
    ends = metrics.end_points(solid, voxel_size=0.5)
    assert ends.count == len(ends.places) == 1
    assert 28 <= ends.places[0, 1] <= 32
    assert ends.per_voxel == 1 / 25**3
    assert ends.density == pytest.approx(8 / 25**3)
    assert metrics.end_points(solid, margin=0).count == 3
    skeleton = metrics.skeletonize(solid)
    assert metrics.end_points(solid, skeleton=skeleton).count == 1


@settings(max_examples=50)
@given(phases)
def test_ends_are_voxels_with_one_neighbour(solid: np.ndarray) -> None:
    skeleton = metrics.skeletonize(solid)
    neighbours = ndimage.convolve(skeleton.astype(int), CORNERS, mode="constant") - 1
    expected = np.argwhere(skeleton & (neighbours == 1))
    found = metrics.end_points(solid, margin=0)
    np.testing.assert_array_equal(found.places, expected)
    assert found.per_voxel == len(expected) / solid.size
    assert found.unit == "voxel"


def test_strict_thinning_makes_no_more_ends_than_the_old_method() -> None:
    solid = smooth((80, 80, 80), 3)
    strict, lee = (
        metrics.end_points(solid, skeleton=metrics.skeletonize(solid, method=method)).count
        for method in METHODS
    )
    assert strict <= 1.2 * lee


@pytest.mark.parametrize(
    ("options", "parameter"),
    [({"kind": "line"}, "kind"), ({"method": "old"}, "method"), ({"phase": 3}, "phase")],
)
def test_bad_parameters_are_named(options: dict[str, object], parameter: str) -> None:
    with pytest.raises(ParameterError, match=rf"^{parameter} = .*: must be "):
        metrics.skeletonize(np.ones((2, 2, 2), bool), **options)


@pytest.mark.parametrize("margin", [-1, 1.5, 4])
def test_a_bad_margin_is_named(margin: float) -> None:
    with pytest.raises(ParameterError, match=r"^margin = .*: must "):
        metrics.end_points(np.ones((8, 8, 8), bool), margin=margin)  # type: ignore[arg-type]
