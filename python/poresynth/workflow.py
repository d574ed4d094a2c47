"""What the commands do, from the files that they read to the files that they leave."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from poresynth import console
from poresynth.errors import ParameterError

if TYPE_CHECKING:
    from poresynth.comparison import Comparison
    from poresynth.config import InputConfig, PruneConfig, ReadConfig, RunConfig
    from poresynth.engines.base import SynthesizedVolume, Synthesizer
    from poresynth.pruning import Pruned
    from poresynth.shapes import Domain
    from poresynth.volume import Volume

__all__ = [
    "FLAT_ENGINES",
    "IMAGE_ENGINES",
    "TRAINED_ENGINES",
    "compare",
    "crop",
    "field_of",
    "judge",
    "measure",
    "prune",
    "prune_new",
    "read",
    "read_exemplar",
    "read_exemplars",
    "read_mask",
    "reserve",
    "shape_of_mask",
    "synthesize",
    "write",
    "write_json",
]

IMAGE_ENGINES = {"solid": 3}
"""Engines that learn from images, with the most that each takes; the others take one volume."""

TURNING_ENGINE = "volume"
"""The engine whose structure can turn and scale from place to place."""

FLAT_ENGINES = {"ipfn"}
"""Engines that learn from a volume or from an image, and make the like of it."""

TRAINED_ENGINES = {"scaffoldgan", "ipfn"}
"""Engines whose `fit` trains a network: it takes long, and reports its progress."""

# Channels of a plain array (y, x, channel): more are the voxels of a volume.
_CHANNELS = 4


@contextmanager
def reserve(
    output: Path | None = None, *, report: Path | None = None, json_file: Path | None = None
) -> Iterator[None]:
    """Hold the outputs from the beginning: what would fail at the end fails here.

    Parameters
    ----------
    output : Path, optional
        A volume.
    report : Path, optional
        The folder of a report.
    json_file : Path, optional
        A file for figures.

    Raises
    ------
    FileError
        If one of them cannot be written, or another process is writing there.
    """
    from poresynth import io
    from poresynth.report import reserved

    with ExitStack() as stack:
        if output is not None:
            io.check_output(output)
            stack.enter_context(io.claim(output))
        if json_file is not None:
            io.check_writable(json_file)
            stack.enter_context(io.claim(json_file))
        if report is not None:
            stack.enter_context(reserved(report))
        yield


def synthesize(run: RunConfig, output: Path, threads: int, report: Path | None) -> None:
    """Make a volume, write it with all that made it, and say how new it is.

    Parameters
    ----------
    run : RunConfig
        What decides the result.
    output : Path
        The new volume.
    threads : int
        Number of threads; 0 takes all cores.
    report : Path, optional
        Folder for a report.

    Raises
    ------
    PoresynthError
        If anything is wrong with the run; no output is then left.
    """
    from poresynth import io

    with reserve(output, report=report):
        exemplars = read_exemplars(run)
        digests = _check_repetition(run, exemplars)
        domain = read_mask(run.mask, run.mask_unit, exemplars[0])
        volume = _sample(run, exemplars, domain, threads)
        if run.prune is not None:
            known = None if run.known_mask is None else read(Path(run.known_mask)).array != 0
            volume = prune_new(
                volume,
                run.prune,
                exemplar=None if run.engine in IMAGE_ENGINES else exemplars[0],
                boundary=run.boundary,
                known_mask=known,
                domain=None if domain is None else domain.mask.array,
                threads=threads,
                report=report,
            )
        origin = volume.metadata["poresynth"]
        origin["configuration"] = run.saved(digests)
        origin["command"] = run.command(output)
        io.write(output, volume)
        console.result(f"new volume: {output}")
        for name, ratio in (origin.get("seam") or {}).items():
            if ratio is not None:
                console.result(
                    f"seam at the known voxels: {ratio:.2f} times the {name.replace('_', ' ')} "
                    "of the exemplar"
                )
        for reason in ("field_reason", "mode_reason"):
            if reason in origin:
                console.result(f"synthesised: {origin[reason]}")
        if "raw_porosity" in origin:
            console.result(f"porosity at the exemplar's threshold: {origin['raw_porosity']:.4f}")
        judge(exemplars, volume, threads, report, beside_images=run.engine in IMAGE_ENGINES)


def judge(
    exemplars: Sequence[Volume],
    volume: SynthesizedVolume,
    threads: int,
    report: Path | None,
    *,
    beside_images: bool,
) -> None:
    """Say how new a volume is; beside images, or with a report, how like its exemplars too."""
    if volume.shape[0] == 1:
        console.note("it is an image: comparisons and reports are of volumes")
        return
    if report is None and not beside_images:
        _print_copying(exemplars[0], volume, threads)
    else:
        _compare_with_exemplars(exemplars, volume, threads, report)


def _check_repetition(run: RunConfig, exemplars: Sequence[Volume]) -> tuple[str, ...]:
    """Return the exemplars' hashes; a saved run must have the same, and should the version."""
    import numpy as np

    from poresynth import __version__

    if run.version not in (None, __version__):
        console.note(
            f"the configuration was saved by version {run.version}; this is {__version__}, "
            "which may give other voxels"
        )
    digests = tuple(
        hashlib.sha256(np.ascontiguousarray(exemplar.array).data).hexdigest()
        for exemplar in exemplars
    )
    saved = digests if run.exemplar_sha256 is None else run.exemplar_sha256
    if len(saved) != len(digests):
        allowed = f"must be as many as exemplars, {len(digests)}"
        raise ParameterError("exemplar_sha256", f"{len(saved)} hashes", allowed)
    for path, was, now in zip(run.exemplar, saved, digests, strict=True):
        if was != now:
            raise ParameterError(
                "exemplar",
                path,
                "is not the one of the saved run any more (its sha256 differs); name it on the "
                "command line to use it all the same",
            )
    return digests


