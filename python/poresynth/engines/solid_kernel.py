"""What is made of images, as the kernel takes it."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from poresynth.engines.image_fields import ImageField
from poresynth.engines.images import Images
from poresynth.engines.point_models import PointModel
from poresynth.engines.solid_parameters import SolidParameters

__all__ = ["example", "first_values", "options"]


def first_values(
    model: PointModel, shape: tuple[int, int, int], p: SolidParameters, seed: int, threads: int = 0
) -> npt.NDArray[np.float32]:
    """Return what a volume of a shape starts from at the coarsest level, shape (1, z, y, x)."""
    scale = 1 << (p.levels - 1)
    z, y, x = (-(-n // scale) for n in shape)
    return model.field((z, y, x), scale, seed, threads)


def example(
    axis: int, field: npt.NDArray[np.float32], symmetric: bool, weight: float
) -> dict[str, Any]:
    """Return an image across an axis as the kernel takes it."""
    return {
        "field": field,
        "symmetry": "full" if symmetric else "none",
        "keep_axis": None,
        "normal": axis,
        "weight": weight,
    }


def options(p: SolidParameters, images: Images, field: ImageField) -> dict[str, Any]:
    """Return parameters as the kernel takes them."""

    def at(values: tuple[Any, ...], level: int) -> Any:
        """Return the value of a level, of values from coarse to fine; the last one goes on."""
        return values[min(p.levels - 1 - level, len(values) - 1)]

    levels = [
        {
            "stages": p.stages(),
            "iterations": at(p.iterations, level),
            "filters": p.filters,
            "filter_edge": p.filter_edge,
            "deep": at(p.deep, level),
            "alike": images.alike,
            "regularisation": field.regularisation,
            "detail": field.detail,
            "response_steps": (at(p.response_steps, level), p.final_steps if level == 0 else 0),
            "search": p.search,
            "candidates": p.candidates,
            "temperature": 0.0,
            "bandwidth": at(p.bandwidth, level) or None,
            "relaxation": at(p.relaxation, level),
            "mode_steps": p.mode_steps,
        }
        for level in range(p.levels)
    ]
    shared = p.model_dump(
        include={
            "tolerance", "components", "variance", "index_weight", "exponent", "emphasis",
            "match_histogram",
        }
    )  # fmt: skip
    return {
        **shared,
        "levels": levels,
        "start": "random_field" if p.filters > 0 else "voxels",
        "block": 1,
        "starts": 1,
        "patience": 3 if p.tolerance > 0 else 1001,
        "run_penalty": 0.0,
        "run_reach": 1,
        "adaptive": False,
        "gradient": 0.0,
        "boundary": "periodic",
    }
