"""Colour textures that fields are trained on: photographs if there are any, else drawn ones."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree

from poresynth import io
from poresynth.preprocess import crop, downsample
from poresynth.volume import Volume

__all__ = ["DATA", "texture"]

DATA = Path(os.environ.get("PORESYNTH_DATA", "."))
EDGE = 256

Picture = npt.NDArray[Any]


def texture(name: str) -> Volume:
    """Return a texture, shape (1, y, x, 3).

    Parameters
    ----------
    name : {"honeycomb", "crosshatch", "veins"}
        Photographs come from the subfolder 2d of PORESYNTH_DATA, at half of their pixels along an
        edge, for their grain is finer than what a small field learns.
    """
    file, drawn = _TEXTURES[name]
    if (DATA / "2d" / file).exists():
        picture = downsample(io.read(DATA / "2d" / file), 2, labels=False)
        return crop(picture, *_INSIDE[name]) if name in _INSIDE else picture
    shade = drawn(np.random.default_rng(0))[None, ..., None]
    dark, bright = np.array([60, 20, 10]), np.array([240, 190, 90])
    return Volume(np.rint(dark + shade * (bright - dark)).astype(np.uint8))


def _honeycomb(random: np.random.Generator) -> Picture:
    rows = np.arange(-1, EDGE // 26 + 2)
    centres = [(26 * row, 30 * (n + row % 2 / 2)) for row in rows for n in range(-1, 10)]
    return np.clip(_walls(np.array(centres), 5) + 0.4 * _clouds(random, 6), 0, 1)


def _veins(random: np.random.Generator) -> Picture:
    wide, fine = (_walls(EDGE * random.random((n, 2)), w) for n, w in ((12, 5), (160, 2)))
    return np.clip(np.maximum(wide, 0.6 * fine) + 0.2 * _clouds(random, 3), 0, 1)


def _crosshatch(random: np.random.Generator) -> Picture:
    y, x = np.mgrid[:EDGE, :EDGE] + 4 * np.stack([_clouds(random, 20) for _ in "yx"])
    strokes = np.maximum(np.sin((x + y) / 3), np.sin((x - y) / 3))
    return np.clip(0.5 + 0.4 * strokes + 0.2 * _clouds(random, 3), 0, 1)


def _walls(centres: Picture, width: float) -> Picture:
    """Walls between the cells of points: 1 in their middle, 0 from ``width`` pixels on."""
    grid = np.stack(np.mgrid[:EDGE, :EDGE], axis=-1)
    nearest, second = np.moveaxis(cKDTree(centres).query(grid, k=2)[0], -1, 0)
    return np.clip(1 - (second - nearest) / width, 0, 1)


def _clouds(random: np.random.Generator, size: float) -> Picture:
    """Smooth noise of this size, about −1 to 1."""
    field = gaussian_filter(random.standard_normal((EDGE, EDGE)), size, mode="wrap")
    return np.asarray(field / (2 * field.std()))


_TEXTURES: dict[str, tuple[str, Callable[[np.random.Generator], Picture]]] = {
    "honeycomb": ("honeycombed_0003.jpg", _honeycomb),
    "crosshatch": ("crosshatched_0014.jpg", _crosshatch),
    "veins": ("veined_0106.jpg", _veins),
}
# Corner and edges of what is taken; the cloth's own corners are round.
_INSIDE = {"crosshatch": ((0, 2, 4), (1, 170, 200))}
