"""The one training loop of the neural engines.

An engine hands over a `Step`: its networks, its optimisers, what one iteration does, and how a
generator is judged. The loop does the rest: device, precision, several GPUs, gradient accumulation,
learning rates, the moving average of the generator, comparisons with the exemplar, checkpoints, the
log, the early stop, and an end that leaves something usable, whatever ends it.

A minimal engine::

    class Regression:
        generator = "net"

        def __init__(self) -> None:
            self.networks = {"net": torch.nn.Linear(2, 1)}
            self.optimizers = {"net": torch.optim.Adam(self.networks["net"].parameters(), 1e-3)}

        def prepare(self, machine: Machine) -> None:
            self.net = machine.ready(self.networks["net"])

        def run(self, machine, iteration, random) -> dict[str, Tensor]:
            def losses() -> dict[str, Tensor]:
                x = machine.put(torch.rand(machine.part, 2, generator=random))
                return {"square": (self.net(x) - x.sum(1, keepdim=True)).square().mean()}
            return machine.update(self.optimizers["net"], losses)

        def evaluate(self, generator) -> Evaluation: ...
        def keep(self, generator, evaluation, training) -> None: ...

Everything random in `run` comes from ``random``, which the loop seeds from (seed, process,
iteration): a resumed training draws what an uninterrupted one would have drawn. On one device the
two are the same, bit for bit.
"""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
import torch
import torch.distributed as dist
from torch import Tensor, nn

from poresynth import io
from poresynth.engines.base import ProgressCallback
from poresynth.engines.neural.checkpoint import CHECKPOINT, restore_checkpoint, save_checkpoint
from poresynth.engines.neural.judge import Evaluation
from poresynth.engines.neural.log import Log, mid_slices
from poresynth.engines.neural.machine import Machine, processes
from poresynth.engines.neural.memory import explained_memory
from poresynth.engines.neural.noise import mix_seed
from poresynth.engines.neural.parameters import FREE_TO_CHANGE, TrainingParameters
from poresynth.engines.neural.signals import deferred_signals
from poresynth.errors import FileError, ParameterError, TrainingError

__all__ = ["COLLAPSED", "Step", "Training", "train"]

COLLAPSED = 5
"""Comparisons in a row with one phase only, after which a generator that had both is given up: for
one or two of them it comes back."""


@dataclass
class Training:
    """How a training went.

    Attributes
    ----------
    iteration : int
        Iterations done.
    best : dict or None
        Figures of the generator that was kept.
    best_score : float
    best_iteration : int
    stale, one_phase : int
        Comparisons since the best; those of one phase only, without a break.
    seconds : float
        Time of all its runs.
    ended : str
        Why it ended.
    records : list of dict
        The log.
    notes : dict
        What the step says of itself, JSON-compatible.
    """

    iteration: int = 0
    best: dict[str, float] | None = None
    best_score: float = float("inf")
    best_iteration: int = 0
    stale: int = 0
    one_phase: int = 0
    seconds: float = 0.0
    ended: str = ""
    records: list[dict[str, Any]] = field(default_factory=list)
    notes: dict[str, Any] = field(default_factory=dict)

    def facts(self) -> dict[str, Any]:
        """Return what a model says of its training, JSON-compatible."""
        return {
            "iterations": self.iteration,
            "kept": self.best_iteration,
            "figures": self.best,
            "seconds": round(self.seconds, 1),
            "ended": self.ended,
            **self.notes,
        }


class Step(Protocol):
    """What an engine trains.

    Attributes
    ----------
    networks : dict of str to torch.nn.Module
        All that has a state, by name.
    optimizers : dict of str to torch.optim.Optimizer
        By name. The loop multiplies the learning rate of each group by that of the schedule.
    generator : str
        Name of the network that is averaged, judged and kept.
    notes : dict
        What a model says of the training besides its figures, JSON-compatible.
    """

    networks: dict[str, nn.Module]
    optimizers: dict[str, torch.optim.Optimizer]
    generator: str
    notes: dict[str, Any]

    def prepare(self, machine: Machine) -> None:
        """Move everything to the machine; called once, before all else."""

    def run(self, machine: Machine, iteration: int, random: torch.Generator) -> dict[str, Tensor]:
        """Do one iteration, 0 the first; return its losses by name, detached."""

    def evaluate(self, generator: nn.Module) -> Evaluation:
        """Judge a generator, a copy that may be changed. Uses no random numbers but its own."""

    def keep(self, generator: nn.Module, evaluation: Evaluation, training: Training) -> None:
        """Take note of the best generator so far, as `evaluate` left it."""