def _sample(
    run: RunConfig, exemplars: Sequence[Volume], domain: Domain | None, threads: int
) -> SynthesizedVolume:
    from poresynth.engines import get_engine
    from poresynth.resources import available_memory, check_memory, format_bytes

    known, known_mask = (
        None if path is None else read(Path(path)).array for path in (run.known, run.known_mask)
    )
    directions = _directions(run)
    example = exemplars[0] if len(exemplars) == 1 else exemplars
    engine = get_engine(run.engine)(**run.parameters)
    if run.engine in TRAINED_ENGINES:
        with console.progress("training") as progress:
            engine.fit(example, progress=progress)
    else:
        engine.fit(example)
    if domain is not None:
        _check_room(domain, exemplars[0], engine)
    needed, free = engine.estimate_memory(run.shape), available_memory()
    check_memory(needed, f"shape {' '.join(map(str, run.shape))}")
    console.note(
        f"needs about {format_bytes(needed)} of memory"
        + ("" if free is None else f"; {format_bytes(free)} is available")
    )
    with console.progress("synthesis") as progress:
        made = engine.sample(
            run.shape,
            seed=run.seed,
            boundary=run.boundary,
            porosity=field_of("porosity", run.porosity, run.shape),
            **directions,
            known=known,
            known_mask=None if known_mask is None else known_mask != 0,
            mask=None if domain is None else domain.mask.array,
            threads=threads,
            progress=progress,
        )
    if domain is not None:
        made.metadata["poresynth"]["domain"] = domain.to_dict()
    return made


def _check_room(domain: Domain, exemplar: Volume, engine: Synthesizer) -> None:
    """Refuse a body that is smaller than what it is filled with."""
    from poresynth.engines.grading import feature_size
    from poresynth.shapes import check_room

    threshold = getattr(engine, "threshold_", None)
    if threshold is not None:
        structure = exemplar.array if exemplar.array.ndim == 3 else exemplar.array[..., 0]
        # Half of a solid and a pore intercept together: the mean size of one of them.
        feature = feature_size(structure > threshold) / 2 * min(exemplar.voxel_size)
        check_room(domain.mask, feature)


def read_mask(mask: str | None, unit: str | None, volume: Volume) -> Domain | None:
    """Read a domain in voxels of a volume, and say what was repaired.

    Parameters
    ----------
    mask : str, optional
        Path of a volume or a closed mesh; nothing is read without.
    unit : str, optional
        Unit of a mesh that does not say its own.
    volume : Volume
        Whose voxel size and unit count.
    """
    from poresynth.shapes import read_domain

    if mask is None:
        return None
    domain = read_domain(mask, voxel_size=volume.voxel_size, unit=volume.unit, body_unit=unit)
    for said in domain.notes:
        console.note(f"{mask}: {said}")
    return domain


