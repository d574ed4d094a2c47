"""How far slices are from the volume that they were cut from, in their own plane."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from readme import machines
from study import known

import poresynth
from poresynth import metrics
from poresynth.engines.roughness import interface_density
from poresynth.metrics.sections import SECTION_AXES

from .making import RUNS
from .materials import in_order, signed
from .truths import Truth

STUDY = "slices"

Slice = npt.NDArray[np.bool_]

# What is measured in a plane, and what of the volume it bears on.
FIGURES = {
    "interfaces": "interfaces (gradient), %",
    "thickness": "thickness (Tb.Th), %",
    "spacing": "spacing (Tb.Sp), %",
}


def measure(truth: Truth, name: str) -> dict[str, Any]:
    """Hold the slices of a run against all slices of their volume."""
    slices = truth.slices(RUNS[name].images)
    level = poresynth.threshold(truth.volume)
    given = [poresynth.binarize(image, level) for image in slices.images.values()]
    every = [
        np.ascontiguousarray(stack[i : i + 1])
        for axis in SECTION_AXES
        for stack in [metrics.sections(truth.solid, axis).array]
        for i in range(len(stack))
    ]
    own, whole = (np.nanmean([*map(_figures, solids)], axis=0) for solids in (given, every))
    errors = 100 * (own / whole - 1)
    return {
        "study": STUDY,
        "title": truth.title,
        "run": name,
        "slices": slices.places,
        "errors_percent": {
            figure: known(float(error)) for figure, error in zip(FIGURES, errors, strict=True)
        },
    }


def _figures(solid: Slice) -> tuple[float, float, float]:
    """Measure a slice, in the order of `FIGURES`."""
    return interface_density(solid, 0), _thickness(solid), _thickness(~solid)


def _thickness(phase: Slice) -> float:
    """Return the mean local thickness in the plane, NaN without the phase."""
    if not phase.any():
        return float("nan")
    return float(metrics.local_thickness(phase)[phase].mean(dtype=float))


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
        "Of the mean of all slices of the volume, each measured in its plane; in brackets the "
        f"columns above that it bears on. {machines(rows)}.",
    ]
    return "\n".join(lines)
