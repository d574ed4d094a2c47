"""Thickening a solid to a least strut thickness (zhang_2017 §5.4, Fig. 13)."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from poresynth.errors import ParameterError
from poresynth.fabrication.fields import Field, keep_firm
from poresynth.metrics import component_sizes, distance_transform, local_thickness

__all__ = ["Thickening", "Weakness", "thicken", "weakness"]

Progress = Callable[[str, float], object]

# To the 26 neighbours; the opposite of each is as far from the end.
_DIRECTIONS = np.array([d for d in itertools.product((-1, 0, 1), repeat=3) if any(d)])

SLOPE = 0.5
"""On the ridge of a strut or a wall the depth grows by less per length, in every direction.

From an edge of 90° inwards it grows by 0.71, from a corner of a cube by 0.58, off a ridge by 1."""

STEPS = (1, 2)
"""Voxels over which the depth is watched: one alone is noisy on slanted surfaces."""

CORNER = 3**0.5 - 1
"""How far the corner of a cube is from the largest ball in it, in radii of that ball.

What is no farther from a thick part, and a voxel, is an edge of it or a bump on it."""

SMOOTHING = 1.0
"""Standard deviation in voxels of the smoothing around the places that are thickened."""

ROOM = 0.6
"""Voxels by which a ball is larger in radius than half of the least thickness.

