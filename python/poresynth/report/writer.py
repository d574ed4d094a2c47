"""The report of a comparison: one page for people, one JSON file for programs."""

from __future__ import annotations

import datetime
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from poresynth.errors import FileError
from poresynth.io import atomic
from poresynth.report import html
from poresynth.volume import Volume, as_volume

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy.typing as npt
    from matplotlib.axes import Axes

    from poresynth.compare import Comparison
    from poresynth.report.figures import Theme

__all__ = ["reserved", "write_report"]

# Headings of the table of figures, by the beginning of the figure's name.
GROUPS = {
    "Structure": ("porosity", "two_point", "structure", "euler", "tb_", "bs_", "bv_", "mil_"),
    "Connectivity": ("component", "floating", "largest"),
    "Gray values": ("intensity", "histogram", "gradient", "seam"),
    "Novelty": ("novelty", "copy", "mean_copied"),
}
OTHER = "More"
# Titles of the two-point curves.
TWO_POINT = {
    "two_point": ("Two-point correlation", "averaged over all directions."),
    "two_point_z": ("Two-point correlation", "along z."),
    "two_point_y": ("Two-point correlation", "along y."),
    "two_point_x": ("Two-point correlation", "along x."),
}
NOVELTY = re.compile(r"novelty_\d+$")
# Width of a row of surfaces in pixels: twice the width on the page, for sharp screens.
SURFACE_PIXELS = 1600
# In voxels: smaller pixels show nothing more.
SMALLEST_PIXEL = 1 / 6


def write_report(
    directory: str | PathLike[str],
    exemplar: Volume | npt.ArrayLike,
    volume: Volume | npt.ArrayLike,
    comparison: Comparison,
    *,
    energy: Sequence[Any] | None = None,
    configuration: Mapping[str, Any] | None = None,
    command: str | None = None,
) -> Path:
    """Write ``report.html``, which needs no other file, and ``report.json``.

    Parameters
    ----------
    directory : path_like
        Folder of the report; made if it does not exist. Its parent must exist.
    exemplar, volume : Volume or array_like
        What was compared, shape (z, y, x) or (z, y, x, channel).
    comparison : Comparison
        Its figures and curves, from `poresynth.compare`.
    energy : sequence, optional
        Records with the fields ``level``, ``window``, ``iteration`` and ``energy``, as a
        synthetic volume carries them.
    configuration : mapping, optional
        What made the volume, JSON-compatible.
    command : str, optional
        The command that makes it again.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    FileError
        If the folder cannot be written; what was there before is then untouched.

    Notes
    -----
    Peak memory: 60 bytes for each voxel shown, at most 256³ of each volume.
    """
    exemplar, volume = as_volume(exemplar), as_volume(volume)
    directory = Path(directory)
    now = datetime.datetime.now().astimezone()
    text = _page(exemplar, volume, comparison, energy, configuration, command, now)
    data = _data(comparison, energy, configuration, command, now)
    with (
        reserved(directory),
        atomic.output(directory / "report.html", directory / "report.json") as (page, numbers),
    ):
        page.write_text(text, encoding="utf-8")
        numbers.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    return directory / "report.html"


@contextmanager
def reserved(directory: str | PathLike[str]) -> Iterator[None]:
    """Hold the folder of a report while the work goes on that the report is about.

    Parameters
    ----------
    directory : path_like
        Made if it does not exist, and then removed again if the work leaves nothing in it.

    Raises
    ------
    FileError
        If the folder cannot be written, or another process is writing a report there.
    """
    directory = Path(directory)
    try:
        directory.mkdir()
        made = True
    except FileExistsError:
        made = False
    except OSError as error:
        raise FileError.because(directory, error) from error
    try:
        atomic.check_writable(directory / "report.html")
        with atomic.claim(directory / "report.html"):
            yield
    except BaseException:
        if made:
            with suppress(OSError):  # Something else has come into it.
                directory.rmdir()
        raise


def _data(
    comparison: Comparison,
    energy: Sequence[Any] | None,
    configuration: Mapping[str, Any] | None,
    command: str | None,
    now: datetime.datetime,
) -> dict[str, Any]:
    """Return what the page says, for programs: the keys of `compare`, and what goes with them."""
    from poresynth import __version__

    return {
        **comparison.to_dict(),
        "curves": {name: vars(curve) for name, curve in comparison.curves.items()},
        "energy": [
            {
                "level": int(record.level),
                "window": int(record.window),
                "iteration": int(record.iteration),
                "energy": float(record.energy),
            }
            for record in energy or ()
        ],
        "configuration": configuration,
        "command": command,
        "version": __version__,
        "date": now.isoformat(timespec="seconds"),
    }


