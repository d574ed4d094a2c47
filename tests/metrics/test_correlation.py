"""Two-point correlation against counting, and against known values."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal
from tests.metrics.strategies import ORDERS, boundaries, phases
from tests.references.two_point import two_point

from poresynth import metrics
from poresynth.errors import ParameterError

CURVES = ["radial", "z", "y", "x"]


def curves_of(found: metrics.TwoPointCorrelation) -> list[np.ndarray]:
    return [getattr(found, name) for name in CURVES]


@settings(max_examples=40)
@given(phases, st.integers(0, 6), boundaries, st.sampled_from(list(ORDERS)))
def test_pairs_are_counted_exactly(solid: np.ndarray, r: int, boundary: str, order: str) -> None:
    r = min(r, min(solid.shape) // 2) if boundary == "periodic" else r
    found = metrics.two_point_correlation(ORDERS[order](solid), r, boundary=boundary)
    assert found.r.tolist() == list(range(r + 1))
    for curve, expected in zip(curves_of(found), two_point(solid, r, boundary), strict=True):
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
    axis = np.arange(n)
    void = np.ones((n, n, n), bool)
    for centre in rng.random((count, 3)) * n:
        z, y, x = (((axis - c + n / 2) % n - n / 2) ** 2 for c in centre)
        void &= z[:, None, None] + y[:, None] + x > radius**2
    r = np.arange(25)
    one = 4 / 3 * np.pi * radius**3
    half = np.minimum(r / (2 * radius), 1)
    union = one * (1 + 1.5 * half - 0.5 * half**3)
    found = metrics.two_point_correlation(void, 24, boundary="periodic")
    np.testing.assert_allclose(found.radial, np.exp(-count / n**3 * union), atol=0.02)


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
