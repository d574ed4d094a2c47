"""Images and volumes as endless fields: the implicit periodic field network (ipfn_2022)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal, cast

import numpy as np
import numpy.typing as npt
import torch
from torch import nn

from poresynth.engines.base import ProgressCallback, SynthesizedVolume
from poresynth.engines.field_choice import choose_field
from poresynth.engines.neural.engine import Boundary, Cut, NeuralEngine, Shape, as_corner
from poresynth.engines.neural.noise import mix_seed
from poresynth.engines.neural.scaling import Scaling
from poresynth.engines.neural.tiles import Tiles, assemble
from poresynth.engines.neural.training import Step
from poresynth.engines.periodic_field.generator import Generator
from poresynth.engines.periodic_field.guidance import Factors
from poresynth.engines.periodic_field.latent import LatentField
from poresynth.engines.periodic_field.options import FieldOptions
from poresynth.engines.periodic_field.parameters import FieldParameters, Preset, resolve
from poresynth.engines.periodic_field.period import Period, starting_period
from poresynth.engines.periodic_field.sampling import FieldTiles, Frame, tile_memory
from poresynth.engines.periodic_field.scaling import DistanceScaling
from poresynth.engines.periodic_field.start import Start, choose_start, spacings
from poresynth.engines.periodic_field.training import FieldStep
from poresynth.engines.periodic_field.windows import Windows
from poresynth.engines.porosity import PorosityLike
from poresynth.engines.request import Request
from poresynth.errors import ParameterError
from poresynth.resources import check_memory
from poresynth.volume import Volume, as_volume

if TYPE_CHECKING:
    from typing_extensions import Self

__all__ = ["PeriodicField"]

SPACING = {True: 1.0, False: 0.25}
"""Distance of the latent field's sites as a phase, where the period is clear and where it stands
for four wavelengths: half of a wavelength. At two thirds the struts of a foam came out too thick:
D2 was 18 instead of 12 %, and the surface 17 instead of 7 % too small (one training each)."""

# What a seed drawn from that of the training is for.
_WEIGHTS, _MODELS, _SHARES = 1, 4, 5

_CALIBRATED = {2: 384, 3: 80}
"""Edge of the field whose shares are made right, pixels or voxels."""

# Channels of a plain array (y, x, channel): more are the voxels of a volume.
_CHANNELS = 4


class PeriodicField(NeuralEngine):
    """Learn an image or a volume as an endless field, and sample any window of it.

    Chen et al., *Exemplar-based Pattern Synthesis with Implicit Periodic Field Network* (2022). A
    small network maps the coordinates of a point, encoded by sines of a period that is learned, and
    the numbers of a smooth random field to the value there. As points are independent of each
    other, outputs have any size, a window of a large output is had by itself, and a field can be
    sampled finer than the exemplar's voxels.

    Parameters
    ----------
    preset : {"tiny", "small", "paper"}, default "tiny"
        Where the parameters that are not given come from. ``"tiny"``: a network of 4 × 48 that
        two cores train in about a minute, on an image in half of it. ``"small"``: 6 × 96, ten times
        as many iterations, for a GPU or a night. ``"paper"``: ipfn_2022 §4 and the authors' code:
        10 × 128, Eq. 4 on one aligned lattice, adversarial from the beginning. Of images in
        colours, ``"tiny"`` is 4 × 64 and ``"small"`` 5 × 96, mostly adversarial: three and fifteen
        minutes on one core.
    threshold : float, optional
        Gray value that parts pore from solid; Otsu's by default.
    solid : {"bright", "dark"}, default "bright"
        Which side of the threshold is solid.
    kind : {"auto", "gray", "binary", "label"}, default "auto"
        What the values mean. Two values are binary, up to 16 integers labels, all else gray.
    field : {"auto", "distance", "intensity"}, default "auto"
        What is learned: signed distances to the surface, clipped, or values. ``"auto"`` takes
        distances of two clear phases and of labels, values of everything else and of colours.
    clip : int, default 6
        Where distances are clipped, pixels or voxels.
    guidance : {"none", "density", "direction", "map"}, default "none"
        What the field is conditioned on (Eq. 5): how dense the structure is around a voxel (Eq. 6
        over a patch of the size of a crop); a line or plane; a map that `fit` is given. Both losses
        see it, and `sample` chooses it.
    direction : tuple of float, optional
        a, b, c of the line a x + b y + c, or a, b, c, d of the plane a x + b y + c z + d, on
        coordinates from −1 to 1 (§3.3); with guidance "direction".
    period : {"exemplar", "crop"}, float or tuple of float, default "exemplar"
        Where the period of the encoding starts: at the peak of the exemplar's autocorrelation along
        each axis, or four wavelengths where there is no clear peak; at the crop's extent, as the
        paper's; or at so many pixels or voxels.
    learn_period : bool, default True
        Whether a of Eq. 3 is learned; the ablation "w/o deformation" of §4.2 is False with period
        "crop".
    shift : {"period", "paper", "none"}, default "period"
        How coordinates are shifted in training: over one period of the encoding, which is all that
        there is; by up to 4 half crops (§3); or not (the ablation "w/o shift").
    encoded : {"clear", "all", "none"}, default "clear"
        Along which axes the network sees the phase: those along which the exemplar's
        autocorrelation has a clear peak, or the period is given; or all, as the paper's; or none,
        so that a period that is given is only the scale of the latent field. A medium without a
        period has no place that differs from others; without phases its field cannot have one
        either.
    bandwidth : int, default 1
        i of Eq. 3, the highest octave. High ones print a lattice into media without a period.
    diagonal : bool
        Whether sums and differences of the axes' phases are encoded beside them (not in the paper):
        True for images, False for volumes, where there are ten of them, and of the preset paper.
        A period that starts 15 % off was put right in 8 of 8 trainings without them; with them one
        of a lattice was not.
    width, depth : int
        Of the perceptron; 48 and 4 of the preset tiny.
    points : tuple of int, default (1, 1)
        Lattices of random points whose distances a point of the field has as latent values (not in
        the paper): struts and grains are made of them. Each number says how many points one has
        along an axis where the coarsest has one: (1, 8) for a mesh of veins inside a mesh of wider
        ones. None, (), where phases are encoded.
    latents : int
        Numbers of the latent field at a point; by the preset.
    groups : int
        Lattices that carry them, each shifted by its own fraction of a cell; by the preset.
    octaves : int
        Spacings of the lattices, each half of the one before; the groups take them in turn.
    spacing : float, optional
        Distance of the sites of the coarsest lattices as a phase, 2 being a period: of the points,
        or of numbers without. By default the one whose model is nearest to the exemplar, with
        points; else 1 where the exemplar has a period and 0.25 where four wavelengths stand for
        one: half of a wavelength.
    interpolation : {"gradient", "quintic", "paper"}, default "gradient"
        Between the sites: slopes or values, by quintics; or Eq. 4, which is not continuous.
    sigma : float, default 0.2
        σ of Eq. 4, in cells.
    crop : int
        Edge of the crops that the critic sees, and of the patches of Eq. 6; by the preset.
    start_iterations : int, default 200
        Iterations at the beginning that lead the network to the model of stochastic geometry that
        is nearest to the exemplar, such as edges of Voronoi cells (not in the paper). 0: from a
        flat field. Needs points.
    start_model : str, default "nearest"
        The model that training starts from: the nearest, or one by name, such as "edges of cells",
        "all but balls around points", "noise"; of the first lattice of points. For colours, which
        have no order, and for meshes in meshes the nearest is not the best.
    sliced_iterations : int, optional
        Iterations before the adversarial ones: those of the start, and of the sliced-Wasserstein
        losses. All by default: they are faster and steadier; 300 of images in colours, which come
        out as grains by these losses alone.
    reach : int
        Longest distance that the sliced-Wasserstein loss sees, along an axis; by the preset, at
        most half of the exemplar.
    grids, filters : int, default 64, 64
        Grids of points whose responses are compared, and filters of each.
    taps : (int, int), default (1, 8)
        Fewest and most points of a filter.
    places : int, default 1024
        Independent places of the field that a grid is evaluated at in a step; 512 of volumes by the
        preset tiny. With 1024 a training took 1.7 times as long, and correlation came no nearer.
    jets : float, default 0.5
        Share of the steps that compare slopes and curvatures instead of filters' responses. 0 where
        a period is clear, of which they tell nothing.
    critic_maps : tuple of int, default (16, 32, 64)
        Feature maps of the critic's strided convolutions.
    critic_steps, generator_steps : int, default 1, 1
        Steps of each in an adversarial iteration.
    penalty : float, default 10
        λ of the gradient penalty.
    iterations, batch, accumulate, learning_rate, schedule, ema, precision, channels_last, \
