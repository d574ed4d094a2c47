"""What cannot be read or written is said in one line, and leaves nothing behind."""

from __future__ import annotations

import importlib.util
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import poresynth
from poresynth.errors import FileError, MissingExtraError, ParameterError
from poresynth.io import check_output, formats
from poresynth.io.format import Format
from poresynth.volume import Volume

VOXELS = np.random.default_rng(0).integers(0, 255, (5, 60, 70)).astype(np.uint8)
NAMES = [f.name for f in formats()]
FILES = [f.name for f in formats() if not f.folder]


def path_for(folder: Path, format_: Format) -> Path:
    return folder / f"new{(format_.suffixes or ('',))[0]}"


def voxels_for(format_: Format) -> np.ndarray[Any, Any]:
    return VOXELS[:1] if format_.name in ("PNG", "JPEG", "BMP") else VOXELS


def test_unknown_suffixes_list_the_known(tmp_path: Path) -> None:
    (tmp_path / "a.xyz").write_bytes(b"1")
    known = r"unknown suffix '\.xyz'; known are \.tif, \.tiff, \.npy, .*\.nii\.gz, \.vti$"
    with pytest.raises(FileError, match=known):
        poresynth.read(tmp_path / "a.xyz")
    with pytest.raises(FileError, match=known):
        poresynth.write(tmp_path / "b.xyz", VOXELS)
    with pytest.raises(FileError, match=known):
        check_output(tmp_path / "b.xyz")


def test_missing_files_and_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(FileError, match=r"^no\.tif: no such file or folder$"):
        poresynth.read("no.tif")
    for function in (check_output, lambda path: poresynth.write(path, VOXELS)):
        with pytest.raises(FileError, match=r"^no/a\.tif: the folder .*/no does not exist$"):
            function("no/a.tif")
    Path("file").write_bytes(b"1")
    with pytest.raises(FileError, match=r"^file/a\.tif: .* is a file, not a folder"):
        poresynth.write("file/a.tif", VOXELS)


def test_a_folder_without_slices(tmp_path: Path) -> None:
    (tmp_path / "log.txt").write_text("hello")
    with pytest.raises(FileError, match=r"holds no slices \(tif, png, bmp\)"):
        poresynth.read(tmp_path)


def test_empty_files(tmp_path: Path) -> None:
    (tmp_path / "a.tif").touch()
    with pytest.raises(FileError, match=r"a\.tif: the file is empty$"):
        poresynth.read(tmp_path / "a.tif")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes are POSIX")
