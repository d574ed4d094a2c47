"""MetaImage, NRRD and NIfTI, through SimpleITK. Axes run x, y, z there, and edges are in mm."""

from __future__ import annotations

import gzip
import importlib
import math
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from poresynth.errors import ParameterError
from poresynth.io import header
from poresynth.io.format import FLOATS, WIDE, Content, Format, FormatError
from poresynth.io.quiet import quiet
from poresynth.io.units import NANOMETRES, convert

__all__ = ["META", "NIFTI", "NRRD"]

_KEY = "poresynth"


# MetaImage cannot read back a field of 32 KiB; the sidecar has what is left out.
_LONGEST = 16_384


def _simple_itk() -> Any:
    return importlib.import_module("SimpleITK")


def _read(path: Path) -> Content:
    sitk = _simple_itk()
    try:
        with quiet():
            image = sitk.ReadImage(str(path))
    except RuntimeError as error:  # Its text speaks of missing files for every damage.
        raise FormatError("truncated or damaged") from error
    if image.GetDimension() > 3:
        raise FormatError(f"has edges {image.GetSize()}; only z, y, x and one channel axis")
    array = sitk.GetArrayFromImage(image)
    edges = image.GetSpacing()[::-1]
    if image.GetDimension() == 2:
        array, edges = array[np.newaxis], (edges[-1], *edges)
    content = Content(array)
    if edges != (1, 1, 1):  # What these formats say when nobody gave a scale.
        content.voxel_size, content.unit = edges, "mm"
    if image.HasMetaDataKey(_KEY):
        content.header = header.decode(image.GetMetaData(_KEY))
    return content


def _write(path: Path, content: Content) -> None:
    sitk = _simple_itk()
    array = np.ascontiguousarray(content.array)
    image = sitk.GetImageFromArray(array, isVector=array.ndim == 4)
    if content.unit in NANOMETRES:
        image.SetSpacing(convert(content.voxel_size, content.unit, "mm")[::-1])
    text = header.encode(content.header) if content.header else ""
    if text and len(text) < _LONGEST:
        image.SetMetaData(_KEY, text)
    with quiet():
        sitk.WriteImage(image, str(path))
    if path.suffix in (".mhd", ".nhdr"):
        # The header names the file of the voxels, which will be renamed with it.
        lines = path.read_bytes()
        path.write_bytes(lines.replace(b".partial-", b""))


def _companions(path: Path) -> tuple[Path, ...]:
    """Return the file of the voxels, for the formats that have one beside the header."""
    return (path.with_suffix(".raw"),) if path.suffix.lower() in (".mhd", ".nhdr") else ()


def _read_nifti(path: Path) -> Content:
    stored = _nifti_voxels(path)
    content = _read(path)
    if stored is not None and stored.dtype.kind == "f" and not np.isfinite(stored).all():
        # ITK reads NaN and infinite voxels as zeros. Channels are the slowest axis in the file.
        array = content.array
        planar = array.reshape(*array.shape[:3], -1).transpose(3, 0, 1, 2)
        stored = stored.reshape(planar.shape)
        planar[...] = np.where(np.isfinite(stored), planar, stored)
    return content


def _write_nifti(path: Path, content: Content) -> None:
    shape = content.array.shape
    if len(shape) == 4 and shape[:2] == (1, 1):  # ITK would write what it cannot read.
        raise ParameterError("volume.shape", shape, "NIfTI holds no line of several channels")
    _write(path, content)
    _nifti_voxels(path)  # ITK does not notice here that the disk is full.


def _nifti_voxels(path: Path) -> npt.NDArray[Any] | None:
    """Return the voxels as stored, to find what ITK reads as zeros in silence: missing ones, NaN.

    None for NIfTI-2, which ITK reads with checks of its own.
    """
    data = path.read_bytes()
    if path.suffix.lower() == ".gz":
        data = gzip.decompress(data)
    order = "<" if data[:4] == struct.pack("<i", 348) else ">"
    if len(data) < 348 or struct.unpack_from(order + "i", data)[0] != 348:
        return None
    count, *edges = struct.unpack_from(order + "8h", data, 40)
    kind, bits = struct.unpack_from(order + "2h", data, 70)
    (offset,) = struct.unpack_from(order + "f", data, 108)
    expected = int(offset) + math.prod(edges[:count]) * bits // 8
    if len(data) < expected:
        raise FormatError(f"truncated: it has {len(data)} bytes of {expected}")
    dtype = {16: "f4", 64: "f8"}.get(kind, f"V{max(bits // 8, 1)}")
    return np.frombuffer(data, order + dtype, math.prod(edges[:count]), int(offset))


def _starts_with(*starts: bytes) -> Callable[[Path], bool]:
    def matches(path: Path) -> bool:
        with path.open("rb") as file:
            return file.read(16).startswith(starts)

    return matches


META = Format(
    name="MetaImage",
    suffixes=(".mha", ".mhd"),
    dtypes=("bool", *WIDE, *FLOATS),
    read=_read,
    write=_write,
    matches=_starts_with(b"ObjectType", b"NDims", b"Comment"),
    companions=_companions,
    holds_header=True,
    package="SimpleITK",
    extra="io",
)
NRRD = Format(
    name="NRRD",
    suffixes=(".nrrd", ".nhdr"),
    dtypes=("bool", *WIDE, *FLOATS),
    read=_read,
    write=_write,
    matches=_starts_with(b"NRRD"),
    companions=_companions,
    holds_header=True,
    package="SimpleITK",
    extra="io",
)
NIFTI = Format(
    name="NIfTI",
    suffixes=(".nii", ".nii.gz"),
    dtypes=("bool", *WIDE, *FLOATS),
    read=_read_nifti,
    write=_write_nifti,
    matches=_starts_with(b"\x5c\1\0\0", b"\0\0\1\x5c", b"\x1c\2\0\0", b"\0\0\2\x1c", b"\x1f\x8b"),
    package="SimpleITK",
    extra="io",
)
