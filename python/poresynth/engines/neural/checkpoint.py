"""Checkpoints: all that a training needs to go on exactly.

Tensors of networks and optimisers stand under ``network.<name>.<key>`` and
``optimizer.<name>.<parameter>.<key>`` in one safetensors file, which also holds the facts: the
iteration, the parameters, the best score. Random numbers need no state: they are functions of
seed, process and iteration.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from poresynth.engines.neural.files import below, read_tensors, write_tensors
from poresynth.errors import FileError

__all__ = ["CHECKPOINT", "checkpoint_parameters", "restore_checkpoint", "save_checkpoint"]

CHECKPOINT = "checkpoint.safetensors"


def save_checkpoint(
    folder: Path,
    networks: Mapping[str, nn.Module],
    optimizers: Mapping[str, torch.optim.Optimizer],
    facts: Mapping[str, Any],
) -> None:
    """Write the state of a training, in place of the one before.

    Parameters
    ----------
    folder : Path
    networks, optimizers : mapping
        By name.
    facts : mapping
        What else is to be known, JSON-compatible.

    Raises
    ------
    FileError
        If it cannot be written; the one before is then left.
    """
    tensors: dict[str, Tensor] = {}
    groups = {}
    for name, network in networks.items():
        for key, tensor in network.state_dict().items():
            tensors[f"network.{name}.{key}"] = tensor
    for name, optimizer in optimizers.items():
        state = optimizer.state_dict()
        groups[name] = state["param_groups"]
        for index, entry in state["state"].items():
            for key, value in entry.items():
                tensors[f"optimizer.{name}.{index}.{key}"] = torch.as_tensor(value)
    write_tensors(folder / CHECKPOINT, tensors, {**facts, "param_groups": groups})


def restore_checkpoint(
    folder: Path,
    networks: Mapping[str, nn.Module],
    optimizers: Mapping[str, torch.optim.Optimizer],
) -> dict[str, Any]:
    """Give networks and optimisers the state of a checkpoint; return its facts.

    Raises
    ------
    FileError
        If there is none, or it is damaged or of other networks.
    """
    path = folder / CHECKPOINT
    tensors, facts = _read(path)
    try:
        for name, network in networks.items():
            network.load_state_dict(below(f"network.{name}.", tensors))
        for name, optimizer in optimizers.items():
            state: dict[int, dict[str, Tensor]] = {}
            for key, tensor in below(f"optimizer.{name}.", tensors).items():
                index, _, entry = key.partition(".")
                state.setdefault(int(index), {})[entry] = tensor
            groups = facts["param_groups"][name]
            optimizer.load_state_dict({"state": state, "param_groups": groups})
    except (RuntimeError, KeyError, ValueError) as error:
        said = str(error).splitlines()[0]
        raise FileError(f"{path}: a checkpoint of other networks ({said})") from error
    return facts


def checkpoint_parameters(path: str | Path, engine: str) -> dict[str, Any]:
    """Return the parameters of the training that a checkpoint belongs to.

    Raises
    ------
    FileError
        If it is missing, damaged, or another engine's.
    """
    facts = _read(Path(path))[1]
    made_by = facts["identity"].get("engine")
    if made_by != engine:
        raise FileError(f"{path}: a checkpoint of the engine {made_by}, not {engine}")
    parameters: dict[str, Any] = facts["parameters"]
    return parameters


def _read(path: Path) -> tuple[dict[str, Tensor], dict[str, Any]]:
    if not path.exists():
        raise FileError(f"{path.parent}: holds no checkpoint to resume from")
    return read_tensors(path, "a checkpoint")
