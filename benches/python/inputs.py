"""Volumes to measure."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from poresynth import exemplars


def gray(edge: int, seed: int = 0) -> np.ndarray:
    """Smooth noise with features of about a tenth of 128 voxels, float32."""
    noise = np.random.default_rng(seed).standard_normal((edge,) * 3).astype(np.float32)
    return ndimage.gaussian_filter(noise, 4, mode="wrap")


def blobs(edge: int, seed: int = 0) -> np.ndarray:
    """The brighter half of smooth noise."""
    return gray(edge, seed) > 0


def foam(edge: int) -> np.ndarray:
    """The struts of a foam whose pores reach up to about 20 voxels from the nearest one."""
    shape = (max(edge, 40),) * 3
    return np.asarray(exemplars.foam(shape, cell=min(40.0, edge / 2), seed=1)) >= 128


def pores(edge: int) -> np.ndarray:
    """The pores of that foam."""
    return ~foam(edge)
