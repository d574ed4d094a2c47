"""Slow NumPy twin of slice response matching: filters as sums of shifted copies."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from tests.references.random_key import Key

STEP = 2
GROUP = 4
STRENGTH = 12
Target = tuple[int, np.ndarray, bool, float]


def normal(key: Key, index: int) -> float:
    bits = key.bits(index)
    radius = np.sqrt(-2 * np.log(((bits >> 32) + 1) / 2**32))
    return float(radius * np.cos(2 * np.pi * (bits & 0xFFFFFFFF) / 2**32))


def rotation(n: int, key: Key) -> np.ndarray:
    """Orthonormal rows: normal vectors, made orthogonal one after the other."""
    if n == 1:
        return np.ones((1, 1))
    basis: list[np.ndarray] = []
    for row in range(n):
        v = np.array([normal(key.with_(row), i) for i in range(n)])
        for b in basis:
            v = v - (v @ b) * b
        basis.append(v / np.linalg.norm(v))
    return np.array(basis)


def draw(images: Sequence[np.ndarray], edge: int, key: Key) -> tuple:
    """A unit filter (edge, edge) and its directions in channel space, one a row."""
    directions = rotation(len(images[0]), key.with_(0))
    patches = key.with_(2)
    image = np.tensordot(directions[0], images[patches.below(0, len(images))], 1)
    (y0, x0), (y1, x1) = (
        (
            patches.below(i, image.shape[0] - edge + 1),
            patches.below(i + 1, image.shape[1] - edge + 1),
        )
        for i in (1, 3)
    )
    taps = image[y0 : y0 + edge, x0 : x0 + edge] - image[y1 : y1 + edge, x1 : x1 + edge]
    if not taps.any():
        noise = [normal(key.with_(1), i) for i in range(edge * edge)]
        taps = np.array(noise).reshape(edge, edge)
    return taps / np.linalg.norm(taps), directions


def cumulative(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Edges of the bins and shares of the values below them."""
    low, high = values.min(), values.max()
    if low == high:
        return np.array([low, high]), np.array([0.0, 1.0])
    # A power of two, that 16 values a bin or fewer come to.
    number = int(np.clip(2 ** np.ceil(np.log2(max(values.size // 16, 1))), 256, 2048))
    bins = np.clip(((values - low) / (high - low) * number).astype(int), 0, number - 1)
    counts = np.bincount(bins, minlength=number)
    return np.linspace(low, high, number + 1), np.r_[0.0, np.cumsum(counts) / values.size]


def transported(values: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Values of the same rank of another distribution: exact at the bins' edges, linear between."""
    edges, below = cumulative(values.ravel())
    other, other_below = cumulative(wanted)
    flat = edges[0] == edges[-1]
    ranks = np.array([0.5, 0.5]) if flat else below
    return np.interp(values, edges, np.interp(ranks, *first_of_equal(other_below, other)))


def first_of_equal(below: np.ndarray, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    # Steps over empty bins, so that ranks are strictly ascending but for rounding.
    return below + np.arange(len(below)) * 1e-15, edges


def inside(image: np.ndarray, taps: np.ndarray) -> np.ndarray:
    windows = np.lib.stride_tricks.sliding_window_view(image, taps.shape)
    return (windows * taps).sum((2, 3))


def symmetries(taps: np.ndarray, symmetric: bool) -> list[np.ndarray]:
    if not symmetric:
        return [taps]
    return [np.rot90(t, k) for t in (taps, taps.T) for k in range(4)]


def correlated(volume: np.ndarray, taps: np.ndarray, axis: int) -> np.ndarray:
    axes = [a for a in range(3) if a != axis]
    return sum(tap * np.roll(volume, (-j, -i), axes) for (j, i), tap in np.ndenumerate(taps))


def spread(values: np.ndarray, taps: np.ndarray, axis: int) -> np.ndarray:
    axes = [a for a in range(3) if a != axis]
    return sum(tap * np.roll(values, (j, i), axes) for (j, i), tap in np.ndenumerate(taps))


def power(taps: np.ndarray, axis: int, shape: tuple[int, ...]) -> np.ndarray:
    """|F̂|² by wave number, the same along the axis."""
    kernel = np.zeros(shape)
    kernel[0, 0, 0] = 1
    return np.abs(np.fft.fftn(spread(kernel, taps, axis))) ** 2


def scale(pooled: np.ndarray, key: Key, kind: int) -> tuple[float, float]:
    """Standard deviation of an image's responses, and the offset above which they count."""
    edges, below = cumulative(pooled)
    middles, shares = (edges[1:] + edges[:-1]) / 2, np.diff(below)
    deviation = np.sqrt((shares * (middles - (shares * middles).sum()) ** 2).sum())
    share = 0.1 + 0.8 * unit(key.with_(0), kind)
    counts = np.round(below * pooled.size)
    return deviation, edges[np.searchsorted(counts, int(share * pooled.size), side="right")]


def left(responses: np.ndarray, deviation: float, offset: float) -> np.ndarray:
    return np.maximum((responses - offset) / deviation, 0)


def same(a: Target, b: Target) -> bool:
    return np.array_equal(a[1], b[1]) and a[2] == b[2]


def unit(key: Key, index: int) -> float:
    return (key.bits(index) >> 40) / 2**24


def second_step(
    found: list[np.ndarray],
    looked: np.ndarray,
    axis: int,
    sources: Sequence[Target],
    group: Sequence[tuple],
    key: Key,
) -> list[np.ndarray]:
    """What the responses to the responses of a group ask of these, at the places looked at."""
    channels = len(sources[0][1])
    kinds = [(taps, directions[d]) for d in range(channels) for taps, directions in group]
    # By image, kind and symmetry.
    own = [
        [
            [inside(np.tensordot(direction, image, 1), turned) for turned in symmetries(taps, many)]
            for taps, direction in kinds
        ]
        for _, image, many, _ in sources
    ]
    which = key.with_(5).below(0, len(sources))
    scales = [
        scale(np.concatenate([r.ravel() for r in responses]), key, i)
        for i, responses in enumerate(own[which])
    ]
    above = [
        [[left(r, *s) for r in responses] for responses, s in zip(of, scales, strict=True)]
        for of in own
    ]
    first = [responses[0] for responses in above[which]]
    room = [n - 4 for n in first[0].shape]
    bank = []
    for k in range(4):
        draws = key.with_(1 + k)
        a, b = ([draws.below(i, room[0]), draws.below(i + 1, room[1])] for i in (0, 2))
        taps = np.array([m[a[0] : a[0] + 5 : 2, a[1] : a[1] + 5 : 2] for m in first]) - np.array(
            [m[b[0] : b[0] + 5 : 2, b[1] : b[1] + 5 : 2] for m in first]
        )
        total = np.abs(taps).sum()
        bank.append(taps / total if total > 0 else np.full(taps.shape, 1 / taps.size))
    # The places looked at are a smaller volume, that tiles space as well.
    shape = [looked.any(tuple(b for b in range(3) if b != a)).sum() for a in range(3)]
    small = [f[looked].reshape(shape) for f in found]
    remains = [left(f, *s) for f, s in zip(small, scales, strict=True)]
    asked = [np.zeros(shape) for _ in small]
    for taps in bank:
        response = sum(correlated(r, t, axis) for r, t in zip(remains, taps, strict=True))
        wanted = []
        for of, (_, _, many, _) in zip(above, sources, strict=True):
            for turn in range(len(of[0])):
                turned = [symmetries(t, many)[turn] for t in taps]
                wide = [np.zeros((5, 5)) for _ in turned]
                for w, t in zip(wide, turned, strict=True):
                    w[::2, ::2] = t
                answers = (inside(m[turn], w) for m, w in zip(of, wide, strict=True))
                wanted.append(sum(answers).ravel())
        change = transported(response, np.concatenate(wanted)) - response
        for i, t in enumerate(taps):
            asked[i] += spread(change, t, axis)
    out = []
    for i, (change, (deviation, _)) in enumerate(zip(asked, scales, strict=True)):
        size = sum(np.abs(taps[i]).sum() for taps in bank)
        full = np.zeros(looked.shape)
        full[looked] = (np.where(remains[i] > 0, STRENGTH * deviation / size * change, 0)).ravel()
        out.append(full)
    return out


def step(
    volume: np.ndarray,
    targets: Sequence[Target],
    filters: int,
    edge: int,
    key: Key,
    deep: bool = False,
    alike: bool = False,
    regularisation: float = 0.05,
) -> tuple[np.ndarray, float]:
    """One step on a volume (channel, z, y, x), without the matching of its values."""
    images = [image for _, image, *_ in targets]
    bank = [draw(images, edge, key.with_(0).with_(k)) for k in range(filters)]
    start = key.with_(1).below(0, STEP**2)
    asked = np.zeros(volume.shape)
    seen = np.zeros(volume.shape[1:])
    squares = []
    # The first target with each image.
    numbers = [
        i for i, t in enumerate(targets) if not any(same(t, before) for before in targets[:i])
    ]
    for target in targets:
        axis, image, symmetric, weight = target
        number = numbers.index(next(i for i in numbers if same(targets[i], target)))
        for g in range(0, filters if deep else 0, GROUP):
            group = bank[g : g + GROUP]
            looked = places(volume.shape[1:], axis, (start + g // GROUP) % STEP**2)
            kinds = [(f, d) for d in range(len(image)) for f in group]
            found = [
                correlated(np.tensordot(directions[d], volume, 1), taps, axis)
                for (taps, directions), d in kinds
            ]
            own = key.with_(2).with_(0 if alike else number).with_(g // GROUP)
            sources = [targets[i] for i in numbers] if alike else [target]
            changes = second_step(found, looked, axis, sources, group, own)
            for ((taps, directions), d), change in zip(kinds, changes, strict=True):
                back = weight * spread(change, taps, axis)
                asked += directions[d][:, None, None, None] * back
        for k, (taps, directions) in enumerate(bank):
            looked = places(volume.shape[1:], axis, (start + k // GROUP) % STEP**2)
            seen += weight * looked.mean() * power(taps, axis, volume.shape[1:])
            for direction in directions:
                found = correlated(np.tensordot(direction, volume, 1), taps, axis)
                mixed = np.tensordot(direction, image, 1)
                wanted = [inside(mixed, t).ravel() for t in symmetries(taps, symmetric)]
                change = np.zeros(found.shape)
                change[looked] = transported(found[looked], np.concatenate(wanted)) - found[looked]
                squares.append(change[looked] ** 2)
                back = weight * spread(change, taps, axis)
                asked += direction[:, None, None, None] * back
    spectrum = np.fft.fftn(asked, axes=(1, 2, 3)) / (seen + regularisation * seen.mean())
    moved = volume + np.fft.ifftn(spectrum, axes=(1, 2, 3)).real
    return moved, float(np.concatenate(squares).mean())


def places(shape: tuple[int, ...], axis: int, turn: int) -> np.ndarray:
    """Where a group of filters looks: every second row and column of each slice."""
    looked = np.ones(shape, bool)
    for along, first in zip((a for a in range(3) if a != axis), divmod(turn, STEP), strict=True):
        at = np.arange(shape[along])
        on = (at >= first) & ((at - first) % STEP == 0)
        looked &= np.expand_dims(on, [a for a in range(3) if a != along])
    return looked
