"""Cells of shifted lattices: where points lie in them, and which sites they need."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

__all__ = ["Cells", "cells_around", "shifts"]


@dataclass(frozen=True)
class Cells:
    """The cells that the points of grids lie in, on several lattices.

    Attributes
    ----------
    first : Tensor
        First site of each window of a lattice, int64, shape (lattice, batch, axis).
    sites : tuple of int
        Sites of a window along each axis.
    index : list of Tensor
        Cell of each point along each axis, counted from the first site, int64, shape (lattice,
        batch, points).
    fraction : list of Tensor
        Place of each point in its cell along each axis, 0 to 1, the same shape.
    """

    first: Tensor
    sites: tuple[int, ...]
    index: list[Tensor]
    fraction: list[Tensor]

    def like(self, numbers: Tensor) -> Cells:
        """Return the same where these numbers are, with fractions of their type."""
        return Cells(
            self.first,
            self.sites,
            [cell.to(numbers.device) for cell in self.index],
            [t.to(numbers.device, numbers.dtype) for t in self.fraction],
        )


def shifts(axes: int, lattices: int) -> Tensor:
    """Return the shift of each lattice along each axis in cells, shape (lattice, axis).

    Multiples of the powers of the root of x^(axes + 1) = x + 1 (a Kronecker sequence) spread
    evenly over a cell, for any number of lattices; the first is 0, as in the paper.
    """
    root = 1.5
    for _ in range(64):
        root = (1 + root) ** (1 / (axes + 1))
    rows = [
        [lattice / root ** (axis + 1) % 1.0 for axis in range(axes)] for lattice in range(lattices)
    ]
    return torch.tensor(rows, dtype=torch.float64)


def cells_around(
    phases: Sequence[Tensor],
    spacing: Sequence[float],
    fineness: Sequence[int],
    shift: Tensor,
    laps: Sequence[Tensor] | None,
    below: int = 0,
) -> Cells:
    """Find the cells of points on a grid.

    Parameters
    ----------
    phases : sequence of Tensor
        Phase of the points along each axis, shape (batch, points).
    spacing : sequence of float
        Distance of the sites of a lattice of fineness 1 along each axis, as a phase.
    fineness : sequence of int
        Sites that each lattice has where that one has one, along an axis.
    shift : Tensor
        Shift of each lattice along each axis in cells, shape (lattice, axis).
    laps : sequence of Tensor or None
        Sites of a lattice of fineness 1 to go on from the phase at each point, int64, shape (batch,
        points).
    below : int, default 0
        Sites that are needed below that of each cell; above it is one.
    """
    shift = shift.to(phases[0].device, phases[0].dtype)[..., None, None]
    fine = torch.tensor(fineness, device=phases[0].device)[:, None, None]
    firsts, cells, fractions, sites = [], [], [], []
    for axis, phase in enumerate(phases):
        place = phase * (fine / spacing[axis]) - shift[:, axis]  # (lattice, batch, points)
        floor = place.detach().floor()
        fractions.append(place - floor)
        cell, around = floor.long(), place.detach()
        if laps is not None:
            cell, around = cell + laps[axis] * fine, around + laps[axis] * fine
        first = cell.amin(-1, keepdim=True) - below
        # As many as such a grid can touch, wherever it lies and however it is rounded.
        extent = float((around.amax(-1) - around.amin(-1)).max())
        sites.append(math.ceil(extent + 1e-6) + 2 + below)
        firsts.append(first[..., 0])
        cells.append(cell - first)
    return Cells(torch.stack(firsts, dim=-1), tuple(sites), cells, fractions)
