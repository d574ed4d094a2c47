"""The generator: a multilayer perceptron on encoded coordinates and latent numbers (§3.4)."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torch.nn import functional as F  # noqa: N812 – the name that the field knows

from poresynth.engines.periodic_field.encoding import diagonals, encode, encoded_size

__all__ = ["Generator"]


class Generator(nn.Module):
    """G of ipfn_2022 §3.4: linear layers with ReLU between them and a sigmoid at the end.

    Parameters
    ----------
    axes : int
        2 for images, 3 for volumes.
    channels : int
        Channels of the output.
    latents : int
        Latent values of a point.
    guides : int
        Guidance factors of a point (Eq. 5); 0 without.
    bandwidth : int
        i of Eq. 3.
    diagonal : bool
        Whether sums and differences of the axes' phases are encoded, too.
    width, depth : int
        Width of the hidden layers, and number of layers with the last.

    Notes
    -----
    ``encoded`` is 1 for an axis whose phase the network sees, else 0: then only the latent field
    tells places along it apart, and no place can be special.

    ``scale`` holds a of Eq. 3, one number an axis, relative to ``start``, the period that training
    started from, in pixels or voxels: 1 is that period, 2 half of it. ``spacing`` is the distance
    of the latent field's sites along each axis, as a phase.

    On a grid the first layer is a sum over the axes, each of which has far fewer points than the
    grid: coordinates are encoded, and multiplied by their weights, once an axis.
    """

    start: Tensor
    spacing: Tensor
    encoded: Tensor

    def __init__(
        self,
        *,
        axes: int,
        channels: int,
        latents: int,
        guides: int,
        bandwidth: int,
        diagonal: bool,
        width: int,
        depth: int,
    ) -> None:
        super().__init__()
        self.axes = axes
        self.bandwidth = bandwidth
        self.sums = diagonals(axes) if diagonal else []
        self.scale = nn.Parameter(torch.ones(axes))
        self.register_buffer("start", torch.ones(axes))
        self.register_buffer("spacing", torch.ones(axes))
        self.register_buffer("encoded", torch.ones(axes))
        inputs = (axes + len(self.sums)) * encoded_size(bandwidth) + latents + guides
        self.first = nn.Linear(inputs, width)
        hidden: list[nn.Module] = [nn.ReLU()]
        for _ in range(depth - 2):
            hidden += [nn.Linear(width, width), nn.ReLU()]
        self.hidden = nn.Sequential(*hidden)
        self.last = nn.Linear(width, channels)
        # By PyTorch's own start the field of a new network is flat, and a guided training took some
        # hundred iterations to leave that; now fewer than forty.
        for layer in (self.first, *self.hidden):
            if isinstance(layer, nn.Linear):
                nn.init.kaiming_normal_(layer.weight, nonlinearity="relu")

    def forward(
        self,
        phases: Sequence[Tensor],
        latent: Tensor,
        guidance: Tensor | None = None,
    ) -> Tensor:
        """Return the field on grids.

        Parameters
        ----------
        phases : sequence of Tensor
            a·c along each axis, shape (batch, points).
        latent : Tensor
            Shape (batch, points, …, latent).
        guidance : Tensor, optional
            Shape (batch, guide, points, …).

        Returns
        -------
        Tensor
            Values from 0 to 1, shape (batch, channel, points, …).
        """
        size = encoded_size(self.bandwidth)
        *own, other = torch.split(
            self.first.weight, [*[size] * self.axes, self.first.in_features - size * self.axes], 1
        )
        rest = latent if guidance is None else torch.cat([latent, guidance.movedim(1, -1)], -1)
        sums = [
            encode(_sum(phases, signs), self.bandwidth) * self._seen(signs) for signs in self.sums
        ]
        rest = torch.cat([*sums, rest], -1)
        total = F.linear(rest, other, self.first.bias)  # (batch, points, …, width)
        for axis, (phase, weight) in enumerate(zip(phases, own, strict=True)):
            code = encode(phase, self.bandwidth) * self.encoded[axis]
            part = F.linear(code, weight)  # (batch, points, width)
            shape = [1] * self.axes
            shape[axis] = -1
            total = total + part.reshape(len(part), *shape, part.shape[-1])
        out: Tensor = self.last(self.hidden(total)).sigmoid()
        return out.movedim(-1, 1)

    def _seen(self, signs: Sequence[int]) -> Tensor:
        """Return 1 if every axis of a sum of phases is encoded, else 0."""
        return self.encoded[[sign != 0 for sign in signs]].prod()

    @property
    def channels(self) -> int:
        """Values of a point."""
        return self.last.out_features

    @property
    def device(self) -> torch.device:
        """Where the weights are."""
        return self.scale.device

    @property
    def frequency(self) -> Tensor:
        """Phase of a pixel or voxel along each axis, shape (axis,)."""
        return 2 * self.scale / self.start

    @property
    def period(self) -> tuple[float, ...]:
        """Learned period along each axis, pixels or voxels."""
        return tuple((2 / self.frequency.detach().double()).tolist())

    def start_from(self, means: Sequence[float]) -> None:
        """Let the output begin at these means of the channels: training does not have to go there.

        Parameters
        ----------
        means : sequence of float
            One a channel, 0 to 1.
        """
        with torch.no_grad():
            self.last.bias.copy_(torch.tensor(means).clamp(0.01, 0.99).logit())


def _sum(phases: Sequence[Tensor], signs: Sequence[int]) -> Tensor:
    """Return a sum of phases on the grid, shape (batch, points, …)."""
    axes = len(phases)
    total = phases[0].new_zeros(())
    for axis, (phase, sign) in enumerate(zip(phases, signs, strict=True)):
        shape = [1] * axes
        shape[axis] = -1
        # Without its sign an axis still gives its points.
        total = total + sign * phase.reshape(len(phase), *shape)
    return total
