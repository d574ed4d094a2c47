"""Costs of bridges between the components of a phase, by plain Dijkstra from every component."""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Iterator

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import minimum_spanning_tree

LENGTH = 0.1
"""Toll of a voxel at the cut."""

Place = tuple[int, int, int]


def tolls(phase: np.ndarray, score: np.ndarray, free: np.ndarray) -> np.ndarray:
    """What a voxel costs: 0 in the phase, infinite where it may not change."""
    scores = np.sort(score[free].astype(np.float64))
    cut = scores[min(len(scores) - np.count_nonzero(phase & free), len(scores) - 1)]
    toll = np.maximum(cut - score, 0) / np.abs(scores - cut).mean() + LENGTH
    toll[~free] = np.inf
    toll[phase] = 0
    return toll


def neighbours(
    at: Place, shape: tuple[int, ...], connectivity: int, periodic: bool
) -> Iterator[tuple[float, Place]]:
    """Lengths of the steps, and the voxels that they lead to."""
    for step in itertools.product((-1, 0, 1), repeat=3):
        square = sum(s * s for s in step)
        if not 0 < square <= (1 if connectivity == 6 else 3):
            continue
        to = tuple(a + s for a, s in zip(at, step, strict=True))
        if periodic:
            to = tuple(t % n for t, n in zip(to, shape, strict=True))
        if all(0 <= t < n for t, n in zip(to, shape, strict=True)):
            yield math.sqrt(square), to


def distances(toll: np.ndarray, start: np.ndarray, connectivity: int, periodic: bool) -> np.ndarray:
    """Least cost of a way from a set of voxels to every voxel."""
    cost = np.where(start, 0.0, np.inf)
    queue = [(0.0, tuple(int(i) for i in at)) for at in np.argwhere(start)]
    while queue:
        reached, at = heapq.heappop(queue)
        if reached > cost[at]:
            continue
        for length, to in neighbours(at, toll.shape, connectivity, periodic):
            further = reached + length * (toll[at] + toll[to]) / 2
            if further < cost[to]:
                cost[to] = further
                heapq.heappush(queue, (further, to))
    return cost


def spanning_cost(toll: np.ndarray, labels: np.ndarray, connectivity: int, periodic: bool) -> float:
    """Cost of the cheapest bridges that make labelled components (from 1 on) one."""
    parts = [labels == k for k in range(1, int(labels.max()) + 1)]
    between = np.zeros((len(parts), len(parts)))
    for i, part in enumerate(parts):
        cost = distances(toll, part, connectivity, periodic)
        for j, other in enumerate(parts):
            between[i, j] = cost[other].min()
    return float(minimum_spanning_tree(csr_matrix(between)).sum())
