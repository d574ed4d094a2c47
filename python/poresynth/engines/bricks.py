"""Volumes brick by brick: in bounded memory, and without what lies outside a body.

Each brick is made with the voxels beside it that are made already, as known ones: they lead what is
new up to them, so that no border shows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from poresynth.engines.base import ProgressCallback, SynthesizedVolume
from poresynth.engines.cells import Box, cells, seen_from

__all__ = ["Wall", "lay", "layout"]

EDGE = 192
"""Edge of a brick, voxels. With the margin, 232³ voxels take some 0.6 GB; half the edge takes a
quarter of that, and makes 1.6 times as many voxels twice."""

MARGIN = 32
"""Least margin, voxels. With 16, bricks of a foam changed phase at their borders 1.4 times as often
as the foam does elsewhere."""

Shape = tuple[int, int, int]
_Bools = npt.NDArray[np.bool_]


class Wall(Protocol):
    """Where bricks are put, and from where their neighbours are read: an array, or a file."""

    def __getitem__(self, box: Box, /) -> npt.NDArray[Any]:
        """Return the voxels of a box."""

    def __setitem__(self, box: Box, part: Any, /) -> None:
        """Set the voxels of a box."""


@dataclass(frozen=True, eq=False)
class _Brick:
    """What is synthesised for a cell of the wall.

    Attributes
    ----------
    box : tuple of slice
        The part of the cell that matters, and the margin before it.
    own : tuple of slice
        Where the cell and the box overlap.
    known, free : numpy.ndarray of bool
        Voxels of the box that were made before, and those that are new.
    """

    box: Box
    own: Box
    known: _Bools
    free: _Bools


def lay(
    wall: Wall,
    shape: Shape,
    sample: Callable[..., SynthesizedVolume],
    *,
    least: int,
    seed: int,
    domain: _Bools | None,
    outside: Any,
    progress: ProgressCallback | None,
    **options: Any,
) -> dict[str, Any]:
    """Make a volume brick by brick.

    Parameters
    ----------
    wall : Wall
        Takes the voxels.
    shape : (int, int, int)
        Of the volume.
    sample : callable
        `sample` of an engine.
    least : int
        Least edge that the engine makes, voxels: the largest window at the coarsest level. That
        much a brick sees of its neighbours, but at least `MARGIN`.
    seed : int
        Each brick has one of its own, which depends on this one and its place.
    domain : numpy.ndarray of bool or None
        The voxels that matter, shape (z, y, x); bricks without any are not made.
    outside : scalar
        The value of the others.
    progress : callable or None
        As of ``sample``.
    **options
        More arguments of ``sample``.

    Returns
    -------
    dict
        ``count`` of the bricks that were made, their ``edge`` and ``margin``; ``seam``, as of
        `poresynth.engines.seam.seam`, and ``copying``: means over the new voxels.
    """
    cut, plan = cells(shape, EDGE), layout(least)
    found: list[tuple[int, dict[str, Any]]] = []
    for number, cell in enumerate(cut):
        brick = _brick(cell, shape, domain, plan["margin"])
        if brick is None or brick.own != cell:
            wall[cell] = outside
        if brick is None:
            continue
        given: dict[str, Any] = {}
        if brick.known.any():
            given = {"known": wall[brick.box], "known_mask": brick.known}
        made = sample(
            brick.known.shape,
            seed=_seed(seed, number),
            mask=brick.known | brick.free,
            progress=_share(progress, number, len(cut)),
            **given,
            **options,
        )
        wall[brick.own] = made.array[seen_from(brick.own, brick.box)]
        new = int(np.count_nonzero(brick.free))
        found.append((new, made.metadata["poresynth"]))
    return {
        "count": len(found),
        **plan,
        "seam": _means(found, "seam"),
        "copying": _means(found, "copying"),
    }


def layout(least: int) -> dict[str, int]:
    """Return the ``edge`` of a brick, and the ``margin`` of its neighbours that it sees, voxels.

    Parameters
    ----------
    least : int
        Least edge that the engine makes, voxels.
    """
    return {"edge": EDGE, "margin": max(least, MARGIN)}


def _brick(cell: Box, shape: Shape, domain: _Bools | None, margin: int) -> _Brick | None:
    """Return what is synthesised for a cell, None if nothing in it matters."""
    inside = None if domain is None else domain[cell]
    box = []
    for axis, (part, n) in enumerate(zip(cell, shape, strict=True)):
        first, last = part.start, part.stop
        if inside is not None:
            others = tuple(i for i in range(3) if i != axis)
            filled = np.flatnonzero(inside.any(axis=others))
            if not len(filled):
                return None
            first, last = part.start + int(filled[0]), part.start + int(filled[-1]) + 1
        # An engine makes no smaller edge than the margin.
        start = max(0, first - margin)
        box.append(slice(start, min(n, max(last, start + margin))))
    z, y, x = box
    where: Box = (z, y, x)
    before, new = _order(cell, where)
    if domain is not None:
        before, new = before & domain[where], new & domain[where]
    z, y, x = (
        slice(max(a.start, b.start), min(a.stop, b.stop)) for a, b in zip(cell, where, strict=True)
    )
    return _Brick(where, (z, y, x), before, new)


def _order(cell: Box, box: Box) -> tuple[_Bools, _Bools]:
    """Return which voxels of a box lie in cells before this one, and which in it."""
    sides = []
    for axis, (part, whole) in enumerate(zip(cell, box, strict=True)):
        at = np.arange(whole.start, whole.stop)
        side = (at >= part.stop).astype(np.int8) - (at < part.start)
        sides.append(side.reshape([-1 if i == axis else 1 for i in range(3)]))
    z, y, x = sides
    # The sign of the first axis along which they differ says which comes first in C order.
    order = 9 * z + 3 * y + x
    return order < 0, order == 0


def _seed(seed: int, number: int) -> int:
    return int(np.random.SeedSequence([seed, number]).generate_state(1, np.uint64)[0])


def _share(progress: ProgressCallback | None, number: int, count: int) -> ProgressCallback | None:
    """Return what reports the progress of one brick as that of the whole."""
    if progress is None:
        return None
    report = progress
    name = f"brick {number + 1} of {count}"
    return lambda stage, share: report(f"{name}, {stage}", (number + share) / count)


def _means(found: list[tuple[int, dict[str, Any]]], name: str) -> dict[str, float]:
    """Return the means of figures over the bricks that have them, by their new voxels."""
    means = {}
    for figure in dict.fromkeys(key for _, facts in found for key in facts.get(name, {})):
        pairs = [(new, facts.get(name, {}).get(figure)) for new, facts in found]
        known = [(new, value) for new, value in pairs if value is not None]
        if known:
            weights, values = zip(*known, strict=True)
            means[figure] = float(np.average(values, weights=weights))
    return means
