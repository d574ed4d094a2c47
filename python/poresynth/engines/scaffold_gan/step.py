"""One iteration of ScaffoldGAN: the discriminator, the look-up table, the generator."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import torch
from torch import Tensor, nn

from poresynth.engines.neural.judge import Evaluation
from poresynth.engines.neural.machine import Machine
from poresynth.engines.neural.noise import mix_seed
from poresynth.engines.neural.training import Training
from poresynth.engines.scaffold_gan.crops import Crops, turns
from poresynth.engines.scaffold_gan.lattice import latent_window
from poresynth.engines.scaffold_gan.losses.adversarial import discriminator_loss, generator_loss
from poresynth.engines.scaffold_gan.losses.gram import gram_loss
from poresynth.engines.scaffold_gan.losses.porosity import porosity_loss, soft_solid
from poresynth.engines.scaffold_gan.losses.sliced_wasserstein import (
    random_filters,
    sliced_wasserstein_loss,
)
from poresynth.engines.scaffold_gan.losses.structural import (
    Shape,
    cuboids,
    look_up_table,
    region_grid,
    structural_loss,
)
from poresynth.engines.scaffold_gan.losses.two_point import two_point_loss
from poresynth.engines.scaffold_gan.networks import (
    Discriminator,
    Generator,
    initialise,
    patch_strides,
)
from poresynth.engines.scaffold_gan.parameters import ScaffoldParameters

__all__ = ["ScaffoldStep", "draw_latents"]

# Of random filters: as many and as wide as trained fastest, and places that are sorted.
FILTERS, FILTER_EDGE, FILTER_SCALES, FILTER_PLACES = 24, 6, 2, 4096

Region = tuple[int, Shape, Shape]
"""A layer, the edges of its regions, and the steps between them."""


def draw_latents(count: int, latent: int, extent: int, random: torch.Generator) -> Tensor:
    """Return latents uniform in [−1, 1], shape (count, latent, extent, extent, extent)."""
    return 2 * torch.rand(count, latent, extent, extent, extent, generator=random) - 1


class ScaffoldStep:
    """What ScaffoldGAN hands to the training loop.

    Parameters
    ----------
    parameters : ScaffoldParameters
        All parameters.
    exemplar : Tensor
        What is learnt, scaled to [−1, 1], shape (channels, z, y, x).
    threshold : float
        Of the exemplar's solid, in the same scale: for the soft-porosity loss.
    evaluate, keep : callable
        Of the engine, as in `poresynth.engines.neural.training.Step`.
    """

    generator = "generator"

    def __init__(
        self,
        parameters: ScaffoldParameters,
        exemplar: Tensor,
        threshold: float,
        evaluate: Callable[[nn.Module], Evaluation],
        keep: Callable[[nn.Module, Evaluation, Training], None],
    ) -> None:
        p = self.parameters = parameters
        self.exemplar, self.threshold = exemplar, threshold
        self.evaluate, self.keep = evaluate, keep
        channels = len(exemplar)
        generator = Generator(p.latent, p.generator_maps, channels)
        strides = None
        if p.variant == "patchgan":
            strides = patch_strides(len(p.discriminator_maps) + 1, p.patch_halvings)
        discriminator = Discriminator(p.discriminator_maps, channels, strides)
        self.discriminator = discriminator
        random = torch.Generator().manual_seed(mix_seed(p.training_seed, 0x57EA))
        for network in (generator, discriminator):
            initialise(network, random)
        if p.output_bias:
            # What tanh makes the exemplar's mean of.
            mean = exemplar.mean((1, 2, 3)).clamp(-0.99, 0.99)
            generator.layers[-1].get_parameter("bias").data.copy_(torch.atanh(mean))
        self.notes: dict[str, Any] = {}
        self.networks: dict[str, nn.Module] = {
            "generator": generator,
            "discriminator": discriminator,
        }
        rates = {"generator": p.learning_rate}
        rates["discriminator"] = p.discriminator_rate or p.learning_rate
        self.optimizers: dict[str, torch.optim.Optimizer] = {
            name: torch.optim.Adam(network.parameters(), rates[name], (p.momentum, 0.999))
            for name, network in self.networks.items()
        }
        self.filters = random_filters(FILTERS, channels, FILTER_EDGE, random)
        self.regions = list(_regions(p)) if p.structural_weight else []
        self.layers = len(p.regions) if p.structural_weight or p.gram_weight else 0

    def prepare(self, machine: Machine) -> None:
        """Move networks and exemplar to the machine, and draw the anchors of the look-up table."""
        p = self.parameters
        self._generate = machine.ready(self.networks["generator"])
        self._discriminate = machine.ready(self.networks["discriminator"])
        exemplar = self.exemplar.to(machine.device)
        self.crops = Crops(exemplar, p.crop, p.stride, turns(p.symmetry, p.keep_axis))
        self.filters = self.filters.to(machine.device)
        self.wanted = float(soft_solid(exemplar, self.threshold))
        random = torch.Generator().manual_seed(mix_seed(p.training_seed, 0xA4C4))
        self.anchors = []
        edges = self.discriminator.edges(p.crop)
        for layer, shape, stride in self.regions:
            count = machine.part * math.prod(region_grid([edges[layer]] * 3, shape, stride))
            drawn = None
            if p.table is not None and p.table < count:
                drawn = torch.randperm(count, generator=random)[: p.table].to(machine.device)
            self.anchors.append(drawn)

    def run(self, machine: Machine, iteration: int, random: torch.Generator) -> dict[str, Tensor]:
        """Train the discriminator once, then the generator once."""
        drawn: list[Tensor] = []

        def discriminate() -> dict[str, Tensor]:
            drawn[:] = [machine.put(self.crops.draw(machine.part, random))]
            with torch.no_grad():
                fake = self._fake(machine, random)
            logits = [self._discriminate(batch)[0] for batch in (drawn[0], fake)]
            return {"discriminator": discriminator_loss(*logits)}

        found = machine.update(self.optimizers["discriminator"], discriminate)
        # Of a batch in parts, the last one stands for all in what follows.
        [real] = drawn
        real_features: list[Tensor] = []
        if self.layers:
            # The look-up table is that of the discriminator as it is now.
            with torch.no_grad(), machine.precision():
                real_features = self._discriminate(real, self.layers)[1]
        tables = [
            look_up_table(real_features[layer], shape, stride, anchors)
            for (layer, shape, stride), anchors in zip(self.regions, self.anchors, strict=True)
        ]

        def generate() -> dict[str, Tensor]:
            fake = self._fake(machine, random)
            logits, features = self._discriminate(fake, self.layers)
            losses = {"adversarial": generator_loss(logits, self.parameters.generator_loss)}
            losses |= self._feature_losses(features, real_features, tables)
            return losses | self._volume_losses(fake, real, iteration, random)

        frozen = [self.discriminator]
        return found | machine.update(self.optimizers["generator"], generate, frozen=frozen)

    def _fake(self, machine: Machine, random: torch.Generator) -> Tensor:
        p = self.parameters
        if p.latents == "one":
            z = machine.put(draw_latents(machine.part, p.latent, 1, random))
            fake: Tensor = self._generate(z)
            return fake
        window = latent_window(0, p.crop, len(p.generator_maps))
        z = machine.put(draw_latents(machine.part, p.latent, window.extent, random))
        part = slice(window.offset, window.offset + p.crop)
        endless: Tensor = self._generate(z, True)[:, :, part, part, part]
        return endless

    def _feature_losses(
        self, features: list[Tensor], real: list[Tensor], tables: list[Tensor]
    ) -> dict[str, Tensor]:
        p = self.parameters
        losses = {}
        if p.structural_weight:
            terms = [
                structural_loss(features[layer], table, shape, stride)
                for (layer, shape, stride), table in zip(self.regions, tables, strict=True)
            ]
            shapes = len(terms) // len(p.regions)
            losses["structural"] = p.structural_weight * torch.stack(terms).sum() / shapes
        if p.gram_weight:
            pairs = zip(features, real, strict=True)
            terms = [gram_loss(fake, own, p.gram_slices) for fake, own in pairs]
            losses["gram"] = p.gram_weight * torch.stack(terms).sum()
        return losses

    def _volume_losses(
        self, fake: Tensor, real: Tensor, iteration: int, random: torch.Generator
    ) -> dict[str, Tensor]:
        p = self.parameters
        losses: dict[str, Any] = {}
        if p.porosity_weight:
            loss = porosity_loss(fake, self.threshold, self.wanted)
            losses["porosity"] = p.porosity_weight * loss
        if p.two_point_weight:
            losses["two_point"] = p.two_point_weight * two_point_loss(fake, real, p.crop // 4)
        if p.sliced_weight:
            # It falls to nothing by the end of the start: then it would only hold back.
            until = p.iterations // 4 if p.sliced_iterations is None else p.sliced_iterations
            share = max(0.0, 1 - iteration / until) if until else 0.0
            if share:
                places = torch.rand(FILTER_PLACES, generator=random).to(fake.device)
                loss = sliced_wasserstein_loss(
                    fake, real, self.filters, scales=FILTER_SCALES, places=places
                )
                losses["sliced_wasserstein"] = share * p.sliced_weight * loss
        return losses


def _regions(p: ScaffoldParameters) -> Iterator[Region]:
    """Give the regions of each layer: cubes, cuboids or both, side by side."""
    for layer, width in enumerate(p.regions):
        shapes: list[Shape] = []
        if p.region_shapes != "cuboids":
            shapes.append((width, width, width))
        if p.region_shapes != "cubes":
            shapes.extend(cuboids(width))
        for shape in shapes:
            yield layer, shape, shape