def _page(
    exemplar: Volume,
    volume: Volume,
    comparison: Comparison,
    energy: Sequence[Any] | None,
    configuration: Mapping[str, Any] | None,
    command: str | None,
    now: datetime.datetime,
) -> str:
    from poresynth import __version__

    origin = volume.metadata.get("poresynth", {})
    name = Path((configuration or {}).get("exemplar", "")).name
    facts = {
        "exemplar": f"{name}: {_describe(exemplar)}" if name else _describe(exemplar),
        "new volume": _describe(volume),
        "engine": _engine(origin),
        "seed": str(origin.get("seed", "not recorded")),
        "boundary": str(origin.get("boundary", "not recorded")),
        "made with": f"poresynth {origin.get('version', '(not recorded)')}",
        "reported": f"{now:%Y-%m-%d %H:%M %Z}, poresynth {__version__}",
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


def _extent(volume: Volume, axis: int) -> float:
    return volume.shape[axis] * volume.voxel_size[axis]


def _caption(name: str, part: Volume, whole: Volume) -> str:
    return name if part.shape == whole.shape else f"{name}, its central part"


def _surfaces(exemplar: Volume, volume: Volume, comparison: Comparison) -> str:
    from poresynth.preprocess import binarize
    from poresynth.report.render3d import surface_picture
    from poresynth.report.slices import central_part, png

    shown = central_part(volume, exemplar)
    edges = max(exemplar.shape) + max(shown.shape)
    pixel = max(1.4 * edges / SURFACE_PIXELS, SMALLEST_PIXEL)
    row = []
    for name, part, whole in (("exemplar", exemplar, exemplar), ("new volume", shown, volume)):
        solid = binarize(part, comparison.threshold, comparison.solid)
        picture = surface_picture(solid, exemplar.voxel_size, pixel)
        row.append(html.Picture(png(picture), picture.shape[1], _caption(name, part, whole)))
    says = (
        "<p>The solid, cut at the exemplar's threshold, seen along the same direction and at the "
        "same scale; the first axis points up, the faces where the block was cut are ochre.</p>"
    )
    return says + html.pairs([row], None, "surfaces")


def _slices(exemplar: Volume, volume: Volume) -> str:
    from poresynth.report.slices import (
        DIRECTIONS,
        central_part,
        gray_window,
        scale_bar,
        slice_picture,
    )

    shown = central_part(volume, exemplar)
    window = gray_window(exemplar.array)
    rows = []
    for name, across, (_, right) in DIRECTIONS:
        row = []
        for title, part, whole in (("exemplar", exemplar, exemplar), ("new volume", shown, volume)):
            caption = _caption(f"{title}, {name}", part, whole)
            picture = slice_picture(part, across, window)
            row.append(html.Picture(picture, _extent(part, right), caption))
        rows.append(row)
    bar = scale_bar(min(picture.width for row in rows for picture in row), exemplar.unit)
    says = "<p>Middle slices in three directions, at one scale and with one range of grays.</p>"
    return says + html.pairs(rows, bar, "voxels")


def _charts(comparison: Comparison, energy: Sequence[Any] | None) -> str:
    from poresynth.report import figures

    charts = []

    def add(title: str, says: str, plot: Callable[[Axes, Theme], None]) -> None:
        light, dark = (figures.draw(plot, theme) for theme in (figures.LIGHT, figures.DARK))
        charts.append(html.chart(title, says, light, dark))

    for name, curve in comparison.curves.items():
        if name.startswith("two_point"):
            title, says = TWO_POINT[name]
            band = (curve.low, curve.high)
            add(
                title,
                says,
                figures.two_point(curve.r, curve.volume, curve.exemplar, *band, "voxels"),
            )
    for name, curve in comparison.curves.items():
        if "histogram" in name:
            gray = figures.histogram(
                curve.edges, curve.volume, curve.exemplar, comparison.threshold
            )
            add("Gray values", "How often each gray value occurs.", gray)
    edges = sorted(int(n.removeprefix("novelty_")) for n in comparison.figures if NOVELTY.match(n))
    if edges:
        values = [comparison.figures[f"novelty_{edge}"].value for edge in edges]
        says = "How far blocks of the new volume are from the most similar blocks of the exemplar."
        add("Novelty", says, figures.novelty(edges, values))
    if energy:
        says = "Mismatch to the exemplar that is left, at each level and edge of neighbourhood."
        add("Energy", says, figures.energy(energy))
    return f'<div class="charts">{"".join(charts)}</div>'
