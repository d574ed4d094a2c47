"""Real scans and photographs, as other people's programs wrote them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import poresynth
from poresynth.preprocess import binarize, is_two_valued, threshold


@pytest.mark.parametrize(
    ("name", "edge", "size", "unit"),
    [
        ("trabecular_bone_gray_100.tif", 100, 39.0, "µm"),
        ("trabecular_bone_gray_200.tif", 200, 19.5, "µm"),
        ("cement_gray_128.tif", 128, 1.0, "voxel"),
        ("berea_sandstone_binary_200.tif", 200, 1.0, "voxel"),
        ("ketton_limestone_binary_256.tif", 256, 1.0, "voxel"),
    ],
)
def test_volumes(name: str, edge: int, size: float, unit: str, data_dir: Path) -> None:
    volume = poresynth.read(data_dir / name)
    assert volume.shape == (edge, edge, edge)
    assert volume.dtype == np.uint8
    assert volume.voxel_size == pytest.approx((size, size, size))
    assert volume.unit == unit
    assert is_two_valued(volume) == ("binary" in name)


def test_bone_is_the_mean_of_its_finer_scan(data_dir: Path) -> None:
    coarse, fine = (poresynth.read(data_dir / f"trabecular_bone_gray_{n}.tif") for n in (100, 200))
    mean = poresynth.downsample(fine, 2)
    assert mean.voxel_size == pytest.approx(coarse.voxel_size)
    assert np.abs(mean.array.astype(int) - coarse.array).max() <= 1


def test_porosity_of_the_rocks(data_dir: Path) -> None:
    for name, porosity in (("berea_sandstone", 0.196), ("ketton_limestone", 0.127)):
        (path,) = data_dir.glob(f"{name}_binary_*.tif")
        volume = poresynth.read(path)
        assert threshold(volume) == 127.5
        assert 1 - binarize(volume).mean() == pytest.approx(porosity, abs=1e-3)


@pytest.mark.parametrize(
    ("name", "channels", "values"),
    [
        ("carbonate.png", 1, 2),
        ("ceramics.png", 1, 2),
        ("sandstone.png", 1, 2),
        ("composite_3phase.png", 1, 3),
        ("honeycombed_0003.jpg", 3, 256),
        ("crosshatched_0014.jpg", 3, 256),
        ("veined_0106.jpg", 3, 256),
    ],
)
def test_images(name: str, channels: int, values: int, data_dir: Path) -> None:
    volume = poresynth.read(data_dir / "2d" / name)
    assert volume.shape[0] == 1
    assert volume.channels == channels
    assert volume.dtype == np.uint8
    assert len(np.unique(volume.array)) <= values
