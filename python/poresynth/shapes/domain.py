"""The voxels that a part may fill: from a mask, or from a body voxelised."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from poresynth import io
from poresynth.errors import ParameterError
from poresynth.io.units import NANOMETRES, spell
from poresynth.meshes.files import READABLE
from poresynth.metrics import distance_transform
from poresynth.shapes.body import Body, read_body
from poresynth.shapes.voxels import voxelise
from poresynth.volume import Volume, voxel_edges

__all__ = ["Domain", "check_room", "read_domain"]

Progress = Callable[[str, float], object]

SMALLEST = 4
"""A body of fewer voxels across has no inside to fill; its unit is wrong, or the voxels are."""

MOST_VOXELS = 1 << 36
"""More are a mistake of the unit."""


@dataclass(frozen=True, eq=False)
class Domain:
    """Where a part may be.

    Attributes
    ----------
    mask : Volume
        bool, shape (z, y, x): the inside, with its scale.
    origin : (float, float, float)
        Position (z, y, x) of the outer corner of the first voxel in the body's own frame, in the
        mask's unit: a part made inside lies where the body was.
    source : str
        The file.
    notes : tuple of str
        What a person should know: repairs, a sentence each.
    """

    mask: Volume
    origin: tuple[float, float, float]
    source: str
    notes: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return what made it, JSON-compatible; in a volume's provenance under ``"domain"``."""
        return {
            "source": self.source,
            "shape": list(self.mask.shape),
            "voxels": int(np.count_nonzero(self.mask.array)),
            "voxel_size": list(self.mask.voxel_size),
            "unit": self.mask.unit,
            "origin": list(self.origin),
            "notes": list(self.notes),
        }


def read_domain(
    path: str | os.PathLike[str],
    *,
    voxel_size: float | tuple[float, float, float] = 1.0,
    unit: str = "voxel",
    body_unit: str | None = None,
    margin: int = 1,
    name: str = "mask",
    progress: Progress | None = None,
) -> Domain:
    """Read where a part may be, from a mask or from a closed body.

    Parameters
    ----------
    path : path_like
        A volume in any format of `poresynth.io`, inside where it is not 0; or a closed mesh: STL,
        PLY, OBJ or 3MF.
    voxel_size : float or (float, float, float), default 1.0
        Edges of a voxel along (z, y, x), in ``unit``, for a mesh; a volume has its own unless it
        does not say, which then is this.
    unit : str, default "voxel"
        Unit of the voxel size: the exemplar's.
    body_unit : str, optional
        Unit of the mesh. Default: what the file says, which only 3MF does. Needed where the voxels
        have a unit and the file has none; where neither has, a unit of the mesh is a voxel.
    margin : int, default 1
        Empty voxels around a body on each side; with one its surface is closed inside the volume.
    name : str, default "mask"
        What the caller calls it, for the messages.
    progress : callable, optional
        ``progress(stage, fraction)``; what it raises ends the work.

    Returns
    -------
    Domain
        The box of a body is rounded up to whole voxels, and the body lies in its middle.

    Raises
    ------
    ParameterError
        If a body is open, has no unit beside voxels that have one, is smaller than `SMALLEST`
        voxels across or huge, or a mask is empty.
    FileError
        If the file cannot be read.
    MissingExtraError
        If a mesh is to be read without the extra ``mesh``.

    Notes
    -----
    Peak memory: 1 byte a voxel besides what `poresynth.meshes.read` and `voxelise` need.
    """
    size, unit = voxel_edges(voxel_size), spell(unit)
    if margin < 0:
        raise ParameterError("margin", margin, "must be at least 0")
    if Path(path).suffix.lower() in READABLE:
        return _from_body(path, size, unit, body_unit, margin, name, progress)
    volume = io.read(path)
    if volume.channels != 1:
        raise ParameterError(name, f"{path}: {volume.channels} channels", "must have one")
    inside = volume.array.reshape(volume.shape) != 0
    if not inside.any():
        raise ParameterError(name, path, "must not be 0 everywhere")
    if volume.unit == "voxel" and volume.voxel_size == (1.0, 1.0, 1.0):
        volume = Volume(inside, size, unit)
    return Domain(Volume(inside, volume.voxel_size, volume.unit), (0.0, 0.0, 0.0), str(path))


