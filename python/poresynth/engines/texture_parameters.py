"""Parameters and presets of the volume-texture engine."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator

from poresynth.engines.parameters import checked, named
from poresynth.errors import ParameterError

__all__ = ["PRESETS", "TextureParameters", "resolve"]


class TextureParameters(BaseModel):
    """Every parameter of `VolumeTexture`, checked; its docstring says what each means."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    preset: Literal["quality", "fast", "paper"] = "quality"
    threshold: float | None = None
    solid: Literal["bright", "dark"] = "bright"
    kind: Literal["auto", "gray", "binary", "label"] = "auto"
    field: Literal["auto", "distance", "intensity"] = "auto"
    clip: int = Field(6, ge=1, le=64)
    smoothing: float = Field(0.5, ge=0, le=5)
    levels: int = Field(3, ge=1, le=6)
    windows: tuple[int, ...] = Field((10, 8, 4), min_length=1, max_length=8)
    steps: tuple[int, ...] | None = None
    iterations: int = Field(12, ge=1, le=1000)
    tolerance: float = Field(0.005, ge=0, lt=1)
    block: int = Field(8, ge=1)
    starts: int | None = Field(None, ge=1, le=1000)
    components: int = Field(32, ge=1, le=256)
    variance: float = Field(0.95, gt=0, le=1)
    symmetry: Literal["none", "flips", "rotations", "full"] = "none"
    keep_axis: Literal["z", "y", "x"] | None = None
    search: Literal["coherent", "kd_tree", "brute_force"] = "coherent"
    candidates: int = Field(10, ge=1)
    index_weight: Literal["off", "literal", "normalised"] = "off"
    run_penalty: float = Field(0.5, ge=0)
    run_reach: int = Field(12, ge=1)
    temperature: float = Field(0.02, ge=0, le=10)
    exponent: float = Field(0.1, ge=0, le=2)
    adaptive: bool = False
    gradient: float = Field(0.0, ge=0, le=10)

    @field_validator("windows")
    @classmethod
    def _windows(cls, windows: tuple[int, ...]) -> tuple[int, ...]:
        if any(not 2 <= w <= 32 for w in windows):
            raise ValueError("must each be from 2 to 32 voxels")
        return windows

    @field_validator("steps")
    @classmethod
    def _steps(cls, steps: tuple[int, ...] | None) -> tuple[int, ...] | None:
        if steps is not None and any(s < 1 for s in steps):
            raise ValueError("must each be at least 1 voxel")
        return steps

    def stages(self) -> list[tuple[int, int]]:
        """Return the (window, lattice step) pairs of a level, in voxels."""
        steps = self.steps or tuple(max(1, w // 2) for w in self.windows)
        if len(steps) != len(self.windows) or any(
            s > w for s, w in zip(steps, self.windows, strict=True)
        ):
            raise ParameterError(
                "steps", steps, f"must be one a window, none larger than it: {self.windows}"
            )
        return list(zip(self.windows, steps, strict=True))

    def trials(self) -> int:
        """Return how many volumes are begun at the coarsest level."""
        return self.starts or (8 if self.levels > 2 else 1)


PRESETS: dict[str, dict[str, Any]] = {
    "quality": {},
    "fast": {"levels": 2, "windows": (8, 4), "iterations": 6, "temperature": 0.0},
    "paper": {
        "field": "intensity",
        "levels": 2,
        "iterations": 30,
        "components": 40,
        "search": "kd_tree",
        "index_weight": "literal",
        "run_penalty": 0.0,
        "temperature": 0.0,
        "exponent": 0.8,
        "adaptive": True,
        "gradient": 0.1,
    },
}
"""What each preset changes against the defaults."""


def resolve(given: dict[str, Any]) -> TextureParameters:
    """Check parameters, with those of the preset under those that are given.

    Parameters
    ----------
    given : dict
        Parameters by name; None stands for the preset's own value.

    Returns
    -------
    TextureParameters

    Raises
    ------
    ParameterError
        If a parameter is unknown or outside its range.
    """
    chosen = named(given)
    return checked(
        TextureParameters, {**PRESETS.get(chosen.get("preset", "quality"), {}), **chosen}
    )
