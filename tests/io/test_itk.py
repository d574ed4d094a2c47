"""MetaImage, NRRD and NIfTI, against SimpleITK."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import poresynth
from poresynth.errors import FileError, ParameterError
from poresynth.volume import Volume

sitk: Any = pytest.importorskip("SimpleITK", reason="needs the extra io")

VOXELS = np.random.default_rng(0).integers(-999, 999, (3, 4, 5)).astype(np.int16)
SUFFIXES = [".mha", ".mhd", ".nrrd", ".nhdr", ".nii", ".nii.gz"]
pytestmark = pytest.mark.parametrize("suffix", SUFFIXES)


def test_simpleitk_writes_we_read(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"a{suffix}"
    for array, vector in ((VOXELS, False), (np.stack([VOXELS, VOXELS + 1], axis=3), True)):
        image = sitk.GetImageFromArray(array, isVector=vector)
        image.SetSpacing((0.25, 0.5, 2.0))
        image.SetOrigin((7, 8, 9))
        sitk.WriteImage(image, str(path))
        found = poresynth.read(path)
        np.testing.assert_array_equal(found.array, array)
        assert found.dtype == np.int16
        assert (found.voxel_size, found.unit) == ((2.0, 0.5, 0.25), "mm")


def test_we_write_simpleitk_reads(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"a{suffix}"
    for array in (VOXELS, np.stack([VOXELS, VOXELS + 1], axis=3)):
        poresynth.write(path, Volume(array, (2000, 500, 250), "µm"))
        image = sitk.ReadImage(str(path))
        np.testing.assert_array_equal(sitk.GetArrayFromImage(image), array)
        assert image.GetSpacing() == (0.25, 0.5, 2.0)
    poresynth.write(path, VOXELS > 0)
    image = sitk.ReadImage(str(path))
    np.testing.assert_array_equal(sitk.GetArrayFromImage(image), (VOXELS > 0) * 255)


def test_an_edge_of_one_is_no_scale(suffix: str, tmp_path: Path) -> None:
    sitk.WriteImage(sitk.GetImageFromArray(VOXELS), str(tmp_path / f"a{suffix}"))
    assert poresynth.read(tmp_path / f"a{suffix}").unit == "voxel"


def test_images_and_movies(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"a{suffix}"
    image = sitk.GetImageFromArray(VOXELS[0])
    image.SetSpacing((0.5, 0.25))
    sitk.WriteImage(image, str(path))
    found = poresynth.read(path)
    assert found.array.shape == (1, 4, 5)
    assert found.voxel_size == (0.5, 0.25, 0.5)
    movie = sitk.GetImageFromArray(np.stack([VOXELS, VOXELS]), isVector=False)
    sitk.WriteImage(movie, str(path))
    with pytest.raises(FileError, match=r"has edges \(5, 4, 3, 2\)"):
        poresynth.read(path)


def test_long_provenance(suffix: str, tmp_path: Path) -> None:
    provenance = {"command": "x" * 100_000}
    path = tmp_path / f"a{suffix}"
    poresynth.write(path, Volume(VOXELS, metadata={"poresynth": provenance}))
    assert poresynth.read(path).metadata == {"poresynth": provenance}


def test_infinite_voxels_of_others(suffix: str, tmp_path: Path) -> None:
    array = VOXELS.astype(np.float32)
    array[0, 1, 2], array[2, 3, 4] = np.nan, -np.inf
    sitk.WriteImage(sitk.GetImageFromArray(array), str(tmp_path / f"a{suffix}"))
    np.testing.assert_array_equal(poresynth.read(tmp_path / f"a{suffix}"), array)


def test_nothing_is_printed(suffix: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / f"a{suffix}"
    poresynth.write(path, VOXELS)
    data = path.with_suffix(".raw") if suffix in (".mhd", ".nhdr") else path
    data.write_bytes(data.read_bytes()[:-20])
    with pytest.raises(FileError, match=r"truncated|damaged"):
        poresynth.read(path)
    assert capfd.readouterr() == ("", "")


def test_headers_and_their_data(suffix: str, tmp_path: Path) -> None:
    path, data = tmp_path / f"a{suffix}", tmp_path / "a.raw"
    data.write_bytes(b"precious")
    if suffix in (".mhd", ".nhdr"):
        with pytest.raises(FileError, match=r"would replace a\.raw, which is not part of it"):
            poresynth.write(path, VOXELS)
        data.unlink()
        poresynth.write(path, VOXELS)
        poresynth.write(path, VOXELS + 1)
        assert b".partial" not in path.read_bytes()
        np.testing.assert_array_equal(poresynth.read(path), VOXELS + 1)
    else:
        poresynth.write(path, VOXELS)
        assert data.read_bytes() == b"precious"


def test_lines_of_channels(suffix: str, tmp_path: Path) -> None:
    line = np.zeros((1, 1, 5, 2), np.uint8)
    if suffix.startswith(".nii"):
        with pytest.raises(ParameterError, match="NIfTI holds no line"):
            poresynth.write(tmp_path / f"a{suffix}", line)
    else:
        poresynth.write(tmp_path / f"a{suffix}", line)
        assert poresynth.read(tmp_path / f"a{suffix}").array.shape == line.shape
