"""Files of meshes: STL, 3MF, PLY, OBJ and VTP."""

from __future__ import annotations

import importlib
import importlib.util
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from poresynth.errors import FileError, MissingExtraError, ParameterError, PoresynthError
from poresynth.io import check_writable, output
from poresynth.io.units import spell
from poresynth.meshes.mesh import Mesh
from poresynth.meshes.stl import write_stl

__all__ = ["READABLE", "SUFFIXES", "check_output", "read", "write"]


@dataclass(frozen=True)
class _Format:
    """How meshes are written to files of a suffix.

    Parameters
    ----------
    name : str
        As people call it.
    write : callable
        ``write(path, mesh)``.
    packages : tuple of str
        What it needs.
    extra : str
        The extra that brings them.
    """

    name: str
    write: Callable[[Path, Mesh], None]
    packages: tuple[str, ...] = ()
    extra: str = "mesh"


def read(path: str | os.PathLike[str], *, unit: str | None = None) -> Mesh:
    """Read a mesh; vertices at one place become one.

    Parameters
    ----------
    path : path_like
        STL, PLY, OBJ or 3MF.
    unit : str, optional
        Unit of length; default: what the file says, which only 3MF does, else ``"voxel"``.

    Returns
    -------
    Mesh
        float64 vertices, not checked: see `poresynth.meshes.check`.

    Raises
    ------
    FileError
        If the file cannot be read, or holds no triangles.
    MissingExtraError
        Without the extra ``mesh``.

    Notes
    -----
    Peak memory: trimesh's, some 500 bytes a triangle.
    """
    given, path = path, Path(path)
    if path.suffix.lower() not in READABLE:
        raise FileError(f"{given}: unknown suffix {path.suffix!r}; known are {', '.join(READABLE)}")
    _require(_FORMATS[path.suffix.lower()].name, _TRIMESH, "mesh")
    trimesh: Any = importlib.import_module("trimesh")
    try:
        if path.stat().st_size == 0:
            raise FileError(f"{given}: the file is empty")
        found = trimesh.load_mesh(str(path), process=False)
        found.merge_vertices(merge_tex=True, merge_norm=True)
        vertices, faces = np.array(found.vertices), np.array(found.faces)
    except (PoresynthError, MemoryError):
        raise
    except OSError as error:
        raise FileError.because(given, error) from error
    except Exception as error:  # Libraries raise what they like; the user gets one line.
        said = FileError.because(given, error)
        raise FileError(f"{said} (truncated, damaged, or not what its suffix says)") from error
    if not len(faces):
        raise FileError(f"{given}: holds no triangles")
    if not np.isfinite(vertices).all():
        raise FileError(f"{given}: holds NaN or infinite positions")
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    if unit is None:
        unit = "voxel" if found.units is None else found.units.rstrip("s")
    return Mesh(vertices.astype(np.float64), faces.astype(np.int32), spell(unit))


def write(path: str | os.PathLike[str], mesh: Mesh) -> None:
    """Write a mesh; the file appears whole or not at all.

    Parameters
    ----------
    path : path_like
        The suffix picks the format: STL (``.stl``, binary; ASCII with a solid for each patch if the
        mesh has patches), and with the extra ``mesh`` 3MF (``.3mf``), PLY (``.ply``, binary) and
        OBJ (``.obj``); with the extra ``view`` VTP (``.vtp``), for ParaView.
    mesh : Mesh
        With at least one triangle. 3MF is in millimetres whatever its unit; the other formats have
        no unit and take the numbers as they are. A mesh of unknown scale has a millimetre a voxel.

    Raises
    ------
    FileError
        If the suffix is unknown, the folder is missing or not writable, or there is no room.
    MissingExtraError
        If the format needs an optional package.
    ParameterError
        If the mesh has no triangle.

    Notes
    -----
    Peak memory: a few MB for STL, three copies of the mesh for PLY and VTP, about 1 kB a triangle
    for 3MF and OBJ.
    """
    given, path = path, Path(path)
    check_output(given)
    if not len(mesh.faces):
        raise ParameterError("mesh", "no triangles", "must have at least one to be written")
    try:
        with output(given) as (temporary,):
            _FORMATS[path.suffix.lower()].write(temporary, mesh)
    except (PoresynthError, MemoryError):
        raise
    except Exception as error:  # Writers raise what they like; the user gets one line.
        raise FileError.because(given, error) from error


def check_output(path: str | os.PathLike[str]) -> None:
    """Raise unless `write` can write to a path, so that long work can fail before it begins.

    Parameters
    ----------
    path : path_like
        The output to be.

    Raises
    ------
    FileError, MissingExtraError
        As `write` does.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in _FORMATS:
        raise FileError(f"{path}: unknown suffix {suffix!r}; known are {', '.join(SUFFIXES)}")
    format_ = _FORMATS[suffix]
    _require(format_.name, format_.packages, format_.extra)
    check_writable(path)


def _require(name: str, packages: tuple[str, ...], extra: str) -> None:
    if not all(importlib.util.find_spec(package) for package in packages):
        raise MissingExtraError(name, extra)


def _by_trimesh(path: Path, mesh: Mesh) -> None:
    trimesh: Any = importlib.import_module("trimesh")
    whole = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    # Nine digits hold float32 exactly.
    options = {"digits": 9} if path.suffix.lower() == ".obj" else {}
    content = whole.export(file_type=path.suffix.lower()[1:], **options)
    path.write_bytes(content.encode("utf-8") if isinstance(content, str) else content)


def _write_3mf(path: Path, mesh: Mesh) -> None:
    _by_trimesh(path, mesh if mesh.unit == "voxel" else mesh.in_unit("mm"))


def _write_vtp(path: Path, mesh: Mesh) -> None:
    pyvista: Any = importlib.import_module("pyvista")
    surface = pyvista.PolyData.from_regular_faces(mesh.vertices, mesh.faces)
    if mesh.patches is not None:
        surface.cell_data["patch"] = mesh.patches
    surface.save(str(path))


_TRIMESH = ("trimesh", "networkx", "lxml")
_FORMATS = {
    ".stl": _Format("STL", write_stl),
    ".3mf": _Format("3MF", _write_3mf, _TRIMESH),
    ".ply": _Format("PLY", _by_trimesh, _TRIMESH),
    ".obj": _Format("OBJ", _by_trimesh, _TRIMESH),
    ".vtp": _Format("VTP", _write_vtp, ("pyvista",), "view"),
}
SUFFIXES = tuple(_FORMATS)
"""Suffixes of the files that `write` writes."""

READABLE = (".stl", ".3mf", ".ply", ".obj")
"""Suffixes of the files that `read` reads."""
