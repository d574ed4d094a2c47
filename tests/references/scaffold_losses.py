"""Twins of ScaffoldGAN's losses: plain NumPy, one region, slice, lag or voxel at a time."""

from __future__ import annotations

import itertools

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Shape = tuple[int, int, int]


def discriminator_loss(real: Array, fake: Array) -> float:
    """Eq. 1, with the sigmoid written out."""
    d_real, d_fake = (1 / (1 + np.exp(-logits)) for logits in (real, fake))
    return float(-np.log(d_real).mean() - np.log(1 - d_fake).mean())


def generator_loss(fake: Array, kind: str) -> float:
    d = 1 / (1 + np.exp(-fake))
    return float(-np.log(d).mean() if kind == "non_saturating" else np.log(1 - d).mean())


def regions(features: Array, shape: Shape, stride: Shape) -> list[Array]:
    """Every region of a batch as a vector, in the order of memory."""
    found = []
    for sample in features:
        ranges = [
            range(0, n - w + 1, s) for n, w, s in zip(sample.shape[1:], shape, stride, strict=True)
        ]
        for z, y, x in itertools.product(*ranges):
            part = sample[:, z : z + shape[0], y : y + shape[1], x : x + shape[2]]
            found.append(part.ravel())
    return found


def nearest(queries: Array, table: Array) -> list[int]:
    """Brute force: the sum of squared differences with every row."""
    found = []
    for query in queries:
        distances = [float(((query - row) ** 2).sum()) for row in table]
        found.append(int(np.argmin(distances)))
    return found


def structural_loss(features: Array, table: Array, shape: Shape, stride: Shape) -> float:
    """Eqs. 3 and 4, a mean over regions and elements."""
    total = []
    for query in regions(features, shape, stride):
        total.append(min(float(((query - row) ** 2).mean()) for row in table))
    return float(np.mean(total))


def gram_loss(fake: Array, real: Array, slices: int) -> float:
    """Section 3.3 on equally spaced slices, a mean over directions and entries."""
    squares = []
    for axis in range(3):
        grams = []
        for features in (fake, real):
            batch, channels = features.shape[:2]
            count = features.shape[2 + axis]
            chosen = min(slices, count)
            gram = np.zeros((channels, channels))
            for sample in range(batch):
                for i in range(chosen):
                    at = (2 * i + 1) * count // (2 * chosen)
                    plane = features[sample].take(at, 1 + axis)
                    for m in range(channels):
                        for n in range(channels):
                            gram[m, n] += (plane[m] * plane[n]).mean()
            grams.append(gram / (batch * chosen))
        squares.append((grams[0] - grams[1]) ** 2)
    return float(np.mean(squares))


def covariance(volumes: Array, reach: int) -> dict[Shape, float]:
    """Mean product of pairs at every lag, over the variance."""
    deviation = volumes - volumes.mean()
    found = {}
    span = range(-reach, reach + 1)
    for lag in itertools.product(span, span, range(reach + 1)):
        here, there = [], []
        for n, d in zip(volumes.shape[2:], lag, strict=True):
            here.append(slice(max(0, -d), n - max(0, d)))
            there.append(slice(max(0, d), n - max(0, -d)))
        every = (slice(None), slice(None))
        pairs = deviation[(*every, *here)] * deviation[(*every, *there)]
        found[lag] = float(pairs.mean())
    variance = found[(0, 0, 0)]
    return {lag: value / variance for lag, value in found.items()}


def sliced_wasserstein(
    fake: Array, real: Array, filters: Array, scales: int, places: Array
) -> float:
    """Sorted responses of each filter, at the places that are looked at."""
    total = 0.0
    for scale in range(scales):
        if scale:
            fake, real = halved(fake), halved(real)
        for kernel in filters:
            rows = []
            for batch in (fake, real):
                responses = []
                for sample in batch:
                    edges = [n - kernel.shape[1] + 1 for n in sample.shape[1:]]
                    for z, y, x in np.ndindex(*edges):
                        w = kernel.shape[1]
                        part = sample[:, z : z + w, y : y + w, x : x + w]
                        responses.append(float((part * kernel).sum()))
                chosen = [responses[int(place * len(responses))] for place in places]
                rows.append(sorted(chosen))
            total += float(np.abs(np.subtract(*rows)).mean()) / len(filters)
    return total / scales


def halved(volumes: Array) -> Array:
    b, c, z, y, x = volumes.shape
    cut = volumes[:, :, : z // 2 * 2, : y // 2 * 2, : x // 2 * 2]
    return cut.reshape(b, c, z // 2, 2, y // 2, 2, x // 2, 2).mean((3, 5, 7))


def porosity_loss(fake: Array, threshold: float, wanted: float, steepness: float) -> float:
    share = np.mean([1 / (1 + np.exp(-steepness * (v - threshold))) for v in fake.ravel()])
    return float((share - wanted) ** 2)


def transposed(values: Array, weight: Array, stride: int) -> Array:
    """A transposed convolution on an endless lattice, from its definition: no padding cut off."""
    out = np.zeros((weight.shape[1], *(stride * (n - 1) + 4 for n in values.shape[1:])))
    for z, y, x in np.ndindex(*values.shape[1:]):
        added = np.tensordot(values[:, z, y, x], weight, 1)
        out[
            :,
            stride * z : stride * z + 4,
            stride * y : stride * y + 4,
            stride * x : stride * x + 4,
        ] += added
    return out
