"""What a field is sampled with, beyond shape and seed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from poresynth.engines.periodic_field.guidance import Guidance
from poresynth.errors import ParameterError

__all__ = ["FieldOptions"]

Shape = tuple[int, int, int]


@dataclass(frozen=True, eq=False)
class FieldOptions:
    """The arguments of `PeriodicField.sample` that other engines do not have; see there.

    Raises
    ------
    ParameterError
        If one is outside what is allowed.
    """

    guidance: Guidance | None = None
    noise_scale: float = 1.0
    latent: Literal["random", "constant"] = "random"
    mirrored: bool = False
    resolution: float = 1.0
    whole: Shape | None = None

    def __post_init__(self) -> None:
        """Check what does not depend on the engine."""
        for name in ("noise_scale", "resolution"):
            if not 0 < getattr(self, name) < float("inf"):
                raise ParameterError(name, getattr(self, name), "must be positive and finite")
        if self.latent not in ("random", "constant"):
            raise ParameterError("latent", self.latent, "must be 'random' or 'constant'")

    def provenance(self) -> dict[str, Any]:
        """Return what a result says of its making."""
        guidance: Any = self.guidance
        if isinstance(guidance, (tuple, list)):
            guidance = list(guidance)
        elif isinstance(guidance, np.ndarray):
            guidance = f"a map of shape {guidance.shape}"
        return {
            "guidance": guidance,
            "noise_scale": self.noise_scale,
            "latent": self.latent,
            "mirrored": self.mirrored,
            "resolution": self.resolution,
        }
