"""A whole synthesis, each edge twice the exemplar's: the preset quality beside fast.

No maintained public library makes a volume from a volume; zhang_2017 reports 1200 s for 120³
from 60³. results.py times the preset paper.
"""

from __future__ import annotations

import numpy as np
from race import Race

import poresynth
from poresynth import exemplars

LEAST = 40  # the smallest exemplar for windows of 10 at three levels
race = Race(
    "synthesis of a volume twice as wide",
    lambda edge: [np.asarray(exemplars.foam((max(edge // 2, LEAST),) * 3, cell=20.0, seed=1))],
    sizes=(120,),
    large=(),
)


def synthesize(exemplar: np.ndarray, preset: str, threads: int = 0) -> np.ndarray:
    shape = tuple(2 * n for n in exemplar.shape)
    return poresynth.VolumeTexture(preset=preset).fit(exemplar).sample(shape, threads=threads).array


@race.contestant("poresynth")
def _(exemplar: np.ndarray, threads: int = 0) -> np.ndarray:
    return synthesize(exemplar, "quality", threads)


@race.contestant("the preset fast", "poresynth")
def _(exemplar: np.ndarray) -> np.ndarray:
    return synthesize(exemplar, "fast")