def shape_of_mask(document: Mapping[str, Any]) -> tuple[int, int, int] | None:
    """Return the shape that a body has in voxels of the exemplar, for a run that says none."""
    from poresynth.config import validate
    from poresynth.meshes import READABLE
    from poresynth.shapes import read_domain

    mask = document.get("mask")
    if document.get("shape") is not None or Path(str(mask)).suffix.lower() not in READABLE:
        return None
    run = validate({**document, "shape": (1, 1, 1)})
    exemplar = read_exemplars(run)[0]
    # Repairs are said when the run reads the body.
    return read_domain(
        str(mask),
        voxel_size=exemplar.voxel_size,
        unit=exemplar.unit,
        body_unit=run.mask_unit,
    ).mask.shape


def _directions(run: RunConfig) -> dict[str, Any]:
    """Return how structure turns and scales, for engines that can do it."""
    given: dict[str, Any] = {}
    if run.scale is not None:
        given["scale"] = field_of("scale", run.scale, run.shape)
    if run.orientation is not None:
        given["orientation"] = read(Path(run.orientation)).array
        given["orientation_axis"] = run.orientation_axis
    if given and run.engine != TURNING_ENGINE:
        name = next(iter(given))
        allowed = f"must not be given for the engine {run.engine}, only for {TURNING_ENGINE}"
        raise ParameterError(name, getattr(run, name), allowed)
    return given


def field_of(name: str, wanted: float | str | None, shape: tuple[int, int, int]) -> Any:
    """Return a number, or a map of a volume: from a file, or linear from face to face."""
    import numpy as np

    if not isinstance(wanted, str):
        return wanted
    found = re.fullmatch(r"([zyx])=([^:=]+):([^:=]+)", wanted)
    if found is None:
        return read(Path(wanted)).array
    try:
        first, last = (float(text) for text in found.groups()[1:])
    except ValueError:
        allowed = "must be a number, a map's path, or AXIS=FROM:TO such as z=0.6:0.9"
        raise ParameterError(name, wanted, allowed) from None
    along = "zyx".index(found[1])
    edges = [shape[axis] if axis == along else 1 for axis in range(3)]
    # Linear from face to face; the outermost voxels' centres lie half a voxel inside.
    places = (np.arange(shape[along]) + 0.5) / shape[along]
    return np.broadcast_to((first + (last - first) * places).reshape(edges), shape)


def prune_new(
    volume: SynthesizedVolume,
    how: PruneConfig,
    *,
    exemplar: Volume | None,
    boundary: Literal["open", "periodic"],
    known_mask: Any = None,
    domain: Any = None,
    threads: int = 0,
    report: Path | None = None,
) -> SynthesizedVolume:
    """Prune a new volume, cut as its exemplar was; its provenance says so.

    The parameters are those of `prune`; known voxels stay.
    """
    from dataclasses import replace

    origin = volume.metadata["poresynth"]
    learned = origin["exemplar"]
    cut = learned[0] if isinstance(learned, list) else learned
    pruned = prune(
        volume,
        how,
        exemplar=exemplar,
        threshold=cut["threshold"],
        solid=cut["solid"],
        boundary=boundary,
        free=None if known_mask is None else ~known_mask,
        domain=domain,
        threads=threads,
        report=report,
    )
    figures = {name: value for name, value in pruned.to_dict().items() if name != "edits"}
    metadata = {**volume.metadata, "poresynth": {**origin, "pruning": figures}}
    return replace(volume, array=pruned.volume.array, metadata=metadata)


def prune(
    volume: Volume,
    how: PruneConfig,
    *,
    exemplar: Volume | None,
    threshold: float | None,
    solid: Literal["bright", "dark"],
    boundary: Literal["open", "periodic"] = "open",
    free: Any = None,
    domain: Any = None,
    threads: int = 0,
    report: Path | None = None,
    command: str | None = None,
) -> Pruned:
    """Prune a volume, say what that did, and write the report of it.

    The parameters are those of `poresynth.pruning.prune`; ``report`` is a folder for
    ``pruning.html``.
    """
    from poresynth import pruning
    from poresynth.report import write_pruning_report
    from poresynth.report.words import number

    with console.progress("pruning") as progress:
        pruned = pruning.prune(
            volume,
            exemplar=exemplar,
            threshold=threshold,
            solid=solid,
            boundary=boundary,
            free=free,
            domain=domain,
            threads=threads,
            progress=progress,
            **how.arguments(exemplar=exemplar is not None),
        )
    before, after, own = pruned.before, pruned.after, pruned.exemplar
    names = list(vars(after))
    rows = [
        [name, *(number(getattr(s, name)) for s in (before, after, own) if s is not None)]
        for name in names
    ]
    header = ("figure", "before", "after", *(() if own is None else ("exemplar",)))
    console.figures("Before and after pruning", rows, header)
    made = ", ".join(f"{count} × {kind}" for kind, count in pruned.counts().items())
    console.result(f"edits: {made or 'none'}")
    if pruned.loose:
        console.note(f"{pruned.loose} loose branches found no strut within reach and remain")
    if report is not None:
        page = write_pruning_report(report, volume, pruned, command=command)
        console.result(f"report of the pruning: {page}")
    return pruned


