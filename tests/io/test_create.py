"""Volumes written part by part."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile

from poresynth import io
from poresynth.errors import FileError, ParameterError
from poresynth.volume import Volume

ORIGIN = {"poresynth": {"engine": "none", "seed": 3}}
DTYPES = ["bool", "uint8", "uint16", "int32", "float32", "float64"]


def like(volume: Volume) -> Volume:
    """The same without voxels."""
    blank = np.broadcast_to(np.zeros((), volume.dtype), volume.array.shape)
    return volume.with_array(blank)


def parts(shape: tuple[int, ...], edge: int) -> Any:
    for corner in itertools.product(*(range(0, n, edge) for n in shape)):
        yield tuple(slice(c, c + edge) for c in corner)


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("name", ["new.tif", "new.ome.tif", "new.zarr"])
def test_parts_are_the_whole(
    tmp_path: Path, name: str, dtype: str, rng: np.random.Generator
) -> None:
    array = rng.integers(0, 2 if dtype == "bool" else 200, (17, 30, 23)).astype(dtype)
    volume = Volume(array, (2.0, 1.5, 1.5), "µm", ORIGIN)
    with io.create(tmp_path / name, like(volume)) as writer:
        for box in parts(array.shape, 9):
            writer[box] = array[box]
            back = writer[box]
            assert back.dtype == array.dtype
            np.testing.assert_array_equal(back, array[box])
    found = io.read(tmp_path / name)
    assert found.dtype == array.dtype
    assert np.array_equal(found.array, array)
    assert (found.voxel_size, found.unit) == (volume.voxel_size, volume.unit)
    assert found.metadata == ORIGIN
    # The same file as in one piece.
    io.write(tmp_path / f"whole-{name}", volume)
    if name.endswith("tif"):
        layouts = []
        for path in (tmp_path / name, tmp_path / f"whole-{name}"):
            with tifffile.TiffFile(path) as file:
                series = file.series[0]
                layouts.append((series.axes, series.shape, series.dataoffset is None))
        assert layouts[0] == layouts[1]


def test_nothing_is_left_of_work_that_stops(tmp_path: Path) -> None:
    blank = Volume(np.broadcast_to(np.uint8(0), (8, 8, 8)))

    def stop(name: str) -> None:
        with io.create(tmp_path / name, blank) as writer:
            writer[0:4, 0:4, 0:4] = np.ones((4, 4, 4), np.uint8)
            raise ZeroDivisionError

    for name in ("new.tif", "new.zarr"):
        with pytest.raises(ZeroDivisionError):
            stop(name)
    assert list(tmp_path.iterdir()) == []


def test_what_is_not_set_is_zero(tmp_path: Path) -> None:
    blank = Volume(np.broadcast_to(np.uint8(7), (8, 8, 8)))
    for name in ("new.tif", "new.zarr"):
        with io.create(tmp_path / name, blank) as writer:
            writer[0:4, 0:4, 0:4] = np.ones((4, 4, 4), np.uint8)
        assert io.read(tmp_path / name).array.sum() == 64


def test_formats_of_one_piece_and_channels_are_refused(tmp_path: Path) -> None:
    blank = Volume(np.broadcast_to(np.uint8(0), (8, 8, 8)))
    with pytest.raises(FileError, match="only TIFF and Zarr can be written part by part"):
        io.create(tmp_path / "new.npz", blank).__enter__()
    colours = Volume(np.broadcast_to(np.uint8(0), (8, 8, 8, 3)))
    with pytest.raises(ParameterError, match=r"must be \(z, y, x\)"):
        io.create(tmp_path / "new.tif", colours).__enter__()


def test_a_disk_without_room_is_said_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import errno
    import os

    def full(*arguments: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "posix_fallocate", full)
    blank = Volume(np.broadcast_to(np.uint8(0), (8, 8, 8)))
    with pytest.raises(FileError, match="no room left on the disk"):
        io.create(tmp_path / "new.tif", blank).__enter__()
    assert list(tmp_path.iterdir()) == []
