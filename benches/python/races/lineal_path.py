"""Lineal path along the three axes, and chords."""

from __future__ import annotations

import numpy as np
from inputs import blobs
from race import Race

import poresynth.metrics


def numpy_runs(solid: np.ndarray, axis: int) -> np.ndarray:
    """Runs by length along an axis: where neighbours along it differ."""
    lines = np.moveaxis(solid, axis, -1)
    n = lines.shape[-1]
    changes = np.zeros((*lines.shape[:2], n + 1), np.int8)
    changes[..., 1:n] = lines[..., 1:].view(np.int8) - lines[..., :-1].view(np.int8)
    changes[..., 0] = lines[..., 0]
    changes[..., n] -= lines[..., -1]
    changes = changes.ravel()
    return np.bincount(np.flatnonzero(changes < 0) - np.flatnonzero(changes > 0), minlength=n + 1)


paths = Race(
    "lineal path along three axes",
    lambda edge: [blobs(edge)],
    lambda ours, theirs: theirs is None or np.allclose(ours, theirs, rtol=1e-9),
)


@paths.contestant("poresynth")
def _(solid: np.ndarray, threads: int = 0) -> np.ndarray:
    return poresynth.metrics.lineal_path(solid, threads=threads).mean


@paths.contestant("NumPy, run lengths", "numpy")
def _(solid: np.ndarray) -> np.ndarray:
    n = len(solid)
    curves = []
    for axis in range(3):
        runs = numpy_runs(solid, axis)
        longer = runs.sum() - np.cumsum(runs)
        curves.append(np.cumsum(longer[::-1])[::-1][:n] / (n**2 * (n - np.arange(n))))
    return np.mean(curves, axis=0)


@paths.contestant("PoreSpy, one axis", "porespy", most=256)
def _(solid: np.ndarray) -> None:
    # Bins the distances of its own, so that there is no curve to compare.
    from porespy.filters import distance_transform_lin
    from porespy.metrics import lineal_path_distribution

    lineal_path_distribution(distance_transform_lin(solid, axis=0, mode="forward"))