def _print_copying(exemplar: Volume, volume: SynthesizedVolume, threads: int) -> None:
    """Print how much is verbatim: no result goes without it."""
    from poresynth.metrics import novelty
    from poresynth.metrics.copying import EDGES
    from poresynth.metrics.structure import first_channel
    from poresynth.report.words import number

    copying = volume.metadata["poresynth"].get("copying", {})
    rows = [(name, number(value)) for name, value in copying.items()]
    arrays = first_channel(exemplar, "exemplar"), first_channel(volume, "volume")
    for edge in EDGES:
        found = novelty(*arrays, edge, threads=threads)
        rows.append((f"novelty_{edge}", number(found.plain)))
        rows.append((f"novelty_{edge}_mirrors", number(found.mirrored)))
    title = "How new it is (novelty 0: a copy, 1: as different as two halves of the exemplar)"
    console.figures(title, rows, ("figure", "new volume"))


def _compare_with_exemplars(
    exemplars: Sequence[Volume], volume: SynthesizedVolume, threads: int, report: Path | None
) -> None:
    from poresynth.report import write_report

    origin = volume.metadata["poresynth"]
    learned = origin["exemplar"]
    cut = learned[0] if isinstance(learned, list) else learned
    reference = _reference(exemplars, origin["parameters"].get("axes"))
    comparison = compare(
        reference, volume, threshold=cut["threshold"], solid=cut["solid"], threads=threads
    )
    if report is not None:
        page = write_report(
            report,
            reference,
            volume,
            comparison,
            energy=volume.energy,
            configuration=origin["configuration"],
            command=origin["command"],
        )
        console.result(f"report: {page}")


def _reference(exemplars: Sequence[Volume], axes: Sequence[str] | None) -> Any:
    """Return what a volume is compared with: its exemplar, or the image of each axis."""
    axes = axes or "zyx"
    if len(exemplars) > 1:
        return dict(zip(axes, exemplars, strict=False))
    return exemplars[0] if len(axes) == 3 else dict.fromkeys(axes, exemplars[0])


def compare(
    exemplar: Any,
    volume: Volume,
    *,
    threshold: float | None,
    solid: Literal["bright", "dark"],
    seed: int = 0,
    threads: int = 0,
) -> Comparison:
    """Compare a volume with its exemplar, or with the image of each of its axes, and say how alike.

    The parameters are those of `poresynth.compare`.
    """
    import poresynth
    from poresynth.report.words import number

    with console.progress("comparison") as progress:
        comparison = poresynth.compare(
            exemplar,
            volume,
            threshold=threshold,
            solid=solid,
            seed=seed,
            threads=threads,
            progress=progress,
        )
    rows = []
    for figure in comparison.figures.values():
        unit = f" {figure.unit}" if figure.unit else ""
        spread = [number(n) for n in (figure.low, figure.high) if n is not None]
        rows.append(
            (
                figure.name,
                number(figure.value) + unit,
                number(figure.exemplar),
                " to ".join(spread),
                figure.mark,
            )
        )
    header = ("figure", "new volume", "exemplar", "its range", "mark")
    console.figures("The new volume beside its exemplar", rows, header)
    return comparison


def measure(
    path: Path,
    source: ReadConfig | None,
    *,
    threshold: float | None,
    solid: Literal["bright", "dark"],
    transport: bool,
    threads: int,
) -> dict[str, Any]:
    """Measure a volume and print the numbers; parameters as of `poresynth.metrics.measure`."""
    from poresynth import metrics
    from poresynth.report.words import number

    volume = read(path, source)
    with console.progress("measurement") as progress:
        found = metrics.measure(
            volume,
            threshold=threshold,
            solid=solid,
            transport=transport,
            threads=threads,
            progress=progress,
        )
    rows = []
    for metric in (*metrics.METRICS.values(), *metrics.TRANSPORT_METRICS.values()):
        if metric.name not in found:
            continue
        cells = [metric.name, number(found[metric.name]), metric.unit]
        if volume.unit != "voxel":
            scaled = found.get(f"{metric.name}_in_unit")
            unit = metrics.unit_of(volume.unit, metric.power)
            cells += ["", ""] if not metric.power else [number(scaled), unit]
        rows.append((*cells, metric.description))
    units = () if volume.unit == "voxel" else ("in unit", "of length")
    header = ("figure", "value", "unit", *units, "what it says")
    console.figures(str(path), rows, header)
    return found


