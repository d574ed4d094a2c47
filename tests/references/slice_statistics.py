"""Figures of one binary slice by public libraries and by brute force."""

from __future__ import annotations

import numpy as np
from scipy import ndimage
from skimage import measure
from tests.references.thickness import local_thickness

AREA = 10_000


def plane(solid: np.ndarray) -> dict[str, float]:
    """The figures of `poresynth.metrics.slice_statistics` for a slice (row, column).

    All but the tips, which depend on the way of thinning.
    """
    holes = measure.label(~solid, connectivity=1)
    border = np.concatenate([holes[[0, -1]].ravel(), holes[:, [0, -1]].ravel()])
    thickness, spacing = (
        local_thickness(phase[np.newaxis], (1.0, 1.0, 1.0), "open")[0][phase].mean()
        for phase in (solid, ~solid)
    )
    return {
        "solid_fraction": float(solid.mean()),
        "components": AREA * measure.label(solid, connectivity=2).max() / solid.size,
        "holes": AREA * len(set(holes[~solid]) - set(border)) / solid.size,
        "perimeter": perimeter(solid),
        "thickness": float(thickness),
        "spacing": float(spacing),
    }


def perimeter(solid: np.ndarray) -> float:
    """Crofton's perimeter per area: changes of phase along rows, columns and both diagonals."""
    per_length = []
    for dy, dx in ((0, 1), (1, 0), (1, 1), (1, -1)):
        start = solid[: len(solid) - dy, max(0, -dx) : solid.shape[1] - max(0, dx)]
        end = solid[dy:, max(0, dx) : solid.shape[1] - max(0, -dx)]
        per_length.append((start != end).mean() / np.hypot(dy, dx))
    return float(np.pi / 2 * np.mean(per_length))


def two_point(solid: np.ndarray, r_max: int) -> np.ndarray:
    """S₂ for r = 0 … r_max, by every shift of the slice."""
    hits, pairs = np.zeros(r_max + 1), np.zeros(r_max + 1)
    for dy in range(-r_max, r_max + 1):
        for dx in range(-r_max, r_max + 1):
            r = round(float(np.hypot(dy, dx)))
            if r <= r_max:
                rows = slice(max(0, -dy), len(solid) - max(0, dy))
                columns = slice(max(0, -dx), solid.shape[1] - max(0, dx))
                one = solid[rows, columns]
                hits[r] += (
                    one & solid[max(0, dy) :, max(0, dx) :][: len(one), : one.shape[1]]
                ).sum()
                pairs[r] += one.size
    return hits / pairs


def tips(skeleton: np.ndarray, margin: int) -> float:
    """End points of a skeleton (row, column) per 10⁴ pixels."""
    around = ndimage.convolve(skeleton.astype(int), np.ones((3, 3)), mode="constant")
    inner = (slice(margin, -margin),) * 2
    return AREA * float((skeleton & (around == 2))[inner].mean())
