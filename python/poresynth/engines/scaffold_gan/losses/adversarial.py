"""The adversarial loss (scaffoldgan_2021 Eq. 1)."""

from __future__ import annotations

from typing import Literal

from torch import Tensor
from torch.nn.functional import softplus

__all__ = ["discriminator_loss", "generator_loss"]


def discriminator_loss(real: Tensor, fake: Tensor) -> Tensor:
    """Return −E[log D(x)] − E[log(1 − D(G(z)))].

    Parameters
    ----------
    real, fake : Tensor
        Logits: D is their sigmoid, which is computed within the logarithm so that it does not
        saturate. Any shape; of PatchGAN one logit a patch, over which the loss is a mean.
    """
    return softplus(-real).mean() + softplus(fake).mean()


def generator_loss(fake: Tensor, kind: Literal["non_saturating", "saturating"]) -> Tensor:
    """Return the generator's part.

    Parameters
    ----------
    fake : Tensor
        Logits of what was generated.
    kind : {"non_saturating", "saturating"}
        −E[log D(G(z))], or E[log(1 − D(G(z)))] as Eq. 1 is printed, whose gradient vanishes while
        the discriminator is sure.
    """
    return softplus(-fake).mean() if kind == "non_saturating" else -softplus(fake).mean()
