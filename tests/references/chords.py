"""Runs along the axes, voxel by voxel."""

from __future__ import annotations

import numpy as np


def chords(solid: np.ndarray, axis: int, boundary: str) -> tuple[list[int], list[int]]:
    """Lengths of the chords that end inside, and of those that the border cuts."""
    inside, cut = [], []
    for line in np.moveaxis(solid, axis, -1).reshape(-1, solid.shape[axis]):
        n = len(line)
        if line.all():
            cut.append(n)
            continue
        if boundary == "periodic":
            line = np.roll(line, -int(np.argmin(line)))
        edges = np.flatnonzero(np.diff(np.concatenate([[0], line, [0]]).astype(int)))
        for start, end in edges.reshape(-1, 2):
            at_border = boundary == "open" and (start == 0 or end == n)
            (cut if at_border else inside).append(int(end - start))
    return inside, cut


def lineal_path(solid: np.ndarray, axis: int, r_max: int, boundary: str) -> np.ndarray:
    """Share of the segments of r voxels that lie in the phase as a whole."""
    line = np.moveaxis(solid, axis, 0)
    n = len(line)
    found = np.full(r_max + 1, np.nan)
    for r in range(min(n, r_max + 1)):
        steps = [np.roll(line, -k, axis=0) for k in range(r + 1)]
        whole = np.logical_and.reduce(steps)
        found[r] = (whole if boundary == "periodic" else whole[: n - r]).mean()
    return found
