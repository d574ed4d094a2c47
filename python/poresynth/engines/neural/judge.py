"""How alike a training's volumes are to the exemplar: a few figures, quick enough for every round.

The full comparison is `poresynth.compare`; this one takes a second, and decides which generator is
kept and when a training stops.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from poresynth.metrics.connectivity import FLOATING, component_sizes
from poresynth.metrics.correlation import (
    R_MAX,
    TwoPointCorrelation,
    normalised,
    relative_error,
    two_point_correlation,
)

__all__ = ["Evaluation", "Judge"]

FAR = 10
"""Voxels beyond which an autocovariance along an axis betrays a lattice."""

Solid = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Evaluation:
    """What a generator made, measured.

    Attributes
    ----------
    figures : dict
        By name, as in `Judge`.
    score : float or None
        The lower the better; infinite where one phase is missing. None where figures cannot tell
        the better of two generators: the later one is then kept.
    volume : numpy.ndarray
        Shape (z, y, x), in the exemplar's values, for the picture.
    """

    figures: dict[str, float]
    score: float | None
    volume: npt.NDArray[Any]

    @property
    def one_phase(self) -> str | None:
        """What the volume holds if it is one phase only, "solid" or "pore"; else None."""
        porosity = self.figures["porosity"]
        return {0.0: "solid", 1.0: "pore"}.get(porosity)


class Judge:
    """Compares the solid of volumes with that of one exemplar.

    Figures:

    - ``porosity`` and ``porosity_error_percent``;
    - ``two_point_error_percent``: D2 of the papers. White noise of the right porosity has 16 to
      38 % of it, for much of D2 is the porosity;
    - ``covariance_error_percent``: the same of the normalised autocovariance (S₂ − φ²)/(φ − φ²),
      which porosity does not enter and of which white noise has 100 %;
    - ``axis_repeat``: the largest autocovariance along an axis beyond 10 voxels. A lattice that the
      eye sees at once gives 0.4 and hardly moves the radial figures;
    - ``components`` and ``floating_parts``, of 26 neighbours.

    The score is the mean of the two radial errors: one sees the porosity, the other does not.

    Parameters
    ----------
    solid : numpy.ndarray of bool
        The exemplar's, shape (z, y, x); an image is (1, y, x).
    """

    def __init__(self, solid: Solid) -> None:
        self._reach = max(2, min(R_MAX, min(n for n in solid.shape if n > 1) // 2))
        self._porosity = 1 - float(solid.mean())
        self._own = two_point_correlation(solid, self._reach)

    def __call__(self, solid: Solid, volume: npt.NDArray[Any]) -> Evaluation:
        """Measure a volume of any shape; ``volume`` is what is shown of it."""
        porosity = 1 - float(solid.mean())
        error = 100 * abs(porosity - self._porosity) / self._porosity
        figures = {"porosity": porosity, "porosity_error_percent": error}
        if porosity in (0.0, 1.0):
            return Evaluation(figures, float("inf"), volume)
        found = two_point_correlation(solid, self._reach)
        two_point = relative_error(found.radial, self._own.radial)
        covariance = relative_error(
            *(normalised(curves.radial, curves.radial[0]) for curves in (found, self._own))
        )
        sizes = component_sizes(solid)
        figures |= {
            "two_point_error_percent": two_point,
            "covariance_error_percent": covariance,
            "axis_repeat": axis_repeat(found),
            "components": float(len(sizes)),
            "floating_parts": float(np.count_nonzero(sizes < FLOATING)),
        }
        return Evaluation(figures, (two_point + covariance) / 2, volume)


def axis_repeat(found: TwoPointCorrelation) -> float:
    """Return the largest autocovariance over the variance along an axis beyond `FAR` voxels."""
    curves = np.stack([found.z, found.y, found.x])[:, FAR + 1 :]
    far = normalised(curves, found.radial[0])
    return float(np.nanmax(far)) if np.isfinite(far).any() else float("nan")
