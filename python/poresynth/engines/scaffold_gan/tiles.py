"""The endless volume of a generator, in tiles."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import torch

from poresynth.engines.neural.noise import lattice_noise
from poresynth.engines.scaffold_gan.lattice import latent_window
from poresynth.engines.scaffold_gan.networks import Generator

__all__ = ["GeneratorTiles", "tile_edge"]


def tile_edge(crop: int) -> int:
    """Return the edge of a tile for crops of this edge: what lies around it is then a third.

    With four doublings 128³ voxels are made of 130³, and layer by layer of 66³, 34³, 18³ and 10³
    where 64³, 32³, 16³ and 8³ are needed.
    """
    return 2 * crop


class GeneratorTiles:
    """The volume that a generator makes of the latents of a seed.

    Parameters
    ----------
    generator : Generator
        In evaluation mode: its batch norms are then fixed, and a voxel depends on nothing but the
        few latents around it.
    seed : int
        Of the latents.
    crop : int
        Edge of the training samples.
    period : (int, int, int), optional
        Voxels after which the volume repeats, multiples of the spacing of the latents.
    """

    def __init__(
        self,
        generator: Generator,
        seed: int,
        crop: int,
        period: tuple[int, int, int] | None = None,
    ) -> None:
        self.generator, self.seed = generator, seed
        edge = tile_edge(crop)
        self.edge = (edge, edge, edge)
        self.channels = generator.channels
        self.device = next(generator.parameters()).device
        spacing = 1 << generator.doublings
        self.period = None if period is None else [n // spacing for n in period]

    def __call__(self, index: tuple[int, int, int]) -> npt.NDArray[np.float32]:
        """Return a tile, shape (channels, edge, edge, edge)."""
        edge, generator = self.edge[0], self.generator
        windows = [latent_window(i * edge, (i + 1) * edge, generator.doublings) for i in index]
        noise = lattice_noise(
            self.seed,
            [w.start for w in windows],
            [w.extent for w in windows],
            channels=generator.latent,
            period=self.period,
        )
        made = generator(torch.from_numpy(noise)[None].to(self.device), True)[0]
        z, y, x = (slice(w.offset, w.offset + edge) for w in windows)
        tile: npt.NDArray[np.float32] = made[:, z, y, x].float().cpu().numpy()
        return tile
