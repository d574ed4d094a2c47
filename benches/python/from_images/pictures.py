"""Two pages of the README: volumes from slices of materials, and solids from colour images."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt
from opening_picture import Page
from readme import save_picture

from poresynth import metrics
from poresynth.metrics.sections import SECTION_AXES
from poresynth.report.figures import LIGHT
from poresynth.report.slices import gray_window
from poresynth.volume import Volume

from . import colours
from .making import RUNS, synthesise
from .materials import make
from .truths import Truth, truths

TITLE = "pictures"
MATERIALS, COLOURS = "from_images", "colour_solids"

MARGIN, GAP = 24, 16
HEAD, CAPTION = 44, 26  # above the pictures of the page, and above those of a row

# How bright the faces of a cube are that look up, to the left and to the right.
LIGHTS = (1.0, 0.86, 0.72)

Picture = npt.NDArray[np.uint8]
Row = tuple[str, list[Picture]]


def draw_all(edge: int) -> None:
    """Make a volume of each material and of each image, and draw the two pages."""
    rows = [material_row(truth, edge) for truth in truths([""])]
    heads = ["image", *(f"new, across {a}" for a in SECTION_AXES), "new, diagonal", "the original"]
    save_picture(MATERIALS, draw(heads, rows))
    rows = [colour_row(title, image, edge) for title, image in colours.images([""])]
    if rows:
        heads = ["image", "solid", *(f"across {a}" for a in SECTION_AXES), "diagonal"]
        save_picture(COLOURS, draw(heads, rows))


def material_row(truth: Truth, edge: int) -> Row:
    """The slice, what is made of it, and the slice of the original that was not shown to it."""
    slices, made = make(truth, RUNS["one"], edge, seeds=1)
    image = next(iter(slices.images.values()))
    window = gray_window(truth.volume.array)
    middle = truth.volume.array[truth.volume.shape[0] // 2]
    shown = [image.array[0], *_sections(made.volumes[0]), middle]
    return truth.title, [_rgb(picture, window) for picture in shown]


def colour_row(title: str, image: Volume, edge: int) -> Row:
    """The image, and the solid that is made of it."""
    solid = synthesise([image], edge, 1).volumes[0]
    shown = [image.array[0], cube(solid.array), *_sections(solid)]
    return title.removeprefix(f"{colours.STUDY}, "), [_rgb(picture, (0, 255)) for picture in shown]


def _sections(volume: Volume) -> list[npt.NDArray[Any]]:
    """Return the middle section across each axis, and a diagonal one."""
    stacks = [metrics.sections(volume, axis).array for axis in SECTION_AXES]
    return [*(stack[len(stack) // 2] for stack in stacks), metrics.diagonal_sections(volume, 1)[0]]


def _rgb(picture: npt.NDArray[Any], window: tuple[float, float]) -> Picture:
    low, high = window
    shares = np.clip((picture.astype(float) - low) / (high - low), 0, 1)
    gray = np.rint(255 * shares).astype(np.uint8)
    return gray if gray.ndim == 3 else np.repeat(gray[..., None], 3, axis=2)


def cube(array: npt.NDArray[Any]) -> Picture:
    """Draw a colour cube from a corner: its faces at z = 0 and at the ends of y and x, on white."""
    n = len(array)
    slant = np.sqrt(3) / 2  # of the edges that are not upright, per voxel of width
    height, width = 2 * n, 2 * int(n * slant)  # even, so that no ray meets the edge in front
    below, right = np.mgrid[:height, :width] + 0.5
    right = (right - width / 2) / slant
    # What a ray meets of each face, in voxels along its two axes.
    faces: tuple[tuple[npt.NDArray[Any], npt.NDArray[Any], npt.NDArray[Any]], ...] = (
        (array[0], below - right / 2, below + right / 2),
        (array[:, -1], below - n - right / 2, right + n),
        (array[:, :, -1], below - n + right / 2, n - right),
    )
    page = np.full((height, width, 3), 255, np.uint8)
    for light, (face, first, second) in zip(LIGHTS, faces, strict=True):
        a, b = (np.floor(place).astype(int) for place in (first, second))
        seen = (a >= 0) & (a < n) & (b >= 0) & (b < n)
        page[seen] = np.rint(light * face[a[seen], b[seen]])
    return page


def draw(heads: list[str], rows: Iterable[Row]) -> bytes:
    """Draw a page: a row a material, one pixel a voxel, names above."""
    rows = list(rows)
    widths = [max(p.shape[1] for p in column) for column in zip(*(r[1] for r in rows), strict=True)]
    heights = [max(p.shape[0] for p in pictures) for _, pictures in rows]
    lefts = MARGIN + np.cumsum([0, *(width + GAP for width in widths)])
    height = HEAD + sum(CAPTION + h + GAP for h in heights) + MARGIN
    page = Page(int(lefts[-1]) - GAP + MARGIN, height)
    for left, head in zip(lefts, heads, strict=False):
        page.text(head, left, MARGIN + 8, 13, color=LIGHT.exemplar)
    top = HEAD
    for (title, pictures), tall in zip(rows, heights, strict=True):
        page.text(title, MARGIN, top + 17, 14, weight="bold")
        for left, picture in zip(lefts, pictures, strict=False):
            page.image(picture, int(left), top + CAPTION)
        top += CAPTION + tall + GAP
    return page.png()
