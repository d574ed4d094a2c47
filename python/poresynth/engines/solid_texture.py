"""Volumes from images: solid texture synthesis (prieto_2011, after Kopf et al. 2007)."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from poresynth import _core
from poresynth.engines.base import EnergyRecord, ProgressCallback, SynthesizedVolume
from poresynth.engines.field_choice import choose_field
from poresynth.engines.grading import Graded, follow_map
from poresynth.engines.image_fields import (
    ColourField,
    DistanceField,
    ImageField,
    PhaseField,
    agreed,
    with_feature,
)
from poresynth.engines.images import Images, as_images, targets
from poresynth.engines.mode_choice import choose_mode
from poresynth.engines.porosity import PorosityLike
from poresynth.engines.request import Request
from poresynth.engines.roughness import smoothing_like
from poresynth.engines.solid_kernel import example, first_values, options
from poresynth.engines.solid_parameters import Axis, SolidParameters, resolve_mode
from poresynth.engines.values import cut, outside_value, phase_values
from poresynth.errors import FileError, ParameterError
from poresynth.pruning.connecting import connect
from poresynth.resources import check_memory
from poresynth.volume import Volume

if TYPE_CHECKING:
    from typing_extensions import Self

__all__ = ["SolidTexture"]

SMALLEST = {"gray": 40, "binary": 6, "label": 6}
"""Voxels of the smallest island that is joined rather than erased: in gray values noise makes
larger ones."""

SEVERAL_SMOOTHING = 0.5
"""Blur where more than two phases meet, voxels: as on two phases, whose blur is found."""


class SolidTexture:
    """Synthesise volumes whose every section looks like an image.

    One image stands for the planes across all three axes, or two or three images for those across
    one axis each. The volume starts as a Gaussian random field with the images' covariance; then
    the responses of its sections to random filters are given the distributions that they have on
    the images, by least squares, coarse to fine. Networks that are one piece start from the edges
    of Voronoi cells instead. In materials with a structure that this misses, neighbourhoods of the
    sections are matched to neighbourhoods of the images and averaged as well: that is the method of
    Prieto et al., *3D texture synthesis for modeling realistic organic tissues* (2011), Kopf et al.
    (2007) and Chen and Wang (2010), whose parameters are presets.

    Parameters
    ----------
    preset : {"quality", "prieto", "kopf", "chen_wang"}, default "quality"
        Where the parameters that are not given come from. ``"prieto"``: neighbourhoods of 9 × 9 on
        every second voxel, a kd-tree, the weighted mean with r = 0.8, histograms by look-up.
        ``"kopf"``: 8 × 8, the mean of the main cluster, histograms by weights. ``"chen_wang"``:
        8 × 8, coherent search, nearly one window a voxel, position and index histograms. Both match
        histograms after every iteration, too: without, rocks of low porosity become one phase.
    mode : {"auto", "responses", "cells", "structured"}, default "auto"
        What the quality preset does: filter responses from a Gaussian random field or from Voronoi
        cells, or neighbourhoods as well. ``"auto"`` takes cells where the solid is ``connected``
        and the smaller phase, and the sections of one of their models, struts or plates between
        random points, are within 20 % of the images: of the five nearest the one that leaves the
        fewest dead ends a loop. From three slices the structure error of an open-cell foam was 4
        instead of 23 %, of trabecular bone 6 instead of 10 %, from one slice 9 instead of 22 and 10
        instead of 9 %. It also takes them for pores, the smaller phase, that a random field does
        not hold together as far as the images do: from one slice of Ketton limestone it was 6
        instead of 26 %, from three 4 instead of 24. One choice of slices in four does not show
        that; ``"cells"`` by name serves round packed grains only: of Berea sandstone it was 24
        instead of 9 %. It takes neighbourhoods, which thicken features, for colours, and where at
        half the resolution sections score three times better with them; a score of less than 30 %
        without stands.
    axes : tuple of {"z", "y", "x"}, optional
        Of one image the axes across which it stands for the planes; all unless given. Of several
        images one axis each, z, y, x unless given. Planes across an axis that is left out are free.
        Rows of an image lie along the first of the two other axes in the order z, y, x.
    weights : tuple of float, optional
        Importance of each of the axes; 1 by default.
    symmetric : bool, optional
        Whether an image may be mirrored and turned by 90°: eight views. By default one image may,
        for it stands for all directions, and several may not; nor may any in the presets of papers.
    threshold : float, optional
        Gray value that parts pore from solid; Otsu's of all images together by default.
    solid : {"bright", "dark"}, default "bright"
        Which side of the threshold is solid.
    kind : {"auto", "gray", "binary", "label"}, default "auto"
        What the values mean. Two values are binary, up to 16 integers labels, all else gray.
    connected : {"none", "solid", "pore", "both"}, default "none"
        A phase that is one piece in the material. Sections cannot say so: islands of fewer than 6
        voxels (40 of gray images) are erased, others joined by bridges.
    field : {"auto", "distance", "intensity"}, default "auto"
        What is synthesised: clipped signed distances in the plane of the image, or its values. With
        distances the structure error of trabecular bone was 14 instead of 31 %, of Berea sandstone
        15 instead of 20 %, of an open-cell foam 35 instead of 39 % (one slice of each, 128³).
        ``"auto"`` takes values for colours and for grays without two phases, as `VolumeTexture`.
    clip : int, default 12
        Where distances are clipped, voxels. At 12 instead of 6 the structure error of bone was 11
        instead of 14 %, of foam 28 instead of 35 %; at 24 nothing changed any more.
    feature : {"none", "distance"}, default "none"
        Whether the signed distance to a mask is one more channel (prieto_2011 §2.1.1), for images
        with large even areas: of the solid, or of the masks that `fit` is given.
    feature_weight : float, default 1.0
        Importance of that channel.
    smoothing : float, optional
        Gaussian blur of the distances before the cut, voxels. By default as much as gives the
        sections the images' density of interfaces.
    levels : int, default 3
        Resolutions, each half of the one before.
    filters : int, default 16
        Filters of each step of response matching; 0 leaves responses out.
    filter_edge : int, optional
        Edge of a filter, voxels; 3 unless given, 5 for gray values. Distances carry shape beyond a
        filter, and filters of 3 and 4 left a third of the excess skeleton tips that filters of 8
        left; with values, the structure error of cement paste was 33 with 5 instead of 41 %.
    deep : tuple of bool, default (False, True, False), (False,) in mode "structured"
        Whether responses to what is left of responses above a threshold are matched too, at each
        level, coarse to fine; the last one goes on. They see where edges end and what they meet:
        the structure error of Ketton limestone was 24 instead of 33 %, of cement paste 24 instead
        of 33 %. At the coarsest level they repeat the image: novelty of bone 0.35, not 0.59. What
        several images answer counts as one where no axis has 1.7 times the interfaces of another:
        with three slices of bone the structure error was 21 %, and is 9 %.
    response_steps : tuple of int, default (300, 60, 15)
        Steps of response matching at each level, coarse to fine; the last number goes on. In mode
        "cells" (30, 20, 15), for more undo the start, in mode "structured" (40, 15, 10). Long
        struts come of those at the coarsest level, where they cost little: with 200 and 40 the
        structure error of bone and of Ketton limestone is 2 % more, with 500 and 100 it is 1 and
        2 % less, both within the noise of 8 %.
    final_steps : int, default 0
        Steps of response matching after the last neighbourhoods.
    windows : tuple of int, default (8,)
        Edges of the neighbourhoods at each level, voxels.
    steps : tuple of int, optional
        Lattice step of each window in the plane, voxels; a quarter of the window by default.
    iterations : tuple of int, default (0,), (20, 10, 2) in mode "structured"
        Most iterations with each window at each level, coarse to fine. A step of response matching
        follows each.
    tolerance : float, default 0
        A window is done when for three iterations the energy has not fallen by this share; 0: after
        all iterations.
    components : int, default 32
        Most principal components of a neighbourhood.
    variance : float, default 0.95
        Share of the variance above which no further component is kept (prieto_2011 §2.1.1).
    search : {"coherent", "kd_tree", "brute_force"}, default "coherent"
        How matches are found; as `VolumeTexture`.
    candidates : int, default 10
        Nearest windows that the kd-tree ranks again.
    index_weight : {"off", "literal", "normalised"}, default "off"
        The index histogram of Chen and Wang (2010): windows that are used often are dearer.
    emphasis : {"none", "histogram", "position"}, default "none"
        What weighs less in the mean: values that the volume has too many of (Kopf et al. 2007), or
        pixels that were used too often (Chen and Wang 2010).
    match_histogram : bool, default True
        Whether each channel is given the images' histogram after every iteration (prieto_2011
        §2.1.3); colours along directions that do not correlate.
    exponent : float, default 0.8
        r of prieto_2011 Eq. 1: windows that fit badly weigh less.
    bandwidth : tuple of float, default (0,)
        Distance from a voxel's value, of 255, at which another weighs a quarter: only the main
        cluster is averaged (prieto_2011 §2.1.2). 0: all are. Coarse to fine.
    mode_steps : int, default 0
        Mean-shift steps from the plain mean to the main cluster; 0: one step from the value that a
        voxel has.
    relaxation : tuple of float, default (1,)
        Share of the way to the mean that a voxel goes, coarse to fine.

    Attributes
    ----------
    exemplar_ : list of Volume
        The images.
    parameters_ : SolidParameters
        All parameters, with those of preset and mode.
    threshold_ : float or None
        Gray value that parts pore from solid; None for labels.
    porosity_ : float
        The images' porosity.
    field_, field_reason_ : str
        What is synthesised, and why.
    mode_, mode_reason_ : str
        Which mode is taken, and why.

    Examples
    --------
    >>> from poresynth.engines.solid_texture import SolidTexture
    >>> from poresynth.exemplars import spinodal
    >>> image = spinodal((48, 48, 48)).array[:1]
    >>> engine = SolidTexture(mode="responses", levels=2).fit(image)
    >>> engine.sample((32, 32, 32), seed=1).shape
    (32, 32, 32)
    """

    def __init__(
        self,
        *,
        preset: Literal["quality", "prieto", "kopf", "chen_wang"] = "quality",
        mode: Literal["auto", "responses", "cells", "structured"] | None = None,
        axes: tuple[Axis, ...] | None = None,
        weights: tuple[float, ...] | None = None,
        symmetric: bool | None = None,
        threshold: float | None = None,
        solid: Literal["bright", "dark"] | None = None,
        kind: Literal["auto", "gray", "binary", "label"] | None = None,
        connected: Literal["none", "solid", "pore", "both"] | None = None,
        field: Literal["auto", "distance", "intensity"] | None = None,
        clip: int | None = None,
        feature: Literal["none", "distance"] | None = None,
        feature_weight: float | None = None,
        smoothing: float | None = None,
        levels: int | None = None,
        filters: int | None = None,
        filter_edge: int | None = None,
        deep: tuple[bool, ...] | None = None,
        response_steps: tuple[int, ...] | None = None,
        final_steps: int | None = None,
        windows: tuple[int, ...] | None = None,
        steps: tuple[int, ...] | None = None,
        iterations: tuple[int, ...] | None = None,
        tolerance: float | None = None,
        components: int | None = None,
        variance: float | None = None,
        search: Literal["coherent", "kd_tree", "brute_force"] | None = None,
        candidates: int | None = None,
        index_weight: Literal["off", "literal", "normalised"] | None = None,
        emphasis: Literal["none", "histogram", "position"] | None = None,
        match_histogram: bool | None = None,
        exponent: float | None = None,
        bandwidth: tuple[float, ...] | None = None,
        mode_steps: int | None = None,
        relaxation: tuple[float, ...] | None = None,
    ) -> None:
        given = dict(locals())
        del given["self"]
        self.parameters: dict[str, Any] = given

    def fit(
        self,
        exemplar: Volume | npt.ArrayLike | Sequence[Volume | npt.ArrayLike],
        masks: Sequence[npt.ArrayLike] | None = None,
    ) -> Self:
        """Check the parameters and the images, and choose the mode.

        Parameters
        ----------
        exemplar : Volume, array_like or sequence of one to three of them
            Images, shape (y, x), (y, x, channel), (1, y, x) or (1, y, x, channel), of one dtype and
            as many channels each; the first channel decides the structure. At least
            ``max(windows) · 2**(levels - 1)`` pixels along each edge.
        masks : sequence of array_like of bool, optional
            Of each image the pixels to whose border the feature channel is the distance, shape
            (y, x). Only with ``feature="distance"``.

        Returns
        -------
        SolidTexture
            The engine itself.

        Raises
        ------
        ParameterError
            If a parameter is out of range, or an image is empty, constant, not finite, too small
            for the windows, of one phase only, or unlike the others, or mode "cells" is asked for
            more than one channel.

        Notes
        -----
        With ``mode="auto"`` a volume of 32³ voxels of half the resolution is made, or two; five of
        64³ voxels to choose among cells.
        """
        parameters = resolve_mode(self.parameters)
        images = Images.of(as_images(exemplar), parameters)
        least = max(parameters.windows) << (parameters.levels - 1)
        for image in images.images:
            if min(image.shape[1:]) < least:
                raise ParameterError(
                    "exemplar",
                    image.shape[1:],
                    f"must have at least {least} pixels along each edge for a window of "
                    f"{max(parameters.windows)} at {parameters.levels} levels; use smaller windows "
                    "or fewer levels",
                )
        self._images = images
        self._masks = _check_masks(masks, images, parameters)
        self._field, self.field_, self.field_reason_ = _choose_field(images, parameters)
        self._fields = [
            self._field.of(image.array, images.phase(i)) for i, image in enumerate(images.images)
        ]
        # The channels of a colour, or of phases as they are, would part from one another, and
        # neighbourhoods alone ask for no distribution.
        apart = isinstance(self._field, DistanceField) or len(self._fields[0]) == 1
        if apart and parameters.filters > 0:
            self._fields = agreed(self._fields)
        if self._masks is not None:
            self._fields = [
                with_feature(field, mask, parameters)
                for field, mask in zip(self._fields, self._masks, strict=True)
            ]
        self.exemplar_ = images.images
        self.threshold_ = images.phases.threshold
        self.porosity_ = images.phases.porosity
        given = self.parameters
        if parameters.filter_edge is None:
            given = {**given, "filter_edge": self._field.filter_edge}
        choice = choose_mode(images, self._field, self._fields, given, parameters)
        self.mode_, self.mode_reason_, self._model = choice
        self.parameters_ = resolve_mode(given, self.mode_)
        return self

    def sample(
        self,
        shape: tuple[int, int, int],
        *,
        seed: int = 0,
        boundary: Literal["open", "periodic"] = "open",
        porosity: PorosityLike | None = None,
        known: Volume | npt.ArrayLike | None = None,
        known_mask: npt.NDArray[np.bool_] | None = None,
        mask: npt.NDArray[np.bool_] | None = None,
        threads: int = 0,
        progress: ProgressCallback | None = None,
    ) -> SynthesizedVolume:
        """Make a volume.

        The same images, parameters, shape and seed give the same volume, bit for bit, on any
        number of threads.

        Parameters
        ----------
        shape : (int, int, int)
            Voxels along (z, y, x); any aspect, each at least the largest window at the coarsest
            level.
        seed : int, default 0
            From 0 to 2⁶⁴ − 1.
        boundary : {"open", "periodic"}, default "open"
            A periodic volume tiles space without a seam. An open one is cut out of a periodic one
            whose edges are multiples of 2^(levels − 1).
        porosity : float, Volume, array_like or callable, optional
            Wanted pore fraction; the images' by default. A number is reproduced to within one
            voxel. A map (z, y, x) of the output's shape, or coarser and interpolated, or a
            function ``porosity(z, y, x)`` of the voxels' centres in the unit of the voxel size,
            gives it from place to place: see `poresynth.engines.grading.grade`.
        known : Volume or array_like, optional
            Values of the voxels that are given, in an array of the output's shape (and the images'
            channels). Kept exactly.
        known_mask : numpy.ndarray of bool, optional
            Where ``known`` counts; shape (z, y, x).
        mask : numpy.ndarray of bool, optional
            The voxels that matter, shape (z, y, x); voxels outside hold the pore's lowest value.
            Memory and time go with the box round it.
        threads : int, default 0
            0 takes all cores.
        progress : callable, optional
            ``progress(stage, fraction)``, called between steps on the calling thread. An exception
            in it stops the work.

        Returns
        -------
        SynthesizedVolume
            Of the images' dtype, with the energies and the provenance.

        Raises
        ------
        ParameterError
            If an argument is out of range.
        MemoryEstimateError
            If the volume cannot fit into memory.
        KeyboardInterrupt
            On Ctrl-C, at once.

        Notes
        -----
        The structure is cut at the quantile that gives the wanted number of solid voxels exactly.
        Gray values of each phase then get the images' histogram of that phase.

        Peak memory: see `estimate_memory`.
        """
        self._check_fitted()
        p, images = self.parameters_, self._images
        request = Request.of(
            shape,
            least=max(p.windows) << (p.levels - 1),
            exemplar=images.pooled,
            seed=seed,
            boundary=boundary,
            porosity=porosity,
            known=known,
            known_mask=known_mask,
            mask=mask,
            threads=threads,
        )
        part, where = request.around_domain()
        check_memory(self.estimate_memory(part.shape) + part.memory, f"a volume of {request.shape}")
        field, energy = self._synthesize(part, progress)
        scores = self._field.scores(field)
        sigma = self._smoothing(scores, part.seed)
        if sigma > 0:
            field = _core.gaussian(field, sigma, boundary=part.boundary)
            scores = self._field.scores(field)
        phase = cut(images.phases, scores, part)
        phase, repair = self._repaired(phase, scores, part)
        gray = field
        if images.phases.kind == "gray":
            gray = self._field.gray(field, part.seed, part.threads)
        array = phase_values(images.phases, images.pooled.array, phase, gray, part)
        graded = None
        if part.porosity_map is not None:
            graded = follow_map(array, images.phases, part, scores[0])
        return SynthesizedVolume(
            request.whole(array, where, outside_value(images.phases, images.pooled.array)),
            images.pooled.voxel_size,
            images.pooled.unit,
            {"poresynth": self._provenance(request, sigma, repair, graded)},
            energy=tuple(EnergyRecord(*record) for record in energy),
        )

    def estimate_memory(self, shape: tuple[int, int, int]) -> int:
        """Return the peak memory of `sample` in bytes.

        Per voxel 8 bytes and 21 a field channel with responses, else 4 and 6; 3 and 7 more for
        responses to responses at the finest level; where neighbourhoods are matched 20 bytes and
        1.5 a field channel for each. Turning distances back into gray values takes 38 bytes a voxel
        and 4 a channel of the images, turning colours back 18 a channel, if that is more. Per pixel
        of each constrained axis' image come descriptors: 32 bytes, times the number of symmetric
        copies, with 40 more for the kd-tree. That is 2 to 20 % above what was measured on gray,
        binary, label and colour images, 96³ to 192³.
        """
        self._check_fitted()
        p = self.parameters_
        channels = len(self._fields[0])
        aims = targets(self._images, p, self._fields)
        per_voxel = 8.0 + 21 * channels if p.filters > 0 else 4.0 + 6 * channels
        if p.filters > 0 and p.deep[: p.levels][-1]:
            per_voxel += 3.0 + 7 * channels
        per_pixel = 0
        if any(p.iterations):
            per_site = 20 + 1.5 * channels
            per_voxel += per_site * len(aims) / min(step for _, step in p.stages()) ** 2
            per_pixel = 32 + (40 if p.search == "kd_tree" else 0)
        values = self._images.images[0].channels
        if self._images.phases.kind == "gray":
            back = 38 + 4 * values if self.field_ == "distance" else 18 * values
            per_voxel = max(per_voxel, back)
        described: int = sum(
            (8 if symmetric else 1) * per_pixel * field[0].size for _, field, symmetric, _ in aims
        )
        return round(per_voxel * math.prod(shape)) + described

    def save(self, path: str | Path) -> None:
        """Write parameters and images to an ``.npz`` file (no pickles inside).

        Raises
        ------
        FileError
            If the file cannot be written; nothing partial is left.
        """
        from poresynth.io.atomic import output

        self._check_fitted()
        header = {
            "engine": "solid",
            "parameters": self.parameters_.model_dump(),
            "voxel_size": self._images.pooled.voxel_size,
            "unit": self._images.pooled.unit,
        }
        arrays: dict[str, Any] = {
            f"image_{i}": image.array for i, image in enumerate(self._images.images)
        }
        if self._masks is not None:
            arrays |= {f"mask_{i}": mask for i, mask in enumerate(self._masks)}
        with output(path) as (temporary,), temporary.open("wb") as file:
            np.savez_compressed(file, header=np.array(json.dumps(header)), **arrays)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read an engine that `save` wrote.

        Raises
        ------
        FileError
            If the file is missing or not such a file.
        """
        try:
            with np.load(path, allow_pickle=False) as data:
                header = json.loads(str(data["header"]))
                names = [name for name in data.files if name.startswith("image_")]
                size, unit = tuple(header["voxel_size"]), header["unit"]
                images = [Volume(data[name], size, unit) for name in names]
                masks = [data[name] for name in data.files if name.startswith("mask_")]
            parameters = header["parameters"]
        except (OSError, ValueError, KeyError) as error:
            raise FileError(f"{path}: not a saved solid engine ({error})") from error
        return cls(**parameters).fit(images, masks or None)

    def _check_fitted(self) -> None:
        if not hasattr(self, "parameters_"):
            raise ParameterError("engine", "not fitted", "must see an exemplar first: call fit")

    def _synthesize(
        self, request: Request, progress: ProgressCallback | None
    ) -> tuple[npt.NDArray[np.float32], list[Any]]:
        """Return the field of the wanted shape, and the energies."""
        p, shape = self.parameters_, request.shape
        made = shape
        if request.boundary == "open":
            unit = 1 << (p.levels - 1)
            z, y, x = (-(-n // unit) * unit for n in shape)
            made = (z, y, x)
        beyond = [(0, m - n) for m, n in zip(made, shape, strict=True)]
        domain, known_mask = request.domain, request.known_mask
        known = self._known_field(request)
        start = None
        if self._model is not None:
            start = first_values(self._model, made, p, request.seed, request.threads)
        field, _, energy = _core.synthesize(
            [example(*target) for target in targets(self._images, p, self._fields)],
            made,
            options(p, self._images, self._field),
            seed=request.seed,
            start=start,
            known=None if known is None else np.pad(known, [(0, 0), *beyond]),
            known_mask=None if known_mask is None else np.pad(known_mask, beyond),
            domain=None if domain is None else np.pad(domain, beyond),
            threads=request.threads,
            progress=progress,
        )
        z, y, x = shape
        return np.ascontiguousarray(field[:, :z, :y, :x]), energy

    def _known_field(self, request: Request) -> npt.NDArray[np.float32] | None:
        filled = request.filled(self._images.pooled.array[0, 0, 0])
        if filled is None:
            return None
        if self._masks is not None:
            raise ParameterError(
                "known", "given", "must not be given with a feature channel, which it lacks"
            )
        return self._field.of(filled, self._images.phases.phase_of(filled))

    def _smoothing(self, scores: npt.NDArray[np.float32], seed: int) -> float:
        wanted = self.parameters_.smoothing
        if wanted is not None:
            return wanted
        if isinstance(self._field, ColourField):
            return 0.0
        if len(scores) > 1:
            return SEVERAL_SMOOTHING
        images = self._images
        return smoothing_like(images.solids(), images.phases.porosity, scores[0], seed)

    def _repaired(
        self, phase: npt.NDArray[np.uint8], scores: npt.NDArray[np.float32], request: Request
    ) -> tuple[npt.NDArray[np.uint8], dict[str, Any]]:
        """Join the phases that were declared connected; return what it took."""
        wanted = self.parameters_.connected
        repair: dict[str, Any] = {}
        if wanted == "none":
            return phase, repair
        if len(self._images.phases.labels) > 2:
            raise ParameterError("connected", wanted, "must be 'none' for more than two phases")
        which: tuple[Literal["solid", "pore"], ...] = ("solid", "pore")
        for side in which if wanted == "both" else (wanted,):
            found = connect(
                phase > 0,
                scores[0],
                side,
                smallest=SMALLEST[self._images.phases.kind],
                boundary=request.boundary,
                free=request.free,
                domain=request.domain,
                threads=request.threads,
            )
            phase = found.solid.view(np.uint8)
            repair[side] = {
                "erased": found.erased,
                "joined": found.joined,
                "apart": found.apart,
                "missing": found.missing,
            }
        return phase, repair

    def _provenance(
        self, request: Request, sigma: float, repair: dict[str, Any], graded: Graded | None
    ) -> dict[str, Any]:
        images, phases = self._images, self._images.phases
        learned = [phases.provenance(image) for image in images.images]
        axes = [axis for axis, _ in images.axes]
        start = {} if self._model is None else {"start": asdict(self._model)}
        return {
            "version": _core.__version__,
            "engine": "solid",
            "parameters": {**self.parameters_.model_dump(mode="json"), "axes": axes},
            "field": self.field_,
            "field_reason": self.field_reason_,
            "mode": self.mode_,
            "mode_reason": self.mode_reason_,
            **start,
            "smoothing": sigma,
            "repair": repair,
            **request.provenance(),
            **({} if graded is None else {"grading": graded.provenance()}),
            "exemplar": learned[0] if len(learned) == 1 else learned,
        }


def _check_masks(
    masks: Sequence[npt.ArrayLike] | None, images: Images, parameters: SolidParameters
) -> list[npt.NDArray[np.bool_]] | None:
    """Return the masks of the feature channel, shape (1, y, x), None without one."""
    if parameters.feature == "none":
        if masks is not None:
            raise ParameterError("masks", "given", "must come with feature='distance'")
        return None
    if masks is None:
        return [images.phase(i) > 0 for i in range(len(images.images))]
    if len(masks) != len(images.images):
        raise ParameterError("masks", len(masks), f"must be one an image: {len(images.images)}")
    checked = []
    for mask, image in zip(masks, images.images, strict=True):
        array = np.asarray(mask).astype(bool)
        array = array[None] if array.ndim == 2 else array
        if array.shape != image.shape or array.all() or not array.any():
            allowed = f"must have the shape {image.shape[1:]}, with pixels in and outside"
            raise ParameterError("masks", array.shape, allowed)
        checked.append(array)
    return checked


def _choose_field(images: Images, parameters: SolidParameters) -> tuple[ImageField, str, str]:
    """Return the field, its name and why."""
    phases = images.phases
    if images.images[0].channels > 1 and parameters.field == "auto":
        name, reason = "intensity", "intensity, for the image has channels"
    else:
        # The largest image says it for all.
        largest = max(images.images, key=lambda image: image.array.size)
        own = phases.with_phase(phases.phase_of(largest.array))
        name, reason = choose_field(largest.array, own, parameters.field)
    if name == "distance":
        return DistanceField(images, parameters), name, reason
    gray = phases.kind == "gray"
    return ColourField(images) if gray else PhaseField(images), name, reason
