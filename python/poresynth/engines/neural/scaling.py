"""Between an exemplar's values and what a network learns: numbers in [−1, 1]."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from poresynth.engines.phases import Phases
from poresynth.engines.values import channels_first
from poresynth.volume import Volume

__all__ = ["Scaling"]

TAILS = 0.001
"""Share of the darkest and of the brightest voxels that are clipped: a few bright grains must not
press all else into a corner of the range."""

Field = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Scaling:
    """How the values of one exemplar become a field, and come back.

    Two phases are −1 (pore) and 1 (solid) in one channel, more have one channel each that is 1 in
    the phase and −1 elsewhere. Gray values go linearly from their 0.1 % and 99.9 % quantiles to −1
    and 1, channel by channel.

    Attributes
    ----------
    phases : Phases
        The exemplar's.
    dtype : numpy.dtype
        The exemplar's.
    low, high : numpy.ndarray
        Gray values at −1 and 1, shape (channels,); empty unless gray.
    plain : bool
        Whether a gray volume has no axis of channels.
    """

    phases: Phases
    dtype: np.dtype[Any]
    low: npt.NDArray[np.float64]
    high: npt.NDArray[np.float64]
    plain: bool

    @classmethod
    def of(cls, volume: Volume, phases: Phases) -> Scaling:
        """Find the range of an exemplar."""
        ends = np.zeros((2, 0))
        if phases.kind == "gray":
            flat = channels_first(volume.array).reshape(volume.channels, -1)
            ends = np.quantile(flat.astype(np.float64), [TAILS, 1 - TAILS], axis=1)
            # Where nearly all voxels have one value the tails are all that differs.
            flat_ends = np.stack([flat.min(1), flat.max(1)]).astype(np.float64)
            ends = np.where(ends[0] < ends[1], ends, flat_ends)
        return cls(phases, volume.dtype, ends[0], ends[1], volume.array.ndim == 3)

    @property
    def channels(self) -> int:
        """Channels of the field."""
        if self.phases.kind == "gray":
            return len(self.low)
        return 1 if len(self.phases.labels) == 2 else len(self.phases.labels)

    @property
    def threshold(self) -> float:
        """Field value that parts pore from solid, in the first channel."""
        if self.phases.kind != "gray" or self.phases.threshold is None:
            return 0.0
        return float(self._to_unit(np.asarray([self.phases.threshold]), 0)[0])

    @property
    def bright(self) -> bool:
        """Whether high field values are the solid's."""
        return self.phases.kind != "gray" or self.phases.solid == "bright"

    def field(self, volume: Volume) -> Field:
        """Return the field of the exemplar, shape (channels, z, y, x)."""
        if self.phases.kind == "gray":
            channels = channels_first(volume.array)
            return np.stack([self._to_unit(c, k) for k, c in enumerate(channels)])
        which = [1] if self.channels == 1 else range(self.channels)
        return np.stack([np.where(self.phases.phase == k, 1, -1) for k in which]).astype(np.float32)

    def scores(self, field: Field) -> Field:
        """Return what `poresynth.engines.values.cut` ranks: high in the solid, or a row a phase."""
        if self.channels > 1 and self.phases.kind != "gray":
            return field
        return field[:1] if self.bright else -field[:1]

    def values(self, field: Field) -> npt.NDArray[Any]:
        """Return what a field means in the exemplar's values, as it is, voxel by voxel.

        Returns
        -------
        numpy.ndarray
            Of the exemplar's data type, shape (z, y, x[, channel]): the larger of the phases, or
            gray values, rounded and cut to the data type's range. Cut at the exemplar's threshold
            they have whatever porosity the network gave them.
        """
        if self.phases.kind != "gray":
            index = field[0] > 0 if self.channels == 1 else field.argmax(0)
            labels: npt.NDArray[Any] = self.phases.labels[index.astype(np.intp)]
            return labels
        array = np.empty(field.shape, self.dtype)
        for channel, planes in enumerate(field):
            half, low = (self.high[channel] - self.low[channel]) / 2, self.low[channel]
            # Plane by plane: double precision takes twice the memory of the field.
            for z, plane in enumerate(planes):
                gray = (plane.astype(np.float64) + 1) * half + low
                if self.dtype.kind in "iu":
                    limits = np.iinfo(self.dtype)
                    gray = np.clip(np.rint(gray), limits.min, limits.max)
                array[channel, z] = gray
        return array[0] if self.plain else np.ascontiguousarray(np.moveaxis(array, 0, -1))

    def _to_unit(self, values: npt.NDArray[Any], channel: int) -> Field:
        span = self.high[channel] - self.low[channel]
        unit = (values.astype(np.float64) - self.low[channel]) * (2 / span) - 1
        return np.asarray(np.clip(unit, -1, 1), np.float32)
