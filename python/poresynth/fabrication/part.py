"""From a volume to a part: phase, shape, shell, least thickness, what holds together."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from poresynth.errors import ParameterError
from poresynth.fabrication.fields import Field, field_of_gray, field_of_voxels
from poresynth.fabrication.loose import (
    Cavities,
    Keep,
    LooseParts,
    closed_cavities,
    drop_loose_parts,
)
from poresynth.fabrication.thickening import Thickening, thicken
from poresynth.metrics.structure import Structure, first_channel
from poresynth.shapes import Domain
from poresynth.shapes import shell as shell_of
from poresynth.volume import Volume, as_volume

__all__ = ["Part", "Phase", "Progress", "make_part", "staged"]

Progress = Callable[[str, float], object]
Phase = Literal["solid", "pore"]


@dataclass(frozen=True, eq=False)
class Part:
    """A part, before its surface is laid.

    Attributes
    ----------
    field : numpy.ndarray of float32
        Positive inside, shape (z, y, x); the surface is where it is 0.
    before : numpy.ndarray of bool
        The phase as it was in the volume, within the shape, before the shell and all else.
    phase : {"solid", "pore"}
        What is inside.
    voxel_size : (float, float, float)
        Edges of a voxel along (z, y, x), in ``unit``.
    unit : str
        Unit of length.
    origin : (float, float, float)
        Position (z, y, x) of the outer corner of the first voxel.
    space : int
        Voxels of the shape that the part lies in.
    loose : LooseParts
        What did not hold together with the rest.
    thickening : Thickening or None
        None if no least thickness was asked for.
    cavities : Cavities
        Closed pores; of the phase pore, closed solid.
    """

    field: Field
    before: npt.NDArray[np.bool_]
    phase: Phase
    voxel_size: tuple[float, float, float]
    unit: str
    origin: tuple[float, float, float]
    space: int
    loose: LooseParts
    thickening: Thickening | None
    cavities: Cavities

    @property
    def inside(self) -> npt.NDArray[np.bool_]:
        """The voxels of the part, shape (z, y, x)."""
        return self.field > 0

    @property
    def corners(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Least and greatest (x, y, z) of the volume that the part was made of, in ``unit``."""
        z, y, x = self.origin
        d, h, w = (n * size for n, size in zip(self.field.shape, self.voxel_size, strict=True))
        return (x, y, z), (x + w, y + h, z + d)

    def porosity(self, inside: npt.NDArray[np.bool_]) -> float:
        """Return the share of pore in the shape, where these voxels are the phase."""
        share = int(np.count_nonzero(inside)) / self.space
        return share if self.phase == "pore" else 1 - share


