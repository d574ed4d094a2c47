"""Gray values: distances of histograms, sharpness, seams."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy import ndimage, stats
from tests.metrics.strategies import ORDERS

from poresynth import metrics
from poresynth.errors import ParameterError
from poresynth.volume import Volume

SHAPES = hnp.array_shapes(min_dims=3, max_dims=3, min_side=1, max_side=6)
GRAYS = st.sampled_from(["uint8", "int8", "uint16", "int16"]).flatmap(
    lambda dtype: hnp.arrays(dtype, SHAPES)
)
REALS = hnp.arrays("float64", SHAPES, elements=st.floats(-1e3, 1e3))


def texture(shape: tuple[int, int, int], seed: int) -> np.ndarray:
    noise = np.random.default_rng(seed).standard_normal(shape)
    return (128 + 200 * ndimage.gaussian_filter(noise, 1.5, mode="wrap")).clip(0, 255)


@given(GRAYS, GRAYS)
def test_integers_are_compared_exactly(a: np.ndarray, b: np.ndarray) -> None:
    found = metrics.histogram_distance(a, b)
    expected = stats.wasserstein_distance(a.ravel().astype(float), b.ravel().astype(float))
    assert found.gray_levels == pytest.approx(expected, abs=1e-6)
    deviation = a.std(dtype=float)
    if deviation > 0:
        assert found.percent == pytest.approx(100 * expected / deviation, abs=1e-4)
    else:
        assert np.isnan(found.percent)


@given(REALS, REALS)
@example(np.zeros((1, 1, 1)), np.full((1, 1, 1), 5e-324))
def test_real_values_are_compared_to_a_share_of_their_range(a: np.ndarray, b: np.ndarray) -> None:
    found = metrics.histogram_distance(a, b).gray_levels
    expected = stats.wasserstein_distance(a.ravel(), b.ravel())
    assert found == pytest.approx(expected, abs=np.ptp([a.min(), b.min(), a.max(), b.max()]) / 6e4)


def test_a_shift_is_its_own_distance() -> None:
    exemplar = np.arange(60, dtype=np.uint8).reshape(3, 4, 5)
    assert metrics.histogram_distance(exemplar, exemplar + 7).gray_levels == pytest.approx(7)


def test_the_mean_gradient_is_that_of_numpy() -> None:
    gray = texture((7, 8, 9), 1)
    expected = np.mean([np.abs(np.diff(gray, axis=axis)).mean() for axis in range(3)])
    for dtype in (np.uint8, np.float32, np.float64):
        values = gray.astype(dtype)
        expected = np.mean(
            [np.abs(np.diff(values.astype(float), axis=axis)).mean() for axis in range(3)]
        )
        for order in ORDERS.values():
            assert metrics.mean_gradient(order(values)) == pytest.approx(expected, rel=1e-6)


def test_blur_lowers_and_noise_raises_the_gradient_ratio(rng: np.random.Generator) -> None:
    gray = texture((20, 20, 20), 1)
    assert metrics.gradient_ratio(gray, gray) == 1
    assert metrics.gradient_ratio(gray, ndimage.gaussian_filter(gray, 1)) < 0.95
    assert metrics.gradient_ratio(gray, gray + rng.normal(0, 20, gray.shape)) > 1.05


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_seam_is_found_along_every_axis(axis: int) -> None:
    exemplar, volume = texture((32, 32, 32), 1), texture((40, 40, 40), 2)
    even = metrics.seam(exemplar, volume)
    assert 0.5 < even < 1.6
    cut = np.concatenate(
        [np.take(volume, range(20), axis), np.take(volume[::-1, ::-1, ::-1], range(20), axis)], axis
    )
    assert metrics.seam(exemplar, cut) > 2 * even
    assert metrics.seam(exemplar, exemplar) == 1


def test_a_small_part_of_the_exemplar_has_no_seam() -> None:
    exemplar = texture((48, 48, 48), 3)
    parts = [exemplar[i : i + 16, j : j + 16, :16] for i in (0, 16, 32) for j in (0, 16, 32)]
    figures = [metrics.seam(exemplar, part) for part in parts]
    assert 0.5 < np.median(figures) < 1.5
    assert max(figures) < 2.5


def test_degenerate_volumes_have_finite_or_undefined_figures() -> None:
    one, flat = np.full((1, 1, 1), 7, np.uint8), np.full((4, 4, 4), 7, np.uint8)
    gray = texture((4, 4, 4), 1)
    assert metrics.mean_gradient(one) == metrics.mean_gradient(flat) == 0
    assert np.isnan(metrics.gradient_ratio(flat, gray))
    assert metrics.seam(gray, flat) == 0
    assert metrics.seam(gray, one) == 0
    assert metrics.histogram_distance(one, flat).gray_levels == 0


@pytest.mark.parametrize(
    "bad",
    [
        np.zeros((0, 3, 3)),
        np.zeros((3, 3)),
        np.zeros((3, 3, 3, 2)),
        np.full((3, 3, 3), np.nan),
        np.full((3, 3, 3), np.inf),
        np.zeros((3, 3, 3), complex),
        np.full((3, 3, 3), "a"),
    ],
)
def test_what_is_no_volume_is_refused(bad: np.ndarray) -> None:
    good = np.zeros((3, 3, 3))
    for function in (metrics.histogram_distance, metrics.gradient_ratio, metrics.seam):
        with pytest.raises(ParameterError, match=r"^exemplar = .*: must "):
            function(bad, good)
        with pytest.raises(ParameterError, match=r"^volume = .*: must "):
            function(good, bad)


def test_volumes_are_taken_too() -> None:
    gray = texture((6, 6, 6), 1).astype(np.uint8)
    assert metrics.mean_gradient(Volume(gray)) == metrics.mean_gradient(gray)
