"""One iteration of training, by either loss."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor, nn

from poresynth.engines.neural.judge import Evaluation
from poresynth.engines.neural.machine import Machine
from poresynth.engines.neural.noise import mix_seed
from poresynth.engines.neural.training import Training
from poresynth.engines.periodic_field.adversarial import critic_loss, generator_loss
from poresynth.engines.periodic_field.critic import Critic
from poresynth.engines.periodic_field.distributions import DistributionLoss
from poresynth.engines.periodic_field.generator import Generator
from poresynth.engines.periodic_field.jets import JetLoss
from poresynth.engines.periodic_field.latent import LatentField
from poresynth.engines.periodic_field.lattice import Cells
from poresynth.engines.periodic_field.parameters import FieldParameters
from poresynth.engines.periodic_field.responses import ResponseLoss
from poresynth.engines.periodic_field.start import Start
from poresynth.engines.periodic_field.windows import Windows, grid_phases

__all__ = ["FieldStep"]

NODES = 4
"""Lines along each axis of the grids of the sliced-Wasserstein loss: 16 points of an image, 64 of a
volume, whose neighbours are a voxel apart in the narrowest."""

# What a seed drawn from that of the training is for.
_FILTERS, _JETS = 2, 3


class FieldStep:
    """What the training loop trains (`poresynth.engines.neural.training.Step`).

    Parameters
    ----------
    parameters : FieldParameters
    windows : Windows
        Of the exemplar, 0 to 1.
    generator : Generator
        Untrained, with its starting period.
    latent : LatentField
    start : Start or None
        What the first iterations are led to.
    judge : callable
        Judges a generator.
    keep : callable
        Takes note of a generator.
    """

    generator = "generator"

    def __init__(
        self,
        parameters: FieldParameters,
        windows: Windows,
        generator: Generator,
        latent: LatentField,
        start: Start | None,
        judge: Callable[[nn.Module], Evaluation],
        keep: Callable[[nn.Module, Evaluation, Training], None],
    ) -> None:
        p = self.parameters = parameters
        self._windows, self._latent, self._start = windows, latent, start
        self.evaluate, self.keep = judge, keep
        field = windows.field
        generator.start_from(field.flatten(1).mean(1).tolist())
        self.notes: dict[str, Any] = {} if start is None else {"start": start.words()}
        # Distances to points do not tell how they change with the period, and where nothing but the
        # latent field tells places apart their spacing is chosen already.
        learned = p.learn_period and not (p.points and not generator.encoded.any())
        generator.scale.requires_grad_(learned)
        networks: dict[str, nn.Module] = {"generator": generator}
        groups: list[dict[str, Any]] = [
            {"params": [generator.scale], "lr": p.period_rate},
            {"params": [t for t in generator.parameters() if t is not generator.scale]},
        ]
        optimizers: dict[str, torch.optim.Optimizer] = {
            "generator": torch.optim.Adam(groups, p.learning_rate, p.betas)
        }
        if p.sliced < p.iterations:
            critic = Critic(
                axes=field.ndim - 1,
                channels=windows.channels,
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
            self._jets: JetLoss | None = None
            if p.jets:
                random.manual_seed(mix_seed(p.training_seed, _JETS))
                self._jets = JetLoss(self._windows, reach=p.reach, places=p.places, random=random)

    def run(self, machine: Machine, iteration: int, random: torch.Generator) -> dict[str, Tensor]:
        """Do one iteration."""
        p = self.parameters
        if self._start is not None and iteration < p.started:
            return self._run_start(machine, self._start, random)
        return (self._run_sliced if iteration < p.sliced else self._run_adversarial)(
            machine, random
        )

    def _run_start(
        self, machine: Machine, start: Start, random: torch.Generator
    ) -> dict[str, Tensor]:
        """Lead the generator to the model that it starts from."""

        def losses() -> dict[str, Tensor]:
            grid = int(torch.randint(len(self._responses.offsets), (), generator=random))
            offsets = list(self._responses.offsets[grid])
            phases, latent, guide = self._points(machine, offsets, self.parameters.places, random)
            made = self._made["generator"](phases, latent, guide)
            return {"start": (made - start(latent, guide)).abs().mean()}

        return machine.update(self.optimizers["generator"], losses)

    def _run_sliced(self, machine: Machine, random: torch.Generator) -> dict[str, Tensor]:
        def losses() -> dict[str, Tensor]:
            loss: DistributionLoss = self._responses
            if self._jets and float(torch.rand((), generator=random)) < self.parameters.jets:
                loss = self._jets
            grid = int(torch.randint(len(loss.offsets), (), generator=random))
            fake = self._fake(machine, list(loss.offsets[grid]), loss.places, random)
            return {"sliced": loss(fake, grid)}

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
        phases, latent, guide = self._points(machine, offsets, count, random)
        made: Tensor = self._made["generator"](phases, latent, guide)
        return made if guide is None else torch.cat([made, guide.to(made.dtype)], dim=1)

    def _points(
        self, machine: Machine, offsets: list[Tensor], count: int, random: torch.Generator
    ) -> tuple[list[Tensor], Tensor, Tensor | None]:
        """Return phases, latent values and guidance of grids of points anywhere in the field."""
        network = self.networks["generator"]
        assert isinstance(network, Generator)
        frequency = network.frequency
        shift = self._shift(machine, count, frequency, random)
        phases = grid_phases(offsets, frequency, shift)

        def numbers(lattices: range, count: int, cells: Cells) -> Tensor:
            shape = (*cells.first.shape[:2], count, *cells.sites)
            return machine.put(2 * torch.rand(shape, generator=random) - 1)

        return phases, self._latent(phases, numbers), self._windows.guides(offsets, count, random)

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