def _from_body(
    path: str | os.PathLike[str],
    size: tuple[float, float, float],
    unit: str,
    body_unit: str | None,
    margin: int,
    name: str,
    progress: Progress | None,
) -> Domain:
    body = _in_unit(read_body(path, unit=body_unit), path, size, unit, name)
    low, high = body.mesh.bounds[:, ::-1]
    edges = np.array(size)
    # Coordinates in float32 do not make a body a voxel longer.
    across = np.ceil((high - low) / edges - 1e-4).astype(np.int64)
    extent = " × ".join(f"{length:.4g}" for length in (high - low)[::-1])
    voxels = f"voxels of {' × '.join(f'{edge:g}' for edge in dict.fromkeys(size))} {unit}"
    if across.min() < SMALLEST:
        allowed = f"must be at least {SMALLEST} {voxels} across; is its unit right?"
        raise ParameterError(name, f"{path}: {extent} {body.mesh.unit}", allowed)
    across += 2 * margin
    if across.prod() > MOST_VOXELS:
        allowed = f"must not hold more than {MOST_VOXELS:.1e} {voxels}; is its unit right?"
        raise ParameterError(name, f"{path}: {extent} {body.mesh.unit}", allowed)
    corner = (low + high) / 2 - across * edges / 2
    shape = (int(across[0]), int(across[1]), int(across[2]))
    origin = (float(corner[0]), float(corner[1]), float(corner[2]))
    mask = voxelise(body.mesh, shape, size, origin=origin, progress=progress)
    if not mask.any():
        allowed = f"must hold the centre of a voxel, of {voxels}; it is too thin"
        raise ParameterError(name, f"{path}: {extent} {body.mesh.unit}", allowed)
    return Domain(Volume(mask, size, unit), origin, str(path), body.repairs)


def _in_unit(
    body: Body, path: str | os.PathLike[str], size: tuple[float, float, float], unit: str, name: str
) -> Body:
    """Return a body in the unit of the voxels."""
    if (body.mesh.unit == "voxel") != (unit == "voxel"):
        if unit == "voxel":
            allowed = (
                f"the mesh has one ({body.mesh.unit}), so the size of a voxel must be known, too"
            )
            raise ParameterError("unit", "unknown", allowed)
        allowed = (
            f"the file does not say its unit, and a voxel is {max(size):g} {unit}; name it, "
            f"one of {', '.join(NANOMETRES)}"
        )
        raise ParameterError(f"unit of the {name}", path, allowed)
    return Body(body.mesh.in_unit(unit), body.repairs)


def check_room(mask: Volume, feature: float, what: str = "features of the exemplar") -> float:
    """Raise unless a body has room for the features of a material.

    Parameters
    ----------
    mask : Volume
        The body, bool.
    feature : float
        Size of a feature in the mask's unit: of a strut and a pore together, say Tb.Th + Tb.Sp.
    what : str, default "features of the exemplar"
        What they are, for the message.

    Returns
    -------
    float
        Diameter of the largest ball inside the body, to a voxel, in the mask's unit.

    Raises
    ------
    ParameterError
        If that ball is smaller than a feature.

    Notes
    -----
    Peak memory: 6 bytes a voxel.
    """
    inside = np.pad(mask.array, 1)
    depth = distance_transform(inside, voxel_size=mask.voxel_size)
    widest = 2 * float(depth.max())
    if widest < feature:
        allowed = (
            f"must be wider than the {what}, {feature:.3g} {mask.unit}; enlarge the shape, or take "
            "smaller voxels"
        )
        raise ParameterError("mask", f"a body {widest:.3g} {mask.unit} thick", allowed)
    return widest
