"""Local thickness by brute force: every ball, centred on and between voxels, by its definition."""

from __future__ import annotations

import itertools

import numpy as np


def local_thickness(
    solid: np.ndarray, voxel_size: tuple[float, float, float], boundary: str
) -> np.ndarray:
    """The diameter of the largest ball that holds each voxel; 0 outside."""
    size = np.array(voxel_size)
    shape = np.array(solid.shape)
    out = np.zeros(solid.shape)
    inside, outside = np.argwhere(solid), np.argwhere(~solid)
    if not len(inside):
        return out
    if not len(outside):
        out[solid] = np.inf
        return out

    def steps(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Steps in voxels between all pairs, shape (len(a), len(b), 3)."""
        d = np.abs(a[:, None] - b[None])
        d = np.minimum(d, shape - d) if boundary == "periodic" else d
        return np.where(d == 0.5, 0, d)  # between two voxels is level with both

    def nearest(places: np.ndarray, edges: np.ndarray) -> np.ndarray:
        """Distance of each place to the nearest voxel outside."""
        return np.sqrt(((steps(places, outside) * edges) ** 2).sum(-1).min(1))

    diameters = np.zeros(len(inside))
    for offset in itertools.product((-0.5, 0.0, 0.5), repeat=3):
        places = inside + np.array(offset)
        if boundary == "periodic":
            places %= shape
            known = np.ones(len(places), bool)
        else:
            known = ((places >= 0) & (places <= shape - 1)).all(1)
        distance = nearest(places, size)
        counted = nearest(places, np.ones(3))
        known &= counted > 0
        diameter = distance * (2 - 1 / np.where(known, counted, 1))
        diameters = np.maximum(diameters, np.where(known, diameter, 0))
    reach = nearest(inside.astype(float), size)
    apart = np.sqrt(((steps(inside.astype(float), inside.astype(float)) * size) ** 2).sum(-1))
    holds = apart < reach[None] * (1 - 1e-6)
    out[solid] = np.where(holds, diameters[None], 0).max(1)
    return out
