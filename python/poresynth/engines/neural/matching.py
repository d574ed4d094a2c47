"""The exemplar's porosity and grays for volumes too large for memory: a map from field to values.

`poresynth.engines.values` ranks all voxels, which have to be in memory for that. Here the field is
counted in 65536 levels, block by block, and the map from level to value has the wanted porosity and
the exemplar's histogram in each phase, as exactly as the levels are fine.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from poresynth.engines.neural.scaling import Scaling
from poresynth.errors import ParameterError

__all__ = ["LEVELS", "LevelMap", "to_levels"]

LEVELS = 1 << 16
"""Levels of the field: of a volume whose field is spread out, one holds some 10⁻⁴ of the voxels."""


def to_levels(field: npt.NDArray[np.float32]) -> npt.NDArray[np.uint16]:
    """Return the level of each value of a field in [−1, 1], 0 to 65535."""
    scaled = np.rint((field + np.float32(1)) * np.float32((LEVELS - 1) / 2))
    return np.asarray(np.clip(scaled, 0, LEVELS - 1), np.uint16)


class LevelMap:
    """A map from the levels of a field to the exemplar's values.

    Parameters
    ----------
    scaling : Scaling
        Of the exemplar; one channel.
    exemplar : numpy.ndarray
        Shape (z, y, x).
    counts : numpy.ndarray
        Voxels of the whole volume at each level, shape (65536,).
    porosity : float, optional
        Wanted; the exemplar's by default.

    Attributes
    ----------
    porosity : float
        What the map gives the volume.
    """

    def __init__(
        self,
        scaling: Scaling,
        exemplar: npt.NDArray[Any],
        counts: npt.NDArray[np.int64],
        porosity: float | None = None,
    ) -> None:
        if scaling.channels != 1:
            raise ParameterError(
                "cut", "porosity", "needs one channel to rank; take cut = exemplar for this model"
            )
        phases = scaling.phases
        if not scaling.bright:
            counts = counts[::-1]
        wanted = phases.porosity if porosity is None else porosity
        below = np.concatenate([[0], np.cumsum(counts)])
        total = below[-1]
        cut = int(np.argmin(np.abs(below - wanted * total)))
        self.porosity = float(below[cut] / total)
        middles = below[:-1] + counts / 2
        table = np.empty(LEVELS, scaling.dtype)
        for phase, part in enumerate((slice(0, cut), slice(cut, LEVELS))):
            if phases.kind != "gray":
                table[part] = phases.labels[phase]
                continue
            own = np.sort(exemplar[phases.phase == phase])
            if not scaling.bright:
                own = own[::-1]
            first, last = below[part.start], max(below[part.stop], below[part.start] + 1)
            share = np.clip((middles[part] - first) / (last - first), 0, 1)
            table[part] = own[np.minimum((share * len(own)).astype(np.intp), len(own) - 1)]
        self._table = table if scaling.bright else table[::-1]

    def __call__(self, field: npt.NDArray[np.float32]) -> npt.NDArray[Any]:
        """Return the values of a field of shape (1, z, y, x), shape (z, y, x)."""
        return self._table[to_levels(field[0])]
