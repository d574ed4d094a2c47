"""Noise as a function of seed and place: unbounded, any window by itself, periodic on request.

The value at a lattice site is a hash of (seed, channel, site): no stored field, no border, no order
of drawing. Two windows that overlap agree where they do, whatever their size, and on every device,
for the hash is computed with integers.

    >>> whole = lattice_noise(7, (-2, 0, 5), (4, 4, 4), channels=3)
    >>> part = lattice_noise(7, (0, 1, 5), (2, 2, 2), channels=3)
    >>> bool((whole[:, 2:, 1:3, :2] == part).all())
    True
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
import numpy.typing as npt

__all__ = ["lattice_noise", "mix_seed"]

_MASK = (1 << 64) - 1
_GOLDEN = 0x9E3779B97F4A7C15

Bits = npt.NDArray[np.uint64]


def lattice_noise(
    seed: int,
    start: Sequence[int],
    shape: Sequence[int],
    *,
    channels: int,
    kind: Literal["uniform", "normal"] = "uniform",
    period: Sequence[int] | None = None,
) -> npt.NDArray[np.float32]:
    """Return the noise of a window of the lattice.

    Parameters
    ----------
    seed : int
        0 to 2⁶⁴ − 1.
    start : sequence of int
        First site of the window along each axis, any integer; as many as the lattice has axes.
    shape : sequence of int
        Sites along each axis.
    channels : int
        Values at each site.
    kind : {"uniform", "normal"}, default "uniform"
        Uniform in [−1, 1), or normal of mean 0 and variance 1.
    period : sequence of int, optional
        The lattice repeats after so many sites along each axis.

    Returns
    -------
    numpy.ndarray
        Shape (channels, *shape).

    Notes
    -----
    Peak memory: about 24 bytes a value.
    """
    axes = len(shape)
    bits = np.asarray(mix_seed(seed), np.uint64)
    for axis, (first, count) in enumerate(zip(start, shape, strict=True)):
        sites = [first + i for i in range(count)]
        if period is not None:
            sites = [site % period[axis] for site in sites]
        bits = _with(bits[..., np.newaxis], np.array([s & _MASK for s in sites], np.uint64))
    numbers = np.arange(channels, dtype=np.uint64).reshape(channels, *(1,) * axes)
    bits = _with(bits[np.newaxis], numbers)
    if kind == "uniform":
        # 24 bits are what float32 holds of a number below 1.
        share = (bits >> np.uint64(40)).astype(np.float32)
        return np.asarray(share * np.float32(2**-23) - 1, np.float32)
    from scipy.special import ndtri

    # 53 bits, moved by a half so that neither 0 nor 1 is met.
    middle = ((bits >> np.uint64(11)).astype(np.float64) + 0.5) * 2.0**-53
    return np.asarray(ndtri(middle), np.float32)


def mix_seed(*parts: int) -> int:
    """Return one number, 0 to 2⁶⁴ − 1, that depends on all parts: a seed for each purpose."""
    state = np.uint64(0)
    for part in parts:
        state = _with(state[np.newaxis], np.array([part & _MASK], np.uint64))[0]
    return int(state)


def _with(state: Bits, part: Bits) -> Bits:
    """Return the states that go on from ``state`` with another number (SplitMix64)."""
    with np.errstate(over="ignore"):
        golden = np.uint64(_GOLDEN)
        return _mix(state ^ _mix(part * golden + golden))


def _mix(x: Bits) -> Bits:
    with np.errstate(over="ignore"):
        x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        return np.asarray(x ^ (x >> np.uint64(31)), np.uint64)
