"""Batch norms of a generator that is about to sample."""

from __future__ import annotations

import torch
from torch import nn

from poresynth.engines.neural.noise import lattice_noise, mix_seed
from poresynth.engines.scaffold_gan.networks import Generator

__all__ = ["calibrate"]

BATCHES, EXTENT = 16, 9
"""Latents of calibration: 16 blocks of 9³, which make as many crops."""


@torch.no_grad()
def calibrate(generator: Generator, seed: int) -> None:
    """Measure the statistics that batch norms use in evaluation mode.

    Averaged weights have statistics of their own (on a scan of bone, D2 was 134 % with those of
    training and 31 % with measured ones); and a generator that was trained on single latents has
    others on a lattice of them, where up to 64 latents add up in each voxel of the first layer
    instead of one. So they are measured on what is sampled: an endless lattice.

    Parameters
    ----------
    generator : Generator
        Left in evaluation mode.
    seed : int
        Of the latents: the same weights have the same statistics.
    """
    norms = [m for m in generator.modules() if isinstance(m, nn.BatchNorm3d)]
    before = [norm.momentum for norm in norms]
    for norm in norms:
        norm.reset_running_stats()
        norm.momentum = None  # The plain mean of all batches.
    generator.train()
    device = next(generator.parameters()).device
    for i in range(BATCHES):
        shape = (EXTENT, EXTENT, EXTENT)
        noise = lattice_noise(mix_seed(seed, i), (0, 0, 0), shape, channels=generator.latent)
        generator(torch.from_numpy(noise)[None].to(device), True)
    generator.eval()
    for norm, momentum in zip(norms, before, strict=True):
        norm.momentum = momentum
