"""Volume fractions."""

from __future__ import annotations

import numpy as np

from poresynth.metrics.arguments import PhaseLike, as_phase

__all__ = ["porosity"]


def porosity(solid: PhaseLike) -> float:
    """Return the share of a volume that is not solid: ε = |void| / |all| (scaffoldgan_2021 §6.2).

    Parameters
    ----------
    solid : Volume or array_like
        The solid, shape (z, y, x): bool, or at most 16 values of which 0 is not solid.

    Returns
    -------
    float
        0 to 1.

    Raises
    ------
    ParameterError
        If the array is empty, not (z, y, x), or a gray volume.

    Notes
    -----
    Peak memory: none for bool, 1 byte a voxel for other types.
    """
    phase = as_phase(solid)
    return float(1 - np.count_nonzero(phase) / phase.size)