def make_part(
    volume: Volume | npt.ArrayLike,
    *,
    threshold: float | None = None,
    solid: Literal["bright", "dark"] = "bright",
    phase: Phase = "solid",
    domain: Domain | None = None,
    shell: float | None = None,
    min_thickness: float | None = None,
    keep: Keep = "largest",
    threads: int = 0,
    progress: Progress | None = None,
) -> Part:
    """Turn a volume into a part that can be made.

    Parameters
    ----------
    volume : Volume or array_like
        Shape (z, y, x), gray, binary or labels; of several channels the first. Its provenance says
        where a body was that it was made in.
    threshold : float, optional
        Gray value that parts solid from pore; default: Otsu's, or midway between two values.
    solid : {"bright", "dark"}, default "bright"
        Which side is solid.
    phase : {"solid", "pore"}, default "solid"
        What the part is: the material, or the space that a fluid fills.
    domain : Domain, optional
        A shape of the volume's voxels: what lies outside is cut off. See
        `poresynth.shapes.read_domain`.
    shell : float, optional
        Thickness of a solid layer under the surface of the domain, or of the whole block, in the
        volume's unit.
    min_thickness : float, optional
        Least thickness of struts and walls, in the volume's unit; see `thicken`.
    keep : {"largest", "all"}, default "largest"
        The largest part alone, since what nothing holds falls off; or all.
    threads : int, default 0
        Number of threads; 0 takes all cores. The result does not depend on it.
    progress : callable, optional
        ``progress(stage, fraction)``; what it raises ends the work.

    Returns
    -------
    Part

    Raises
    ------
    ParameterError
        If a parameter is outside its range, the domain has another shape, or nothing is left.

    Notes
    -----
    In this order: threshold, shell, phase, cut by the domain; loose parts are removed, so that
    specks are not thickened; thickening; loose parts again. A gray volume keeps its surface at
    sub-voxel level; one of two values is smoothed within half a voxel (`field_of_voxels`).

    Peak memory: 20 bytes a voxel, and as for `thicken` if it is asked for.
    """
    volume = as_volume(volume)
    if phase not in ("solid", "pore"):
        raise ParameterError("phase", phase, "must be 'solid' or 'pore'")
    if keep not in ("largest", "all"):
        raise ParameterError("keep", keep, "must be 'largest' or 'all'")
    if min_thickness is not None and phase == "pore":
        raise ParameterError("min_thickness", min_thickness, "is for the phase solid, not the pore")
    if shell is not None and min_thickness is not None and shell < min_thickness:
        allowed = f"must be at least the least thickness, {min_thickness:g} {volume.unit}"
        raise ParameterError("shell", shell, allowed)
    inside = _inside(domain, volume)
    field = _field(volume, threshold, solid)
    before = field <= 0 if phase == "pore" else field > 0
    if inside is not None:
        before &= inside
    if shell is not None:
        field = _with_shell(field, shell, inside, volume)
    if phase == "pore":
        np.negative(field, out=field)
    if inside is not None:
        np.minimum(field, field_of_voxels(inside), out=field)
    report = progress or (lambda stage, share: None)
    report("parts", 0.1)
    if not (field > 0).any():
        raise ParameterError("phase", phase, "must be somewhere in the volume and its domain")
    loose = drop_loose_parts(field, keep, threads=threads)
    thickening = None
    if min_thickness is not None:
        field, thickening = thicken(
            field,
            min_thickness,
            voxel_size=volume.voxel_size,
            unit=volume.unit,
            domain=inside,
            threads=threads,
            progress=staged(report, 0.2, 0.9),
        )
        # Growth that the domain cuts off may stand alone.
        drop_loose_parts(field, keep, threads=threads)
    report("cavities", 0.9)
    cavities = closed_cavities(
        field > 0, voxel_size=volume.voxel_size, unit=volume.unit, threads=threads
    )
    report("cavities", 1.0)
    return Part(
        field=field,
        before=before,
        phase=phase,
        voxel_size=volume.voxel_size,
        unit=volume.unit,
        origin=_origin(volume, domain),
        space=int(np.count_nonzero(inside)) if inside is not None else before.size,
        loose=loose,
        thickening=thickening,
        cavities=cavities,
    )


def staged(progress: Progress | None, start: float, end: float) -> Progress:
    """Return a progress callback for a part of the work, from one share of the whole to another."""

    def report(stage: str, share: float) -> None:
        if progress is not None:
            progress(stage, start + share * (end - start))

    return report


def _inside(domain: Domain | None, volume: Volume) -> npt.NDArray[np.bool_] | None:
    if domain is None:
        return None
    if domain.mask.shape != volume.shape:
        shape, wanted = (" × ".join(map(str, v.shape)) for v in (domain.mask, volume))
        allowed = f"has {shape} voxels, but must have those of the volume, {wanted}"
        raise ParameterError("mask", domain.source, allowed)
    return domain.mask.array


def _field(volume: Volume, threshold: float | None, solid: Literal["bright", "dark"]) -> Field:
    array = first_channel(volume, "volume") if _varies(volume.array) else volume.array
    if not _varies(array):
        # A full or empty block is a part, too, once a threshold or a truth value says which.
        bright = bool(array.flat[0] > (0 if threshold is None else threshold))
        return field_of_voxels(np.full(volume.shape, bright == (solid == "bright")))
    structure = Structure.of(volume, threshold, solid)
    if structure.kind == "gray":
        return field_of_gray(array, structure)
    return field_of_voxels(structure.cut(array))


def _varies(array: npt.NDArray[Any]) -> bool:
    return any(bool((plane != array.flat[0]).any()) for plane in array)


def _with_shell(
    field: Field, thickness: float, inside: npt.NDArray[np.bool_] | None, volume: Volume
) -> Field:
    """Return the union with a shell; what lies outside the domain is cut off later."""
    body = np.ones(field.shape, dtype=bool) if inside is None else inside
    layer = shell_of(Volume(body, volume.voxel_size, volume.unit), thickness)
    # With all outside, so that only the inner side of the shell is a surface.
    return np.maximum(field, field_of_voxels(layer | ~body))


def _origin(volume: Volume, domain: Domain | None) -> tuple[float, float, float]:
    """Return where the first voxel's corner is, by the body that the volume was made in."""
    made = volume.metadata.get("poresynth", {}).get("domain", {})
    if tuple(made.get("shape", ())) != volume.shape or made.get("unit") != volume.unit:
        return (0.0, 0.0, 0.0) if domain is None else domain.origin
    z, y, x = made["origin"]
    return float(z), float(y), float(x)
