"""Novelty of blocks of 12³, 20³ and 32³, mirrored copies counted."""

from __future__ import annotations

import itertools

import numpy as np
from inputs import gray
from race import Race

import poresynth.metrics

EDGES = (12, 20, 32)
PROBES = 24
race = Race(
    "novelty, three block sizes, with mirrors",
    lambda edge: [gray(edge, 0), gray(edge, 1)],
    # The blocks are random: the figures scatter by tens of percent.
    lambda ours, theirs: bool(np.all(np.abs(np.log(np.divide(ours, theirs))) < 1.5)),
    sizes=(100,),
    large=(),
)


@race.contestant("poresynth")
def _(exemplar: np.ndarray, volume: np.ndarray, threads: int = 0) -> list[float]:
    edges = [edge for edge in EDGES if edge < len(exemplar) // 2]
    found = [poresynth.metrics.novelty(exemplar, volume, edge, threads=threads) for edge in edges]
    return [each.mirrored for each in found]


@race.contestant("scipy.fft, each place by correlation", "scipy")
def _(exemplar: np.ndarray, volume: np.ndarray) -> list[float]:
    edges = [edge for edge in EDGES if edge < len(exemplar) // 2]
    return [by_correlation(exemplar, volume, edge) for edge in edges]


def by_correlation(exemplar: np.ndarray, volume: np.ndarray, edge: int) -> float:
    """The figure from Fourier correlations in single precision."""
    from scipy import fft, ndimage

    random = np.random.default_rng(0)
    exemplar, volume = ((v - v.mean()) / v.std() for v in (exemplar, volume))
    half = len(exemplar) // 2
    places = []
    for part in (exemplar[:half], exemplar[half : 2 * half]):
        shape = [fft.next_fast_len(n, real=True) for n in part.shape]
        inner = tuple(slice(edge // 2, edge // 2 + n - edge + 1) for n in part.shape)
        squares = ndimage.uniform_filter(part**2, edge, mode="constant")[inner] * edge**3
        places.append((part, shape, fft.rfftn(part, shape, workers=-1), squares))

    def best(probe: np.ndarray, where: list) -> float:
        found = []
        for flips in itertools.product((slice(None), slice(None, None, -1)), repeat=3):
            image = probe[flips]
            for _, shape, spectrum, squares in where:
                product = spectrum * fft.rfftn(image, shape, workers=-1).conj()
                correlation = fft.irfftn(product, shape, workers=-1)
                valid = correlation[tuple(map(slice, squares.shape))]
                found.append(float((squares - 2 * valid).min()))
        return (min(found) + float((probe**2).sum())) / probe.size

    def block(array: np.ndarray) -> np.ndarray:
        start = [random.integers(0, n - edge + 1) for n in array.shape]
        return array[tuple(slice(i, i + edge) for i in start)]

    own = [best(block(places[i % 2][0]), [places[1 - i % 2]]) for i in range(PROBES)]
    new = [best(block(volume), places) for _ in range(PROBES)]
    return float(np.median(new) / np.median(own))
