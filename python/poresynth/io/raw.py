"""RAW: the bare voxels; their shape and type come from the caller or from a sidecar."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from poresynth.errors import FileError, ParameterError
from poresynth.io.format import FLOATS, WIDE, Content, Format
from poresynth.io.units import spell

__all__ = ["RAW"]

_ORDERS = {"little": "<", "big": ">"}

# The names that C and NRRD have for types, where NumPy has others.
_C_TYPES = {
    "signed char": "int8",
    "uchar": "uint8",
    "unsigned char": "uint8",
    "short": "int16",
    "ushort": "uint16",
    "unsigned short": "uint16",
    "int": "int32",
    "uint": "uint32",
    "unsigned int": "uint32",
    "long long": "int64",
    "longlong": "int64",
    "unsigned long long": "uint64",
    "ulonglong": "uint64",
    "float": "float32",
    "double": "float64",
}


def _read(
    path: Path,
    *,
    shape: tuple[int, ...] | None = None,
    dtype: npt.DTypeLike | None = None,
    byte_order: str | None = None,
    offset: int | None = None,
) -> Content:
    given = {"shape": shape, "dtype": dtype, "byte_order": byte_order, "offset": offset}
    fields = {"byte_order": "little", "offset": 0, **_sidecar(path)}
    fields.update({name: value for name, value in given.items() if value is not None})
    for name in ("shape", "dtype"):
        if name not in fields:
            allowed = f"must be given for a RAW file without a sidecar ({path.name}.json, .txt)"
            raise ParameterError(name, None, allowed)
    edges, type_, order = _shape(fields["shape"]), _type(fields["dtype"]), fields["byte_order"]
    if order not in _ORDERS:
        raise ParameterError("byte_order", order, "must be 'little' or 'big'")
    start, size = int(fields["offset"]), path.stat().st_size
    if start < 0:
        raise ParameterError("offset", start, "must not be negative")
    expected = start + math.prod(edges) * type_.itemsize
    if size != expected:
        described = " x ".join(map(str, edges)) + f" {type_.name}"
        after = f" after {start} bytes" if start else ""
        raise FileError(
            f"{path}: the file has {size} bytes, but {described}{after} takes {expected}"
        )
    stored = np.dtype("u1" if type_.kind == "b" else f"{_ORDERS[order]}{type_.str[1:]}")
    array: npt.NDArray[Any] = np.memmap(path, stored, "r", start, edges)
    if type_.kind == "b":
        array = array != 0
    content = Content(array if len(edges) > 2 else array[np.newaxis])
    if "voxel_size" in fields:
        z, y, x = (float(s) for s in np.broadcast_to(fields["voxel_size"], 3))
        content.voxel_size, content.unit = (z, y, x), spell(str(fields.get("unit", "voxel")))
    return content


def _shape(value: Any) -> tuple[int, ...]:
    try:
        edges = tuple(int(n) for n in value)
    except (TypeError, ValueError):
        edges = ()
    if len(edges) not in (2, 3, 4) or min(edges) < 1:
        raise ParameterError("shape", value, "must be (z, y, x) or (z, y, x, channel), positive")
    return edges


def _type(value: Any) -> np.dtype[Any]:
    if isinstance(value, str):
        value = _C_TYPES.get(value.lower(), value.lower().removesuffix("_t"))
    try:
        name = np.dtype(value).name
    except TypeError:
        name = ""
    if name not in RAW.dtypes:
        raise ParameterError("dtype", value, f"must be one of {', '.join(RAW.dtypes)}")
    dtype: np.dtype[Any] = np.dtype(name)
    return dtype


def _sidecar(path: Path) -> dict[str, Any]:
    """Return the fields of the first sidecar beside a RAW file, such as ``new.raw.json``."""
    parsers = {".json": _json, ".txt": _text, ".nhdr": _nrrd}
    for suffix, parse in parsers.items():
        for sidecar in (path.with_name(path.name + suffix), path.with_suffix(suffix)):
            if sidecar.is_file():
                try:
                    return parse(sidecar.read_text(encoding="utf-8"))
                except (ValueError, KeyError, TypeError) as error:
                    raise FileError(f"{sidecar}: not a description of a volume") from error
    return {}


def _json(text: str) -> dict[str, Any]:
    fields = json.loads(text)
    if not isinstance(fields, dict):
        raise TypeError("not an object")
    return fields


def _text(text: str) -> dict[str, Any]:
    """Parse lines ``name: value`` or ``name = value``, named like the options of `read`.

    ``width``, ``height`` and ``depth`` do instead of ``shape``; other lines are left alone.
    """
    fields: dict[str, Any] = {}
    for line in text.splitlines():
        if match := re.match(r"\s*([\w ]+?)\s*[:=]\s*(.+?)\s*$", line):
            fields[match[1].lower().replace(" ", "_")] = match[2]
    if {"width", "height"} <= fields.keys():
        edges = [fields.get("depth", "1"), fields["height"], fields["width"]]
        fields.setdefault("shape", " ".join(edges))
    if "byte_order" in fields:
        fields["byte_order"] = re.sub(r"[ -]?endian$", "", fields["byte_order"].lower())
    for name, number in (("shape", int), ("voxel_size", float)):
        if name in fields:
            numbers = re.findall(r"\d*\.?\d+(?:[eE][+-]?\d+)?", fields[name])
            fields[name] = [number(n) for n in numbers]
    return fields


def _nrrd(text: str) -> dict[str, Any]:
    """Parse a detached NRRD header, whose axes run from the fastest to the slowest."""
    lines = (line.split(":", 1) for line in text.splitlines() if ": " in line and line[0] != "#")
    raw = {name.strip().lower(): value.strip() for name, value in lines}
    if raw["encoding"].lower() != "raw":
        raise ValueError("the voxels are compressed")
    fields: dict[str, Any] = {
        "shape": [int(n) for n in raw["sizes"].split()][::-1],
        "dtype": raw["type"],
        "byte_order": raw.get("endian", "little").lower(),
        "offset": int(raw.get("byte skip", raw.get("byteskip", 0))),
    }
    if "space directions" in raw:
        vectors = re.findall(r"\(([^)]*)\)", raw["space directions"])
        edges = [math.hypot(*(float(c) for c in v.split(","))) for v in vectors]
    else:
        edges = [float(s) for s in raw.get("spacings", "").split() if s.lower() != "nan"]
    if len(edges) == 3:
        units = re.findall(r'"([^"]*)"', raw.get("space units", raw.get("units", "")))
        fields["voxel_size"] = edges[::-1]
        fields["unit"] = units[-1] if units else "voxel" if edges == [1, 1, 1] else "mm"
    return fields


def _write(path: Path, content: Content) -> None:
    array = content.array
    little = array.dtype.newbyteorder("<")
    with path.open("wb") as file:
        for section in array:  # Piece by piece: Ctrl-C is heard, and other orders need no copy.
            file.write(np.ascontiguousarray(section, little).data)


def _matches(path: Path) -> bool:
    return True  # Any bytes can be voxels.


RAW = Format(
    name="RAW",
    suffixes=(".raw", ".bin"),
    dtypes=("bool", *WIDE, *FLOATS),
    read=_read,
    write=_write,
    matches=_matches,
    sidecar={"byte_order": "little"},
)
