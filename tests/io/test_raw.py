"""RAW: bare voxels and the sidecars that describe them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import poresynth
from poresynth.errors import FileError, ParameterError
from poresynth.volume import Volume

VOXELS = np.random.default_rng(0).integers(-30_000, 30_000, (3, 4, 5)).astype(np.int16)


@pytest.mark.parametrize("byte_order", ["little", "big"])
@pytest.mark.parametrize("dtype", ["uint8", "int16", "uint32", "float32", "float64", "int64"])
@pytest.mark.parametrize("offset", [0, 352])
def test_the_caller_describes_the_file(
    dtype: str, byte_order: str, offset: int, tmp_path: Path
) -> None:
    array = VOXELS.astype(dtype)
    stored = array.astype(array.dtype.newbyteorder(byte_order))
    (tmp_path / "a.raw").write_bytes(bytes(offset) + stored.tobytes())
    options = {"dtype": dtype, "byte_order": byte_order, "offset": offset}
    for path in (tmp_path / "a.raw", (tmp_path / "a.raw").rename(tmp_path / "b.bin")):
        if path.exists():
            found = poresynth.read(path, shape=(3, 4, 5), **options)
            np.testing.assert_array_equal(found.array, array)
            assert found.dtype == np.dtype(dtype)


def test_images_channels_and_bool(tmp_path: Path) -> None:
    path = tmp_path / "a.raw"
    path.write_bytes(bytes([0, 1, 255, 0, 7, 0]))
    found = poresynth.read(path, shape=(2, 3), dtype=bool)
    np.testing.assert_array_equal(found.array, [[[0, 1, 1], [0, 1, 0]]])
    assert found.dtype == bool
    assert poresynth.read(path, shape=(1, 1, 2, 3), dtype="u1").channels == 3


def test_what_we_write_is_the_bare_voxels(tmp_path: Path) -> None:
    poresynth.write(tmp_path / "a.raw", Volume(np.asfortranarray(VOXELS), 2.5, "µm"))
    assert (tmp_path / "a.raw").read_bytes() == VOXELS.astype("<i2").tobytes()
    assert json.loads((tmp_path / "a.raw.json").read_text()) == {
        "shape": [3, 4, 5],
        "dtype": "int16",
        "voxel_size": [2.5, 2.5, 2.5],
        "unit": "µm",
        "poresynth": {},
        "byte_order": "little",
    }


SIDECARS: dict[str, tuple[str, str]] = {
    "json": (
        "a.json",
        '{"shape": [3, 4, 5], "dtype": "int16", "byte_order": "big",'
        ' "voxel_size": [3, 2, 1], "unit": "um", "else": null}',
    ),
    "text": (
        "a.raw.txt",
        "A scan of something\n\nshape: 3 x 4 x 5\nDtype = short\nbyte order: Big-Endian\n"
        "voxel_size: 3 2 1.0\nunit: micron\n",
    ),
    "text of edges": (
        "a.txt",
        "width=5\nheight=4\ndepth=3\ndtype=int16\nbyte_order=big\nvoxel size=3, 2, 1\nunit=um",
    ),
    "nrrd directions": (
        "a.nhdr",
        "NRRD0005\n# A comment: none\ntype: short\ndimension: 3\nsizes: 5 4 3\nendian: big\n"
        "encoding: raw\nspace directions: (1,0,0) (0,2,0) (0,0,3)\n"
        'space units: "um" "um" "um"\ndata file: a.raw\n',
    ),
    "nrrd spacings": (
        "a.raw.nhdr",
        "NRRD0004\ntype: int16_t\ndimension: 3\nsizes: 5 4 3\nendian: big\nencoding: raw\n"
        'spacings: 1 2 3\nunits: "um" "um" "um"\ndata file: a.raw\n',
    ),
}


@pytest.mark.parametrize("kind", SIDECARS)
def test_sidecars(kind: str, tmp_path: Path) -> None:
    name, text = SIDECARS[kind]
    (tmp_path / "a.raw").write_bytes(VOXELS.astype(">i2").tobytes())
    (tmp_path / name).write_text(text)
    found = poresynth.read(tmp_path / "a.raw")
    np.testing.assert_array_equal(found.array, VOXELS)
    assert found.dtype == np.int16
    assert (found.voxel_size, found.unit) == ((3, 2, 1), "µm")
    # The caller knows better.
    other = poresynth.read(tmp_path / "a.raw", shape=(5, 4, 3), byte_order="little", unit="mm")
    np.testing.assert_array_equal(other.array.ravel(), VOXELS.astype(">i2").ravel().view("<i2"))
    assert other.unit == "mm"


def test_nrrd_headers_of_channels_and_without_a_unit(tmp_path: Path) -> None:
    array = np.arange(3 * 4 * 5 * 2, dtype=np.uint8).reshape(3, 4, 5, 2)
    (tmp_path / "a.raw").write_bytes(bytes(7) + array.tobytes())
    header = (
        "NRRD0004\ntype: uchar\ndimension: 4\nsizes: 2 5 4 3\nencoding: raw\nbyte skip: 7\n"
        "spacings: nan 0.5 0.5 0.5\nkinds: vector domain domain domain\ndata file: a.raw\n"
    )
    (tmp_path / "a.nhdr").write_text(header)
    found = poresynth.read(tmp_path / "a.raw")
    np.testing.assert_array_equal(found.array, array)
    assert (found.voxel_size, found.unit) == ((0.5, 0.5, 0.5), "mm")
    (tmp_path / "a.nhdr").write_text(header.replace("0.5 0.5 0.5", "1 1 1"))
    assert poresynth.read(tmp_path / "a.raw").unit == "voxel"


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.json", "{"),
        ("a.json", "[1]"),
        ("a.nhdr", "NRRD0004\nsizes: 3 4 5\n"),
        ("a.nhdr", "NRRD0004\ntype: short\nsizes: 5 4 3\nencoding: gzip\n"),
        ("a.txt", "\udcff\udcfe"),
    ],
)
def test_sidecars_that_describe_nothing(name: str, text: str, tmp_path: Path) -> None:
    (tmp_path / "a.raw").write_bytes(VOXELS.tobytes())
    (tmp_path / name).write_bytes(text.encode(errors="surrogateescape"))
    with pytest.raises(FileError, match=rf"{name}: not a description of a volume"):
        poresynth.read(tmp_path / "a.raw")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({}, r"shape = None: must be given for a RAW file without a sidecar \(a\.raw\.json"),
        ({"shape": (3, 4, 5)}, "dtype = None: must be given"),
        ({"shape": (3, -4, 5)}, r"shape = \(3, -4, 5\): must be \(z, y, x\)"),
        ({"shape": "wide"}, "shape = wide: must be"),
        ({"shape": 60}, "shape = 60: must be"),
        ({"shape": (60,)}, r"shape = \(60,\): must be"),
        ({"dtype": "complex64"}, "dtype = complex64: must be one of bool, uint8"),
        ({"dtype": "thing"}, "dtype = thing: must be one of bool, uint8"),
        ({"byte_order": "mixed"}, "byte_order = mixed: must be 'little' or 'big'"),
        ({"offset": -1}, "offset = -1: must not be negative"),
    ],
)
def test_wrong_options(options: dict[str, Any], said: str, tmp_path: Path) -> None:
    (tmp_path / "a.raw").write_bytes(VOXELS.tobytes())
    whole = {"shape": (3, 4, 5), "dtype": "int16"}
    given = {**whole, **options} if options and "said" not in options else options
    if options == {"shape": (3, 4, 5)}:
        given = options
    with pytest.raises(ParameterError, match=said):
        poresynth.read(tmp_path / "a.raw", **given)


@pytest.mark.parametrize("size", [1, 119, 121, 1000])
def test_a_file_of_another_length(size: int, tmp_path: Path) -> None:
    (tmp_path / "a.raw").write_bytes(bytes(size))
    said = rf"a\.raw: the file has {size} bytes, but 3 x 4 x 5 int16 takes 120$"
    with pytest.raises(FileError, match=said):
        poresynth.read(tmp_path / "a.raw", shape=(3, 4, 5), dtype="int16")
    with pytest.raises(FileError, match=r"3 x 4 x 5 int16 after 8 bytes takes 128$"):
        poresynth.read(tmp_path / "a.raw", shape=(3, 4, 5), dtype="int16", offset=8)
