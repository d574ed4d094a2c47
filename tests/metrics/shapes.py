"""Shapes whose topology, surface or fabric is known."""

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


def voxel() -> np.ndarray:
    return np.pad(np.ones((1, 1, 1), bool), 1)


def cube(edge: int = 7) -> np.ndarray:
    return np.pad(np.ones((edge,) * 3, bool), 1)


def hollow_cube() -> np.ndarray:
    solid = cube()
    solid[3:6, 3:6, 3:6] = False
    return solid


def torus() -> np.ndarray:
    solid = np.pad(np.ones((3, 9, 9), bool), 1)
    solid[:, 4:7, 4:7] = False
    return solid


def tunnelled_cube(tunnels: int = 3) -> np.ndarray:
    """Straight parallel tunnels."""
    solid = np.pad(np.ones((5, 5, 13), bool), 1)
    for i in range(tunnels):
        solid[:, 3, 3 + 4 * i] = False
    return solid


def box_frame() -> np.ndarray:
    """The twelve edges of a box."""
    n = 9
    border = np.zeros((3, n, n, n), bool)
    for axis in range(3):
        np.moveaxis(border[axis], axis, 0)[[0, -1]] = True
    return np.pad(border.sum(axis=0) >= 2, 1)


def rod_lattice(nodes: int = 5) -> np.ndarray:
    """Rods of one voxel through a cubic lattice of nodes; open at the border of the lattice."""
    n = 4 * (nodes - 1) + 1
    on = np.stack(np.meshgrid(*[np.arange(n) % 4 == 0] * 3, indexing="ij"))
    return np.pad(on.sum(axis=0) >= 2, 1)


def pair(step: tuple[int, int, int]) -> np.ndarray:
    """Two voxels, one step from each other."""
    solid = np.zeros((4, 4, 4), bool)
    solid[1, 1, 1] = solid[tuple(1 + d for d in step)] = True
    return solid
