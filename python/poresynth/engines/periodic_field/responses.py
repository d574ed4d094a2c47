"""The sparse sliced-Wasserstein loss: responses to a few random taps, matched by quantiles."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from poresynth.engines.periodic_field.distributions import DistributionLoss, quantiles
from poresynth.engines.periodic_field.windows import Windows

__all__ = ["ResponseLoss"]

_TABLE_PLACES = 1 << 14
"""Places of the exemplar whose responses make the quantiles: the probability of a quantile is then
known to 0.004."""


class ResponseLoss(DistributionLoss):
    """Distance between the distributions of filter responses on a field and on the exemplar.

    A filter is a weighted sum of the field at a few places. The response distributions of all such
    filters determine the joint distribution of the field at those places (Cramér and Wold), and the
    distance of two distributions on a line is that of their sorted values.

    The places are nodes of small grids whose lines are spaced at random, from neighbouring voxels
    up to the reach. A step evaluates one such grid at many independent places of the endless field,
    instead of a few dense crops: values of one crop hang together, and a loss on a few crops holds
    every one of them to the distribution of the whole, which it should differ from. The filters are
    fixed, so that the exemplar's responses are sorted once.

    Guidance factors are channels like any other: matching their joint distribution with the field
    matches the field given the guidance.

    Parameters
    ----------
    windows : Windows
        Of the exemplar.
    reach : int
        Largest extent of a grid along an axis, below the edge of the exemplar.
    nodes : int
        Lines of a grid along each axis.
    grids : int
        Grids that are drawn at the beginning.
    filters : int
        Filters of each.
    taps : (int, int)
        Fewest and most places of a filter.
    places : int
        Places that a grid is evaluated at in a step.
    random : torch.Generator
        Of the CPU; draws grids and filters.

    Attributes
    ----------
    offsets : Tensor
        The lines of each grid, int64, shape (grid, axis, node).

    Notes
    -----
    Peak memory: 4 · grids · filters · (places + channels · nodes^axes) bytes.
    """

    def __init__(
        self,
        windows: Windows,
        *,
        reach: int,
        nodes: int,
        grids: int,
        filters: int,
        taps: tuple[int, int],
        places: int,
        random: torch.Generator,
    ) -> None:
        channels, axes, device = windows.channels, windows.field.ndim - 1, windows.field.device
        self.places = places
        self.offsets = torch.stack(
            [_lines(axes, min(nodes, reach + 1), reach, random) for _ in range(grids)]
        )
        count = self.offsets.shape[2] ** axes
        self._weights = torch.stack(
            [_filters(filters, channels, count, taps, random) for _ in range(grids)]
        ).to(device)
        tables = []
        for grid, offsets in enumerate(self.offsets):
            drawn = windows.draw(list(offsets), _TABLE_PLACES, random)
            tables.append(quantiles(self.responses(drawn, grid), places))
        self.tables = tables

    def responses(self, field: Tensor, grid: int) -> Tensor:
        """Return weighted sums, shape (place, channel, node, …) → (place, filter)."""
        return field.flatten(1) @ self._weights[grid].T


def _lines(axes: int, nodes: int, reach: int, random: torch.Generator) -> Tensor:
    """Return the lines of a grid, shape (axis, node): distinct, ascending from 0."""
    # As many grids between 4 and 8 voxels as between 8 and 16.
    least, most = math.log(nodes - 1), math.log(reach)
    extent = round(math.exp(least + (most - least) * float(torch.rand((), generator=random))))
    rows = [
        torch.sort(1 + torch.randperm(extent, generator=random)[: nodes - 1]).values
        for _ in range(axes)
    ]
    return torch.cat([torch.zeros(axes, 1, dtype=torch.int64), torch.stack(rows)], dim=1)


def _filters(
    filters: int, channels: int, count: int, taps: tuple[int, int], random: torch.Generator
) -> Tensor:
    """Return filters of unit length on a grid, shape (filter, channel · node)."""
    wanted = torch.randint(taps[0], taps[1] + 1, (filters, 1), generator=random)
    order = torch.rand(filters, count, generator=random).argsort(1).argsort(1)
    weights = torch.randn(filters, channels, count, generator=random)
    weights = (weights * (order < wanted)[:, None]).flatten(1)
    return weights / weights.square().sum(1, keepdim=True).sqrt()
