"""The header: provenance, exact scale and bool, inside the file and beside it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import tifffile

import poresynth
from poresynth.errors import ParameterError
from poresynth.io import header
from poresynth.volume import Volume

VOXELS = np.arange(24, dtype=np.uint8).reshape(2, 3, 4)
PROVENANCE = {"engine": "volume", "seed": 3}


def synthetic(array: np.ndarray = VOXELS, **scale: object) -> Volume:
    return Volume(array, metadata={"poresynth": PROVENANCE}, **scale)


def info(path: Path) -> str:
    with tifffile.TiffFile(path) as file:
        return file.imagej_metadata["Info"]


def test_the_sidecar_is_one_json_object(tmp_path: Path) -> None:
    poresynth.write(tmp_path / "new.tif", synthetic(voxel_size=19.5, unit="µm"))
    assert json.loads((tmp_path / "new.tif.json").read_text()) == {
        "shape": [2, 3, 4],
        "dtype": "uint8",
        "voxel_size": [19.5, 19.5, 19.5],
        "unit": "µm",
        "poresynth": PROVENANCE,
    }


@pytest.mark.parametrize("suffix", [".tif", ".npz", ".zarr"])
def test_the_file_alone_is_enough(suffix: str, tmp_path: Path) -> None:
    poresynth.write(tmp_path / f"new{suffix}", synthetic(voxel_size=1 / 3, unit="µm"))
    (tmp_path / f"new{suffix}.json").unlink()
    found = poresynth.read(tmp_path / f"new{suffix}")
    assert found.metadata == {"poresynth": PROVENANCE}
    assert (found.voxel_size, found.unit) == ((1 / 3,) * 3, "µm")


def test_units_are_spelled_one_way(tmp_path: Path) -> None:
    for suffix in (".tif", ".npy", ".npz", ".zarr"):
        poresynth.write(tmp_path / f"new{suffix}", Volume(VOXELS, 1 / 3, "um"))
        found = poresynth.read(tmp_path / f"new{suffix}")
        assert (found.voxel_size, found.unit) == ((1 / 3,) * 3, "µm")


def test_a_sidecar_that_no_longer_holds_goes(tmp_path: Path) -> None:
    poresynth.write(tmp_path / "new.npy", synthetic())
    poresynth.write(tmp_path / "new.npy", VOXELS)
    assert [p.name for p in tmp_path.iterdir()] == ["new.npy"]


def test_a_foreign_json_stays(tmp_path: Path) -> None:
    (tmp_path / "new.npy.json").write_text('{"mine": true}')
    poresynth.write(tmp_path / "new.npy", VOXELS)
    assert (tmp_path / "new.npy.json").read_text() == '{"mine": true}'
    assert poresynth.read(tmp_path / "new.npy").metadata == {}


def test_the_sidecar_of_another_volume_is_ignored(tmp_path: Path) -> None:
    poresynth.write(tmp_path / "new.npy", synthetic(voxel_size=2, unit="mm"))
    np.save(tmp_path / "new.npy", np.zeros((5, 5, 5)))
    found = poresynth.read(tmp_path / "new.npy")
    assert (found.metadata, found.voxel_size, found.unit) == ({}, (1, 1, 1), "voxel")


def test_a_scale_changed_by_another_program_holds(tmp_path: Path) -> None:
    path = tmp_path / "new.tif"
    poresynth.write(path, synthetic(voxel_size=19.5, unit="µm"))
    edited = {"axes": "ZYX", "spacing": 40.0, "unit": "um", "Info": info(path)}
    tifffile.imwrite(path, VOXELS, imagej=True, resolution=(1 / 20, 1 / 20), metadata=edited)
    found = poresynth.read(path)
    assert found.voxel_size == pytest.approx((40, 20, 20))
    assert found.metadata == {"poresynth": PROVENANCE}


def test_bool_that_another_program_edited_stays_gray(tmp_path: Path) -> None:
    poresynth.write(tmp_path / "new.raw", VOXELS > 9)
    poresynth.write(tmp_path / "new.tif", VOXELS > 9)
    edited = {"axes": "ZYX", "Info": info(tmp_path / "new.tif")}
    tifffile.imwrite(tmp_path / "new.tif", VOXELS, imagej=True, metadata=edited)
    np.testing.assert_array_equal(poresynth.read(tmp_path / "new.tif"), VOXELS)
    assert poresynth.read(tmp_path / "new.raw").dtype == bool


def test_numpy_numbers_and_paths_in_the_provenance_are_written(tmp_path: Path) -> None:
    given = {"porosity": np.float64(0.5), "shape": np.array([1, 2]), "path": Path("a.tif")}
    poresynth.write(tmp_path / "a.npz", Volume(VOXELS, metadata={"poresynth": given}))
    found = poresynth.read(tmp_path / "a.npz").metadata["poresynth"]
    assert found == {"porosity": 0.5, "shape": [1, 2], "path": "a.tif"}


@pytest.mark.parametrize("given", ["text", {"engine": object()}, {"engine": {1, 2}}])
def test_provenance_must_be_json(given: object, tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="JSON-compatible"):
        poresynth.write(tmp_path / "a.npz", Volume(VOXELS, metadata={"poresynth": given}))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "text",
    [
        "",
        "no json",
        "[1, 2]",
        "3",
        '{"poresynth": {}}',
        '{"poresynth": 1, "shape": [1, 1, 1], "dtype": "u1", "voxel_size": [1, 1, 1], "unit": ""}',
        '{"poresynth": {}, "shape": 3, "dtype": "u1", "voxel_size": [1, 1, 1], "unit": ""}',
    ],
)
def test_other_texts_are_no_headers(text: str) -> None:
    assert header.decode(text) is None
