"""What a page says of a volume beside the images that its sections shall look like."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from poresynth.report import html, parts
from poresynth.volume import Volume

if TYPE_CHECKING:
    from poresynth.comparison import SectionComparison

__all__ = ["content"]

# Headings of the table of the whole, by the beginnings of the figures' names.
GROUPS = {
    "On the whole": ("slice_score", "porosity", "two_point", "phase"),
    "The volume, for information: images do not determine it": ("component", "floating", "largest"),
    "Copying": ("copy", "mean_copied"),
}
POSITIONS = (0.25, 0.5, 0.75)
"""Where the slices are that are shown, as shares of the volume's edge."""


class _Row(NamedTuple):
    """Slices of a volume in one plane, shape (slice, row, column), and the image beside them."""

    name: str
    image: Volume | None
    slices: Volume


def content(
    images: Mapping[Any, Volume],
    volume: Volume,
    comparison: SectionComparison,
    energy: Sequence[Any] | None,
) -> html.Content:
    """Return the page's content; see `poresynth.report.write_report` for the parameters."""
    planes = [plane for group in comparison.planes for plane in group]
    whole = [f for f in comparison.figures.values() if not f.name.endswith(_suffixes(planes))]
    table = (
        html.verdict(comparison.figures.values())
        + html.figures_table(parts.grouped(whole, GROUPS))
        + html.planes_table(comparison.figures, comparison.planes)
        + html.legend(f"parts of the image, {comparison.window}² pixels each")
    )
    image = "image" if len(comparison.planes) == 1 else "images"
    return html.Content(
        f"A new volume beside its {image}",
        f"How alike its slices are to the {image}, measured in the same way.",
        "; ".join(
            f"{parts.describe(images[group[0]])}, {html.across(group)}"
            for group in comparison.planes
        ),
        [
            html.Section("Figures", table),
            html.Section("Slices", _slices(images, volume, comparison)),
            html.Section("Surface", _surface(volume, comparison)),
            html.Section("Curves", _charts(comparison, energy)),
        ],
    )


def _suffixes(planes: Sequence[str]) -> tuple[str, ...]:
    return tuple(f"_{plane}" for plane in planes)


def _slices(images: Mapping[Any, Volume], volume: Volume, comparison: SectionComparison) -> str:
    from poresynth.preprocess import is_two_valued
    from poresynth.report import slices

    first = next(iter(images.values()))
    pixel = first.voxel_size[2]
    rows = []
    for row in _rows(images, volume, comparison):
        image = first if row.image is None else row.image
        window = slices.gray_window(image.array)
        # Two values are black and white, whatever numbers they are.
        own = slices.gray_window(volume.array) if is_two_valued(volume.array) else window
        shown = [] if row.image is None else [("image", row.image, window)]
        count = row.slices.shape[0]
        for place in sorted({int(share * (count - 1)) for share in POSITIONS}):
            plane = row.slices.with_array(row.slices.array[place : place + 1])
            shown.append((f"{row.name}, {place + 1} of {count}", plane, own))
        pictures = []
        for name, plane, values in shown:
            part = slices.central_part(plane, image)
            picture = slices.slice_picture(part, 0, values)
            caption = parts.caption(name, part, plane)
            pictures.append(html.Picture(picture, part.shape[2] * pixel, caption))
        rows.append(pictures)
    bar = slices.scale_bar(min(picture.width for row in rows for picture in row), first.unit)
    says = (
        "<p>The image and slices of the new volume across each axis and along the diagonal of the "
        "second and third, at one scale and with one range of grays.</p>"
    )
    return says + html.pairs(rows, bar, "voxels many")


def _rows(
    images: Mapping[Any, Volume], volume: Volume, comparison: SectionComparison
) -> Iterator[_Row]:
    """Yield the planes that are compared with an image, then the others."""
    from poresynth import metrics
    from poresynth.comparison.sections import DIAGONAL
    from poresynth.metrics.sections import SECTION_AXES

    owner = {p: images[group[0]] for group in comparison.planes for p in group}
    slices: dict[str, Volume] = {axis: metrics.sections(volume, axis) for axis in SECTION_AXES}
    slices[DIAGONAL] = Volume(metrics.diagonal_sections(volume))
    for plane in (*owner, *(plane for plane in slices if plane not in owner)):
        yield _Row(html.across([plane]), owner.get(plane), slices[plane])


def _surface(volume: Volume, comparison: SectionComparison) -> str:
    from poresynth.metrics.structure import Structure, first_channel

    structure = Structure(comparison.kind, comparison.threshold, comparison.solid)
    solid = volume.with_array(structure.cut(first_channel(volume, "volume")))
    says = (
        "<p>The solid, cut at the threshold of the images; the first axis points up, the faces "
        "where the block was cut are ochre.</p>"
    )
    return says + parts.surfaces({"new volume": solid}, "surfaces alone")


def _charts(comparison: SectionComparison, energy: Sequence[Any] | None) -> str:
    from poresynth.report import figures

    charts = []
    for group in comparison.planes:
        for plane in group:
            plot = figures.two_point(comparison.curves[f"two_point_{plane}"])
            says = f"in slices {html.across([plane])}."
            charts.append(parts.chart("Two-point correlation", says, plot))
        names = [n for n in comparison.curves if re.fullmatch(rf"histogram(_.+)?_{group[0]}", n)]
        for i, name in enumerate(names):
            channel = name.removeprefix("histogram").removesuffix(f"_{group[0]}")
            says = f"How often each value occurs, beside the image {html.across(group)}."
            threshold = None if i else comparison.threshold
            plot = figures.histogram(comparison.curves[name], threshold)
            title = f"Values of {channel.replace('_', ' ').strip()}" if channel else "Gray values"
            charts.append(parts.chart(title, says, plot))
    return parts.charts(charts + parts.energy_chart(energy))
