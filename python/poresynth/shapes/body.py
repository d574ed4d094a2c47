"""Closed bodies from files of meshes: what is wrong with one is repaired and said, or refused."""

from __future__ import annotations

import importlib
import os
from dataclasses import dataclass
from typing import Any

import numpy as np

from poresynth import meshes
from poresynth.errors import MissingExtraError, ParameterError
from poresynth.meshes import Mesh
from poresynth.meshes.checks import count_edges, volume

__all__ = ["Body", "closed_body", "read_body"]


@dataclass(frozen=True)
class Body:
    """A closed body.

    Attributes
    ----------
    mesh : Mesh
        Closed, its normals pointing outwards.
    repairs : tuple of str
        What was done to make it so, a sentence each; empty for a body that was sound.
    """

    mesh: Mesh
    repairs: tuple[str, ...] = ()


def read_body(path: str | os.PathLike[str], *, unit: str | None = None) -> Body:
    """Read a closed body from a file.

    Parameters
    ----------
    path : path_like
        STL, PLY, OBJ or 3MF.
    unit : str, optional
        Unit of length; default: what the file says, which only 3MF does, else ``"voxel"``: unknown.

    Returns
    -------
    Body

    Raises
    ------
    FileError
        If the file cannot be read, or holds no triangles.
    ParameterError
        As `closed_body` does.
    MissingExtraError
        Without the extra ``mesh``.
    """
    return closed_body(meshes.read(path, unit=unit), str(path))


def closed_body(mesh: Mesh, name: str = "body") -> Body:
    """Check that a mesh bounds a body, and repair what can be repaired without a guess.

    Holes of three or four edges are closed, triangles that look to the other side than their
    neighbours are turned, and a body that is inside out is turned as a whole.

    Parameters
    ----------
    mesh : Mesh
        The mesh.
    name : str, default "body"
        What the caller names it, for the messages.

    Returns
    -------
    Body

    Raises
    ------
    ParameterError
        If larger holes are left, triangles cannot be turned to one side, or there is no volume.
    MissingExtraError
        If something is to be repaired, and the extra ``mesh`` is missing.
    """
    repairs = []
    edges = count_edges(mesh.faces)
    if edges.open:
        mesh = _filled(mesh)
        left = count_edges(mesh.faces)
        if left.open:
            allowed = (
                f"must be closed, but triangles are missing at {left.open} open edges; close the "
                "holes in the program that made it, or in a mesh editor"
            )
            raise ParameterError(name, f"a mesh of {len(mesh.faces)} triangles", allowed)
        repairs.append(f"holes along {edges.open} open edges were closed")
        edges = left
    if edges.twisted:
        turned = _aligned(mesh)
        left = count_edges(turned.faces)
        if left.twisted:
            allowed = (
                f"must have an inside, but triangles look to either side at {left.twisted} edges"
            )
            raise ParameterError(name, f"a mesh of {len(mesh.faces)} triangles", allowed)
        count = int((turned.faces != mesh.faces).any(axis=1).sum())
        repairs.append(f"{count} triangles that looked to the other side were turned")
        mesh = turned
    inside = volume(mesh)
    if inside < 0:
        mesh = Mesh(mesh.vertices, mesh.faces[:, ::-1], mesh.unit)
        repairs.append("the body was inside out (inverted normals) and was turned")
    if not abs(inside) > _FLAT * float(np.ptp(mesh.bounds, axis=0).max()) ** 3:
        raise ParameterError(name, f"a volume of {abs(inside):g} {mesh.unit}³", "must be positive")
    return Body(mesh, tuple(repairs))


# A body of a smaller share of the cube around it is a sheet.
_FLAT = 1e-9


def _trimesh() -> Any:
    try:
        return importlib.import_module("trimesh")
    except ImportError as error:
        raise MissingExtraError("repair of meshes", "mesh") from error


def _filled(mesh: Mesh) -> Mesh:
    trimesh = _trimesh()
    whole = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    trimesh.repair.fill_holes(whole)
    return _mesh(whole, mesh.unit)


def _aligned(mesh: Mesh) -> Mesh:
    trimesh = _trimesh()
    whole = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    trimesh.repair.fix_winding(whole)
    return _mesh(whole, mesh.unit)


def _mesh(whole: Any, unit: str) -> Mesh:
    return Mesh(np.array(whole.vertices), np.array(whole.faces, dtype=np.int32), unit)
