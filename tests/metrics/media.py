"""Random media whose correlation functions are known."""

from __future__ import annotations

import numpy as np


def overlapping_spheres(n: int, radius: float, count: int, rng: np.random.Generator) -> np.ndarray:
    """The void between spheres at random places of a periodic volume of n³ voxels."""
    axis = np.arange(n)
    void = np.ones((n, n, n), bool)
    for centre in rng.random((count, 3)) * n:
        z, y, x = (((axis - c + n / 2) % n - n / 2) ** 2 for c in centre)
        void &= z[:, None, None] + y[:, None] + x > radius**2
    return void
