"""The pore made to hang together: closed pores filled, a way opened from face to face."""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

from poresynth import _core
from poresynth.metrics import ComponentStatistics, component_statistics

__all__ = ["closed_pores", "open_path"]

PORE: Literal[6] = 6
"""Voxels of the pore touch by faces if those of the solid touch by corners."""


def closed_pores(
    solid: npt.NDArray[np.bool_], *, threads: int = 0
) -> tuple[npt.NDArray[np.uint32], npt.NDArray[np.int64]]:
    """Return the labelled pore, and the labels of the pores that do not reach the border."""
    found = component_statistics(~solid, connectivity=PORE, labels=True, threads=threads)
    low, high = found.bounding_boxes[..., 0], found.bounding_boxes[..., 1]
    closed = (low > 0).all(axis=1) & (high < solid.shape).all(axis=1)
    return _labels(found), np.flatnonzero(closed) + 1


def open_path(
    solid: npt.NDArray[np.bool_],
    score: npt.NDArray[np.float32],
    axis: int,
    width: float,
    free: npt.NDArray[np.bool_] | None,
    *,
    threads: int = 0,
) -> npt.NDArray[np.bool_]:
    """Return the solid with a way for the pore from face to face of an axis.

    The way is the cheapest through the solid where ``score``, low in the pore, is lowest; it is
    ``width`` voxels thick. What percolates is returned as it is.
    """
    found = component_statistics(~solid, connectivity=PORE, labels=True, threads=threads)
    if found.spans[:, axis].any():
        return solid
    pad = [(1, 1) if i == axis else (0, 0) for i in range(3)]
    # Two slabs of pore, each with what touches it; the pores between are cheap ground, no pieces.
    low, high = found.bounding_boxes[:, axis].T
    reached = np.isin(_labels(found), 1 + np.flatnonzero((low == 0) | (high == solid.shape[axis])))
    pore = np.pad(reached, pad, constant_values=True)
    depth = np.where(solid, -np.maximum(score, 0), 0).astype(np.float32)
    may = np.pad(np.ones_like(solid) if free is None else free, pad, constant_values=False)
    opened, *_ = _core.connect_phase(
        pore,
        np.pad(depth, pad, mode="edge"),
        connectivity=PORE,
        boundary="open",
        smallest=0,
        width=width,
        free=may,
        threads=threads,
    )
    inner = tuple(slice(1, -1) if i == axis else slice(None) for i in range(3))
    # What `connect_phase` took from the pore's surface to keep its number stays pore: the number is
    # restored once, at the end.
    return np.asarray(solid & ~opened[inner])


def _labels(found: ComponentStatistics) -> npt.NDArray[np.uint32]:
    assert found.labels is not None  # They were asked for.
    return found.labels