def test_pipes_and_devices(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.tif")
    with pytest.raises(FileError, match="is not a regular file"):
        poresynth.read(tmp_path / "a.tif")
    with pytest.raises(FileError, match="is not a regular file"):
        poresynth.write(tmp_path / "a.tif", VOXELS)
    assert not (tmp_path / "a.tif").is_file()


@pytest.mark.parametrize("name", [n for n in FILES if n != "RAW"])
def test_other_content_than_the_suffix_says(
    name: str, tmp_path: Path, format_named: Callable[[str], Format]
) -> None:
    path = path_for(tmp_path, format_named(name))
    np.save(tmp_path / "a.npy", VOXELS)
    (tmp_path / "a.npy").replace(path)
    if name != "NPY":
        said = rf"not {name}, in spite of its suffix: its content is NPY$"
        with pytest.raises(FileError, match=said):
            poresynth.read(path)
    path.write_bytes(b"nothing that anybody knows")
    with pytest.raises(FileError, match=rf"not {name}, in spite of its suffix$"):
        poresynth.read(path)


@pytest.mark.parametrize("name", [n for n in FILES if n != "TIFF"])
def test_truncated_files(name: str, tmp_path: Path, format_named: Callable[[str], Format]) -> None:
    format_ = format_named(name)
    path, array = path_for(tmp_path, format_), voxels_for(format_)
    poresynth.write(path, array)
    expected = poresynth.read(path).array.copy()
    whole, messages = path.read_bytes(), []
    for end in [1, *np.linspace(20, len(whole) - 1, 40).astype(int)]:
        path.write_bytes(whole[:end])
        try:
            found = poresynth.read(path)
        except FileError as error:
            messages.append(str(error))
        else:  # Only an end mark is missing.
            np.testing.assert_array_equal(found.array, expected)
    assert len(messages) >= 38
    assert all(m.startswith(f"{path}: ") and "\n" not in m for m in messages)


def test_errors_are_chained(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", VOXELS)
    (tmp_path / "a.npy").write_bytes((tmp_path / "a.npy").read_bytes()[:-1])
    with pytest.raises(FileError) as caught:
        poresynth.read(tmp_path / "a.npy")
    assert isinstance(caught.value.__cause__, ValueError)
    assert isinstance(caught.value, OSError)


def test_unreadable_files(public_folder: Path, drop_privileges: Callable[[], None]) -> None:
    file, closed = public_folder / "a.npy", public_folder / "closed"
    np.save(file, VOXELS)
    poresynth.read(file)
    closed.mkdir()
    for path in (file, closed):
        path.chmod(0)
    drop_privileges()
    for path in (file, closed, closed / "a.npy"):
        with pytest.raises(FileError, match=rf"^{re.escape(str(path))}: permission denied"):
            poresynth.read(path)


def test_unwritable_folders_and_files(
    public_folder: Path, drop_privileges: Callable[[], None]
) -> None:
    closed, folder = public_folder / "closed", public_folder / "open"
    closed.mkdir(mode=0o555)
    folder.mkdir()
    folder.chmod(0o777)
    (folder / "a.npy").write_bytes(b"precious")
    (folder / "a.npy").chmod(0o444)
    drop_privileges()
    for function in (check_output, lambda path: poresynth.write(path, VOXELS)):
        with pytest.raises(FileError, match="permission denied to write into"):
            function(closed / "a.npy")
        with pytest.raises(FileError, match="exists and is read-only"):
            function(folder / "a.npy")
    assert (folder / "a.npy").read_bytes() == b"precious"
    poresynth.write(folder / "b.npy", VOXELS)


@pytest.mark.parametrize("name", NAMES)
def test_unknown_options(name: str, tmp_path: Path, format_named: Callable[[str], Format]) -> None:
    format_ = format_named(name)
    path = path_for(tmp_path, format_)
    with pytest.raises(ParameterError, match=f"colour = 3: is not an option of {name}; it has "):
        poresynth.write(path, voxels_for(format_), colour=3)
    assert list(tmp_path.iterdir()) == []
    poresynth.write(path, voxels_for(format_))
    with pytest.raises(ParameterError, match=f"colour = 3: is not an option of {name}; it has "):
        poresynth.read(path, colour=3)


@pytest.mark.parametrize(("suffix", "extra"), [(".mha", "io"), (".nii.gz", "io"), (".vti", "view")])
def test_a_missing_extra_is_named(
    suffix: str, extra: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    starts = {".mha": b"ObjectType", ".nii.gz": b"\x1f\x8b", ".vti": b'<VTKFile type="ImageData"'}
    path = tmp_path / f"a{suffix}"
    with pytest.raises(MissingExtraError, match=rf"poresynth\[{extra}\]"):
        poresynth.write(path, VOXELS)
    with pytest.raises(MissingExtraError, match=rf"poresynth\[{extra}\]"):
        check_output(path)
    path.write_bytes(starts[suffix])
    with pytest.raises(MissingExtraError, match=rf"poresynth\[{extra}\]"):
        poresynth.read(path)
    missing = {f.name: f.unavailable for f in formats() if f.unavailable}
    assert missing.keys() == {"MetaImage", "NRRD", "NIfTI", "VTI"}
    assert missing["VTI"] == "needs vtk: pip install 'poresynth[view]'"


def test_check_output_foresees_what_write_refuses(tmp_path: Path) -> None:
    check_output(tmp_path / "a.tif", Volume(VOXELS))
    with pytest.raises(ParameterError, match=r"volume\.dtype = int64: TIFF holds bool, uint8"):
        check_output(tmp_path / "a.tif", Volume(VOXELS.astype(np.int64)))
    (tmp_path / "a.npy").mkdir()
    with pytest.raises(FileError, match="is a folder, not a file"):
        check_output(tmp_path / "a.npy")
    (tmp_path / "a.zarr").touch()
    with pytest.raises(FileError, match="is a file, not a folder"):
        check_output(tmp_path / "a.zarr")


@pytest.mark.parametrize("name", NAMES)
def test_a_full_disk(name: str, tiny_disk: Path, format_named: Callable[[str], Format]) -> None:
    format_ = format_named(name)
    random = np.random.default_rng(0)
    shape = (1, 900, 900) if name in ("PNG", "JPEG", "BMP") else (10, 300, 300)
    array = random.integers(0, 255, shape).astype(np.uint8)
    path = path_for(tiny_disk, format_)
    poresynth.write(path, array[..., :100, :100])
    before = {p: p.is_file() and p.read_bytes() for p in tiny_disk.rglob("*")}
    with pytest.raises(FileError, match=r"new.*: no room left on the disk$"):
        poresynth.write(path, array)
    assert {p: p.is_file() and p.read_bytes() for p in tiny_disk.rglob("*")} == before


@pytest.mark.parametrize("suffix", [".tif", ".npy", ".zarr", "", ".raw"])
def test_no_room_when_flushing(
    suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(FileError, match="no room left on the disk"):
        poresynth.write(tmp_path / f"new{suffix}", VOXELS)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", NAMES)
def test_a_writer_that_fails_leaves_what_was_there(
    name: str, tmp_path: Path, format_named: Callable[[str], Format]
) -> None:
    format_ = format_named(name)
    path = path_for(tmp_path, format_)
    poresynth.write(path, voxels_for(format_))
    before = {p: p.is_file() and p.read_bytes() for p in tmp_path.rglob("*")}

    def fail(temporary: Path, content: object) -> None:
        temporary.write_bytes(b"half")
        raise RuntimeError("first line\nthe cause")

    write = format_.write
    object.__setattr__(format_, "write", fail)
    try:
        with pytest.raises(FileError, match=r"new.*: the cause$"):
            poresynth.write(path, voxels_for(format_))
    finally:
        object.__setattr__(format_, "write", write)
    assert {p: p.is_file() and p.read_bytes() for p in tmp_path.rglob("*")} == before
