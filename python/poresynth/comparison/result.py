"""What a comparison finds, and the rule that judges it."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, Literal

from poresynth.metrics.measurement import json_number
from poresynth.metrics.registry import unit_of

__all__ = ["Comparison", "Curve", "Figure", "Figures", "Histogram", "Samples", "mark"]

Mark = Literal["pass", "near", "off", "info"]
Better = Literal["equal", "smaller", "larger"]


@dataclass(frozen=True)
class Figure:
    """One number of a comparison.

    Parameters
    ----------
    name : str
        Key in the JSON.
    value : float
        Of the synthetic volume; NaN where it is not defined.
    exemplar : float or None
        The same of the exemplar.
    low, high : float or None
        Range over the exemplar's sub-volumes.
    mark : {"pass", "near", "off", "info"}
        See `mark`; "info" where no judgement is meant.
    unit : str
        Unit; ``""`` for shares and counts.
    description : str
        What it is, and what is tolerated beside the range.
    power : int
        Of the length in the unit: 1 for a length, −3 for a count per volume, 0 for none.
    """

    name: str
    value: float
    exemplar: float | None = None
    low: float | None = None
    high: float | None = None
    mark: Mark = "info"
    unit: str = ""
    description: str = ""
    power: int = 0


@dataclass(frozen=True)
class Samples:
    """A metric of sub-volumes of one size.

    Parameters
    ----------
    exemplar, volume : list of float
        One value a sub-volume; NaN where it is not defined.
    """

    exemplar: list[float]
    volume: list[float]


@dataclass(frozen=True)
class Curve:
    """A two-point correlation.

    Parameters
    ----------
    r : list of int
        Distances, voxels.
    volume, exemplar : list of float
        The two curves.
    low, high : list of float
        Range over the exemplar's sub-volumes.
    """

    r: list[int]
    volume: list[float]
    exemplar: list[float]
    low: list[float]
    high: list[float]


@dataclass(frozen=True)
class Histogram:
    """Distributions of gray values.

    Parameters
    ----------
    edges : list of float
        Edges of the bins, one more than bins.
    volume, exemplar : list of float
        Share of the voxels in each bin.
    """

    edges: list[float]
    volume: list[float]
    exemplar: list[float]


@dataclass(frozen=True)
class Comparison:
    """What `compare` found.

    Parameters
    ----------
    figures : dict of str to Figure
        By name, in the order of reading.
    curves : dict of str to Curve or Histogram
        ``two_point``, ``two_point_z``, ``two_point_y``, ``two_point_x``; for gray volumes
        ``histogram``.
    threshold : float
        The exemplar's value that parts solid from pore.
    solid : {"bright", "dark"}
        Which side is solid.
    kind : {"gray", "binary", "label"}
        What the exemplar's values mean.
    subvolume_shape : (int, int, int)
        Shape of the sub-volumes.
    samples : dict of str to Samples
        The metrics of the sub-volumes, by name.
    voxel_size : (float, float, float)
        Of the synthetic volume.
    unit : str
        Unit of the voxel size; ``"voxel"`` if it is unknown.
    """

    figures: dict[str, Figure]
    curves: dict[str, Any]
    threshold: float
    solid: Literal["bright", "dark"]
    kind: Literal["gray", "binary", "label"]
    subvolume_shape: tuple[int, int, int]
    samples: dict[str, Samples] = field(default_factory=dict)
    voxel_size: tuple[float, float, float] = (1.0, 1.0, 1.0)
    unit: str = "voxel"

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as flat JSON.

        Each under its name, and what is known of it under ``<name>_exemplar``, ``<name>_low``,
        ``<name>_high`` and ``<name>_mark``; undefined numbers are None. Lengths are in voxels and,
        if the voxel size is known, as ``<name>_in_unit`` in ``unit`` (of voxels that are not
        cubic, by the cube root of their volume); densities likewise.
        """
        result: dict[str, Any] = {}
        edge = math.prod(self.voxel_size) ** (1 / 3)
        for name, figure in self.figures.items():
            numbers = {
                name: figure.value,
                f"{name}_exemplar": figure.exemplar,
                f"{name}_low": figure.low,
                f"{name}_high": figure.high,
            }
            if figure.power and self.unit != "voxel":
                numbers[f"{name}_in_unit"] = figure.value * edge**figure.power
            result |= {
                key: json_number(value)
                for key, value in numbers.items()
                if value is not None or key == name
            }
            result[f"{name}_mark"] = figure.mark
        return result | {
            "kind": self.kind,
            "threshold": self.threshold,
            "solid": self.solid,
            "subvolume_shape": list(self.subvolume_shape),
            "voxel_size": list(self.voxel_size),
            "unit": self.unit,
        }


def mark(
    value: float,
    ideal: float,
    low: float | None,
    high: float | None,
    *,
    tolerance: float = 0.0,
    better: Better = "equal",
) -> Mark:
    """Judge a figure: the one rule for all of them.

    Parameters
    ----------
    value : float
        The figure.
    ideal : float
        What it would be at best: the exemplar's own value, 0 for an error, 1 for a ratio.
    low, high : float or None
        Range over the exemplar's sub-volumes.
    tolerance : float, default 0
        Deviation from the ideal that is accepted even if the range is narrower.
    better : {"equal", "smaller", "larger"}, default "equal"
        A figure of which less (or more) is better is not judged on that side of the ideal.

    Returns
    -------
    {"pass", "near", "off", "info"}
        "pass" inside the range, which always reaches from the ideal as far as the tolerance;
        "near" inside the range when it is stretched to twice its reach from the ideal; "off"
        beyond; "info" for an undefined value.
    """
    if math.isnan(value) or math.isnan(ideal):
        return "info"
    deviation = value - ideal
    if (better == "smaller" and deviation <= 0) or (better == "larger" and deviation >= 0):
        return "pass"
    if deviation > 0:
        reach = max(tolerance, high - ideal if high is not None else 0.0)
    else:
        reach = max(tolerance, ideal - low if low is not None else 0.0)
    if abs(deviation) <= reach:
        return "pass"
    return "near" if abs(deviation) <= 2 * reach else "off"


class Figures(dict[str, Figure]):
    """Figures by name."""

    def add(
        self,
        name: str,
        value: float,
        description: str,
        *,
        exemplar: float | None = None,
        parts: Iterable[float] = (),
        unit: str = "",
        power: int = 0,
        ideal: float | None = None,
        tolerance: float | None = None,
        better: Better = "equal",
    ) -> None:
        """Add a figure, judged if a tolerance is given; the ideal is the exemplar's value."""
        defined = [float(p) for p in parts if not math.isnan(p)]
        low, high = (min(defined), max(defined)) if defined else (None, None)
        ideal = exemplar if ideal is None else ideal
        verdict: Mark = "info"
        if tolerance is not None and ideal is not None:
            verdict = mark(value, ideal, low, high, tolerance=tolerance, better=better)
        unit = unit or unit_of("voxel", power)
        self[name] = Figure(name, value, exemplar, low, high, verdict, unit, description, power)
