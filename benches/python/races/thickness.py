"""Local thickness of blobs, and of the wide pores of a foam."""

from __future__ import annotations

import numpy as np
from inputs import blobs, pores
from race import Race

import poresynth.metrics


def similar(ours: np.ndarray, theirs: np.ndarray) -> bool:
    """Rounded radii are up to a voxel too small."""
    return bool(abs(ours[ours > 0].mean() - 2 * theirs[theirs > 0].mean()) < 2)


RACES = [
    Race("local thickness, blobs", lambda edge: [blobs(edge)], similar, sizes=(128, 256)),
    Race("local thickness, pores of a foam", lambda edge: [pores(edge)], similar),
]

for race in RACES:

    @race.contestant("poresynth")
    def _(solid: np.ndarray, threads: int = 0) -> np.ndarray:
        return poresynth.metrics.local_thickness(solid, threads=threads)

    @race.contestant("PoreSpy, balls, whole radii", "porespy")
    def _(solid: np.ndarray) -> np.ndarray:
        from porespy.filters import local_thickness

        return local_thickness(solid, method="bf")

    @race.contestant("PoreSpy, distances, whole radii", "porespy", most=256)
    def _(solid: np.ndarray) -> np.ndarray:
        from porespy.filters import local_thickness

        return local_thickness(solid, method="dt")

    # The only route to what ours finds; where whole radii take 9 s, it takes half an hour.
    @race.contestant("PoreSpy, distances, all radii", "porespy", most=128)
    def _(solid: np.ndarray) -> np.ndarray:
        from porespy.filters import local_thickness
        from scipy.ndimage import distance_transform_edt

        radii = np.unique(distance_transform_edt(solid))
        return local_thickness(solid, method="legacy", sizes=radii[:0:-1])
