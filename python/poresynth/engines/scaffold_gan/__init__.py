"""ScaffoldGAN (scaffoldgan_2021): networks, losses, training samples, sampling."""

from __future__ import annotations

# First, for it says in one line what is not installed.
from poresynth.engines import neural as _neural  # noqa: F401
from poresynth.engines.scaffold_gan.engine import ScaffoldGAN

__all__ = ["ScaffoldGAN"]
