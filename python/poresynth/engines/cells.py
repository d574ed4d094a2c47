"""A volume cut into cells that are gone through one by one."""

from __future__ import annotations

import itertools
import math

import numpy as np

__all__ = ["Box", "cells", "grown", "seen_from"]

Box = tuple[slice, slice, slice]


def cells(shape: tuple[int, ...], edge: int) -> list[Box]:
    """Cut a volume into cells of about the same edges, none longer than ``edge``, in C order.

    Parameters
    ----------
    shape : (int, int, int)
        Of the volume.
    edge : int
        Most voxels along an axis.
    """
    ranges = []
    for n in shape:
        cuts = np.linspace(0, n, math.ceil(n / edge) + 1).round().astype(int).tolist()
        ranges.append([slice(a, b) for a, b in itertools.pairwise(cuts)])
    return [(z, y, x) for z, y, x in itertools.product(*ranges)]


def grown(box: Box, shape: tuple[int, ...], margin: int) -> Box:
    """Return a box with a margin, as far as the volume goes.

    Parameters
    ----------
    box : tuple of slice
    shape : (int, int, int)
        Of the volume.
    margin : int
        Voxels on each side.
    """
    z, y, x = (
        slice(max(part.start - margin, 0), min(part.stop + margin, n))
        for part, n in zip(box, shape, strict=True)
    )
    return (z, y, x)


def seen_from(part: Box, whole: Box) -> Box:
    """Return the place of a part in an array of the whole.

    Parameters
    ----------
    part, whole : tuple of slice
        Boxes of one volume.
    """
    z, y, x = (slice(a.start - b.start, a.stop - b.start) for a, b in zip(part, whole, strict=True))
    return (z, y, x)
