"""Zarr, against zarr-python and the text of OME-NGFF."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zarr

import poresynth
from poresynth.errors import FileError, ParameterError
from poresynth.volume import Volume

VOXELS = np.random.default_rng(0).integers(0, 60_000, (5, 140, 9)).astype(np.uint16)
MODERN = int(zarr.__version__.split(".")[0]) >= 3
VERSIONS = [2, pytest.param(3, marks=pytest.mark.skipif(not MODERN, reason="needs zarr 3"))]


def store(path: Path, version: int, **arrays: np.ndarray) -> Any:
    """Write a group as zarr-python does."""
    if MODERN:
        group: Any = zarr.open_group(str(path), mode="w", zarr_format=version)
    else:
        group = zarr.open_group(str(path), mode="w")
    for name, array in arrays.items():
        create = group.create_array if MODERN else group.create_dataset
        create(name, shape=array.shape, dtype=array.dtype, chunks=array.shape)[...] = array
    return group


@pytest.mark.parametrize("version", VERSIONS)
def test_what_we_write_is_an_ome_zarr(version: int, tmp_path: Path) -> None:
    array = np.stack([VOXELS, VOXELS + 1], axis=3)
    poresynth.write(tmp_path / "a.zarr", Volume(array, (3, 2, 1), "µm"), version=version)
    group: Any = zarr.open_group(str(tmp_path / "a.zarr"), mode="r")
    np.testing.assert_array_equal(group["0"][...], np.moveaxis(array, 3, 0))
    assert group["0"].chunks == (1, 5, 128, 9)
    attributes = dict(group.attrs)
    if version == 2:
        assert (tmp_path / "a.zarr" / "0" / ".zarray").exists()
        assert (tmp_path / "a.zarr" / "0" / "0" / "0" / "0" / "0").exists()  # Separated by "/".
        image = attributes["multiscales"][0]
        assert image["version"] == "0.4"
    else:
        document = json.loads((tmp_path / "a.zarr" / "0" / "zarr.json").read_text())
        assert document["zarr_format"] == 3
        assert document["dimension_names"] == ["c", "z", "y", "x"]
        assert attributes["ome"]["version"] == "0.5"
        image = attributes["ome"]["multiscales"][0]
    assert image["axes"] == [
        {"name": "c", "type": "channel"},
        *({"name": n, "type": "space", "unit": "micrometer"} for n in "zyx"),
    ]
    scale = {"type": "scale", "scale": [1, 3, 2, 1]}
    assert image["datasets"] == [{"path": "0", "coordinateTransformations": [scale]}]


@pytest.mark.parametrize("version", VERSIONS)
def test_plain_arrays(version: int, tmp_path: Path) -> None:
    for array in (VOXELS, VOXELS.astype(np.float64), VOXELS > 99, VOXELS.astype(">u2")):
        options = {"zarr_format": version} if MODERN else {}
        z = zarr.open(
            str(tmp_path / "a.zarr"),
            mode="w",
            shape=array.shape,
            dtype=array.dtype,
            chunks=(2, 50, 9),
            **options,
        )
        z[...] = array
        found = poresynth.read(tmp_path / "a.zarr")
        np.testing.assert_array_equal(found.array, array)
        assert found.dtype == array.dtype.newbyteorder("=")
    with pytest.raises(ParameterError, match="name = x: must be left out"):
        poresynth.read(tmp_path / "a.zarr", name="x")


@pytest.mark.parametrize("version", VERSIONS)
def test_groups_of_arrays(version: int, tmp_path: Path) -> None:
    store(tmp_path / "a.zarr", version, one=VOXELS)
    np.testing.assert_array_equal(poresynth.read(tmp_path / "a.zarr"), VOXELS)
    store(tmp_path / "b", version, one=VOXELS, two=VOXELS[0])
    with pytest.raises(ParameterError, match="name = None: must be one of one, two"):
        poresynth.read(tmp_path / "b")
    assert poresynth.read(tmp_path / "b", name="two").shape == (1, 140, 9)


def multiscales(version: int, scales: list[list[float]], axes: list[Any], **more: Any) -> Any:
    datasets = [
        {"path": str(i), "coordinateTransformations": [{"type": "scale", "scale": scale}]}
        for i, scale in enumerate(scales)
    ]
    image = {"axes": axes, "datasets": datasets, **more}
    return {"multiscales": [image]} if version == 2 else {"ome": {"multiscales": [image]}}


@pytest.mark.parametrize("version", VERSIONS)
def test_pyramids_of_others(version: int, tmp_path: Path) -> None:
    array = VOXELS[np.newaxis, np.newaxis]
    group = store(tmp_path / "a.zarr", version, **{"0": array, "1": array[..., ::2, ::2]})
    axes = [
        {"name": "t", "type": "time", "unit": "second"},
        {"name": "c", "type": "channel"},
        *({"name": n, "type": "space", "unit": "micrometer"} for n in "zyx"),
    ]
    whole = [{"type": "scale", "scale": [1, 1, 10, 10, 10]}]
    group.attrs.update(
        multiscales(
            version,
            [[1, 1, 0.3, 0.2, 0.1], [1, 1, 0.3, 0.4, 0.2]],
            axes,
            coordinateTransformations=whole,
        )
    )
    found = poresynth.read(tmp_path / "a.zarr")
    np.testing.assert_array_equal(found.array, VOXELS)
    assert found.voxel_size == (3, 2, 1)
    assert found.unit == "µm"


@pytest.mark.parametrize("version", VERSIONS)
def test_images_movies_and_collections(version: int, tmp_path: Path) -> None:
    space = [{"name": n, "type": "space", "unit": "millimeter"} for n in "yx"]
    group = store(tmp_path / "image.zarr", version, **{"0": VOXELS[0]})
    group.attrs.update(multiscales(version, [[2, 2]], space))
    found = poresynth.read(tmp_path / "image.zarr")
    assert found.array.shape == (1, 140, 9)
    assert (found.voxel_size, found.unit) == ((2, 2, 2), "mm")

    group = store(tmp_path / "movie.zarr", version, **{"0": VOXELS})
    group.attrs.update(multiscales(version, [[1, 2, 2]], [{"name": "t"}, *space]))
    with pytest.raises(FileError, match="only z, y, x and channels"):
        poresynth.read(tmp_path / "movie.zarr")

    # The layout of bioformats2raw: one image a group.
    group = store(tmp_path / "many.zarr", version)
    inner = store(tmp_path / "many.zarr" / "0", version, **{"0": VOXELS})
    volume = multiscales(version, [[1, 2, 2]], [{"name": "z"}, *space])
    inner.attrs.update(volume)
    np.testing.assert_array_equal(poresynth.read(tmp_path / "many.zarr"), VOXELS)
    store(tmp_path / "many.zarr" / "1", version, **{"0": VOXELS}).attrs.update(volume)
    with pytest.raises(ParameterError, match="name = None: must be one of 0, 1"):
        poresynth.read(tmp_path / "many.zarr")
    np.testing.assert_array_equal(poresynth.read(tmp_path / "many.zarr", name="1"), VOXELS)


def test_axes_of_the_first_versions(tmp_path: Path) -> None:
    group = store(tmp_path / "a.zarr", 2, **{"0": VOXELS[np.newaxis, np.newaxis]})
    group.attrs.update({"multiscales": [{"version": "0.1", "datasets": [{"path": "0"}]}]})
    np.testing.assert_array_equal(poresynth.read(tmp_path / "a.zarr"), VOXELS)
    group.attrs.update(
        {"multiscales": [{"axes": ["t", "c", "z", "y", "x"], "datasets": [{"path": "0"}]}]}
    )
    assert poresynth.read(tmp_path / "a.zarr").unit == "voxel"


@pytest.mark.parametrize("version", VERSIONS)
def test_a_damaged_store(version: int, tmp_path: Path) -> None:
    path = tmp_path / "a.zarr"
    poresynth.write(path, VOXELS, version=version)
    # The chunks, named "0" or "1" in folders, and the metadata of the array.
    files = [p for p in (path / "0").rglob("*") if p.is_file() and p.name != ".zattrs"]
    assert len(files) == 3
    for file in files:
        whole = file.read_bytes()
        for end in (0, 1, len(whole) // 2, len(whole) - 1):
            file.write_bytes(whole[:end])
            with pytest.raises(FileError, match=r"a\.zarr: .*damaged, or not Zarr"):
                poresynth.read(path)
        file.write_bytes(whole)
    np.testing.assert_array_equal(poresynth.read(path), VOXELS)


def test_options(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="version = 4: must be 2 or 3"):
        poresynth.write(tmp_path / "a.zarr", VOXELS, version=4)
    (tmp_path / "a.zarr").mkdir()
    (tmp_path / "a.zarr" / "notes.txt").touch()
    with pytest.raises(FileError, match="holds other files"):
        poresynth.write(tmp_path / "a.zarr", VOXELS)
