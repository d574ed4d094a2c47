"""Two-point correlation by counting the pairs of each lag."""

from __future__ import annotations

import itertools

import numpy as np


def two_point(solid: np.ndarray, r_max: int, boundary: str) -> list[np.ndarray]:
    """S₂ for r = 0 … r_max: radial, along z, along y, along x."""
    sums = np.zeros((4, r_max + 1))
    pairs = np.zeros((4, r_max + 1))
    for lag in itertools.product(range(-r_max, r_max + 1), repeat=3):
        steps = list(zip(lag, solid.shape, strict=True))
        if any(abs(d) >= n for d, n in steps):
            continue
        if boundary == "periodic":
            first, second = solid, np.roll(solid, [-d for d in lag], axis=(0, 1, 2))
        else:
            first = solid[tuple(slice(max(-d, 0), n - max(d, 0)) for d, n in steps)]
            second = solid[tuple(slice(max(d, 0), n - max(-d, 0)) for d, n in steps)]
        product = np.count_nonzero(first & second)
        rows = [0] + [1 + a for a in range(3) if lag[a] >= 0 and sum(map(abs, lag)) == lag[a]]
        r = round(float(np.sqrt(np.dot(lag, lag))))
        if r <= r_max:
            sums[rows, r] += product
            pairs[rows, r] += first.size
    with np.errstate(invalid="ignore"):
        return list(sums / pairs)
