"""NPZ: NumPy's file of named arrays; ours holds the voxels, the scale and the header."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from poresynth.errors import ParameterError
from poresynth.io import header
from poresynth.io.format import FLOATS, WIDE, Content, Format
from poresynth.io.units import spell

__all__ = ["NPZ"]


def _read(path: Path, *, name: str | None = None) -> Content:
    with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
        arrays = {n: file[n] for n in (file.files if name is None else [name]) if n in file}
        images = [n for n, array in arrays.items() if array.ndim in (2, 3, 4)]
        if len(images) != 1:
            raise ParameterError("name", name, f"must be an image or volume of {file.files}")
        array = arrays[images[0]]
        content = Content(array if array.ndim > 2 else array[np.newaxis])
        if "voxel_size" in file.files and file["voxel_size"].shape == (3,):
            z, y, x = (float(s) for s in file["voxel_size"])
            content.voxel_size = (z, y, x)
        if "unit" in file.files:
            content.unit = spell(str(file["unit"]))
        if "header" in file.files:
            content.header = header.decode(str(file["header"]))
        return content


def _write(path: Path, content: Content) -> None:
    fields: dict[str, Any] = {
        "array": content.array,
        "voxel_size": np.array(content.voxel_size),
        "unit": np.array(content.unit),
    }
    if content.header:
        fields["header"] = np.array(header.encode(content.header))
    # As numpy.savez_compressed, which leaves its archive open when the disk is full.
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for name, array in fields.items():
            with file.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, array, allow_pickle=False)


def _matches(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(4) == b"PK\3\4"


NPZ = Format(
    name="NPZ",
    suffixes=(".npz",),
    dtypes=("bool", *WIDE, *FLOATS),
    read=_read,
    write=_write,
    matches=_matches,
    holds_bool=True,
    holds_header=True,
)
