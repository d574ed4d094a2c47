"""What the studies of quality share: volumes of several seeds, made once and measured together."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

import poresynth
from poresynth import metrics
from poresynth.metrics.copying import PROBES
from poresynth.volume import Volume

SECOND = "second specimen"


def synthesise(exemplar: Volume, edge: int, seeds: int, **parameters: Any) -> Any:
    """Make a cube a seed; return them and the median of the seconds."""
    volumes, seconds = [], []
    for seed in range(seeds):
        start = time.perf_counter()
        made = poresynth.VolumeTexture(**parameters).fit(exemplar).sample((edge,) * 3, seed=seed)
        seconds.append(time.perf_counter() - start)
        # Without the match map, which takes more memory than the voxels.
        volumes.append(Volume(made.array, made.voxel_size, made.unit))
    return volumes, statistics.median(seconds)


def solids(
    exemplar: Volume, volumes: Sequence[Volume]
) -> tuple[npt.NDArray[np.bool_], list[npt.NDArray[np.bool_]]]:
    """Cut exemplar and volumes at the exemplar's threshold."""
    level = poresynth.threshold(exemplar)
    own, *others = (poresynth.binarize(volume, level) for volume in (exemplar, *volumes))
    return own, others


def structure_and_novelty(
    exemplar: Volume,
    volumes: Sequence[Volume],
    own: npt.NDArray[np.bool_],
    others: list[npt.NDArray[np.bool_]],
    samples: int,
) -> dict[str, Any]:
    """Measure what must be read together, pooled over the volumes.

    ``samples`` times the usual number of blocks are compared, spread over the volumes, so that a
    single piece of the material is known as well as the volumes of several seeds.
    """
    structure = metrics.structure_error(own, others)
    curve = metrics.novelty_curve(exemplar, volumes, probes=PROBES * samples // len(volumes))
    return {
        "structure_error_percent": known(structure.percent),
        "window": structure.window,
        "differences": {
            name: {
                "error_percent": known(found.error_percent),
                "noise_percent": known(found.noise_percent),
            }
            for name, found in structure.differences.items()
        },
        **{f"novelty_{edge}": known(found.mirrored) for edge, found in curve.items()},
        **{f"novelty_{edge}_unmirrored": known(found.plain) for edge, found in curve.items()},
    }


def known(value: float) -> float | None:
    """Round to six figures; None stands for what is not defined."""
    return float(f"{value:.6g}") if math.isfinite(value) else None
