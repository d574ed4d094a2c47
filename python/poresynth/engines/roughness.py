"""How rough surfaces are, and how much smoothing makes them as rough as those of images."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from poresynth import _core
from poresynth.engines.images import AXES
from poresynth.engines.solid_parameters import Axis
from poresynth.engines.values import cut_share

__all__ = ["interface_density", "smoothing_like"]

MOST = 2.0
"""Voxels; more would take features away rather than roughness."""

STEPS = 7
"""Halvings of the range: the blur is then known to 0.02 voxels."""

BLOCK = 128
"""Edge of the part in the middle that is looked at: enough for a density, at a fixed cost."""


def interface_density(solid: npt.NDArray[np.bool_], across: int) -> float:
    """Return the share of neighbouring voxels in planes across an axis that are of two phases.

    Parameters
    ----------
    solid : numpy.ndarray of bool
        Shape (z, y, x).
    across : int
        The axis that the planes are perpendicular to.
    """
    lines = [np.moveaxis(solid, axis, 0) for axis in range(3) if axis != across]
    changes = [np.count_nonzero(line[1:] != line[:-1]) for line in lines]
    return sum(changes) / sum(line[1:].size for line in lines)


def smoothing_like(
    solids: Mapping[Axis, npt.NDArray[np.bool_]],
    porosity: float,
    scores: npt.NDArray[np.float32],
    seed: int,
) -> float:
    """Return the blur at which the sections' interfaces are as dense as the images'.

    A volume whose responses match is rougher at the scale of single voxels than its images: its
    three planes pull at each voxel. The perimeter in the planes says how much of that to take away.

    Parameters
    ----------
    solids : mapping
        Of each axis that is constrained the solid of its image, shape (1, y, x).
    porosity : float
        Of the images.
    scores : numpy.ndarray of float32
        Shape (z, y, x): what is cut into solid and pore.
    seed : int
        Decides between equal scores.

    Returns
    -------
    float
        Standard deviation of a Gaussian, voxels; 0 where the volume is smooth enough.
    """
    wanted = np.mean([interface_density(solid, 0) for solid in solids.values()])
    middle = tuple(slice((n - min(n, BLOCK)) // 2, (n + min(n, BLOCK)) // 2) for n in scores.shape)
    block = np.ascontiguousarray(scores[middle])

    def density(sigma: float) -> float:
        smooth = block
        if sigma > 0:
            smooth = _core.gaussian(block[None], sigma, boundary="open")[0]
        solid = cut_share(smooth, 1 - porosity, seed)
        return float(np.mean([interface_density(solid, AXES.index(axis)) for axis in solids]))

    low, high = 0.0, MOST
    if density(0.0) <= wanted:
        return 0.0
    for _ in range(STEPS):
        middle_sigma = (low + high) / 2
        if density(middle_sigma) > wanted:
            low = middle_sigma
        else:
            high = middle_sigma
    return (low + high) / 2