compile, device, evaluate_every, patience, training_seed
        As of `poresynth.engines.neural.parameters.TrainingParameters`.
    period_rate : float, default 2e-3
        Learning rate of the period, relative to its start: by Adam it moves at most so far a step.
    betas : (float, float), default (0.5, 0.9)
        Of Adam.

    Attributes
    ----------
    exemplar_ : Volume
        The exemplar.
    parameters_ : FieldParameters
        All parameters, with those of the preset.
    threshold_ : float or None
        Gray value that parts pore from solid; None for labels.
    porosity_ : float
        The exemplar's porosity.
    period_ : tuple of float
        Learned period along each axis, pixels or voxels.
    period_reason_ : str
        Along which axes it is encoded, and why.
    field_, field_reason_ : str
        What is learned, and why.
    generator_ : Generator
        The generator of the best comparison.
    training_ : dict
        Iterations, which generator was kept, its figures, seconds, and why the training ended.

    Examples
    --------
    >>> from poresynth.engines.periodic_field import PeriodicField
    >>> from poresynth.exemplars import spinodal
    >>> engine = PeriodicField(iterations=200, start_iterations=0, places=128, device="cpu")
    >>> engine = engine.fit(spinodal((32, 32, 32)))
    >>> engine.sample((40, 40, 40), seed=1).shape
    (40, 40, 40)
    """

    engine: ClassVar[str] = "ipfn"
    sampling_options: ClassVar[frozenset[str]] = frozenset(
        {"start", *(option.name for option in fields(FieldOptions))}
    )
    parameters_: FieldParameters

    def __init__(
        self,
        *,
        preset: Preset = "tiny",
        threshold: float | None = None,
        solid: Literal["bright", "dark"] | None = None,
        kind: Literal["auto", "gray", "binary", "label"] | None = None,
        field: Literal["auto", "distance", "intensity"] | None = None,
        clip: int | None = None,
        guidance: Literal["none", "density", "direction", "map"] | None = None,
        direction: tuple[float, ...] | None = None,
        period: Literal["exemplar", "crop"] | float | tuple[float, ...] | None = None,
        learn_period: bool | None = None,
        shift: Literal["period", "paper", "none"] | None = None,
        encoded: Literal["clear", "all", "none"] | None = None,
        bandwidth: int | None = None,
        diagonal: bool | None = None,
        width: int | None = None,
        depth: int | None = None,
        points: tuple[int, ...] | None = None,
        latents: int | None = None,
        groups: int | None = None,
        octaves: int | None = None,
        spacing: float | None = None,
        interpolation: Literal["gradient", "quintic", "paper"] | None = None,
        sigma: float | None = None,
        crop: int | None = None,
        start_iterations: int | None = None,
        start_model: str | None = None,
        sliced_iterations: int | None = None,
        reach: int | None = None,
        grids: int | None = None,
        filters: int | None = None,
        taps: tuple[int, int] | None = None,
        places: int | None = None,
        jets: float | None = None,
        critic_maps: tuple[int, ...] | None = None,
        critic_steps: int | None = None,
        generator_steps: int | None = None,
        penalty: float | None = None,
        iterations: int | None = None,
        batch: int | None = None,
        accumulate: int | None = None,
        learning_rate: float | None = None,
        period_rate: float | None = None,
        betas: tuple[float, float] | None = None,
        schedule: Literal["constant", "cosine"] | None = None,
        ema: float | None = None,
        precision: Literal["float32", "bfloat16", "float16"] | None = None,
        channels_last: bool | None = None,
        compile: bool | None = None,  # noqa: A002 – the name that PyTorch gives it
        device: str | None = None,
        evaluate_every: int | None = None,
        patience: int | None = None,
        training_seed: int | None = None,
    ) -> None:
        given = dict(locals())
        del given["self"]
        self.parameters: dict[str, Any] = given

    def fit(
        self,
        exemplar: Volume | npt.ArrayLike,
        *,
        guidance: npt.ArrayLike | None = None,
        folder: str | Path | None = None,
        resume: bool = False,
        progress: ProgressCallback | None = None,
        origin: Mapping[str, Any] | None = None,
    ) -> Self:
        """Train on an exemplar.

        Parameters
        ----------
        exemplar : Volume or array_like
            A volume (z, y, x[, channel]), or an image (y, x), (1, y, x[, channel]) or, of at most
            four channels, (y, x, channel). A structure is that of the first channel.
        guidance : array_like, optional
            The guidance factor at every voxel, in any unit; for the parameter guidance "map".
        folder, resume, progress, origin
            As of `poresynth.engines.neural.engine.NeuralEngine.fit`.

        Returns
        -------
        PeriodicField

        Raises
        ------
        ParameterError
            If a parameter, the exemplar or the guidance is outside what is allowed.
        TrainingError
            If the training comes to nothing.
        KeyboardInterrupt
            On Ctrl-C, after a checkpoint.

        Notes
        -----
        The same exemplar, parameters and training seed give the same network on one machine.
        """
        self._map = None if guidance is None else np.asarray(guidance)
        volume = _as_exemplar(exemplar)
        return super().fit(volume, folder=folder, resume=resume, progress=progress, origin=origin)

    def sample(
        self,
        shape: Shape,
        *,
        seed: int = 0,
        boundary: Boundary = "open",
        porosity: PorosityLike | None = None,
        known: Volume | npt.ArrayLike | None = None,
        known_mask: npt.NDArray[np.bool_] | None = None,
        mask: npt.NDArray[np.bool_] | None = None,
        threads: int = 0,
        progress: ProgressCallback | None = None,
        cut_at: Cut | None = None,
        start: Shape = (0, 0, 0),
        **options: Any,
    ) -> SynthesizedVolume:
        """Make an image or a volume: a window of an endless one that the seed stands for.

        As `poresynth.engines.neural.engine.NeuralEngine.sample`; ``options`` are those of
        `poresynth.engines.periodic_field.options.FieldOptions`. By default colours are cut nowhere,
        all else at the exemplar's porosity.
        """
        if known is not None or known_mask is not None:
            raise ParameterError("known", "given", "cannot be kept by a neural engine")
        chosen = FieldOptions.of(options)
        request = self._request(shape, seed, boundary, porosity, mask, threads)
        return self._sample(request, self._cut(cut_at, porosity), start, progress, chosen)

    def sample_to(
        self,
        path: str | Path,
        shape: Shape,
        *,
        seed: int = 0,
        boundary: Boundary = "open",
        porosity: float | None = None,
        threads: int = 0,
        progress: ProgressCallback | None = None,
        cut_at: Cut | None = None,
        start: Shape = (0, 0, 0),
        origin: dict[str, Any] | None = None,
        **options: Any,
    ) -> dict[str, float]:
        """Make a volume and write it block by block, however large it is.

        As `poresynth.engines.neural.engine.NeuralEngine.sample_to`, with the arguments of `sample`.
        Not for several channels.
        """
        chosen = FieldOptions.of(options)
        request = self._request(shape, seed, boundary, porosity, None, threads)
        cut_at = self._cut(cut_at, porosity)
        return self._sample_to(path, request, cut_at, start, progress, origin, chosen)

    def sample_field(
        self,
        shape: Shape,
        *,
        seed: int = 0,
        boundary: Boundary = "open",
        threads: int = 0,
        progress: ProgressCallback | None = None,
        start: Shape = (0, 0, 0),
        **options: Any,
    ) -> Volume:
        """Return the field itself, which `sample` cuts.

        Parameters
        ----------
        shape, seed, boundary, threads, progress, start, **options
            As of `sample`.

        Returns
        -------
        Volume
            float32, with the provenance. Of distances: to the surface in voxels of the exemplar,
            positive in the solid, up to ``clip``; a surface at level 0 can be meshed at any
            resolution. Of intensities: from −1 to 1, with ``threshold`` where the phases part, and
            a last axis of channels if there are several.
        """
        chosen, start = FieldOptions.of(options), as_corner(start)
        request = self._request(shape, seed, boundary, None, None, threads)
        tiles = self._tiles(self.generator_, request.seed, request.shape, boundary, chosen)
        check_memory(self.estimate_memory(request.shape), f"a field of {request.shape}")
        report = None if progress is None else lambda share: progress("sampling", share)
        field = assemble(tiles, start, request.shape, threads=threads, progress=report)
        if isinstance(self._scaling, DistanceScaling):
            field *= np.float32(self._scaling.clip)
        array = field[0] if len(field) == 1 else np.ascontiguousarray(np.moveaxis(field, 0, -1))
        made_by = {"poresynth": self._provenance(request, "none", start, chosen)}
        return Volume(array, self._voxel_size(chosen), self.exemplar_.unit, made_by)

    @property
    def period_(self) -> tuple[float, ...]:
        """Learned period along each axis that the field has, pixels or voxels."""
        self._check_fitted()
        return cast(Generator, self.generator_).period

    @property
    def period_reason_(self) -> str:
        """Along which axes the phase is encoded, and why, in a few words."""
        self._check_fitted()
        made = cast(Generator, self.generator_)
        axes = "zyx"[3 - made.axes :]
        seen = [axis for axis, one in zip(axes, made.encoded.tolist(), strict=True) if one]
        if self.parameters_.encoded == "all":
            return "phases encoded along all axes, as asked"
        if self.parameters_.encoded == "none":
            return "no phase encoded, as asked"
        if not seen:
            return "no phase encoded, for along no axis is a period clear"
        return f"phases encoded along {', '.join(seen)}, where the period is clear or given"

    def _resolve(self, exemplar: Volume) -> FieldParameters:
        p = resolve(self.parameters, _axes(exemplar), exemplar.channels)
        edge = min(n for n in exemplar.shape if n > 1)
        # What a preset says is as much as a small exemplar has.
        most = {"crop": edge, "reach": max(4, edge // 2)}
        given = self.parameters
        return p.model_copy(
            update={n: min(getattr(p, n), m) for n, m in most.items() if given[n] is None}
        )

    def _check(self, exemplar: Volume) -> None:
        edge = min(n for n in exemplar.shape if n > 1)
        for name, limit in (("crop", edge), ("reach", edge - 1)):
            value = getattr(self.parameters_, name)
            if value > limit:
                allowed = f"must be at most {limit} for an exemplar with an edge of {edge}"
                raise ParameterError(name, value, allowed)
        if exemplar.channels > 1 and self.parameters_.field == "distance":
            allowed = f"must be 'intensity' for {exemplar.channels} channels"
            raise ParameterError("field", "distance", allowed)

    def _scale(self, volume: Volume) -> Scaling:
        p = self.parameters_
        if volume.channels > 1:
            self.field_, self.field_reason_ = "intensity", "intensity, for it has channels"
        else:
            self.field_, self.field_reason_ = choose_field(volume.array, self._phases, p.field)
        if self.field_ == "distance":
            return DistanceScaling.of_distances(volume, self._phases, p.clip)
        return Scaling.of(volume, self._phases)

    def _generator(self) -> Generator:
        p = self.parameters_
        return Generator(
            axes=_axes(self.exemplar_),
            channels=self._scaling.channels,
            latents=self._latent_field(()).size,
            guides=0 if p.guidance == "none" else 1,
            bandwidth=p.bandwidth,
            diagonal=p.diagonal,
            width=p.width,
            depth=p.depth,
        )

    def _step(self, field: torch.Tensor, progress: ProgressCallback | None) -> Step:
        p = self.parameters_
        array = field.numpy()
        flat = array[:, 0] if _axes(self.exemplar_) == 2 else array
        guide = None
        found = Factors.of(p.guidance, p.direction, self._phases, p.crop, self._map)
        if found is not None:
            factors, own = found
            guide = own.reshape(1, *flat.shape[1:])
            self.extras = {"guidance": torch.tensor([factors.low, factors.high, factors.mean])}
        windows = Windows(
            torch.from_numpy(np.ascontiguousarray((flat + 1) / 2)),
            None if guide is None else torch.from_numpy(np.ascontiguousarray(guide)),
            p.crop if p.guidance == "density" else None,
        )
        period = starting_period(flat, p.period, p.crop, p.bandwidth)
        seen = [clear and p.encoded != "none" for clear in period.clear]
        if any(seen):
            # What has a period has its structure from the phases, and slopes tell nothing of it.
            # Into the parameters themselves: a saved model is built from them again.
            none: dict[str, Any] = {"points": (), "jets": 0.0}
            free = {name: none[name] for name in none if self.parameters[name] is None}
            p = self.parameters_ = p.model_copy(update=free)
        start = self._start(windows, period, progress)
        spacing = self._spacing(period) if start is None else start.spacing
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(mix_seed(p.training_seed, _WEIGHTS) >> 1)
            generator = self._generator()
            generator.start.copy_(torch.tensor(period.length))
            generator.spacing.copy_(torch.tensor(spacing))
            if p.encoded != "all":
                generator.encoded.copy_(torch.tensor(seen))
            return FieldStep(
                p,
                windows,
                generator,
                self._latent_field(spacing),
                start,
                self._evaluate,
                self._keep,
            )

    def _start(
        self, windows: Windows, period: Period, progress: ProgressCallback | None
    ) -> Start | None:
        """Choose what the training starts from, if there is room to."""
        p = self.parameters_
        if not (p.points and p.started):
            if p.start_model != "nearest":
                allowed = "needs start_iterations, and points where phases are encoded"
                raise ParameterError("start_model", p.start_model, allowed)
            return None
        chosen = p.spacing is not None or p.encoded == "all"
        free = [not (clear or chosen) for clear in period.clear]
        return choose_start(
            windows,
            p.reach,
            self._latent_field,
            period.length,
            spacings(period, self._spacing(period), free),
            mix_seed(p.training_seed, _MODELS),
            None if progress is None else lambda share: progress("choosing a start", share),
            None if p.start_model == "nearest" else p.start_model,
        )

    def _spacing(self, period: Period) -> tuple[float, ...]:
        """Return the distance of the coarsest sites along each axis, as a phase."""
        p = self.parameters_
        coarser = 2 if p.points else 1
        return tuple(p.spacing or coarser * SPACING[clear] for clear in period.clear)

    def _calibrate(self, generator: nn.Module) -> None:
        """Shift distances until the field's own surface parts the exemplar's shares.

        Jets weigh slopes against shares, and leave the shares off by a few percent.
        """
        p = self.parameters_
        plain = self.field_ == "distance" and self._scaling.channels == 1
        if not (plain and p.jets and p.guidance == "none"):
            return
        made = cast(Generator, generator).eval()
        edge = _CALIBRATED[made.axes]
        shape = (1 if made.axes == 2 else edge, edge, edge)
        tiles = self._tiles(made, mix_seed(p.training_seed, _SHARES), shape, "open")
        middle = float(np.quantile(assemble(tiles, (0, 0, 0), shape), self.porosity_))
        with torch.no_grad():
            made.last.bias.sub_(torch.tensor((1 + middle) / 2).clamp(0.05, 0.95).logit())

    def _tiles(
        self, generator: nn.Module, seed: int, shape: Shape, boundary: Boundary, options: Any = None
    ) -> Tiles:
        o = FieldOptions() if options is None else cast(FieldOptions, options)
        made = cast(Generator, generator)
        whole = shape if o.whole is None else o.whole
        if made.axes == 2 and (shape[0] != 1 or whole[0] != 1):
            raise ParameterError("shape", shape, "must be (1, y, x): the exemplar is an image")
        if o.latent == "constant" and not made.encoded.any():
            allowed = "needs a period that is encoded: the exemplar has none, see encoded = 'all'"
            raise ParameterError("latent", "constant", allowed)
        p, guide = self.parameters_, None
        if p.guidance != "none":
            low, high, mean = self.extras["guidance"].tolist()
            guide = Factors(p.guidance, p.direction or (), low, high, mean).guide(o.guidance, whole)
        elif o.guidance is not None:
            raise ParameterError("guidance", "given", "was not trained: see the parameter guidance")
        return FieldTiles(
            made,
            self._latent_field(tuple(made.spacing.tolist())),
            self._frame(made, whole, boundary, o)[0],
            seed=seed,
            constant=o.latent == "constant",
            guide=guide,
            precision=p.precision,
            compiled=p.compile,
        )

    def _frame(
        self, generator: Generator, whole: Shape, boundary: Boundary, options: FieldOptions
    ) -> tuple[Frame, tuple[float, ...]]:
        """Return how voxels become phases, and how much that stretches the structure."""
        edges = whole[3 - generator.axes :]
        frame = Frame.open(
            generator.period,
            generator.spacing.tolist(),
            generator.encoded.bool().tolist(),
            noise_scale=options.noise_scale,
            resolution=options.resolution,
            mirrored=edges if options.mirrored else None,
        )
        return frame.periodic(edges) if boundary == "periodic" else (frame, (1.0,) * len(edges))

    def _tile_memory(self) -> int:
        return tile_memory(
            self._device,
            _axes(self.exemplar_),
            latents=self._latent_field(()).size,
            width=self.parameters_.width,
        )

    def _voxel_size(self, options: Any) -> tuple[float, float, float]:
        z, y, x = (edge / options.resolution for edge in self.exemplar_.voxel_size)
        return (z, y, x)

    def _provenance(
        self, request: Request, cut_at: Cut | Literal["none"], start: Shape, options: Any
    ) -> dict[str, Any]:
        made, whole = cast(Generator, self.generator_), options.whole or request.shape
        _, stretch = self._frame(made, whole, request.boundary, options)
        return {
            **super()._provenance(request, cut_at, start, options),
            **options.provenance(),
            "whole": list(whole),
            "field": self.field_,
            "field_reason": self.field_reason_,
            "period": list(self.period_),
            "period_reason": self.period_reason_,
            "stretch": list(stretch),
        }

    def _cut(self, asked: Cut | None, porosity: PorosityLike | None) -> Cut:
        """Colours are not cut: a porosity that is wanted all the same is that of the first."""
        if asked is not None:
            return asked
        return "exemplar" if self.exemplar_.channels > 1 and porosity is None else "porosity"

    def _latent_field(self, spacing: tuple[float, ...]) -> LatentField:
        """Return the latent field whose coarsest sites are so far apart along each axis."""
        p = self.parameters_
        return LatentField(
            _axes(self.exemplar_),
            p.points,
            p.groups,
            p.latents // p.groups,
            p.octaves,
            spacing,
            p.interpolation,
            p.sigma,
        )


def _axes(volume: Volume) -> int:
    return 2 if volume.shape[0] == 1 else 3


def _as_exemplar(exemplar: Volume | npt.ArrayLike) -> Volume:
    """Return an exemplar as a volume; a flat array is an image."""
    if isinstance(exemplar, Volume):
        return exemplar
    array = np.asanyarray(exemplar)
    colours = array.ndim == 3 and array.shape[2] <= _CHANNELS < min(array.shape[:2])
    return as_volume(array[None] if array.ndim == 2 or colours else array)
