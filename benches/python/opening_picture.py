"""The picture that opens the README: an exemplar and a volume made of it, at one scale.

    python benches/python/opening_picture.py

Trabecular bone if the folder in the environment variable PORESYNTH_DATA holds it, else a procedural
exemplar. The picture is docs/images/opening.png.
"""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from readme import save_picture
from specimens import Material, materials
from study import synthesise

import poresynth
from poresynth import metrics
from poresynth.report.figures import LIGHT
from poresynth.report.render3d import surface_picture
from poresynth.report.slices import gray_window, scale_bar
from poresynth.volume import Volume

EDGE = 200  # of the new volume: twice the exemplar's
SCALE = 2  # pixels a voxel, of slices and renderings
PROBES = 96  # blocks that the novelty is a median of: an error of about a tenth
NOVEL_EDGE = 20

DOTS = 100  # an inch: only the size of letters depends on it
MARGIN, GAP, COLUMN_GAP = 56, 56, 112
HEAD, FOOT = 124, 150  # above the pictures, and for the figures below them


Picture = npt.NDArray[np.uint8]


def pictures(volume: Volume, level: float, window: tuple[float, float]) -> tuple[Picture, Picture]:
    """Return the middle slice and the surface, RGB on white."""
    plane = volume.array[volume.shape[0] // 2].astype(np.float64)
    low, high = window
    gray = np.rint(255 * np.clip((plane - low) / (high - low), 0, 1)).astype(np.uint8)
    section = np.repeat(gray.repeat(SCALE, 0).repeat(SCALE, 1)[..., None], 3, axis=2)
    solid = poresynth.binarize(volume, level)
    surface = surface_picture(solid, volume.voxel_size, 1 / SCALE)
    opacity = surface[..., 3:] / 255.0
    on_white = np.rint(surface[..., :3] * opacity + 255 * (1 - opacity)).astype(np.uint8)
    return section, on_white


def figures(volume: Volume, level: float) -> list[tuple[str, str]]:
    """Return what is written under a slice: names and values."""
    solid = poresynth.binarize(volume, level)
    size, unit = volume.voxel_size[0], volume.unit
    density = metrics.connectivity_density(solid).density
    if unit == "µm":
        loops = f"{density * (1000 / size) ** 3:.1f} / mm³"
    else:
        size, unit, loops = 1.0, "voxels", f"{density * 1e6:.0f} · 10⁻⁶"
    thickness, separation = (
        f"{metrics.thickness(phase).mean * size:.3g} {unit}" for phase in (solid, ~solid)
    )
    return [
        ("porosity", f"{100 * metrics.porosity(solid):.2f} %"),
        ("Tb.Th", thickness),
        ("Tb.Sp", separation),
        ("Conn.D", loops),
    ]


class Page:
    """A white page of so many pixels, from the top left."""

    def __init__(self, width: int, height: int) -> None:
        self.width, self.height = width, height
        self.figure = Figure(figsize=(width / DOTS, height / DOTS), dpi=DOTS, facecolor="white")

    def image(self, picture: Picture, x: int, y: int) -> None:
        """Put a picture, pixel by pixel."""
        self.figure.figimage(picture, x, self.height - y - picture.shape[0], origin="upper")

    def text(self, words: str, x: float, y: float, pixels: float, **look: Any) -> None:
        """Write words on a base line."""
        look = {"color": LIGHT.ink, **look}
        place = x / self.width, 1 - y / self.height
        self.figure.text(*place, words, fontsize=72 * pixels / DOTS, va="baseline", **look)

    def line(self, start: tuple[float, float], end: tuple[float, float], **look: Any) -> None:
        """Draw a line."""
        x, y = zip(start, end, strict=True)
        along, down = [v / self.width for v in x], [1 - v / self.height for v in y]
        self.figure.add_artist(Line2D(along, down, **look))

    def png(self) -> bytes:
        stream = io.BytesIO()
        self.figure.savefig(stream, format="png", dpi=DOTS)
        return stream.getvalue()


def heading(page: Page, title: str, words: str, x: float) -> None:
    """Write a title with a line under it."""
    page.text(title, x, 60, 32, weight="bold")
    page.text(words, x, 94, 19, color=LIGHT.exemplar)


def cells(page: Page, values: list[tuple[str, str]], x: float, y: float, step: float) -> None:
    """Write figures in two rows, each under its name."""
    for i, (name, value) in enumerate(values):
        left, top = x + step * (i % 2), y + 74 * (i // 2)
        page.text(name, left, top, 18, color=LIGHT.exemplar)
        page.text(value, left, top + 30, 25)


def draw(material: Material, made: Volume, seconds: float) -> bytes:
    """Draw the page: slice over rendering of the exemplar, then slice and rendering of the new."""
    exemplar = material.exemplar
    level, window = poresynth.threshold(exemplar), gray_window(exemplar.array)
    (small, small_surface), (large, large_surface) = (
        pictures(volume, level, window) for volume in (exemplar, made)
    )
    second = MARGIN + small_surface.shape[1] + COLUMN_GAP
    third = second + large.shape[1] + GAP
    below = HEAD + small.shape[0] + GAP // 2
    foot = below + small_surface.shape[0] + GAP // 2
    height = max(foot + FOOT, HEAD + large_surface.shape[0] + GAP)
    page = Page(third + large_surface.shape[1] + MARGIN, height)

    page.image(small, MARGIN, HEAD)
    page.image(small_surface, MARGIN, below)
    page.image(large, second, HEAD)
    page.image(large_surface, third, (HEAD + height - GAP - large_surface.shape[0]) // 2)
    across = second - COLUMN_GAP // 2
    page.line((across, 40), (across, height - 40), color=LIGHT.faint, lw=1.2)

    length, label = scale_bar(exemplar.shape[2] * exemplar.voxel_size[2], exemplar.unit)
    bar = length / exemplar.voxel_size[2] * SCALE
    end, under = second + large.shape[1], HEAD + large.shape[0] + 16
    page.line((end - bar, under), (end, under), color=LIGHT.ink, lw=2.5, solid_capstyle="butt")
    page.text(label, end, under + 24, 17, ha="right")

    novelty = metrics.novelty(exemplar, made, NOVEL_EDGE, probes=PROBES).mirrored
    heading(page, "One example", f"{material.title}, {exemplar.shape[0]}³ voxels", MARGIN)
    heading(
        page,
        "A new volume, made of it",
        f"{made.shape[0]}³ voxels in {seconds:.0f} s; novelty {novelty:.2f}, where 0 is a copy and "
        "1 as new as one half of the example to the other",
        second,
    )
    cells(page, figures(exemplar, level), MARGIN, foot, 160)
    cells(page, figures(made, level), second, foot, 200)
    return page.png()


def main() -> None:
    material = next(reversed([*materials(["spinodal", "trabecular"])]))
    volumes, seconds = synthesise(material.exemplar, EDGE, seeds=1)
    save_picture("opening", draw(material, volumes[0], seconds))


if __name__ == "__main__":
    main()
