"""A sliced-Wasserstein loss on random filters: a fast start, beyond the paper."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn.functional import avg_pool3d, conv3d

__all__ = ["random_filters", "sliced_wasserstein_loss"]


def random_filters(count: int, channels: int, width: int, random: torch.Generator) -> Tensor:
    """Return normal random filters of norm 1, shape (count, channels, width, width, width)."""
    filters = torch.randn(count, channels, width, width, width, generator=random)
    return torch.nn.functional.normalize(filters.flatten(1)).reshape(filters.shape)


def sliced_wasserstein_loss(
    fake: Tensor, real: Tensor, filters: Tensor, *, scales: int, places: Tensor
) -> Tensor:
    """Return the mean distance between the distributions of filter responses.

    Parameters
    ----------
    fake, real : Tensor
        Crops, shapes (batch, channels, z, y, x), the same.
    filters : Tensor
        From `random_filters`.
    scales : int
        Resolutions, each half of the one before.
    places : Tensor
        Numbers in [0, 1), shape (n,): where responses are looked at, as a share of all of them.

    Returns
    -------
    Tensor
        1-Wasserstein distance of the responses of each filter, a mean over filters and scales.
        Responses are sorted; the gradient passes through ``fake``.
    """
    total = fake.new_zeros(())
    with torch.autocast(fake.device.type, enabled=False):
        fake, real = fake.float(), real.float()
        for scale in range(scales):
            if scale:
                fake, real = avg_pool3d(fake, 2), avg_pool3d(real, 2)
            rows = []
            for batch in (fake, real):
                flat = conv3d(batch, filters).transpose(0, 1).flatten(1)
                at = (places * flat.shape[1]).long()
                rows.append(flat[:, at].sort(1).values)
            total = total + (rows[0] - rows[1]).abs().mean()
    return total / scales
