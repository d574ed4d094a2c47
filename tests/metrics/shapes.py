"""Shapes of known topology, with an empty border."""

from __future__ import annotations

import numpy as np


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
