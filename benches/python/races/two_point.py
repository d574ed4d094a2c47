"""Radial two-point correlation, r ≤ 50 voxels, open boundary."""

from __future__ import annotations

import numpy as np
from inputs import blobs
from race import Race

import poresynth.metrics

R_MAX = 50
race = Race(
    f"two-point correlation, r ≤ {R_MAX}",
    lambda edge: [blobs(edge)],
    # PoreSpy bins distances in its own way and returns no curve to compare.
    lambda ours, theirs: theirs is None or np.allclose(ours, theirs, rtol=1e-4),
    sizes=(128, 256),
)


@race.contestant("poresynth")
def _(solid: np.ndarray, threads: int = 0) -> np.ndarray:
    return poresynth.metrics.two_point_correlation(solid, R_MAX, threads=threads).radial


@race.contestant("scipy.fft, padded to 2N", "scipy")
def _(solid: np.ndarray) -> np.ndarray:
    from scipy import fft

    shape = [fft.next_fast_len(2 * n, real=True) for n in solid.shape]

    def correlate(array: np.ndarray) -> np.ndarray:
        spectrum = fft.rfftn(array.astype(np.float32), shape, workers=-1)
        return fft.irfftn(np.abs(spectrum) ** 2, shape, workers=-1, overwrite_x=True)

    counts = correlate(solid)
    near = np.ix_(*[np.r_[0 : R_MAX + 1, n - R_MAX : n] for n in shape])
    counts = counts[near]
    lags = np.r_[0 : R_MAX + 1, R_MAX:0:-1]
    pairs = np.ones((1, 1, 1))
    squares = np.zeros((1, 1, 1))
    for axis, n in enumerate(solid.shape):
        line = np.expand_dims(lags, tuple({0, 1, 2} - {axis}))
        pairs = pairs * (n - line)
        squares = squares + line**2
    r = np.rint(np.sqrt(squares)).astype(int).ravel()
    totals = [np.bincount(r, values.ravel())[: R_MAX + 1] for values in (counts, pairs)]
    return totals[0] / totals[1]


@race.contestant("PoreSpy", "porespy", most=128)
def _(solid: np.ndarray) -> None:
    from porespy.metrics import two_point_correlation

    two_point_correlation(solid, bins=R_MAX)
