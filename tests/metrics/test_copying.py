"""Novelty against its slow twin, and of volumes whose novelty is known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage
from tests.metrics.strategies import ORDERS, TYPES
from tests.references import block_match as twin

from poresynth import metrics
from poresynth.errors import ParameterError


def texture(shape: tuple[int, int, int], seed: int, wave: float = 1.5) -> np.ndarray:
    noise = np.random.default_rng(seed).standard_normal(shape)
    return ndimage.gaussian_filter(noise, wave, mode="wrap")


@settings(max_examples=15)
@given(
    st.integers(2, 6),
    st.tuples(st.integers(14, 24), st.integers(7, 13), st.integers(7, 13)),
    st.tuples(*[st.integers(7, 12)] * 3),
    st.integers(1, 5),
    st.integers(0, 2**63),
)
def test_the_twin_agrees(
    edge: int,
    shape: tuple[int, int, int],
    new: tuple[int, int, int],
    probes: int,
    seed: int,
) -> None:
    exemplar, volume = texture(shape, seed), texture(new, seed + 1)
    expected = twin.novelty(exemplar, volume, edge, probes, seed)
    found = metrics.novelty(exemplar, volume, edge, probes=probes, seed=seed)
    assert found == pytest.approx(expected, rel=1e-3, abs=1e-4)


@pytest.mark.parametrize("order", ORDERS)
def test_memory_order_and_threads_do_not_matter(order: str) -> None:
    exemplar, volume = texture((30, 14, 15), 1), texture((12, 14, 13), 2)
    expected = metrics.novelty(exemplar, volume, 5, threads=1)
    assert metrics.novelty(ORDERS[order](exemplar), ORDERS[order](volume), 5, threads=3) == expected


@pytest.mark.parametrize("dtype", TYPES)
def test_every_type(dtype: str) -> None:
    exemplar, volume = texture((30, 14, 15), 1), texture((12, 14, 13), 2)
    a, b = ((50 * (v > 0)).astype(dtype) for v in (exemplar, volume))
    assert metrics.novelty(a, b, 6) == metrics.novelty(a.astype(float), b.astype(float), 6)


def test_scale_and_offset_of_the_gray_values_do_not_matter() -> None:
    exemplar, volume = texture((30, 14, 15), 1), texture((12, 14, 13), 2)
    expected = metrics.novelty(exemplar, volume, 6)
    assert metrics.novelty(40 * exemplar + 100, 3 * volume - 7, 6) == pytest.approx(expected)


def test_copies_are_not_new() -> None:
    exemplar = texture((40, 20, 20), 3)
    copy = metrics.novelty(exemplar, exemplar[:20], 8)
    assert max(copy) < 0.01
    mirror = metrics.novelty(exemplar, exemplar[:20, ::-1], 8)
    assert mirror.plain > 0.5
    assert mirror.mirrored < 0.01


def test_another_specimen_is_as_new_as_the_other_half() -> None:
    exemplar, volume = texture((60, 40, 40), 4), texture((40, 40, 40), 5)
    found = metrics.novelty(exemplar, volume, 8, probes=100)
    assert found == pytest.approx((1, 1), abs=0.2)


@pytest.mark.parametrize(
    ("exemplar", "volume"),
    [((16, 9, 9), (9, 9, 9)), ((18, 8, 9), (9, 9, 9)), ((18, 9, 9), (9, 9, 8))],
)
def test_too_small_for_a_block(
    exemplar: tuple[int, int, int], volume: tuple[int, int, int]
) -> None:
    assert np.isnan(metrics.novelty(texture(exemplar, 1), texture(volume, 2), 8)).all()
    assert np.isfinite(metrics.novelty(texture((18, 9, 9), 1), texture((9, 9, 9), 2), 8)).all()


def test_an_exemplar_that_repeats_itself_has_no_measure() -> None:
    half = texture((10, 10, 10), 1)
    exemplar = np.concatenate([half, half])
    assert np.isnan(metrics.novelty(exemplar, texture((10, 10, 10), 2), 5)).all()


@pytest.mark.parametrize(
    ("options", "parameter"),
    [
        ({"edge": 0}, "edge"),
        ({"edge": 2.5}, "edge"),
        ({"edge": 4, "probes": 0}, "probes"),
        ({"edge": 4, "seed": -1}, "seed"),
    ],
)
def test_bad_parameters_are_named(options: dict[str, float], parameter: str) -> None:
    with pytest.raises(ParameterError, match=rf"^{parameter} = .*: must be "):
        metrics.novelty(texture((12, 8, 8), 1), texture((8, 8, 8), 2), **options)


def test_the_curve_is_pooled_over_volumes(rng: np.random.Generator) -> None:
    exemplar, first, second = (rng.random((44, 30, 30)) for _ in range(3))
    curve = metrics.novelty_curve(exemplar, [first, second], probes=4)
    assert list(curve) == [12, 20, 32]
    alone = [
        metrics.novelty(exemplar, v, 12, probes=4, seed=i) for i, v in ((0, first), (1, second))
    ]
    assert curve[12].plain == pytest.approx(np.mean([found.plain for found in alone]))
    assert np.isnan(curve[32].plain)
