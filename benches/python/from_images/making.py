"""Making volumes from images, with the time that it takes."""

from __future__ import annotations

import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from poresynth.engines.solid_texture import SolidTexture
from poresynth.volume import Volume


@dataclass(frozen=True)
class Run:
    """What is done with the images of a material."""

    title: str
    preset: str
    images: int = 1


RUNS = {
    "one": Run("quality, one slice", "quality"),
    "three": Run("quality, three slices", "quality", images=3),
    "prieto": Run("prieto, one slice", "prieto"),
    "kopf": Run("kopf, one slice", "kopf"),
    "chen_wang": Run("chen_wang, one slice", "chen_wang"),
}


@dataclass(frozen=True, eq=False)
class Made:
    """Volumes of several seeds; the seconds of the fit, and of one volume after it (median)."""

    volumes: list[Volume]
    mode: str
    fit_seconds: float
    sample_seconds: float

    def seconds(self) -> dict[str, float]:
        """What it takes to make one volume, and the part of it that the fit is."""
        return {
            "seconds": round(self.fit_seconds + self.sample_seconds, 2),
            "fit_seconds": round(self.fit_seconds, 2),
        }


def synthesise(images: Sequence[Volume], edge: int, seeds: int, **parameters: Any) -> Made:
    """Make a cube a seed."""
    start = time.perf_counter()
    engine = SolidTexture(**parameters).fit(images)
    fit = time.perf_counter() - start
    volumes, seconds = [], []
    for seed in range(seeds):
        start = time.perf_counter()
        volumes.append(engine.sample((edge,) * 3, seed=seed))
        seconds.append(time.perf_counter() - start)
    return Made(volumes, engine.mode_, fit, statistics.median(seconds))
