"""Parts that would fall off, and pores that nothing can leave."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from poresynth.fabrication.fields import Field
from poresynth.metrics import component_statistics, largest_part

__all__ = ["Cavities", "Keep", "LooseParts", "closed_cavities", "drop_loose_parts"]

Keep = Literal["largest", "all"]


@dataclass(frozen=True)
class LooseParts:
    """Parts that do not hang together with the rest.

    Attributes
    ----------
    found : int
        Parts other than the largest.
    removed : int
        How many of them were removed.
    removed_voxels : int
        Their voxels.
    largest_removed : int
        Voxels of the largest of them: a real part among specks of a few voxels is worth a look.
    """

    found: int
    removed: int
    removed_voxels: int
    largest_removed: int


@dataclass(frozen=True)
class Cavities:
    """Closed pores, which trap powder or resin.

    Attributes
    ----------
    count : int
        How many.
    voxels, largest_voxels : int
        Voxels of all, and of the largest.
    volume : float
        Volume of all in ``unit``³.
    unit : str
        Unit of length.
    """

    count: int
    voxels: int
    largest_voxels: int
    volume: float
    unit: str


def drop_loose_parts(field: Field, keep: Keep = "largest", *, threads: int = 0) -> LooseParts:
    """Remove what is not connected with the largest part of a solid.

    Parameters
    ----------
    field : numpy.ndarray of float32
        The solid, positive inside, shape (z, y, x). Changed in place: the sign of removed voxels.
    keep : {"largest", "all"}, default "largest"
        The largest part alone, since what nothing holds falls off; or all, to be counted only.
    threads : int, default 0
        Number of threads; 0 takes all cores.

    Returns
    -------
    LooseParts

    Notes
    -----
    Voxels hang together by faces and edges, as in the mesh. Peak memory: 3 bytes a voxel.
    """
    solid = field > 0
    found = component_statistics(solid, connectivity=18, threads=threads)
    others = max(len(found.sizes) - 1, 0)
    if not others or keep == "all":
        return LooseParts(others, 0, 0, 0)
    loose = solid & ~largest_part(solid, connectivity=18, threads=threads)
    np.negative(field, out=field, where=loose)
    sizes = np.sort(found.sizes)[:-1]
    return LooseParts(others, others, int(sizes.sum()), int(sizes[-1]))


def closed_cavities(
    solid: npt.NDArray[np.bool_],
    *,
    voxel_size: tuple[float, float, float] = (1.0, 1.0, 1.0),
    unit: str = "voxel",
    threads: int = 0,
) -> Cavities:
    """Count the pores that are closed on all sides.

    Parameters
    ----------
    solid : numpy.ndarray of bool
        Shape (z, y, x); beyond the border is air.
    voxel_size : (float, float, float), default (1.0, 1.0, 1.0)
        Edges of a voxel along (z, y, x), in ``unit``.
    unit : str, default "voxel"
        Unit of length.
    threads : int, default 0
        Number of threads; 0 takes all cores.

    Returns
    -------
    Cavities

    Notes
    -----
    Pores hang together by faces of voxels. Peak memory: 2 bytes a voxel.
    """
    pores = component_statistics(~solid, connectivity=6, threads=threads)
    low, high = pores.bounding_boxes[..., 0], pores.bounding_boxes[..., 1]
    closed = (low > 0).all(axis=1) & (high < solid.shape).all(axis=1)
    sizes = pores.sizes[closed]
    voxels = int(sizes.sum())
    return Cavities(
        count=len(sizes),
        voxels=voxels,
        largest_voxels=int(sizes.max(initial=0)),
        volume=voxels * float(np.prod(voxel_size)),
        unit=unit,
    )
