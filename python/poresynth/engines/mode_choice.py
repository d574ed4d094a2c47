"""Which way of making a volume from images suits a material, by the scores of its sections."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from poresynth import _core
from poresynth.engines.image_fields import ImageField
from poresynth.engines.images import Images, targets
from poresynth.engines.roughness import smoothing_like
from poresynth.engines.solid_parameters import SolidParameters, resolve_mode
from poresynth.metrics.slice_statistics import slice_score

__all__ = ["choose_mode", "example", "options"]

EDGE = 32
"""Edge of the volumes that are compared, voxels of half the resolution: 32 chose as 64 did on nine
materials, in a second and a half instead of four."""

STEPS = 60
"""Steps of response matching at each level of a trial, at most: the rest goes into long shapes, by
which the choice does not go."""

MARGIN = 3.0
"""How many times better the sections must score with neighbourhoods. They thicken features, which
counts of parts and holes do not show: sections of a spinodal scored 10 instead of 22 %, and its
structure error rose from 15 to 27 %; with 35 instead of 17 % on bone it rose, too."""

BEST = 10.0
"""Percent that no trial with neighbourhoods is known to have scored below (15 to 32 % on six
materials, of one slice and of three): where that would not do, there is none."""


def choose_mode(
    images: Images,
    field: ImageField,
    fields: list[npt.NDArray[np.float32]],
    given: dict[str, Any],
    parameters: SolidParameters,
) -> tuple[str, str]:
    """Return the mode, and why in a few words.

    Parameters
    ----------
    images : Images
        The exemplar.
    field : ImageField
        What is synthesised.
    fields : list of numpy.ndarray
        The field of each image, shape (channel, 1, y, x).
    given : dict
        Parameters as given by the user.
    parameters : SolidParameters
        The same, checked; a named mode is taken without a trial.
    """
    if parameters.mode != "auto":
        reason = "as asked" if given.get("mode") else f"of the preset {parameters.preset}"
        return parameters.mode, f"{parameters.mode}, {reason}"
    if images.images[0].channels > 1:
        return "structured", "structured, which keeps colours together"
    if parameters.levels == 1 or len(images.phases.labels) > 2:
        what = "one level" if parameters.levels == 1 else "several phases"
        return "responses", f"responses, for there is no trial of {what}"
    halves = [_halved(own) for own in fields]
    share = 1 - images.phases.porosity
    solids = [_cut(field.scores(half)[0], share) for half in halves]
    wanted = {axis: solids[i] for axis, i in images.axes}

    def score(mode: str) -> float:
        p = resolve_mode(given, mode)
        steps = tuple(min(count, STEPS) for count in p.response_steps)
        p = p.model_copy(update={"levels": p.levels - 1, "response_steps": steps})
        made = _core.synthesize(
            [example(*target) for target in targets(images, p, halves)],
            (EDGE,) * 3,
            options(p, images, field),
            seed=0,
        )[0]
        trial = field.scores(made)
        sigma = smoothing_like(wanted, images.phases.porosity, trial[0], 0)
        if sigma > 0:
            trial = _core.gaussian(trial, sigma, boundary="periodic")
        return slice_score(wanted, _cut(trial[0], share)).percent

    sections = "by the score of sections at half the resolution"
    responses = score("responses")
    if responses < MARGIN * BEST:
        return "responses", f"responses, {sections} ({responses:.1f} %)"
    structured = score("structured")
    best = "structured" if MARGIN * structured < responses else "responses"
    return best, (
        f"{best}, {sections} (responses {responses:.1f} %, structured {structured:.1f} %; "
        f"structured must score {MARGIN:g} times better)"
    )


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


def _halved(field: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Return an image's field at half the resolution."""
    channels, _, ny, nx = field.shape
    whole = field[:, :, : ny // 2 * 2, : nx // 2 * 2]
    blocks = whole.reshape(channels, 1, ny // 2, 2, nx // 2, 2)
    return np.ascontiguousarray(blocks.mean(axis=(3, 5), dtype=np.float32))


def _cut(scores: npt.NDArray[np.float32], share: float) -> npt.NDArray[np.bool_]:
    count = round(share * scores.size)
    return _core.cut_solid(scores.ravel(), count, seed=0).reshape(scores.shape)
