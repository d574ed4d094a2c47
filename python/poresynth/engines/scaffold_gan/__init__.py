"""ScaffoldGAN (scaffoldgan_2021): networks, losses, training samples, sampling."""

from __future__ import annotations

from poresynth.engines.scaffold_gan.engine import ScaffoldGAN

__all__ = ["ScaffoldGAN"]
