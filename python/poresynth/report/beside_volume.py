"""What a page says of a volume beside a volume."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from poresynth.report import html, parts
from poresynth.volume import Volume

if TYPE_CHECKING:
    from poresynth.comparison import VolumeComparison

__all__ = ["content"]

# Headings of the table of figures, by the beginnings of the figures' names.
GROUPS = {
    "What tells good from poor": ("end_point", "euler_density", "structure_error"),
    "Amount and correlation": ("porosity", "phase", "two_point"),
    "Connectivity": ("component", "floating", "largest", "connectivity"),
    "Sizes and shapes": ("bv_", "bs_", "tb_", "mil_", "branch_", "solid_chord", "pore_chord"),
    "Gray values": ("histogram", "gradient", "seam"),
    "Novelty": ("novelty", "copy", "mean_copied"),
}
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


def content(
    exemplar: Volume, volume: Volume, comparison: VolumeComparison, energy: Sequence[Any] | None
) -> html.Content:
    """Return the page's content; see `poresynth.report.write_report` for the parameters."""
    figures = comparison.figures.values()
    table = (
        html.verdict(figures)
        + html.figures_table(parts.grouped(figures, GROUPS))
        + html.legend("random parts of the exemplar")
    )
    return html.Content(
        "A new volume beside its exemplar",
        "How alike the two are, measured in the same way, and how much of the new one is new.",
        parts.describe(exemplar),
        [
            html.Section("Figures", table),
            html.Section("Surfaces", _surfaces(exemplar, volume, comparison)),
            html.Section("Slices", _slices(exemplar, volume)),
            html.Section("Curves", _charts(comparison, energy)),
        ],
    )


def _surfaces(exemplar: Volume, volume: Volume, comparison: VolumeComparison) -> str:
    from poresynth.metrics.structure import Structure, first_channel
    from poresynth.report.slices import central_part

    structure = Structure(comparison.kind, comparison.threshold, comparison.solid)
    solids = {}
    for name, whole in (("exemplar", exemplar), ("new volume", volume)):
        solid = whole.with_array(structure.cut(first_channel(whole, name)))
        part = central_part(solid, exemplar)
        solids[parts.caption(name, part, whole)] = part
    says = (
        "<p>The solid, cut at the exemplar's threshold, seen along the same direction and at the "
        "same scale; the first axis points up, the faces where the block was cut are ochre.</p>"
    )
    return says + parts.surfaces(solids, "surfaces")


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
            caption = parts.caption(f"{name}, {direction}", part, whole)
            row.append(html.Picture(picture, width, caption))
        rows.append(row)
    bar = slices.scale_bar(min(picture.width for row in rows for picture in row), exemplar.unit)
    says = "<p>Middle slices in three directions, at one scale and with one range of grays.</p>"
    return says + html.pairs(rows, bar, "voxels")


def _charts(comparison: VolumeComparison, energy: Sequence[Any] | None) -> str:
    from poresynth.report import figures

    charts = []
    boxes = {name: comparison.samples[name] for name in BOXES if name in comparison.samples}
    if boxes:
        says = (
            "Each figure over parts of one size, scaled to the exemplar's range: boxes are the "
            "exemplar's parts, points those of the new volume, and the line is their mean."
        )
        charts.append(parts.chart("Morphometry", says, figures.boxes(boxes)))
    for name, says in TWO_POINT.items():
        plot = figures.two_point(comparison.curves[name])
        charts.append(parts.chart("Two-point correlation", says, plot))
    if "histogram" in comparison.curves:
        gray = figures.histogram(comparison.curves["histogram"], comparison.threshold)
        charts.append(parts.chart("Gray values", "How often each gray value occurs.", gray))
    blocks = {
        int(match[1]): (comparison.figures[name].value, comparison.figures[f"{name}_mirrors"].value)
        for name in comparison.figures
        if (match := NOVELTY.match(name))
    }
    if any(plain == plain for plain, _ in blocks.values()):
        says = "How far blocks of the new volume are from the most similar blocks of the exemplar."
        charts.append(parts.chart("Novelty", says, figures.novelty(blocks)))
    return parts.charts(charts + parts.energy_chart(energy))