def train(
    step: Step,
    parameters: TrainingParameters,
    *,
    folder: Path | None = None,
    resume: bool = False,
    identity: Mapping[str, Any] | None = None,
    exemplar: npt.NDArray[Any] | None = None,
    progress: ProgressCallback | None = None,
) -> Training:
    """Train until the iterations are done, the comparison no longer improves, or Ctrl-C.

    Parameters
    ----------
    step : Step
        The engine's.
    parameters : TrainingParameters
        The engine's; all are stored, and compared when a training is resumed.
    folder : Path, optional
        Where checkpoint, log and pictures go; created. None leaves nothing.
    resume : bool, default False
        Go on from the checkpoint in the folder.
    identity : mapping, optional
        What else must be the same to resume, JSON-compatible: the exemplar's hash.
    exemplar : numpy.ndarray, optional
        Shape (z, y, x): shown in the pictures below what the generator made.
    progress : callable, optional
        ``progress(stage, fraction)`` after each iteration. An exception in it ends the training
        like Ctrl-C: after a checkpoint.

    Returns
    -------
    Training

    Raises
    ------
    TrainingError
        If a loss or a weight is not finite, or the generator makes one phase only. The generator
        that was kept and the last checkpoint are left.
    MemoryEstimateError
        If the device has too little memory.
    ParameterError
        If a checkpoint is of another training.
    FileError
        If there is no checkpoint to resume from, or a file cannot be written.
    KeyboardInterrupt
        On Ctrl-C, after the iteration under way and a checkpoint; on a second one at once.
    """
    with processes(parameters.device):
        run = _Run(step, parameters, folder, dict(identity or {}), exemplar, progress)
        # Of cuDNN's algorithms, those that give the same bits again.
        flags = torch.backends.cudnn.flags(enabled=True, benchmark=False, deterministic=True)
        with flags, _same_sums(run.machine.device):
            return run.go(resume)


@contextmanager
def _same_sums(device: torch.device) -> Iterator[None]:
    """Let the threads of a CPU add gradients of gathered values in one order.

    GPUs have no such algorithms for some operations, and would refuse them.
    """
    before = torch.are_deterministic_algorithms_enabled()
    torch.use_deterministic_algorithms(before or device.type == "cpu")
    try:
        yield
    finally:
        torch.use_deterministic_algorithms(before)


