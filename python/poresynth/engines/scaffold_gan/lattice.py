"""Which latents a window of the output depends on: the exact halo of transposed convolutions.

A transposed convolution of kernel 4, stride 2 and padding 1 adds input i to outputs 2i − 1 to
2i + 2; the first one, of stride 1 and no padding, to i to i + 3. So the window [a, b) of the output
needs, one doubling after another, inputs ⌈(a − 2)/2⌉ to ⌊b/2⌋, and of the first layer those from 3
before the first on. On an endless lattice of latents every voxel is defined, and a window of it is
computed from the latents that it needs by cutting each layer to the outputs that have all their
inputs: as padding 3 in the first layer and 2 in the others.
"""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["LatentWindow", "latent_window"]


class LatentWindow(NamedTuple):
    """The latents of a window along one axis.

    Attributes
    ----------
    start, extent : int
        First latent, and how many.
    offset : int
        Where the window begins in what the generator makes of them.
    """

    start: int
    extent: int
    offset: int


def latent_window(start: int, stop: int, doublings: int) -> LatentWindow:
    """Return the latents that voxels [start, stop) of the output depend on.

    Parameters
    ----------
    start, stop : int
        Any integers, start < stop.
    doublings : int
        Transposed convolutions of stride 2.
    """
    low, high = start, stop
    for _ in range(doublings):
        low, high = -((2 - low) // 2), high // 2 + 1
    low -= 3
    # The first output that has all its inputs: low + 3, then 2 i + 1 a doubling.
    first = low + 3
    for _ in range(doublings):
        first = 2 * first + 1
    return LatentWindow(low, high - low, start - first)
