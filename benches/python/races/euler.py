"""Euler number, 26-connected, of blobs."""

from __future__ import annotations

import contextlib

import numpy as np
from inputs import blobs
from race import Race

import poresynth.metrics

race = Race(
    "Euler number, 26-connected",
    lambda edge: [blobs(edge)],
    # quantimpy knows 6 neighbours only, and weights the border: its number is not compared.
    lambda ours, theirs: theirs is None or ours == theirs,
)


@race.contestant("poresynth")
def _(solid: np.ndarray, threads: int = 0) -> int:
    return poresynth.metrics.euler_number(solid, threads=threads)


@race.contestant("scikit-image")
def _(solid: np.ndarray) -> int:
    from skimage import measure

    return measure.euler_number(solid, connectivity=3)


# A quantimpy built for an older NumPy fails with a ValueError.
with contextlib.suppress(ImportError, ValueError):
    from quantimpy import minkowski

    @race.contestant("quantimpy")
    def _(solid: np.ndarray) -> None:
        minkowski.functionals(solid)
