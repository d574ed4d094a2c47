"""Point by point twins of the periodic field network: NumPy and loops."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import numpy as np

__all__ = [
    "encode",
    "gradient_penalty",
    "invariants",
    "latent",
    "mean_distance",
    "nearest_distances",
    "perceptron",
]

Array = np.ndarray


def encode(phase: float, bandwidth: int) -> list[float]:
    """Eq. 3 of one coordinate."""
    out = []
    for k in range(bandwidth + 1):
        out += [np.cos(2**k * np.pi * phase), np.sin(2**k * np.pi * phase)]
    return out


def latent(
    place: Sequence[float], numbers: Callable[[tuple[int, ...]], Array], kind: str, sigma: float
) -> Array:
    """Eq. 4, or its quintic cousins, at one place in cells of the lattice."""
    cell = np.floor(place).astype(int)
    t = np.asarray(place) - cell
    total, weights = 0.0, 0.0
    for corner in itertools.product((0, 1), repeat=len(t)):
        away = t - np.array(corner)
        if kind == "paper":
            weight = np.exp(-np.linalg.norm(away) / sigma)
        else:
            up = 6 * t**5 - 15 * t**4 + 10 * t**3
            weight = np.prod([u if side else 1 - u for u, side in zip(up, corner, strict=True)])
        weights += weight
        own = numbers(tuple(int(c + side) for c, side in zip(cell, corner, strict=True)))
        if kind == "gradient":
            # The numbers are slopes along the axes in turn.
            own = own * [4 * away[k % len(t)] for k in range(len(own))]
        total = total + weight * own
    return np.asarray(total / weights)


def perceptron(inputs: Array, layers: Sequence[tuple[Array, Array]]) -> Array:
    """Linear layers (weight, bias) with ReLU between them and a sigmoid at the end."""
    hidden = inputs
    for weight, bias in layers[:-1]:
        hidden = np.maximum(weight @ hidden + bias, 0)
    weight, bias = layers[-1]
    return 1 / (1 + np.exp(-(weight @ hidden + bias)))


def mean_distance(distance: Array, edge: int) -> Array:
    """Eq. 6 of the patch around each point; m is its number of points, the border a mirror."""
    edges = [min(edge, n) for n in distance.shape]
    padded = np.pad(np.abs(distance), [(e, e) for e in edges], mode="symmetric")
    out = np.empty(distance.shape)
    for index in np.ndindex(distance.shape):
        box = tuple(
            slice(i + e - e // 2, i + e - e // 2 + e) for i, e in zip(index, edges, strict=True)
        )
        out[index] = padded[box].mean()
    return out


def gradient_penalty(
    score: Callable[[Array], float], real: Array, fake: Array, mix: Array, step: float = 1e-5
) -> float:
    """Mean of (‖∇D‖ − 1)², by central differences; crops (batch, …), D of one crop."""
    found = []
    for one, other, share in zip(real, fake, mix, strict=True):
        point = share * one + (1 - share) * other
        gradient = np.zeros(point.shape)
        for index in np.ndindex(point.shape):
            away = np.zeros(point.shape)
            away[index] = step
            gradient[index] = (score(point + away) - score(point - away)) / (2 * step)
        found.append((np.linalg.norm(gradient) - 1) ** 2)
    return float(np.mean(found))


def nearest_distances(
    place: Sequence[float],
    numbers: Callable[[tuple[int, ...]], Array],
    jitter: float,
    farthest: float,
    reach: int = 3,
) -> Array:
    """Distances in cells to the nearest of the points in all cells around, at one place."""
    cell = np.floor(place).astype(int)
    found = []
    for step in itertools.product(range(-reach, reach + 1), repeat=len(cell)):
        site = tuple(int(c + s) for c, s in zip(cell, step, strict=True))
        point = np.array(site) + 0.5 + jitter / 2 * numbers(site)
        found.append(float(np.linalg.norm(np.asarray(place) - point)))
    return np.minimum(np.sort(found)[: len(cell) + 1], farthest)


def invariants(window: Array) -> list[float]:
    """What rotations leave of value, gradient and Hessian in the middle of 3 × 3 (× 3) values."""
    axes = window.ndim
    middle = (1,) * axes
    unit = np.eye(axes, dtype=int)

    def at(*steps: Array) -> float:
        return float(window[tuple(np.array(middle) + sum(steps, np.zeros(axes, int)))])

    g = np.array([(at(u) - at(-u)) / 2 for u in unit])
    h = np.empty((axes, axes))
    for i, j in itertools.product(range(axes), repeat=2):
        u, v = unit[i], unit[j]
        if i == j:
            h[i, i] = at(u) + at(-u) - 2 * at()
        else:
            h[i, j] = (at(u, v) + at(-u, -v) - at(u, -v) - at(-u, v)) / 4
    found = [at(), g @ g, np.trace(h), np.trace(h @ h), g @ h @ g]
    if axes == 3:
        found += [np.trace(h @ h @ h), (h @ g) @ (h @ g)]
    return [float(value) for value in found]
