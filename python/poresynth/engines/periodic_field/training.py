"""One iteration of training, by either loss."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor, nn

from poresynth.engines.neural.judge import Evaluation
from poresynth.engines.neural.machine import Machine
from poresynth.engines.neural.noise import mix_seed
from poresynth.engines.neural.training import Training
from poresynth.engines.periodic_field.adversarial import critic_loss, generator_loss
from poresynth.engines.periodic_field.critic import Critic
from poresynth.engines.periodic_field.generator import Generator
from poresynth.engines.periodic_field.latent import LatentField
from poresynth.engines.periodic_field.parameters import FieldParameters
from poresynth.engines.periodic_field.responses import ResponseLoss
from poresynth.engines.periodic_field.windows import Windows, grid_phases

__all__ = ["FieldStep"]

NODES = 4
"""Lines along each axis of the grids of the sliced-Wasserstein loss: 16 points of an image, 64 of a
volume, whose neighbours are a voxel apart in the narrowest."""

# What a seed drawn from that of the training is for.
_FILTERS = 2


class FieldStep:
    """What the training loop trains (`poresynth.engines.neural.training.Step`).

    Parameters
    ----------
    parameters : FieldParameters
    field : numpy.ndarray
        The exemplar's, −1 to 1, shape (channel, edge, …).
    guide : numpy.ndarray or None
        Its guidance factor, shape (1, edge, …).
    generator : Generator
        Untrained, with its starting period.
    latent : LatentField
    judge : callable
        Judges a generator.
    keep : callable
        Takes note of a generator.
    """

    generator = "generator"

    def __init__(
        self,
        parameters: FieldParameters,
        field: npt.NDArray[np.float32],
        guide: npt.NDArray[np.float32] | None,
        generator: Generator,
        latent: LatentField,
        judge: Callable[[nn.Module], Evaluation],
        keep: Callable[[nn.Module, Evaluation, Training], None],
    ) -> None:
        p = self.parameters = parameters
        shown = (field + 1) / 2
        self._windows = Windows(
            torch.from_numpy(np.ascontiguousarray(shown)),
            None if guide is None else torch.from_numpy(np.ascontiguousarray(guide)),
            p.crop if p.guidance == "density" else None,
        )
        self._latent = latent
        self.evaluate, self.keep = judge, keep
        generator.start_from(shown.reshape(len(field), -1).mean(1).tolist())
        networks: dict[str, nn.Module] = {"generator": generator}
        groups: list[dict[str, Any]] = [
            {"params": [generator.scale], "lr": p.period_rate if p.learn_period else 0.0},
            {"params": [t for t in generator.parameters() if t is not generator.scale]},
        ]
        optimizers: dict[str, torch.optim.Optimizer] = {
            "generator": torch.optim.Adam(groups, p.learning_rate, p.betas)
        }
        if p.sliced < p.iterations:
            critic = Critic(
                axes=field.ndim - 1,
                channels=self._windows.channels,
                maps=p.critic_maps,
                crop=p.crop,
            )
            networks["critic"] = critic
            optimizers["critic"] = torch.optim.Adam(critic.parameters(), p.learning_rate, p.betas)
        self.networks, self.optimizers = networks, optimizers

    def prepare(self, machine: Machine) -> None:
        """Move everything to the machine, and sort the exemplar's responses."""
        p = self.parameters
        self._made = {name: machine.ready(network) for name, network in self.networks.items()}
        self._windows = self._windows.to(machine.device)
        if p.sliced:
            random = torch.Generator()
            random.manual_seed(mix_seed(p.training_seed, _FILTERS))
            self._responses = ResponseLoss(
                self._windows,
                reach=p.reach,
                nodes=NODES,
                grids=p.grids,
                filters=p.filters,
                taps=p.taps,
                places=p.places,
                random=random,
            )

    def run(self, machine: Machine, iteration: int, random: torch.Generator) -> dict[str, Tensor]:
        """Do one iteration."""
        if iteration < self.parameters.sliced:
            return self._run_sliced(machine, random)
        return self._run_adversarial(machine, random)

    def _run_sliced(self, machine: Machine, random: torch.Generator) -> dict[str, Tensor]:
        responses = self._responses

        def losses() -> dict[str, Tensor]:
            grid = int(torch.randint(len(responses.offsets), (), generator=random))
            offsets = list(responses.offsets[grid])
            fake = self._fake(machine, offsets, responses.places, random)
            return {"sliced": responses(fake, grid)}

        return machine.update(self.optimizers["generator"], losses)

    def _run_adversarial(self, machine: Machine, random: torch.Generator) -> dict[str, Tensor]:
        p, critic = self.parameters, self._made["critic"]
        offsets = [torch.arange(p.crop)] * (self._windows.field.ndim - 1)
        found: dict[str, Tensor] = {}

        def of_critic() -> dict[str, Tensor]:
            with torch.no_grad():
                fake = self._fake(machine, offsets, machine.part, random)
            real = self._windows.draw(offsets, machine.part, random)
            mix = machine.put(torch.rand(machine.part, generator=random))
            return {"critic": critic_loss(critic, real, fake, mix, p.penalty)}

        def of_generator() -> dict[str, Tensor]:
            fake = self._fake(machine, offsets, machine.part, random)
            return {"generator": generator_loss(critic, fake)}

        for _ in range(p.critic_steps):
            found |= machine.update(self.optimizers["critic"], of_critic)
        for _ in range(p.generator_steps):
            found |= machine.update(
                self.optimizers["generator"], of_generator, frozen=[self.networks["critic"]]
            )
        return found

    def _fake(
        self, machine: Machine, offsets: list[Tensor], count: int, random: torch.Generator
    ) -> Tensor:
        """Return grids of points that the generator makes, with guidance as further channels."""
        p, network = self.parameters, self.networks["generator"]
        assert isinstance(network, Generator)
        frequency = network.frequency
        shift = self._shift(machine, count, frequency, random)
        phases = grid_phases(offsets, frequency, shift)

        def numbers(first: Tensor, sites: tuple[int, ...]) -> Tensor:
            shape = (*first.shape[:2], p.latents // p.groups, *sites)
            return machine.put(2 * torch.rand(shape, generator=random) - 1)

        latent = self._latent(phases, numbers)
        guide = self._windows.guides(offsets, count, random)
        made: Tensor = self._made["generator"](phases, latent, guide)
        return made if guide is None else torch.cat([made, guide.to(made.dtype)], dim=1)

    def _shift(
        self, machine: Machine, count: int, frequency: Tensor, random: torch.Generator
    ) -> Tensor:
        """Return the phase of the first point of each grid, shape (count, axis)."""
        p = self.parameters
        uniform = machine.put(torch.rand(count, len(frequency), generator=random))
        if p.shift == "period":
            return 2 * uniform
        # The paper's coordinates of a crop go from −1 to 1, and are shifted by up to 4.
        scale = frequency * (p.crop - 1) / 2
        return scale * ((8 * uniform - 4 if p.shift == "paper" else 0 * uniform) - 1)
