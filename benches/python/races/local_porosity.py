"""Porosity of all windows of 20³ voxels."""

from __future__ import annotations

import numpy as np
from inputs import blobs
from race import Race

import poresynth.metrics

EDGE = 20
race = Race(
    f"local porosity, windows of {EDGE}³",
    lambda edge: [blobs(edge)],
    lambda ours, theirs: np.array_equal(ours, theirs),
)


@race.contestant("poresynth")
def _(solid: np.ndarray, threads: int = 0) -> np.ndarray:
    return poresynth.metrics.local_porosity(solid, EDGE, threads=threads).counts[0]


@race.contestant("NumPy, summed volumes", "numpy")
def _(solid: np.ndarray) -> np.ndarray:
    sums = np.pad((~solid).cumsum(0, np.int32).cumsum(1).cumsum(2), ((1, 0),) * 3)
    for axis in range(3):
        sums = np.moveaxis(sums, axis, 0)
        sums = np.moveaxis(sums[EDGE:] - sums[:-EDGE], 0, axis)
    bins = np.minimum(sums.ravel() * 100 // EDGE**3, 99)
    return np.bincount(bins, minlength=100)
