"""What the losses on distributions share: sorted responses against those of the exemplar."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

__all__ = ["DistributionLoss", "quantiles"]


class DistributionLoss(ABC):
    """Mean distance of the sorted responses of a field and of the exemplar, grid by grid.

    Attributes
    ----------
    offsets : sequence of sequence of Tensor
        Places of the points of each grid along each axis, as of `Windows.draw`.
    places : int
        Places of the field that a grid is evaluated at in a step.
    tables : sequence of Tensor
        Sorted responses of the exemplar for each grid, as many as there are of a field.
    """

    offsets: Sequence[Sequence[Tensor]] | Tensor
    places: int
    tables: Sequence[Tensor] | Tensor

    def __call__(self, field: Tensor, grid: int) -> Tensor:
        """Return the mean distance of the sorted responses.

        Parameters
        ----------
        field : Tensor
            The field on a grid at ``places`` places, shape (place, channel, node, …).
        grid : int
            Which grid.
        """
        # Quantiles of many values need all the bits that there are.
        with torch.autocast(field.device.type, enabled=False):
            found = self.responses(field.float(), grid)
            return (ascending(found) - self.tables[grid]).abs().mean()

    @abstractmethod
    def responses(self, field: Tensor, grid: int) -> Tensor:
        """Return what is sorted, shape (place, channel, node, …) → (sample, response)."""


def quantiles(values: Tensor, count: int) -> Tensor:
    """Return the middles of so many equal shares of values along the first axis, ascending."""
    at = ((torch.arange(count) + 0.5) / count * len(values)).long()
    return ascending(values)[at.to(values.device)]


def ascending(values: Tensor) -> Tensor:
    """Return values in order along the first axis."""
    if values.requires_grad or values.device.type != "cpu":
        return values.sort(0).values
    # A tenth of the time.
    return torch.from_numpy(np.sort(values.numpy(), axis=0))
