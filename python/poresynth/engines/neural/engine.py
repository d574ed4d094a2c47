"""What the neural engines have in common beside their training: fit, sample, save, load.

A subclass names itself in ``engine`` and says with a few methods what is its own: `_resolve`,
`_check`, `_generator`, `_step`, `_calibrate`, `_tiles`, and with others what differs from the rest:
`_scale`, `_voxel_size`, `check_shape`.
"""

from __future__ import annotations

import hashlib
import inspect
import math
import operator
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
import numpy.typing as npt
import torch
from torch import nn

from poresynth import _core
from poresynth.engines.base import ProgressCallback, SynthesizedVolume
from poresynth.engines.grading import follow_map
from poresynth.engines.neural.blockwise import BLOCK, WRITING, write_blocks
from poresynth.engines.neural.files import below, read_tensors, write_tensors
from poresynth.engines.neural.judge import Evaluation, Judge
from poresynth.engines.neural.log import tensorboard_missing
from poresynth.engines.neural.machine import choose_device, first_process
from poresynth.engines.neural.matching import map_memory, value_map
from poresynth.engines.neural.noise import mix_seed
from poresynth.engines.neural.parameters import TrainingParameters
from poresynth.engines.neural.scaling import Scaling
from poresynth.engines.neural.tiles import Box, Tiles, assemble
from poresynth.engines.neural.training import Step, Training, train
from poresynth.engines.phases import Phases
from poresynth.engines.porosity import PorosityLike
from poresynth.engines.request import Request
from poresynth.engines.values import cut, outside_value, phase_values
from poresynth.errors import FileError, ParameterError
from poresynth.preprocess import validate_voxels
from poresynth.resources import check_memory
from poresynth.volume import Volume, as_volume

if TYPE_CHECKING:
    from typing_extensions import Self

__all__ = ["MODEL", "NeuralEngine", "as_corner", "load_engine"]

MODEL = "model.safetensors"
"""The file of the generator in the folder of a training."""

JUDGED = 128
"""Longest edge of the volumes that are compared while training, voxels."""

Shape = tuple[int, int, int]
Cut = Literal["porosity", "exemplar"]
Boundary = Literal["open", "periodic"]


