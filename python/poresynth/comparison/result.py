"""What a comparison finds, and the rule that judges it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from poresynth.metrics.intensity import count_levels
from poresynth.metrics.measurement import json_number
from poresynth.metrics.registry import unit_of
from poresynth.volume import Volume

__all__ = [
    "Comparison",
    "Curve",
    "Figure",
    "Figures",
    "Histogram",
    "Samples",
    "SectionComparison",
    "VolumeComparison",
    "mark",
]

Mark = Literal["pass", "near", "off", "info"]
Better = Literal["equal", "smaller", "larger"]
_Curve = npt.NDArray[np.float64]

# Most bins of a histogram.
BINS = 128


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
    error_percent : float, optional
        Difference from the exemplar, relative to its value: of figures of sections.
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
    error_percent: float | None = None


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

    @classmethod
    def of(cls, volume: _Curve, exemplar: _Curve, parts: Sequence[_Curve]) -> Curve:
        """Put correlations together, as far as all are known: small parts hold no long segments.

        Parameters
        ----------
        volume, exemplar : numpy.ndarray
            Values for r = 0, 1, …, NaN where there are none, shape (n,).
        parts : sequence of numpy.ndarray
            The same of the exemplar's sub-volumes.

        Returns
        -------
        Curve
        """
        band = np.array(parts)
        known = np.isfinite(volume) & np.isfinite(exemplar) & np.isfinite(band).all(axis=0)
        return cls(
            r=np.flatnonzero(known).tolist(),
            volume=volume[known].tolist(),
            exemplar=exemplar[known].tolist(),
            low=band.min(axis=0)[known].tolist(),
            high=band.max(axis=0)[known].tolist(),
        )


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

    @classmethod
    def of(cls, volume: npt.NDArray[Any], exemplar: npt.NDArray[Any]) -> Histogram:
        """Count the gray values of two volumes, shapes (z, y, x), in bins of whole levels."""
        counts = count_levels(exemplar, volume)
        step = float(counts.levels[1] - counts.levels[0]) if len(counts.levels) > 1 else 1.0
        # Whole levels in each bin, so that no bin is fuller than its neighbours by rounding.
        width = -(-len(counts.levels) // BINS)
        starts = np.arange(0, len(counts.levels), width)
        shares = [
            (np.add.reduceat(count, starts) / count.sum()).tolist()
            for count in (counts.volume, counts.exemplar)
        ]
        edges = counts.levels[0] + step * (width * np.arange(len(starts) + 1) - 0.5)
        return cls(edges.tolist(), *shares)


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """What `compare` found.

    Parameters
    ----------
    figures : dict of str to Figure
        By name, in the order of reading.
    curves : dict of str to Curve or Histogram
        By name.
    threshold : float
        The exemplar's value that parts solid from pore.
    solid : {"bright", "dark"}
        Which side is solid.
    kind : {"gray", "binary", "label"}
        What the exemplar's values mean.
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
            "voxel_size": list(self.voxel_size),
            "unit": self.unit,
        }


@dataclass(frozen=True, kw_only=True)
class VolumeComparison(Comparison):
    """A volume beside a volume.

    Its curves are ``two_point``, ``two_point_z``, ``two_point_y``, ``two_point_x``, and for gray
    volumes ``histogram``.

    Parameters
    ----------
    subvolume_shape : (int, int, int)
        Shape of the sub-volumes.
    samples : dict of str to Samples
        The metrics of the sub-volumes, by name.
    """

    subvolume_shape: tuple[int, int, int]
    samples: dict[str, Samples] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as `Comparison.to_dict` does, and the shape of the sub-volumes."""
        return super().to_dict() | {"subvolume_shape": list(self.subvolume_shape)}


@dataclass(frozen=True, kw_only=True)
class SectionComparison(Comparison):
    """Sections of a volume beside images.

    Figures of sections end in the name of their plane: that of the axis that it is across, or
    ``diagonal``. Curves are ``two_point_<plane>``, and for gray images ``histogram_<axis>`` or
    ``histogram_<channel>_<axis>``, of several axes of one image the first.

    Parameters
    ----------
    planes : tuple of tuples of str
        Names of the planes that are compared with each of the images.
    window : int
        Edge of the windows in which slices and images were measured.
    """

    planes: tuple[tuple[str, ...], ...]
    window: int

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as `Comparison.to_dict` does, with the errors of those of sections.

        That of ``<name>_<plane>`` is ``<name>_error_percent_<plane>``, without its sign.
        """
        result = super().to_dict()
        for name, figure in self.figures.items():
            if figure.error_percent is not None:
                stem, _, plane = name.rpartition("_")
                result[f"{stem}_error_percent_{plane}"] = json_number(abs(figure.error_percent))
        return result | {"planes": [list(group) for group in self.planes], "window": self.window}


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
        error_percent: float | None = None,
    ) -> None:
        """Add a figure, judged if a tolerance is given; the ideal is the exemplar's value."""
        defined = [float(p) for p in parts if not math.isnan(p)]
        low, high = (min(defined), max(defined)) if defined else (None, None)
        ideal = exemplar if ideal is None else ideal
        verdict: Mark = "info"
        if tolerance is not None and ideal is not None:
            verdict = mark(value, ideal, low, high, tolerance=tolerance, better=better)
        unit = unit or unit_of("voxel", power)
        self[name] = Figure(
            name, value, exemplar, low, high, verdict, unit, description, power, error_percent
        )

    def add_copying(self, volume: Volume) -> None:
        """Add what the record of a volume says of copying, where an engine that copies made it."""
        record = volume.metadata.get("poresynth", {}).get("copying") or {}
        if "copy_fraction" in record:
            self.add("copy_fraction", record["copy_fraction"], "share of verbatim continuations")
        if "mean_copied_block" in record:
            what = "edge of the mean verbatim block, weighted by volume"
            self.add("mean_copied_block", record["mean_copied_block"], what, power=1)
