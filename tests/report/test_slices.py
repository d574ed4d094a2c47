"""Slices of a report."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from poresynth.report.slices import central_part, gray_window, png, scale_bar, slice_picture
from poresynth.volume import Volume


def pixels(picture: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(picture)))


def test_a_slice_is_the_middle_one_and_one_pixel_a_voxel() -> None:
    array = np.arange(3 * 4 * 5, dtype=np.uint8).reshape(3, 4, 5)
    for axis in range(3):
        expected = array.take(array.shape[axis] // 2, axis=axis)
        picture = pixels(slice_picture(Volume(array), axis, (0, 255)))
        np.testing.assert_array_equal(picture, expected)


@pytest.mark.parametrize("dtype", [bool, np.uint8, np.int16, np.float32])
def test_every_type_fills_the_range_of_grays(dtype: type) -> None:
    array = (np.arange(8).reshape(2, 2, 2) > 3).astype(dtype)
    picture = pixels(slice_picture(Volume(array), 1, gray_window(array)))
    assert set(picture.ravel().tolist()) == {0, 255}


def test_channels_are_colours() -> None:
    array = np.zeros((2, 3, 4, 3), dtype=np.uint8)
    array[..., 2] = 255
    picture = pixels(slice_picture(Volume(array), 0, (0, 255)))
    assert picture.shape == (3, 4, 3)
    assert (picture == [0, 0, 255]).all()


def test_two_channels_show_the_first() -> None:
    array = np.zeros((2, 3, 4, 2), dtype=np.uint8)
    array[..., 0] = 255
    assert pixels(slice_picture(Volume(array), 0, (0, 255))).shape == (3, 4)


def test_a_constant_volume_has_a_window() -> None:
    low, high = gray_window(np.full((3, 3, 3), 7))
    assert low < 7 < high


def test_outliers_do_not_darken_the_picture() -> None:
    array = np.linspace(0, 100, 10_000).reshape(10, 10, 100)
    array[0, 0, 0] = 1e6
    assert gray_window(array)[1] < 101


def test_a_much_larger_volume_is_shown_by_its_centre() -> None:
    exemplar, volume = Volume(np.zeros((10, 10, 10))), Volume(np.zeros((10, 40, 25)))
    assert central_part(volume, exemplar).shape == (10, 25, 25)


@pytest.mark.parametrize(
    ("extent", "unit", "length", "label"),
    [
        (3900, "µm", 1000, "1 mm"),
        (600, "µm", 200, "200 µm"),
        (64, "voxel", 20, "20 voxels"),
        (3, "voxel", 1, "1 voxel"),
        (0.7, "mm", 0.2, "0.2 mm"),
    ],
)
def test_scale_bars_are_round(extent: float, unit: str, length: float, label: str) -> None:
    drawn, text = scale_bar(extent, unit)
    assert drawn == pytest.approx(length)
    assert text == label


def test_a_picture_survives_its_encoding() -> None:
    picture = np.random.default_rng(0).integers(0, 256, (5, 6, 4), dtype=np.uint8)
    np.testing.assert_array_equal(pixels(png(picture)), picture)
