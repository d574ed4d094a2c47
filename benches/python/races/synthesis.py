"""A whole synthesis, each edge twice the exemplar's: the preset quality beside fast.

Others are too slow to run each time, and are named here. zhang_2017 reports 1200 s for 120³ from
60³. SNESIM of MPSlib (scikit-mps 0.6.0: mps_snesim_tree, template 5³, three grids, 25 conditions)
took 364 s of one core for 64³ from a binary foam of 40³, for a structure error of 32 %; the preset
quality 0.7 s, for 15 %. results.py times the preset paper.
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
