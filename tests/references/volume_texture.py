"""Slow NumPy twin of one level of the volume-texture engine with exact search.

Distances are taken between whole neighbourhoods, not descriptors: with every principal component
kept the two agree up to the descriptors' quantisation.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from .random_key import Key


def axis_origins(n: int, window: int, step: int, shift: int, boundary: str) -> list[int]:
    """Window origins along an axis; every voxel is covered."""
    shift %= step
    if boundary == "periodic":
        count = -(-n // step)
        return sorted({(k * n // count + shift) % n for k in range(count)})
    origins, k = set(), 0
    while max(k * step - shift, 0) + window < n + step:
        origins.add(min(max(k * step - shift, 0), n - window))
        k += 1
    return sorted(origins)


def window_at(volume: np.ndarray, origin: tuple[int, int, int], window: int) -> np.ndarray:
    axes = [(o + np.arange(window)) % n for o, n in zip(origin, volume.shape, strict=True)]
    return volume[np.ix_(*axes)]


def random_blocks(
    exemplar: np.ndarray, shape: tuple[int, int, int], block: int, boundary: str, key: Key
) -> np.ndarray:
    """Initial state: random blocks of the exemplar."""
    out = np.zeros(shape, np.float64)
    axes = [axis_origins(n, block, block, 0, boundary) for n in shape]
    for site, origin in enumerate(itertools.product(*axes)):
        own = key.with_(site)
        source = [own.below(a, exemplar.shape[a] - block + 1) for a in range(3)]
        to = [(o + np.arange(block)) % n for o, n in zip(origin, shape, strict=True)]
        out[np.ix_(*to)] = exemplar[tuple(slice(s, s + block) for s in source)]
    return out


@dataclass
class Pass:
    """What one iteration did."""

    blended: np.ndarray
    matches: list[tuple[int, int, int]]
    data: float
    gradient: float


def iterate(
    exemplar: np.ndarray,
    volume: np.ndarray,
    window: int,
    origins: list[list[int]],
    exponent: float = 0.8,
) -> Pass:
    """Search phase by brute force, then the weighted mean of all windows."""
    candidates = sliding_window_view(exemplar, (window,) * 3)
    grid = candidates.shape[:3]
    flat = candidates.reshape(-1, window**3)
    sums = np.zeros(volume.shape)
    weights = np.zeros(volume.shape)
    found, fits = [], []
    for origin in itertools.product(*origins):
        own = window_at(volume, origin, window)
        best = int(((flat - own.ravel()) ** 2).sum(1).argmin())
        found.append(tuple(int(i) for i in np.unravel_index(best, grid)))
        off = own - flat[best].reshape((window,) * 3)
        pairs = sum(float((np.diff(off, axis=a) ** 2).sum()) for a in range(3))
        fits.append((float((off**2).mean()), 2 * pairs / off.size))
    fit = np.array(fits)
    weight = (np.sqrt(fit[:, 0]) + 1) ** (exponent - 2)
    for origin, match, w in zip(itertools.product(*origins), found, weight, strict=True):
        to = np.ix_(
            *[(o + np.arange(window)) % n for o, n in zip(origin, volume.shape, strict=True)]
        )
        patch = exemplar[tuple(slice(m, m + window) for m in match)]
        sums[to] += w * patch
        weights[to] += w
    return Pass(sums / weights, found, float((weight * fit[:, 0]).mean()), float(fit[:, 1].mean()))


def match_histogram(values: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Give ``values`` the distribution of ``target``, by ranks."""
    order = np.argsort(values, axis=None, kind="stable")
    ranks = (np.arange(values.size) + 0.5) / values.size
    wanted = np.interp(ranks, (np.arange(target.size) + 0.5) / target.size, np.sort(target.ravel()))
    out = np.empty(values.size)
    out[order] = wanted
    return out.reshape(values.shape)
