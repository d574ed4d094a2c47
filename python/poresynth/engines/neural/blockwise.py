"""Volumes too large for memory: made and written block by block."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from poresynth import io
from poresynth.engines.neural.matching import ValueMap
from poresynth.engines.neural.scaling import Scaling
from poresynth.engines.neural.tiles import Box, blocks
from poresynth.volume import Volume

__all__ = ["BLOCK", "WRITING", "write_blocks"]

BLOCK = 128
"""Edge of the blocks, voxels: the chunk of a Zarr store."""

WRITING = 1 << 26
"""What writing a block takes beside the block, bytes: compression, mapped pages."""

Field = npt.NDArray[np.float32]


def write_blocks(
    path: str | Path,
    like: Volume,
    make: Callable[[Box, Callable[[float], object]], Field],
    scaling: Scaling,
    matched: ValueMap | None,
    progress: Callable[[float], object],
) -> dict[str, float]:
    """Make a volume block by block and write it; the file appears whole or not at all.

    Parameters
    ----------
    path : path-like
        A TIFF or a Zarr store.
    like : Volume
        Shape, data type, scale and metadata; its voxels are not looked at.
    make : callable
        Returns the field of a block; called with the block, and with a function that takes the
        share of it that is done. Every block is made twice if the values are to be matched.
    scaling : Scaling
        Of the exemplar.
    matched : ValueMap or None
        What gives the values of the whole volume; None takes the field as it is.
    progress : callable
        Called with the share of all that is done.

    Returns
    -------
    dict of float
        ``porosity`` of what was written, and ``raw_porosity`` of the field as it is.
    """
    boxes = blocks(like.shape, BLOCK)
    steps = len(boxes) * (1 if matched is None else 2)

    def made(box: Box, done: int) -> Field:
        return make(box, lambda share: progress((done + share) / steps))

    def pores(values: npt.NDArray[Any]) -> int:
        return int(np.count_nonzero(scaling.phases.phase_of(values) == 0))

    raw, written = 0, 0
    to_values = scaling.values if matched is None else matched
    # Opened before the first round, so that what cannot be written fails at once.
    with io.create(path, like) as writer:
        if matched is not None:
            for done, box in enumerate(boxes):
                field = made(box, done)
                matched.see(field)
                raw += pores(scaling.values(field))
            matched.settle()
        for done, box in enumerate(boxes, steps - len(boxes)):
            values = to_values(made(box, done))
            written += pores(values)
            writer[box.slices] = values
    voxels = math.prod(like.shape)
    raw = written if matched is None else raw
    return {"porosity": written / voxels, "raw_porosity": raw / voxels}
