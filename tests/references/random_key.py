"""NumPy-free twin of the position-keyed random numbers (SplitMix64 finaliser)."""

from __future__ import annotations

from dataclasses import dataclass

MASK = (1 << 64) - 1
GOLDEN = 0x9E3779B97F4A7C15


def mix(x: int) -> int:
    x = ((x ^ (x >> 30)) * 0xBF58476D1CE4E5B9) & MASK
    x = ((x ^ (x >> 27)) * 0x94D049BB133111EB) & MASK
    return x ^ (x >> 31)


@dataclass(frozen=True)
class Key:
    state: int

    @classmethod
    def new(cls, seed: int) -> Key:
        return cls(mix((seed + GOLDEN) & MASK))

    def with_(self, part: int) -> Key:
        return Key(mix(self.state ^ mix((part * GOLDEN + GOLDEN) & MASK)))

    def bits(self, index: int) -> int:
        return mix((self.state + (index + 1) * GOLDEN) & MASK)

    def below(self, index: int, n: int) -> int:
        return (self.bits(index) * n) >> 64
