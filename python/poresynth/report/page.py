"""The page of a report: what stands on it, in which order, in which words."""

from __future__ import annotations

import datetime
import json
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from poresynth.report import html
from poresynth.volume import Volume

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.axes import Axes

    from poresynth.comparison import Comparison
    from poresynth.report.figures import Theme

__all__ = ["render"]

# Headings of the table of figures, by the beginnings of the figures' names.
GROUPS = {
    "What tells good from poor": ("end_point", "euler_density", "structure_error"),
    "Amount and correlation": ("porosity", "phase", "two_point"),
    "Connectivity": ("component", "floating", "largest", "connectivity"),
    "Sizes and shapes": ("bv_", "bs_", "tb_", "mil_", "branch_", "solid_chord", "pore_chord"),
    "Gray values": ("histogram", "gradient", "seam"),
    "Novelty": ("novelty", "copy", "mean_copied"),
}
OTHER = "More"
# What the correlations are of.
TWO_POINT = {
    "two_point": "averaged over all directions.",
    "two_point_z": "along z.",
    "two_point_y": "along y.",
    "two_point_x": "along x.",
}
# The parameters of the box plots of prieto_2011, Fig. 7.
BOXES = ("bv_tv", "bs_bv", "tb_th", "tb_n", "tb_sp", "mil_mean", "euler_density")
NOVELTY = re.compile(r"novelty_(\d+)$")
# Width of a row of surfaces in pixels: twice the width on the page, for sharp screens.
SURFACE_PIXELS = 1600
# In voxels: smaller pixels show nothing more.
SMALLEST_PIXEL = 1 / 6


def render(
    exemplar: Volume,
    volume: Volume,
    comparison: Comparison,
    energy: Sequence[Any] | None,
    configuration: Mapping[str, Any] | None,
    command: str | None,
    now: datetime.datetime,
) -> str:
    """Return the page; see `poresynth.report.write_report` for the parameters."""
    from poresynth import __version__

    origin = volume.metadata.get("poresynth", {})
    facts = {
        "exemplar": _describe(exemplar),
        "new volume": _describe(volume),
        "engine": _engine(origin),
        "seed": str(origin.get("seed", "not recorded")),
        "boundary": str(origin.get("boundary", "not recorded")),
        "made with": f"poresynth {origin.get('version', '(not recorded)')}",
        "reported": f"{now:%Y-%m-%d %H:%M %Z}, poresynth {__version__}",
        "synthesised": str(origin.get("field_reason", "not recorded")),
    }
    sections = [
        html.Section("Figures", html.figures_table(_groups(comparison))),
        html.Section("Surfaces", _surfaces(exemplar, volume, comparison)),
        html.Section("Slices", _slices(exemplar, volume)),
        html.Section("Curves", _charts(comparison, energy)),
    ]
    if configuration is not None:
        sections.append(html.Section("Configuration", html.code(_toml(configuration))))
    if command is not None:
        sections.append(html.Section("The command that repeats the run", html.code(command)))
    return html.page(
        "A new volume beside its exemplar",
        "How alike the two are, measured in the same way, and how much of the new one is new.",
        facts,
        sections,
        f"poresynth {__version__}. The same numbers for programs: report.json.",
    )


def _toml(document: Mapping[str, Any]) -> str:
    """Write a configuration as it can be given back: plain values are the same in JSON and TOML."""

    def line(key: str, value: Any) -> str:
        return f"{key} = {json.dumps(value, ensure_ascii=False)}"

    plain, tables = [], []
    for key, value in document.items():
        if isinstance(value, Mapping):
            tables += ["", f"[{key}]", *(line(*item) for item in value.items())]
        else:
            plain.append(line(key, value))
    return "\n".join([*plain, *tables])


def _describe(volume: Volume) -> str:
    size = " × ".join(str(edge) for edge in volume.shape)
    if volume.unit == "voxel":
        return f"{size} voxels"
    sizes = sorted(set(volume.voxel_size))
    edges = " × ".join(f"{edge:g}" for edge in (sizes if len(sizes) == 1 else volume.voxel_size))
    return f"{size} voxels of {edges} {volume.unit}"


def _engine(origin: Mapping[str, Any]) -> str:
    if "engine" not in origin:
        return "not recorded"
    preset = origin.get("parameters", {}).get("preset")
    return f"{origin['engine']}, preset {preset}" if preset else str(origin["engine"])


