"""Slow NumPy twin of the window search: all windows, principal components, exact neighbours."""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view


def windows(volume: np.ndarray, window: int, step: int) -> np.ndarray:
    """All windows every `step` voxels: (z, y, x, window³)."""
    found = sliding_window_view(volume, (window,) * 3)[::step, ::step, ::step]
    return found.reshape(*found.shape[:3], window**3).astype(np.float64)


def components(exemplar: np.ndarray, others: np.ndarray, count: int) -> list[np.ndarray]:
    """The leading principal components of the exemplar's vectors, and the others' along them."""
    flat = exemplar.reshape(-1, exemplar.shape[-1])
    mean = flat.mean(axis=0)
    _, _, directions = np.linalg.svd(flat - mean, full_matrices=False)
    return [(vectors - mean) @ directions[:count].T for vectors in (exemplar, others)]


def squared_distances(descriptors: np.ndarray, queries: np.ndarray) -> np.ndarray:
    """Of every query, a row each, to every window."""
    length = descriptors.shape[-1]
    a, b = (np.asarray(each).reshape(-1, length) for each in (queries, descriptors))
    a, b = (each.astype(np.int64 if each.dtype == np.int16 else np.float64) for each in (a, b))
    return ((a[:, None] - b[None]) ** 2).sum(axis=-1)
