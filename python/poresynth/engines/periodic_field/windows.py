"""Windows of the exemplar, and grids of points that are made to look like them."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

__all__ = ["draw_windows", "grid_phases"]


def draw_windows(
    field: Tensor, offsets: Sequence[Tensor], count: int, random: torch.Generator
) -> Tensor:
    """Return the exemplar on grids of points at random places.

    Parameters
    ----------
    field : Tensor
        Shape (channel, edge, …).
    offsets : sequence of Tensor
        Places of the points of a grid along each axis, int64, ascending from 0.
    count : int
        Grids.
    random : torch.Generator
        Of the CPU.

    Returns
    -------
    Tensor
        Shape (count, channel, points, …).
    """
    axes = len(offsets)
    index: list[Tensor | slice] = [slice(None)]
    for axis, (places, edge) in enumerate(zip(offsets, field.shape[1:], strict=True)):
        room = edge - int(places[-1])
        corner = torch.randint(room, (count, 1), generator=random).to(field.device)
        shape = [count] + [1] * axes
        shape[axis + 1] = -1
        index.append((corner + places.to(field.device)).reshape(shape))
    return field[tuple(index)].transpose(0, 1)


def grid_phases(offsets: Sequence[Tensor], frequency: Tensor, shift: Tensor) -> list[Tensor]:
    """Return the phases of grids of points.

    Parameters
    ----------
    offsets : sequence of Tensor
        As of `draw_windows`.
    frequency : Tensor
        Phase of one pixel or voxel along each axis, shape (axis,): a of Eq. 3 in its units.
    shift : Tensor
        Phase of the first point of each grid, shape (count, axis).

    Returns
    -------
    list of Tensor
        One an axis, shape (count, points).
    """
    return [
        start[:, None] + places.to(rate.device) * rate
        for places, start, rate in zip(offsets, shift.T, frequency, strict=True)
    ]
