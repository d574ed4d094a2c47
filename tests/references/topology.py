"""Euler numbers by listing cells; periodic components by walking through the tiled volume."""

from __future__ import annotations

import itertools

import numpy as np


def cells(solid: np.ndarray, connectivity: int) -> np.ndarray:
    """The cubic complex of a phase that ends at the border, as a lattice of cells.

    A cell's dimension is the number of its odd indices. 26: voxels are the cubes, shape (2n + 1).
    6: voxels are the vertices, shape (2n − 1).
    """
    lattice = np.asarray(solid)
    for axis in range(3):
        lattice = np.moveaxis(lattice, axis, 0)
        n = len(lattice)
        if connectivity == 26:
            grown = np.zeros((2 * n + 1, *lattice.shape[1:]), bool)
            grown[1::2] = lattice
            grown[:-1:2] |= lattice
            grown[2::2] |= lattice
        else:
            grown = np.zeros((2 * n - 1, *lattice.shape[1:]), bool)
            grown[::2] = lattice
            grown[1::2] = lattice[:-1] & lattice[1:]
        lattice = np.moveaxis(grown, 0, axis)
    return lattice


def alternating_sum(lattice: np.ndarray, border: float = 1.0) -> float:
    """V − E + F − C, where a border plane of the lattice has a weight."""
    total = lattice.astype(float)
    for axis, n in enumerate(lattice.shape):
        signs = np.where(np.arange(n) % 2, -1.0, 1.0)
        # An axis of one plane has both borders there.
        weights = np.ones(n)
        for end in (0, n - 1):
            weights[end] -= 1 - border
        signs *= weights
        total *= np.expand_dims(signs, tuple({0, 1, 2} - {axis}))
    return float(total.sum())


def euler_number(solid: np.ndarray, connectivity: int, boundary: str) -> int:
    """χ of a phase."""
    if boundary == "open":
        return int(alternating_sum(cells(solid, connectivity)))
    total = 0
    joined = np.logical_or if connectivity == 26 else np.logical_and
    for paired in itertools.product([False, True], repeat=3):
        there = np.asarray(solid)
        for axis in np.flatnonzero(paired):
            there = joined(there, np.roll(there, 1, axis=axis))
        dimension = 3 - sum(paired) if connectivity == 26 else sum(paired)
        total += (-1) ** dimension * int(there.sum())
    return total


def edge_corrected(solid: np.ndarray, connectivity: int) -> float:
    """Δχ: cells in a face of the volume count one half, in an edge one fourth, in a corner ⅛."""
    return alternating_sum(cells(solid, connectivity), 0.5)


def periodic_components(
    solid: np.ndarray, connectivity: int
) -> list[tuple[int, list[list[int]], list[float], list[bool]]]:
    """Size, box, centroid and spans of each component, in C order of their first voxels."""
    order = {6: 1, 18: 2, 26: 3}[connectivity]
    steps = [s for s in itertools.product((-1, 0, 1), repeat=3) if 0 < np.abs(s).sum() <= order]
    shape = np.array(solid.shape)
    seen: dict[tuple[int, ...], np.ndarray] = {}
    found = []
    for start in np.argwhere(solid):
        if tuple(start.tolist()) in seen:
            continue
        seen[tuple(start.tolist())] = start
        stack, places, spans = [start], [], np.zeros(3, bool)
        while stack:
            place = stack.pop()
            places.append(place)
            for step in steps:
                there = place + step
                inside = tuple((there % shape).tolist())
                if not solid[inside]:
                    continue
                if inside in seen:
                    spans |= seen[inside] != there
                else:
                    seen[inside] = there
                    stack.append(there)
        low, high = np.min(places, axis=0), np.max(places, axis=0) + 1
        shift = low // shape * shape
        box = np.stack([np.where(spans, 0, low - shift), np.where(spans, shape, high - shift)], 1)
        centroid = np.where(spans, np.nan, np.mean(places, axis=0) - shift)
        found.append((len(places), box.tolist(), centroid.tolist(), spans.tolist()))
    return found
