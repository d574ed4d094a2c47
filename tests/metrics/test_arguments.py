"""What the metrics take."""

from __future__ import annotations

import numpy as np
import pytest
from tests.metrics.strategies import ORDERS, TYPES

from poresynth import Volume
from poresynth.errors import ParameterError
from poresynth.metrics.arguments import as_phase, scale_of


@pytest.mark.parametrize("order", ORDERS.values(), ids=ORDERS)
@pytest.mark.parametrize("dtype", TYPES)
def test_the_phase_is_what_is_not_zero(dtype: str, order, rng: np.random.Generator) -> None:
    phase = rng.random((3, 4, 5)) < 0.5
    assert np.array_equal(as_phase(order(phase.astype(dtype))), phase)


def test_a_label_names_the_phase() -> None:
    labels = np.arange(24).reshape(2, 3, 4) % 3
    assert np.array_equal(as_phase(labels, phase=2), labels == 2)
    assert np.array_equal(as_phase(labels > 0, phase=0), labels == 0)
    with pytest.raises(ParameterError, match=r"phase = 7: must be one of the values \[0, 1, 2\]"):
        as_phase(labels, phase=7)


def test_bytes_of_zero_and_one_are_not_copied() -> None:
    volume = np.zeros((3, 3, 3), np.uint8)
    volume[1, 1, 1] = 1
    assert np.shares_memory(as_phase(volume), volume)
    assert not np.shares_memory(as_phase(2 * volume), volume)
    assert np.array_equal(as_phase(2 * volume), volume > 0)


def test_the_scale_is_the_volumes_own_unless_given() -> None:
    array = np.zeros((2, 2, 2))
    assert scale_of(array) == ((1.0, 1.0, 1.0), "voxel")
    assert scale_of(Volume(array, 3.0, "µm")) == ((3.0, 3.0, 3.0), "µm")
    assert scale_of(Volume(array, 3.0, "µm"), (1, 2, 3)) == ((1.0, 2.0, 3.0), "µm")
    with pytest.raises(ParameterError, match="voxel_size"):
        scale_of(array, -1.0)


@pytest.mark.parametrize("dtype", ["uint8", "int16", "float32"])
def test_a_gray_volume_is_no_phase(dtype: str) -> None:
    gray = np.arange(27).reshape(3, 3, 3).astype(dtype)
    with pytest.raises(ParameterError, match=r"^solid = gray volume.*poresynth\.binarize"):
        as_phase(gray)


def test_a_phase_is_not_copied(rng: np.random.Generator) -> None:
    solid = rng.random((9, 10, 11)) < 0.3
    assert as_phase(Volume(solid)) is solid
    fortran = np.asfortranarray(solid)
    assert as_phase(fortran * np.uint8(9)).flags.f_contiguous
