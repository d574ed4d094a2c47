"""PNG, JPEG and BMP, against Pillow."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import poresynth
from poresynth.errors import FileError, ParameterError

GRAY = np.random.default_rng(0).integers(0, 255, (20, 30)).astype(np.uint8)
RGB = np.random.default_rng(1).integers(0, 255, (20, 30, 3)).astype(np.uint8)


@pytest.mark.parametrize("suffix", [".png", ".bmp"])
@pytest.mark.parametrize("array", [GRAY, RGB, GRAY > 99])
def test_pillow_writes_we_read_and_back(suffix: str, array: np.ndarray, tmp_path: Path) -> None:
    Image.fromarray(array).save(tmp_path / f"a{suffix}")
    found = poresynth.read(tmp_path / f"a{suffix}").array
    np.testing.assert_array_equal(found[0], array)
    assert found.dtype == array.dtype
    poresynth.write(tmp_path / f"b{suffix}", found)
    with Image.open(tmp_path / f"b{suffix}") as image:
        np.testing.assert_array_equal(np.asarray(image), array)


def test_sixteen_bits_of_gray(tmp_path: Path) -> None:
    array = np.arange(600, dtype=np.uint16).reshape(20, 30) * 109
    Image.fromarray(array).save(tmp_path / "a.png")
    np.testing.assert_array_equal(poresynth.read(tmp_path / "a.png").array[0], array)


def test_sixteen_bits_of_colour_are_not_halved_in_silence(tmp_path: Path) -> None:
    Image.fromarray(RGB).save(tmp_path / "a.png")
    data = bytearray((tmp_path / "a.png").read_bytes())
    data[24] = 16  # The bit depth in the header chunk.
    import zlib

    data[29:33] = zlib.crc32(data[12:29]).to_bytes(4, "big")
    (tmp_path / "a.png").write_bytes(data)
    with pytest.raises(FileError, match="16-bit colour; save it as TIFF"):
        poresynth.read(tmp_path / "a.png")


def test_palettes_are_expanded(tmp_path: Path) -> None:
    phases = Image.fromarray((GRAY // 100).astype(np.uint8), mode=None).convert("P")
    phases.putpalette([0, 0, 0, 127, 127, 127, 254, 254, 254])
    phases.save(tmp_path / "gray.png")
    found = poresynth.read(tmp_path / "gray.png").array
    np.testing.assert_array_equal(found[0], GRAY // 100 * 127)
    phases.putpalette([255, 0, 0, 0, 255, 0, 0, 0, 255])
    phases.save(tmp_path / "colour.bmp")
    found = poresynth.read(tmp_path / "colour.bmp").array
    np.testing.assert_array_equal(found[0], np.eye(3, dtype=np.uint8)[GRAY // 100] * 255)


@pytest.mark.parametrize("mode", ["RGBA", "LA"])
def test_alpha_is_refused(mode: str, tmp_path: Path) -> None:
    Image.fromarray(RGB).convert(mode).save(tmp_path / "a.png")
    with pytest.raises(FileError, match=r"a\.png: has transparency .*convert\('RGB'\)"):
        poresynth.read(tmp_path / "a.png")


def test_transparent_colours_are_refused(tmp_path: Path) -> None:
    Image.fromarray(RGB).save(tmp_path / "a.png", transparency=(1, 2, 3))
    with pytest.raises(FileError, match="has transparency"):
        poresynth.read(tmp_path / "a.png")


def test_jpeg(tmp_path: Path) -> None:
    smooth = np.add.outer(np.arange(64), np.arange(64)).astype(np.uint8)
    for array in (smooth, np.stack([smooth, smooth[::-1], smooth[:, ::-1]], axis=2)):
        for name in ("a.jpg", "a.jpeg"):
            poresynth.write(tmp_path / name, array[np.newaxis])
            found = poresynth.read(tmp_path / name).array[0]
            assert found.shape == array.shape
            assert np.abs(found.astype(int) - array).max() <= 8
    Image.fromarray(RGB).convert("CMYK").save(tmp_path / "b.jpg")
    with pytest.raises(FileError, match="colours of kind CMYK; save it as gray or RGB"):
        poresynth.read(tmp_path / "b.jpg")


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".bmp"])
def test_only_images_are_written(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"a{suffix}"
    with pytest.raises(ParameterError, match=r"holds an image, \(1, y, x\)"):
        poresynth.write(path, np.zeros((2, 3, 4), np.uint8))
    with pytest.raises(ParameterError, match="holds one channel, or three"):
        poresynth.write(path, np.zeros((1, 3, 4, 2), np.uint8))
    assert list(tmp_path.iterdir()) == []
