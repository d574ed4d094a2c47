"""Signed distance of a phase, clipped at 6 voxels, as the volume engine uses it."""

from __future__ import annotations

import numpy as np
from inputs import blobs
from race import Race

from poresynth import _core

CLIP = 6
race = Race(
    f"signed distance, clipped at {CLIP} voxels",
    lambda edge: [blobs(edge)],
    lambda ours, theirs: np.allclose(ours, theirs, atol=1e-4),
)


def clipped(inside: np.ndarray, outside: np.ndarray, phase: np.ndarray) -> np.ndarray:
    return np.clip(np.where(phase, inside - 0.5, 0.5 - outside), -CLIP, CLIP)


@race.contestant("poresynth")
def _(phase: np.ndarray) -> np.ndarray:
    return _core.signed_distance(phase, CLIP, boundary="open")


@race.contestant("edt", "edt")
def _(phase: np.ndarray) -> np.ndarray:
    import edt

    return clipped(edt.edt(phase, parallel=0), edt.edt(~phase, parallel=0), phase)


@race.contestant("scipy.ndimage", "scipy")
def _(phase: np.ndarray) -> np.ndarray:
    from scipy import ndimage

    distance = ndimage.distance_transform_edt
    return clipped(distance(phase), distance(~phase), phase)
