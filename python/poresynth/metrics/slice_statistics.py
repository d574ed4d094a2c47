"""What binary slices are like, and how far the slices of a volume are from images."""

from __future__ import annotations

import itertools
import math
import os
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from poresynth import _core
from poresynth.errors import ParameterError
from poresynth.metrics.arguments import PhaseLike, as_phase, whole_number
from poresynth.metrics.correlation import R_MAX, relative_error
from poresynth.metrics.registry import finite_mean
from poresynth.metrics.sections import Images, as_images, sections
from poresynth.metrics.transport import Axis

__all__ = [
    "SLICE_FIGURES",
    "SliceScore",
    "SliceStatistics",
    "mean_error",
    "mean_statistics",
    "percent_error",
    "slice_score",
    "slice_statistics",
    "window_boxes",
    "window_statistics",
]

_Phase = npt.NDArray[np.bool_]
_Curve = npt.NDArray[np.float64]

MOST_WINDOWS = 32
"""Windows of a stack that are measured, evenly spaced over slices and places. The figures of so
many slices of blobs of 128³ voxels are within 4 % of those of all slices, all but the counts within
0.5 %; those of half as many are within 9 % and 2 %."""

MARGIN = 3
"""Pixels at the border of a window in which tips do not count, as in `structure_error`."""

AREA = 10_000
"""Pixels that counts are given for: a slice of 100²."""

SLICE_FIGURES = (
    "solid_fraction",
    "components",
    "holes",
    "tips",
    "perimeter",
    "thickness",
    "spacing",
)
"""The single figures of `SliceStatistics`."""

COUNTS = ("components", "holes", "tips")
"""Those that count something."""

# Percent. An error may be infinite: that of the width of pores, where there is none left.
_MOST = 100.0


@dataclass(frozen=True, eq=False)
class SliceStatistics:
    """Figures of binary slices, means over windows of one size.

    Attributes
    ----------
    solid_fraction : float
        Share of solid pixels.
    components : float
        8-connected parts of the solid per 10⁴ pixels.
    holes : float
        4-connected parts of the pore that do not touch the border of the window, per 10⁴ pixels.
    tips : float
        End points of the solid's skeleton per 10⁴ pixels, without those near the border.
    perimeter : float
        Length of the border between solid and pore per area, 1/pixel.
    thickness, spacing : float
        Mean local thickness of the solid and of the pore in the plane, pixels: diameters of discs.
        NaN where no window holds both phases.
    two_point : numpy.ndarray
        Two-point correlation S₂ of the solid in the plane, for r = 0, 1, … pixels, at most 50 and
        half of the window's smaller edge; shape (r_max + 1,).
    window : (int, int)
        Shape of the windows, pixels.
    windows : int
        How many were measured.
    """

    solid_fraction: float
    components: float
    holes: float
    tips: float
    perimeter: float
    thickness: float
    spacing: float
    two_point: _Curve
    window: tuple[int, int]
    windows: int

    def least(self, name: str) -> float:
        """Return the least of a figure that can be seen: of a count, one in all windows."""
        return AREA / (self.windows * math.prod(self.window)) if name in COUNTS else 0.0

    def errors(self, other: SliceStatistics) -> dict[str, float]:
        """Return how far other slices are from these.

        Parameters
        ----------
        other : SliceStatistics
            Of windows of the same size: holes and thickness depend on it.

        Returns
        -------
        dict of str to float
            Percent: 100 · (other − own) / own for each of `SLICE_FIGURES`, of counts relative to at
            least one in all of the own windows; for ``two_point`` the relative L2 error from r = 1
            on. NaN where the own figure is not defined, infinite where the other's is not.
        """
        found = {
            name: percent_error(getattr(self, name), getattr(other, name), self.least(name))
            for name in SLICE_FIGURES
        }
        return {**found, "two_point": relative_error(other.two_point, self.two_point)}


@dataclass(frozen=True, eq=False)
class SliceScore:
    """What `slice_score` found.

    Attributes
    ----------
    percent : float
        Mean over the axes and the figures of |error|, each at most 100.
    errors : dict of str to dict of str to float
        By axis: `SliceStatistics.errors` of the volume's slices against the image.
    images, slices : dict of str to SliceStatistics
        By axis: the figures behind the errors.
    """

    percent: float
    errors: dict[Axis, dict[str, float]]
    images: dict[Axis, SliceStatistics]
    slices: dict[Axis, SliceStatistics]


