"""How far the structure of volumes is from that of their exemplar, in one number."""

from __future__ import annotations

import itertools
import math
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from poresynth.errors import ParameterError
from poresynth.metrics.arguments import PhaseLike, as_phase, whole_number
from poresynth.metrics.connectivity import FLOATING, component_sizes, largest_share
from poresynth.metrics.parts import remove_small_parts
from poresynth.metrics.skeleton import end_points, skeletonize
from poresynth.metrics.surface import surface_area
from poresynth.metrics.thickness import thickness
from poresynth.metrics.topology import euler_number

__all__ = ["StructureDifference", "StructureError", "structure_error"]

_Phase = npt.NDArray[np.bool_]

MOST_WINDOWS = 27
"""Windows of one volume: three along each axis."""

MARGIN = 3
"""Voxels at the faces of a window in which end points do not count. A wider margin would leave too
little of the window to count in."""


@dataclass(frozen=True)
class StructureDifference:
    """One quantity, as a mean over windows.

    Attributes
    ----------
    exemplar, volume : float
        The two means.
    error_percent : float
        100 · (volume − exemplar) / |exemplar|; NaN where the exemplar has 0.
    noise_percent : float
        Standard error of that difference, from the windows' spread: an error below twice the noise
        is no finding. NaN with less than two windows.
    """

    exemplar: float
    volume: float
    error_percent: float
    noise_percent: float


@dataclass(frozen=True)
class StructureError:
    """What `structure_error` found.

    Attributes
    ----------
    percent : float
        Mean over the quantities of |error_percent|, each at most 100.
    differences : dict of str to StructureDifference
        ``largest_solid`` and ``largest_pore`` (shares of the phase in its largest part),
        ``euler_density`` (per 10⁶ voxels) and ``end_point_density`` (per 10³ voxels) of the solid
        without floating parts, ``tb_th``, ``tb_sp`` (voxels) and ``surface_density`` (1/voxel).
    window : int
        Edge of the windows, voxels.
    windows : (int, int)
        How many of the exemplar and of the volumes were measured.
    """

    percent: float
    differences: dict[str, StructureDifference]
    window: int
    windows: tuple[int, int]


def structure_error(
    exemplar: PhaseLike,
    volumes: PhaseLike | Sequence[PhaseLike],
    *,
    window: int | None = None,
    threads: int = 0,
    progress: Callable[[str, float], object] | None = None,
) -> StructureError:
    """Compare the structure of volumes with that of their exemplar.

    Porosity and two-point correlation do not tell a good volume from a poor one; connectivity, dead
    ends, thickness and surface do. A copy of the exemplar has no error: rank by this number at
    equal `novelty`.

    Parameters
    ----------
    exemplar : Volume or array_like
        The solid, shape (z, y, x): bool, or at most 16 values of which 0 is not solid.
    volumes : Volume, array_like, or a list of them
        The solid of one or more volumes of the material. Several, such as one a seed, are pooled:
        one alone often differs by the noise of its sampling.
    window : int, optional
        Edge of the cubic windows in which everything is measured, for border effects depend on the
        size. Default: half of the exemplar's smallest edge, less where a volume is smaller.
    threads : int, default 0
        Number of threads; 0 takes all cores.
    progress : callable, optional
        Called with what is being done and the share of the whole that is done.

    Returns
    -------
    StructureError

    Raises
    ------
    ParameterError
        If a parameter is outside its range.

    Notes
    -----
    Up to 27 windows of each volume lie on a regular grid. The solid is 26-connected, the pore
    6-connected; the skeleton is thinned with ``method="lee"``, the surface is that of the marching
    cubes, thicknesses are exact local ones. Peak memory: 18 bytes a voxel of a
    window and thread.
    """
    own = as_phase(exemplar, "exemplar")
    given: Sequence[Any] = volumes if isinstance(volumes, (list, tuple)) else [volumes]
    others = [as_phase(volume, "volumes") for volume in given]
    if not others:
        raise ParameterError("volumes", given, "must hold at least one volume")
    largest = min(min(phase.shape) for phase in (own, *others))
    edge = min(min(own.shape) // 2, largest) if window is None else window
    edge = whole_number("window", edge, 2 * MARGIN + 1)
    if edge > largest:
        raise ParameterError("window", edge, f"must be at most {largest}, the smallest edge")
    cut = [list(_windows(phase, edge)) for phase in (own, *others)]
    tell = progress or (lambda stage, share: None)
    parts = [part for windows in cut for part in windows]
    measured: list[dict[str, float]] = []
    # Windows are small: a thread each is faster than all threads on one.
    with ThreadPoolExecutor(threads or os.cpu_count()) as pool:
        try:
            for found in pool.map(_measure, parts):
                measured.append(found)
                tell("comparing windows", len(measured) / len(parts))
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    sides = measured[: len(cut[0])], measured[len(cut[0]) :]
    differences = {
        name: _difference(*([found[name] for found in side] for side in sides))
        for name in measured[0]
    }
    errors = [abs(d.error_percent) for d in differences.values()]
    known = [min(100.0, error) for error in errors if math.isfinite(error)]
    return StructureError(
        percent=float(np.mean(known)) if known else float("nan"),
        differences=differences,
        window=edge,
        windows=(len(sides[0]), len(sides[1])),
    )


def _windows(phase: _Phase, edge: int) -> Iterator[_Phase]:
    """Cut windows on a regular grid, as many as fit side by side along each axis."""
    starts = [np.linspace(0, n - edge, max(1, n // edge)).astype(int) for n in phase.shape]
    corners = list(itertools.product(*starts))
    count = min(len(corners), MOST_WINDOWS)
    for i in np.linspace(0, len(corners) - 1, count).astype(int):
        yield phase[tuple(slice(start, start + edge) for start in corners[i])]


def _measure(solid: _Phase) -> dict[str, float]:
    pore = ~solid
    firm = remove_small_parts(solid, FLOATING, threads=1)
    skeleton = skeletonize(firm, method="lee", threads=1)
    tips = end_points(firm, skeleton=skeleton, margin=MARGIN, threads=1)
    surface = surface_area(solid, method="marching_cubes", threads=1)
    return {
        "largest_solid": largest_share(component_sizes(solid, threads=1)),
        "largest_pore": largest_share(component_sizes(pore, connectivity=6, threads=1)),
        "euler_density": 1e6 * euler_number(firm, threads=1) / firm.size,
        "end_point_density": 1e3 * tips.per_voxel,
        "tb_th": thickness(solid, threads=1).mean,
        "tb_sp": thickness(pore, threads=1).mean,
        "surface_density": surface.area / solid.size,
    }


def _difference(exemplar: list[float], volume: list[float]) -> StructureDifference:
    own, new = (np.array(side)[np.isfinite(side)] for side in (exemplar, volume))
    if not (len(own) and len(new)):
        return StructureDifference(*[float("nan")] * 4)
    mean, other = float(own.mean()), float(new.mean())
    scale = 100 / abs(mean) if mean else float("nan")
    noise = float("nan")
    if min(len(own), len(new)) > 1:
        noise = float(np.sqrt(own.var(ddof=1) / len(own) + new.var(ddof=1) / len(new)))
    return StructureDifference(mean, other, (other - mean) * scale, noise * scale)
