"""A folder of slices: one image a file, in natural order of the names."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

import numpy as np

from poresynth.errors import FileError, ParameterError
from poresynth.io.format import Content, Format
from poresynth.io.image import BMP, PNG
from poresynth.io.tiff import TIFF

__all__ = ["SLICES"]

_KINDS = {"tif": TIFF, "png": PNG, "bmp": BMP}


def _read(path: Path, *, slices: str | None = None) -> Content:
    files = _files(path, slices)
    kind = _KINDS[_kind(files[0]) or "tif"]
    first = _slice(kind, files[0])
    array = np.empty((len(files), *first.array.shape[1:]), first.array.dtype)
    array[0] = first.array[0]
    for i, file in enumerate(files[1:], 1):
        found = _slice(kind, file).array
        if found.shape != first.array.shape or found.dtype != first.array.dtype:
            raise FileError(
                f"{file}: the slice is {found.shape[1:]} {found.dtype.name}, "
                f"{files[0].name} is {first.array.shape[1:]} {first.array.dtype.name}"
            )
        array[i] = found[0]
    return Content(array, first.voxel_size, first.unit)


def _files(path: Path, slices: str | None) -> list[Path]:
    """Return the slices in natural order."""
    if slices is not None and slices not in _KINDS:
        raise ParameterError("slices", slices, f"must be one of {', '.join(_KINDS)}")
    visible = (p for p in path.iterdir() if not p.name.startswith(".") and p.is_file())
    files = sorted((p for p in visible if _kind(p)), key=_natural)
    kinds = Counter(_kind(p) for p in files)
    if slices is None and len(kinds) > 1:
        counts = ", ".join(f"{n} {kind}" for kind, n in kinds.items())
        raise FileError(f"{path}: the folder holds {counts}; say which with slices=")
    files = [p for p in files if slices in (None, _kind(p))]
    if not files:
        raise FileError(f"{path}: the folder holds no slices ({slices or ', '.join(_KINDS)})")
    return files


def _kind(path: Path) -> str | None:
    suffix = path.suffix.lower()
    return next((kind for kind, f in _KINDS.items() if suffix in f.suffixes), None)


def _natural(path: Path) -> tuple[list[tuple[int, str]], str]:
    """Order slice_2 before slice_10; the name itself breaks ties such as 01 and 1."""
    parts = re.split(r"(\d+)", path.name)
    numbered = [(int(p), "") if i % 2 else (-1, p.lower()) for i, p in enumerate(parts)]
    return numbered, path.name


def _slice(kind: Format, file: Path) -> Content:
    if not kind.matches(file):
        raise FileError(f"{file}: not {kind.name}, in spite of its suffix")
    content = kind.load(file)
    if content.array.shape[0] != 1:
        raise FileError(f"{file}: a slice must be one image, this has {content.array.shape[0]}")
    return content


def _write(path: Path, content: Content, *, slices: str = "tif") -> None:
    if slices not in _KINDS:
        raise ParameterError("slices", slices, f"must be one of {', '.join(_KINDS)}")
    kind = _KINDS[slices]
    array = content.array
    if not kind.holds(array.dtype):
        allowed = f"slices of {kind.name} hold {', '.join(kind.dtypes)}"
        raise ParameterError("volume.dtype", array.dtype.name, allowed)
    path.mkdir()
    digits = max(4, len(str(len(array) - 1)))
    for i in range(len(array)):
        section = Content(array[i : i + 1], content.voxel_size, content.unit)
        kind.write(path / f"slice_{i:0{digits}d}{kind.suffixes[0]}", section)


def _matches(path: Path) -> bool:
    return path.is_dir()


def _may_replace(path: Path) -> bool:
    return all(_kind(p) for p in path.iterdir())


SLICES = Format(
    name="a folder of slices",
    suffixes=(),
    dtypes=TIFF.dtypes,
    read=_read,
    write=_write,
    matches=_matches,
    folder=True,
    may_replace=_may_replace,
)
