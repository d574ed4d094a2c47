"""Changes of phase along the directions of the lattice, pair by pair."""

from __future__ import annotations

import itertools
import math

import numpy as np
from scipy.spatial import SphericalVoronoi


def steps(reach: int) -> np.ndarray:
    """One of each pair of opposite lattice directions, shape (n, 3)."""
    line = range(-reach, reach + 1)
    found = [s for s in itertools.product(line, repeat=3) if s > (0, 0, 0) and math.gcd(*s) == 1]
    return np.array(found)


def weights(directions: np.ndarray) -> np.ndarray:
    """Shares of the sphere that are nearest to each direction or its opposite."""
    units = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    areas = SphericalVoronoi(np.concatenate([units, -units])).calculate_areas()
    return areas[: len(units)] / (2 * np.pi)


def changes(solid: np.ndarray, step: np.ndarray, boundary: str) -> tuple[int, int]:
    """Changes of phase, and pairs, one step apart."""
    sides = list(zip(step, solid.shape, strict=True))
    if boundary == "open" and any(abs(d) >= n for d, n in sides):
        return 0, 0

    def at(by: np.ndarray) -> np.ndarray:
        if boundary == "periodic":
            return np.roll(solid, [-d for d in by], axis=(0, 1, 2))
        starts = [max(-d, 0) for d, _ in sides]
        lengths = [n - abs(d) for d, n in sides]
        corner = zip(starts, by, lengths, strict=True)
        return solid[tuple(slice(s + d, s + d + n) for s, d, n in corner)]

    start = at(np.zeros(3, int))
    differ = start ^ at(step)
    twice = np.zeros(start.shape, bool)
    if step @ step > 3:
        for p in itertools.product(*[{d // 2, -(-d // 2)} for d in step]):
            twice |= (start ^ at(np.array(p))) & (start ^ at(step - p))
    total = np.count_nonzero(differ) + 2 * np.count_nonzero(twice & ~differ)
    return total, start.size
