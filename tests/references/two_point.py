"""Two-point correlation by counting the pairs of each lag."""

from __future__ import annotations

import itertools

import numpy as np


def pairs(first: np.ndarray, second: np.ndarray, lag: tuple[int, ...], boundary: str) -> np.ndarray:
    """Pairs with the ends in the two phases, and all pairs, that are a lag apart."""
    steps = list(zip(lag, first.shape, strict=True))
    if any(abs(d) >= n for d, n in steps):
        return np.zeros(2)
    if boundary == "periodic":
        start, end = first, np.roll(second, [-d for d in lag], axis=(0, 1, 2))
    else:
        start = first[tuple(slice(max(-d, 0), n - max(d, 0)) for d, n in steps)]
        end = second[tuple(slice(max(d, 0), n - max(-d, 0)) for d, n in steps)]
    return np.array([np.count_nonzero(start & end), start.size])


def two_point(
    solid: np.ndarray,
    r_max: int,
    boundary: str,
    other: np.ndarray | None = None,
    voxel_size: tuple[float, float, float] = (1, 1, 1),
) -> list[np.ndarray]:
    """S₂ for r = 0 … r_max: radial, along z, along y, along x."""
    sums = np.zeros((4, r_max + 1))
    counts = np.zeros((4, r_max + 1))
    for lag in itertools.product(range(-r_max, r_max + 1), repeat=3):
        product, count = pairs(solid, solid if other is None else other, lag, boundary)
        length = np.linalg.norm(np.multiply(lag, voxel_size)) / min(voxel_size)
        r = int(np.floor(length + 0.5))
        if r <= r_max:
            sums[0, r] += product
            counts[0, r] += count
        for axis in range(3):
            if sum(map(abs, lag)) == abs(lag[axis]):
                sums[1 + axis, abs(lag[axis])] += product
                counts[1 + axis, abs(lag[axis])] += count
    with np.errstate(invalid="ignore"):
        return list(sums / counts)


def two_point_map(solid: np.ndarray, other: np.ndarray, r_max: int, boundary: str) -> np.ndarray:
    """S₂ for each lag from −r_max to r_max."""
    lags = itertools.product(range(-r_max, r_max + 1), repeat=3)
    counted = np.array([pairs(solid, other, lag, boundary) for lag in lags])
    with np.errstate(invalid="ignore"):
        return (counted[:, 0] / counted[:, 1]).reshape((2 * r_max + 1,) * 3)
