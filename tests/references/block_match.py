"""Slow NumPy twin of the novelty: every place, by Fourier correlation in double precision."""

from __future__ import annotations

import itertools

import numpy as np

from .random_key import Key


def best_match(probe: np.ndarray, volume: np.ndarray) -> float:
    """Smallest mean squared difference between the probe and any place in the volume."""
    axes = (0, 1, 2)
    spectrum = np.fft.rfftn(volume) * np.conj(np.fft.rfftn(probe, volume.shape, axes))
    cross = np.fft.irfftn(spectrum, volume.shape, axes)
    places = tuple(n - e + 1 for n, e in zip(volume.shape, probe.shape, strict=True))
    windows = np.lib.stride_tricks.sliding_window_view(volume**2, probe.shape)
    squares = windows.sum(axis=(3, 4, 5))
    difference = squares - 2 * cross[tuple(map(slice, places))] + (probe**2).sum()
    return max(float(difference.min()), 0.0) / probe.size


def novelty(
    exemplar: np.ndarray, volume: np.ndarray, edge: int, probes: int, seed: int
) -> tuple[float, float]:
    """Novelty, plain and against the mirror images too."""
    exemplar = (exemplar - exemplar.mean()) / exemplar.std()
    volume = (volume - volume.mean()) / volume.std()
    half = len(exemplar) // 2
    halves = exemplar[:half], exemplar[half : 2 * half]

    def block(array: np.ndarray, source: int, index: int) -> np.ndarray:
        key = Key.new(seed).with_(edge).with_(source)
        starts = [key.below(3 * index + a, n - edge + 1) for a, n in enumerate(array.shape)]
        return array[tuple(slice(i, i + edge) for i in starts)]

    own = [(block(halves[i % 2], 0, i), [halves[1 - i % 2]]) for i in range(probes)]
    new = [(block(volume, 1, i), halves) for i in range(probes)]
    figures = []
    for flips in ([(1, 1, 1)], list(itertools.product((1, -1), repeat=3))):
        medians = [
            np.median(
                [
                    min(best_match(p[::a, ::b, ::c], w) for w in where for a, b, c in flips)
                    for p, where in tasks
                ]
            )
            for tasks in (new, own)
        ]
        figures.append(float(medians[0] / medians[1]))
    return figures[0], figures[1]
