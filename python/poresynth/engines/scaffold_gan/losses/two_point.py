"""A loss on the normalised two-point covariance, beyond the paper."""

from __future__ import annotations

import torch
from torch import Tensor

__all__ = ["covariance", "two_point_loss"]


def covariance(volumes: Tensor, reach: int) -> Tensor:
    """Return the autocovariance at all lags of up to so many voxels an axis, over the variance.

    Parameters
    ----------
    volumes : Tensor
        Shape (batch, channels, z, y, x); channels are averaged.
    reach : int
        Longest lag along each axis, less than the edges.

    Returns
    -------
    Tensor
        Shape (2 · reach + 1, 2 · reach + 1, reach + 1): lags −reach to reach of z and y, 0 to reach
        of x; a mean over the batch. The first two axes are in the order of an FFT. Nothing wraps:
        each lag is a mean over the pairs that there are.
    """
    with torch.autocast(volumes.device.type, enabled=False):
        volumes = volumes.float()
        deviation = volumes - volumes.mean()
        edges = volumes.shape[2:]
        size = [n + reach for n in edges]
        spectrum = torch.fft.rfftn(deviation, size, dim=(2, 3, 4))
        sums = torch.fft.irfftn(spectrum.abs().square().mean((0, 1)), size)
        lags = torch.cat([torch.arange(reach + 1), torch.arange(-reach, 0)]).to(volumes.device)
        sums = sums[lags % size[0]][:, lags % size[1]][:, :, : reach + 1]
        pairs = [(n - lags.abs()).to(sums.dtype) for n in edges]
        count = pairs[0][:, None, None] * pairs[1][:, None] * pairs[2][: reach + 1]
        means: Tensor = sums / count
        # A constant volume has no covariance to speak of.
        return means / means[0, 0, 0].clamp_min(1e-6)


def two_point_loss(fake: Tensor, real: Tensor, reach: int) -> Tensor:
    """Return the mean squared difference of the normalised covariances.

    Normalised, it leaves porosity and contrast to other losses: with them it is ruled by the
    porosity's wandering.

    Parameters
    ----------
    fake, real : Tensor
        Crops, shapes (batch, channels, z, y, x). The gradient passes through ``fake`` only.
    reach : int
        As for `covariance`.
    """
    return (covariance(fake, reach) - covariance(real.detach(), reach)).square().mean()