class NeuralEngine(ABC):
    """Base of the neural engines; see `poresynth.engines.base.Synthesizer`.

    Attributes
    ----------
    exemplar_ : Volume
        The exemplar.
    parameters_ : TrainingParameters
        All parameters, with those of the preset.
    threshold_ : float or None
        Gray value that parts pore from solid; None for labels.
    porosity_ : float
        The exemplar's porosity.
    generator_ : torch.nn.Module
        The generator that was kept.
    training_ : dict
        How it was trained: iterations, which was kept, its figures.
    origin_ : dict
        What `fit` was told of the training.
    tensorboard_missing_ : str or None
        Why the last training wrote no files for TensorBoard, None if it did or should not.
    """

    engine: ClassVar[str]
    sampling_options: ClassVar[frozenset[str]] = frozenset({"start"})
    """Arguments of `sample` and `sample_to` that other engines do not have."""

    extras: Mapping[str, torch.Tensor] = MappingProxyType({})
    """What a model holds beside generator and exemplar; a subclass fills it before `fit`."""

    parameters: dict[str, Any]
    exemplar_: Volume
    parameters_: TrainingParameters
    threshold_: float | None
    porosity_: float
    generator_: nn.Module
    training_: dict[str, Any]
    origin_: dict[str, Any]
    tensorboard_missing_: str | None

    # --- what a subclass says -----------------------------------------------------------------

    @abstractmethod
    def _resolve(self, exemplar: Volume) -> TrainingParameters:
        """Return the checked parameters, with ``threshold``, ``solid`` and ``kind`` among them."""

    @abstractmethod
    def _check(self, exemplar: Volume) -> None:
        """Raise `ParameterError` for an exemplar that cannot be learnt."""

    @abstractmethod
    def _generator(self) -> nn.Module:
        """Return an untrained generator."""

    @abstractmethod
    def _step(self, field: torch.Tensor, progress: ProgressCallback | None) -> Step:
        """Return what is trained; its ``evaluate`` and ``keep`` are those of this class."""

    @abstractmethod
    def _calibrate(self, generator: nn.Module) -> None:
        """Make a generator ready for sampling."""

    @abstractmethod
    def _tiles(
        self, generator: nn.Module, seed: int, shape: Shape, boundary: Boundary, options: Any = None
    ) -> Tiles:
        """Return the endless field of a seed.

        Parameters
        ----------
        generator : torch.nn.Module
        seed : int
        shape : (int, int, int)
            Of the volume that is asked for: of a periodic one the period, in voxels.
        boundary : {"open", "periodic"}
        options
            What `sample` of the subclass has beyond that of this class.

        Raises
        ------
        ParameterError
            If there is no such volume.
        """

    @abstractmethod
    def _tile_memory(self) -> int:
        """Return the peak memory of one tile in bytes."""

    def _scale(self, volume: Volume) -> Scaling:
        """Return what the network learns of the exemplar."""
        return Scaling.of(volume, self._phases)

    def check_shape(self, shape: Shape, boundary: Boundary) -> None:  # noqa: B027
        """Raise `ParameterError` for a volume that no training of these parameters could make."""

    def _voxel_size(self, options: Any) -> tuple[float, float, float]:
        """Return the edges of a voxel that is sampled."""
        return self.exemplar_.voxel_size

    # --- training -----------------------------------------------------------------------------

    def fit(
        self,
        exemplar: Volume | npt.ArrayLike,
        *,
        folder: str | Path | None = None,
        resume: bool = False,
        progress: ProgressCallback | None = None,
        origin: Mapping[str, Any] | None = None,
    ) -> Self:
        """Train on an exemplar.

        Parameters
        ----------
        exemplar : Volume or array_like
            Shape (z, y, x), or (z, y, x, channel), whose first channel decides the structure. bool,
            integer or float.
        folder : path-like, optional
            Where the training leaves its files: ``model.safetensors``, which `load` reads, as soon
            as there is a generator to keep; ``checkpoint.safetensors``; ``log.jsonl``; pictures of
            mid-slices in ``slices``; TensorBoard's files. None leaves none.
        resume : bool, default False
            Go on from the checkpoint in the folder: on the same device with the same bits as if it
            had never stopped.
        progress : callable, optional
            ``progress(stage, fraction)`` after each iteration; an exception in it ends the training
            after a checkpoint.
        origin : mapping, optional
            What else a model and its volumes should say of the training, JSON-compatible.

        Returns
        -------
        NeuralEngine
            The engine itself, with the generator of the best comparison.

        Raises
        ------
        ParameterError
            If a parameter is out of range, or the exemplar is empty, constant, not finite, too
            small or of one phase only; if a checkpoint is of another training.
        TrainingError
            If a loss is not finite, or the generator makes one phase only.
        MemoryEstimateError
            If the device has too little memory.
        KeyboardInterrupt
            On Ctrl-C, after a checkpoint.
        """
        place = None if folder is None else Path(folder)
        if place is None and not first_process():
            raise ParameterError("folder", None, "is needed to train with several processes")
        self._learn(as_volume(exemplar))
        self._kept: dict[str, torch.Tensor] = {}
        self._folder = place
        self.training_, self.origin_ = {}, dict(origin or {})
        self.tensorboard_missing_ = tensorboard_missing() if place is not None else None
        if resume and place is not None and (place / MODEL).exists():
            tensors, facts = read_tensors(place / MODEL, "a model")
            self._kept, self.training_ = below("generator.", tensors), facts["training"]
        field = self._scaling.field(self.exemplar_)
        self._judge = Judge(self._phases.phase > 0)
        done = train(
            self._step(torch.from_numpy(field), progress),
            self.parameters_,
            folder=place,
            resume=resume,
            identity={"engine": self.engine, "exemplar": _digest(self.exemplar_)},
            exemplar=_first(self.exemplar_.array),
            progress=progress,
        )
        self.training_ = done.facts()
        if place is not None and not first_process():
            self._kept = below("generator.", read_tensors(place / MODEL, "a model")[0])
        self._adopt(self._kept, choose_device(self.parameters_.device))
        if place is not None and first_process():
            self.save(place / MODEL)
        return self

    def _learn(self, volume: Volume) -> None:
        """Take an exemplar in."""
        validate_voxels(volume, "exemplar")
        self.parameters_ = self._resolve(volume)
        self._check(volume)
        chosen: Any = self.parameters_
        self._phases = Phases.of(volume, chosen.kind, chosen.threshold, chosen.solid)
        self._scaling = self._scale(volume)
        self.exemplar_ = volume
        self.threshold_, self.porosity_ = self._phases.threshold, self._phases.porosity

    def _adopt(self, tensors: dict[str, torch.Tensor], device: torch.device) -> None:
        """Make the generator of these weights the one that samples."""
        self.generator_ = self._generator()
        self.generator_.load_state_dict(tensors)
        self.generator_.requires_grad_(False).eval().to(device)

    def _evaluate(self, generator: nn.Module) -> Evaluation:
        """Judge a volume of the exemplar's shape, cut at the exemplar's threshold."""
        self._calibrate(generator)
        generator.eval()
        shape = [min(n, JUDGED) for n in self.exemplar_.shape]
        seed = mix_seed(self.parameters_.training_seed, 0xE7A1)
        tiles = self._tiles(generator, seed, self.exemplar_.shape, "open")
        field = assemble(tiles, (0, 0, 0), shape)
        values = self._scaling.values(field)
        found = self._judge(self._phases.phase_of(values) > 0, _first(values))
        if self.exemplar_.channels > 1 and found.one_phase is None:
            # The figures are of the first channel, cut in two: of colours they say too little.
            found = replace(found, score=None)
        return found

    def _keep(self, generator: nn.Module, evaluation: Evaluation, training: Training) -> None:
        """Keep a generator, on the disk too."""
        state = generator.state_dict()
        self._kept = {name: tensor.detach().cpu().clone() for name, tensor in state.items()}
        self.training_ = training.facts()
        if self._folder is not None:
            self._write(self._folder / MODEL, self._kept)

    # --- sampling -----------------------------------------------------------------------------

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
        cut_at: Cut = "porosity",
        start: Shape = (0, 0, 0),
    ) -> SynthesizedVolume:
        """Make a volume: a window of an endless one that the seed stands for.

        Parameters
        ----------
        shape : (int, int, int)
            Voxels along (z, y, x), any.
        seed : int, default 0
            From 0 to 2⁶⁴ − 1.
        boundary : {"open", "periodic"}, default "open"
            A periodic volume tiles space without a seam; its edges must be multiples of the spacing
            of the latents, which the message says.
        porosity : float, Volume, array_like or callable, optional
            Wanted pore fraction; the exemplar's by default. A number is reproduced to within one
            voxel. A map or a function of position gives it from place to place: see
            `poresynth.engines.grading.grade`.
        known, known_mask
            Not for neural engines: they cannot keep voxels.
        mask : numpy.ndarray of bool, optional
            The voxels that matter, shape (z, y, x); those outside hold the pore's lowest value, and
            do not count for the porosity. Tiles without any are not computed.
        threads : int, default 0
            Tiles computed at once on a CPU; 0 takes all cores. The result does not depend on it.
        progress : callable, optional
            ``progress(stage, fraction)``, called between tiles. An exception in it stops the work.
        cut_at : {"porosity", "exemplar"}, default "porosity"
            ``"porosity"`` takes the exemplar's porosity (or the wanted one), and in each phase the
            exemplar's histogram: so the values of a voxel depend on the whole volume.
            ``"exemplar"`` takes the generator's values as they are; cut at the exemplar's
            threshold, their porosity is off by what training left. A window has then the bits that
            the same window of a larger volume has. Both porosities are in the provenance.
        start : (int, int, int), default (0, 0, 0)
            First voxel of the window in the endless volume, any integers.

        Returns
        -------
        SynthesizedVolume
            Of the exemplar's dtype, with the provenance.

        Raises
        ------
        ParameterError
            If an argument is out of range.
        MemoryEstimateError
            If the volume cannot fit into memory; `sample_to` needs less.
        KeyboardInterrupt
            On Ctrl-C, at once.

        Notes
        -----
        Peak memory: see `estimate_memory`.
        """
        if known is not None or known_mask is not None:
            raise ParameterError("known", "given", "cannot be kept by a neural engine")
        request = self._request(shape, seed, boundary, porosity, mask, threads)
        return self._sample(request, cut_at, start, progress)

    def _request(
        self,
        shape: Shape,
        seed: int,
        boundary: Boundary,
        porosity: PorosityLike | None,
        mask: npt.NDArray[np.bool_] | None,
        threads: int,
    ) -> Request:
        self._check_fitted()
        return Request.of(
            shape,
            least=1,
            exemplar=self.exemplar_,
            seed=seed,
            boundary=boundary,
            porosity=porosity,
            known=None,
            known_mask=None,
            mask=mask,
            threads=threads,
        )

    def _sample(
        self,
        request: Request,
        cut_at: Cut,
        start: Shape,
        progress: ProgressCallback | None,
        options: Any = None,
    ) -> SynthesizedVolume:
        """Make what `sample` was asked for; ``options`` are what that of a subclass adds."""
        start = as_corner(start)
        tiles = self._window(request, cut_at, options)
        needed = self.estimate_memory(request.shape, threads=request.threads) + request.memory
        check_memory(needed, f"a volume of {request.shape}")
        report = None if progress is None else lambda share: progress("sampling", share)
        field = assemble(
            tiles,
            start,
            request.shape,
            domain=request.domain,
            threads=request.threads,
            progress=report,
        )
        values = self._scaling.values(field)
        own = self._phases.phase_of(values) == 0
        raw = float(own.mean() if request.domain is None else own[request.domain].mean())
        del own
        made_so: dict[str, Any] = {"raw_porosity": raw}
        if cut_at == "porosity":
            scores = self._scaling.scores(field)
            phase = cut(self._phases, scores, request)
            values = phase_values(self._phases, self.exemplar_.array, phase, field, request)
            if request.porosity_map is not None:
                graded = follow_map(values, self._phases, request, scores[0])
                made_so["grading"] = graded.provenance()
        else:
            request.impose(values, outside_value(self._phases, self.exemplar_.array))
        return SynthesizedVolume(
            values,
            self._voxel_size(options),
            self.exemplar_.unit,
            {"poresynth": {**self._provenance(request, cut_at, start, options), **made_so}},
        )

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
        cut_at: Cut = "porosity",
        start: Shape = (0, 0, 0),
        origin: dict[str, Any] | None = None,
    ) -> dict[str, float]:
        """Make a volume and write it block by block, however large it is.

        Parameters
        ----------
        path : path-like
            A TIFF, which is not compressed, or a Zarr store.
        shape, seed, boundary, threads, progress, start
            As for `sample`.
        porosity, cut_at
            As for `sample`; with ``cut_at="porosity"`` the field is made twice, once to see it and
            once to write. Of two phases the porosity is right to the share of one of 65536 levels,
            some 10⁻⁴; of more, each share to some 5 · 10⁻⁴.
        origin : dict, optional
            What else goes into the provenance of the file, JSON-compatible.

        Returns
        -------
        dict of float
            ``porosity`` of what was written, and ``raw_porosity`` at the exemplar's threshold.

        Raises
        ------
        ParameterError
            If an argument is out of range, or the exemplar has an axis of channels.
        MemoryEstimateError
            If a block cannot fit into memory.
        FileError
            If the file cannot be written; nothing partial is left.
        KeyboardInterrupt
            On Ctrl-C, at once.

        Notes
        -----
        Peak memory: `estimate_memory` with ``blockwise``, the same for any volume above 128³.
        """
        request = self._request(shape, seed, boundary, porosity, None, threads)
        return self._sample_to(path, request, cut_at, start, progress, origin)

    def _sample_to(
        self,
        path: str | Path,
        request: Request,
        cut_at: Cut,
        start: Shape,
        progress: ProgressCallback | None,
        origin: dict[str, Any] | None,
        options: Any = None,
    ) -> dict[str, float]:
        """Make what `sample_to` was asked for; ``options`` are what that of a subclass adds."""
        start = as_corner(start)
        if request.porosity_map is not None:
            allowed = "must be a number where a volume is written block by block"
            raise ParameterError("porosity", "a map", allowed)
        if self.exemplar_.array.ndim == 4:
            allowed = "must be one to write block by block; take a volume that fits into memory"
            raise ParameterError("channels", self.exemplar_.channels, allowed)
        tiles = self._window(request, cut_at, options)
        needed = self.estimate_memory(request.shape, threads=request.threads, blockwise=True)
        check_memory(needed, f"a volume of {request.shape}, block by block,")
        matched = None
        if cut_at == "porosity":
            voxels, wanted = math.prod(request.shape), request.porosity
            matched = value_map(self._scaling, self.exemplar_.array, voxels, wanted)

        def make(box: Box, report: Callable[[float], object]) -> npt.NDArray[np.float32]:
            at = [a + b for a, b in zip(start, box.start, strict=True)]
            return assemble(tiles, at, box.shape, threads=request.threads, progress=report)

        def report(share: float) -> None:
            if progress is not None:
                progress("sampling", share)

        blank = np.broadcast_to(np.zeros((), self.exemplar_.dtype), request.shape)
        made_by = self._provenance(request, cut_at, start, options)
        metadata = {"poresynth": {**made_by, **(origin or {})}}
        like = Volume(blank, self._voxel_size(options), self.exemplar_.unit, metadata)
        return write_blocks(path, like, make, self._scaling, matched, report)

    def estimate_memory(self, shape: Shape, *, threads: int = 0, blockwise: bool = False) -> int:
        """Return the peak memory of `sample`, or of `sample_to`, in bytes.

        Parameters
        ----------
        shape : (int, int, int)
            Of the volume.
        threads : int, default 0
            As for `sample`: each computes tiles of its own.
        blockwise : bool, default False
            Of `sample_to`: that of a block of 128³ voxels, of writing (64 MB), and of what matches
            the values of the whole volume (1 MB; with more than two phases 12 MB each).

        Notes
        -----
        Per voxel 4 bytes a channel for the field, three of the exemplar's values and 6 bytes for
        the cut, and the tiles that are computed at once: 20 to 40 % above what was measured.
        """
        self._check_fitted()
        at_once = (threads or torch.get_num_threads()) if self._device.type == "cpu" else 1
        per_voxel = 6 + (4 + 3 * self.exemplar_.dtype.itemsize) * self._scaling.channels
        voxels, more = math.prod(shape), 0
        if blockwise:
            more = WRITING + map_memory(self._scaling, voxels)
            voxels = math.prod(min(n, BLOCK) for n in shape)
        return per_voxel * voxels + at_once * self._tile_memory() + more

    @property
    def _device(self) -> torch.device:
        return next(self.generator_.parameters()).device

    def _window(self, request: Request, cut_at: Cut, options: Any) -> Tiles:
        """Check what is asked of the field, and return it."""
        if cut_at not in ("porosity", "exemplar"):
            raise ParameterError("cut_at", cut_at, "must be 'porosity' or 'exemplar'")
        wanted = request.porosity if request.porosity_map is None else "a map"
        if cut_at == "exemplar" and wanted is not None:
            allowed = "goes with cut_at = porosity, not with the exemplar's threshold"
            raise ParameterError("porosity", wanted, allowed)
        return self._tiles(self.generator_, request.seed, request.shape, request.boundary, options)

    def _provenance(
        self, request: Request, cut_at: Cut | Literal["none"], start: Shape, options: Any
    ) -> dict[str, Any]:
        return {
            "version": _core.__version__,
            "engine": self.engine,
            "parameters": self.parameters_.model_dump(mode="json"),
            "training": {**self.training_, **self.origin_},
            **request.provenance(),
            "cut_at": cut_at,
            "start": list(start),
            "exemplar": self._phases.provenance(self.exemplar_),
        }

    # --- files --------------------------------------------------------------------------------

    def save(self, path: str | Path) -> None:
        """Write the generator, the parameters and the exemplar to a ``.safetensors`` file.

        Raises
        ------
        FileError
            If the file cannot be written; nothing partial is left.
        """
        self._check_fitted()
        self._write(Path(path), self.generator_.state_dict())

    @classmethod
    def load(cls, path: str | Path, *, device: str = "auto") -> Self:
        """Read an engine that `save` or a training wrote.

        Parameters
        ----------
        path : path-like
            The file, or the folder of a training.
        device : str, default "auto"
            Where it samples: "auto" takes a GPU if there is one.

        Raises
        ------
        FileError
            If the file is missing or not such a file.
        """
        file = _model_file(path)
        tensors, facts = read_tensors(file, "a model")
        try:
            if facts["engine"] != cls.engine:
                raise FileError(f"{path}: a model of the engine {facts['engine']}")
            names = inspect.signature(cls).parameters
            given = {n: v for n, v in facts["parameters"].items() if n in names}
            engine = cls(**given)
            array = tensors["exemplar"].numpy()
            volume = Volume(array, tuple(facts["voxel_size"]), facts["unit"])
            engine.extras = below("extra.", tensors)
            engine._learn(volume)
            engine.training_, engine.origin_ = facts["training"], facts["origin"]
            engine._adopt(below("generator.", tensors), choose_device(device))
        except (KeyError, TypeError, RuntimeError) as error:
            said = str(error).splitlines()[0]
            raise FileError(f"{path}: not a saved {cls.engine} engine ({said})") from error
        return engine

    def _write(self, path: Path, generator: dict[str, torch.Tensor]) -> None:
        tensors = {f"generator.{name}": tensor for name, tensor in generator.items()}
        # A copy: a mapped file cannot be handed over.
        tensors["exemplar"] = torch.from_numpy(np.array(self.exemplar_.array, order="C"))
        tensors |= {f"extra.{name}": tensor for name, tensor in self.extras.items()}
        facts = {
            "engine": self.engine,
            "parameters": self.parameters_.model_dump(mode="json"),
            "voxel_size": list(self.exemplar_.voxel_size),
            "unit": self.exemplar_.unit,
            "training": self.training_,
            "origin": self.origin_,
            "version": _core.__version__,
        }
        write_tensors(path, tensors, facts)

    def _check_fitted(self) -> None:
        if not hasattr(self, "generator_"):
            raise ParameterError("engine", "not fitted", "must see an exemplar first: call fit")


def load_engine(path: str | Path, *, device: str = "auto") -> NeuralEngine:
    """Read a model, whichever neural engine made it; parameters as of `NeuralEngine.load`."""
    from poresynth.engines import get_engine

    _, facts = read_tensors(_model_file(path), "a model")
    kind: Any = get_engine(facts.get("engine", ""))
    engine: NeuralEngine = kind.load(path, device=device)
    return engine


def as_corner(start: Sequence[int]) -> Shape:
    """Return the first voxel of a window as three integers, which it must be."""
    try:
        z, y, x = (operator.index(n) for n in start)
    except (TypeError, ValueError):
        raise ParameterError("start", start, "must be three integers (z, y, x)") from None
    return (z, y, x)


def _model_file(path: str | Path) -> Path:
    path = Path(path)
    if path.is_dir():
        if not (path / MODEL).exists():
            raise FileError(f"{path}: holds no model yet")
        return path / MODEL
    return path


def _first(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return the channel that decides the structure."""
    return array if array.ndim == 3 else array[..., 0]


def _digest(volume: Volume) -> str:
    return hashlib.sha256(np.ascontiguousarray(volume.array).data).hexdigest()
