"""How far slices are from the volume that they were cut from, in their own plane."""

from __future__ import annotations

from functools import cache
from typing import Any

from readme import machines
from study import known

import poresynth
from poresynth.metrics.sections import SECTION_AXES, sections
from poresynth.metrics.slice_statistics import (
    SliceStatistics,
    mean_statistics,
    window_statistics,
)

from .making import RUNS
from .materials import in_order, signed
from .truths import Truth

STUDY = "slices"

# What is measured in a plane, and what of the volume it bears on.
FIGURES = {
    "perimeter": "perimeter (gradient), %",
    "thickness": "thickness (Tb.Th), %",
    "spacing": "spacing (Tb.Sp), %",
}


def measure(truth: Truth, name: str) -> dict[str, Any]:
    """Hold the slices of a run against those of their whole volume."""
    slices = truth.slices(RUNS[name].images)
    level = poresynth.threshold(truth.volume)
    images = [poresynth.binarize(image, level) for image in slices.images.values()]
    own = mean_statistics([found for image in images for found in window_statistics(image)])
    errors = _of_all(truth).errors(own)
    return {
        "study": STUDY,
        "title": truth.title,
        "run": name,
        "slices": slices.places,
        "errors_percent": {figure: known(errors[figure]) for figure in FIGURES},
    }


@cache
def _of_all(truth: Truth) -> SliceStatistics:
    """Measure slices across all axes."""
    stacks = [sections(truth.solid, axis) for axis in SECTION_AXES]
    return mean_statistics([found for stack in stacks for found in window_statistics(stack)])


def table(rows: list[dict[str, Any]]) -> str:
    """The README's table."""
    lines = [
        "| material | slices | " + " | ".join(FIGURES.values()) + " |",
        "|---|---|" + "---|" * len(FIGURES),
    ]
    for row in sorted(rows, key=in_order):
        errors = " | ".join(signed(row["errors_percent"][figure]) for figure in FIGURES)
        lines.append(f"| {row['title']} | {RUNS[row['run']].images} | {errors} |")
    lines += [
        "",
        "Against the mean of 32 slices of the volume across each axis, evenly spaced; in brackets "
        f"the columns above that it bears on. {machines(rows)}.",
    ]
    return "\n".join(lines)
