"""Exact Euclidean distance to the outside of a phase."""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

from poresynth import _core
from poresynth.metrics.arguments import PhaseLike, as_phase, scale_of

__all__ = ["distance_transform"]

Boundary = Literal["open", "periodic"]


def distance_transform(
    solid: PhaseLike,
    *,
    phase: int | None = None,
    voxel_size: float | tuple[float, float, float] | None = None,
    boundary: Boundary = "open",
    cap: float | None = None,
    threads: int = 0,
) -> npt.NDArray[np.float32]:
    """Return the distance of each voxel of a phase to the nearest voxel outside it.

    Parameters
    ----------
    solid : Volume or array_like
        The phase, shape (z, y, x): bool, or at most 16 values of which 0 is not in it.
    phase : int, optional
        The value that is the phase, instead of all but 0: a label, or 0 for the pore.
    voxel_size : float or (float, float, float), optional
        Edges of a voxel along (z, y, x); those of the volume unless given, 1 for a plain array.
    boundary : {"open", "periodic"}, default "open"
        Open: nothing is known beyond the border, which is no wall. Periodic: the volume goes on at
        the opposite face.
    cap : float, optional
        Largest distance of interest, in the unit of the voxel size; larger ones become this one.
        The time grows with it, up to some 100 voxels.
    threads : int, default 0
        Number of threads; 0 takes all cores. The distances do not depend on it.

    Returns
    -------
    numpy.ndarray of float32
        Shape (z, y, x), in the memory order of the phase: distances between centres of voxels, in
        the unit of the voxel size; 0 outside the phase. Where no voxel is outside, infinity, or the
        cap.

    Raises
    ------
    ParameterError
        If a parameter is outside its range.

    Notes
    -----
    Exact: squared distances are whole numbers where the edges of the voxels are whole multiples of
    the shortest, and are rounded to single precision otherwise. The surface of the phase lies half
    a voxel nearer than the nearest voxel outside. scipy's `distance_transform_edt` has the same
    convention, and an arbitrary result for a volume that the phase fills.

    Peak memory: 4 bytes a voxel, the result.
    """
    size = scale_of(solid, voxel_size).voxel_size
    array = as_phase(solid, phase=phase)
    return _core.distance_transform(array, size, boundary=boundary, cap=cap, threads=threads)