A ball of voxels measures up to a voxel less across than it is; the tenth keeps the many voxels that
are a whole number away from the middle off the surface."""

ROUNDS = 8
"""Struts that come to touch by a thickening may leave a thin place between them: of 180 random
volumes 46 had one after three rounds, 6 after five, none after eight."""


@dataclass(frozen=True, eq=False)
class Weakness:
    """Where a solid is thinner than a least thickness.

    Attributes
    ----------
    middles : numpy.ndarray of bool
        The middles of struts, walls and necks that are too thin, shape (z, y, x).
    places : int
        How many there are, near ones counted as one.
    thin_percent : float
        Share of the solid whose local thickness is below the minimum; the sharp edges of thick
        parts are in it, since no large ball reaches into them.
    thickness : float
        Mean local thickness of the solid.
    """

    middles: npt.NDArray[np.bool_]
    places: int
    thin_percent: float
    thickness: float


@dataclass(frozen=True)
class Thickening:
    """What a thickening did; lengths in ``unit``.

    Attributes
    ----------
    minimum : float
        Least thickness that was asked for.
    weak_places_before, weak_places_after : int
        Struts, walls and necks that are thinner.
    thin_percent_before, thin_percent_after : float
        Share of the solid whose local thickness is below the minimum, sharp edges included.
    thickness_before, thickness_after : float
        Mean local thickness of the solid.
    voxels_added : int
        Voxels by which the solid has grown.
    unit : str
        Unit of length.
    """

    minimum: float
    weak_places_before: int
    weak_places_after: int
    thin_percent_before: float
    thin_percent_after: float
    thickness_before: float
    thickness_after: float
    voxels_added: int
    unit: str


def thicken(
    field: Field,
    minimum: float,
    *,
    voxel_size: tuple[float, float, float] = (1.0, 1.0, 1.0),
    unit: str = "voxel",
    domain: npt.NDArray[np.bool_] | None = None,
    threads: int = 0,
    progress: Progress | None = None,
) -> tuple[Field, Thickening]:
    """Thicken a solid where it is thinner than a printer can make it.

    Parameters
    ----------
    field : numpy.ndarray of float32
        The solid, positive inside, shape (z, y, x).
    minimum : float
        Least thickness, in ``unit``; at least two voxels.
    voxel_size : (float, float, float), default (1.0, 1.0, 1.0)
        Edges of a voxel along (z, y, x), in ``unit``.
    unit : str, default "voxel"
        Unit of length.
    domain : numpy.ndarray of bool, optional
        Where the solid may grow, shape (z, y, x); default: everywhere.
    threads : int, default 0
        Number of threads; 0 takes all cores. The result does not depend on it.
    progress : callable, optional
        ``progress(stage, fraction)``; what it raises ends the work.

    Returns
    -------
    field : numpy.ndarray of float32
        The thicker solid.
    thickening : Thickening
        What was done, measured by the local thickness.

    Raises
    ------
    ParameterError
        If the minimum is less than two voxels.

    Notes
    -----
    The two operations of zhang_2017 §5.4, Gaussian smoothing and dilation, where the solid is weak:
    the surface is smoothed around its weak places (`weakness`), and united with balls of the least
    diameter round their middles, which smoothing thus cannot take away. All else keeps its surface.
    The balls are `ROOM` voxels larger. Beyond the border and the domain nothing is known: a strut
    that they cut lengthwise does not count as weak.

    Peak memory: about 40 bytes a voxel.
    """
    coarsest = max(voxel_size)
    if not (np.isfinite(minimum) and minimum >= 2 * coarsest):
        allowed = f"must be at least two voxels, {2 * coarsest:g} {unit}; or take smaller voxels"
        raise ParameterError("min_thickness", minimum, allowed)

    def measure() -> Weakness:
        return weakness(field > 0, minimum, voxel_size=voxel_size, domain=domain, threads=threads)

    was = int(np.count_nonzero(field > 0))
    before = after = measure()
    for i in range(ROUNDS):
        if progress is not None:
            progress("thickness", i / ROUNDS)
        if not after.places:
            break
        field = _grown(field, after.middles, minimum, voxel_size, domain, threads)
        after = measure()
    return field, Thickening(
        minimum=minimum,
        weak_places_before=before.places,
        weak_places_after=after.places,
        thin_percent_before=before.thin_percent,
        thin_percent_after=after.thin_percent,
        thickness_before=before.thickness,
        thickness_after=after.thickness,
        voxels_added=int(np.count_nonzero(field > 0)) - was,
        unit=unit,
    )


def weakness(
    solid: npt.NDArray[np.bool_],
    minimum: float,
    *,
    voxel_size: tuple[float, float, float] = (1.0, 1.0, 1.0),
    domain: npt.NDArray[np.bool_] | None = None,
    threads: int = 0,
) -> Weakness:
    """Find where a solid is thinner than a least thickness.

    Parameters
    ----------
    solid : numpy.ndarray of bool
        Shape (z, y, x).
    minimum : float
        The least thickness, in the unit of the voxel size.
    voxel_size : (float, float, float), default (1.0, 1.0, 1.0)
        Edges of a voxel along (z, y, x).
    domain : numpy.ndarray of bool, optional
        What is known, shape (z, y, x): struts go on outside, as beyond the border.
    threads : int, default 0
        Number of threads; 0 takes all cores. The result does not depend on it.

    Returns
    -------
    Weakness
        Its thickness and share of thin voxels are those of the solid alone, with air outside.

    Notes
    -----
    A voxel is thin where the local thickness is below the minimum: no ball of that diameter inside
    the solid reaches it. That alone holds for the edges and corners of every thick part, too. So a
    thin voxel counts as the middle of a weak place only if its own ball is about as large as its
    local thickness, and either it is farther from the thick parts than their corners reach, on a
    ridge of the depth, or thick parts are on two opposite sides of it: a neck. (A waist between two
    balls that overlap is not thin in this measure, since a large ball reaches it.)

    Peak memory: about 25 bytes a voxel.
    """
    thickness = local_thickness(solid, voxel_size=voxel_size, threads=threads)
    # Rounding must not make a strut of just the least thickness thin.
    thin = solid & (thickness < minimum * (1 - 1e-5))
    inside = max(int(np.count_nonzero(solid)), 1)
    percent = 100 * int(np.count_nonzero(thin)) / inside
    mean = float(np.mean(thickness, where=solid, dtype=float)) if solid.any() else float("nan")
    body = solid
    if domain is not None:
        # Just so far that no strut is thin for what lies beyond: wide balls take long.
        away = distance_transform(~domain, voxel_size=voxel_size, cap=2 * minimum, threads=threads)
        body = solid | (~domain & (away <= 1.5 * minimum))
        del away
        thickness = local_thickness(body, voxel_size=voxel_size, threads=threads)
        thin &= thickness < minimum * (1 - 1e-5)
    middles = _middles(body, thin, thickness, minimum, voxel_size, threads)
    del thickness
    places = 0
    if middles.any():
        reach = distance_transform(~middles, voxel_size=voxel_size, cap=minimum, threads=threads)
        places = len(component_sizes(reach <= minimum / 2, threads=threads))
    return Weakness(middles, places, percent, mean)


def _middles(
    solid: npt.NDArray[np.bool_],
    thin: npt.NDArray[np.bool_],
    thickness: npt.NDArray[np.float32],
    minimum: float,
    voxel_size: tuple[float, float, float],
    threads: int,
) -> npt.NDArray[np.bool_]:
    """Return the thin voxels in the middle of struts, walls and necks; see `weakness`."""
    edge = max(voxel_size)
    depth = distance_transform(solid, voxel_size=voxel_size, cap=minimum, threads=threads)
    # A ball of another place may be larger by what the middle is off the centre of a voxel.
    central = thin & (2 * depth >= np.minimum(thickness - 0.75 * edge, 0.8 * (thickness + edge)))
    thick = solid & ~thin
    corner = CORNER * minimum / 2 + edge
    away = distance_transform(~thick, voxel_size=voxel_size, cap=2 * corner, threads=threads)
    far, near = (
        np.flatnonzero(central & (away > corner)),
        np.flatnonzero(central & (away <= corner)),
    )
    del away, central
    reach = int(np.ceil(corner / min(voxel_size))) + 1
    middles = np.zeros(solid.shape, dtype=bool)
    middles.reshape(-1)[far[_is_ridge(depth, far, voxel_size)]] = True
    middles.reshape(-1)[near[_is_between(thick, near, solid, reach)]] = True
    return middles


def _is_ridge(
    depth: npt.NDArray[np.float32], voxel: npt.NDArray[np.int64], size: tuple[float, float, float]
) -> npt.NDArray[np.bool_]:
    """Return from which voxels the depth grows slowly in every direction."""
    ridge = np.ones(len(voxel), dtype=bool)
    own = depth.ravel()[voxel]
    for direction in _DIRECTIONS:
        for step in STEPS:
            there = step * direction
            growth = _values(depth, voxel, there, mode="nearest") - own
            ridge &= growth < SLOPE * float(np.linalg.norm(there * size))
    return ridge


def _is_between(
    thick: npt.NDArray[np.bool_],
    voxel: npt.NDArray[np.int64],
    solid: npt.NDArray[np.bool_],
    reach: int,
) -> npt.NDArray[np.bool_]:
    """Return which voxels have a thick part on both sides, reached through the solid."""
    between = np.zeros(len(voxel), dtype=bool)
    for direction in _DIRECTIONS[: len(_DIRECTIONS) // 2]:
        met = []
        for sense in (direction, -direction):
            open_, found = np.ones(len(voxel), dtype=bool), np.zeros(len(voxel), dtype=bool)
            for step in range(1, reach + 1):
                open_ &= _values(solid, voxel, step * sense, mode="outside")
                found |= open_ & _values(thick, voxel, step * sense, mode="outside")
            met.append(found)
        between |= met[0] & met[1]
    return between


def _values(
    array: npt.NDArray[Any], voxel: npt.NDArray[np.int64], step: npt.NDArray[np.int64], mode: str
) -> npt.NDArray[Any]:
    """Return an array's values beside voxels; beyond the border the nearest, or 0."""
    place = np.stack(np.unravel_index(voxel, array.shape)) + step[:, None]
    last = np.array(array.shape)[:, None] - 1
    inner = np.clip(place, 0, last)
    values: npt.NDArray[Any] = array[tuple(inner)]
    if mode == "outside":
        values[(inner != place).any(axis=0)] = 0
    return values


def _grown(
    field: Field,
    middles: npt.NDArray[np.bool_],
    minimum: float,
    voxel_size: tuple[float, float, float],
    domain: npt.NDArray[np.bool_] | None,
    threads: int,
) -> Field:
    """Return the solid smoothed near the middles, and united with balls around them."""
    from scipy import ndimage

    coarsest = max(voxel_size)
    radius = minimum / 2 + ROOM * coarsest
    away = distance_transform(
        ~middles, voxel_size=voxel_size, cap=radius + 2 * coarsest, threads=threads
    )
    near = away < radius + coarsest
    grown = ndimage.gaussian_filter(field, SMOOTHING, mode="nearest", truncate=3)
    # The balls as a field, with the slope of a smoothed surface.
    away -= np.float32(radius)
    away /= np.float32(-2 * coarsest)
    np.maximum(grown, away, out=grown)
    np.maximum(grown, field, out=grown)
    keep_firm(grown, grown > 0)
    if domain is not None:
        near &= domain
    return np.where(near, grown, field)