def slice_statistics(
    stack: PhaseLike, *, window: int | None = None, threads: int = 0
) -> SliceStatistics:
    """Measure binary slices in their planes.

    Parameters
    ----------
    stack : Volume or array_like
        The solid, shape (slice, row, column): bool, or at most 16 values of which 0 is not solid;
        (1, y, x) for an image. Pixels are taken for squares.
    window : int, optional
        Edge of the square windows in which everything is measured. Parts, holes and widths depend
        on how much is seen: slices and images of several sizes are comparable in windows of one
        size only. Default: whole slices.
    threads : int, default 0
        Number of threads; 0 takes all cores. The figures do not depend on it.

    Returns
    -------
    SliceStatistics
        Means over at most 32 windows. They cover each slice but for a tenth of a window,
        overlapping where they do not fit side by side; of more than 32, those are measured that are
        evenly spaced over slices, each in the next of its places in turn.

    Raises
    ------
    ParameterError
        If the stack is not a phase, or the window is larger than a slice.

    Notes
    -----
    The perimeter is Crofton's, from the changes of phase along rows, columns and diagonals: within
    1 % for discs of a radius of at least 5 pixels, up to 6 % too small for straight edges along
    one of those. Thickness and skeleton are those of `local_thickness` and `skeletonize` for a
    volume of one slice, which are those of the plane. Peak memory: about 30 bytes a pixel of a
    window and thread.
    """
    return mean_statistics(window_statistics(stack, window=window, threads=threads))


def slice_score(images: Images, volume: PhaseLike, *, threads: int = 0) -> SliceScore:
    """Score how far the slices of a volume are from the images that they shall look like.

    Parameters
    ----------
    images : mapping, or Volume or array_like
        The solid in the image of the planes across an axis, by ``"z"``, ``"y"``, ``"x"``, or some
        of them: shape (1, y, x), bool or at most 16 values of which 0 is not solid. An image alone
        stands for all three axes.
    volume : Volume or array_like
        The solid of the volume, shape (z, y, x).
    threads : int, default 0
        Number of threads; 0 takes all cores. The score does not depend on it.

    Returns
    -------
    SliceScore

    Raises
    ------
    ParameterError
        If there is no image, or something is no phase.

    Notes
    -----
    Everything is measured in square windows of one size: the smallest edge of the images and of the
    slices. Peak memory: as `slice_statistics`.
    """
    solid = as_phase(volume, "volume")
    pictures = as_images(images)
    stacks = {axis: sections(solid, axis) for axis in pictures}
    window = min(edge for v in (*stacks.values(), *pictures.values()) for edge in v.shape[1:])
    own: dict[Axis, SliceStatistics] = {}
    for axis, image in pictures.items():
        # One image may stand for several axes.
        same = (other for other in own if pictures[other] is image)
        known = next(same, None)
        own[axis] = (
            slice_statistics(as_phase(image, f"images.{axis}"), window=window, threads=threads)
            if known is None
            else own[known]
        )
    new = {
        axis: slice_statistics(stack, window=window, threads=threads)
        for axis, stack in stacks.items()
    }
    errors = {axis: own[axis].errors(new[axis]) for axis in pictures}
    percent = mean_error(error for found in errors.values() for error in found.values())
    return SliceScore(percent, errors, own, new)


def window_statistics(
    stack: PhaseLike, *, window: int | None = None, threads: int = 0
) -> list[SliceStatistics]:
    """Measure the windows of binary slices one by one.

    Parameters
    ----------
    stack, window, threads
        As for `slice_statistics`.

    Returns
    -------
    list of SliceStatistics
        One for each window that `slice_statistics` takes the mean over.

    Raises
    ------
    ParameterError
        As for `slice_statistics`.
    """
    array = as_phase(stack, "stack")
    edges = array.shape[1:]
    if window is not None:
        edge = whole_number("window", window, 1)
        if edge > min(edges):
            allowed = f"must be at most {min(edges)}, the smaller edge of a slice"
            raise ParameterError("window", edge, allowed)
        edges = (edge, edge)
    threads = whole_number("threads", threads, 0)
    parts = (np.ascontiguousarray(array[box]) for box in window_boxes(array.shape, edges))
    with ThreadPoolExecutor(threads or os.cpu_count()) as pool:
        return list(pool.map(_measure, parts))


