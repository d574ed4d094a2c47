"""Which way of making a volume from images suits a material, by trials."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from poresynth import _core
from poresynth.engines.image_fields import ImageField
from poresynth.engines.images import Images, targets
from poresynth.engines.model_choice import mean_period, near_models
from poresynth.engines.point_models import PointModel
from poresynth.engines.roughness import smoothing_like
from poresynth.engines.solid_kernel import example, first_values, options
from poresynth.engines.solid_parameters import Axis, SolidParameters, resolve_mode
from poresynth.engines.values import cut_share
from poresynth.errors import ParameterError
from poresynth.metrics.correlation import two_point_cluster
from poresynth.metrics.sections import SECTION_AXES, sections
from poresynth.metrics.skeleton import MARGIN as TIPS_MARGIN
from poresynth.metrics.skeleton import end_points
from poresynth.metrics.slice_statistics import slice_score
from poresynth.metrics.topology import euler_number

__all__ = ["Choice", "choose_mode", "dead_ends_a_loop"]

EDGE = 32
"""Edge of the volumes that are compared, voxels of half the resolution: 32 chose as 64 did on nine
materials, in a second and a half instead of four."""

STEPS = 60
"""Steps of response matching at each level of a trial, at most: the rest goes into long shapes, by
which the choice does not go."""

MARGIN = 3.0
"""How many times better the sections must score with neighbourhoods. They thicken features, which
counts of parts and holes do not show: sections of a spinodal scored 10 instead of 22 %, and its
structure error rose from 15 to 27 %; with 35 instead of 17 % on bone it rose, too."""

BEST = 10.0
"""Percent that no trial with neighbourhoods is known to have scored below (15 to 32 % on six
materials, of one slice and of three): where that would not do, there is none."""

NEAR = 20.0
"""Percent that the sections of a model of random points may be off at most: the nearest was 7 to
14 % off eight slices of 128² pixels of foams, 7 to 17 % off nine of 100² of trabecular bone."""

CELLS_EDGE = 96
"""Edge of the volumes in which dead ends and loops are counted, voxels."""

CELLS_STEPS = (20, 8, 0)
"""Their steps of response matching, coarse to fine: none at the finest level, which would take
longest."""

CELLS_TRIED = 5
"""Models that are tried: sections do not tell well which is nearest as a volume. On twelve slices
of a foam, trabecular bone and limestone the structure error of the nearest was 19 % on average, of
the one with the fewest dead ends a loop 13 %, of the best of the five 12 %. The fewest dead ends in
64³ voxels, whatever the loops, left 17 %."""

PORES_EDGE = 64
"""Edge of the volume and of the windows of images in which it is seen how pores hang together."""

PORES_STEP = 8
"""From one window, and from one section, to the next."""

PORES_REACH = 1.0
"""At which distance, in mean distances from one pore to the next on a line, where a window is wide
enough. At 0.75 of it only nine of fifteen choices of three slices of Ketton limestone were told
from a random field, at 1.0 thirteen; of single slices eleven and ten."""

PORES_STEPS = (100, 30, 0)
"""Steps of response matching of that volume, coarse to fine; more of them take longer and tell the
same."""

PORES_HELD = 0.4
"""Share of the pairs of pixels in one pore that must be left so far apart. Of thirty choices of one
or three slices of Ketton limestone, round packed grains, 23 had less (0 to 0.39, the others 0.86
and more), of thirty of Berea sandstone one (0.23, the others 0.45 and more), of 48 sections of cut
Gaussian fields two whose pores were 44 and 66 pixels apart (0.34). From a random field Ketton has a
structure error of 24 %, from cells 4 to 11 %, but Berea 9 % from a random field and 24 % from
cells: the limit is on the side of the field."""


class Choice(NamedTuple):
    """How volumes are made.

    Attributes
    ----------
    mode : str
        Of `MODES`.
    reason : str
        Why, in a few words.
    model : PointModel or None
        What they start from; None for a Gaussian random field.
    """

    mode: str
    reason: str
    model: PointModel | None = None


def choose_mode(
    images: Images,
    field: ImageField,
    fields: list[npt.NDArray[np.float32]],
    given: dict[str, Any],
    parameters: SolidParameters,
) -> Choice:
    """Return the mode, and why in a few words.

    Parameters
    ----------
    images : Images
        The exemplar.
    field : ImageField
        What is synthesised.
    fields : list of numpy.ndarray
        The field of each image, shape (channel, 1, y, x).
    given : dict
        Parameters as given by the user.
    parameters : SolidParameters
        The same, checked; a named mode is taken without comparing it with others.

    Raises
    ------
    ParameterError
        If cells are asked for where there is more than one channel to start from.
    """
    trials = _Trials(images, field, given)
    several = len(images.phases.labels) > 2
    startable = len(fields[0]) == 1 and parameters.filters > 0 and not several
    if parameters.mode != "auto":
        reason = "as asked" if given.get("mode") else f"of the preset {parameters.preset}"
        found = Choice(parameters.mode, f"{parameters.mode}, {reason}")
        if parameters.mode != "cells":
            return found
        if not startable:
            allowed = (
                "must be another mode for colours, several phases, a feature channel, or no filters"
            )
            raise ParameterError("mode", "cells", allowed)
        model = trials.fewest_dead_ends(near_models(images, CELLS_TRIED), fields)
        return found._replace(model=model, reason=f"{found.reason}: {model.words()}")
    if images.images[0].channels > 1:
        return Choice("structured", "structured, which keeps colours together")
    if parameters.levels == 1 or several:
        what = "one level" if parameters.levels == 1 else "several phases"
        return Choice("responses", f"responses, for there is no trial of {what}")
    if startable and _is_network(images, parameters):
        near = near_models(images, CELLS_TRIED)
        if near[0][1] <= NEAR:
            model = trials.fewest_dead_ends(near, fields)
            reason = f"cells, for sections are near to those of {model.words()}"
            return Choice("cells", reason, model)
    if startable and _may_be_packed(images):
        held = trials.pores_held(fields)
        if held < PORES_HELD:
            model = trials.fewest_dead_ends(near_models(images, CELLS_TRIED), fields)
            reason = (
                f"cells, for a random field holds pores together {held:.2f} times as well as the "
                f"images: {model.words()}"
            )
            return Choice("cells", reason, model)
    by = "by the score of sections at half the resolution"
    halves = [_halved(own) for own in fields]
    responses = trials.score("responses", halves)
    if responses < MARGIN * BEST:
        return Choice("responses", f"responses, {by} ({responses:.1f} %)")
    structured = trials.score("structured", halves)
    best = "structured" if MARGIN * structured < responses else "responses"
    return Choice(
        best,
        f"{best}, {by} (responses {responses:.1f} %, structured {structured:.1f} %; "
        f"structured must score {MARGIN:g} times better)",
    )


def _is_network(images: Images, parameters: SolidParameters) -> bool:
    """Whether the solid was declared to be one piece, and is the smaller phase on all axes."""
    declared = parameters.connected in ("solid", "both")
    return _is_isotropic(images) and images.phases.porosity >= 0.5 and declared


def _may_be_packed(images: Images) -> bool:
    """Whether pores between grains could be those between the cells of random points."""
    wide = min(n for image in images.images for n in image.shape[1:]) >= PORES_EDGE
    return _is_isotropic(images) and 0 < images.phases.porosity < 0.5 and wide


def _is_isotropic(images: Images) -> bool:
    return len(images.images) == 1 or images.alike


@dataclass(frozen=True, eq=False)
class _Trials:
    """Small volumes by which modes are compared."""

    images: Images
    field: ImageField
    given: dict[str, Any]

    def score(self, mode: str, halves: list[npt.NDArray[np.float32]]) -> float:
        """Return how far the sections of a volume of half the resolution are, percent."""
        p = resolve_mode(self.given, mode)
        steps = tuple(min(count, STEPS) for count in p.response_steps)
        p = p.model_copy(update={"levels": p.levels - 1, "response_steps": steps})
        wanted = self._cuts(halves)
        return slice_score(wanted, self._solid(p, halves, wanted, EDGE)).percent

    def pores_held(self, fields: list[npt.NDArray[np.float32]]) -> float:
        """Return how many pairs of places so far apart are in one pore, by those of the images.

        Of sections of a volume that is made from a random field.
        """
        distance = min(round(PORES_REACH * mean_period(self.images)), PORES_EDGE // 2 - 1)
        wanted = self._cuts(fields)
        p = resolve_mode(self.given, "responses").model_copy(update={"response_steps": PORES_STEPS})
        solid = self._solid(p, fields, wanted, PORES_EDGE)

        def pairs(stack: npt.NDArray[np.bool_]) -> float:
            found = [
                two_point_cluster(np.ascontiguousarray(~stack[i : i + 1, y, x]), distance)
                for i in range(len(stack))
                for y, x in itertools.product(*map(_windows, stack.shape[1:]))
            ]
            return float(np.mean([cluster.radial[distance] for cluster in found]))

        own = np.mean([pairs(image) for image in wanted.values()])
        new = np.mean([pairs(sections(solid, axis).array[::PORES_STEP]) for axis in SECTION_AXES])
        return float(new / own) if own > 0 else 1.0

    def fewest_dead_ends(
        self, near: list[tuple[PointModel, float]], fields: list[npt.NDArray[np.float32]]
    ) -> PointModel:
        """Return the model of whose struts the fewest end, by the loops that they make."""
        p, wanted = resolve_mode(self.given, "cells"), self._cuts(fields)
        p = p.model_copy(update={"response_steps": CELLS_STEPS})

        def dead_ends(model: PointModel) -> float:
            solid = self._solid(p, fields, wanted, CELLS_EDGE, model)
            return dead_ends_a_loop(solid if model.sign > 0 else ~solid)

        return min((model for model, _ in near), key=dead_ends)

    def _solid(
        self,
        p: SolidParameters,
        fields: list[npt.NDArray[np.float32]],
        wanted: dict[Axis, npt.NDArray[np.bool_]],
        edge: int,
        model: PointModel | None = None,
    ) -> npt.NDArray[np.bool_]:
        """Return the solid of a cube, of this edge where windows fit in at the coarsest level."""
        least = max(p.windows) << (p.levels - 1)
        shape, porosity = (max(edge, least),) * 3, self.images.phases.porosity
        made = _core.synthesize(
            [example(*target) for target in targets(self.images, p, fields)],
            shape,
            options(p, self.images, self.field),
            seed=0,
            start=None if model is None else first_values(model, shape, p, 0),
        )[0]
        trial = self.field.scores(made)
        sigma = smoothing_like(wanted, porosity, trial[0], 0)
        if sigma > 0:
            trial = _core.gaussian(trial, sigma, boundary="periodic")
        return cut_share(trial[0], 1 - porosity)

    def _cuts(self, fields: list[npt.NDArray[np.float32]]) -> dict[Axis, npt.NDArray[np.bool_]]:
        """Return the solid of the fields of the images, by the axis that each is across."""
        share = 1 - self.images.phases.porosity
        solids = [cut_share(self.field.scores(own)[0], share) for own in fields]
        return {axis: solids[i] for axis, i in self.images.axes}


def dead_ends_a_loop(network: npt.NDArray[np.bool_]) -> float:
    """Return how many struts of a network that tiles space end, by its loops or, without any, by 1.

    Parameters
    ----------
    network : numpy.ndarray
        The struts, bool, shape (z, y, x).
    """
    # No strut ends at a face.
    ends = end_points(np.pad(network, TIPS_MARGIN, mode="wrap")).count
    return ends / max(-euler_number(network, boundary="periodic"), 1)


def _windows(edge: int) -> list[slice]:
    """Return where windows that overlap are along an edge."""
    count = (edge - PORES_EDGE) // PORES_STEP + 1
    starts = np.linspace(0, edge - PORES_EDGE, count).astype(int)
    return [slice(start, start + PORES_EDGE) for start in starts]


def _halved(field: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Return an image's field at half the resolution."""
    channels, _, ny, nx = field.shape
    whole = field[:, :, : ny // 2 * 2, : nx // 2 * 2]
    blocks = whole.reshape(channels, 1, ny // 2, 2, nx // 2, 2)
    return np.ascontiguousarray(blocks.mean(axis=(3, 5), dtype=np.float32))
