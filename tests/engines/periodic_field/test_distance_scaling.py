"""Signed distances as what is learned, and the way back."""

from __future__ import annotations

import numpy as np
import pytest

from poresynth import _core
from poresynth.engines.periodic_field.scaling import DistanceScaling
from poresynth.engines.phases import Phases
from poresynth.exemplars import spinodal
from poresynth.volume import Volume


def scaled(array: np.ndarray, solid: str = "bright", clip: int = 5) -> DistanceScaling:
    volume = Volume(array)
    phases = Phases.of(volume, "auto", None, solid)  # type: ignore[arg-type]
    return DistanceScaling.of_distances(volume, phases, clip)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize("solid", ["bright", "dark"])
def test_a_gray_exemplar_comes_back_with_its_phases(dtype: type, solid: str) -> None:
    array = spinodal((32, 32, 32), seed=2).array.astype(dtype)
    scaling = scaled(array, solid)
    field = scaling.field(Volume(array))
    assert (float(field.min()), float(field.max())) == (-1, 1)
    values = scaling.values(field)
    assert values.dtype == dtype
    np.testing.assert_array_equal(scaling.phases.phase_of(values), scaling.phases.phase)
    # Deep inside the grays are the means of the phases: noise is gone.
    inside = scaling.phases.phase == 1
    deep = field[0] >= 0.8
    assert values[deep].std() < 0.5 * array[deep].std()
    assert values[inside].mean() == pytest.approx(array[inside].mean(), rel=0.05)


def test_the_field_is_the_distance_over_the_clip() -> None:
    array = spinodal((32, 32, 32), seed=2).array
    scaling = scaled(array, clip=4)
    expected = _core.signed_distance(scaling.phases.phase == 1, 4, boundary="open") / 4
    np.testing.assert_allclose(scaling.field(Volume(array))[0], expected, atol=1e-6)
    found = scaling.phases.phase_of(scaling.values(expected[None]))
    np.testing.assert_array_equal(found, scaling.phases.phase)


def test_a_binary_exemplar_comes_back_as_it_was() -> None:
    array = spinodal((32, 32, 32)).array > 125
    scaling = scaled(array)
    np.testing.assert_array_equal(scaling.values(scaling.field(Volume(array))), array)


def test_labels_have_a_channel_each_and_come_back() -> None:
    array = np.random.default_rng(1).choice([3, 7, 20], (12, 12, 12)).astype(np.uint8)
    scaling = scaled(array)
    field = scaling.field(Volume(array))
    assert field.shape == (3, 12, 12, 12)
    np.testing.assert_array_equal(scaling.values(field), array)


@pytest.mark.parametrize("solid", ["bright", "dark"])
def test_grays_rise_or_fall_with_the_distance(solid: str) -> None:
    array = spinodal((32, 32, 32), seed=2).array
    scaling = scaled(array, solid)
    line = np.linspace(-1.2, 1.2, 400, dtype=np.float32)[None, None, None]
    values = scaling.values(line).ravel().astype(int)
    steps = np.diff(values) * (1 if solid == "bright" else -1)
    assert (steps >= 0).all()


def test_a_voxel_that_rounds_to_the_threshold_stays_in_its_phase() -> None:
    array = spinodal((32, 32, 32), seed=2).array
    scaling = scaled(array)
    line = np.linspace(-0.02, 0.02, 202, dtype=np.float32).reshape(1, 1, 2, 101)
    np.testing.assert_array_equal(scaling.phases.phase_of(scaling.values(line)), line[0] > 0)
