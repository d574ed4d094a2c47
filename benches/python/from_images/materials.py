"""What is made of slices of a material, held against the slices and against their volume."""

from __future__ import annotations

import itertools
import math
import statistics
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt
from readme import machines
from study import known, solids, structure_and_novelty

from poresynth import metrics
from poresynth.comparison import compare_sections
from poresynth.metrics.registry import METRICS, finite_mean
from poresynth.metrics.specimen import Specimen
from poresynth.volume import Volume

from .making import RUNS, Made, Run, synthesise
from .truths import CONNECTED, TRUTHS, Slices, Truth

Phase = npt.NDArray[np.bool_]

STUDY = "material"

# The seven of prieto_2011, Figure 7, as the registry calls them, with the names of the paper.
SEVEN = {
    "bv_tv": "BV/TV",
    "bs_bv": "BS/BV",
    "tb_th": "Tb.Th",
    "tb_n": "Tb.N",
    "tb_sp": "Tb.Sp",
    "mil_mean": "MIL",
    "euler_density": "Euler",
}


def make(truth: Truth, run: Run, edge: int, seeds: int) -> tuple[Slices, Made]:
    """Choose the slices of a material, and make volumes of them."""
    slices = truth.slices(run.images)
    given: dict[str, Any] = {"preset": run.preset}
    if connected(truth.title, run):
        given["connected"] = "solid"
    return slices, synthesise([*slices.images.values()], edge, seeds, **given)


def connected(title: str, run: Run) -> bool:
    """Whether the engine is told that the solid is one piece; the papers' methods cannot be."""
    return title in CONNECTED and run.preset == "quality"


def measure(truth: Truth, name: str, edge: int, seeds: int) -> dict[str, Any]:
    """Make the volumes of a row and judge them."""
    slices, made = make(truth, RUNS[name], edge, seeds)
    return {
        "study": STUDY,
        "title": truth.title,
        "run": name,
        "seeds": seeds,
        "edge": edge,
        "slices": slices.places,
        "mode": made.mode,
        "connected": connected(truth.title, RUNS[name]),
        "against_slice": against_slice(slices, made.volumes),
        "against_volume": against_volume(truth, slices, made.volumes),
        **made.seconds(),
    }


def against_slice(slices: Slices, volumes: list[Volume]) -> dict[str, Any]:
    """Judge volumes by their sections: means over the seeds."""
    found = [compare_sections(slices.to_compare(), volume).figures for volume in volumes]
    names = ("porosity_error_percent", "two_point_error_percent", "slice_score_percent")
    return {
        name: known(statistics.mean(figures[name].value for figures in found)) for name in names
    }


def against_volume(truth: Truth, slices: Slices, volumes: list[Volume]) -> dict[str, Any]:
    """Judge volumes by the one that the slices are of, cut at its threshold."""
    own, others = solids(truth.volume, volumes)
    porosity = metrics.porosity(own)
    largest = metrics.largest_component_fraction(own)
    shares = [metrics.largest_component_fraction(solid) - largest for solid in others]
    pooled = structure_and_novelty(truth.volume, volumes, own, others, len(volumes))
    noises = [found["noise_percent"] for found in pooled["differences"].values()]
    gradients = [metrics.gradient_ratio(truth.volume, volume) for volume in volumes]
    errors = [100 * abs(metrics.porosity(solid) - porosity) / porosity for solid in others]
    return {
        "porosity_error_percent": known(statistics.mean(errors)),
        "two_point_error_percent": known(
            statistics.mean(metrics.two_point_error(own, solid) for solid in others)
        ),
        "slice_two_point_error_percent": known(truth.slice_error(slices)),
        "gradient_error_percent": known(100 * (statistics.mean(gradients) - 1)),
        "worst_largest_component_difference": known(max(shares, key=abs)),
        **pooled,
        "structure_noise_percent": known(
            finite_mean([min(n, 100.0) for n in noises if n is not None])
        ),
        "seven": seven(own, others),
    }


