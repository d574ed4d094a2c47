"""What a file's own fields cannot hold: the exact scale, that voxels are bool, the provenance.

The header is one JSON object. It lies inside the file where the format has a natural place and in
the sidecar ``<name>.json`` beside it.
"""

from __future__ import annotations

import json
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from poresynth.errors import ParameterError
from poresynth.io.format import Content
from poresynth.io.units import NANOMETRES, convert, spell
from poresynth.volume import Volume

__all__ = ["decode", "encode", "make", "read_sidecar", "restore", "sidecar_path"]

# A scale that went through float32 or a ratio of integers differs by less; an edited one by more.
_SAME = 1e-4


def make(volume: Volume) -> dict[str, Any]:
    """Return the header of a volume.

    Raises
    ------
    ParameterError
        If ``volume.metadata["poresynth"]`` is not a JSON-compatible dict.
    """
    provenance = volume.metadata.get("poresynth", {})
    allowed = "must be a JSON-compatible dict"
    if not isinstance(provenance, dict):
        raise ParameterError("volume.metadata['poresynth']", provenance, allowed)
    try:
        provenance = json.loads(json.dumps(provenance, default=_plain))
    except (TypeError, ValueError) as error:
        message = f"{allowed} ({error})"
        raise ParameterError("volume.metadata['poresynth']", "{…}", message) from error
    return {
        "shape": list(volume.array.shape),
        "dtype": volume.dtype.name,
        "voxel_size": list(volume.voxel_size),
        "unit": spell(volume.unit),
        "poresynth": provenance,
    }


def _plain(value: Any) -> Any:
    """Return what JSON can hold for the types that programs leave in a dict unnoticed."""
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    if isinstance(value, PathLike):
        return str(value)
    raise TypeError(f"a {type(value).__name__} cannot be written as JSON")


def encode(header: dict[str, Any]) -> str:
    """Return a header as one line of ASCII text, which every format can hold."""
    return json.dumps(header)


def decode(text: str) -> dict[str, Any] | None:
    """Return the header in a text, or None if the text is something else."""
    try:
        header = json.loads(text)
        ours = (
            isinstance(header["poresynth"], dict)
            and isinstance(header["unit"], str)
            and isinstance(header["dtype"], str)
            and len(header["shape"]) in (3, 4)
            and len(header["voxel_size"]) == 3
        )
    except (ValueError, TypeError, KeyError, IndexError):
        return None
    return header if ours else None


def sidecar_path(path: Path) -> Path:
    """Return where the sidecar of a file or folder lies."""
    return path.with_name(f"{path.name}.json")


def read_sidecar(path: Path) -> dict[str, Any] | None:
    """Return the header in the sidecar of a file; None if there is none."""
    try:
        return decode(sidecar_path(path).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError):
        return None


def restore(content: Content, header: dict[str, Any] | None) -> Volume:
    """Return what a file holds as a volume, with what its header adds.

    A header of another shape belongs to another volume and adds nothing. A scale that another
    program has changed since stays as that program wrote it.
    """
    if header is None or tuple(header["shape"]) != content.array.shape:
        return Volume(content.array, content.voxel_size, content.unit)
    array, size, unit = content.array, content.voxel_size, content.unit
    if header["dtype"] == "bool" and array.dtype == np.uint8:
        solid = array == 255
        if np.array_equal(solid, array != 0):
            array = solid
    z, y, x = header["voxel_size"]
    # Formats forget how thick an image is.
    known = slice(None) if array.shape[0] > 1 else slice(1, None)
    if _agree(size, unit, (z, y, x), header["unit"], known):
        size, unit = (z, y, x), header["unit"]
    metadata = {"poresynth": header["poresynth"]} if header["poresynth"] else {}
    return Volume(array, size, unit, metadata)


def _agree(
    size: tuple[float, float, float],
    unit: str,
    header_size: tuple[float, float, float],
    header_unit: str,
    known: slice,
) -> bool:
    """Whether a file's own scale is unknown or, along the known axes, the header's."""
    if unit in NANOMETRES and header_unit in NANOMETRES:
        size, unit = convert(size, unit, header_unit), header_unit
    unknown = unit == "voxel"
    same = bool(np.allclose(size[known], header_size[known], rtol=_SAME, atol=0))
    return (unknown and size == (1.0, 1.0, 1.0)) or (same and (unknown or unit == header_unit))
