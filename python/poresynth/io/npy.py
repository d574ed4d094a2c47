"""NPY: NumPy's own file of one array."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from poresynth.io.format import FLOATS, WIDE, Content, Format

__all__ = ["NPY"]


def _read(path: Path) -> Content:
    array = np.load(path, mmap_mode="r", allow_pickle=False)
    return Content(array[np.newaxis] if array.ndim == 2 else array)


def _write(path: Path, content: Content) -> None:
    array = content.array
    with path.open("wb") as file:
        np.lib.format.write_array_header_1_0(
            file,
            {
                "descr": np.lib.format.dtype_to_descr(array.dtype),
                "fortran_order": False,
                "shape": array.shape,
            },
        )
        for section in array:  # Piece by piece: Ctrl-C is heard, and other orders need no copy.
            file.write(np.ascontiguousarray(section).data)


def _matches(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(6) == b"\x93NUMPY"


NPY = Format(
    name="NPY",
    suffixes=(".npy",),
    dtypes=("bool", *WIDE, *FLOATS),
    read=_read,
    write=_write,
    matches=_matches,
    holds_bool=True,
)
