"""The volume under a marching-cubes surface, one cube at a time, without its triangles' table."""

from __future__ import annotations

import itertools

import numpy as np


def surface_pieces(field: np.ndarray, nearest: float) -> list[np.ndarray]:
    """Return the crossing of each edge between two voxels of unlike sign, as a set of points.

    Positions (z, y, x) in voxels, outer corner at 0. What `isosurface` uses as vertices inside the
    volume, found by a plain loop.
    """
    points = []
    for index in itertools.product(*(range(n) for n in field.shape)):
        for axis in range(3):
            other = list(index)
            other[axis] += 1
            if other[axis] == field.shape[axis]:
                continue
            here, there = float(field[index]), float(field[tuple(other)])
            if (here > 0) != (there > 0):
                share = min(max(here / (here - there), nearest), 1 - nearest)
                point = np.array(index, dtype=float) + 0.5
                point[axis] += share
                points.append(point)
    return points
