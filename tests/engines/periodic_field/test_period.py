"""The period of an exemplar."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from poresynth.engines.periodic_field.period import (
    autocovariance,
    estimate_period,
    starting_period,
)
from poresynth.errors import ParameterError
from poresynth.exemplars import foam, spinodal


def stripes(period: float, edge: int = 120, noise: float = 0.0) -> np.ndarray:
    x = np.arange(edge)
    wave = np.sin(2 * np.pi * x / period)[None, :] + np.zeros((edge, 1))
    return (wave + np.random.default_rng(1).normal(0, noise, wave.shape)).astype(np.float32)[None]


@given(st.floats(9.0, 40.0))
def test_the_period_of_stripes_is_found_within_two_percent(period: float) -> None:
    found = estimate_period(stripes(period, noise=0.3))
    assert found.clear[1]
    assert found.length[1] == pytest.approx(period, rel=0.02)


def test_a_lattice_has_a_period_along_each_axis() -> None:
    z, y, x = np.meshgrid(*[np.arange(64)] * 3, indexing="ij")
    field = np.cos(2 * np.pi * z / 12) + np.cos(2 * np.pi * y / 16) + np.cos(2 * np.pi * x / 20)
    solid = (field > 0).astype(np.float32)[None]
    found = estimate_period(solid)
    assert found.clear == (True, True, True)
    assert found.length == pytest.approx((12, 16, 20), rel=0.03)


def test_a_medium_without_a_period_gets_four_wavelengths() -> None:
    for wavelength in (10, 16):
        volume = spinodal((80, 80, 80), wavelength=wavelength, seed=3).array
        found = estimate_period(volume[None].astype(np.float32))
        assert found.clear == (False, False, False)
        assert found.length == pytest.approx((4 * wavelength,) * 3, rel=0.25)
    found = estimate_period(foam((96, 96, 96)).array[None].astype(np.float32))
    assert not any(found.clear)


def test_the_autocovariance_is_that_of_pairs() -> None:
    field = np.random.default_rng(4).random((2, 5, 12)).astype(np.float32)
    centred = field.astype(float) - field.mean(axis=(1, 2), keepdims=True, dtype=float)
    expected = [sum((c[:, : 12 - lag] * c[:, lag:]).mean() for c in centred) for lag in range(7)]
    np.testing.assert_allclose(
        autocovariance(field, 2), np.array(expected) / expected[0], atol=1e-10
    )


def test_a_ramp_has_no_period() -> None:
    field = np.tile(np.linspace(0, 1, 40, dtype=np.float32), (1, 40, 1))
    found = estimate_period(field)
    assert found.clear == (False, False)
    assert all(np.isfinite(found.length))


def test_the_starting_period_is_what_was_asked_for() -> None:
    field = stripes(10.0)
    own = starting_period(field, "exemplar", 64, 1)
    assert own.length == estimate_period(field).length
    # Octaves down to a 32nd of the period need a period of 64.
    wide = starting_period(field, "exemplar", 64, 5)
    assert wide.length[1] == pytest.approx(7 * own.length[1])
    assert starting_period(field, "crop", 64, 1).length == (63, 63)
    assert starting_period(field, 30.0, 64, 1).length == (30, 30)
    assert starting_period(field, (30.0, 20.0), 64, 1).length == (30, 20)


@pytest.mark.parametrize("asked", [(1.0,), (3.0, 3.0, 3.0)])
def test_a_period_of_other_axes_is_refused(asked: Any) -> None:
    with pytest.raises(ParameterError, match="must be one number, or 2"):
        starting_period(stripes(10.0), asked, 64, 1)
