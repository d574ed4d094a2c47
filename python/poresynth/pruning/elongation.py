"""Branches grown to the next strut, by a branch of the exemplar that is like them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import ndimage
from scipy.spatial import distance

from poresynth.pruning.spurs import Network

__all__ = ["Growth", "Stock", "grow"]

_Floats = npt.NDArray[np.float64]

RAYS = 96
"""Directions in which a branch looks for a strut."""
AHEAD = 0.6
"""Least cosine between a branch and the way to the strut: 53°, the half of what is before it."""
SKIN = 1.5
"""Voxels around a strut whose gray values its surface blurs."""
WIDER = 1.3
"""Most by which a copied branch is thicker than that which it continues, where it meets a node."""
STRETCH = 1.6
"""Most by which a copied branch is lengthened."""


@dataclass(frozen=True, eq=False)
class Growth:
    """What a branch became.

    Attributes
    ----------
    voxels : numpy.ndarray of int64
        The new voxels of the solid, shape (n, 3).
    skin : numpy.ndarray of int64
        Voxels around them that stay pore, shape (m, 3).
    source : numpy.ndarray of int64
        The voxels of the exemplar that lie there, first for ``voxels``, then for ``skin``, shape
        (n + m, 3).
    """

    voxels: npt.NDArray[np.int64]
    skin: npt.NDArray[np.int64]
    source: npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Stock:
    """Branches of an exemplar from junction to junction, to copy from.

    Attributes
    ----------
    solid : numpy.ndarray of bool
        The exemplar, shape (z, y, x).
    radius : numpy.ndarray of float32
        Distance to the pore, in voxels, same shape.
    paths : list of numpy.ndarray of float64
        Voxels (z, y, x) of each branch, shape (k, 3).
    span : numpy.ndarray of float64
        Straight distance between the ends in voxels, shape (n,).
    direction : numpy.ndarray of float64
        Unit vector from end to end, shape (n, 3).
    thickness : numpy.ndarray of float64
        Mean radius along the branch in voxels, shape (n,).
    """

    solid: npt.NDArray[np.bool_]
    radius: npt.NDArray[np.float32]
    paths: list[_Floats]
    span: _Floats
    direction: _Floats
    thickness: _Floats

    @classmethod
    def of(cls, solid: npt.NDArray[np.bool_], network: Network) -> Stock:
        """Collect the branches that run straight enough to be copied."""
        graph = network.graph
        paths, spans, directions, thickness = [], [], [], []
        for branch in np.flatnonzero(graph.branches.type == 2).tolist():
            path = graph.path(branch).astype(float)
            if len(path) < 3:
                continue
            chord = path[-1] - path[0]
            span = float(np.linalg.norm(chord))
            # A branch that bends back leaves its chord by more than half of it.
            if span < 2 or len(path) > 2 * span:
                continue
            paths.append(path)
            spans.append(span)
            directions.append(chord / span)
            thickness.append(float(network.radius[tuple(graph.path(branch).T)].mean()))
        return cls(
            solid,
            network.radius,
            paths,
            np.array(spans),
            np.array(directions).reshape(-1, 3),
            np.array(thickness),
        )

    def likest(self, gap: _Floats, radius: float) -> int | None:
        """Return the branch whose length, thickness and direction are nearest; None if none fits.

        A relative difference of length counts as much as the same angle in radians, one of
        thickness, which shows, twice as much.
        """
        if not self.paths:
            return None
        length = float(np.linalg.norm(gap))
        stretch = np.maximum(length / self.span, 1)
        cosine = np.abs(self.direction @ (gap / length))
        cost = np.log(stretch) + 2 * np.abs(np.log(self.thickness / max(radius, 1.0)))
        cost += np.arccos(np.clip(cosine, 0, 1))
        cost[stretch > STRETCH] = np.inf
        best = int(np.argmin(cost))
        return best if np.isfinite(cost[best]) else None


def grow(
    solid: npt.NDArray[np.bool_],
    network: Network,
    path: npt.NDArray[np.uint32],
    reach: float,
    stock: Stock,
    free: npt.NDArray[np.bool_] | None,
) -> Growth | None:
    """Find what lets a branch reach the next strut.

    Parameters
    ----------
    solid : numpy.ndarray of bool
        The solid as it is now.
    network : Network
        Its skeleton, which may be some edits older.
    path : numpy.ndarray of uint32
        Voxels of the branch from its free end on.
    reach : float
        How far the strut may be, voxels.
    stock : Stock
        Branches to copy.
    free : numpy.ndarray of bool or None
        Voxels that may change.

    Returns
    -------
    Growth or None
        None if there is no strut within reach, no branch to copy, or no way without touching
        something else.
    """
    tip = path[0].astype(float)
    radius = float(network.radius[tuple(path.T)].mean())
    back = path[min(len(path) - 1, int(2 * radius) + 3)].astype(float)
    heading = tip - back
    if not heading.any():
        return None
    target = _strut_ahead(solid, tip, heading / np.linalg.norm(heading), radius, reach)
    if target is None:
        return None
    number = stock.likest(target - tip, radius)
    if number is None:
        return None
    return _copied(solid, tip, target, radius, stock, number, free)


def _directions() -> _Floats:
    """Return unit vectors evenly over the sphere (Fibonacci's spiral), shape (n, 3)."""
    n = int(RAYS * 2 / (1 - AHEAD))
    z = 1 - (2 * np.arange(n) + 1) / n
    angle = np.pi * (3 - np.sqrt(5)) * np.arange(n)
    around = np.sqrt(1 - z**2)
    return np.stack([z, around * np.cos(angle), around * np.sin(angle)], axis=1)


_SPHERE = _directions()


def _strut_ahead(
    solid: npt.NDArray[np.bool_], tip: _Floats, heading: _Floats, radius: float, reach: float
) -> _Floats | None:
    """Return the nearest voxel of the solid beyond the pore before a tip."""
    cosine = _SPHERE @ heading
    ahead = _SPHERE[cosine >= AHEAD]
    cosine = cosine[cosine >= AHEAD]
    steps = np.arange(0.5, reach + radius, 0.5)
    places = np.rint(tip + ahead[:, None] * steps[None, :, None]).astype(np.int64)
    inside = ((places >= 0) & (places < solid.shape)).all(axis=2)
    clipped = np.clip(places, 0, np.array(solid.shape) - 1)
    hit = solid[tuple(np.moveaxis(clipped, 2, 0))] & inside
    # The branch itself ends first: only what follows pore is another strut.
    left = np.maximum.accumulate(~hit & inside, axis=1)
    other = hit & left
    # A ray that stays in the branch's own root for long runs along it, not out of it.
    other &= (np.argmax(left, axis=1) * 0.5 <= 2 * radius + 2)[:, None]
    far = np.where(other.any(axis=1), np.argmax(other, axis=1) * 0.5, np.inf)
    # A strut straight ahead is preferred to a nearer one at the side.
    cost = far * (2 - cosine)
    best = int(np.argmin(cost))
    if not np.isfinite(cost[best]) or far[best] > reach:
        return None
    found: _Floats = tip + ahead[best] * (far[best] + 1.5)
    return np.clip(found, 0, np.array(solid.shape) - 1.0)


def _copied(
    solid: npt.NDArray[np.bool_],
    tip: _Floats,
    target: _Floats,
    radius: float,
    stock: Stock,
    number: int,
    free: npt.NDArray[np.bool_] | None,
) -> Growth | None:
    """Lay a branch of the exemplar between two places."""
    gap = target - tip
    length = float(np.linalg.norm(gap))
    chain, direction = _segment(stock.paths[number], length, stock.direction[number] @ gap < 0)
    stretch = max(length / max(float(np.linalg.norm(chain[-1] - chain[0])), 1e-9), 1.0)
    turn = _rotation(gap / length, direction)
    centres = tip + ((chain - chain[0]) @ turn) * stretch
    widest = float(stock.radius[tuple(chain.astype(int).T)].max()) + SKIN + 1
    low = np.maximum(np.floor(centres.min(axis=0) - widest), 0).astype(int)
    high = np.minimum(np.ceil(centres.max(axis=0) + widest) + 1, solid.shape).astype(int)
    places = np.stack(np.meshgrid(*map(np.arange, low, high), indexing="ij"), -1).reshape(-1, 3)
    # Each voxel belongs to the place of the chain that it lies deepest in.
    ball = np.minimum(stock.radius[tuple(chain.astype(int).T)], WIDER * max(radius, 1.0))
    square = distance.cdist(places, centres, "sqeuclidean")
    nearest = np.argmin(square - ball**2, axis=1)
    from_chain = np.take_along_axis(square, nearest[:, None], 1)[:, 0]
    near = from_chain <= (ball[nearest] + SKIN) ** 2
    places, nearest, from_chain = places[near], nearest[near], from_chain[near]
    offset = (places - centres[nearest]) @ turn.T
    source = np.rint(chain[nearest] + offset).astype(np.int64)
    source = np.clip(source, 0, np.array(stock.solid.shape) - 1)
    is_solid = stock.solid[tuple(source.T)] & (from_chain <= (ball[nearest] + 1) ** 2)
    # The centre line itself must come through, whatever was rounded.
    is_solid |= from_chain <= 1.5**2
    now = solid[tuple(places.T)]
    may = np.ones(len(places), bool) if free is None else free[tuple(places.T)]
    change = is_solid & ~now & may
    change &= ~_touches_others(solid, places, low, high, (tip, target), radius + 3)
    change[change] = _bridging(solid, places[change], tip, target, radius + 3)
    if not change.any():
        return None
    skin = ~is_solid & ~now & ~stock.solid[tuple(source.T)] & may
    return Growth(places[change], places[skin], np.concatenate([source[change], source[skin]]))


def _segment(path: _Floats, length: float, reverse: bool) -> tuple[_Floats, _Floats]:
    """Return the middle of a branch, whose ends are as far apart as wanted, and its direction."""
    chain = path[::-1] if reverse else path
    while len(chain) > 3 and np.linalg.norm(chain[-2] - chain[1]) >= length:
        chain = chain[1:-1]
    chord = chain[-1] - chain[0]
    return chain, chord / np.linalg.norm(chord)


def _rotation(to: _Floats, direction: _Floats) -> npt.NDArray[Any]:
    """Return R with ``v @ R`` turning ``direction`` to ``to`` by the smallest angle."""
    cross, cosine = np.cross(direction, to), float(direction @ to)
    skew = np.array([[0, -cross[2], cross[1]], [cross[2], 0, -cross[0]], [-cross[1], cross[0], 0]])
    # Directions hardly ever lie opposite: `_segment` turned the branch round.
    turn: npt.NDArray[Any] = np.eye(3) + skew + skew @ skew / max(1 + cosine, 1e-6)
    return np.asarray(turn.T)


def _touches_others(
    solid: npt.NDArray[np.bool_],
    places: npt.NDArray[np.int64],
    low: npt.NDArray[np.int64],
    high: npt.NDArray[np.int64],
    ends: tuple[_Floats, _Floats],
    near: float,
) -> npt.NDArray[np.bool_]:
    """Return which places in a box touch a part of the solid that is near neither end."""
    others = solid[tuple(map(slice, low, high))].copy()
    for end in ends:
        others &= _squares(low, high, end) > near**2
    beside = ndimage.binary_dilation(others, np.ones((3, 3, 3)))
    return np.asarray(beside[tuple((places - low).T)])


def _squares(low: npt.NDArray[np.int64], high: npt.NDArray[np.int64], place: _Floats) -> _Floats:
    """Return the squared distances of the voxels of a box from a place."""
    z, y, x = ((np.arange(a, b) - p) ** 2 for a, b, p in zip(low, high, place, strict=True))
    squares: _Floats = z[:, None, None] + y[:, None] + x
    return squares


def _bridging(
    solid: npt.NDArray[np.bool_],
    places: npt.NDArray[np.int64],
    tip: _Floats,
    target: _Floats,
    near: float,
) -> npt.NDArray[np.bool_]:
    """Return which of the new voxels belong to a piece that leads from one end to the other."""
    if len(places) == 0:
        return np.zeros(0, bool)
    low = np.maximum(places.min(axis=0) - 1, 0)
    high = np.minimum(places.max(axis=0) + 2, solid.shape)
    box = tuple(map(slice, low, high))
    new = np.zeros(high - low, np.bool_)
    new[tuple((places - low).T)] = True
    pieces, count = ndimage.label(new, np.ones((3, 3, 3)))
    good = np.ones(count + 1, bool)
    for end in (tip, target):
        root = solid[box] & (_squares(low, high, end) <= near**2)
        beside = ndimage.binary_dilation(root, np.ones((3, 3, 3)))
        good &= np.isin(np.arange(count + 1), pieces[beside])
    good[0] = False
    return np.asarray(good[pieces[tuple((places - low).T)]])
