"""Engines that make volumes by example."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

from poresynth.errors import ParameterError

if TYPE_CHECKING:
    from poresynth.engines.base import Synthesizer

__all__ = ["ENGINES", "get_engine", "load_model", "saved_parameters"]

# Name on the command line → module and class, imported when first asked for.
ENGINES: dict[str, tuple[str, str]] = {
    "volume": ("poresynth.engines.volume_texture", "VolumeTexture"),
    "solid": ("poresynth.engines.solid_texture", "SolidTexture"),
    "ipfn": ("poresynth.engines.periodic_field", "PeriodicField"),
    "scaffoldgan": ("poresynth.engines.scaffold_gan", "ScaffoldGAN"),
}


def get_engine(name: str) -> type[Synthesizer]:
    """Return the engine class of this name.

    Parameters
    ----------
    name : str
        A key of ``ENGINES``.

    Returns
    -------
    type
        A class that follows `poresynth.engines.base.Synthesizer`.

    Raises
    ------
    ParameterError
        If there is no engine of this name.
    """
    if name not in ENGINES:
        raise ParameterError("engine", name, f"must be one of {', '.join(sorted(ENGINES))}")
    module, attribute = ENGINES[name]
    engine: type[Synthesizer] = getattr(importlib.import_module(module), attribute)
    return engine


def load_model(path: str | Path, *, device: str = "auto") -> Any:
    """Read a trained model, whichever engine made it.

    Parameters
    ----------
    path : path-like
        The folder of a training, or a ``.safetensors`` file.
    device : str, default "auto"
        Where it samples: "auto" takes a GPU if there is one.

    Returns
    -------
    NeuralEngine
        `poresynth.engines.neural.engine.NeuralEngine`, fitted.

    Raises
    ------
    FileError
        If there is no model, or it is damaged.
    MissingExtraError
        If PyTorch is not installed.
    """
    # By name, so that PyTorch is not loaded for the other engines.
    engine = importlib.import_module("poresynth.engines.neural.engine")
    return engine.load_engine(path, device=device)


def saved_parameters(checkpoint: str | Path, engine: str) -> dict[str, Any]:
    """Return the parameters that the training of a checkpoint began with.

    Parameters
    ----------
    checkpoint : path-like
        The file.
    engine : str
        Name of the engine that should have made it.

    Returns
    -------
    dict

    Raises
    ------
    FileError
        If it is missing, damaged, or another engine's.
    """
    files = importlib.import_module("poresynth.engines.neural.checkpoint")
    parameters: dict[str, Any] = files.checkpoint_parameters(checkpoint, engine)
    return parameters
