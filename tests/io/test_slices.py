"""Folders of slices, against tifffile and Pillow."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import tifffile
from PIL import Image

import poresynth
from poresynth.errors import FileError, ParameterError
from poresynth.volume import Volume

VOXELS = np.random.default_rng(0).integers(0, 255, (12, 6, 7)).astype(np.uint8)


def save(path: Path, array: np.ndarray) -> None:
    if path.suffix == ".tif":
        tifffile.imwrite(path, array)
    else:
        Image.fromarray(array).save(path)


@pytest.mark.parametrize("suffix", [".tif", ".png", ".bmp"])
@pytest.mark.parametrize("name", ["slice_{}", "{}", "scan 3 layer {} of 12", "S{:03d}"])
def test_names_are_in_natural_order(suffix: str, name: str, tmp_path: Path) -> None:
    for i, section in enumerate(VOXELS):
        save(tmp_path / f"{name.format(i)}{suffix}", section)
    (tmp_path / "log.txt").write_text("not a slice")
    (tmp_path / ".hidden.tif").write_text("not a slice")
    (tmp_path / "previews").mkdir()
    found = poresynth.read(tmp_path)
    np.testing.assert_array_equal(found.array, VOXELS)
    assert found.dtype == np.uint8


def test_the_suffix_may_be_upper_case(tmp_path: Path) -> None:
    for i, section in enumerate(VOXELS):
        save(tmp_path / f"{i}.png", section)
        (tmp_path / f"{i}.png").replace(tmp_path / f"{i}.PNG")
    np.testing.assert_array_equal(poresynth.read(tmp_path).array, VOXELS)


@pytest.mark.parametrize("slices", ["tif", "png", "bmp"])
@pytest.mark.parametrize("array", [VOXELS, VOXELS > 99, np.stack([VOXELS] * 3, axis=3)])
def test_slices_of_every_kind_come_back(slices: str, array: np.ndarray, tmp_path: Path) -> None:
    poresynth.write(tmp_path / "new", Volume(array, (3, 2, 1), "µm"), slices=slices)
    names = sorted(p.name for p in (tmp_path / "new").iterdir())
    assert names[:2] == [f"slice_0000.{slices}", f"slice_0001.{slices}"]
    found = poresynth.read(tmp_path / "new")
    np.testing.assert_array_equal(found.array, array)
    assert found.dtype == array.dtype
    assert (found.voxel_size, found.unit) == ((3, 2, 1), "µm")
    for i, section in enumerate(array):
        seen = np.asarray(Image.open(tmp_path / "new" / names[i]))
        np.testing.assert_array_equal(seen.astype(bool), section.astype(bool))


def test_slices_that_imagej_saved_know_their_scale(tmp_path: Path) -> None:
    for i, section in enumerate(VOXELS):
        fields = {"unit": "um"}
        tifffile.imwrite(
            tmp_path / f"{i}.tif", section, imagej=True, resolution=(0.5, 0.5), metadata=fields
        )
    found = poresynth.read(tmp_path)
    assert (found.voxel_size, found.unit) == ((2, 2, 2), "µm")


def test_a_folder_of_two_kinds_needs_a_word(tmp_path: Path) -> None:
    for i, section in enumerate(VOXELS):
        save(tmp_path / f"{i}.tif", section)
    save(tmp_path / "preview.png", VOXELS[0])
    with pytest.raises(FileError, match=r"holds 12 tif, 1 png; say which with slices="):
        poresynth.read(tmp_path)
    np.testing.assert_array_equal(poresynth.read(tmp_path, slices="tif").array, VOXELS)
    assert poresynth.read(tmp_path, slices="png").shape == (1, 6, 7)
    with pytest.raises(FileError, match=r"holds no slices \(bmp\)"):
        poresynth.read(tmp_path, slices="bmp")
    with pytest.raises(ParameterError, match="slices = gif: must be one of tif, png, bmp"):
        poresynth.read(tmp_path, slices="gif")


@pytest.mark.parametrize(
    ("odd", "said"),
    [
        (VOXELS[0, :5], r"10\.tif: the slice is \(5, 7\) uint8, 0\.tif is \(6, 7\) uint8"),
        (VOXELS[0].astype(np.uint16), r"10\.tif: the slice is \(6, 7\) uint16, 0\.tif is"),
        (VOXELS[:2], r"10\.tif: a slice must be one image, this has 2"),
    ],
)
def test_an_odd_slice_is_named(odd: np.ndarray, said: str, tmp_path: Path) -> None:
    for i, section in enumerate(VOXELS):
        save(tmp_path / f"{i}.tif", section)
    save(tmp_path / "10.tif", odd)
    with pytest.raises(FileError, match=said):
        poresynth.read(tmp_path)


def test_a_broken_slice_is_named(tmp_path: Path) -> None:
    for i, section in enumerate(VOXELS):
        save(tmp_path / f"{i}.png", section)
    whole = (tmp_path / "7.png").read_bytes()
    (tmp_path / "7.png").write_bytes(whole[:-30])
    with pytest.raises(FileError, match=r"7\.png: .*truncated"):
        poresynth.read(tmp_path)
    (tmp_path / "7.png").write_bytes(b"hello, here is no picture")
    with pytest.raises(FileError, match=r"7\.png: not PNG, in spite of its suffix"):
        poresynth.read(tmp_path)


def test_a_folder_with_other_files_is_not_replaced(tmp_path: Path) -> None:
    poresynth.write(tmp_path / "new", VOXELS)
    poresynth.write(tmp_path / "new", VOXELS[:3], slices="png")
    assert len(list((tmp_path / "new").iterdir())) == 3
    (tmp_path / "new" / "notes.txt").write_text("precious")
    with pytest.raises(FileError, match=r"new: the folder exists and holds other files"):
        poresynth.write(tmp_path / "new", VOXELS)
    assert (tmp_path / "new" / "notes.txt").read_text() == "precious"


def test_slices_that_cannot_hold_the_type(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="slices of BMP hold bool, uint8"):
        poresynth.write(tmp_path / "new", VOXELS.astype(np.uint16), slices="bmp")
    with pytest.raises(ParameterError, match="slices = jpg: must be one of"):
        poresynth.write(tmp_path / "new", VOXELS, slices="jpg")
    assert list(tmp_path.iterdir()) == []