def mean_statistics(windows: Sequence[SliceStatistics]) -> SliceStatistics:
    """Return the means over windows of one size."""
    return SliceStatistics(
        **{name: finite_mean([getattr(w, name) for w in windows]) for name in SLICE_FIGURES},
        two_point=np.mean([w.two_point for w in windows], axis=0),
        window=windows[0].window,
        windows=len(windows),
    )


def percent_error(own: float, new: float, least: float = 0.0) -> float:
    """Return how far a value is from another, in percent of that or of the least that is resolved.

    NaN if the own value is not defined, infinite if only the new one is not.
    """
    if math.isnan(own):
        return float("nan")
    scale = max(abs(own), least)
    if math.isnan(new) or (not scale and new):
        return float("inf")
    return 100 * (new - own) / scale if scale else 0.0


def mean_error(errors: Iterable[float]) -> float:
    """Return the mean of |error| in percent, each at most 100; NaN if none is defined."""
    known = [min(abs(error), _MOST) for error in errors if not math.isnan(error)]
    return float(np.mean(known)) if known else float("nan")


def window_boxes(
    shape: tuple[int, int, int], edges: tuple[int, int]
) -> Iterator[tuple[slice, slice, slice]]:
    """Yield the places of the windows of a stack, each in one slice; see `slice_statistics`."""
    # As many as it takes to see all but a tenth of a window.
    starts = [
        np.linspace(0, n - edge, math.ceil(n / edge - 0.1)).astype(int)
        for n, edge in zip(shape[1:], edges, strict=True)
    ]
    places = list(itertools.product(*starts))
    count = min(shape[0] * len(places), MOST_WINDOWS)
    for k in range(count):
        i = (2 * k + 1) * shape[0] // (2 * count)
        # In turn, so that each place counts alike.
        y, x = places[k % len(places) if len(places) <= count else k * len(places) // count]
        yield slice(i, i + 1), slice(y, y + edges[0]), slice(x, x + edges[1])


def _measure(solid: _Phase) -> SliceStatistics:
    """Measure a window of shape (1, row, column); windows have a thread each."""
    size, cube = solid.size, (1.0, 1.0, 1.0)
    pore, edges = ~solid, solid.shape[1:]
    r_max = min(R_MAX, min(edges) // 2)
    parts = _core.component_sizes(solid, connectivity=26, boundary="open", threads=1)
    _, boxes, *_ = _core.component_statistics(pore, connectivity=6, boundary="open", threads=1)
    inside = (boxes[:, 1:, 0] > 0) & (boxes[:, 1:, 1] < edges)
    _, specific = _core.surface_area(solid, cube, method="crofton", boundary="open", threads=1)
    curves = _core.two_point(solid, r_max, boundary="open", voxel_size=cube, threads=1)
    return SliceStatistics(
        solid_fraction=float(solid.mean()),
        components=AREA * len(parts) / size,
        holes=AREA * int(inside.all(axis=1).sum()) / size,
        tips=AREA * _tips(solid),
        # The surface of what the slice is a section of is 4/π times as much per volume.
        perimeter=math.pi / 4 * specific,
        thickness=_mean_thickness(solid),
        spacing=_mean_thickness(pore),
        two_point=curves[0],
        window=(edges[0], edges[1]),
        windows=1,
    )


def _tips(solid: _Phase) -> float:
    """Return the end points of the skeleton per pixel, away from the border."""
    skeleton = _core.thin(solid, kind="curve", method="strict", threads=1)[0]
    around = np.pad(skeleton, 1).astype(np.uint8)
    rows = around[:-2] + around[1:-1] + around[2:]
    neighbours = rows[:, :-2] + rows[:, 1:-1] + rows[:, 2:] - skeleton
    margin = min(MARGIN, min(skeleton.shape) // 4)
    inner = (slice(margin, -margin or None),) * 2
    return float((skeleton & (neighbours == 1))[inner].mean())


def _mean_thickness(phase: _Phase) -> float:
    if phase.all() or not phase.any():
        return float("nan")
    local = _core.local_thickness(phase, (1.0, 1.0, 1.0), boundary="open", threads=1)
    return float(local[phase].mean(dtype=float))
