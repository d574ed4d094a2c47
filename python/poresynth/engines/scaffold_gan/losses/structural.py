"""The structural loss (scaffoldgan_2021 §3.2, Eqs. 3 and 4)."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from poresynth.engines.scaffold_gan.losses.search import nearest

__all__ = ["Shape", "cuboids", "look_up_table", "region_grid", "regions", "structural_loss"]

Shape = tuple[int, int, int]


def cuboids(width: int) -> tuple[Shape, ...]:
    """Return cuboids of a cube's volume, each long along one axis: the "different aspect ratios".

    The paper (§2.3) names no ratios; 2 : 1 : ½ is the flattest that a width of 2 allows.
    """
    long, short = 2 * width, width // 2
    return ((long, width, short), (short, long, width), (width, short, long))


def region_grid(edges: Sequence[int], shape: Shape, stride: Sequence[int]) -> Shape:
    """Return how many regions a map of these edges holds along each axis."""
    z, y, x = ((n - w) // s + 1 for n, w, s in zip(edges, shape, stride, strict=True))
    return (z, y, x)


def regions(features: Tensor, shape: Shape, stride: Shape) -> Tensor:
    """Return F(C_q): the features in the cubical regions of a lattice.

    Parameters
    ----------
    features : Tensor
        Shape (batch, channels, z, y, x).
    shape, stride : (int, int, int)
        Edges of a region, and steps between regions.

    Returns
    -------
    Tensor
        Shape (batch · regions of a map, channels · voxels of a region), batch slowest.
    """
    channels = features.shape[1]
    for axis, (width, step) in enumerate(zip(shape, stride, strict=True)):
        features = features.unfold(axis + 2, width, step)
    # (batch, channel, z, y, x, dz, dy, dx) → (batch, z, y, x, channel, dz, dy, dx)
    ordered = features.permute(0, 2, 3, 4, 1, 5, 6, 7)
    return ordered.reshape(-1, channels * shape[0] * shape[1] * shape[2])


def look_up_table(features: Tensor, shape: Shape, stride: Shape, anchors: Tensor | None) -> Tensor:
    """Return {F(C_p); p ∈ P}, detached: a table of the training samples' regions.

    Parameters
    ----------
    features : Tensor
        Of training samples, shape (batch, channels, z, y, x).
    shape, stride : (int, int, int)
        As for `regions`.
    anchors : Tensor of int or None
        The rows of `regions` that are taken, shape (m,); None takes all.
    """
    table = regions(features.detach(), shape, stride)
    return table if anchors is None else table[anchors]


def structural_loss(features: Tensor, table: Tensor, shape: Shape, stride: Shape) -> Tensor:
    """Return L_s of one layer: the mean squared distance of regions to their nearest in a table.

    Parameters
    ----------
    features : Tensor
        Of what was generated, shape (batch, channels, z, y, x).
    table : Tensor
        From `look_up_table`.
    shape, stride : (int, int, int)
        As for `regions`.

    Returns
    -------
    Tensor
        A mean over regions and their elements, where the paper has a sum: so λ_s = 1 means the same
        at any size. The gradient passes through ``features`` only.

    Notes
    -----
    The search is exact, and the distance is computed anew from the nearest row's differences.
    Peak memory: two copies of the regions, and that of `nearest`.
    """
    found = regions(features, shape, stride)
    with torch.no_grad():
        match = table[nearest(found, table)]
    # Half-precision features are subtracted in float32.
    exact = torch.promote_types(found.dtype, torch.float32)
    return (found.to(exact) - match.to(exact)).square().mean()
