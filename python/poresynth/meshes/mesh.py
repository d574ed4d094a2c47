"""A closed surface of triangles, in physical units."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from poresynth.errors import ParameterError
from poresynth.io.units import NANOMETRES, spell

__all__ = ["Mesh"]


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles.

    Parameters
    ----------
    vertices : numpy.ndarray
        float32 or float64, shape (n, 3): positions (x, y, z) in ``unit``, as mesh files have them.
    faces : numpy.ndarray
        int32, shape (m, 3): vertices of each triangle, anticlockwise seen from outside.
    unit : str, default "voxel"
        Unit of length; ``"voxel"`` means that the scale is unknown.
    patches : numpy.ndarray of uint8, optional
        Shape (m,): the named part of the surface that each triangle belongs to.
    patch_names : tuple of str, default ()
        Names of patches 0, 1, …

    Raises
    ------
    ParameterError
        If an array has another shape, or a triangle names a vertex that is not there.

    Notes
    -----
    Peak memory: none beyond the arrays.
    """

    vertices: npt.NDArray[Any]
    faces: npt.NDArray[np.int32]
    unit: str = "voxel"
    patches: npt.NDArray[np.uint8] | None = None
    patch_names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check that the arrays belong together."""
        vertices, faces = np.asarray(self.vertices), np.asarray(self.faces)
        for name, array in (("vertices", vertices), ("faces", faces)):
            if array.ndim != 2 or array.shape[1] != 3:
                raise ParameterError(f"{name}.shape", array.shape, "must be (n, 3)")
        if vertices.dtype not in (np.float32, np.float64):
            raise ParameterError("vertices.dtype", vertices.dtype, "must be float32 or float64")
        if len(faces) and not 0 <= faces.min() <= faces.max() < len(vertices):
            what = f"{faces.min()} to {faces.max()}"
            raise ParameterError("faces", what, f"must be 0 to {len(vertices) - 1}, the vertices")
        if self.patches is not None and self.patches.shape != (len(faces),):
            raise ParameterError("patches.shape", self.patches.shape, f"must be ({len(faces)},)")
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "faces", faces.astype(np.int32, copy=False))

    @property
    def bounds(self) -> npt.NDArray[np.float64]:
        """Least and greatest (x, y, z), shape (2, 3)."""
        return np.array([self.vertices.min(axis=0), self.vertices.max(axis=0)], dtype=np.float64)

    def in_unit(self, unit: str) -> Mesh:
        """Return the mesh with its lengths in another unit.

        Raises
        ------
        ParameterError
            If the scale is unknown, or the unit is.
        """
        unit = spell(unit)
        if unit == self.unit:
            return self
        for name, each in (("unit", unit), ("mesh.unit", self.unit)):
            if each not in NANOMETRES:
                raise ParameterError(name, each, f"must be one of {', '.join(NANOMETRES)}")
        factor = NANOMETRES[self.unit] / NANOMETRES[unit]
        vertices = (self.vertices * factor).astype(self.vertices.dtype, copy=False)
        return replace(self, vertices=vertices, unit=unit)

    def with_vertices(self, vertices: npt.NDArray[Any]) -> Mesh:
        """Return the same triangles between moved vertices."""
        return replace(self, vertices=vertices)
