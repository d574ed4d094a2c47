"""Generator and discriminator (scaffoldgan_2021 §3.4, Fig. 2; DCGAN in three dimensions).

The paper lists maps of 512, 512, 256, 128 and 64 for the generator and 64, 128, 256, 512 and 512
for the discriminator, which leaves neither a channel for the output nor one for the score, and says
stride 2 of every layer, which makes 64³ of no extent of latents. Here the last layer has one map,
the generator's first has stride 1 (1 → 4), the discriminator's last no padding (4 → 1), as in
DCGAN; nor has the discriminator's first layer a batch norm, which would hide mean and contrast from
all that is compared in its features.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torch.nn.functional import conv_transpose3d, leaky_relu

__all__ = ["Discriminator", "Generator", "initialise", "patch_strides"]

KERNEL = 4
SLOPE = 0.2
"""Of the leaky ReLU, as in DCGAN."""


class Generator(nn.Module):
    """Transposed convolutions from latents to a volume in [−1, 1].

    Parameters
    ----------
    latent : int
        Values of a latent.
    maps : sequence of int
        Feature maps after each layer but the last; one doubling follows each.
    channels : int
        Of the volume.
    """

    def __init__(self, latent: int, maps: Sequence[int], channels: int = 1) -> None:
        super().__init__()
        widths = [latent, *maps, channels]
        last = len(widths) - 2
        self.layers = nn.ModuleList(
            nn.ConvTranspose3d(a, b, KERNEL, 2 if i else 1, 1 if i else 0, bias=i == last)
            for i, (a, b) in enumerate(itertools.pairwise(widths))
        )
        self.norms = nn.ModuleList(nn.BatchNorm3d(width) for width in maps)
        self.latent, self.channels, self.doublings = latent, channels, len(maps)

    def forward(self, z: Tensor, endless: bool = False) -> Tensor:
        """Return the volume of latents.

        Parameters
        ----------
        z : Tensor
            Shape (batch, latent, n, n, n); any extents.
        endless : bool, default False
            Keep only voxels that no latent outside would change: with d doublings
            2^d (n − 5) + 2 of them instead of 2^d (n + 3).

        Returns
        -------
        Tensor
            Shape (batch, channels, z, y, x).
        """
        for i, layer in enumerate(self.layers):
            stride, padding = (2, 2 if endless else 1) if i else (1, 3 if endless else 0)
            weight, bias = layer.get_parameter("weight"), layer.bias
            z = conv_transpose3d(z, weight, bias, stride, padding)  # type: ignore[arg-type]
            z = torch.relu(self.norms[i](z)) if i < len(self.norms) else torch.tanh(z)
        return z


class Discriminator(nn.Module):
    """Convolutions from a volume to logits: one, or one a patch.

    Parameters
    ----------
    maps : sequence of int
        Feature maps of each layer but the last.
    strides : sequence of (int, int)
        Stride and padding of every layer, the last too; the default halves the volume at each
        layer and ends in one logit for a crop of 4 · 2^len(maps). `patch_strides` has others.
    channels : int
        Of the volume.
    """

    def __init__(
        self,
        maps: Sequence[int],
        channels: int = 1,
        strides: Sequence[tuple[int, int]] | None = None,
    ) -> None:
        super().__init__()
        widths = [channels, *maps, 1]
        self.steps = strides or [*[(2, 1)] * len(maps), (1, 0)]
        self.layers = nn.ModuleList(
            # Where a batch norm follows, a bias would be taken away again.
            nn.Conv3d(a, b, KERNEL, stride, padding, bias=i in (0, len(maps)))
            for i, ((a, b), (stride, padding)) in enumerate(
                zip(itertools.pairwise(widths), self.steps, strict=True)
            )
        )
        self.norms = nn.ModuleList(nn.BatchNorm3d(width) for width in maps[1:])

    def edges(self, crop: int) -> list[int]:
        """Return the edges of the maps of all layers but the last, for a crop of this edge."""
        found = []
        for stride, padding in self.steps[:-1]:
            crop = (crop + 2 * padding - KERNEL) // stride + 1
            found.append(crop)
        return found

    def forward(self, x: Tensor, layers: int = 0) -> tuple[Tensor, list[Tensor]]:
        """Return the logits, and the features of the first layers after their activation.

        Parameters
        ----------
        x : Tensor
            Shape (batch, channels, z, y, x).
        layers : int, default 0
            How many layers' features are wanted: l₀, l₁ …
        """
        features = []
        for i, layer in enumerate(self.layers[:-1]):
            x = layer(x)
            x = leaky_relu(self.norms[i - 1](x) if i else x, SLOPE)
            if i < layers:
                features.append(x)
        return self.layers[-1](x), features


def patch_strides(layers: int, halvings: int) -> list[tuple[int, int]]:
    """Return strides and paddings of a PatchGAN of this many layers (Isola et al. 2017).

    Parameters
    ----------
    layers : int
        All of them, the last too.
    halvings : int
        Layers of stride 2, the first ones; the others have stride 1. Of five layers two see patches
        of 46 voxels; three see 70, as Isola et al. chose for images of 256, and that is more than a
        crop of 64.
    """
    return [(2, 1)] * halvings + [(1, 1)] * (layers - halvings)


def initialise(network: nn.Module, random: torch.Generator) -> None:
    """Draw the weights as DCGAN does: N(0, 0.02), batch norms around 1, no bias."""
    for module in network.modules():
        if isinstance(module, (nn.Conv3d, nn.ConvTranspose3d)):
            nn.init.normal_(module.weight, 0.0, 0.02, generator=random)
            if module.bias is not None:
                nn.init.zeros_(module.bias)
        elif isinstance(module, nn.BatchNorm3d):
            nn.init.normal_(module.weight, 1.0, 0.02, generator=random)
            nn.init.zeros_(module.bias)
