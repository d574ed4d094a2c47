"""The Gram loss (scaffoldgan_2021 §3.3)."""

from __future__ import annotations

import torch
from torch import Tensor

__all__ = ["gram_loss", "slice_grams"]


def slice_grams(features: Tensor, slices: int) -> Tensor:
    """Return the Gram matrices of equally spaced slices across z, y and x.

    Parameters
    ----------
    features : Tensor
        Shape (batch, channels, z, y, x).
    slices : int
        Slices a direction at most: a map of fewer layers gives all of them.

    Returns
    -------
    Tensor
        ⟨f_m, f_n⟩ over the voxels of a slice, a mean over voxels, slices and batch; shape
        (direction, channels, channels). The batch is averaged before matrices are compared, for
        nothing pairs a sample with a training sample: comparing pairs would ask every sample for
        the same matrix.
    """
    found = []
    with torch.autocast(features.device.type, enabled=False):
        for axis in (2, 3, 4):
            count = features.shape[axis]
            chosen = min(slices, count)
            # The middles of equal parts.
            at = [(2 * i + 1) * count // (2 * chosen) for i in range(chosen)]
            index = torch.tensor(at, device=features.device)
            flat = features.index_select(axis, index).float().transpose(0, 1).flatten(1)
            found.append(flat @ flat.T / flat.shape[1])
    return torch.stack(found)


def gram_loss(fake: Tensor, real: Tensor, slices: int) -> Tensor:
    """Return L_g of one layer, a mean over directions and entries of the matrices.

    Parameters
    ----------
    fake, real : Tensor
        Features of what was generated, and of training samples, shapes (batch, channels, z, y, x).
        The gradient passes through ``fake`` only.
    slices : int
        As for `slice_grams`.
    """
    return (slice_grams(fake, slices) - slice_grams(real.detach(), slices)).square().mean()
