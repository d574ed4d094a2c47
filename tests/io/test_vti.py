"""VTI, against PyVista."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import poresynth
from poresynth.errors import FileError
from poresynth.volume import Volume

pv: Any = pytest.importorskip("pyvista", reason="needs the extra view")

VOXELS = np.random.default_rng(0).integers(-999, 999, (3, 4, 5)).astype(np.int16)


def test_we_write_pyvista_reads(tmp_path: Path) -> None:
    for array in (VOXELS, np.stack([VOXELS, VOXELS + 1], axis=3), np.asfortranarray(VOXELS)):
        poresynth.write(tmp_path / "a.vti", Volume(array, (3, 2, 1), "µm"))
        image = pv.read(tmp_path / "a.vti")
        assert image.dimensions == (6, 5, 4)
        assert image.spacing == (1, 2, 3)
        seen = image.cell_data["voxels"].reshape(array.shape)
        np.testing.assert_array_equal(seen, array)


@pytest.mark.parametrize("place", ["cell_data", "point_data"])
def test_pyvista_writes_we_read(place: str, tmp_path: Path) -> None:
    extra = 1 if place == "cell_data" else 0
    image = pv.ImageData(dimensions=(5 + extra, 4 + extra, 3 + extra), spacing=(1, 2, 3))
    getattr(image, place)["anything"] = VOXELS.ravel()
    image.save(tmp_path / "a.vti")
    found = poresynth.read(tmp_path / "a.vti")
    np.testing.assert_array_equal(found.array, VOXELS)
    assert found.dtype == np.int16
    assert (found.voxel_size, found.unit) == ((3, 2, 1), "voxel")


def test_files_without_voxels(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    pv.ImageData(dimensions=(3, 3, 3)).save(tmp_path / "a.vti")
    with pytest.raises(FileError, match="without voxels"):
        poresynth.read(tmp_path / "a.vti")
    poresynth.write(tmp_path / "b.vti", VOXELS)
    (tmp_path / "b.vti").write_bytes((tmp_path / "b.vti").read_bytes()[:-200])
    with pytest.raises(FileError, match="truncated"):
        poresynth.read(tmp_path / "b.vti")
    assert capfd.readouterr() == ("", "")
