"""Parameters, presets and modes of the solid-texture engine."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from poresynth.engines.parameters import checked, named

__all__ = ["MODES", "SOLID_PRESETS", "Axis", "SolidParameters", "resolve_mode"]

Axis = Literal["z", "y", "x"]
Window = Annotated[int, Field(ge=2, le=32)]
Step = Annotated[int, Field(ge=1)]
Count = Annotated[int, Field(ge=0, le=1000)]
Weight = Annotated[float, Field(gt=0, le=100)]
Width = Annotated[float, Field(ge=0, le=1000)]
Share = Annotated[float, Field(gt=0, le=1)]


class SolidParameters(BaseModel):
    """Every parameter of `SolidTexture`, checked; its docstring says what each means."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    preset: Literal["quality", "prieto", "kopf", "chen_wang"] = "quality"
    mode: Literal["auto", "responses", "cells", "structured"] = "auto"
    axes: tuple[Axis, ...] | None = Field(None, min_length=1, max_length=3)
    weights: tuple[Weight, ...] | None = None
    symmetric: bool | None = None
    threshold: float | None = None
    solid: Literal["bright", "dark"] = "bright"
    kind: Literal["auto", "gray", "binary", "label"] = "auto"
    connected: Literal["none", "solid", "pore", "both"] = "none"
    field: Literal["auto", "distance", "intensity"] = "auto"
    clip: int = Field(12, ge=1, le=64)
    feature: Literal["none", "distance"] = "none"
    feature_weight: float = Field(1.0, gt=0, le=10)
    smoothing: float | None = Field(None, ge=0, le=5)
    levels: int = Field(3, ge=1, le=6)
    filters: int = Field(16, ge=0, le=256)
    filter_edge: int | None = Field(None, ge=2, le=32)
    response_steps: tuple[Count, ...] = Field((300, 60, 15), min_length=1)
    deep: tuple[bool, ...] = Field((False, True, False), min_length=1)
    final_steps: int = Field(0, ge=0, le=1000)
    windows: tuple[Window, ...] = Field((8,), min_length=1, max_length=8)
    steps: tuple[Step, ...] | None = None
    iterations: tuple[Count, ...] = Field((0,), min_length=1)
    tolerance: float = Field(0.0, ge=0, lt=1)
    components: int = Field(32, ge=1, le=256)
    variance: float = Field(0.95, gt=0, le=1)
    search: Literal["coherent", "kd_tree", "brute_force"] = "coherent"
    candidates: int = Field(10, ge=1)
    index_weight: Literal["off", "literal", "normalised"] = "off"
    emphasis: Literal["none", "histogram", "position"] = "none"
    match_histogram: bool = True
    exponent: float = Field(0.8, ge=0, le=2)
    bandwidth: tuple[Width, ...] = Field((0.0,), min_length=1)
    mode_steps: int = Field(0, ge=0, le=20)
    relaxation: tuple[Share, ...] = Field((1.0,), min_length=1)

    @field_validator("axes")
    @classmethod
    def _axes(cls, axes: tuple[Axis, ...] | None) -> tuple[Axis, ...] | None:
        if axes is not None and len(set(axes)) < len(axes):
            raise ValueError("must each be named once")
        return axes

    @model_validator(mode="after")
    def _stages(self) -> SolidParameters:
        steps = self.steps
        if steps is not None and (
            len(steps) != len(self.windows)
            or any(s > w for s, w in zip(steps, self.windows, strict=True))
        ):
            raise ValueError(f"steps {steps} must be one a window, none larger: {self.windows}")
        return self

    def stages(self) -> list[tuple[int, int]]:
        """Return the (window, lattice step) pairs of a level, in voxels."""
        steps = self.steps or tuple(max(1, w // 4) for w in self.windows)
        return list(zip(self.windows, steps, strict=True))


MODES: dict[str, dict[str, Any]] = {
    "responses": {},
    "cells": {"response_steps": (30, 20, 15)},
    "structured": {
        "response_steps": (40, 15, 10),
        "deep": (False,),
        "iterations": (20, 10, 2),
    },
}
"""What each mode changes against the defaults."""

# Texture optimisation as published: no responses, images as they are, their own values. Histograms
# are matched after every iteration in all of them: by weights alone, rocks of low porosity become
# one phase. The papers take the nearest window that their tree finds: with 3 instead of 10 that are
# ranked again the search takes half the time, and sections score as well.
_PUBLISHED: dict[str, Any] = {
    "mode": "structured",
    "symmetric": False,
    "field": "intensity",
    "smoothing": 0.0,
    "filters": 0,
    "response_steps": (0,),
    "iterations": (30,),
    "tolerance": 0.005,
    "components": 64,
    "candidates": 3,
}

SOLID_PRESETS: dict[str, dict[str, Any]] = {
    "quality": {},
    "prieto": {**_PUBLISHED, "windows": (9,), "steps": (2,), "search": "kd_tree"},
    "kopf": {
        **_PUBLISHED,
        "steps": (2,),
        "search": "kd_tree",
        "emphasis": "histogram",
        "bandwidth": (40.0,),
        "mode_steps": 3,
    },
    "chen_wang": {
        **_PUBLISHED,
        "steps": (2,),
        "index_weight": "normalised",
        "emphasis": "position",
        "bandwidth": (1.0,),
        "mode_steps": 1,
    },
}
"""What each preset changes against the defaults."""


def resolve_mode(given: dict[str, Any], mode: str | None = None) -> SolidParameters:
    """Check parameters, with those of mode and preset under those that are given.

    Parameters
    ----------
    given : dict
        Parameters by name; None stands for the preset's own value.
    mode : {"responses", "cells", "structured"}, optional
        Which mode, where "auto" is asked for; the parameters are then of that mode.

    Raises
    ------
    ParameterError
        If a parameter is unknown or outside its range.
    """
    chosen = named(given)
    preset = SOLID_PRESETS.get(chosen.get("preset", "quality"), {})
    values = {**preset, **chosen}
    if mode is not None and values.get("mode", "auto") == "auto":
        values["mode"] = mode
    of_mode = {} if "preset" in chosen and preset else MODES.get(values.get("mode", "auto"), {})
    return checked(SolidParameters, {**of_mode, **values})
