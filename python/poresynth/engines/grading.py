"""Porosity that differs from place to place: the surface moves by a smooth field of levels.

Volumes are gone through cell by cell, and depths are kept only of the voxels that may change, so
that it is these that memory goes with.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from poresynth import _core
from poresynth.engines.cells import Box, cells, grown, seen_from
from poresynth.engines.interpolation import places
from poresynth.engines.phases import Phases
from poresynth.engines.porosity import PorosityMap
from poresynth.engines.request import Request
from poresynth.errors import ParameterError
from poresynth.pruning.gray import DEPTHS, repaint

__all__ = ["Graded", "feature_size", "follow_map", "grade"]

_Floats = npt.NDArray[np.float64]
_Singles = npt.NDArray[np.float32]
_Bools = npt.NDArray[np.bool_]

EDGE = 128
"""Longest edge of a cell, voxels."""
HALO = 32
"""Voxels that a cell sees beyond itself: struts are thinner than that."""
ROUNDS = 12
"""Newton steps of the levels; errors halve or better in each, and 12 reach the noise of voxels."""
BLOCK = 1.0
"""Distance of the nodes of the level field, in feature sizes. In smooth noise that was to keep its
porosity, 17, 11, 7 and 5 % of the voxels changed with 0.5, 0.75, 1 and 1.5, and windows of two
feature sizes missed a gradient beside it by 0.7, 0.9, 1.3 and 1.6 % porosity."""
LONGEST = 2.0
"""Most that a level moves in a step, voxels: surfaces meet, and the slope is then another."""
WINDOW = 4
"""Edge of the windows in which porosity is compared, in blocks that are summed: three feature
sizes, and neighbouring windows are a block apart."""
REACHED = 0.03
"""Mean error of the local porosity above which a map is refused as impossible."""
EVEN = 2.0
"""Blur of the struts' thickness, voxels: it changes in steps where a strut meets a node."""
NEAR, FAR = 2.0, 4.0
"""Depths, voxels, between which the score hands over to the exact distance: nearer it knows the
surface between the voxels, further it may be clipped."""
SOFT = 0.7
"""Blur of a solid that stands for a score, voxels. 1.0 and 1.5 smooth the surface of bone by 4 and
10 % of its area, and join what lay near."""


@dataclass(frozen=True, eq=False)
class Graded:
    """A solid whose porosity follows a map.

    Attributes
    ----------
    solid : numpy.ndarray of bool
        Shape (z, y, x).
    window : int
        Edge of the windows, voxels, in which the porosity is compared: three feature sizes.
    error : float
        Mean absolute error of the porosity of the windows, a fraction.
    """

    solid: _Bools
    window: int
    error: float

    def provenance(self) -> dict[str, Any]:
        """Return what a result says of its grading."""
        return {"window": self.window, "mean_absolute_error_percent": 100 * self.error}


def follow_map(
    array: npt.NDArray[Any], phases: Phases, request: Request, score: _Singles | None = None
) -> Graded:
    """Make the porosity of a volume follow the map that was asked for, in place.

    Parameters
    ----------
    array : numpy.ndarray
        A volume of the exemplar's porosity, shape (z, y, x[, channel]). Voxels that change keep
        their rank among the values of their depth.
    phases : Phases
        The exemplar's.
    request : Request
        What was asked for, with a map.
    score : numpy.ndarray of float32, optional
        What the phase was cut from, shape (z, y, x), high in the solid; see `grade`.

    Returns
    -------
    Graded
        The solid, and how well it follows.

    Raises
    ------
    ParameterError
        If there are more than two phases, or the map is out of reach.
    """
    if len(phases.labels) > 2:
        what = "a map"
        raise ParameterError("porosity", what, "must be a number for more than two phases")
    assert request.porosity_map is not None
    before, free = phases.phase_of(array) > 0, request.free
    graded = grade(
        before,
        request.porosity_map,
        feature_size(phases.phase > 0),
        free=free,
        domain=request.domain,
        seed=request.seed,
        score=score,
    )
    for channel in np.moveaxis(array, -1, 0) if array.ndim == 4 else [array]:
        for cell in cells(before.shape, EDGE):
            # Values of voxels that keep their depth lead those that move: these never change.
            box = grown(cell, before.shape, DEPTHS + 1)
            painted = repaint(
                channel[box],
                before[box],
                graded.solid[box],
                gray=phases.kind == "gray",
                keep=None if free is None else ~free[box],
            )
            channel[cell] = painted[seen_from(cell, box)]
    return graded