class _Run:
    def __init__(
        self,
        step: Step,
        parameters: TrainingParameters,
        folder: Path | None,
        identity: dict[str, Any],
        exemplar: npt.NDArray[Any] | None,
        progress: ProgressCallback | None,
    ) -> None:
        self.step, self.parameters, self.folder = step, parameters, folder
        self.identity, self.exemplar, self.progress = identity, exemplar, progress
        self.machine = Machine(parameters)
        self.training = Training(notes=step.notes)
        self.averaged = copy.deepcopy(step.networks[step.generator])
        self.rates = {
            name: [group["lr"] for group in optimizer.param_groups]
            for name, optimizer in step.optimizers.items()
        }
        self.losses: list[dict[str, float]] = []

    def go(self, resume: bool) -> Training:
        with explained_memory(self.machine.device, self._remedy):
            return self._go(resume)

    def _go(self, resume: bool) -> Training:
        self.step.prepare(self.machine)
        self.averaged.to(self.machine.device)
        if resume:
            self._restore()
        writes = self.folder is not None and self.machine.rank == 0
        with ExitStack() as stack:
            if writes and self.folder is not None:
                try:
                    self.folder.mkdir(parents=True, exist_ok=True)
                except OSError as error:
                    raise FileError.because(self.folder, error) from error
                stack.enter_context(io.claim(self.folder / CHECKPOINT))
            self.log = Log(self.folder if writes else None, self.training.iteration)
            stack.callback(self.log.close)
            self.training.records = self.log.records
            stopped = stack.enter_context(deferred_signals())
            self._loop(stopped)
        return self.training

    def _loop(self, stopped: Callable[[], BaseException | None]) -> None:
        training, last = self.training, self.parameters.iterations
        began = time.monotonic() - training.seconds
        while training.iteration < last and not self._enough():
            self._iterate()
            training.seconds = time.monotonic() - began
            if training.iteration % self.parameters.evaluate_every == 0 or (
                training.iteration == last
            ):
                self._evaluate()
            try:
                self._report()
                reason = stopped()
                if self.machine.agree(reason is not None):
                    raise reason or KeyboardInterrupt
            except BaseException:
                self._save()
                raise
        training.ended = "no better one" if self._enough() else "all iterations"
        if training.best is None:
            raise TrainingError(
                f"the generator never made both phases in {training.iteration} iterations; "
                f"{self._left()}. More iterations, or a lower learning rate, help"
            )

    def _iterate(self) -> None:
        """Do one iteration, and take note of its losses."""
        p, machine, training = self.parameters, self.machine, self.training
        if p.schedule == "cosine":
            factor = 0.5 * (1 + math.cos(math.pi * training.iteration / p.iterations))
            for name, optimizer in self.step.optimizers.items():
                for group, rate in zip(optimizer.param_groups, self.rates[name], strict=True):
                    group["lr"] = rate * factor
        random = torch.Generator()
        random.manual_seed(mix_seed(p.training_seed, machine.rank, training.iteration))
        found = self.step.run(machine, training.iteration, random)
        values = torch.stack([*(v.float() for v in found.values()), self._weights()]).tolist()
        losses = dict(zip(found, values[:-1], strict=True))
        wrong = [f"the loss {n} is" for n, value in losses.items() if not math.isfinite(value)]
        if not math.isfinite(values[-1]):
            # Of this step: a checkpoint of such weights would be none.
            wrong.append("some weights are")
        if machine.agree(bool(wrong)):
            what = wrong[0] if wrong else "a loss of another process is"
            raise TrainingError(
                f"{what} not finite at iteration {training.iteration + 1}; {self._left()}. "
                "A lower learning rate, or bfloat16 instead of float16, helps"
            )
        if p.ema:
            with torch.no_grad():
                generator = self.step.networks[self.step.generator]
                pairs = zip(self.averaged.parameters(), generator.parameters(), strict=True)
                for mean, value in pairs:
                    mean.lerp_(value, 1 - p.ema)
        training.iteration += 1
        self.losses.append(losses)

    def _weights(self) -> Tensor:
        """Return the sum of all weights: a number if all of them are."""
        with torch.no_grad():
            sums = [p.sum() for net in self.step.networks.values() for p in net.parameters()]
            return torch.stack(sums).sum().float()

    def _evaluate(self) -> None:
        """Compare the generator with the exemplar, keep it if it is the best, save everything."""
        machine, training, step = self.machine, self.training, self.step
        machine.average_buffers(step.networks.values())
        generator = step.networks[step.generator]
        if self.parameters.ema:
            pairs = zip(self.averaged.buffers(), generator.buffers(), strict=True)
            for mean, value in pairs:
                mean.copy_(value)
        else:
            self.averaged.load_state_dict(generator.state_dict())
        failure = None
        if machine.rank == 0:
            found = step.evaluate(self.averaged)
            training.one_phase = training.one_phase + 1 if found.one_phase else 0
            score = found.score
            better = score is None or score < training.best_score
            training.stale = 0 if better or training.best is None else training.stale + 1
            if better:
                new = replace(training, best=found.figures, best_iteration=training.iteration)
                step.keep(self.averaged, found, new)
                # Only now, for it may have found no room.
                training.best = found.figures
                training.best_score = float("inf") if score is None else score
                training.best_iteration = training.iteration
            self._write_log(found)
            if training.best is not None and training.one_phase >= COLLAPSED:
                failure = TrainingError(
                    f"the generator has collapsed: {COLLAPSED} times in a row, up to iteration "
                    f"{training.iteration}, all that it made was {found.one_phase}; {self._left()}"
                )
        if machine.agree(failure is not None):
            raise failure or TrainingError("the generator has collapsed")
        self._share()
        self._save()

    def _write_log(self, found: Evaluation) -> None:
        training = self.training
        # One loss may take over from another between two comparisons.
        names = dict.fromkeys(name for one in self.losses for name in one)
        self.log.write(
            {
                "iteration": training.iteration,
                "seconds": round(training.seconds, 2),
                "losses": {
                    n: float(np.mean([one[n] for one in self.losses if n in one])) for n in names
                },
                "figures": found.figures,
                "score": None if found.score == float("inf") else found.score,
                "best": training.best_iteration,
            }
        )
        self.losses.clear()
        if self.exemplar is not None:
            self.log.picture(training.iteration, mid_slices(found.volume, self.exemplar))

    def _enough(self) -> bool:
        return 0 < self.parameters.patience <= self.training.stale

    def _share(self) -> None:
        """Tell the other processes what the first one found: they stop when it does."""
        if self.machine.ranks > 1:
            state: list[Any] = [self.training.best, self.training.stale]
            dist.broadcast_object_list(state, 0)
            self.training.best, self.training.stale = state

    def _report(self) -> None:
        if self.progress is None or self.machine.rank:
            return
        training, last = self.training, self.parameters.iterations
        stage = f"iteration {training.iteration} of {last}"
        if math.isfinite(training.best_score):
            stage += f", best {training.best_score:.1f} % off"
        self.progress(stage, training.iteration / last)

    @property
    def _networks(self) -> dict[str, nn.Module]:
        return {**self.step.networks, "averaged": self.averaged}

    def _save(self) -> None:
        if self.folder is None or self.machine.rank:
            return
        training = self.training
        facts = {
            "iteration": training.iteration,
            "best": training.best,
            "best_score": training.best_score if math.isfinite(training.best_score) else None,
            "best_iteration": training.best_iteration,
            "stale": training.stale,
            "one_phase": training.one_phase,
            "seconds": training.seconds,
            "scaler": self.machine.scaler_state(),
            "parameters": self.parameters.model_dump(mode="json"),
            "identity": self.identity,
        }
        save_checkpoint(self.folder, self._networks, self.step.optimizers, facts)

    def _restore(self) -> None:
        if self.folder is None:
            raise ParameterError("resume", True, "needs the folder of the training")
        facts = restore_checkpoint(self.folder, self._networks, self.step.optimizers)
        for now, then in (
            (self.parameters.model_dump(mode="json"), facts["parameters"]),
            (self.identity, facts["identity"]),
        ):
            for name in sorted({*now, *then} - FREE_TO_CHANGE):
                if now.get(name) != then.get(name):
                    allowed = f"was {then.get(name)} in the training that is to be resumed"
                    raise ParameterError(name, now.get(name), allowed)
        training = self.training
        for name in ("iteration", "best", "best_iteration", "stale", "one_phase", "seconds"):
            setattr(training, name, facts[name])
        if facts["best_score"] is not None:
            training.best_score = facts["best_score"]
        self.machine.load_scaler_state(facts["scaler"])

    def _left(self) -> str:
        """Say what there is to go on from."""
        there = []
        if self.training.best is not None:
            there.append(f"the generator of iteration {self.training.best_iteration} is kept")
        if self.folder is not None and (self.folder / CHECKPOINT).exists():
            there.append(f"the last checkpoint lies in {self.folder}")
        return ", and ".join(there) or "no generator was kept"

    def _remedy(self) -> str:
        """Say what needed memory, what needs less, and what there is to go on from."""
        less = "a smaller batch, or more parts by accumulate, needs less"
        return f"{self.machine.part} crops at once; {less}. {self._left()}"
