"""Volumes from a volume: texture optimisation with cubic neighbourhoods (zhang_2017)."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from poresynth import _core
from poresynth.engines.base import EnergyRecord, ProgressCallback, SynthesizedVolume
from poresynth.engines.bricks import Wall, lay, layout
from poresynth.engines.coordinates import Coordinates, FieldLike, material_coordinates
from poresynth.engines.field_choice import choose_field
from poresynth.engines.grading import follow_map
from poresynth.engines.phases import Phases
from poresynth.engines.porosity import PorosityLike
from poresynth.engines.request import KNOWN_MEMORY, Request
from poresynth.engines.seam import seam
from poresynth.engines.settling import settle
from poresynth.engines.texture_parameters import resolve
from poresynth.engines.values import channels_first, cut, outside_value, phase_values
from poresynth.errors import FileError, ParameterError
from poresynth.io import create, output
from poresynth.preprocess import validate_voxels
from poresynth.resources import check_memory
from poresynth.volume import Volume, as_volume

if TYPE_CHECKING:
    from typing_extensions import Self

    from poresynth._core import MatchMap

__all__ = ["VolumeTexture"]

PATIENCE = 3
"""A window is done after this many iterations in a row without a new lowest energy. The lattice
moves at random, and the energy with it by some percent, so that one iteration says little."""

CARRIED = 30
"""Bytes a voxel of the output that structure takes which is brought there from another place."""


class VolumeTexture:
    """Synthesise volumes whose every neighbourhood looks like one of the exemplar's.

    The method of Zhang, Chen, Wang and Wang, *By example synthesis of three-dimensional porous
    materials* (2017): windows of the output are matched to windows of the exemplar (search phase)
    and averaged with adaptive weights (optimisation phase), coarse to fine. Where the exemplar has
    clear phases it works on the signed distance of the solid rather than on intensities, and brings
    the intensities over afterwards.

    Parameters
    ----------
    preset : {"quality", "fast", "paper"}, default "quality"
        Where the parameters that are not given come from. ``"quality"``: three levels, coherent
        search, run penalty. ``"fast"``: two levels, two windows, half of the iterations, no
        annealing. ``"paper"``: the parameters of zhang_2017 §5.1, with intensities, a kd-tree, the
        index histogram and adaptive weights; without symmetric copies, which the paper names but
        does not count (``symmetry="full"`` adds all).
    threshold : float, optional
        Gray value that parts pore from solid; Otsu's of the exemplar by default.
    solid : {"bright", "dark"}, default "bright"
        Which side of the threshold is solid.
    kind : {"auto", "gray", "binary", "label"}, default "auto"
        What the exemplar's values mean. Two values are binary, up to 16 integers labels, all else
        gray.
    field : {"auto", "distance", "intensity"}, default "auto"
        What is synthesised. The clipped signed distance carries shape over a window's edge, so that
        necks and walls join: from 100³ to 152³, two seeds each, the mean error of connectivity,
        Euler number, skeleton tips, thickness, spacing and surface is 2.7 % instead of 10.7 % on
        trabecular bone and 5.2 % instead of 20.8 % on Berea sandstone, at equal or higher novelty.
        Intensities (of labels: one-hot phases) are the paper's choice. ``"auto"`` takes distance
        for two values and for labels (eight volumes of three and four: mean structure error 13.2 %
        against 13.0 %, two-point error 5.0 % against 5.6 %), and for gray values if it explains
        93.5 % of their structure, 1 − C_r(1) / C_g(1): the autocovariances at one voxel of the gray
        values, blurred by one voxel against noise, and of what their mean at each distance leaves
        of them. Bone and cement have 94.7 to 98 %, also noisy ones, Gaussian random fields 87 to
        92 %. In six such fields the gray values that distance carries over met at borders, with
        sharpest jumps 1.47 times the exemplar's instead of 1.03; structure was alike, and novelty
        0.46 instead of 0.36.
    clip : int, default 6
        Where the signed distance is clipped, voxels: about the radius of the features. Much more
        makes the windows' variance that of the largest pores.
    smoothing : float, default 0.5
        Gaussian blur of the final distance before the cut, voxels, against single-voxel roughness:
        without it the structure error is 7.8 instead of 6.3 % on Berea sandstone, 3.6 instead of
        2.6 % on bone.
    levels : int, default 3
        Resolutions, each half of the one before; the paper has two. The coarser the first, the
        longer the range over which structures are kept in order.
    windows : tuple of int, default (10, 8, 4)
        Neighbourhood edges w at each level, voxels, coarse to fine. Large ones hold the structure
        together and make the verbatim copies larger.
    steps : tuple of int, optional
        Lattice step t of each window, voxels; w / 2 by default, which suffices.
    iterations : int, default 12
        Most iterations of a window at a level, 30 in the paper; 24 changed the surface of Berea
        sandstone by 0.2 %.
    tolerance : float, default 0.005
        A window is done when for three iterations the energy has not fallen by this share.
    block : int, default 8
        Edge of the random blocks that the coarsest level starts from, voxels.
    starts : int, optional
        Volumes that are begun, each from random blocks of its own; the one whose radial two-point
        function at the end of the coarsest level is nearest to the exemplar's goes on. The first is
        that of a run with one. By default 8 with three levels or more, each of which takes 1 % of
        the time (at two levels it would be a tenth), and 1 with fewer. Bone's two-point error is
        then 4 % or less instead of 4.9, where a volume that is alike everywhere has 4.7 %.
    components : int, default 32
        Most principal components of a neighbourhood; 32 int16 fill a cache line and lose nothing
        visible.
    variance : float, default 0.95
        Share of the variance above which no further component is kept (zhang_2017 §4.2).
    symmetry : {"none", "flips", "rotations", "full"}, default "none"
        Symmetric copies of the exemplar that are offered too: 1, 8, 24 or 48, with as many times
        the memory. A swap of axes is wrong for an anisotropic material.
    keep_axis : {"z", "y", "x"}, optional
        Keep only symmetries that map this axis to itself, for a material with a direction.
    search : {"coherent", "kd_tree", "brute_force"}, default "coherent"
        Coherent search continues what neighbouring windows found: among 149 000 windows of edge 8
        it answers 490 times as many queries as brute force and 50 times as many as the kd-tree.
    candidates : int, default 10
        Nearest windows that the kd-tree ranks again by the full cost (k of the paper).
    index_weight : {"off", "literal", "normalised"}, default "off"
        The paper's index histogram, which makes much-used windows dearer: as printed (which does
        nothing measurable), or in units of the expected share.
    run_penalty : float, default 0.5
        Price of continuing a verbatim copy, in units of the descriptors' variance: it trades
        structure for novelty. Trabecular bone's novelty of 12³ is 0.15 without it and 0.42 at 0.5,
        with structure errors of 2.3 and 3.4 %; Berea sandstone's 0.30 and 1.12, with 4.1 and 4.2 %
        (two seeds of 152³ each, so that 2 % are noise).
    run_reach : int, default 12
        Distance, in voxels of the level, over which a copy must not go on.
    temperature : float, default 0.02
        At the finest level coherent search chooses among the candidates of a site by chance, as
        exp(−cost / T), where T falls from this, in units of the descriptors' variance, to 0 in the
        iterations of a window; 0 takes the best. It lowers the structure error by a sixth (of all
        of seven materials, three seeds of 152³ each) and takes a third more time, for no window is
        done early.
    exponent : float, default 0.1
        r of Eq. 2: windows that fit badly weigh less; 2 weighs all alike, the paper has 0.8. Lower
        is sharper: Berea sandstone's mean gradient comes out 4.5 % too low at 0.8, 3 % at 0.2 and
        2.5 % at 0, with structure errors that differ less than by their noise.
    adaptive : bool, default False
        The factor λ of Eq. 2, which grows by 5 % when the energy falls and shrinks by 30 % when it
        rises, each by more than the tenth that the random lattice makes. Without effect when
        ``gradient`` is 0.
    gradient : float, default 0.0
        μ of Eq. 1, against data weights of mean λ. It smooths where windows disagree, which costs
        surface: at 0.1 Berea sandstone lost 3 % more of it than without, at 0.5 8 %, and the
        structure error rose from 5.9 to 8.4 % (bone: from 3.1 to 8.0 %). The paper's term; 0.02 to
        0.5 acts.

    Attributes
    ----------
    exemplar_ : Volume
        The exemplar.
    parameters_ : TextureParameters
        All parameters, with those of the preset.
    threshold_ : float or None
        Gray value that parts pore from solid; None for labels.
    porosity_ : float
        The exemplar's porosity.
    field_ : {"distance", "intensity"}
        What is synthesised.
    field_reason_ : str
        Why, in a few words, with the share that decided.

    Examples
    --------
    >>> from poresynth.engines.volume_texture import VolumeTexture
    >>> from poresynth.exemplars import spinodal
    >>> engine = VolumeTexture(preset="fast").fit(spinodal((32, 32, 32)))
    >>> engine.sample((40, 40, 40), seed=1).shape
    (40, 40, 40)
    """

    def __init__(
        self,
        *,
        preset: Literal["quality", "fast", "paper"] = "quality",
        threshold: float | None = None,
        solid: Literal["bright", "dark"] | None = None,
        kind: Literal["auto", "gray", "binary", "label"] | None = None,
        field: Literal["auto", "distance", "intensity"] | None = None,
        clip: int | None = None,
        smoothing: float | None = None,
        levels: int | None = None,
        windows: tuple[int, ...] | None = None,
        steps: tuple[int, ...] | None = None,
        iterations: int | None = None,
        tolerance: float | None = None,
        block: int | None = None,
        starts: int | None = None,
        components: int | None = None,
        variance: float | None = None,
        symmetry: Literal["none", "flips", "rotations", "full"] | None = None,
        keep_axis: Literal["z", "y", "x"] | None = None,
        search: Literal["coherent", "kd_tree", "brute_force"] | None = None,
        candidates: int | None = None,
        index_weight: Literal["off", "literal", "normalised"] | None = None,
        run_penalty: float | None = None,
        run_reach: int | None = None,
        temperature: float | None = None,
        exponent: float | None = None,
        adaptive: bool | None = None,
        gradient: float | None = None,
    ) -> None:
        given = dict(locals())
        del given["self"]
        self.parameters: dict[str, Any] = given

    def fit(self, exemplar: Volume | npt.ArrayLike) -> Self:
        """Check the parameters and the exemplar.

        Parameters
        ----------
        exemplar : Volume or array_like
            Shape (z, y, x), or (z, y, x, channel), whose first channel decides the structure. bool,
            integer or float. At least ``max(windows) · 2**(levels - 1)`` voxels along each axis.

        Returns
        -------
        VolumeTexture
            The engine itself.

        Raises
        ------
        ParameterError
            If a parameter is out of range, or the exemplar is empty, constant, not finite, too
            small for the windows or of one phase only.
        """
        parameters = resolve(self.parameters)
        stages = parameters.stages()
        volume = as_volume(exemplar)
        validate_voxels(volume, "exemplar")
        smallest = max(w for w, _ in stages) << (parameters.levels - 1)
        if min(volume.shape) < smallest:
            raise ParameterError(
                "exemplar",
                volume.shape,
                f"must have at least {smallest} voxels along each axis for a window of "
                f"{max(w for w, _ in stages)} at {parameters.levels} levels; "
                "use smaller windows or fewer levels",
            )
        self._phases = Phases.of(volume, parameters.kind, parameters.threshold, parameters.solid)
        self.parameters_ = parameters
        self.exemplar_ = volume
        self.threshold_ = self._phases.threshold
        self.porosity_ = self._phases.porosity
        self.field_, self.field_reason_ = choose_field(volume.array, self._phases, parameters.field)
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
        orientation: FieldLike | None = None,
        scale: float | FieldLike | None = None,
        orientation_axis: Literal["z", "y", "x"] = "z",
        threads: int = 0,
        progress: ProgressCallback | None = None,
    ) -> SynthesizedVolume:
        """Make a volume.

        The same exemplar, parameters, shape and seed give the same volume, bit for bit, on any
        number of threads.

        Parameters
        ----------
        shape : (int, int, int)
            Voxels along (z, y, x); any aspect, each at least the largest window at the coarsest
            level.
        seed : int, default 0
            From 0 to 2⁶⁴ − 1.
        boundary : {"open", "periodic"}, default "open"
            A periodic volume tiles space without a seam.
        porosity : float, Volume, array_like or callable, optional
            Wanted pore fraction; the exemplar's by default. A number is reproduced to within one
            voxel. A map (z, y, x) of the output's shape, or coarser and interpolated, or a
            function ``porosity(z, y, x)`` of the voxels' centres in the unit of the voxel size,
            gives it from place to place: see `poresynth.engines.grading.grade`.
        known : Volume or array_like, optional
            Values of the voxels that are given, in an array of the output's shape (and the
            exemplar's channels): a scan to extend, the surroundings of a hole. Kept exactly; how
            visible its border is stands in the provenance, see `poresynth.engines.seam.seam`.
        known_mask : numpy.ndarray of bool, optional
            Where ``known`` counts; shape (z, y, x).
        mask : numpy.ndarray of bool, optional
            The voxels that matter, shape (z, y, x); windows that miss it are not searched, and
            voxels outside hold the pore's lowest value. A body in a large box is made in bricks
            of 192³ voxels, those without its inside left out, so that time goes with the inside
            and memory does not grow beyond that of a brick and the output; there is then no match
            map. With known voxels or a porosity map memory goes with the box, whose match map
            it is.
        orientation : Volume, array_like or callable, optional
            Vectors (z, y, x), shape (z, y, x, 3) or coarser, or a function of the voxels' centres
            that gives them: along them runs the exemplar's ``orientation_axis``, stretched by their
            length. See `poresynth.engines.coordinates.material_coordinates`. Not for periodic
            volumes, nor with known voxels.
        scale : float, Volume, array_like or callable, optional
            Factor by which the structure is larger than the exemplar's, in the same ways.
        orientation_axis : {"z", "y", "x"}, default "z"
            The exemplar's axis that follows the vectors.
        threads : int, default 0
            0 takes all cores.
        progress : callable, optional
            ``progress(stage, fraction)``, called between iterations on the calling thread. An
            exception in it stops the work.

        Returns
        -------
        SynthesizedVolume
            Of the exemplar's dtype, with the match map, the energies and the provenance.

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
        The structure is cut at the quantile that gives the wanted number of solid voxels exactly,
        over the voxels that are neither known nor outside the mask; ties fall by a position-keyed
        random number. Gray values of each phase then get the exemplar's histogram of that phase, so
        that a cut at the exemplar's threshold gives that very structure.

        Peak memory: see `estimate_memory`.
        """
        self._check_fitted()
        p, phases = self.parameters_, self._phases
        request = Request.of(
            shape,
            least=self._least,
            exemplar=self.exemplar_,
            seed=seed,
            boundary=boundary,
            porosity=porosity,
            known=known,
            known_mask=known_mask,
            mask=mask,
            threads=threads,
        )
        coordinates = self._coordinates(request, orientation, scale, orientation_axis)
        if coordinates is None:
            part, where = request.around_domain()
            if self._goes_in_bricks(request, part.shape):
                return self._in_bricks(request, progress)
            made = part
        else:
            part, where = request, ()
            inside = coordinates.domain(request.domain)
            made = replace(request, shape=coordinates.room, domain=inside, porosity_map=None)
        output = int(np.prod(part.shape, dtype=object)) if coordinates is not None else 0
        check_memory(
            self.estimate_memory(made.shape) + part.memory + CARRIED * output,
            f"a volume of {request.shape}",
        )
        field, gray, match_map, energy = self._made(made, progress)
        if coordinates is not None:
            field, gray = coordinates.carry(field), coordinates.carry(gray)
        scores = field
        if self.field_ == "distance" and p.smoothing > 0:
            scores = _core.gaussian(field, p.smoothing, boundary=part.boundary)
        phase = self._cut(scores, part)
        array = phase_values(phases, self.exemplar_.array, phase, gray, part)
        made_so: dict[str, Any] = {}
        if part.porosity_map is not None:
            graded = follow_map(array, phases, part, self._bright(scores)[0])
            made_so["grading"] = graded.provenance()
        if part.known_mask is not None:
            new = (array, phases.phase_of(array) > 0)
            own = (self.exemplar_.array, phases.phase > 0)
            made_so["seam"] = seam(new, own, part.known_mask, part.domain)
        if coordinates is not None:
            made_so["coordinates"] = coordinates.provenance()
        outside = outside_value(phases, self.exemplar_.array)
        return SynthesizedVolume(
            request.whole(array, where, outside),
            self.exemplar_.voxel_size,
            self.exemplar_.unit,
            {"poresynth": self._provenance(request, {**made_so, "copying": _copying(match_map)})},
            match_map=match_map,
            energy=energy,
        )

    def sample_to(
        self,
        path: str | Path,
        shape: tuple[int, int, int],
        *,
        seed: int = 0,
        porosity: float | None = None,
        mask: npt.NDArray[np.bool_] | None = None,
        threads: int = 0,
        progress: ProgressCallback | None = None,
        origin: dict[str, Any] | None = None,
    ) -> dict[str, Any]:
        """Make a volume and write it brick by brick, however large it is.

        Parameters
        ----------
        path : path-like
            A TIFF, which is not compressed, or a Zarr store.
        shape, seed, mask, threads, progress
            As for `sample`.
        porosity : float, optional
            Wanted pore fraction, met in each brick to the voxel; the exemplar's by default.
        origin : dict, optional
            What else goes into the provenance of the file, JSON-compatible.

        Returns
        -------
        dict
            What is known of the bricks at the end, as of `poresynth.engines.bricks.lay`.

        Raises
        ------
        ParameterError
            If an argument is out of range, or the exemplar has several channels.
        FileError
            If the file cannot be written; nothing partial is left.
        KeyboardInterrupt
            On Ctrl-C, at once.

        Notes
        -----
        Peak memory: that of a brick of 192³ voxels with its margin, some 0.6 GB, whatever the
        shape; and the mask.
        """
        self._check_fitted()
        request = Request.of(
            shape,
            least=self._least,
            exemplar=self.exemplar_,
            seed=seed,
            porosity=porosity,
            mask=mask,
            threads=threads,
        )
        if request.porosity_map is not None:
            allowed = "must be a number where a volume is written brick by brick"
            raise ParameterError("porosity", "a map", allowed)
        exemplar = self.exemplar_
        check_memory(self._brick_memory(), "a brick")
        made_by = self._provenance(request, {"bricks": layout(request.least)})
        blank = np.broadcast_to(np.zeros((), exemplar.dtype), request.shape)
        metadata = {"poresynth": {**made_by, **(origin or {})}}
        like = Volume(blank, exemplar.voxel_size, exemplar.unit, metadata)
        with create(path, like) as file:
            return self._lay(file, request, progress)

    def _goes_in_bricks(self, request: Request, box: tuple[int, int, int]) -> bool:
        """Return whether the box round a body takes more memory than bricks of its inside."""
        if request.domain is None or request.known is not None or request.boundary == "periodic":
            return False
        return self.estimate_memory(box) > self._brick_memory()

    def _brick_memory(self) -> int:
        edge = sum(layout(self._least).values())
        return self.estimate_memory((edge, edge, edge)) + KNOWN_MEMORY * edge**3

    def _in_bricks(self, request: Request, progress: ProgressCallback | None) -> SynthesizedVolume:
        exemplar = self.exemplar_
        output = exemplar.dtype.itemsize * exemplar.channels * int(np.prod(request.shape))
        needed = max(self._brick_memory(), request.memory) + output
        check_memory(needed, f"a volume of {request.shape}")
        wall = np.empty(request.shape + exemplar.array.shape[3:], exemplar.dtype)
        bricks = self._lay(wall, request, progress)
        made_so = {"copying": bricks.pop("copying"), "bricks": bricks}
        if request.porosity_map is not None:
            made_so["grading"] = follow_map(wall, self._phases, request).provenance()
        return SynthesizedVolume(
            wall,
            exemplar.voxel_size,
            exemplar.unit,
            {"poresynth": self._provenance(request, made_so)},
        )

    def _lay(
        self, wall: Wall, request: Request, progress: ProgressCallback | None
    ) -> dict[str, Any]:
        return lay(
            wall,
            request.shape,
            self.sample,
            least=request.least,
            seed=request.seed,
            domain=request.domain,
            porosity=request.porosity,
            outside=outside_value(self._phases, self.exemplar_.array),
            progress=progress,
            threads=request.threads,
        )

    @property
    def _least(self) -> int:
        """Least edge that the windows take at the coarsest level, voxels."""
        p = self.parameters_
        return max(w for w, _ in p.stages()) << (p.levels - 1)

    def _coordinates(
        self,
        request: Request,
        orientation: FieldLike | None,
        scale: float | FieldLike | None,
        axis: Literal["z", "y", "x"],
    ) -> Coordinates | None:
        """Return where the output lies in the material, if it is not the material itself."""
        if orientation is None and scale is None:
            return None
        if request.boundary == "periodic" or request.known is not None:
            name = "orientation" if scale is None else "scale"
            raise ParameterError(
                name, "given", "must not be given for a periodic volume or with known voxels"
            )
        return material_coordinates(
            request.shape, self.exemplar_.voxel_size, orientation, scale, axis, request.least
        )

    def _made(
        self, request: Request, progress: ProgressCallback | None
    ) -> tuple[
        npt.NDArray[np.float32], npt.NDArray[np.float32], MatchMap, tuple[EnergyRecord, ...]
    ]:
        """Return the field of the material, what its gray values go by, and where it comes from."""
        phases = self._phases
        known, known_mask = request.known, request.known_mask
        exemplar_field = self._field(self.exemplar_.array, phases.phase)
        field, [match_map], energy = _core.synthesize(
            [self._example(exemplar_field)],
            request.shape,
            self._options(request.boundary),
            seed=request.seed,
            known=self._known_field(request),
            known_mask=known_mask,
            # Windows that hold known voxels only have nothing to find.
            domain=request.free,
            threads=request.threads,
            progress=progress,
        )
        if known_mask is not None:
            surface = 127.5 if self.field_ == "distance" else None
            field = settle(field, exemplar_field, known_mask, request.domain, cut=surface)
        gray = field
        if phases.kind == "gray" and self.field_ == "distance":
            values = np.ascontiguousarray(channels_first(self.exemplar_.array), dtype=np.float32)
            gray = _core.carry(
                exemplar_field, field, values, match_map, seed=request.seed, threads=request.threads
            )
            if known_mask is not None and known is not None:
                gray[:, known_mask] = channels_first(known)[:, known_mask]
                gray = settle(gray, values, known_mask, request.domain)
        return field, gray, match_map, tuple(EnergyRecord(*record) for record in energy)

    def estimate_memory(self, shape: tuple[int, int, int]) -> int:
        """Return the peak memory of `sample` in bytes.

        Per voxel of the output 4 bytes and 13 a field channel (27 with the gradient term); for a
        gray exemplar 4 more, and where distance is synthesised 8 a gray channel. That is 3 to 25 %
        above what was measured on binary, gray and label volumes, more on intensities of several
        channels. Per voxel of the exemplar 24 bytes, 8 a channel, and the descriptors: 2 bytes a
        component, times the number of symmetric copies, with 32 more for the kd-tree.
        """
        self._check_fitted()
        p = self.parameters_
        copies = {"none": 1, "flips": 8, "rotations": 24, "full": 48}[p.symmetry]
        dims = -(-p.components // 16) * 16
        tree = 32 if p.search == "kd_tree" else 0
        channels = self._field_channels()
        per_output = 4 + channels * (27 if p.gradient > 0 else 13)
        if self._phases.kind == "gray":
            per_output += 4 + (8 * self.exemplar_.channels if self.field_ == "distance" else 0)
        per_exemplar = 24 + 8 * channels + copies * (2 * dims + tree)
        exemplar = int(np.prod(self.exemplar_.shape, dtype=object))
        return per_output * int(np.prod(shape, dtype=object)) + per_exemplar * exemplar

    def save(self, path: str | Path) -> None:
        """Write parameters and exemplar to an ``.npz`` file (no pickles inside).

        Raises
        ------
        FileError
            If the file cannot be written; nothing partial is left.
        """
        self._check_fitted()
        header = {
            "engine": "volume",
            "parameters": self.parameters_.model_dump(),
            "voxel_size": self.exemplar_.voxel_size,
            "unit": self.exemplar_.unit,
        }
        with output(path) as (temporary,), temporary.open("wb") as file:
            np.savez_compressed(
                file, exemplar=self.exemplar_.array, header=np.array(json.dumps(header))
            )

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
                array = data["exemplar"]
            volume = Volume(array, tuple(header["voxel_size"]), header["unit"])
            parameters = header["parameters"]
        except (OSError, ValueError, KeyError) as error:
            raise FileError(f"{path}: not a saved volume engine ({error})") from error
        return cls(**parameters).fit(volume)

    def _check_fitted(self) -> None:
        if not hasattr(self, "exemplar_"):
            raise ParameterError("engine", "not fitted", "must see an exemplar first: call fit")

    def _example(self, field: npt.NDArray[np.float32]) -> dict[str, Any]:
        p = self.parameters_
        return {
            "field": field,
            "symmetry": p.symmetry,
            "keep_axis": None if p.keep_axis is None else "zyx".index(p.keep_axis),
            "normal": None,
            "weight": 1.0,
        }

    def _options(self, boundary: str) -> dict[str, Any]:
        p = self.parameters_
        shared = p.model_dump(
            include={
                "tolerance", "block", "components", "variance", "index_weight", "run_penalty",
                "run_reach", "exponent", "adaptive", "gradient",
            }
        )  # fmt: skip
        level = {
            **p.model_dump(include={"iterations", "search", "candidates"}),
            "temperature": 0.0,
            "stages": p.stages(),
            "filters": 0,
            "filter_edge": 0,
            "deep": False,
            "alike": False,
            "regularisation": 1.0,
            "detail": False,
            "response_steps": (0, 0),
            "bandwidth": None,
            "relaxation": 1.0,
            "mode_steps": 0,
        }
        return {
            **shared,
            "levels": [{**level, "temperature": p.temperature}, *[level] * (p.levels - 1)],
            "start": "blocks",
            "starts": p.trials(),
            "patience": PATIENCE,
            "emphasis": "none",
            "match_histogram": True,
            "boundary": boundary,
        }

    def _field_channels(self) -> int:
        labels = len(self._phases.labels)
        if self._phases.kind == "label" and labels > 2:
            return labels
        return self.exemplar_.channels if self.field_ == "intensity" else 1

    def _field(
        self,
        array: npt.NDArray[Any],
        phase: npt.NDArray[np.uint8],
        valid: npt.NDArray[np.bool_] | None = None,
    ) -> npt.NDArray[np.float32]:
        """Return what is synthesised: values in 0 … 255, shape (channel, z, y, x)."""
        phases = self._phases
        if self.field_ == "distance":
            return phases.distance_field(phase, self.parameters_.clip, valid)
        if phases.kind != "gray":
            which = [1] if len(phases.labels) == 2 else range(len(phases.labels))
            return np.stack([np.where(phase == k, np.float32(255), np.float32(0)) for k in which])
        exemplar = channels_first(self.exemplar_.array)
        low = exemplar.min(axis=(1, 2, 3), keepdims=True).astype(np.float64)
        high = exemplar.max(axis=(1, 2, 3), keepdims=True).astype(np.float64)
        span = np.where(high > low, high - low, 1.0)
        field = (channels_first(array) - low) * (255.0 / span)
        return np.ascontiguousarray(field, dtype=np.float32)

    def _known_field(self, request: Request) -> npt.NDArray[np.float32] | None:
        filled = request.filled(self.exemplar_.array[0, 0, 0])
        if filled is None:
            return None
        return self._field(filled, self._phases.phase_of(filled), request.known_mask)

    def _cut(self, scores: npt.NDArray[np.float32], request: Request) -> npt.NDArray[np.uint8]:
        """Return the phase of every voxel, with exactly the wanted number in each."""
        return cut(self._phases, self._bright(scores), request)

    def _bright(self, scores: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """Return the scores so that the solid's are high."""
        dark = self.field_ == "intensity" and self._phases.kind == "gray"
        return -scores if dark and self._phases.solid == "dark" else scores

    def _provenance(self, request: Request, made_so: dict[str, Any]) -> dict[str, Any]:
        return {
            "version": _core.__version__,
            "engine": "volume",
            "parameters": self.parameters_.model_dump(mode="json"),
            "field": self.field_,
            "field_reason": self.field_reason_,
            **request.provenance(),
            **made_so,
            "exemplar": self._phases.provenance(self.exemplar_),
        }


def _copying(match_map: MatchMap) -> dict[str, float]:
    copied, block = match_map.copying()
    return {"copy_fraction": copied, "mean_copied_block": block}
