"""The critic: strided convolutions, as in DCGAN, without normalisation (§3.4)."""

from __future__ import annotations

from collections.abc import Sequence

from torch import Tensor, nn

from poresynth.errors import ParameterError

__all__ = ["Critic"]


class Critic(nn.Module):
    """D of ipfn_2022 §3.4: convolutions of kernel 4 and stride 2, leaky ReLU, a linear head.

    The gradient penalty is a demand on every crop alone, and batch norm would tie them together:
    there is none (as in the authors' code).

    Parameters
    ----------
    axes : int
        2 for images, 3 for volumes.
    channels : int
        Channels of a crop, with those of the guidance (Eq. 5).
    maps : sequence of int
        Feature maps of the layers; the paper's are 64, 128, 256, 512.
    crop : int
        Edge of a crop in pixels or voxels, at least 2 to the power of the number of layers.

    Raises
    ------
    ParameterError
        If the crop is too small for so many layers.
    """

    def __init__(self, *, axes: int, channels: int, maps: Sequence[int], crop: int) -> None:
        super().__init__()
        edge = crop >> len(maps)
        if edge < 1:
            allowed = f"must be at least {1 << len(maps)} for {len(maps)} layers of the critic"
            raise ParameterError("crop", crop, allowed)
        convolution = nn.Conv2d if axes == 2 else nn.Conv3d
        layers: list[nn.Module] = []
        for size, out in zip([channels, *maps[:-1]], maps, strict=True):
            layers += [convolution(size, out, 4, stride=2, padding=1), nn.LeakyReLU(0.2)]
        self.layers = nn.Sequential(*layers, nn.Flatten(), nn.Linear(maps[-1] * edge**axes, 1))

    def forward(self, crops: Tensor) -> Tensor:
        """Return one score a crop: shape (batch, channel, edge, …) → (batch,)."""
        scores: Tensor = self.layers(crops).squeeze(1)
        return scores
