"""What a field is sampled with, beyond shape and seed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Literal

import numpy as np

from poresynth.engines.periodic_field.guidance import Guidance
from poresynth.errors import ParameterError

__all__ = ["FieldOptions"]

Shape = tuple[int, int, int]


@dataclass(frozen=True, eq=False)
class FieldOptions:
    """What `PeriodicField.sample`, `sample_to` and `sample_field` take beside shape and seed.

    Attributes
    ----------
    guidance : float, (float, float) or numpy.ndarray, optional
        Of an engine that was trained with guidance: a number; two, from the first voxel along x to
        the last; or a map of as many axes as the output, of any shape, whose outermost points are
        the outermost voxels. A density goes from 0, the exemplar's least dense place, to 1, its
        densest; a map is in its own unit. The exemplar's mean by default; of a direction, the line
        or plane that lies in the output as it lay in the exemplar.
    noise_scale : float, default 1.0
        How much farther apart the sites of the latent field are than in training (Fig. 5e).
    latent : {"random", "constant"}, default "random"
        ``"constant"`` gives every point the numbers of one site: a pattern that repeats (§4.4).
    mirrored : bool, default False
        Whether the second half along each axis is the first turned over (§4.4).
    resolution : float, default 1.0
        Voxels of the output in a voxel of the exemplar, along each axis.
    whole : (int, int, int), optional
        Shape of the volume that this is a window of, for guidance, mirrors and a periodic boundary;
        the window's own by default.

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

    @classmethod
    def of(cls, given: Mapping[str, Any]) -> FieldOptions:
        """Return options by name.

        Raises
        ------
        ParameterError
            If a name is unknown, or a value outside what is allowed.
        """
        known = [field.name for field in fields(cls)]
        for name, value in given.items():
            if name not in known:
                allowed = f"is no option of sampling by ipfn; known are {', '.join(known)}"
                raise ParameterError(name, value, allowed)
        return cls(**given)

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
