"""Engines that make volumes by example."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from poresynth.errors import ParameterError

if TYPE_CHECKING:
    from poresynth.engines.base import Synthesizer

__all__ = ["ENGINES", "Entry", "get_engine", "load_model", "saved_parameters"]


@dataclass(frozen=True)
class Entry:
    """Where an engine is, and what is known of it before it is imported.

    Attributes
    ----------
    module, attribute : str
        Its class, imported when first asked for.
    learns_from : {"volume", "images", "either"}
        What its `fit` takes.
    most : int
        How many of them at once.
    trains : bool
        Whether `fit` trains a network: it takes long, and reports its progress.
    turns : bool
        Whether `sample` takes fields of orientation and scale.
    bricks : bool
        Whether `sample_to` writes a volume brick by brick.
    """

    module: str
    attribute: str
    learns_from: Literal["volume", "images", "either"] = "volume"
    most: int = 1
    trains: bool = False
    turns: bool = False
    bricks: bool = False


ENGINES = {
    "volume": Entry("poresynth.engines.volume_texture", "VolumeTexture", turns=True, bricks=True),
    "solid": Entry("poresynth.engines.solid_texture", "SolidTexture", learns_from="images", most=3),
    "ipfn": Entry(
        "poresynth.engines.periodic_field", "PeriodicField", learns_from="either", trains=True
    ),
    "scaffoldgan": Entry("poresynth.engines.scaffold_gan", "ScaffoldGAN", trains=True),
}
"""The engines, by their names on the command line."""


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
    entry = ENGINES[name]
    module = importlib.import_module(entry.module)
    engine: type[Synthesizer] = getattr(module, entry.attribute)
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
