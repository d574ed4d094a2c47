"""Parts of a page that comparisons of every kind have: charts, surfaces, words about a volume."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from poresynth.report import html
from poresynth.volume import Volume

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from poresynth.comparison.result import Figure
    from poresynth.report.figures import Theme

__all__ = ["caption", "chart", "charts", "describe", "energy_chart", "grouped", "surfaces"]

OTHER = "More"
"""Heading of the figures that fit under no other."""

# Width of a pair of surfaces in pixels: twice the width on the page, for sharp screens.
SURFACE_PIXELS = 1600
# In voxels: smaller pixels show nothing more.
SMALLEST_PIXEL = 1 / 6


def grouped(
    figures: Iterable[Figure], headings: Mapping[str, tuple[str, ...]]
) -> dict[str, list[Figure]]:
    """Put figures under headings.

    Parameters
    ----------
    figures : iterable of Figure
        In the order of reading.
    headings : mapping of str to tuple of str
        By heading, the beginnings of the figures' names.

    Returns
    -------
    dict of str to list of Figure
        Without the headings that have no figure; what fits under none is at the end.
    """
    groups: dict[str, list[Figure]] = {heading: [] for heading in (*headings, OTHER)}
    for figure in figures:
        fitting = (h for h, starts in headings.items() if figure.name.startswith(starts))
        groups[next(fitting, OTHER)].append(figure)
    return {heading: found for heading, found in groups.items() if found}


def describe(volume: Volume) -> str:
    """Return the size of a volume, or of an image, in words."""
    start = int(volume.shape[0] == 1)
    shape, size = volume.shape[start:], volume.voxel_size[start:]
    text = f"{' × '.join(map(str, shape))} {'pixels' if start else 'voxels'}"
    if volume.unit == "voxel":
        return text
    edges = size[:1] if len(set(size)) == 1 else size
    return f"{text} of {' × '.join(f'{edge:g}' for edge in edges)} {volume.unit}"


def caption(name: str, part: Volume, whole: Volume) -> str:
    """Return what a picture shows, and whether it is a part only."""
    return name if part.shape == whole.shape else f"{name}, its central part"


def surfaces(solids: Mapping[str, Volume], css: str) -> str:
    """Return pictures of the surfaces of solids, side by side at one scale.

    Parameters
    ----------
    solids : mapping of str to Volume
        bool, by caption; with the voxel size of the first.
    css : str
        Class of the row.

    Returns
    -------
    str
        HTML.
    """
    from poresynth.report.render3d import surface_picture
    from poresynth.report.slices import png

    edges = sum(max(solid.shape) for solid in solids.values())
    pixel = max(1.4 * edges / (SURFACE_PIXELS / 2 * len(solids)), SMALLEST_PIXEL)
    size = next(iter(solids.values())).voxel_size
    row = []
    for name, solid in solids.items():
        picture = surface_picture(solid.array, size, pixel)
        row.append(html.Picture(png(picture), picture.shape[1], name))
    return html.pairs([row], None, css)


def chart(title: str, says: str, plot: Callable[[Axes, Theme], None]) -> str:
    """Return a chart for light and dark pages; see `poresynth.report.figures` for plots."""
    from poresynth.report import figures

    light, dark = (figures.draw(plot, theme) for theme in (figures.LIGHT, figures.DARK))
    return html.chart(title, says, light, dark)


def energy_chart(energy: Sequence[Any] | None) -> list[str]:
    """Return the chart of the energy, where an engine recorded it."""
    from poresynth.report import figures

    if not energy:
        return []
    says = "Mismatch to the exemplar that is left, at each level and edge of neighbourhood."
    return [chart("Energy", says, figures.energy(energy))]


def charts(found: Iterable[str]) -> str:
    """Return charts side by side."""
    return f'<div class="charts">{"".join(found)}</div>'