def feature_size(solid: _Bools) -> float:
    """Return the mean length of a solid and a pore intercept together, voxels.

    Parameters
    ----------
    solid : numpy.ndarray of bool
        Shape (z, y, x).
    """
    changes, steps = 0, 0
    for axis in range(3):
        along = np.moveaxis(solid, axis, 0)
        changes += int(np.count_nonzero(along[1:] != along[:-1]))
        steps += along[1:].size
    return 2 * steps / max(changes, 1)


def grade(
    solid: _Bools,
    porosity: PorosityMap,
    feature: float,
    *,
    seed: int,
    free: _Bools | None = None,
    domain: _Bools | None = None,
    score: _Singles | None = None,
) -> Graded:
    """Move the surface of a solid until its local porosity follows a map.

    Parameters
    ----------
    solid : numpy.ndarray of bool
        The solid of the exemplar's porosity, shape (z, y, x).
    porosity : PorosityMap
        Wanted porosity at each voxel, of the same shape.
    feature : float
        Feature size, voxels; see `feature_size`.
    seed : int
        Decides between voxels of one depth.
    free : numpy.ndarray of bool, optional
        Voxels that may change, all by default; only they count.
    domain : numpy.ndarray of bool, optional
        Voxels that are neither solid nor pore are not in it; all are by default.
    score : numpy.ndarray of float32, optional
        What the solid was cut from, same shape: it knows where the surface lies between voxels.
        By default the blurred solid.

    Returns
    -------
    Graded

    Raises
    ------
    ParameterError
        If the map cannot be reached: the mean error of the windows stays above 3 %.

    Notes
    -----
    The surface becomes the level set of the depth below it, in the solid relative to the thickness
    of the strut, so that thin struts do not break before thick ones. The levels are those of nodes
    a feature size apart, linear between them, so that no band shows, and each is moved by
    Newton's method until the porosity round its node is the wanted one. The number of solid voxels
    in all is exact.

    Peak memory: 1 byte a voxel, and the larger of 16 bytes a voxel that may change, and 4 of these
    with 50 bytes a voxel of a cell and its surroundings, 350 MB.
    """
    parts = _parts(solid, free, domain, score)
    windows = _Windows.over(solid.shape, max(round(3 * feature / WINDOW), 1))
    if not parts:
        return Graded(solid.copy(), windows.edge, 0.0)
    nodes = _Nodes.over(solid.shape, round(BLOCK * feature))
    inside, wanted = np.zeros(nodes.shape), np.zeros(nodes.shape)
    voxels = 0.0
    for part in parts:
        share = (1 - porosity.at(part.box)) * part.free
        inside += nodes.around(part.free, part.box)
        wanted += nodes.around(share, part.box)
        voxels += float(share.sum(dtype=np.float64))
    inside = np.maximum(inside, 1e-6)
    levels = np.zeros(nodes.shape)
    for _ in range(ROUNDS):
        above, near = np.zeros(nodes.shape), np.zeros(nodes.shape)
        for part in parts:
            height = part.above(nodes, levels)
            above += nodes.around(part.spread(height > 0), part.box)
            # Voxels that a move of the level by one would change.
            near += nodes.around(part.spread(np.abs(height) <= 1), part.box)
        step = (above - wanted) / np.maximum(near / 2, 0.01 * inside)
        levels += np.clip(step, -LONGEST, LONGEST)
    heights = np.concatenate([part.above(nodes, levels) for part in parts])
    chosen = _core.cut_solid(heights, round(voxels), seed=seed, free=None)
    graded = solid.copy()
    for part in parts:
        own, chosen = chosen[: len(part.depth)], chosen[len(part.depth) :]
        graded[part.box][part.free] = own
        missed = part.spread(~own) - porosity.at(part.box) * part.free
        windows.add(part.box, missed, part.free)
    error = windows.error()
    if error > REACHED:
        raise ParameterError(
            "porosity",
            "a map from {lowest:.3g} to {highest:.3g}".format(**porosity.figures),
            f"is out of reach for this exemplar: windows of {windows.edge} voxels miss it by "
            f"{100 * error:.1f} % on average; take one that varies more slowly or less",
        )
    return Graded(graded, windows.edge, error)


