"""Volumes whose slices are given to the engine, so that what it makes can be held against them.

**The rule for slices.** Of all slices of a volume the one is given whose two-point correlation S2
(radial, in its plane, r = 1 … 50 pixels, at most half of the edge) is nearest, by the root of the
sum of squares, to the median of all slices' S2. Of three slices each is the nearest to the median
of those across its own axis.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from specimens import PROCEDURAL, TITLES, chosen, scans

import poresynth
from poresynth import metrics
from poresynth.metrics.correlation import R_MAX, relative_error
from poresynth.metrics.sections import SECTION_AXES
from poresynth.volume import Volume

EDGE = 128  # voxels of a volume, at most: its first corner
CONNECTED = ("open-cell foam", "trabecular bone")  # their solid is one piece in nature
LEFT_OUT = ("fine bone",)  # the scan of the trabecular bone, once more

TRUTHS = tuple(title for title in TITLES if title not in LEFT_OUT)


@dataclass(frozen=True, eq=False)
class Slices:
    """Slices of a volume, by the axis that each is across.

    Parameters
    ----------
    images : dict of str to Volume
        Each of shape (1, row, column).
    places : dict of str to int
        Where each was cut.
    two_point : numpy.ndarray
        The mean of their S2.
    """

    images: dict[Any, Volume]
    places: dict[str, int]
    two_point: npt.NDArray[np.float64]

    def to_compare(self) -> dict[Any, Volume] | Volume:
        """What comparisons take: one slice stands for all axes."""
        return self.images if len(self.images) > 1 else next(iter(self.images.values()))


@dataclass(frozen=True, eq=False)
class Truth:
    """A volume that is known, and is given to the engine as slices only."""

    title: str
    volume: Volume

    @cached_property
    def solid(self) -> npt.NDArray[np.bool_]:
        """The volume, cut at its own threshold."""
        return poresynth.binarize(self.volume, poresynth.threshold(self.volume))

    @property
    def reach(self) -> int:
        """The longest distance that slices are chosen by."""
        return min(R_MAX, min(self.solid.shape) // 2)

    @cached_property
    def curves(self) -> dict[str, npt.NDArray[np.float64]]:
        """S2 of every slice across each axis, shape (slice, r)."""
        found = {}
        for axis in SECTION_AXES:
            stack = metrics.sections(self.solid, axis).array
            found[axis] = np.stack(
                [
                    metrics.two_point_correlation(stack[i : i + 1], self.reach).radial
                    for i in range(len(stack))
                ]
            )
        return found

    def slices(self, count: int) -> Slices:
        """Return one slice, or one across each of three axes, by the rule."""
        if count == 1:
            middle = np.median(np.concatenate([*self.curves.values()]), axis=0)
            nearest = {axis: _nearest(curves, middle) for axis, curves in self.curves.items()}
            axis = min(nearest, key=lambda axis: nearest[axis][1])
            places = {axis: nearest[axis][0]}
        else:
            places = {
                axis: _nearest(curves, np.median(curves, axis=0))[0]
                for axis, curves in self.curves.items()
            }
        images = {}
        for axis, place in places.items():
            stack = metrics.sections(self.volume, axis)
            images[axis] = stack.with_array(np.ascontiguousarray(stack.array[place : place + 1]))
        curve = np.mean([self.curves[axis][place] for axis, place in places.items()], axis=0)
        return Slices(images, places, curve)

    def slice_error(self, slices: Slices) -> float:
        """D2 of slices against their volume, percent: how far they can tell."""
        whole = metrics.two_point_correlation(self.solid, self.reach)
        return relative_error(slices.two_point, whole.radial)


def truths(words: Sequence[str]) -> Iterator[Truth]:
    """Yield the volumes with one of the words in their title, as far as they are here."""
    for title, draw in PROCEDURAL.items():
        if chosen(title, words):
            yield Truth(title, draw((EDGE,) * 3, 1))
    for title, whole in scans(words):
        if title not in LEFT_OUT:
            shape = [min(n, EDGE) for n in whole.shape]
            yield Truth(title, poresynth.crop(whole, (0, 0, 0), shape))


def _nearest(curves: npt.NDArray[np.float64], middle: npt.NDArray[np.float64]) -> tuple[int, float]:
    """Return which curve is nearest to another from r = 1 on, and how far it is."""
    distances = np.linalg.norm((curves - middle)[:, 1:], axis=1)
    return int(distances.argmin()), float(distances.min())
