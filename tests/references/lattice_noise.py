"""Twin of the lattice noise: plain integers, one site at a time."""

from __future__ import annotations

from collections.abc import Sequence

from tests.references.random_key import GOLDEN, MASK, mix


def site_noise(seed: int, site: Sequence[int], channel: int) -> float:
    state = 0
    for part in (seed, *site, channel):
        state = mix(state ^ mix((part * GOLDEN + GOLDEN) & MASK))
    return (state >> 40) / 2**23 - 1
