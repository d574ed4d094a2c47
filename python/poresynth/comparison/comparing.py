"""Measuring a synthetic volume and its exemplar in the same way.

Every figure stands against the exemplar's own spread: the same quantity of random sub-volumes of
the exemplar, which says how much one specimen of the material differs from another.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from poresynth import metrics
from poresynth.comparison.result import (
    Comparison,
    Curve,
    Figures,
    Histogram,
    Samples,
    VolumeComparison,
)
from poresynth.comparison.sections import compare_sections
from poresynth.errors import ParameterError
from poresynth.metrics.arguments import whole_number
from poresynth.metrics.connectivity import FLOATING, largest_share, size_distance
from poresynth.metrics.copying import EDGES
from poresynth.metrics.correlation import R_MAX, relative_error
from poresynth.metrics.registry import METRICS, finite_mean
from poresynth.metrics.sections import Images
from poresynth.metrics.specimen import Specimen
from poresynth.metrics.structure import Structure, first_channel
from poresynth.preprocess import is_two_valued
from poresynth.volume import Volume, as_volume

__all__ = ["compare"]

_Phase = npt.NDArray[np.bool_]
_Voxels = npt.NDArray[Any]

# Windows of a smaller edge hold no structure to compare.
SMALLEST_WINDOW = 16


def compare(
    exemplar: Images,
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
        binary or labels; the sizes may differ. An exemplar of one slice, or a mapping of such
        images by axis, is compared with sections of the volume: `compare_sections` says how.
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
        A `VolumeComparison`, or a `SectionComparison` with images. Its figures, judged by `mark`:

        - ``end_point_density``, ``euler_density``, then thicknesses, surface, fabric and all else
          in `poresynth.metrics.METRICS` that has a tolerance: means over sub-volumes of one size
          in both, beside the range over the exemplar's. The first two tell a good structure from
          a poor one.
        - ``structure_error_percent``: `poresynth.metrics.structure_error`.
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
    whole_v = as_volume(volume)
    if isinstance(exemplar, Mapping) or as_volume(exemplar).shape[0] == 1 < whole_v.shape[0]:
        return compare_sections(
            exemplar,
            whole_v,
            threshold=threshold,
            solid=solid,
            threads=threads,
            progress=progress,
        )
    whole_e = as_volume(exemplar)
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

    figures = Figures()
    tell("comparing structure", 0.0)
    samples = _add_metrics(figures, parts_e, parts_v, whole_v.voxel_size, threads)
    tell("comparing windows", 0.2)
    _add_structure_error(figures, e, v, threads)
    tell("comparing correlations", 0.4)
    _add_amounts(figures, structure, e, v, parts_e)
    curves = _add_correlation(figures, e, v, parts_e, threads)
    _add_components(figures, e, v, parts_e, parts_v, threads)
    tell("comparing gray values", 0.5)
    _add_sharpness(figures, e, v, parts_e)
    if structure.kind == "gray":
        _add_gray_levels(figures, e, v, parts_e)
        curves["histogram"] = Histogram.of(v.gray, e.gray)
    figures.add_copying(whole_v)
    for i, edge in enumerate(EDGES):
        tell("looking for copies", 0.55 + 0.15 * i)
        _add_novelty(figures, e, v, edge, seed, threads)
    tell("looking for copies", 1.0)
    return VolumeComparison(
        figures=dict(figures),
        curves=curves,
        threshold=structure.threshold,
        solid=structure.solid,
        kind=structure.kind,
        subvolume_shape=(z, y, x),
        samples=samples,
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


def _add_metrics(
    figures: Figures,
    parts_e: list[_Specimen],
    parts_v: list[_Specimen],
    voxel_size: tuple[float, float, float],
    threads: int,
) -> dict[str, Samples]:
    chosen = [metric for metric in METRICS.values() if metric.tolerance is not None]
    sides: list[list[list[float]]] = []
    for parts in (parts_e, parts_v):
        specimens = (Specimen(part.solid, voxel_size, threads) for part in parts)
        sides.append([[metric.function(s) for metric in chosen] for s in specimens])
    samples = {}
    for i, metric in enumerate(chosen):
        own, new = ([float(values[i]) for values in side] for side in sides)
        samples[metric.name] = Samples(own, new)
        mean = finite_mean(own)
        tolerance = (metric.tolerance or 0.0) * abs(mean)
        figures.add(
            metric.name,
            finite_mean(new),
            f"{metric.description}; ± {100 * (metric.tolerance or 0):.0f} % passes",
            exemplar=mean,
            parts=own,
            power=metric.power,
            tolerance=tolerance,
            better=metric.better,
        )
    return samples


def _add_structure_error(figures: Figures, e: _Specimen, v: _Specimen, threads: int) -> None:
    shortest = min(*e.solid.shape, *v.solid.shape)
    if shortest // 2 < SMALLEST_WINDOW:
        return
    figures.add(
        "structure_error_percent",
        metrics.structure_error(e.solid, v.solid, threads=threads).percent,
        "mean difference of connectivity, dead ends, thickness and surface; 6 % passes",
        exemplar=0.0,
        unit="%",
        tolerance=6.0,
        better="smaller",
    )


def _add_amounts(
    figures: Figures, structure: Structure, e: _Specimen, v: _Specimen, parts: list[_Specimen]
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
    figures: Figures, e: _Specimen, v: _Specimen, parts: list[_Specimen], threads: int
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
        curves["two_point" if name == "radial" else f"two_point_{name}"] = Curve.of(
            getattr(new, name), getattr(own, name), [getattr(other, name) for other in others]
        )
    return curves


def _add_components(
    figures: Figures,
    e: _Specimen,
    v: _Specimen,
    parts_e: list[_Specimen],
    parts_v: list[_Specimen],
    threads: int,
) -> None:
    def sizes(specimen: _Specimen) -> npt.NDArray[np.uint64]:
        return metrics.component_sizes(specimen.solid, threads=threads)

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
        largest_share(new),
        "share of the solid in its largest part; 0.01 less passes",
        exemplar=largest_share(own),
        parts=map(largest_share, own_parts),
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


def _add_sharpness(figures: Figures, e: _Specimen, v: _Specimen, parts: list[_Specimen]) -> None:
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


def _add_gray_levels(figures: Figures, e: _Specimen, v: _Specimen, parts: list[_Specimen]) -> None:
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


def _add_novelty(
    figures: Figures, e: _Specimen, v: _Specimen, edge: int, seed: int, threads: int
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
