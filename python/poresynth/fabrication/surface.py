"""The surface of a part, and whether it says the same as its voxels."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from poresynth import meshes
from poresynth.fabrication.part import Part, Progress, staged
from poresynth.meshes import Mesh, MeshReport
from poresynth.meshes.crossings import crossings
from poresynth.metrics import surface_area

__all__ = ["AREA_TOLERANCE", "VOLUME_TOLERANCE", "Surface", "surface_of"]

VOLUME_TOLERANCE = 5.0
"""Per cent by which the volume of a mesh may differ from that of its voxels.

Balls of 12 voxels across lose 4 %, balls of 40 0.5 %, bone of struts of 5 voxels 2 %."""

AREA_TOLERANCE = 10.0
"""Per cent by which its area may differ from Crofton's estimate of that of its voxels.

Flat surfaces along the voxels differ by 7 %, the error of Crofton's estimate; others by 3.5 %."""


HALVINGS = 5
"""A tolerance that still makes triangles cross after so many halvings merges hardly any."""


@dataclass(frozen=True, eq=False)
class Surface:
    """The surface of a part.

    Attributes
    ----------
    mesh : Mesh
        The surface, in the part's unit.
    report : MeshReport
        Its checks.
    volume_error_percent, area_error_percent : float
        Difference from the voxels: of volume by their number, of area by Crofton's estimate.
    """

    mesh: Mesh
    report: MeshReport
    volume_error_percent: float
    area_error_percent: float

    @property
    def agrees(self) -> bool:
        """Whether both are within `VOLUME_TOLERANCE` and `AREA_TOLERANCE`."""
        return (
            abs(self.volume_error_percent) <= VOLUME_TOLERANCE
            and abs(self.area_error_percent) <= AREA_TOLERANCE
        )


def surface_of(
    part: Part,
    *,
    smoothing: int = 0,
    tolerance: float | None = None,
    threads: int = 0,
    progress: Progress | None = None,
) -> Surface:
    """Lay the surface of a part, and check it.

    Parameters
    ----------
    part : Part
        The part.
    smoothing : int, default 0
        Iterations of Taubin's smoothing; see `poresynth.meshes.smooth`.
    tolerance : float, optional
        Merge triangles where the surface moves by no more, in the part's unit; see
        `poresynth.meshes.simplify`. Less where triangles would come to cross.
    threads : int, default 0
        Number of threads for the measurement; 0 takes all cores.
    progress : callable, optional
        ``progress(stage, fraction)``; what it raises ends the work.

    Returns
    -------
    Surface

    Raises
    ------
    ParameterError, MissingExtraError
        As `smooth` and `simplify` do.

    Notes
    -----
    No triangles cross: the surface as laid has none that do, smoothing puts back what it makes, and
    a simplification that makes some is done again with half the tolerance.
    Peak memory: 1 byte a voxel, and as for `poresynth.meshes.isosurface`, `smooth`, `simplify` and
    `check`.
    """
    mesh = meshes.isosurface(
        part.field,
        voxel_size=part.voxel_size,
        origin=part.origin,
        unit=part.unit,
        progress=staged(progress, 0.0, 0.3),
    )
    mesh = meshes.smooth(mesh, smoothing, progress=staged(progress, 0.3, 0.4))
    if tolerance is not None:
        mesh = _simplified(mesh, tolerance, staged(progress, 0.5, 0.8))
    report = meshes.check(mesh, find_crossings=False, progress=staged(progress, 0.8, 0.9))
    report = replace(report, crossings=0)
    inside = part.inside
    volume = int(np.count_nonzero(inside)) * float(np.prod(part.voxel_size))
    area = surface_area(np.pad(inside, 1), voxel_size=part.voxel_size, threads=threads).area
    staged(progress, 0.9, 1.0)("measurement", 1.0)
    return Surface(
        mesh=mesh,
        report=report,
        volume_error_percent=100 * (report.volume / volume - 1),
        area_error_percent=100 * (report.area / area - 1),
    )


def _simplified(mesh: Mesh, tolerance: float, progress: Progress) -> Mesh:
    """Return the mesh simplified as far as no triangles cross."""
    for halving in range(HALVINGS):
        found = meshes.simplify(mesh, tolerance / 2**halving)
        if not len(crossings(found, progress=progress)):
            return found
    return mesh
