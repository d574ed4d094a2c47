"""Two-point cluster function, r ≤ 50 voxels, of thousands of clusters."""

from __future__ import annotations

import numpy as np
from inputs import gray
from race import Race

import poresynth.metrics

R_MAX = 50
race = Race(
    f"two-point cluster function, r ≤ {R_MAX}",
    lambda edge: [gray(edge) > 0.05],
    lambda ours, theirs: np.allclose(ours, theirs, rtol=1e-4, atol=1e-9),
    sizes=(128,),
    large=(),
)


@race.contestant("poresynth")
def _(solid: np.ndarray, threads: int = 0) -> np.ndarray:
    return poresynth.metrics.two_point_cluster(solid, R_MAX, threads=threads).radial


@race.contestant("scipy, a transform for each cluster's box", "scipy")
def _(solid: np.ndarray) -> np.ndarray:
    from scipy import fft, ndimage

    labels, _ = ndimage.label(solid, np.ones((3, 3, 3)))
    totals = np.zeros(R_MAX + 1)
    for number, box in enumerate(ndimage.find_objects(labels), 1):
        cluster = (labels[box] == number).astype(np.float32)
        shape = [fft.next_fast_len(2 * n - 1, real=True) for n in cluster.shape]
        counts = fft.irfftn(np.abs(fft.rfftn(cluster, shape, workers=-1)) ** 2, shape, workers=-1)
        lags = np.meshgrid(*[np.abs(fft.fftfreq(n, 1 / n)) for n in shape], indexing="ij")
        r = np.rint(np.sqrt(sum(lag**2 for lag in lags))).astype(int).ravel()
        found = np.bincount(r, np.rint(counts).ravel())[: R_MAX + 1]
        totals[: len(found)] += found
    lag = np.arange(-R_MAX, R_MAX + 1)
    z, y, x = np.meshgrid(lag, lag, lag, indexing="ij")
    r = np.rint(np.sqrt(z**2 + y**2 + x**2)).astype(int).ravel()
    pairs = np.prod([n - np.abs(d) for n, d in zip(solid.shape, (z, y, x), strict=True)], axis=0)
    return totals / np.bincount(r, pairs.ravel())[: R_MAX + 1]