def seven(own: Phase, others: list[Phase]) -> dict[str, dict[str, Any]]:
    """Hold the seven parameters against their spread over the octants of the known volume.

    The volume that is judged is measured in octants of the same size.
    """
    edge = min(min(solid.shape) for solid in (own, *others)) // 2
    known_ones = _parameters([own], edge)
    new = _parameters(others, edge)
    found = {}
    for name in SEVEN:
        spread = [values[name] for values in known_ones if math.isfinite(values[name])]
        value = finite_mean([values[name] for values in new])
        low, high = min(spread, default=math.nan), max(spread, default=math.nan)
        found[name] = {
            "value": known(value),
            "lowest": known(low),
            "highest": known(high),
            "inside": low <= value <= high,
        }
    return found


def _parameters(phases: list[Phase], edge: int) -> list[dict[str, float]]:
    """Measure the octants of volumes."""
    specimens = (Specimen(part) for phase in phases for part in _octants(phase, edge))
    return [{name: float(METRICS[name].function(s)) for name in SEVEN} for s in specimens]


def _octants(phase: Phase, edge: int) -> Iterator[Phase]:
    """Cut a cube of so many voxels at each corner."""
    for corner in itertools.product(*((0, n - edge) for n in phase.shape)):
        yield np.ascontiguousarray(phase[tuple(slice(start, start + edge) for start in corner)])


def in_order(row: dict[str, Any]) -> tuple[int, int]:
    """Where a row stands in the table."""
    return TRUTHS.index(row["title"]), [*RUNS].index(row["run"])


def table(rows: list[dict[str, Any]]) -> str:
    """The README's table."""
    lines = [
        "| material | made with | volumes | slice: porosity, % | slice: D2, % | porosity, % "
        "| D2 (of the slices), % | gradient, % | largest part | Tb.Th, % | Tb.Sp, % | Euler, % "
        "| structure error, % | novelty 12 | of seven | CPU seconds |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|",
        *("| " + " | ".join(_cells(row)) + " |" for row in sorted(rows, key=in_order)),
        "",
        "First against the slices: errors of the porosity, and of the correlation of sections. "
        "Then against the volume that the slices were cut from, in brackets the error of the "
        "slices' own correlation; ±: standard error of what is compared, for the structure error "
        "the mean over its quantities. Of seven: parameters of bone (prieto_2011, Figure 7), means "
        "over octants, inside the range over the known volume's octants. Means of several volumes, "
        "but the worst largest part; the time is that of one volume with its fit, of all cores "
        "together. †: with "
        f'`connected="solid"`. {machines(rows)}. One material again: '
        "`python benches/python/images.py bone`; one row: `--runs prieto`.",
    ]
    return "\n".join(lines)


def _cells(row: dict[str, Any]) -> list[str]:
    image, volume = row["against_slice"], row["against_volume"]
    differences = volume["differences"]

    def difference(name: str) -> str:
        found = differences[name]
        return with_noise(signed(found["error_percent"]), found["noise_percent"])

    return [
        row["title"],
        RUNS[row["run"]].title + (" †" if row["connected"] else ""),
        f"{row['seeds']} × {row['edge']}³",
        plain(image["porosity_error_percent"], 2),
        plain(image["two_point_error_percent"], 1),
        plain(volume["porosity_error_percent"], 1),
        f"{plain(volume['two_point_error_percent'], 1)} "
        f"({plain(volume['slice_two_point_error_percent'], 1)})",
        signed(volume["gradient_error_percent"]),
        signed(volume["worst_largest_component_difference"], 4),
        difference("tb_th"),
        difference("tb_sp"),
        difference("euler_density"),
        with_noise(plain(volume["structure_error_percent"], 1), volume["structure_noise_percent"]),
        plain(volume["novelty_12"], 2),
        _inside(volume["seven"]),
        plain(row["cpu_seconds"], 0),
    ]


def _inside(found: dict[str, dict[str, Any]]) -> str:
    out = [title for name, title in SEVEN.items() if not found[name]["inside"]]
    return f"{len(SEVEN) - len(out)}" + (f" (not {', '.join(out)})" if out else "")


def plain(value: float | None, digits: int) -> str:
    """A number, or that there is none."""
    return "–" if value is None else f"{value:.{digits}f}"


def signed(value: float | None, digits: int = 1) -> str:
    """A number with its sign."""
    return "–" if value is None else f"{value:+.{digits}f}".replace("-", "−")


def with_noise(value: str, noise: float | None) -> str:
    """A number with its standard error."""
    return value if noise is None else f"{value} ± {noise:.1f}"
