"""Signed distances as what a network learns, and the way back to the exemplar's values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from poresynth.engines.neural.scaling import Scaling
from poresynth.engines.phases import Phases
from poresynth.volume import Volume

__all__ = ["DistanceScaling"]

Field = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class DistanceScaling(Scaling):
    """Signed distances to the surface, clipped: −1 deep in the pore, 1 deep in the solid.

    More than two phases have one channel each. Gray values come back as the mean gray at each
    distance, so that a field is a scan without its noise.

    Attributes
    ----------
    clip : int
        Distance that is 1, voxels.
    grays : numpy.ndarray
        Values at the distances −1 … 1, evenly spaced; empty unless gray.
    """

    clip: int
    grays: npt.NDArray[np.float64]

    @classmethod
    def of_distances(cls, volume: Volume, phases: Phases, clip: int) -> DistanceScaling:
        """Find the grays of an exemplar with one channel."""
        plain = Scaling.of(volume, phases)
        grays = np.zeros(0)
        if phases.kind == "gray":
            distance = phases.distance_field(phases.phase, clip)[0] / 127.5 - 1
            grays = _mean_grays(distance, volume.array.reshape(distance.shape), phases, clip)
        return cls(phases, volume.dtype, plain.low, plain.high, plain.plain, clip, grays)

    @property
    def channels(self) -> int:
        """Channels of the field."""
        return 1 if len(self.phases.labels) == 2 else len(self.phases.labels)

    @property
    def threshold(self) -> float:
        """Field value of the surface."""
        return 0.0

    @property
    def bright(self) -> bool:
        """Whether high field values are the solid's."""
        return True

    def field(self, volume: Volume) -> Field:
        """Return the field of the exemplar, shape (channels, z, y, x)."""
        field = self.phases.distance_field(self.phases.phase, self.clip)
        return np.asarray(field / np.float32(127.5) - 1, np.float32)

    def scores(self, field: Field) -> Field:
        """Return the field: one score of the solid, or one a phase."""
        return field

    def values(self, field: Field) -> npt.NDArray[Any]:
        """Return what a field means in the exemplar's values, voxel by voxel."""
        if self.phases.kind != "gray":
            return super().values(field)
        at = (np.clip(field[0].astype(np.float64), -1, 1) + 1) / 2 * (len(self.grays) - 1)
        gray = np.interp(at, np.arange(len(self.grays)), self.grays)
        assert self.phases.threshold is not None
        # Rounding must not carry a voxel over the threshold.
        solid = field[0] > 0
        low = high = self.phases.threshold
        if self.dtype.kind in "iu":
            gray, low = np.rint(gray), np.floor(self.phases.threshold)
            high = low + 1
        else:
            high = float(np.nextafter(np.asarray(low, self.dtype), np.asarray(np.inf, self.dtype)))
        bright = solid == (self.phases.solid == "bright")
        gray = np.where(bright, np.maximum(gray, high), np.minimum(gray, low))
        array = np.asarray(gray, self.dtype)
        return array if self.plain else array[..., None]


def _mean_grays(
    distance: Field, gray: npt.NDArray[Any], phases: Phases, clip: int
) -> npt.NDArray[np.float64]:
    """Return the mean gray at distances a half voxel apart, rising or falling all the way."""
    steps = 4 * clip
    place = np.rint((distance + 1) / 2 * steps).astype(np.intp).ravel()
    count = np.bincount(place, minlength=steps + 1)
    total = np.bincount(place, gray.astype(np.float64).ravel(), steps + 1)
    seen = count > 0
    means = np.interp(np.arange(steps + 1), np.flatnonzero(seen), total[seen] / count[seen])
    # The surface is at the threshold, and what is farther in is not paler.
    assert phases.threshold is not None
    sign = 1 if phases.solid == "bright" else -1
    means[steps // 2] = phases.threshold
    upper = np.maximum.accumulate(sign * means[steps // 2 :])
    lower = np.minimum.accumulate(sign * means[steps // 2 :: -1])[::-1]
    return np.asarray(sign * np.concatenate([lower, upper[1:]]))
