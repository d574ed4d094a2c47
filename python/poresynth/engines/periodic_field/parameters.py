"""Parameters and presets of the periodic-field engine."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from poresynth.engines.neural.parameters import TrainingParameters
from poresynth.engines.parameters import checked, named
from poresynth.engines.periodic_field.start import model_names
from poresynth.errors import ParameterError

__all__ = ["PRESETS", "FieldParameters", "Preset", "resolve"]

Preset = Literal["tiny", "small", "paper"]
Length = Annotated[float, Field(gt=1, le=1e6)]
Fineness = Annotated[int, Field(ge=1, le=64)]
Taps = Annotated[int, Field(ge=1, le=64)]
Maps = Annotated[int, Field(ge=1, le=4096)]


class FieldParameters(TrainingParameters):
    """Every parameter of `PeriodicField`, checked; its docstring says what each means."""

    preset: Preset = "tiny"
    threshold: float | None = None
    solid: Literal["bright", "dark"] = "bright"
    kind: Literal["auto", "gray", "binary", "label"] = "auto"
    field: Literal["auto", "distance", "intensity"] = "auto"
    clip: int = Field(6, ge=1, le=64)
    guidance: Literal["none", "density", "direction", "map"] = "none"
    direction: tuple[float, ...] | None = None
    period: Literal["exemplar", "crop"] | Length | tuple[Length, ...] = "exemplar"
    learn_period: bool = True
    shift: Literal["period", "paper", "none"] = "period"
    encoded: Literal["clear", "all", "none"] = "clear"
    bandwidth: int = Field(1, ge=0, le=12)
    diagonal: bool
    width: int = Field(48, ge=1, le=4096)
    depth: int = Field(4, ge=2, le=64)
    points: tuple[Fineness, ...] = Field((1, 1), max_length=64)
    latents: int = Field(12, ge=1, le=4096)
    groups: int = Field(4, ge=1, le=256)
    octaves: int = Field(2, ge=1, le=8)
    spacing: float | None = Field(None, gt=0, le=16)
    interpolation: Literal["gradient", "quintic", "paper"] = "gradient"
    sigma: float = Field(0.2, gt=0, le=100)
    crop: int = Field(ge=4, le=1024)
    start_iterations: int = Field(200, ge=0)
    start_model: str = "nearest"
    sliced_iterations: int | None = Field(None, ge=0)
    reach: int = Field(ge=4, le=1024)
    grids: int = Field(64, ge=1, le=1 << 12)
    filters: int = Field(64, ge=1, le=1 << 12)
    taps: tuple[Taps, Taps] = (1, 8)
    places: int = Field(1024, ge=16, le=1 << 20)
    jets: float = Field(0.5, ge=0, le=1)
    critic_maps: tuple[Maps, ...] = Field((16, 32, 64), min_length=1, max_length=8)
    critic_steps: int = Field(1, ge=1, le=100)
    generator_steps: int = Field(1, ge=1, le=100)
    penalty: float = Field(10.0, ge=0, le=1e6)
    period_rate: float = Field(2e-3, ge=0, le=1)
    betas: tuple[float, float] = (0.5, 0.9)

    @model_validator(mode="after")
    def _fitting(self) -> FieldParameters:
        if self.latents % self.groups:
            raise ValueError(f"latents = {self.latents} must be a multiple of groups")
        if self.taps[0] > self.taps[1]:
            raise ValueError(f"taps = {self.taps} must be the fewest and the most")
        if not all(0 <= beta < 1 for beta in self.betas):
            raise ValueError(f"betas = {self.betas} must be from 0 to below 1")
        if (self.direction is not None) != (self.guidance == "direction"):
            raise ValueError("direction must come with guidance = 'direction', and only then")
        return self

    @property
    def sliced(self) -> int:
        """Iterations before those with the critic."""
        return self.iterations if self.sliced_iterations is None else self.sliced_iterations

    @property
    def started(self) -> int:
        """Iterations that lead to the start."""
        return min(self.start_iterations, self.sliced)


PRESETS: dict[Preset, dict[int, dict[str, Any]]] = {
    "tiny": {
        axes: {
            "crop": {2: 64, 3: 24}[axes],
            "reach": {2: 64, 3: 32}[axes],
            "latents": {2: 12, 3: 18}[axes],
            "groups": {2: 4, 3: 2}[axes],
            "octaves": {2: 2, 3: 1}[axes],
            "places": {2: 1024, 3: 512}[axes],
            "batch": 4,
            "diagonal": axes == 2,
            "iterations": 600,
            "evaluate_every": 100,
            "learning_rate": 3e-3,
            "schedule": "cosine",
            "ema": 0.98,
        }
        for axes in (2, 3)
    },
    "small": {
        axes: {
            "width": 96,
            "depth": 6,
            "bandwidth": 2,
            "points": (1, 1, 1, 1),
            "latents": 32,
            "groups": 4,
            "crop": {2: 96, 3: 32}[axes],
            "reach": {2: 96, 3: 48}[axes],
            "batch": 8,
            "grids": 256,
            "places": 2048,
            "diagonal": axes == 2,
            "iterations": 6000,
            "evaluate_every": 500,
            "learning_rate": 2e-3,
            "schedule": "cosine",
            "ema": 0.99,
        }
        for axes in (2, 3)
    },
    "paper": {
        axes: {
            "shift": "paper",
            "encoded": "all",
            "bandwidth": 5,
            "width": 128,
            "depth": 10,
            "points": (),
            "jets": 0.0,
            "latents": 5,
            "groups": 1,
            "octaves": 1,
            "spacing": 1.0,
            "interpolation": "paper",
            "crop": {2: 128, 3: 64}[axes],
            "reach": {2: 128, 3: 64}[axes],
            "batch": 8,
            "start_iterations": 0,
            "sliced_iterations": 0,
            "critic_maps": (64, 128, 256, 512),
            "critic_steps": 5,
            "generator_steps": 5,
            "diagonal": False,
            "iterations": 12500,
            "evaluate_every": 500,
            "learning_rate": 1e-4,
            "period_rate": 1e-4,
            "period": "crop",
        }
        for axes in (2, 3)
    },
}
"""What each preset says of images (2) and of volumes (3), against the defaults."""

_BY_CRITIC: dict[str, Any] = PRESETS["tiny"][2] | {
    "sliced_iterations": 300,
    "jets": 0.0,
    "critic_maps": (24, 48, 96),
    "learning_rate": 1e-3,
    "period_rate": 1e-4,
}
COLOURS: dict[Preset, dict[str, Any]] = {
    "tiny": _BY_CRITIC | {"width": 64, "iterations": 2000, "evaluate_every": 500},
    "small": _BY_CRITIC
    | {"width": 96, "depth": 5, "bandwidth": 3, "iterations": 6000, "evaluate_every": 1000},
    "paper": PRESETS["paper"][2],
}
"""What each preset says of images of several channels: by the sliced loss alone colours come out as
grains, so that it is but the beginning."""


def resolve(given: dict[str, Any], axes: int, channels: int = 1) -> FieldParameters:
    """Check parameters, with those of the preset under those that are given.

    Parameters
    ----------
    given : dict
        Parameters by name; None stands for the preset's own value.
    axes : int
        2 for images, 3 for volumes.
    channels : int, default 1
        Of the exemplar.

    Returns
    -------
    FieldParameters

    Raises
    ------
    ParameterError
        If a parameter is unknown or outside its range.
    """
    chosen = named(given)
    presets = COLOURS if axes == 2 and channels > 1 else {p: PRESETS[p][axes] for p in PRESETS}
    # A preset that is unknown is refused with the other parameters.
    preset = presets.get(chosen.get("preset", "tiny"), presets["tiny"])
    found = checked(FieldParameters, {**preset, **chosen})
    known = ["nearest", *model_names(axes)]
    if found.start_model not in known:
        raise ParameterError("start_model", found.start_model, f"must be one of {known}")
    return found
