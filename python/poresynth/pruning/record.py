"""What pruning did, and where the structure stood before and after."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from poresynth import _core
from poresynth.metrics import (
    component_sizes,
    end_points,
    euler_density,
)
from poresynth.metrics.connectivity import FLOATING
from poresynth.metrics.skeleton import MARGIN
from poresynth.pruning.pores import PORE
from poresynth.volume import Volume

__all__ = ["Edit", "EditKind", "Pruned", "Standing"]

EditKind = Literal[
    "branch removed",
    "branch elongated",
    "loop cut",
    "part removed",
    "part joined",
    "pore closed",
    "pore opened",
    "surface moved",
]


@dataclass(frozen=True)
class Edit:
    """One change.

    Attributes
    ----------
    kind : str
        What was done: a branch removed, elongated or cut; a part removed or joined; a pore closed,
        or a way opened; the surface moved to restore the porosity.
    place : (int, int, int)
        Where, in voxels (z, y, x): the end of a branch, else the voxel of the change that comes
        first.
    voxels : int
        Voxels that changed phase; of a part that was joined, its own.
    length : float or None
        Length of a branch along its skeleton, in the unit of the voxel size.
    perimeter : float or None
        Perimeter of its cell, in the same unit.
    """

    kind: EditKind
    place: tuple[int, int, int]
    voxels: int
    length: float | None = None
    perimeter: float | None = None


@dataclass(frozen=True)
class Standing:
    """How a structure hangs together.

    Attributes
    ----------
    porosity : float
        Share of the pore.
    end_points : int
        End points of the skeleton, away from the border as `poresynth.metrics.end_points` counts
        them; 0 in a volume that is too small to have an inside.
    end_point_density : float
        The same by the volume they are counted in, in 1/voxel.
    euler_density : float
        Euler number by volume with the border corrected for, in 1/voxel.
    components : int
        Components of the solid (26 neighbours).
    floating_parts : int
        Those of fewer than 10 voxels.
    closed_pores : int
        Components of the pore (6 neighbours) that do not reach the border.
    """

    porosity: float
    end_points: int
    end_point_density: float
    euler_density: float
    components: int
    floating_parts: int
    closed_pores: int

    @classmethod
    def of(
        cls,
        solid: npt.NDArray[np.bool_],
        *,
        boundary: Literal["open", "periodic"] = "open",
        inside: npt.NDArray[np.float32] | None = None,
        skeleton: npt.NDArray[np.bool_] | None = None,
        threads: int = 0,
    ) -> Standing:
        """Measure a solid.

        Parameters
        ----------
        solid : numpy.ndarray of bool
            Shape (z, y, x).
        boundary : {"open", "periodic"}, default "open"
            Whether components go on at the opposite face.
        inside : numpy.ndarray of float32, optional
            Distance of each voxel to where no material is wanted, voxels, shape (z, y, x). End
            points nearer than the margin to it do not count, nor does the volume there.
        skeleton : numpy.ndarray of bool, optional
            That of the solid, where it is known, shape (z, y, x).
        threads : int, default 0
            Number of threads; 0 takes all cores.

        Returns
        -------
        Standing

        Notes
        -----
        Peak memory: 6 bytes a voxel.
        """
        count, density = 0, 0.0
        if min(solid.shape) > 2 * MARGIN:
            ends = end_points(solid, skeleton=skeleton, threads=threads)
            count, density = ends.count, ends.per_voxel
            if inside is not None:
                inner = np.count_nonzero(inside >= MARGIN)
                count = int(np.count_nonzero(inside[tuple(ends.places.T)] >= MARGIN))
                density = count / inner if inner else 0.0
        material = solid.size if inside is None else int(np.count_nonzero(inside))
        sizes = component_sizes(solid, boundary=boundary, threads=threads)
        return cls(
            float(1 - np.count_nonzero(solid) / material),
            count,
            density,
            euler_density(solid, boundary=boundary, threads=threads).density
            * (solid.size / material),
            len(sizes),
            int(np.count_nonzero(sizes < FLOATING)),
            _core.cavities(solid, connectivity=PORE, threads=threads),
        )


@dataclass(frozen=True, eq=False)
class Pruned:
    """A pruned volume and what that took.

    Attributes
    ----------
    volume : Volume
        Of the dtype that was given.
    solid : numpy.ndarray of bool
        Its solid, shape (z, y, x).
    solid_before : numpy.ndarray of bool
        What was solid before, same shape.
    edits : tuple of Edit
        All changes, in the order in which they were made.
    before, after : Standing
        The structure before and after.
    exemplar : Standing or None
        The exemplar's.
    loose : int
        Branches that should have grown to another strut and found none within reach.
    """

    volume: Volume
    solid: npt.NDArray[np.bool_]
    solid_before: npt.NDArray[np.bool_]
    edits: tuple[Edit, ...]
    before: Standing
    after: Standing
    exemplar: Standing | None
    loose: int

    def counts(self) -> dict[str, int]:
        """Return the number of edits of each kind that occurred."""
        found: dict[str, int] = {}
        for edit in self.edits:
            found[edit.kind] = found.get(edit.kind, 0) + 1
        return found

    def to_dict(self) -> dict[str, Any]:
        """Return all figures, JSON-compatible."""
        return {
            "edits": [asdict(edit) for edit in self.edits],
            "counts": self.counts(),
            "loose": self.loose,
            "before": asdict(self.before),
            "after": asdict(self.after),
            "exemplar": None if self.exemplar is None else asdict(self.exemplar),
        }
