"""Engines that make volumes by example."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from poresynth.errors import ParameterError

if TYPE_CHECKING:
    from poresynth.engines.base import Synthesizer

__all__ = ["ENGINES", "get_engine"]

# Name on the command line → module and class, imported when first asked for.
ENGINES: dict[str, tuple[str, str]] = {
    "volume": ("poresynth.engines.volume_texture", "VolumeTexture"),
    "solid": ("poresynth.engines.solid_texture", "SolidTexture"),
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
