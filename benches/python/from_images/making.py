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


@dataclass(frozen=True, order=True)
class Time:
    """What something took, of a clock on the wall and of all cores together."""

    seconds: float
    cpu_seconds: float

    @classmethod
    def now(cls) -> Time:
        """Both clocks."""
        return cls(time.perf_counter(), time.process_time())

    def until_now(self) -> Time:
        """What has passed since."""
        now = Time.now()
        return Time(now.seconds - self.seconds, now.cpu_seconds - self.cpu_seconds)


@dataclass(frozen=True, eq=False)
class Made:
    """Volumes of several seeds; the times of the fit, and of one volume after it (median); how
    much memory the engine says that it takes."""

    volumes: list[Volume]
    mode: str
    memory: int
    fit: Time
    sample: Time

    def seconds(self) -> dict[str, float]:
        """What it takes to make one volume, and the part of it that the fit is."""
        return {
            "seconds": round(self.fit.seconds + self.sample.seconds, 2),
            "fit_seconds": round(self.fit.seconds, 2),
            "cpu_seconds": round(self.fit.cpu_seconds + self.sample.cpu_seconds, 2),
        }


def synthesise(images: Sequence[Volume], edge: int, seeds: int, **parameters: Any) -> Made:
    """Make a cube a seed."""
    start = Time.now()
    engine = SolidTexture(**parameters).fit(images)
    fit = start.until_now()
    volumes, times = [], []
    for seed in range(seeds):
        start = Time.now()
        volumes.append(engine.sample((edge,) * 3, seed=seed))
        times.append(start.until_now())
    memory = engine.estimate_memory((edge,) * 3)
    return Made(volumes, engine.mode_, memory, fit, statistics.median_low(times))