def _groups(comparison: Comparison) -> dict[str, list[Any]]:
    groups: dict[str, list[Any]] = {heading: [] for heading in (*GROUPS, OTHER)}
    for name, figure in comparison.figures.items():
        fitting = (h for h, starts in GROUPS.items() if name.startswith(starts))
        groups[next(fitting, OTHER)].append(figure)
    return {heading: figures for heading, figures in groups.items() if figures}


def _caption(name: str, part: Volume, whole: Volume) -> str:
    return name if part.shape == whole.shape else f"{name}, its central part"


def _surfaces(exemplar: Volume, volume: Volume, comparison: Comparison) -> str:
    from poresynth.metrics.structure import Structure, first_channel
    from poresynth.report.render3d import surface_picture
    from poresynth.report.slices import central_part, png

    structure = Structure(comparison.kind, comparison.threshold, comparison.solid)
    edges = max(exemplar.shape) + max(central_part(volume, exemplar).shape)
    pixel = max(1.4 * edges / SURFACE_PIXELS, SMALLEST_PIXEL)
    row = []
    for name, whole in (("exemplar", exemplar), ("new volume", volume)):
        solid = whole.with_array(structure.cut(first_channel(whole, name)))
        part = central_part(solid, exemplar)
        picture = surface_picture(part.array, exemplar.voxel_size, pixel)
        row.append(html.Picture(png(picture), picture.shape[1], _caption(name, part, whole)))
    says = (
        "<p>The solid, cut at the exemplar's threshold, seen along the same direction and at the "
        "same scale; the first axis points up, the faces where the block was cut are ochre.</p>"
    )
    return says + html.pairs([row], None, "surfaces")


def _slices(exemplar: Volume, volume: Volume) -> str:
    from poresynth.preprocess import is_two_valued
    from poresynth.report import slices

    window = slices.gray_window(exemplar.array)
    shown = [("exemplar", exemplar, window)]
    # Two values are black and white, whatever numbers they are.
    own = slices.gray_window(volume.array) if is_two_valued(volume.array) else window
    shown.append(("new volume", volume, own))
    rows = []
    for direction, across, right in slices.DIRECTIONS:
        row = []
        for name, whole, (black, white) in shown:
            part = slices.central_part(whole, exemplar)
            picture = slices.slice_picture(part, across, (black, white))
            width = part.shape[right] * exemplar.voxel_size[right]
            caption = _caption(f"{name}, {direction}", part, whole)
            row.append(html.Picture(picture, width, caption))
        rows.append(row)
    bar = slices.scale_bar(min(picture.width for row in rows for picture in row), exemplar.unit)
    says = "<p>Middle slices in three directions, at one scale and with one range of grays.</p>"
    return says + html.pairs(rows, bar, "voxels")


def _charts(comparison: Comparison, energy: Sequence[Any] | None) -> str:
    from poresynth.report import figures

    charts = []

    def add(title: str, says: str, plot: Callable[[Axes, Theme], None]) -> None:
        light, dark = (figures.draw(plot, theme) for theme in (figures.LIGHT, figures.DARK))
        charts.append(html.chart(title, says, light, dark))

    boxes = {name: comparison.samples[name] for name in BOXES if name in comparison.samples}
    if boxes:
        says = (
            "Each figure over parts of one size, scaled to the exemplar's range: boxes are the "
            "exemplar's parts, points those of the new volume, and the line is their mean."
        )
        add("Morphometry", says, figures.boxes(boxes))
    for name, says in TWO_POINT.items():
        add("Two-point correlation", says, figures.two_point(comparison.curves[name]))
    if "histogram" in comparison.curves:
        gray = figures.histogram(comparison.curves["histogram"], comparison.threshold)
        add("Gray values", "How often each gray value occurs.", gray)
    blocks = {
        int(match[1]): (comparison.figures[name].value, comparison.figures[f"{name}_mirrors"].value)
        for name in comparison.figures
        if (match := NOVELTY.match(name))
    }
    if any(plain == plain for plain, _ in blocks.values()):
        says = "How far blocks of the new volume are from the most similar blocks of the exemplar."
        add("Novelty", says, figures.novelty(blocks))
    if energy:
        says = "Mismatch to the exemplar that is left, at each level and edge of neighbourhood."
        add("Energy", says, figures.energy(energy))
    return f'<div class="charts">{"".join(charts)}</div>'
