"""Porosity that differs from place to place: the surface moves by a smooth field of levels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from poresynth import _core
from poresynth.engines.interpolation import places
from poresynth.engines.phases import Phases
from poresynth.engines.request import Request
from poresynth.errors import ParameterError
from poresynth.pruning.gray import repaint

__all__ = ["Graded", "feature_size", "follow_map", "grade"]

_Floats = npt.NDArray[np.float64]
_Bools = npt.NDArray[np.bool_]

ROUNDS = 12
"""Newton steps of the levels; errors halve or better in each, and 12 reach the noise of voxels."""
BLOCK = 1.0
"""Distance of the nodes of the level field, in feature sizes. In smooth noise that was to keep its
porosity, 17, 11, 7 and 5 % of the voxels changed with 0.5, 0.75, 1 and 1.5, and windows of two
feature sizes missed a gradient beside it by 0.7, 0.9, 1.3 and 1.6 % porosity."""
LONGEST = 2.0
"""Most that a level moves in a step, voxels: surfaces meet, and the slope is then another."""
REACHED = 0.03
"""Mean error of the local porosity above which a map is refused as impossible."""
EVEN = 2.0
"""Blur of the struts' thickness, voxels: it changes in steps where a strut meets a node."""
NEAR, FAR = 2.0, 4.0
"""Depths, voxels, between which the synthesised field hands over to the exact distance: nearer the
field knows the surface between the voxels, further it is clipped."""


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
    array: npt.NDArray[Any],
    phases: Phases,
    scores: npt.NDArray[np.float32],
    phase: npt.NDArray[np.uint8],
    request: Request,
) -> tuple[npt.NDArray[Any], Graded]:
    """Return a volume whose porosity follows the map that was asked for.

    Parameters
    ----------
    array : numpy.ndarray
        A volume of the exemplar's porosity, shape (z, y, x[, channel]).
    phases : Phases
        The exemplar's.
    scores : numpy.ndarray of float32
        What the phase was cut from, shape (1, z, y, x), high in the solid.
    phase : numpy.ndarray of uint8
        Its phases, shape (z, y, x).
    request : Request
        What was asked for, with a map.

    Returns
    -------
    numpy.ndarray
        Of the same shape and dtype; voxels keep their rank among those of their depth.
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
    before = phase > 0
    graded = grade(
        scores[0],
        before,
        request.porosity_map,
        feature_size(phases.phase > 0),
        request.free,
        seed=request.seed,
    )
    keep = None if request.free is None else ~request.free
    gray = phases.kind == "gray"
    if array.ndim == 3:
        return repaint(array, before, graded.solid, gray=gray, keep=keep), graded
    channels = [
        repaint(array[..., c], before, graded.solid, gray=gray, keep=keep)
        for c in range(array.shape[3])
    ]
    return np.stack(channels, axis=-1), graded


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
    score: npt.NDArray[np.float32],
    solid: _Bools,
    porosity: npt.NDArray[np.float32],
    feature: float,
    free: _Bools | None,
    *,
    seed: int,
) -> Graded:
    """Move the surface of a solid until its local porosity follows a map.

    Parameters
    ----------
    score : numpy.ndarray of float32
        What the solid was cut from, shape (z, y, x).
    solid : numpy.ndarray of bool
        The solid of the exemplar's porosity, same shape.
    porosity : numpy.ndarray of float32
        Wanted porosity at each voxel, same shape.
    feature : float
        Feature size, voxels; see `feature_size`.
    free : numpy.ndarray of bool or None
        Voxels that may change; only they count.
    seed : int
        Decides between voxels of one depth.

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

    Peak memory: 40 bytes a voxel.
    """
    depth = _depth(score, solid)
    count = np.ones(solid.shape, np.float32) if free is None else free.astype(np.float32)
    window = max(round(3 * feature), 4)
    nodes = _Nodes.over(solid.shape, round(BLOCK * feature))
    inside = nodes.around(count)
    wanted = 1 - nodes.around(porosity * count) / inside
    levels = np.zeros(nodes.shape)
    for _ in range(ROUNDS):
        above = depth - nodes.spread(levels)
        share = nodes.around((above > 0) * count) / inside
        # Voxels that a move of the level by one would change.
        slope = nodes.around((np.abs(above) <= 1) * count) / (2 * inside)
        step = (share - wanted) / np.maximum(slope, 0.01)
        levels += np.clip(step, -LONGEST, LONGEST)
    above = depth - nodes.spread(levels)
    voxels = round(float(((1 - porosity) * count).sum(dtype=np.float64)))
    flat = None if free is None else free.ravel()
    graded = _core.cut_solid(above.ravel(), voxels, seed=seed, free=flat).reshape(solid.shape)
    if free is not None:
        graded = np.where(free, graded, solid)
    error = _window_error(graded, porosity, count, window)
    if error > REACHED:
        raise ParameterError(
            "porosity",
            f"a map from {porosity.min():.3g} to {porosity.max():.3g}",
            f"is out of reach for this exemplar: windows of {window} voxels miss it by "
            f"{100 * error:.1f} % on average; take one that varies more slowly or less",
        )
    return Graded(graded, window, error)


def _depth(score: npt.NDArray[np.float32], solid: _Bools) -> npt.NDArray[np.float32]:
    """Return how far below the surface each voxel lies, by the score near it."""
    far = _core.signed_distance(solid, max(solid.shape), boundary="open")
    shell = np.abs(far) < 1
    inner, outer = score[shell & solid], score[shell & ~solid]
    cut = (inner.mean() + outer.mean()) / 2 if len(inner) and len(outer) else 0.0
    # One voxel apart, so that their difference is the slope at the surface.
    slope = max(float(inner.mean() - outer.mean()), 1e-6) if len(inner) and len(outer) else 1.0
    near = np.clip((score - cut) / slope, -FAR, FAR)
    weight = np.clip((np.abs(far) - NEAR) / (FAR - NEAR), 0, 1)
    depth = weight * far + (1 - weight) * near
    radius = _core.local_thickness(solid, (1.0, 1.0, 1.0), boundary="open") / 2
    if solid.any():
        share = ndimage.gaussian_filter(solid.astype(np.float32), EVEN)
        around = ndimage.gaussian_filter(radius, EVEN) / np.maximum(share, 1e-3)
        mean = float(radius[solid].mean())
        depth = np.where(depth > 0, depth * mean / np.maximum(around, 1), depth)
    return depth.astype(np.float32)


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

    def spread(self, values: _Floats) -> npt.NDArray[np.float32]:
        """Interpolate values of the nodes at the voxels."""
        z, y, x = self.weights
        found = np.tensordot(z, np.tensordot(values, y, (1, 1)), (1, 0))
        return np.asarray(np.tensordot(found, x, (1, 1)), np.float32)

    def around(self, values: npt.NDArray[Any]) -> _Floats:
        """Sum values of the voxels round each node, by their weights."""
        z, y, x = self.weights
        rows = np.tensordot(values.astype(np.float32), x.astype(np.float32), (2, 0))
        sums = np.tensordot(np.tensordot(rows, y, (1, 0)), z, (0, 0))
        return np.maximum(np.asarray(sums.transpose(2, 1, 0), np.float64), 1e-6)


def _weights(n: int, nodes: int) -> _Floats:
    """Return the weights of linear interpolation from nodes to voxels, shape (n, nodes)."""
    low, part = places(n, nodes)
    weights = np.zeros((n, nodes))
    weights[np.arange(n), low] = 1 - part
    if nodes > 1:
        weights[np.arange(n), low + 1] = part
    return weights


def _window_error(
    solid: _Bools, porosity: npt.NDArray[np.float32], count: npt.NDArray[np.float32], window: int
) -> float:
    """Return the mean absolute error of the porosity over windows at least half inside."""
    difference = (~solid - porosity) * count
    size = [min(window, n) for n in solid.shape]
    error = ndimage.uniform_filter(difference, size, mode="constant")
    share = ndimage.uniform_filter(count, size, mode="constant")
    step = tuple(
        slice(s // 2, n - (s - 1) // 2, max(s // 4, 1))
        for s, n in zip(size, solid.shape, strict=True)
    )
    error, share = error[step], share[step]
    full = share >= 0.5
    return float(np.abs(error[full] / share[full]).mean()) if full.any() else 0.0
