"""What in a volume is solid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from poresynth.errors import ParameterError
from poresynth.preprocess import is_two_valued, label_values, threshold
from poresynth.volume import Volume

__all__ = ["Cut"]


@dataclass(frozen=True)
class Cut:
    """How values say what is solid.

    Attributes
    ----------
    gray : bool
        Whether values are gray, rather than two or labels.
    level : float
        Value that parts pore from solid.
    bright : bool
        Whether the solid is above it.
    """

    gray: bool
    level: float
    bright: bool

    @classmethod
    def of(
        cls,
        array: npt.NDArray[Any],
        exemplar: Volume | None,
        level: float | None,
        side: Literal["bright", "dark"],
    ) -> Cut:
        """Find the cut of a volume: the exemplar's, if there is one."""
        if side not in ("bright", "dark"):
            raise ParameterError("solid", side, "must be 'bright' or 'dark'")
        labels = label_values(array)
        if labels and level is None:
            return cls(False, (labels[0] + labels[1]) / 2, side == "bright")
        reference = array if exemplar is None else exemplar.array
        if level is None and np.min(array) == np.max(array) and exemplar is None:
            # One value is one phase: there is nothing to prune.
            return cls(False, float(np.min(array)) - 1, True)
        found = threshold(reference, level)
        return cls(not (is_two_valued(array) or bool(labels)), found, side == "bright")

    def solid(self, array: npt.NDArray[Any]) -> npt.NDArray[np.bool_]:
        """Return where voxels are solid."""
        bright = array > self.level
        return np.asarray(bright if self.bright else ~bright)
