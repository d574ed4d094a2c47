"""Volumes to measure."""

from __future__ import annotations

import numpy as np
from scipy import ndimage


def gray(edge: int, seed: int = 0) -> np.ndarray:
    """Smooth noise with features of about a tenth of 128 voxels, float32."""
    noise = np.random.default_rng(seed).standard_normal((edge,) * 3).astype(np.float32)
    return ndimage.gaussian_filter(noise, 4, mode="wrap")


def blobs(edge: int, seed: int = 0) -> np.ndarray:
    """The brighter half of smooth noise."""
    return gray(edge, seed) > 0
