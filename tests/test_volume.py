from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import poresynth
from poresynth.errors import ParameterError
from poresynth.volume import Volume, as_volume

VOXELS = np.arange(24, dtype=np.uint8).reshape(2, 3, 4)


def test_defaults() -> None:
    volume = Volume(VOXELS)
    assert volume.array is VOXELS
    assert volume.voxel_size == (1.0, 1.0, 1.0)
    assert volume.unit == "voxel"
    assert volume.metadata == {}
    assert (volume.shape, volume.channels, volume.dtype) == ((2, 3, 4), 1, np.uint8)
    assert poresynth.Volume is Volume


def test_channels() -> None:
    volume = Volume(np.zeros((2, 3, 4, 5)))
    assert (volume.shape, volume.channels) == ((2, 3, 4), 5)


@pytest.mark.parametrize("size", [2, 2.0, (2, 2, 2), [2, 2, 2], np.full(3, 2), np.float32(2)])
def test_voxel_sizes_are_spelled_out(size: Any) -> None:
    volume = Volume(VOXELS, size)
    assert volume.voxel_size == (2.0, 2.0, 2.0)
    assert all(type(s) is float for s in volume.voxel_size)


@pytest.mark.parametrize("size", [0, -1, np.nan, np.inf, (1, 2), (1, 2, 3, 4), (1, 0, 1), ((1,),)])
def test_voxel_sizes_are_checked(size: Any) -> None:
    with pytest.raises(ParameterError, match="voxel_size"):
        Volume(VOXELS, size)


@pytest.mark.parametrize("shape", [(), (3,), (3, 4), (1, 2, 3, 4, 5)])
def test_dimensions_are_checked(shape: tuple[int, ...]) -> None:
    with pytest.raises(ParameterError, match=r"array.ndim = \d: must be 3"):
        Volume(np.zeros(shape))


def test_numpy_takes_a_volume_as_its_array() -> None:
    volume = Volume(VOXELS, 2, "mm")
    assert np.asarray(volume) is VOXELS
    assert np.array(volume) is not VOXELS
    assert np.array(volume, dtype=float).dtype == float
    assert np.mean(volume) == VOXELS.mean()


def test_with_array_keeps_the_scale() -> None:
    volume = Volume(VOXELS, 2, "mm", {"a": 1}).with_array(VOXELS > 9)
    assert (volume.voxel_size, volume.unit, volume.metadata) == ((2, 2, 2), "mm", {"a": 1})
    assert volume.dtype == bool


def test_as_volume() -> None:
    volume = Volume(VOXELS)
    assert as_volume(volume) is volume
    assert as_volume(VOXELS).array is VOXELS
    assert as_volume([[[1, 2]]]).shape == (1, 1, 2)
