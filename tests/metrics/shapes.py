"""Shapes whose surface and fabric are known."""

from __future__ import annotations

import numpy as np


def ball(
    radius: float, voxel_size: tuple[float, float, float] = (1.0, 1.0, 1.0), shift: float = 0.3
) -> np.ndarray:
    """A ball with void around it, not centred on a voxel."""
    shape = [2 * int(radius / edge) + 5 for edge in voxel_size]
    axes = [
        (np.arange(n) - n // 2 - shift * i / 2) * edge
        for i, (n, edge) in enumerate(zip(shape, voxel_size, strict=True))
    ]
    z, y, x = np.meshgrid(*axes, indexing="ij", sparse=True)
    return np.asarray(z**2 + y**2 + x**2 < radius**2)


def plates(
    n: int,
    thickness: float,
    period: float,
    normal: tuple[float, float, float],
    voxel_size: tuple[float, float, float] = (1.0, 1.0, 1.0),
) -> np.ndarray:
    """Tilted plates in a cube of n voxels."""
    axes = [(np.arange(n) + 0.37) * edge for edge in voxel_size]
    height = sum(
        c * a for c, a in zip(normal, np.meshgrid(*axes, indexing="ij", sparse=True), strict=True)
    ) / np.linalg.norm(normal)
    return np.asarray(height % period < thickness)


def overlapping_spheres(n: int, radius: float, count: int, seed: int) -> np.ndarray:
    """The void of spheres at random, in a periodic cube."""
    axis = np.arange(n)
    void = np.ones((n, n, n), bool)
    for centre in np.random.default_rng(seed).random((count, 3)) * n:
        z, y, x = (((axis - c + n / 2) % n - n / 2) ** 2 for c in centre)
        void &= z[:, None, None] + y[:, None] + x > radius**2
    return void
