"""Thinning to curves, of blobs and of a foam."""

from __future__ import annotations

import numpy as np
from inputs import blobs
from race import Race

import poresynth.metrics
from poresynth import exemplars


def foam(edge: int) -> np.ndarray:
    gray = np.asarray(exemplars.foam((edge,) * 3, cell=24.0, seed=1))
    return gray > gray.mean()


def as_many(ours: np.ndarray, theirs: np.ndarray) -> bool:
    """Skeletons of like size; where the middle is, and what of thin parts is lost, differs."""
    return abs(np.count_nonzero(theirs) / np.count_nonzero(ours) - 1) < 0.2


for race in (
    Race("thinning of blobs", lambda edge: [blobs(edge)], as_many),
    Race("thinning of a foam", lambda edge: [foam(edge)], as_many),
):

    @race.contestant("poresynth")
    def _(solid: np.ndarray) -> np.ndarray:
        return poresynth.metrics.skeletonize(solid)

    @race.contestant('poresynth, method="lee"', "poresynth")
    def _(solid: np.ndarray) -> np.ndarray:
        return poresynth.metrics.skeletonize(solid, method="lee")

    @race.contestant("scikit-image")
    def _(solid: np.ndarray) -> np.ndarray:
        from skimage import morphology

        return morphology.skeletonize(solid, method="lee")
