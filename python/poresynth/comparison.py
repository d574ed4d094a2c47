"""A synthetic volume beside its exemplar, in numbers.

Every figure stands against the exemplar's own spread: the same quantity of random sub-volumes of
the exemplar, which says how much one specimen of the material differs from another.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from poresynth import metrics
from poresynth.errors import ParameterError
from poresynth.metrics.arguments import whole_number
from poresynth.metrics.connectivity import FLOATING, size_distance
from poresynth.metrics.copying import EDGES
from poresynth.metrics.correlation import R_MAX, relative_error
from poresynth.metrics.intensity import count_levels
from poresynth.metrics.structure import Structure, first_channel
from poresynth.preprocess import is_two_valued
from poresynth.volume import Volume, as_volume

__all__ = ["Comparison", "Curve", "Figure", "Histogram", "compare", "mark"]

Mark = Literal["pass", "near", "off", "info"]
Better = Literal["equal", "smaller", "larger"]
_Phase = npt.NDArray[np.bool_]
_Voxels = npt.NDArray[Any]

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
    """

    name: str
    value: float
    exemplar: float | None = None
    low: float | None = None
    high: float | None = None
    mark: Mark = "info"
    unit: str = ""
    description: str = ""


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
    voxel_size: tuple[float, float, float] = (1.0, 1.0, 1.0)
    unit: str = "voxel"

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as flat JSON.

        Each under its name, and what is known of it under ``<name>_exemplar``, ``<name>_low``,
        ``<name>_high`` and ``<name>_mark``; undefined numbers are None. Lengths are in voxels and,
        if the voxel size is known, as ``<name>_in_unit`` in ``unit`` (of voxels that are not
        cubic, by the cube root of their volume).
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
            if figure.unit == "voxel" and self.unit != "voxel":
                numbers[f"{name}_in_unit"] = figure.value * edge
            result |= {
                key: _json_number(value)
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


def compare(
    exemplar: Volume | npt.ArrayLike,
    volume: Volume | npt.ArrayLike,
    *,
    threshold: float | None = None,
    solid: Literal["bright", "dark"] = "bright",
    subvolumes: int = 8,
    seed: int = 0,
    threads: int = 0,
    progress: Callable[[str, float], object] | None = None,
) -> Comparison:
    """Compare a synthetic volume with its exemplar.

    Parameters
    ----------
    exemplar, volume : Volume or array_like
        Shapes (z, y, x) or (z, y, x, channel), of which the first channel is compared. Gray,
        binary or labels; the sizes may differ.
    threshold : float, optional
        Value that parts solid from pore in both. Default: Otsu's of the exemplar; the middle of
        two values; the middle of the two lowest labels, so that all but the lowest are solid. A
        volume of two values is cut midway in any case.
    solid : {"bright", "dark"}, default "bright"
        Which side of the threshold is solid.
    subvolumes : int, default 8
        Random sub-volumes, at least 2, of half of the exemplar's edges (less where the volume is
        smaller): of the exemplar for its own spread, and as many of the volume for what depends on
        size. Eight show the spread to about a quarter of itself.
    seed : int, default 0
        Picks the sub-volumes and the blocks of the novelty.
    threads : int, default 0
        Number of threads; 0 takes all cores. The figures do not depend on it.
    progress : callable, optional
        Called with what is being done and the share of the whole that is done.

    Returns
    -------
    Comparison
        Its figures, judged by `mark`:

        - ``porosity``, and of labels ``phase_fraction_<label>``: shares of the volume.
        - ``porosity_error_percent``: 100 · |ε_E − ε_S| / ε_E.
        - ``two_point_error_percent``: D2 of `poresynth.metrics.two_point_error`, r = 1 … 50.
        - ``components``, ``floating_parts``: counts in the whole volumes, for information, as they
          grow with the volume; ``components_per_million`` and ``floating_parts_per_million`` are
          means over sub-volumes of one size in both, per 10⁶ voxels.
        - ``component_wasserstein``: `poresynth.metrics.component_wasserstein` of the components of
          all sub-volumes of one and the other.
        - ``largest_component_fraction``: share of the solid in its largest component.
        - ``gradient_ratio``, ``seam``, and of gray volumes ``histogram_distance`` and
          ``histogram_distance_percent``: see `poresynth.metrics`. Two-valued volumes are compared
          as 0 and 1.
        - ``copy_fraction``, ``mean_copied_block``: from the volume's record, where an engine that
          copies made it: share of the voxels whose neighbours come from the neighbouring place of
          the exemplar, and edge of the volume-weighted mean copied block in voxels.
        - ``novelty_<edge>`` and ``novelty_<edge>_mirrors``: `poresynth.metrics.novelty`.

    Raises
    ------
    ParameterError
        If a volume is empty, constant or not finite, or a parameter is outside its range.

    Notes
    -----
    Structure and novelty belong together: a copy of the exemplar passes every figure but novelty.
    All boundaries are open. Peak memory: 6 bytes a voxel of the volume, 28 of the exemplar.
    """
    whole_e, whole_v = as_volume(exemplar), as_volume(volume)
    count = whole_number("subvolumes", subvolumes, 2)
    whole_number("seed", seed, 0)
    if whole_e.channels != whole_v.channels:
        allowed = f"must be {whole_e.channels}, as of the exemplar"
        raise ParameterError("volume.channels", whole_v.channels, allowed)
    structure = Structure.of(whole_e, threshold, solid, "exemplar")
    e, v = _specimens(whole_e, whole_v, structure)
    z, y, x = (max(1, min(n // 2, m)) for n, m in zip(e.solid.shape, v.solid.shape, strict=True))
    random = np.random.default_rng(seed)
    parts_e, parts_v = (whole.parts((z, y, x), count, random) for whole in (e, v))
    tell = progress or (lambda stage, share: None)

    figures = _Figures()
    tell("comparing structure", 0.0)
    _add_amounts(figures, structure, e, v, parts_e)
    curves = _add_correlation(figures, e, v, parts_e, threads)
    _add_components(figures, e, v, parts_e, parts_v, threads)
    tell("comparing gray values", 0.2)
    _add_sharpness(figures, e, v, parts_e)
    if structure.kind == "gray":
        curves["histogram"] = _add_gray_levels(figures, e, v, parts_e)
    _add_copying(figures, whole_v)
    for i, edge in enumerate(EDGES):
        tell("looking for copies", 0.4 + 0.2 * i)
        _add_novelty(figures, e, v, edge, seed, threads)
    tell("looking for copies", 1.0)
    return Comparison(
        figures=dict(figures),
        curves=curves,
        threshold=structure.threshold,
        solid=structure.solid,
        kind=structure.kind,
        subvolume_shape=(z, y, x),
        voxel_size=whole_v.voxel_size,
        unit=whole_v.unit,
    )


@dataclass(frozen=True)
class _Specimen:
    """A volume, or a part of one."""

    gray: _Voxels
    solid: _Phase

    def parts(
        self, shape: tuple[int, int, int], count: int, random: np.random.Generator
    ) -> list[_Specimen]:
        """Return sub-volumes at random places."""
        room = [n - m + 1 for n, m in zip(self.solid.shape, shape, strict=True)]
        boxes = [
            tuple(slice(i, i + m) for i, m in zip(start, shape, strict=True))
            for start in random.integers(0, room, (count, 3))
        ]
        return [_Specimen(self.gray[box], self.solid[box]) for box in boxes]


def _specimens(exemplar: Volume, volume: Volume, structure: Structure) -> Iterator[_Specimen]:
    grays = first_channel(exemplar, "exemplar"), first_channel(volume, "volume")
    # The values of two-valued volumes are names: {0, 1} and {0, 255} are the same.
    binary = structure.kind == "binary" and is_two_valued(grays[1])
    for gray in grays:
        solid = structure.cut(gray)
        yield _Specimen(solid if binary else gray, solid)


class _Figures(dict[str, Figure]):
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
        self[name] = Figure(name, value, exemplar, low, high, verdict, unit, description)


def _add_amounts(
    figures: _Figures, structure: Structure, e: _Specimen, v: _Specimen, parts: list[_Specimen]
) -> None:
    own, new, *others = (metrics.porosity(s.solid) for s in (e, v, *parts))

    def error(porosity: float) -> float:
        return 100 * abs(own - porosity) / own

    figures.add(
        "porosity", new, "share of pore; ± 0.01 passes", exemplar=own, parts=others, tolerance=0.01
    )
    figures.add(
        "porosity_error_percent",
        error(new),
        "difference of porosity, relative to the exemplar's; 1 % passes",
        exemplar=0.0,
        parts=map(error, others),
        unit="%",
        tolerance=1.0,
        better="smaller",
    )
    for label in structure.labels:
        own, new, *others = (float(np.mean(s.gray == label)) for s in (e, v, *parts))
        figures.add(
            f"phase_fraction_{label}",
            new,
            f"share of the phase {label}; ± 0.01 passes",
            exemplar=own,
            parts=others,
            tolerance=0.01,
        )


def _add_correlation(
    figures: _Figures, e: _Specimen, v: _Specimen, parts: list[_Specimen], threads: int
) -> dict[str, Any]:
    own, new, *others = (
        metrics.two_point_correlation(s.solid, threads=threads) for s in (e, v, *parts)
    )
    figures.add(
        "two_point_error_percent",
        relative_error(new.radial, own.radial),
        f"D2: difference of the two-point correlations, r = 1 … {R_MAX}; 2 % passes",
        exemplar=0.0,
        parts=(relative_error(other.radial, own.radial) for other in others),
        unit="%",
        tolerance=2.0,
        better="smaller",
    )
    curves: dict[str, Any] = {}
    for name in ("radial", "z", "y", "x"):
        ours, theirs = getattr(new, name), getattr(own, name)
        band = np.array([getattr(other, name) for other in others])
        # A small volume holds no long segments.
        known = np.isfinite(ours) & np.isfinite(theirs) & np.isfinite(band).all(axis=0)
        curves["two_point" if name == "radial" else f"two_point_{name}"] = Curve(
            r=own.r[known].tolist(),
            volume=ours[known].tolist(),
            exemplar=theirs[known].tolist(),
            low=band.min(axis=0)[known].tolist(),
            high=band.max(axis=0)[known].tolist(),
        )
    return curves


def _add_components(
    figures: _Figures,
    e: _Specimen,
    v: _Specimen,
    parts_e: list[_Specimen],
    parts_v: list[_Specimen],
    threads: int,
) -> None:
    def sizes(specimen: _Specimen) -> npt.NDArray[np.uint64]:
        return metrics.component_sizes(specimen.solid, threads=threads)

    def largest(found: npt.NDArray[np.uint64]) -> float:
        return float(found.max() / found.sum()) if len(found) else 0.0

    own, new = sizes(e), sizes(v)
    own_parts, new_parts = ([sizes(part) for part in parts] for parts in (parts_e, parts_v))
    per_million = 1e6 / parts_e[0].solid.size
    counts: dict[str, tuple[Callable[[npt.NDArray[np.uint64]], float], str]] = {
        "components": (len, "26-connected parts of the solid"),
        "floating_parts": (
            lambda found: int(np.count_nonzero(found < FLOATING)),
            f"parts of fewer than {FLOATING} voxels",
        ),
    }
    for name, (count, what) in counts.items():
        figures.add(name, count(new), f"{what}, in all", exemplar=count(own))
        scaled, new_scaled = (
            [per_million * count(found) for found in parts] for parts in (own_parts, new_parts)
        )
        figures.add(
            f"{name}_per_million",
            float(np.mean(new_scaled)),
            f"{what}, in 10⁶ voxels of sub-volumes of one size; 10 more pass",
            exemplar=float(np.mean(scaled)),
            parts=scaled,
            tolerance=10.0,
            better="smaller",
        )
    figures.add(
        "largest_component_fraction",
        largest(new),
        "share of the solid in its largest part; 0.01 less passes",
        exemplar=largest(own),
        parts=map(largest, own_parts),
        tolerance=0.01,
        better="larger",
    )
    percent = 100 / parts_e[0].solid.size
    pool, new_pool = (percent * np.concatenate(found) for found in (own_parts, new_parts))
    figures.add(
        "component_wasserstein",
        size_distance(pool, new_pool),
        "difference of the sizes of the parts, in percent of a sub-volume",
        exemplar=0.0,
        parts=(size_distance(pool, percent * found) for found in own_parts),
        unit="%",
        tolerance=0.0,
        better="smaller",
    )


def _add_sharpness(figures: _Figures, e: _Specimen, v: _Specimen, parts: list[_Specimen]) -> None:
    figures.add(
        "gradient_ratio",
        metrics.gradient_ratio(e.gray, v.gray),
        "sharpness, relative to the exemplar; ± 0.05 passes",
        exemplar=1.0,
        parts=(metrics.gradient_ratio(e.gray, part.gray) for part in parts),
        tolerance=0.05,
    )
    figures.add(
        "seam",
        metrics.seam(e.gray, v.gray),
        "largest jump from plane to plane, relative to the exemplar; 1.5 passes",
        exemplar=1.0,
        tolerance=0.5,
        better="smaller",
    )


def _add_gray_levels(
    figures: _Figures, e: _Specimen, v: _Specimen, parts: list[_Specimen]
) -> Histogram:
    new, *others = (metrics.histogram_distance(e.gray, s.gray) for s in (v, *parts))
    figures.add(
        "histogram_distance",
        new.gray_levels,
        "mean difference of gray values of one rank",
        exemplar=0.0,
        parts=(other.gray_levels for other in others),
        unit="gray levels",
    )
    figures.add(
        "histogram_distance_percent",
        new.percent,
        "the same, relative to the exemplar's standard deviation; 2 % passes",
        exemplar=0.0,
        parts=(other.percent for other in others),
        unit="%",
        tolerance=2.0,
        better="smaller",
    )
    counts = count_levels(e.gray, v.gray)
    step = float(counts.levels[1] - counts.levels[0])
    # Whole levels in each bin, so that no bin is fuller than its neighbours by rounding.
    width = -(-len(counts.levels) // BINS)
    starts = np.arange(0, len(counts.levels), width)
    shares = [
        (np.add.reduceat(count, starts) / count.sum()).tolist()
        for count in (counts.volume, counts.exemplar)
    ]
    edges = counts.levels[0] + step * (width * np.arange(len(starts) + 1) - 0.5)
    return Histogram(edges.tolist(), *shares)


def _add_copying(figures: _Figures, volume: Volume) -> None:
    record = volume.metadata.get("poresynth", {}).get("copying") or {}
    if "copy_fraction" in record:
        figures.add("copy_fraction", record["copy_fraction"], "share of verbatim continuations")
    if "mean_copied_block" in record:
        what = "edge of the mean verbatim block, weighted by volume"
        figures.add("mean_copied_block", record["mean_copied_block"], what, unit="voxel")


def _add_novelty(
    figures: _Figures, e: _Specimen, v: _Specimen, edge: int, seed: int, threads: int
) -> None:
    found = metrics.novelty(e.gray, v.gray, edge, seed=seed, threads=threads)
    what = f"blocks of {edge}³: 0 is copied, 1 as new as another specimen"
    for name, value, against in (
        (f"novelty_{edge}", found.plain, ""),
        (f"novelty_{edge}_mirrors", found.mirrored, ", mirrored copies counted"),
    ):
        figures.add(
            name,
            value,
            f"{what}{against}; 0.6 passes",
            ideal=1.0,
            tolerance=0.4,
            better="larger",
        )


def _json_number(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None
