"""STL: binary, and ASCII with a solid for each patch. Written in blocks."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from poresynth.meshes.mesh import Mesh

__all__ = ["write_stl"]

# Triangles that are written at a time.
_BLOCK = 1 << 16
_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_FACET = (
    "facet normal %.6g %.6g %.6g\n outer loop\n  vertex %.9g %.9g %.9g\n  vertex %.9g %.9g %.9g\n"
    "  vertex %.9g %.9g %.9g\n endloop\nendfacet\n"
)


def write_stl(path: Path, mesh: Mesh) -> None:
    """Write a mesh as STL.

    Parameters
    ----------
    path : Path
        The file.
    mesh : Mesh
        One with patches is written as ASCII, a solid for each patch that has triangles: so
        snappyHexMesh and cfMesh of OpenFOAM read named patches.

    Notes
    -----
    Peak memory: a few MB.
    """
    with path.open("wb") as file:
        if mesh.patches is None:
            _write_binary(file, mesh)
        else:
            for patch, name in enumerate(mesh.patch_names):
                faces = mesh.faces[mesh.patches == patch]
                if len(faces):
                    _write_solid(file, name, mesh.vertices, faces)


def _write_binary(file: BinaryIO, mesh: Mesh) -> None:
    # A header that begins with "solid" would be taken for ASCII.
    file.write(f"poresynth, lengths in {mesh.unit}".encode("ascii", "replace").ljust(80))
    file.write(np.uint32(len(mesh.faces)).astype("<u4").tobytes())
    for normals, corners in _blocks(mesh.vertices, mesh.faces):
        records = np.zeros(len(corners), dtype=_RECORD)
        records["normal"], records["corners"] = normals, corners
        file.write(records.tobytes())


def _write_solid(
    file: BinaryIO, name: str, vertices: npt.NDArray[Any], faces: npt.NDArray[np.int32]
) -> None:
    file.write(f"solid {name}\n".encode("ascii"))
    for normals, corners in _blocks(vertices, faces):
        numbers = np.concatenate([normals, corners.reshape(-1, 9)], axis=1)
        file.write((_FACET * len(numbers) % tuple(numbers.ravel().tolist())).encode("ascii"))
    file.write(f"endsolid {name}\n".encode("ascii"))


def _blocks(
    vertices: npt.NDArray[Any], faces: npt.NDArray[np.int32]
) -> Iterator[tuple[npt.NDArray[Any], npt.NDArray[Any]]]:
    """Yield normals, shape (n, 3), and corners, shape (n, 3, 3), of blocks of triangles."""
    for start in range(0, len(faces), _BLOCK):
        corners = vertices[faces[start : start + _BLOCK]]
        sides = (corners[:, 1:] - corners[:, :1]).astype(np.float64)
        normals = np.cross(sides[:, 0], sides[:, 1])
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        yield normals / np.where(length > 0, length, 1), corners
