"""What the command `measure` does."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from poresynth import console
from poresynth.workflow.files import read

if TYPE_CHECKING:
    from poresynth.config import ReadConfig

__all__ = ["measure"]


def measure(
    path: Path,
    source: ReadConfig | None,
    *,
    threshold: float | None,
    solid: Literal["bright", "dark"],
    transport: bool,
    threads: int,
) -> dict[str, Any]:
    """Measure a volume and print the numbers; parameters as of `poresynth.metrics.measure`."""
    from poresynth import metrics
    from poresynth.report.words import number

    volume = read(path, source)
    with console.progress("measurement") as progress:
        found = metrics.measure(
            volume,
            threshold=threshold,
            solid=solid,
            transport=transport,
            threads=threads,
            progress=progress,
        )
    rows = []
    for metric in (*metrics.METRICS.values(), *metrics.TRANSPORT_METRICS.values()):
        if metric.name not in found:
            continue
        cells = [metric.name, number(found[metric.name]), metric.unit]
        if volume.unit != "voxel":
            scaled = found.get(f"{metric.name}_in_unit")
            unit = metrics.unit_of(volume.unit, metric.power)
            cells += ["", ""] if not metric.power else [number(scaled), unit]
        rows.append((*cells, metric.description))
    units = () if volume.unit == "voxel" else ("in unit", "of length")
    header = ("figure", "value", "unit", *units, "what it says")
    console.figures(str(path), rows, header)
    return found
