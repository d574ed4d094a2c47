"""Distances to the nearest of random points: what networks of struts and grains are made of."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from poresynth import _core
from poresynth.engines.periodic_field.lattice import Cells

__all__ = ["JITTER", "distances", "nearest"]

JITTER = 0.75
"""How far a point may lie from the middle of its cell, as a share of what the cell has room for.
With 1 points come as near as they like, and cells of a foam are more alike than that."""

_FARTHEST = 1.5 - JITTER / 2
"""Distance in cells within which no point is missed by the cells around that of a place."""


def nearest(axes: int) -> int:
    """Return how many distances there are: as many as points that a corner of cells is between."""
    return axes + 1


def distances(numbers: Tensor, cells: Cells) -> Tensor:
    """Return the distances to the nearest points (Worley 1996), in cells, ascending.

    Every cell of a lattice has one point. Where two distances are the same is a face of the Voronoi
    cells of these points, where three are the same an edge, and so on. A distance has the same
    slope everywhere, which functions of noise cannot have: their slope varies by 40 %, for that of
    noise does not depend on its value.

    Parameters
    ----------
    numbers : Tensor
        −1 to 1, as many as axes at each site, shape (lattice, batch, axis, sites, …).
    cells : Cells
        With one more site below that of each cell.

    Returns
    -------
    Tensor
        Shape (lattice, batch, points, …, distance). At most 1.1: all nearer points lie in the cells
        around, so that nothing jumps between cells. No gradient flows back.

    Notes
    -----
    Peak memory: 4 · (axes + 4) bytes a point and lattice, and 8 a site and line of points.
    """
    with torch.no_grad():
        points = numbers * (JITTER / 2) + 0.5
        if numbers.device.type == "cpu" and numbers.dtype == torch.float32:
            return _native(points, cells)
        return _anywhere(points, cells)


def _native(points: Tensor, cells: Cells) -> Tensor:
    """Return the distances by the kernel: a tenth of the time of `_anywhere`."""
    lattices, batch, axes = points.shape[:3]
    count = lattices * batch
    # An image is one layer: all is 0 along the axis that it does not have.
    flat = points.new_zeros((count, 3, math.prod(cells.sites)))
    flat[:, 3 - axes :] = points.reshape(count, axes, -1)
    none = [torch.zeros(count)] * (3 - axes)
    found = _core.point_distances(
        flat.flatten().numpy(),
        [1] * (3 - axes) + list(cells.sites),
        [along.flatten().long().numpy() for along in (*none, *cells.index)],
        [along.flatten().detach().numpy() for along in (*none, *cells.fraction)],
        count=count,
        kept=nearest(axes),
        farthest=_FARTHEST,
        threads=torch.get_num_threads(),
    )
    places = [along.shape[2] for along in cells.index]
    return torch.from_numpy(found).reshape(lattices, batch, *places, nearest(axes))


def _anywhere(points: Tensor, cells: Cells) -> Tensor:
    """Return the distances by operations that every device has."""
    axes = points.shape[2]
    points = points.flatten(3)
    sites = torch.cartesian_prod(
        *[torch.arange(count, device=points.device) for count in cells.sites]
    )
    squares = []
    for axis, (index, t) in enumerate(zip(cells.index, cells.fraction, strict=True)):
        # Whole cells by themselves: windows from other sites on get the same bits.
        whole = index[:, :, None] - sites[:, axis, None]
        squares.append(((t[:, :, None] - points[:, :, axis, :, None]) + whole) ** 2)
    # Along each axis the nearest that a point of any grid comes: most sites are too far away.
    least = torch.stack([square.amin(-1) for square in squares]).sum(0).amin((0, 1))
    shape = [*points.shape[:2], *(square.shape[3] for square in squares)]
    kept = [points.new_full(shape, torch.inf) for _ in range(nearest(axes))]
    free = points.new_empty(shape)
    for site in torch.nonzero(least < _FARTHEST**2)[:, 0].tolist():
        square = torch.zeros_like(free)
        for axis, along in enumerate(squares):
            square += along[:, :, site].reshape(*shape[:2], *_only(axis, axes))
        # Into its place among those kept so far; the farthest falls out.
        for k in range(len(kept)):
            torch.minimum(kept[k], square, out=free)
            torch.maximum(kept[k], square, out=square)
            kept[k], free = free, kept[k]
    return torch.stack(kept, dim=-1).sqrt_().clamp_(max=_FARTHEST)


def _only(axis: int, axes: int) -> list[int]:
    """Return the shape of what varies along one axis only."""
    shape = [1] * axes
    shape[axis] = -1
    return shape
