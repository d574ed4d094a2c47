"""Solids as fields: positive inside, about ±½ far from the surface, 0 on it at sub-voxel level.

A union of two is their maximum, a cut their minimum, and the other phase is the negative.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from poresynth.metrics.structure import Structure

__all__ = ["Field", "field_of_gray", "field_of_voxels", "keep_firm"]

Field = npt.NDArray[np.float32]

SMOOTHING = 0.7
"""Standard deviation in voxels of the smoothing of a surface of voxels.

Of 0.5 to 1.5 it keeps the volume and the area of balls, bone and sandstone best: the volume within
2 %, the area within 3.5 % of Crofton's. Plain steps have 10 % too much area."""

FIRM = 0.1
"""Least distance from 0 of a voxel of a smoothed field, whose sign stays that of the voxel.

So no strut or pore is smoothed away. More makes surfaces rougher, less makes struts of one voxel
thinner."""


def field_of_voxels(solid: npt.NDArray[np.bool_]) -> Field:
    """Return the field of a solid given by its voxels, smoothed within half a voxel.

    Parameters
    ----------
    solid : numpy.ndarray of bool
        Shape (z, y, x).

    Returns
    -------
    numpy.ndarray of float32
        Shape (z, y, x); positive exactly where the voxels are solid.

    Notes
    -----
    A Gaussian of `SMOOTHING` voxels; then each voxel is put back to its own side. Peak memory: 9
    bytes a voxel.
    """
    from scipy import ndimage

    field = solid.astype(np.float32)
    ndimage.gaussian_filter(field, SMOOTHING, mode="nearest", truncate=3, output=field)
    field -= np.float32(0.5)
    keep_firm(field, solid)
    return field


def keep_firm(field: Field, solid: npt.NDArray[np.bool_], least: float = FIRM) -> None:
    """Put each voxel on its own side, ``least`` away from the surface, in place."""
    for plane, inside in zip(field, solid, strict=True):
        np.maximum(plane, np.float32(least), out=plane, where=inside)
        np.minimum(plane, np.float32(-least), out=plane, where=~inside)


def field_of_gray(gray: npt.NDArray[Any], structure: Structure) -> Field:
    """Return the field of the solid of a gray volume, whose surface is where the threshold is met.

    Parameters
    ----------
    gray : numpy.ndarray
        Shape (z, y, x).
    structure : Structure
        How it is cut.

    Returns
    -------
    numpy.ndarray of float32
        Shape (z, y, x); positive where the volume is solid, negative elsewhere.

    Notes
    -----
    Scaled by the distance between the mean grays of solid and pore. Peak memory: 5 bytes a voxel.
    """
    solid = structure.cut(gray)
    inside = float(np.mean(gray, where=solid, dtype=np.float64)) if solid.any() else 1.0
    outside = float(np.mean(gray, where=~solid, dtype=np.float64)) if not solid.all() else 0.0
    field = gray.astype(np.float32)
    field -= np.float32(structure.threshold)
    field /= np.float32(inside - outside)
    # Grays at the threshold itself are on the side on which the structure counts them.
    keep_firm(field, solid, float(np.finfo(np.float32).tiny))
    return field
