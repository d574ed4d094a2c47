"""Two-point correlation against counting, and against known values."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy import signal
from tests.metrics.media import overlapping_spheres
from tests.metrics.strategies import ORDERS, TYPES, boundaries, phases
from tests.references import two_point as twin
from tests.references.cluster import two_point_cluster

from poresynth import metrics
from poresynth.errors import ParameterError
from poresynth.volume import Volume

CURVES = ["radial", "z", "y", "x"]


def curves_of(found: metrics.TwoPointCorrelation) -> list[np.ndarray]:
    return [getattr(found, name) for name in CURVES]


@settings(max_examples=40)
@given(phases, st.integers(0, 6), boundaries, st.sampled_from(list(ORDERS)))
def test_pairs_are_counted_exactly(solid: np.ndarray, r: int, boundary: str, order: str) -> None:
    r = min(r, min(solid.shape) // 2) if boundary == "periodic" else r
    found = metrics.two_point_correlation(ORDERS[order](solid), r, boundary=boundary)
    assert found.r.tolist() == list(range(r + 1))
    for curve, expected in zip(curves_of(found), twin.two_point(solid, r, boundary), strict=True):
        np.testing.assert_array_equal(curve, expected)


def test_larger_volumes_agree_with_scipy(rng: np.random.Generator) -> None:
    solid = rng.random((33, 50, 41)) < 0.4
    counts = signal.correlate(solid.astype(float), solid.astype(float), method="fft")
    pairs = signal.correlate(np.ones(solid.shape), np.ones(solid.shape), method="fft")
    lag = np.stack(np.meshgrid(*[np.arange(1 - n, n) for n in solid.shape], indexing="ij"))
    r = np.rint(np.sqrt((lag**2).sum(axis=0))).astype(int)
    expected = np.bincount(r.ravel(), counts.ravel()) / np.bincount(r.ravel(), pairs.ravel())
    found = metrics.two_point_correlation(solid, 30)
    np.testing.assert_allclose(found.radial, expected[:31], rtol=1e-12)
    middle = [n - 1 for n in solid.shape]
    np.testing.assert_allclose(
        found.y, (counts / pairs)[middle[0], middle[1] : middle[1] + 31, middle[2]], rtol=1e-12
    )


def test_threads_do_not_matter(rng: np.random.Generator) -> None:
    solid = rng.random((20, 21, 22)) < 0.4
    one, three = (metrics.two_point_correlation(solid, 12, threads=n) for n in (1, 3))
    for a, b in zip(curves_of(one), curves_of(three), strict=True):
        np.testing.assert_array_equal(a, b)


def test_random_voxels_are_independent(rng: np.random.Generator) -> None:
    solid = rng.random((64, 64, 64)) < 0.3
    fraction = solid.mean()
    for boundary in ("open", "periodic"):
        found = metrics.two_point_correlation(solid, 20, boundary=boundary)
        for curve in curves_of(found):
            assert curve[0] == pytest.approx(fraction)
            np.testing.assert_allclose(curve[1:], fraction**2, rtol=0.05)


def test_plates_repeat() -> None:
    solid = np.zeros((24, 6, 8), bool)
    solid.reshape(4, 6, 6, 8)[:, :2] = True
    found = metrics.two_point_correlation(solid, 3, boundary="periodic")
    np.testing.assert_allclose(found.z, [1 / 3, 1 / 6, 0, 0])
    np.testing.assert_allclose(found.y, 1 / 3)
    np.testing.assert_allclose(found.x, 1 / 3)


def test_overlapping_spheres_follow_the_exact_law(rng: np.random.Generator) -> None:
    # Void of overlapping spheres: S₂(r) = exp(−ρ v₂(r)), v₂ the union of two spheres.
    n, radius, count = 96, 8.0, 250
    void = overlapping_spheres(n, radius, count, rng)
    r = np.arange(25)
    one = 4 / 3 * np.pi * radius**3
    half = np.minimum(r / (2 * radius), 1)
    union = one * (1 + 1.5 * half - 0.5 * half**3)
    found = metrics.two_point_correlation(void, 24, boundary="periodic")
    np.testing.assert_allclose(found.radial, np.exp(-count / n**3 * union), atol=0.02)


VOXELS = st.sampled_from([(1.0, 1.0, 1.0), (2.0, 1.0, 1.0), (0.7, 1.3, 2.0)])


@st.composite
def pairs_of_phases(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray]:
    """Two phases of one shape, which may overlap."""
    first = draw(phases)
    return first, draw(hnp.arrays(bool, first.shape))


@settings(max_examples=40)
@given(pairs_of_phases(), st.integers(0, 5), boundaries, st.sampled_from(list(ORDERS)), VOXELS)
def test_pairs_of_two_phases_are_counted_exactly(
    both: tuple[np.ndarray, np.ndarray],
    r: int,
    boundary: str,
    order: str,
    voxel_size: tuple[float, float, float],
) -> None:
    first, second = both
    r = min(r, min(first.shape) // 2) if boundary == "periodic" else r
    options = {"voxel_size": voxel_size, "boundary": boundary}
    expected = twin.two_point(first, r, boundary, second, voxel_size)
    for ends in ((ORDERS[order](first), second), (second, first)):
        found = metrics.two_point_cross(*ends, r, **options)
        for curve, other in zip(curves_of(found), expected, strict=True):
            np.testing.assert_allclose(curve, other, rtol=1e-12)
    found = metrics.two_point_correlation(first, r, **options)
    np.testing.assert_allclose(found.distance, min(voxel_size) * np.arange(r + 1))
    for curve, other in zip(
        curves_of(found), twin.two_point(first, r, boundary, None, voxel_size), strict=True
    ):
        np.testing.assert_allclose(curve, other, rtol=1e-12)


@settings(max_examples=40)
@given(pairs_of_phases(), st.integers(0, 5), boundaries, st.sampled_from(list(ORDERS)))
def test_maps_hold_every_lag(
    both: tuple[np.ndarray, np.ndarray], r: int, boundary: str, order: str
) -> None:
    first, second = both
    r = min(r, min(first.shape) // 2) if boundary == "periodic" else r
    found = metrics.two_point_map(ORDERS[order](first), r, boundary=boundary)
    np.testing.assert_allclose(
        found.values, twin.two_point_map(first, first, r, boundary), rtol=1e-12
    )
    np.testing.assert_array_equal(found.values, found.values[::-1, ::-1, ::-1])
    assert found.lag.tolist() == list(range(-r, r + 1))
    cross = metrics.two_point_map(ORDERS[order](first), r, other=second, boundary=boundary)
    np.testing.assert_allclose(
        cross.values, twin.two_point_map(first, second, r, boundary), rtol=1e-12
    )
    back = metrics.two_point_map(second, r, other=ORDERS[order](first), boundary=boundary)
    np.testing.assert_array_equal(cross.values, back.values[::-1, ::-1, ::-1])


def test_the_matrix_of_all_phases_is_one_in_total(rng: np.random.Generator) -> None:
    labels = rng.integers(3, 6, (14, 15, 16)).astype("uint8")
    for boundary in ("open", "periodic"):
        found = metrics.two_point_matrix(Volume(labels, 0.5, "mm"), 7, boundary=boundary)
        assert found.phases.tolist() == [3, 4, 5]
        assert (found.unit, found.distance[-1]) == ("mm", 3.5)
        np.testing.assert_allclose(found.radial.sum(axis=(0, 1)), 1)
        np.testing.assert_array_equal(found.radial, found.radial.transpose(1, 0, 2))
        one = metrics.two_point_correlation(labels, 7, phase=4, boundary=boundary)
        np.testing.assert_array_equal(found.radial[1, 1], one.radial)
        cross = metrics.two_point_cross(labels == 3, labels == 5, 7, boundary=boundary)
        np.testing.assert_array_equal(found.radial[0, 2], cross.radial)
    with pytest.raises(ParameterError, match=r"^labels = more than 16 values: must "):
        metrics.two_point_matrix(np.arange(60).reshape(3, 4, 5), 1)


@settings(max_examples=40)
@given(
    phases,
    st.integers(0, 6),
    boundaries,
    st.sampled_from(list(ORDERS)),
    st.sampled_from([6, 18, 26]),
)
def test_clusters_are_counted_one_by_one(
    solid: np.ndarray, r: int, boundary: str, order: str, connectivity: int
) -> None:
    r = min(r, min(solid.shape) // 2) if boundary == "periodic" else r
    options = {"connectivity": connectivity, "boundary": boundary}
    labels = metrics.label(solid, **options).labels
    found = metrics.two_point_cluster(ORDERS[order](solid), r, **options)
    for curve, expected in zip(
        curves_of(found), two_point_cluster(labels, r, boundary), strict=True
    ):
        np.testing.assert_allclose(curve, expected, rtol=1e-12)


@pytest.mark.parametrize("boundary", ["open", "periodic"])
def test_the_cluster_function_of_large_and_small_clusters(
    boundary: str, rng: np.random.Generator
) -> None:
    # Below the percolation threshold of 26 neighbours there is no giant, just above there is one.
    for fraction, share in ((0.05, 0.2), (0.14, 1.0)):
        solid = rng.random((48, 50, 52)) < fraction
        pair = metrics.two_point_correlation(solid, 20, boundary=boundary)
        found = metrics.two_point_cluster(solid, 20, boundary=boundary)
        assert found.radial[0] == pair.radial[0]
        assert (found.radial <= pair.radial + 1e-12).all()
        assert (found.radial[10:] <= share * pair.radial[10:]).all()
        labels, sizes = metrics.label(solid, boundary=boundary)
        giant = labels == 1 + int(np.argmax(sizes))
        rest = metrics.two_point_cluster(solid & ~giant, 20, boundary=boundary)
        alone = metrics.two_point_correlation(giant, 20, boundary=boundary)
        for ours, one, others in zip(*map(curves_of, (found, alone, rest)), strict=True):
            np.testing.assert_allclose(ours, one + others, rtol=1e-9)
        for threads in (1, 2, 8):
            again = metrics.two_point_cluster(solid, 20, boundary=boundary, threads=threads)
            np.testing.assert_array_equal(again.radial, found.radial)


def test_one_cluster_has_the_two_point_correlation() -> None:
    solid = np.zeros((30, 30, 30), bool)
    solid[5:25, 5:25, 5:25] = True
    for boundary in ("open", "periodic"):
        pair = metrics.two_point_correlation(solid, 15, boundary=boundary)
        found = metrics.two_point_cluster(solid, 15, boundary=boundary)
        for ours, theirs in zip(curves_of(found), curves_of(pair), strict=True):
            np.testing.assert_allclose(ours, theirs, rtol=1e-12)
    assert not metrics.two_point_cluster(np.zeros((3, 4, 5), bool), 2).radial.any()


@given(phases, boundaries)
def test_a_turn_and_a_mirror_change_no_radial_curve(solid: np.ndarray, boundary: str) -> None:
    r = min(solid.shape) // 2
    for function in (metrics.two_point_correlation, metrics.two_point_cluster):
        expected = function(solid, r, boundary=boundary)
        for other in (np.rot90(solid, axes=(0, 2)), solid[:, ::-1]):
            found = function(other, r, boundary=boundary)
            np.testing.assert_allclose(found.radial, expected.radial, rtol=1e-12)


@pytest.mark.parametrize("dtype", [t for t in TYPES if "float" not in t])
def test_every_type(dtype: str, rng: np.random.Generator) -> None:
    solid = rng.random((5, 6, 7)) < 0.4
    expected = metrics.two_point_cluster(solid, 3)
    for value in (1, 100):
        volume = Volume((solid * value).astype(dtype), 0.1, "mm")
        found = metrics.two_point_cluster(volume, 3)
        assert found.unit == ("mm")
        np.testing.assert_array_equal(found.radial, expected.radial)


def test_porespy_agrees_where_its_bins_do(rng: np.random.Generator) -> None:
    # PoreSpy pools the voxels of shells between floats, so that only r = 0 and the level of the
    # plateau compare; until 2026 it wrapped around the border.
    porespy = pytest.importorskip("porespy")
    solid = rng.random((30, 30, 30)) < 0.4
    theirs = porespy.metrics.two_point_correlation(solid, bins=10)
    ours = metrics.two_point_correlation(solid, 10)
    np.testing.assert_allclose(
        np.asarray(theirs.probability_scaled)[1:8], ours.radial[1:8], rtol=0.1
    )


def test_the_error_is_that_of_the_papers() -> None:
    # Full against half full of plates: 1 against S₂ of a volume of known fractions.
    full, empty = np.ones((12, 12, 12), bool), np.zeros((12, 12, 12), bool)
    assert metrics.two_point_error(full, full, 5) == 0
    assert metrics.two_point_error(full, empty, 5) == pytest.approx(100)
    assert np.isnan(metrics.two_point_error(empty, full, 5))


def test_the_error_of_volumes_of_different_sizes(rng: np.random.Generator) -> None:
    exemplar, volume = rng.random((20, 20, 20)) < 0.5, rng.random((4, 5, 6)) < 0.5
    found = metrics.two_point_error(exemplar, volume, 30)
    ours, theirs = (metrics.two_point_correlation(s, 30).radial for s in (volume, exemplar))
    both = np.isfinite(ours) & np.isfinite(theirs)
    both[0] = False
    assert both.sum() == 7
    expected = np.linalg.norm((ours - theirs)[both]) / np.linalg.norm(theirs[both])
    assert found == pytest.approx(100 * expected)


@pytest.mark.parametrize(
    ("r_max", "options", "parameter"),
    [
        (-1, {}, "r_max"),
        (1.5, {}, "r_max"),
        (4, {"boundary": "periodic"}, "r_max"),
        (2, {"boundary": "wrap"}, "boundary"),
    ],
)
def test_bad_parameters_are_named(r_max: float, options: dict[str, str], parameter: str) -> None:
    with pytest.raises(ParameterError, match=rf"^{parameter} = .*: must be "):
        metrics.two_point_correlation(np.ones((9, 7, 8), bool), r_max, **options)


def test_phases_of_different_shapes_are_refused() -> None:
    first, second = np.ones((3, 4, 5), bool), np.ones((3, 4, 4), bool)
    with pytest.raises(ParameterError, match=r"^second.shape = .*: must be "):
        metrics.two_point_cross(first, second, 1)
    with pytest.raises(ParameterError, match=r"^second.shape = .*: must be "):
        metrics.two_point_map(first, 1, other=second)
    with pytest.raises(ParameterError, match=r"^connectivity = 8: must be "):
        metrics.two_point_cluster(first, 1, connectivity=8)  # type: ignore[arg-type]
