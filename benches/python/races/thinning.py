"""Thinning to curves, of blobs and of a foam."""

from __future__ import annotations

import numpy as np
from inputs import blobs, foam
from race import Race

import poresynth.metrics


def as_many(ours: np.ndarray, theirs: np.ndarray) -> bool:
    """Skeletons of like size; where the middle is, and what of thin parts is lost, differs."""
    return abs(np.count_nonzero(theirs) / np.count_nonzero(ours) - 1) < 0.2


for race in (
    Race("thinning of blobs", lambda edge: [blobs(edge)], as_many),
    Race("thinning of a foam", lambda edge: [foam(edge)], as_many),
):

    @race.contestant("poresynth")
    def _(solid: np.ndarray, threads: int = 0) -> np.ndarray:
        return poresynth.metrics.skeletonize(solid, threads=threads)

    @race.contestant('poresynth, method="lee"', "poresynth")
    def _(solid: np.ndarray) -> np.ndarray:
        return poresynth.metrics.skeletonize(solid, method="lee")

    @race.contestant("scikit-image")
    def _(solid: np.ndarray) -> np.ndarray:
        from skimage import morphology

        return morphology.skeletonize(solid, method="lee")
