"""How much of a volume is not copied from its exemplar."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from poresynth import _core
from poresynth.metrics.arguments import as_scalar_volume, whole_number
from poresynth.volume import Volume

__all__ = ["EDGES", "PROBES", "Novelty", "novelty", "novelty_curve"]

EDGES = (12, 20, 32)
"""Edges of the blocks of the novelty curve, voxels."""

PROBES = 24
"""Random blocks that a novelty is a median of."""


class Novelty(NamedTuple):
    """Novelty of blocks of one size; NaN where it is not defined.

    Attributes
    ----------
    plain : float
        Against the exemplar as it is.
    mirrored : float
        Against the exemplar and its seven mirror images.
    """

    plain: float
    mirrored: float


def novelty(
    exemplar: Volume | npt.ArrayLike,
    volume: Volume | npt.ArrayLike,
    edge: int,
    *,
    probes: int = PROBES,
    seed: int = 0,
    threads: int = 0,
) -> Novelty:
    """Return how new the blocks of a volume are.

    Random blocks of the volume are compared with every place in the exemplar, and the smallest
    mean squared difference is kept. Random blocks of one half of the exemplar (cut across z) are
    compared with the other half in the same way. The figure is the ratio of the medians.

    Parameters
    ----------
    exemplar, volume : Volume or array_like
        Shapes (z, y, x), any data type. Both are brought to zero mean and unit deviation.
    edge : int
        Edge of the blocks in voxels.
    probes : int, default 24
        Number of random blocks of each kind. The standard error of a figure is about 35 % for
        edges of 12 voxels, 25 % for 20 and 10 % for 32, and falls with the root of the number.
    seed : int, default 0
        Picks the blocks.
    threads : int, default 0
        Number of threads; 0 takes all cores. The figures do not depend on it.

    Returns
    -------
    Novelty
        0: the blocks are verbatim copies. 1: they differ from the exemplar as much as its halves
        from each other. NaN where the volume, or half of the exemplar, is not larger than a block
        along every axis, and where most blocks of the exemplar occur in both of its halves (small
        blocks of a dense rock, which are all solid).

    Raises
    ------
    ParameterError
        If a parameter is outside its range.

    Notes
    -----
    Exact: no place is left out. Peak memory: 4 bytes a voxel of the volume (none if it is
    float32), 13 bytes a voxel of the exemplar, and for each thread 16 · ``edge`` bytes a voxel of
    one of its planes.
    """
    e, v = as_scalar_volume(exemplar, "exemplar"), as_scalar_volume(volume, "volume")
    found = _core.novelty(
        e.astype(np.float32, copy=False),
        v.astype(np.float32, copy=False),
        whole_number("edge", edge, 1),
        probes=whole_number("probes", probes, 1),
        seed=whole_number("seed", seed, 0),
        threads=threads,
    )
    return Novelty(float("nan"), float("nan")) if found is None else Novelty(*found)


def novelty_curve(
    exemplar: Volume | npt.ArrayLike,
    volumes: Sequence[Volume | npt.ArrayLike],
    *,
    probes: int = PROBES,
    threads: int = 0,
) -> dict[int, Novelty]:
    """Return the novelty of blocks of 12³, 20³ and 32³ voxels, pooled over volumes.

    Parameters
    ----------
    exemplar : Volume or array_like
        As for `novelty`.
    volumes : sequence of Volume or array_like
        Volumes of the material, such as one a seed; the blocks of each are picked anew.
    probes, threads
        As for `novelty`.

    Returns
    -------
    dict of int to Novelty
        By edge of the blocks, the means over the volumes.

    Raises
    ------
    ParameterError
        If a parameter is outside its range.
    """
    curve = {}
    for edge in EDGES:
        found = [
            novelty(exemplar, volume, edge, probes=probes, seed=seed, threads=threads)
            for seed, volume in enumerate(volumes)
        ]
        curve[edge] = Novelty(*np.mean(found, axis=0).tolist())
    return curve
