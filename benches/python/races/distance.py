"""Euclidean distance to the outside of a phase: of blobs, and of the wide pores of a foam."""

from __future__ import annotations

import numpy as np
from inputs import blobs, pores
from race import Race

import poresynth.metrics


def same(ours: np.ndarray, theirs: np.ndarray) -> bool:
    return np.allclose(ours, theirs, rtol=1e-5)


RACES = [
    Race("distance transform, blobs", lambda edge: [blobs(edge)], same),
    Race("distance transform, pores of a foam", lambda edge: [pores(edge)], same),
]

for race in RACES:

    @race.contestant("poresynth")
    def _(solid: np.ndarray, threads: int = 0) -> np.ndarray:
        return poresynth.metrics.distance_transform(solid, threads=threads)

    @race.contestant("edt", "edt")
    def _(solid: np.ndarray) -> np.ndarray:
        import edt

        return edt.edt(solid, parallel=0)

    @race.contestant("scipy.ndimage", "scipy", most=256)
    def _(solid: np.ndarray) -> np.ndarray:
        from scipy import ndimage

        return ndimage.distance_transform_edt(solid)
