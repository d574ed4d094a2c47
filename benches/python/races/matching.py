"""Histogram matching of gray values."""

from __future__ import annotations

import numpy as np
from inputs import gray
from race import Race

import poresynth.metrics


def close(ours: np.ndarray, theirs: np.ndarray) -> bool:
    """Alike but for what is interpolated between neighbouring values."""
    return bool(np.abs(ours - theirs.astype(ours.dtype)).mean() < 1e-3 * np.ptp(ours))


def levels(edge: int, seed: int) -> np.ndarray:
    values = gray(edge, seed)
    return ((values - values.min()) * (255 / np.ptp(values))).astype(np.uint8)


floats = Race("histogram matching, float32", lambda edge: [gray(edge), gray(edge, 1) ** 3], close)
bytes_ = Race(
    "histogram matching, uint8",
    lambda edge: [levels(edge, 0), levels(edge, 1) // 2],
    # scikit-image gives values between levels, where ours are levels.
    lambda ours, theirs: bool(np.abs(ours - theirs.astype(float)).mean() < 1),
)


@floats.contestant("poresynth")
def match(source: np.ndarray, reference: np.ndarray, threads: int = 0) -> np.ndarray:
    return poresynth.metrics.match_histogram(source, reference, threads=threads)


@floats.contestant("scikit-image")
def match_skimage(source: np.ndarray, reference: np.ndarray) -> np.ndarray:
    from skimage.exposure import match_histograms

    return match_histograms(source, reference)


@floats.contestant("NumPy, argsort", "numpy")
def _(source: np.ndarray, reference: np.ndarray) -> np.ndarray:
    found = np.empty_like(reference)
    found.ravel()[np.argsort(source, axis=None)] = np.sort(reference, axis=None)
    return found


bytes_.contestant("poresynth")(match)
bytes_.contestant("scikit-image")(match_skimage)
