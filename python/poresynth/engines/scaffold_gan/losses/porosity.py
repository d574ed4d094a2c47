"""A soft-porosity loss for one-sided exemplars, beyond the paper."""

from __future__ import annotations

import torch
from torch import Tensor

__all__ = ["porosity_loss", "soft_solid"]

STEEPNESS = 8.0
"""Of the sigmoid, a unit being half of the range of grays: 80 % of its rise in 27 % of the range.
Steeper ones have no gradient where a generator is all pore."""


def soft_solid(values: Tensor, threshold: float) -> Tensor:
    """Return the soft share of values above a threshold, a mean over all."""
    return torch.sigmoid(STEEPNESS * (values.float() - threshold)).mean()


def porosity_loss(fake: Tensor, threshold: float, wanted: float) -> Tensor:
    """Return the squared difference of the soft share of what was generated from the exemplar's.

    Parameters
    ----------
    fake : Tensor
        Crops, any shape.
    threshold : float
        That of the exemplar, in the scale of the crops.
    wanted : float
        `soft_solid` of the exemplar.
    """
    return (soft_solid(fake, threshold) - wanted).square()
