"""Noise is a function of seed and place."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.references.lattice_noise import site_noise

from poresynth.engines.neural.noise import lattice_noise, mix_seed

SITES = st.integers(-(10**12), 10**12)


@given(st.integers(0, 2**64 - 1), SITES, SITES, SITES, st.integers(0, 4))
def test_noise_of_a_site_is_the_twins(seed: int, z: int, y: int, x: int, channel: int) -> None:
    found = lattice_noise(seed, (z, y, x), (1, 1, 1), channels=5)
    assert found[channel, 0, 0, 0] == site_noise(seed, (z, y, x), channel)


@given(st.integers(0, 99), st.tuples(SITES, SITES), st.tuples(st.integers(0, 3), st.integers(0, 3)))
def test_a_window_is_a_part_of_the_whole(
    seed: int, start: tuple[int, int], offset: tuple[int, int]
) -> None:
    whole = lattice_noise(seed, start, (6, 6), channels=2, kind="normal")
    at = [s + o for s, o in zip(start, offset, strict=True)]
    part = lattice_noise(seed, at, (3, 2), channels=2, kind="normal")
    assert np.array_equal(part, whole[:, offset[0] : offset[0] + 3, offset[1] : offset[1] + 2])


def test_periodic_noise_repeats_and_is_the_plain_noise_within_one_period() -> None:
    found = lattice_noise(3, (-4, -5), (8, 10), channels=2, period=(4, 5))
    assert np.array_equal(found[:, :4, :5], found[:, 4:, 5:])
    assert np.array_equal(found[:, 4:, 5:], lattice_noise(3, (0, 0), (4, 5), channels=2))


def test_uniform_noise_fills_its_interval_evenly() -> None:
    values = lattice_noise(1, (0, 0, 0), (32, 32, 32), channels=4)
    assert values.dtype == np.float32
    assert values.min() >= -1
    assert values.max() < 1
    counts = np.histogram(values, 16, (-1, 1))[0]
    # Sixteen counts of 8192: chi squared beyond 45 has a chance of 10⁻⁴.
    assert ((counts - 8192) ** 2 / 8192).sum() < 45


def test_normal_noise_has_the_moments_of_the_normal_distribution() -> None:
    values = lattice_noise(2, (0, 0, 0), (32, 32, 32), channels=4, kind="normal").astype(float)
    for power, moment in ((1, 0), (2, 1), (3, 0), (4, 3)):
        assert (values**power).mean() == pytest.approx(moment, abs=0.12)


def test_seeds_channels_and_sites_are_independent() -> None:
    a, b = (lattice_noise(s, (0, 0, 0), (20, 20, 20), channels=2) for s in (0, 1))
    for one, other in ((a, b), (a[0], a[1]), (a[:, 1:], a[:, :-1]), (a[..., 1:], a[..., :-1])):
        assert abs(np.corrcoef(one.ravel(), other.ravel())[0, 1]) < 0.04


def test_a_seed_of_parts_depends_on_each_and_on_their_order() -> None:
    assert len({mix_seed(*p) for p in ((), (0,), (1,), (0, 0), (0, 1), (1, 0), (2**63,))}) == 7
