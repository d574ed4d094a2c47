"""Mean intercept length of blobs, 49 directions."""

from __future__ import annotations

import numpy as np
from inputs import blobs
from race import Race

import poresynth.metrics

race = Race(
    "mean intercept length, 49 directions",
    lambda edge: [blobs(edge)],
    # Ours also looks at the middle of long steps.
    lambda ours, theirs: np.allclose(np.sort(ours), np.sort(theirs), rtol=0.02),
)


@race.contestant("poresynth")
def _(solid: np.ndarray, threads: int = 0) -> np.ndarray:
    return poresynth.metrics.mean_intercept_length(solid, threads=threads).mil


@race.contestant("NumPy, shifted volumes", "numpy")
def _(solid: np.ndarray) -> np.ndarray:
    steps = [
        (z, y, x)
        for z in range(-2, 3)
        for y in range(-2, 3)
        for x in range(-2, 3)
        if (z, y, x) > (0, 0, 0) and np.gcd.reduce((z, y, x)) == 1
    ]
    found = []
    for step in steps:
        first, second = (
            tuple(slice(max(sign * d, 0), min(sign * d, 0) or None) for d in step)
            for sign in (-1, 1)
        )
        changes = solid[first] != solid[second]
        found.append(np.linalg.norm(step) / changes.mean())
    return np.array(found)