def read(path: Path, source: ReadConfig | None = None) -> Volume:
    """Read a volume as the command line asks for it."""
    from poresynth import io

    return io.read(path, **({} if source is None else source.options()))


def read_exemplar(path: Path, source: InputConfig, *, image: bool = False) -> Volume:
    """Read an exemplar, cropped and reduced as the command line asks for it.

    Where an image is wanted, a plain array (y, x, channel) is one.
    """
    from poresynth import preprocess

    volume = read(path, source)
    if image and volume.array.ndim == 3 and volume.shape[2] <= _CHANNELS < min(volume.shape[:2]):
        volume = volume.with_array(volume.array[None])
    if source.crop is not None:
        volume = crop(volume, source.crop)
    return preprocess.downsample(volume, source.downsample) if source.downsample > 1 else volume


def read_exemplars(run: RunConfig) -> list[Volume]:
    """Read the exemplars of a run.

    Parameters
    ----------
    run : RunConfig
        The run.

    Returns
    -------
    list of Volume
        One volume, or the images of an engine that learns from images.

    Raises
    ------
    ParameterError
        If the engine takes something else, or the images differ in their channels.
    FileError
        If one cannot be read.
    """
    images = run.engine in IMAGE_ENGINES
    count, most = len(run.exemplar), IMAGE_ENGINES.get(run.engine, 1)
    if count > most:
        one = "one volume" if run.engine not in FLAT_ENGINES else "one volume or image"
        what = f"1 to {most} images" if images else f"{one}; for images take --engine solid"
        allowed = f"are {count}, but the engine {run.engine} learns from {what}"
        raise ParameterError("exemplar", ", ".join(run.exemplar), allowed)
    volumes = []
    for path in run.exemplar:
        volume = read_exemplar(Path(path), run.input, image=images)
        if run.engine not in FLAT_ENGINES and images != (volume.shape[0] == 1):
            raise ParameterError("exemplar", path, _refusal(run.engine, volume))
        volumes.append(volume)
    channels = [volume.channels for volume in volumes]
    if len(set(channels)) > 1:
        allowed = f"must have the same number of channels, not {', '.join(map(str, channels))}"
        raise ParameterError("exemplar", ", ".join(run.exemplar), allowed)
    return volumes


def _refusal(engine: str, volume: Volume) -> str:
    """Return why an engine does not take a volume, or an image."""
    if engine not in IMAGE_ENGINES:
        return f"is an image, but the engine {engine} learns from a volume; take --engine solid"
    edges, middle = " × ".join(map(str, volume.shape)), volume.shape[0] // 2
    return (
        f"is a volume of {edges} voxels, but the engine {engine} learns from images; take --engine "
        f"volume, or a slice, such as --crop {middle}:{middle + 1} : :"
    )


def crop(volume: Volume, ranges: tuple[str, str, str]) -> Volume:
    """Cut a part out of a volume.

    Parameters
    ----------
    volume : Volume
        The volume.
    ranges : (str, str, str)
        ``"start:stop"`` along (z, y, x); an empty side means the border.

    Returns
    -------
    Volume
        A view. A part one voxel thick, along whichever axis, is an image: (1, y, x).

    Raises
    ------
    ParameterError
        If a range is something else or reaches beyond the volume.
    """
    from poresynth import preprocess

    limits = []
    for axis, text, edge in zip("zyx", ranges, volume.shape, strict=True):
        first, colon, last = text.partition(":")
        try:
            start, stop = int(first or 0), int(last or edge)
        except ValueError:
            colon = ""
        if not colon or not 0 <= start < stop <= edge:
            raise ParameterError(f"crop {axis}", text, f"must be start:stop within 0:{edge}")
        limits.append((start, stop))
    part = preprocess.crop(volume, [a for a, _ in limits], [b - a for a, b in limits])
    return preprocess.as_image(part) if 1 in part.shape else part


def write(output: Path, volume: Volume) -> None:
    """Write a volume and say so."""
    from poresynth import io

    io.write(output, volume)
    console.result(f"{output}: {' × '.join(map(str, volume.shape))} voxels")


def write_json(path: Path, document: Mapping[str, Any]) -> None:
    """Write figures, whole or not at all."""
    from poresynth import io

    with io.output(path) as (temporary,):
        temporary.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
