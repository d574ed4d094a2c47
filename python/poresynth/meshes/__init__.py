"""Closed surfaces of triangles: made from volumes, checked, smoothed, read and written."""

from __future__ import annotations

from poresynth.meshes.checks import MeshReport, check
from poresynth.meshes.files import READABLE, SUFFIXES, check_output, read, write
from poresynth.meshes.isosurface import isosurface
from poresynth.meshes.mesh import Mesh
from poresynth.meshes.simplification import simplify
from poresynth.meshes.smoothing import smooth

__all__ = [
    "READABLE",
    "SUFFIXES",
    "Mesh",
    "MeshReport",
    "check",
    "check_output",
    "isosurface",
    "read",
    "simplify",
    "smooth",
    "write",
]
