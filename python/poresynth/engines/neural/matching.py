"""The exemplar's shares and grays for volumes too large for memory: maps from field to values.

`poresynth.engines.values` ranks all voxels, which have to be in memory for that. Here the field is
seen block by block first, and then mapped block by block: two phases by counts of 65536 levels,
more by a sample of the voxels.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from poresynth.engines.neural.scaling import Scaling

__all__ = ["LEVELS", "LabelMap", "LevelMap", "ValueMap", "map_memory", "to_levels", "value_map"]

LEVELS = 1 << 16
"""Levels of the field: of a volume whose field is spread out, one holds some 10⁻⁴ of the voxels."""

SAMPLE = 1 << 20
"""Voxels that decide the shares of more than two phases: each is right to some 5 · 10⁻⁴."""

SWEEPS = 100
"""Rounds of biases at most; three phases need some ten."""

CLOSE = 1e-4
"""Error of a phase's share, in the sample, that ends the rounds."""

Field = npt.NDArray[np.float32]


class ValueMap(Protocol):
    """A map from field to values that depends on the whole volume."""

    def see(self, field: Field) -> None:
        """Take note of a block of the field, shape (channels, z, y, x)."""

    def settle(self) -> None:
        """Make the map, of all blocks that were seen."""

    def __call__(self, field: Field) -> npt.NDArray[Any]:
        """Return the values of a block, shape (z, y, x)."""


def value_map(
    scaling: Scaling, exemplar: npt.NDArray[Any], voxels: int, porosity: float | None
) -> ValueMap:
    """Return the map for an exemplar.

    Parameters
    ----------
    scaling : Scaling
        Of the exemplar: one channel, or labels.
    exemplar : numpy.ndarray
        Shape (z, y, x).
    voxels : int
        Of the whole volume.
    porosity : float or None
        Wanted; the exemplar's by default. More than two phases keep their proportions.

    """
    if scaling.channels == 1:
        return LevelMap(scaling, exemplar, porosity)
    return LabelMap(scaling, voxels, porosity)


def map_memory(scaling: Scaling, voxels: int) -> int:
    """Return the peak memory of a map in bytes."""
    if scaling.channels == 1:
        return 32 * LEVELS
    # Scores of the sample, once in parts and once whole, and what a round holds.
    return 4 * (3 * scaling.channels + 4) * min(SAMPLE, voxels)


def to_levels(field: Field) -> npt.NDArray[np.uint16]:
    """Return the level of each value of a field in [−1, 1], 0 to 65535."""
    scaled = np.rint((field + np.float32(1)) * np.float32((LEVELS - 1) / 2))
    return np.asarray(np.clip(scaled, 0, LEVELS - 1), np.uint16)


class LevelMap:
    """Two phases: a map from the levels of a field to the exemplar's values.

    It has the wanted porosity, and in each phase the exemplar's histogram, as exactly as the levels
    are fine. Parameters as of `value_map`.
    """

    def __init__(
        self, scaling: Scaling, exemplar: npt.NDArray[Any], porosity: float | None = None
    ) -> None:
        self._scaling, self._exemplar, self._porosity = scaling, exemplar, porosity
        self._counts = np.zeros(LEVELS, np.int64)

    def see(self, field: Field) -> None:
        """Count the levels of a block."""
        self._counts += np.bincount(to_levels(field[0]).ravel(), minlength=LEVELS)

    def settle(self) -> None:
        """Make the table from level to value."""
        scaling, phases = self._scaling, self._scaling.phases
        counts = self._counts if scaling.bright else self._counts[::-1]
        wanted = phases.porosity if self._porosity is None else self._porosity
        below = np.concatenate([[0], np.cumsum(counts)])
        cut = int(np.argmin(np.abs(below - wanted * below[-1])))
        middles = below[:-1] + counts / 2
        table = np.empty(LEVELS, scaling.dtype)
        for phase, part in enumerate((slice(0, cut), slice(cut, LEVELS))):
            if phases.kind != "gray":
                table[part] = phases.labels[phase]
                continue
            own = np.sort(self._exemplar[phases.phase == phase])
            if not scaling.bright:
                own = own[::-1]
            first, last = below[part.start], max(below[part.stop], below[part.start] + 1)
            share = np.clip((middles[part] - first) / (last - first), 0, 1)
            table[part] = own[np.minimum((share * len(own)).astype(np.intp), len(own) - 1)]
        self._table = table if scaling.bright else table[::-1]

    def __call__(self, field: Field) -> npt.NDArray[Any]:
        """Return the values of a block, shape (z, y, x)."""
        return self._table[to_levels(field[0])]


class LabelMap:
    """More than two phases: the phase whose score and bias are largest.

    The biases give a sample of the voxels the wanted shares. Parameters as of `value_map`.
    """

    def __init__(self, scaling: Scaling, voxels: int, porosity: float | None = None) -> None:
        self._phases, self._porosity = scaling.phases, porosity
        self._share = min(1.0, SAMPLE / voxels)
        self._seen: list[Field] = []
        self._random = np.random.default_rng(0)

    def see(self, field: Field) -> None:
        """Keep the scores of some voxels of a block, or of all of a small volume."""
        flat = field.reshape(len(field), -1)
        if self._share < 1:
            count = round(self._share * flat.shape[1])
            flat = flat[:, self._random.integers(0, flat.shape[1], count)]
        self._seen.append(flat)

    def settle(self) -> None:
        """Find the biases: one phase after the other gets its share, until all have theirs."""
        scores = np.concatenate(self._seen, axis=1)
        self._seen.clear()
        count = scores.shape[1]
        wanted = np.array(self._phases.wanted(count, self._porosity))
        present = np.flatnonzero(wanted)
        bias = np.where(wanted > 0, 0, -np.inf).astype(np.float32)
        for _ in range(SWEEPS):
            biased = scores + bias[:, None]
            found = np.bincount(biased.argmax(0), minlength=len(bias))
            if np.abs(found - wanted).max() <= max(1, CLOSE * count):
                break
            for k in present[1:]:  # A bias of all phases changes nothing.
                others = biased[[j for j in present if j != k]].max(0)
                lead = np.partition(others - scores[k], (wanted[k] - 1, wanted[k]))
                bias[k] = lead[wanted[k] - 1 : wanted[k] + 1].mean()
                biased[k] = scores[k] + bias[k]
        self._bias = bias

    def __call__(self, field: Field) -> npt.NDArray[Any]:
        """Return the labels of a block, shape (z, y, x)."""
        labels: npt.NDArray[Any] = self._phases.labels[
            (field + self._bias[:, None, None, None]).argmax(0)
        ]
        return labels
