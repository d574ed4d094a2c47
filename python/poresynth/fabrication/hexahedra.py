"""Voxels as hexahedra for finite elements: Abaqus and CalculiX."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from poresynth.errors import ParameterError

__all__ = ["write_inp"]

Progress = Callable[[str, float], object]

# Corners (z, y, x) of a C3D8: round the lower face anticlockwise from above, then the upper one.
_CORNERS = (
    (0, 0, 0),
    (0, 0, 1),
    (0, 1, 1),
    (0, 1, 0),
    (1, 0, 0),
    (1, 0, 1),
    (1, 1, 1),
    (1, 1, 0),
)
_ENDS = ("XMIN", "XMAX", "YMIN", "YMAX", "ZMIN", "ZMAX")
# Numbers on a line: 16 is the most that the format allows.
_LINE = 16
_ROWS = 1 << 14

_Numbers = npt.NDArray[np.int64]


def write_inp(
    path: Path,
    solid: npt.NDArray[np.bool_],
    *,
    voxel_size: tuple[float, float, float] = (1.0, 1.0, 1.0),
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0),
    unit: str = "voxel",
    name: str = "SOLID",
    progress: Progress | None = None,
) -> tuple[int, int]:
    """Write the voxels of a solid as eight-node bricks that share their nodes.

    Parameters
    ----------
    path : Path
        The file.
    solid : numpy.ndarray of bool
        Shape (z, y, x).
    voxel_size : (float, float, float), default (1.0, 1.0, 1.0)
        Edges of a voxel along (z, y, x), in ``unit``.
    origin : (float, float, float), default (0.0, 0.0, 0.0)
        Position (z, y, x) of the outer corner of the first voxel, in ``unit``.
    unit : str, default "voxel"
        Unit of length, for the heading.
    name : str, default "SOLID"
        Name of the set of all elements.
    progress : callable, optional
        ``progress(stage, fraction)``; what it raises ends the work.

    Returns
    -------
    (int, int)
        Numbers of nodes and of elements.

    Raises
    ------
    ParameterError
        If there is no solid voxel.

    Notes
    -----
    Elements C3D8 in the set ``name``; the nodes on the outer faces of the volume are in the sets
    XMIN, XMAX, YMIN, YMAX, ZMIN and ZMAX, for loads and supports. Numbers run from 1, along x
    first. Material and steps are the user's. Written plane by plane: peak memory 30 bytes a voxel
    of a plane and 8 bytes a node of the outer faces.
    """
    if not solid.any():
        raise ParameterError("volume", "no solid voxel", "must have one to be written")
    depth = solid.shape[0] + 1
    counts = [int(np.count_nonzero(plane)) for plane in _used(solid)]
    starts = np.concatenate([[0], np.cumsum(counts)])
    elements = 0
    report = progress or (lambda stage, share: None)
    with path.open("wb") as file:
        _line(file, f"*HEADING\nporesynth: hexahedra of voxels, lengths in {unit}\n*NODE")
        ends: dict[str, list[_Numbers]] = {name: [] for name in _ENDS}
        for z, used in enumerate(_used(solid)):
            row, column = np.nonzero(used)
            index = (column, row, np.full(len(row), z))
            number = np.arange(starts[z], starts[z] + len(row)) + 1
            places = [origin[2 - i] + voxel_size[2 - i] * index[i] for i in range(3)]
            _rows(file, "%d,%.9g,%.9g,%.9g\n", [number, *places])
            for i in range(3):
                ends[_ENDS[2 * i]].append(number[index[i] == 0])
                ends[_ENDS[2 * i + 1]].append(number[index[i] == solid.shape[2 - i]])
            report("nodes", (z + 1) / (2 * depth))
        _line(file, f"*ELEMENT,TYPE=C3D8,ELSET={name}")
        numbers = _numbered(solid, starts)
        below = next(numbers)
        for z, plane in enumerate(solid):
            above = next(numbers)
            y, x = np.nonzero(plane)
            corners = [(above if dz else below)[y + dy, x + dx] for dz, dy, dx in _CORNERS]
            element = np.arange(elements, elements + len(x)) + 1
            _rows(file, "%d" + 8 * ",%d" + "\n", [element, *corners])
            elements += len(x)
            below = above
            report("elements", 0.5 + (z + 1) / (2 * depth))
        for end, parts in ends.items():
            members = np.concatenate(parts)
            if len(members):
                _line(file, f"*NSET,NSET={end}")
                _listed(file, members)
    return int(starts[-1]), elements


def _used(solid: npt.NDArray[np.bool_]) -> Iterator[npt.NDArray[np.bool_]]:
    """Yield which nodes of each plane of nodes belong to a solid voxel, shape (y + 1, x + 1)."""
    depth, height, width = solid.shape
    for z in range(depth + 1):
        used = np.zeros((height + 1, width + 1), dtype=bool)
        for plane in solid[max(z - 1, 0) : z + 1]:
            for dy in (0, 1):
                for dx in (0, 1):
                    used[dy : height + dy, dx : width + dx] |= plane
        yield used


def _numbered(solid: npt.NDArray[np.bool_], starts: _Numbers) -> Iterator[_Numbers]:
    """Yield the numbers of the nodes of each plane of nodes."""
    for used, start in zip(_used(solid), starts, strict=False):
        yield np.cumsum(used, dtype=np.int64).reshape(used.shape) + start


def _line(file: BinaryIO, text: str) -> None:
    file.write(f"{text}\n".encode("ascii", "replace"))


def _rows(file: BinaryIO, line: str, columns: list[npt.NDArray[Any]]) -> None:
    """Write columns by a format of one line."""
    for start in range(0, len(columns[0]), _ROWS):
        block = [column[start : start + _ROWS].tolist() for column in columns]
        flat = tuple(value for row in zip(*block, strict=True) for value in row)
        file.write((line * len(block[0]) % flat).encode("ascii"))


def _listed(file: BinaryIO, numbers: _Numbers) -> None:
    for start in range(0, len(numbers), _LINE):
        _line(file, ",".join(map(str, numbers[start : start + _LINE].tolist())))