@dataclass(eq=False)
class _Part:
    """The voxels of a cell that may change.

    Attributes
    ----------
    box : tuple of slice
        The cell.
    free : numpy.ndarray of bool
        Where they are in it.
    depth : numpy.ndarray of float32
        How far below the surface each of them lies.
    """

    box: Box
    free: _Bools
    depth: _Singles

    def spread(self, values: npt.NDArray[Any]) -> _Singles:
        """Put values of these voxels where they lie; 0 is elsewhere."""
        spread = np.zeros(self.free.shape, np.float32)
        spread[self.free] = values
        return spread

    def above(self, nodes: _Nodes, levels: _Floats) -> _Singles:
        """Return how far below the surface they lie if it is moved."""
        found: _Singles = self.depth - nodes.spread(levels, self.box)[self.free]
        return found


def _parts(
    solid: _Bools, free: _Bools | None, domain: _Bools | None, score: _Singles | None
) -> list[_Part]:
    """Return the cells that have voxels which may change, with the depths of these."""
    near = _by_solid(solid, domain) if score is None else _by_score(score, solid)
    parts, radii, voxels = [], 0.0, 0
    for cell in cells(solid.shape, EDGE):
        own = np.ones(solid[cell].shape, bool) if free is None else free[cell]
        if not own.any():
            continue
        box = grown(cell, solid.shape, HALO)
        within = seen_from(cell, box)
        valid = None if domain is None else domain[box]
        far = _core.signed_distance(solid[box], HALO + EDGE, boundary="open", valid=valid)
        weight = np.clip((np.abs(far) - NEAR) / (FAR - NEAR), 0, 1)
        depth = weight * far + (1 - weight) * np.clip(near(box), -FAR, FAR)
        radius = _core.local_thickness(solid[box], (1.0, 1.0, 1.0), boundary="open") / 2
        around = _mean_around(radius, solid[box], EVEN)
        depth = np.where(depth > 0, depth / np.maximum(around, 1), depth)
        parts.append(_Part(cell, own, depth[within][own].astype(np.float32)))
        radii += float(radius[within].sum(dtype=np.float64))
        voxels += int(np.count_nonzero(solid[cell]))
    for part in parts:
        part.depth[part.depth > 0] *= radii / max(voxels, 1)
    return parts


def _by_score(score: _Singles, solid: _Bools) -> Callable[[Box], _Singles]:
    """Return what gives the depth near the surface from what the solid was cut from."""
    shell = np.abs(_core.signed_distance(solid, 1, boundary="open")) < 1
    inner, outer = score[shell & solid], score[shell & ~solid]
    known = bool(len(inner) and len(outer))
    cut = float(inner.mean() + outer.mean()) / 2 if known else 0.0
    # One voxel apart, so that their difference is the slope at the surface.
    slope = max(float(inner.mean() - outer.mean()), 1e-6) if known else 1.0
    return lambda box: (score[box] - cut) / slope


def _by_solid(solid: _Bools, domain: _Bools | None) -> Callable[[Box], _Singles]:
    """Return what gives the depth near the surface from the solid alone."""
    slope = math.erf(0.5 / (SOFT * math.sqrt(2)))

    def near(box: Box) -> _Singles:
        blurred = _mean_around(solid[box], None if domain is None else domain[box], SOFT)
        return np.asarray((blurred - 0.5) / slope, np.float32)

    return near


