"""The adversarial losses of the paper: Wasserstein with gradient penalty (Eq. 1, §4)."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

__all__ = ["critic_loss", "generator_loss", "gradient_penalty"]

Critic = Callable[[Tensor], Tensor]


def gradient_penalty(critic: Critic, real: Tensor, fake: Tensor, mix: Tensor) -> Tensor:
    """Return the mean of (‖∇D‖ − 1)² on the way from fake to real crops (Gulrajani et al. 2017).

    Parameters
    ----------
    critic : callable
        Shape (batch, …) → (batch,).
    real, fake : Tensor
        Crops, shape (batch, …).
    mix : Tensor
        Share of the real crop in each pair, 0 to 1, shape (batch,).

    Returns
    -------
    Tensor
        A number, with derivatives for the critic's weights.
    """
    share = mix.reshape(-1, *[1] * (real.ndim - 1))
    between = (share * real + (1 - share) * fake).detach().requires_grad_(True)
    (gradient,) = torch.autograd.grad(critic(between).sum(), between, create_graph=True)
    # Where the gradient vanishes its norm has no derivative; a tiny square gives it one.
    norm = (gradient.flatten(1).square().sum(1) + 1e-12).sqrt()
    return (norm - 1).square().mean()


def critic_loss(critic: Critic, real: Tensor, fake: Tensor, mix: Tensor, weight: float) -> Tensor:
    """Return what the critic minimises: E[D(fake)] − E[D(real)] + λ · gradient penalty."""
    fake = fake.detach()
    difference = critic(fake).mean() - critic(real).mean()
    return difference + weight * gradient_penalty(critic, real, fake, mix)


def generator_loss(critic: Critic, fake: Tensor) -> Tensor:
    """Return what the generator minimises: −E[D(fake)]."""
    return -critic(fake).mean()
