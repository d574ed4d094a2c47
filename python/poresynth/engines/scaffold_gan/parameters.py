"""Parameters, presets and variants of ScaffoldGAN."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field, field_validator

from poresynth.engines.neural.parameters import TrainingParameters
from poresynth.engines.parameters import checked, named
from poresynth.errors import ParameterError

__all__ = ["PRESETS", "VARIANTS", "ScaffoldParameters", "resolve"]


class ScaffoldParameters(TrainingParameters):
    """Every parameter of `ScaffoldGAN`, checked; its docstring says what each means."""

    preset: Literal["tiny", "small", "paper"] = "small"
    variant: Literal["adversarial", "patchgan", "gram", "structural", "full", "extended"] = "full"
    threshold: float | None = None
    solid: Literal["bright", "dark"] = "bright"
    kind: Literal["auto", "gray", "binary", "label"] = "auto"
    latent: int = Field(100, ge=1, le=4096)
    generator_maps: tuple[int, ...] = Field((512, 256, 128, 64), min_length=2, max_length=6)
    discriminator_maps: tuple[int, ...] = Field((64, 128, 256, 512), min_length=2, max_length=6)
    latents: Literal["one", "endless"] = "endless"
    stride: int = Field(2, ge=1)
    symmetry: Literal["none", "flips", "rotations", "full"] = "none"
    keep_axis: Literal["z", "y", "x"] | None = None
    momentum: float = Field(0.5, ge=0, lt=1)
    discriminator_rate: float | None = Field(None, gt=0, le=1)
    generator_loss: Literal["non_saturating", "saturating"] = "non_saturating"
    patch_halvings: int = Field(2, ge=0, le=5)
    structural_weight: float = Field(0.0, ge=0)
    regions: tuple[int, ...] = Field((8, 4, 2), min_length=1, max_length=5)
    region_shapes: Literal["cubes", "cuboids", "both"] = "cubes"
    table: int | None = Field(None, ge=1)
    gram_weight: float = Field(0.0, ge=0)
    gram_slices: int = Field(4, ge=1)
    porosity_weight: float = Field(0.0, ge=0)
    output_bias: bool = False
    two_point_weight: float = Field(0.0, ge=0)
    sliced_weight: float = Field(0.0, ge=0)
    sliced_iterations: int | None = Field(None, ge=0)

    @field_validator("generator_maps", "discriminator_maps")
    @classmethod
    def _maps(cls, maps: tuple[int, ...]) -> tuple[int, ...]:
        if any(not 1 <= m <= 4096 for m in maps):
            raise ValueError("must each be from 1 to 4096 feature maps")
        return maps

    @property
    def crop(self) -> int:
        """Edge of a training sample: 4 voxels, doubled once for each of the generator's maps."""
        return 4 << len(self.generator_maps)

    def check(self) -> None:
        """Check what several parameters have to say to one another."""
        layers = len(self.discriminator_maps)
        if layers != len(self.generator_maps):
            wanted = f"must have as many layers as generator_maps, {len(self.generator_maps)}"
            raise ParameterError("discriminator_maps", self.discriminator_maps, wanted)
        if len(self.regions) > layers:
            raise ParameterError("regions", self.regions, f"must be one a layer, at most {layers}")
        cubes = self.region_shapes == "cubes"
        if any(width < 1 or (not cubes and width % 2) for width in self.regions):
            wanted = "must be at least 1" if cubes else "must be even and at least 2 for cuboids"
            raise ParameterError("regions", self.regions, wanted)
        for i, width in enumerate(self.regions):
            edge, long = self.crop >> (i + 1), width if cubes else 2 * width
            if long > edge:
                wanted = f"must fit into the maps: {long} voxels of layer {i}, whose edge is {edge}"
                raise ParameterError("regions", self.regions, wanted)
        if self.patch_halvings > layers:
            raise ParameterError("patch_halvings", self.patch_halvings, f"must be 0 to {layers}")


VARIANTS: dict[str, dict[str, Any]] = {
    "adversarial": {},
    "patchgan": {},
    "gram": {"gram_weight": 0.1},
    "structural": {"structural_weight": 1.0},
    "full": {"gram_weight": 0.1, "structural_weight": 1.0},
    "extended": {
        "gram_weight": 0.1,
        "structural_weight": 1.0,
        "porosity_weight": 10.0,
        "output_bias": True,
        "two_point_weight": 1.0,
        "sliced_weight": 1.0,
    },
}
"""The losses of each row of the paper's Table 1, and all of ours."""

PRESETS: dict[str, dict[str, Any]] = {
    "paper": {
        "latents": "one",
        "iterations": 40000,
        "batch": 100,
        "learning_rate": 2e-4,
        "evaluate_every": 500,
    },
    "small": {
        "generator_maps": (256, 128, 64, 32),
        "discriminator_maps": (32, 64, 128, 256),
        "iterations": 8000,
        "batch": 16,
        "learning_rate": 2e-4,
        "ema": 0.995,
        "evaluate_every": 200,
        "patience": 15,
        "symmetry": "flips",
        "table": 1024,
    },
    "tiny": {
        "latent": 16,
        "generator_maps": (64, 32, 16),
        "discriminator_maps": (16, 32, 64),
        "regions": (4, 2, 1),
        "table": 256,
        "patch_halvings": 1,
        "iterations": 600,
        "batch": 4,
        "learning_rate": 1e-3,
        "ema": 0.98,
        "evaluate_every": 50,
        "symmetry": "flips",
    },
}
"""What each preset changes against the defaults; it sets all that has none."""


def resolve(given: dict[str, Any]) -> ScaffoldParameters:
    """Check parameters: those given, over those of the variant, over those of the preset.

    Raises
    ------
    ParameterError
        If a parameter is unknown or outside its range, or two do not go together.
    """
    chosen = named(given)
    preset = PRESETS.get(chosen.get("preset", "small"), PRESETS["small"])
    variant = VARIANTS.get(chosen.get("variant", "full"), {})
    parameters = checked(ScaffoldParameters, {**preset, **variant, **chosen})
    parameters.check()
    return parameters
