"""Where training computes: device, precision, gradient accumulation, and several GPUs.

Several GPUs work as several processes, one each, that ``torchrun`` starts; every process draws its
own crops and noise, and gradients are averaged before each optimiser step. That is done by hand,
not by `DistributedDataParallel`: its hooks expect one forward pass and one backward pass a step,
and an adversarial iteration has several of both.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from typing import Any

import torch
import torch.distributed as dist
from torch import Tensor, nn

from poresynth.engines.neural.parameters import TrainingParameters
from poresynth.errors import ParameterError

__all__ = ["Machine", "choose_device", "first_process", "processes"]

DTYPES = {"float32": torch.float32, "bfloat16": torch.bfloat16, "float16": torch.float16}


def choose_device(name: str) -> torch.device:
    """Return the device of this name; "auto" is this process's GPU if there is one.

    Raises
    ------
    ParameterError
        If there is no such device.
    """
    if name == "auto":
        if torch.cuda.is_available():
            return torch.device("cuda", int(os.environ.get("LOCAL_RANK", "0")))
        return torch.device("mps" if torch.backends.mps.is_available() else "cpu")
    try:
        device = torch.device(name)
        torch.empty(1, device=device)
    except (RuntimeError, AssertionError) as error:
        allowed = f"must be one that PyTorch has here ({str(error).splitlines()[0]})"
        raise ParameterError("device", name, allowed) from None
    return device


class Machine:
    """What a training step computes with.

    Attributes
    ----------
    device : torch.device
    rank, ranks : int
        Number of this process, and of all.
    part : int
        Crops that a network sees at once: batch / (accumulate · ranks).
    """

    def __init__(self, parameters: TrainingParameters) -> None:
        self.device = choose_device(parameters.device)
        self.rank, self.ranks = 0, 1
        if dist.is_initialized():
            self.rank, self.ranks = dist.get_rank(), dist.get_world_size()
        self.accumulate = parameters.accumulate
        self.part, rest = divmod(parameters.batch, parameters.accumulate * self.ranks)
        if rest:
            processes = f"{self.ranks} processes × {self.accumulate} parts"
            raise ParameterError("batch", parameters.batch, f"must be a multiple of {processes}")
        self.parameters = parameters
        scaled = parameters.precision == "float16"
        self._scaler = torch.amp.GradScaler(self.device.type, enabled=scaled)

    def ready(self, network: nn.Module) -> Callable[..., Any]:
        """Move a network here, with the same weights in all processes; return what to call."""
        network.to(self.device)
        if self.parameters.channels_last:
            network.to(memory_format=torch.channels_last_3d)
        if self.ranks > 1:
            for tensor in network.state_dict().values():
                dist.broadcast(tensor, 0)
        call: Callable[..., Any] = torch.compile(network) if self.parameters.compile else network
        return call

    def put(self, batch: Tensor) -> Tensor:
        """Move crops or noise here, in the memory order of the networks."""
        batch = batch.to(self.device, non_blocking=True)
        if self.parameters.channels_last and batch.ndim == 5:
            return batch.to(memory_format=torch.channels_last_3d)
        return batch

    def precision(self) -> AbstractContextManager[object]:
        """Return the context in which products and convolutions have the wanted precision."""
        name = self.parameters.precision
        return torch.autocast(self.device.type, DTYPES[name], enabled=name != "float32")

    def update(
        self,
        optimizer: torch.optim.Optimizer,
        losses: Callable[[], Mapping[str, Tensor]],
        *,
        frozen: Iterable[nn.Module] = (),
    ) -> dict[str, Tensor]:
        """Take one step of an optimiser.

        Parameters
        ----------
        optimizer : torch.optim.Optimizer
        losses : callable
            Draws ``part`` crops and returns losses by name; their sum is minimised. Called
            ``accumulate`` times.
        frozen : iterable of torch.nn.Module
            Networks that the gradient passes through, but that do not learn from it.

        Returns
        -------
        dict of Tensor
            The losses, means over the parts, detached.
        """
        held = [p for network in frozen for p in network.parameters() if p.requires_grad]
        totals: dict[str, Tensor] = {}
        optimizer.zero_grad(set_to_none=True)
        try:
            for p in held:
                p.requires_grad_(False)
            for _ in range(self.accumulate):
                with self.precision():
                    parts = losses()
                total = torch.stack([value.float() for value in parts.values()]).sum()
                self._scaler.scale(total / self.accumulate).backward()  # type: ignore[no-untyped-call]
                for name, value in parts.items():
                    share = value.detach().float() / self.accumulate
                    totals[name] = totals[name] + share if name in totals else share
        finally:
            for p in held:
                p.requires_grad_(True)
        learning = (p for group in optimizer.param_groups for p in group["params"])
        self._average([p.grad for p in learning if p.grad is not None])
        self._scaler.step(optimizer)
        self._scaler.update()
        return totals

    def average_buffers(self, networks: Iterable[nn.Module]) -> None:
        """Give running statistics the mean of all processes."""
        self._average([b for net in networks for b in net.buffers() if b.is_floating_point()])

    def agree(self, flag: bool) -> bool:
        """Return whether any process says so: all then do the same."""
        if self.ranks == 1:
            return flag
        said = torch.tensor(float(flag), device=self.device)
        dist.all_reduce(said, dist.ReduceOp.MAX)
        return bool(said.item())

    def scaler_state(self) -> dict[str, Any]:
        """Return the state of the gradient scaler, JSON-compatible; empty unless float16."""
        return dict(self._scaler.state_dict())

    def load_scaler_state(self, state: Mapping[str, Any]) -> None:
        """Go on with a gradient scaler's state."""
        if state:
            self._scaler.load_state_dict(dict(state))

    def _average(self, tensors: list[Tensor]) -> None:
        if self.ranks == 1 or not tensors:
            return
        flat = torch.cat([t.detach().reshape(-1) for t in tensors])
        dist.all_reduce(flat)
        flat /= self.ranks
        parts = torch.split(flat, [t.numel() for t in tensors])
        for tensor, part in zip(tensors, parts, strict=True):
            tensor.detach().copy_(part.view_as(tensor))


def first_process() -> bool:
    """Return whether this process writes files: alone, or the first that ``torchrun`` started."""
    return int(os.environ.get("RANK", "0")) == 0


@contextmanager
def processes(device: str) -> Iterator[None]:
    """Join the processes that ``torchrun`` started, if it did, and leave them at the end."""
    if int(os.environ.get("WORLD_SIZE", "1")) == 1 or dist.is_initialized():
        yield
        return
    chosen = choose_device(device)
    if chosen.type == "cuda":
        torch.cuda.set_device(chosen)
    dist.init_process_group("nccl" if chosen.type == "cuda" else "gloo")
    try:
        yield
    finally:
        dist.destroy_process_group()
