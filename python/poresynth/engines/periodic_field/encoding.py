"""The periodic encoding of coordinates (ipfn_2022 Eq. 3)."""

from __future__ import annotations

import itertools
import math

import torch
from torch import Tensor

__all__ = ["diagonals", "encode", "encoded_size"]


def diagonals(axes: int) -> list[tuple[int, ...]]:
    """Return the sums of phases that are encoded beside the axes' own: 2 of images, 10 of volumes.

    Each is a sign or 0 an axis, the first sign positive. A lattice that is not rectangular, such as
    a honeycomb, is a sum of waves along its diagonals, but a product of waves along the axes, which
    networks this small did not learn: they made square lattices instead.
    """
    return [
        signs
        for signs in itertools.product((0, 1, -1), repeat=axes)
        if sum(map(abs, signs)) > 1 and next(s for s in signs if s) > 0
    ]


def encoded_size(bandwidth: int) -> int:
    """Return the features of one axis: a cosine and a sine of the octaves 0 … bandwidth."""
    return 2 * (bandwidth + 1)


def encode(phase: Tensor, bandwidth: int) -> Tensor:
    """Return γ of Eq. 3 for one axis.

    Parameters
    ----------
    phase : Tensor
        a·c along one axis, any shape. One period of the encoding is a phase of 2.
    bandwidth : int
        i of Eq. 3: the highest octave, whose wavelength is the period / 2^i.

    Returns
    -------
    Tensor
        Shape (…, 2 (bandwidth + 1)): cos(2⁰π a c), sin(2⁰π a c), …, cos(2^i π a c), sin(2^i π a c).
    """
    octaves = phase.new_tensor([math.pi * 2**octave for octave in range(bandwidth + 1)])
    angle = phase[..., None] * octaves  # (…, octave)
    return torch.stack([angle.cos(), angle.sin()], dim=-1).flatten(-2)