def _mean_around(values: npt.NDArray[Any], where: _Bools | None, sigma: float) -> _Singles:
    """Blur values, as if there were none but where they count."""
    if where is None:
        blurred = ndimage.gaussian_filter(values.astype(np.float32), sigma)
    else:
        share = ndimage.gaussian_filter(where.astype(np.float32), sigma)
        blurred = ndimage.gaussian_filter(np.where(where, values, 0).astype(np.float32), sigma)
        blurred /= np.maximum(share, 1e-3)
    return np.asarray(blurred, np.float32)


@dataclass(frozen=True, eq=False)
class _Nodes:
    """Nodes of a coarse grid, in the middle of blocks, and how voxels lie between them."""

    edges: tuple[int, ...]
    weights: tuple[_Floats, ...]

    @classmethod
    def over(cls, shape: tuple[int, ...], block: int) -> _Nodes:
        edges = tuple(max(round(n / max(block, 1)), 1) for n in shape)
        return cls(edges, tuple(_weights(n, m) for n, m in zip(shape, edges, strict=True)))

    @property
    def shape(self) -> tuple[int, ...]:
        return self.edges

    def spread(self, values: _Floats, box: Box) -> _Singles:
        """Interpolate values of the nodes at the voxels of a box."""
        z, y, x = self._within(box)
        found = np.tensordot(z, np.tensordot(values, y, (1, 1)), (1, 0))
        return np.asarray(np.tensordot(found, x, (1, 1)), np.float32)

    def around(self, values: npt.NDArray[Any], box: Box) -> _Floats:
        """Sum values of the voxels of a box round each node, by their weights."""
        z, y, x = self._within(box)
        rows = np.tensordot(values.astype(np.float32), x.astype(np.float32), (2, 0))
        sums = np.tensordot(np.tensordot(rows, y, (1, 0)), z, (0, 0))
        return np.asarray(sums.transpose(2, 1, 0), np.float64)

    def _within(self, box: Box) -> list[_Floats]:
        return [weights[part] for weights, part in zip(self.weights, box, strict=True)]


def _weights(n: int, nodes: int) -> _Floats:
    """Return the weights of linear interpolation from nodes to voxels, shape (n, nodes)."""
    low, part = places(n, nodes)
    weights = np.zeros((n, nodes))
    weights[np.arange(n), low] = 1 - part
    if nodes > 1:
        weights[np.arange(n), low + 1] = part
    return weights


@dataclass(frozen=True, eq=False)
class _Windows:
    """Sums over the blocks that windows are made of: of what is missed, and of what counts."""

    block: int
    missed: _Floats
    count: _Floats

    @classmethod
    def over(cls, shape: tuple[int, ...], block: int) -> _Windows:
        blocks = [-(-n // block) for n in shape]
        return cls(block, np.zeros(blocks), np.zeros(blocks))

    @property
    def edge(self) -> int:
        return WINDOW * self.block

    def add(self, box: Box, missed: npt.NDArray[Any], count: npt.NDArray[Any]) -> None:
        """Add the voxels of a box."""
        at = tuple(slice(s.start // self.block, -(-s.stop // self.block)) for s in box)
        for sums, values in ((self.missed, missed), (self.count, count)):
            found = values.astype(np.float64)
            for axis, part in enumerate(box):
                inner = np.arange(part.start - part.start % self.block, part.stop, self.block)
                found = np.add.reduceat(found, np.maximum(inner - part.start, 0), axis=axis)
            sums[at] += found

    def error(self) -> float:
        """Return the mean absolute error of the porosity over windows at least half inside."""
        missed, count = self.missed, self.count
        whole = 1
        for axis in range(3):
            length = min(WINDOW, missed.shape[axis])
            whole *= length * self.block
            missed, count = (
                np.lib.stride_tricks.sliding_window_view(sums, length, axis).sum(-1)
                for sums in (missed, count)
            )
        full = count >= whole / 2
        return float(np.abs(missed[full] / count[full]).mean()) if full.any() else 0.0
