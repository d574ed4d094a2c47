"""Measuring sections of a volume and the images that they shall look like in the same way.

An image says nothing of the third dimension, so that a volume made from images is judged by its
sections. Every figure stands against the image's own spread: the same of parts of the image, by
default its quarters.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, cast

import numpy as np
import numpy.typing as npt

from poresynth import metrics
from poresynth.comparison.result import Curve, Figures, Histogram, SectionComparison
from poresynth.errors import ParameterError
from poresynth.metrics.connectivity import FLOATING, largest_share
from poresynth.metrics.correlation import R_MAX, relative_error
from poresynth.metrics.registry import finite_mean
from poresynth.metrics.sections import SECTION_AXES, Images, as_images
from poresynth.metrics.slice_statistics import (
    MOST_WINDOWS,
    SLICE_FIGURES,
    SliceStatistics,
    mean_error,
    percent_error,
    window_boxes,
)
from poresynth.metrics.structure import Structure, first_channel
from poresynth.metrics.transport import Axis
from poresynth.preprocess import is_two_valued
from poresynth.volume import Volume, as_volume

__all__ = ["DIAGONAL", "compare_sections"]

_Phase = npt.NDArray[np.bool_]
_Voxels = npt.NDArray[Any]
_Curve = npt.NDArray[np.float64]

DIAGONAL = "diagonal"
"""Name of the planes that hold the z axis and halve the angle between y and x."""

COLOURS = ("red", "green", "blue")


class _Rule(NamedTuple):
    """How a figure of sections is judged.

    ``share`` and ``plain`` are what passes, as a share of the image's own value or as it is;
    ``diagonal`` says what is made of it in diagonals.
    """

    description: str
    power: int = 0
    share: float = 0.1
    plain: float = 0.0
    diagonal: Literal["judged", "told", "left out"] = "judged"


# By the beginnings of the figures' names. Ten percent is what two slices of one material differ by
# at least; 1 and 2 % of the gray values are what prieto_2011, Table 1, attains. Resampling makes up
# to 43 % more tips and changes parts and holes, and it smooths gray values, while widths and
# perimeters stay within 9 %.
RULES = {
    "porosity": _Rule("share of pore; ± 0.01 passes", share=0.0, plain=0.01),
    "thickness": _Rule("mean local thickness of the solid, a diameter; ± 10 % passes", 1),
    "spacing": _Rule("mean local thickness of the pore, a diameter; ± 10 % passes", 1),
    "perimeter": _Rule("border of the solid per area; ± 10 % passes", -1),
    "components": _Rule("parts of the solid in 10⁴ pixels; ± 10 % or one passes", diagonal="told"),
    "holes": _Rule(
        "pores that solid encloses in 10⁴ pixels; ± 10 % or one passes", diagonal="told"
    ),
    "tips": _Rule("skeleton's ends in 10⁴ pixels; ± 10 % or one passes", diagonal="told"),
    "gradient": _Rule(
        "mean difference of neighbouring pixels; ± 5 % passes", share=0.05, diagonal="left out"
    ),
    "mean": _Rule("mean of the gray values; ± 1 % passes", share=0.01, diagonal="left out"),
    "standard_deviation": _Rule(
        "standard deviation of the gray values; ± 2 % passes", share=0.02, diagonal="left out"
    ),
}


def compare_sections(
    images: Images,
    volume: Volume | npt.ArrayLike,
    *,
    threshold: float | None = None,
    solid: Literal["bright", "dark"] = "bright",
    threads: int = 0,
    progress: Callable[[str, float], object] | None = None,
) -> SectionComparison:
    """Compare sections of a volume with the images that they shall look like.

    Parameters
    ----------
    images : mapping, or Volume or array_like
        The image of the planes across an axis, by ``"z"``, ``"y"``, ``"x"``, or some of them:
        shape (1, y, x) or (1, y, x, channel), rows and columns as of `poresynth.metrics.sections`.
        Gray, binary or labels; of several channels the first decides what is solid. An image alone
        stands for all three axes; only then the material may be the same in all directions, and
        diagonal sections are compared, too.
    volume : Volume or array_like
        Shape (z, y, x) or (z, y, x, channel), with pixels of the size of the images'; larger or
        smaller than they are.
    threshold : float, optional
        Value that parts solid from pore everywhere. Default: as of `poresynth.compare`, from all
        the images together.
    solid : {"bright", "dark"}, default "bright"
        Which side of the threshold is solid.
    threads : int, default 0
        Number of threads; 0 takes all cores. The figures do not depend on it.
    progress : callable, optional
        Called with what is being done and the share of the whole that is done.

    Returns
    -------
    SectionComparison
        Its figures, judged by `poresynth.comparison.mark` against the range over parts of the
        image, windows of half its smaller edge (less where the volume is smaller):

        - ``slice_score_percent``: `poresynth.metrics.slice_score`.
        - ``porosity``, ``porosity_error_percent``, and of labels ``phase_fraction_<label>``: of the
          volume, beside the mean over the axes of their images.
        - ``two_point_error_percent``: the mean over the axes of the following.
        - ``components``, ``floating_parts``, ``largest_component_fraction``,
          ``largest_pore_fraction``: of the volume, for information; images do not determine them.
        - ``copy_fraction``, ``mean_copied_block``: from the volume's record, as of `compare`.

        For each plane, ``z``, ``y``, ``x`` or ``diagonal``:

        - ``porosity_<plane>``.
        - ``two_point_error_percent_<plane>``: D2 = 100 · ‖P_S − P_E‖ / ‖P_E‖ over r = 1 … 50
          pixels, at most half of the smallest edge of images and slices, where P_E is the radial
          two-point correlation of the image and P_S the mean of those of the slices.
        - ``gradient_<plane>``: mean absolute difference of neighbours in the plane, of the first
          channel.
        - ``components``, ``holes``, ``tips``, ``perimeter``, ``thickness``, ``spacing``, each with
          ``_<plane>``: `poresynth.metrics.slice_statistics`, means over windows of one size.
        - ``mean_<channel>_<plane>``, ``standard_deviation_<channel>_<plane>`` (``mean_<plane>``
          of one channel): gray values, prieto_2011 Table 1.

    Raises
    ------
    ParameterError
        If there is no image, one is no image, or empty, constant or not finite as the volume must
        not be either, channels differ, or a parameter is outside its range.

    Notes
    -----
    At most 32 slices across each axis, evenly spaced, and 9 diagonals stand for all. Gray values
    are not compared in diagonals, for resampling smooths them. Peak memory: 4 bytes a voxel of the
    volume.
    """
    pictures, whole = as_images(images), as_volume(volume)
    for axis, picture in pictures.items():
        if picture.channels != whole.channels:
            allowed = f"must be {picture.channels}, as of images.{axis}"
            raise ParameterError("volume.channels", whole.channels, allowed)
    structure = _structure(pictures, threshold, solid)
    groups = _groups(pictures, whole.shape)
    known, body = _stacks(pictures, whole, structure)
    slices = {plane: body.sections(plane) for group in groups for plane in group}
    scales = _Scales.of(known.values(), slices.values(), threads)
    names = _channel_names(whole) if structure.kind == "gray" or whole.channels > 1 else ()
    tell = progress or (lambda stage, share: None)

    sides: list[_Side] = []
    curves: dict[str, Any] = {}
    for group in groups:
        image = known[cast("Axis", group[0])]
        own = _measure(image, scales, names)
        parts = [_measure(part, scales, names) for part in image.parts(scales.window)]
        for plane in group:
            tell(f"comparing sections, {plane}", len(sides) / (len(slices) + 1))
            side = _Side(plane, own, _measure(slices[plane], scales, names), parts)
            curves[f"two_point_{plane}"] = side.curve()
            sides.append(side)
        for i, name in enumerate(names):
            curves[f"histogram{name}_{group[0]}"] = Histogram.of(
                body.levels[..., i], image.levels[..., i]
            )
    tell("comparing the whole", len(slices) / (len(slices) + 1))
    figures = Figures()
    across = [side for side in sides if side.plane != DIAGONAL]
    score = metrics.slice_score(
        {axis: stack.solid for axis, stack in known.items()}, body.solid, threads=threads
    )
    _add_headline(figures, score.percent, across)
    _add_phases(figures, structure, body, known)
    _add_connectivity(figures, body.solid, threads)
    figures.add_copying(whole)
    for side in sides:
        _add_plane(figures, side)
    tell("comparing the whole", 1.0)
    return SectionComparison(
        figures=dict(figures),
        curves=curves,
        threshold=structure.threshold,
        solid=structure.solid,
        kind=structure.kind,
        voxel_size=whole.voxel_size,
        unit=whole.unit,
        planes=groups,
        window=scales.window,
    )


def _channel_names(volume: Volume) -> tuple[str, ...]:
    """Return what stands for each channel in names of figures and curves; nothing for one."""
    if volume.channels == 1:
        return ("",)
    if volume.channels == len(COLOURS):
        return tuple(f"_{name}" for name in COLOURS)
    return tuple(f"_channel_{i}" for i in range(volume.channels))


@dataclass(frozen=True, eq=False)
class _Stack:
    """Slices of a volume, or an image: one slice.

    Shapes (slice, row, column); those of ``levels``, all gray values in whatever order, (…,
    channel).
    """

    gray: _Voxels
    solid: _Phase
    levels: _Voxels

    def sections(self, plane: str) -> _Stack:
        """Return the slices of a volume in a plane."""
        if plane == DIAGONAL:
            gray, solid = (metrics.diagonal_sections(array) for array in (self.gray, self.solid))
        else:
            axis = cast("Axis", plane)
            gray, solid = (metrics.sections(array, axis).array for array in (self.gray, self.solid))
        return _Stack(gray, solid, self.levels)

    def parts(self, edge: int) -> list[_Stack]:
        """Return the windows of an image."""
        boxes = window_boxes(self.solid.shape, (edge, edge))
        return [_Stack(self.gray[box], self.solid[box], self.levels[box]) for box in boxes]

    def chosen(self) -> list[tuple[_Voxels, _Phase]]:
        """Return slices that stand for all, each of shape (1, row, column)."""
        count = len(self.solid)
        places = np.linspace(0, count - 1, min(count, MOST_WINDOWS)).astype(int)
        return [(self.gray[i : i + 1], self.solid[i : i + 1]) for i in places]


@dataclass(frozen=True)
class _Scales:
    """Edge of the windows, longest distance of the correlation, threads."""

    window: int
    reach: int
    threads: int

    @classmethod
    def of(cls, images: Iterable[_Stack], slices: Iterable[_Stack], threads: int) -> _Scales:
        own, new = ([min(s.solid.shape[1:]) for s in stacks] for stacks in (images, slices))
        window = max(1, min(min(own) // 2, min(new)))
        return cls(window, min(R_MAX, min(*own, *new) // 2), threads)


@dataclass(frozen=True, eq=False)
class _Measured:
    """What is measured of slices: figures by name, in the order of reading."""

    figures: dict[str, float]
    statistics: SliceStatistics
    two_point: _Curve


@dataclass(frozen=True, eq=False)
class _Side:
    """Sections in a plane beside their image and its parts."""

    plane: str
    own: _Measured
    new: _Measured
    parts: list[_Measured]

    def curve(self) -> Curve:
        """Return the two-point correlations."""
        parts = [part.two_point for part in self.parts]
        return Curve.of(self.new.two_point, self.own.two_point, parts)

    def two_point_errors(self) -> tuple[float, list[float]]:
        """Return D2 of the sections, and of the parts of the image."""
        new, *parts = (
            relative_error(measured.two_point, self.own.two_point)
            for measured in (self.new, *self.parts)
        )
        return new, parts


def _measure(stack: _Stack, scales: _Scales, channels: Sequence[str]) -> _Measured:
    threads, chosen = scales.threads, stack.chosen()
    statistics = metrics.slice_statistics(stack.solid, window=scales.window, threads=threads)
    figures = {"porosity": metrics.porosity(stack.solid)}
    figures |= {name: getattr(statistics, name) for name in RULES if name in SLICE_FIGURES}
    figures["gradient"] = float(np.mean([metrics.mean_gradient(gray) for gray, _ in chosen]))
    levels = metrics.channel_statistics(stack.levels, threads=threads)
    for i, channel in enumerate(channels):
        figures[f"mean{channel}"] = float(levels.mean[i])
        figures[f"standard_deviation{channel}"] = float(levels.standard_deviation[i])
    curves = [
        metrics.two_point_correlation(solid, scales.reach, threads=threads).radial
        for _, solid in chosen
    ]
    return _Measured(figures, statistics, np.mean(curves, axis=0))


def _structure(
    pictures: Mapping[Axis, Volume], threshold: float | None, solid: Literal["bright", "dark"]
) -> Structure:
    """Find one rule for all images: the volume can be cut by one only."""
    checked = {id(p): first_channel(p, f"images.{axis}") for axis, p in pictures.items()}
    if len(checked) == 1:
        return Structure.of(next(iter(pictures.values())), threshold, solid, "images")
    pool = np.concatenate([array.ravel() for array in checked.values()])
    # Every pixel twice, for a line of pixels is no volume; shares are the same.
    return Structure.of(Volume(np.stack([pool, pool])[np.newaxis]), threshold, solid, "images")


def _stacks(
    pictures: Mapping[Axis, Volume], whole: Volume, structure: Structure
) -> tuple[dict[Axis, _Stack], _Stack]:
    """Return the images, the same for the same image, and the volume."""
    named = {**{f"images.{axis}": p for axis, p in pictures.items()}, "volume": whole}
    grays = {id(v): first_channel(v, name) for name, v in named.items()}
    # The values of two-valued volumes are names: {0, 1} and {0, 255} are the same.
    binary = structure.kind == "binary" and all(map(is_two_valued, grays.values()))
    stacks = {}
    for volume in named.values():
        gray = grays[id(volume)]
        solid = structure.cut(gray)
        levels = volume.array if volume.array.ndim == 4 else volume.array[..., np.newaxis]
        stacks[id(volume)] = _Stack(solid if binary else gray, solid, levels)
    return {axis: stacks[id(p)] for axis, p in pictures.items()}, stacks[id(whole)]


def _groups(
    pictures: Mapping[Axis, Volume], shape: tuple[int, int, int]
) -> tuple[tuple[str, ...], ...]:
    """Return the planes that share an image."""
    groups: dict[int, list[str]] = {}
    for axis, picture in pictures.items():
        groups.setdefault(id(picture), []).append(axis)
    found = [tuple(group) for group in groups.values()]
    if found == [SECTION_AXES] and min(shape) > 1:
        found = [(*SECTION_AXES, DIAGONAL)]
    return tuple(found)


def _add_headline(figures: Figures, score: float, across: list[_Side]) -> None:
    own, new = (
        float(np.mean([measured.figures["porosity"] for measured in measureds]))
        for measureds in zip(*((side.own, side.new) for side in across), strict=True)
    )
    parts = [(side, part) for side in across for part in side.parts]
    figures.add(
        "slice_score_percent",
        score,
        "mean difference of the slices' figures and correlation; 6 % passes",
        exemplar=0.0,
        parts=(
            mean_error(side.own.statistics.errors(part.statistics).values()) for side, part in parts
        ),
        unit="%",
        tolerance=6.0,
        better="smaller",
    )
    figures.add(
        "porosity",
        new,
        "share of pore; ± 0.01 passes",
        exemplar=own,
        parts=(part.figures["porosity"] for _, part in parts),
        tolerance=0.01,
    )
    figures.add(
        "porosity_error_percent",
        100 * abs(new - own) / own,
        "difference of porosity, relative to the images'; 1 % passes",
        exemplar=0.0,
        parts=(100 * abs(part.figures["porosity"] - own) / own for _, part in parts),
        unit="%",
        tolerance=1.0,
        better="smaller",
    )
    figures.add(
        "two_point_error_percent",
        finite_mean([side.two_point_errors()[0] for side in across]),
        "D2 of the sections against their image, mean of the axes; 2 % passes",
        exemplar=0.0,
        parts=(error for side in across for error in side.two_point_errors()[1]),
        unit="%",
        tolerance=2.0,
        better="smaller",
    )


def _add_phases(
    figures: Figures, structure: Structure, body: _Stack, images: Mapping[Axis, _Stack]
) -> None:
    for label in structure.labels:
        figures.add(
            f"phase_fraction_{label}",
            float(np.mean(body.gray == label)),
            f"share of the phase {label}; ± 0.01 passes",
            exemplar=float(np.mean([np.mean(image.gray == label) for image in images.values()])),
            tolerance=0.01,
        )


def _add_connectivity(figures: Figures, solid: _Phase, threads: int) -> None:
    parts = metrics.component_sizes(solid, threads=threads)
    pores = metrics.component_sizes(~solid, connectivity=6, threads=threads)
    small = int(np.count_nonzero(parts < FLOATING))
    figures.add("components", len(parts), "26-connected parts of the solid, in all")
    figures.add("floating_parts", small, f"parts of fewer than {FLOATING} voxels, in all")
    what = "share of the solid in its largest part"
    figures.add("largest_component_fraction", largest_share(parts), what)
    what = "share of the pore in its largest part, 6-connected"
    figures.add("largest_pore_fraction", largest_share(pores), what)


def _add_plane(figures: Figures, side: _Side) -> None:
    error, own_errors = side.two_point_errors()
    slices = side.own.statistics.errors(side.new.statistics)
    for name, value in side.new.figures.items():
        rule = next(rule for start, rule in RULES.items() if name.startswith(start))
        if side.plane == DIAGONAL and rule.diagonal == "left out":
            continue
        own = side.own.figures[name]
        judged = side.plane != DIAGONAL or rule.diagonal == "judged"
        least = rule.plain or side.own.statistics.least(name)
        figures.add(
            f"{name}_{side.plane}",
            value,
            rule.description,
            exemplar=own,
            parts=(part.figures[name] for part in side.parts),
            power=rule.power,
            tolerance=max(least, rule.share * abs(own)) if judged else None,
            error_percent=slices.get(name, percent_error(own, value)),
        )
        if name == "porosity":
            figures.add(
                f"two_point_error_percent_{side.plane}",
                error,
                "D2: difference of the two-point correlations; 2 % passes",
                exemplar=0.0,
                parts=own_errors,
                unit="%",
                tolerance=2.0,
                better="smaller",
            )
