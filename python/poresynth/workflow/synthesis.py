"""What the command `synthesize` does, from the exemplars to the new volume."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from poresynth import console
from poresynth.engines import ENGINES, get_engine
from poresynth.errors import ParameterError
from poresynth.workflow.comparing import judge
from poresynth.workflow.domains import check_room, field_of, read_mask
from poresynth.workflow.files import read, reserve
from poresynth.workflow.inputs import read_exemplars
from poresynth.workflow.memory import state_memory
from poresynth.workflow.pruning import prune_new
from poresynth.workflow.refusals import NOT_BLOCKWISE, refuse

if TYPE_CHECKING:
    from poresynth.config import RunConfig
    from poresynth.engines.base import SynthesizedVolume
    from poresynth.shapes import Domain
    from poresynth.volume import Volume

__all__ = ["synthesize"]


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

    if run.blockwise:
        _check_blockwise(run, report)
    of_images = ENGINES[run.engine].learns_from == "images"
    with reserve(output, report=report):
        exemplars = read_exemplars(run)
        digests = _check_repetition(run, exemplars)
        domain = read_mask(run.mask, run.mask_unit, exemplars[0])
        if run.blockwise:
            _sample_to(run, digests, exemplars[0], domain, output, threads)
            return
        volume = _sample(run, exemplars, domain, threads)
        if run.prune is not None:
            known = None if run.known_mask is None else read(Path(run.known_mask)).array != 0
            volume = prune_new(
                volume,
                run.prune,
                exemplar=None if of_images else exemplars[0],
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
        for reason in ("field_reason", "mode_reason", "period_reason"):
            if reason in origin:
                console.result(f"synthesised: {origin[reason]}")
        if "raw_porosity" in origin:
            console.result(f"porosity at the exemplar's threshold: {origin['raw_porosity']:.4f}")
        judge(exemplars, volume, threads, report, beside_images=of_images)


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
    # All that can be refused before a training.
    known, known_mask = (
        None if path is None else read(Path(path)).array for path in (run.known, run.known_mask)
    )
    directions, porosity = _directions(run), field_of("porosity", run.porosity, run.shape)
    example = exemplars[0] if len(exemplars) == 1 else exemplars
    engine: Any = get_engine(run.engine)(**run.parameters)
    if ENGINES[run.engine].trains:
        refuse({"known": run.known}, f"cannot be kept by the engine {run.engine}")
        engine.check_shape(run.shape, run.boundary)
        with console.progress("training") as progress:
            engine.fit(example, progress=progress)
    else:
        engine.fit(example)
    if domain is None:
        state_memory(engine.estimate_memory(run.shape), run.shape)
    else:  # What a body takes depends on its inside: the engine looks itself.
        check_room(domain, exemplars[0], engine)
    with console.progress("synthesis") as progress:
        made: SynthesizedVolume = engine.sample(
            run.shape,
            seed=run.seed,
            boundary=run.boundary,
            porosity=porosity,
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


def _check_blockwise(run: RunConfig, report: Path | None) -> None:
    """Refuse what needs the whole volume at once."""
    if not ENGINES[run.engine].bricks:
        able = ", ".join(name for name, entry in ENGINES.items() if entry.bricks)
        raise ParameterError("blockwise", run.engine, f"is for the engine {able}")
    whole = {
        "report": report,
        "prune": run.prune,
        "known": run.known,
        "scale": run.scale,
        "orientation": run.orientation,
        "boundary": None if run.boundary == "open" else run.boundary,
    }
    refuse(whole, NOT_BLOCKWISE)


def _sample_to(
    run: RunConfig,
    digests: tuple[str, ...],
    exemplar: Volume,
    domain: Domain | None,
    output: Path,
    threads: int,
) -> None:
    """Make and write a volume brick by brick."""
    from poresynth.report.words import number

    engine: Any = get_engine(run.engine)(**run.parameters).fit(exemplar)
    origin = {"configuration": run.saved(digests), "command": run.command(output)}
    if domain is not None:
        check_room(domain, exemplar, engine)
        origin["domain"] = domain.to_dict()
    with console.progress("synthesis") as progress:
        made = engine.sample_to(
            output,
            run.shape,
            seed=run.seed,
            porosity=field_of("porosity", run.porosity, run.shape),
            mask=None if domain is None else domain.mask.array,
            threads=threads,
            progress=progress,
            origin=origin,
        )
    console.result(f"new volume: {output}")
    console.result(f"synthesised: {engine.field_reason_}")
    rows = [
        (name, number(value)) for part in ("seam", "copying") for name, value in made[part].items()
    ]
    console.figures(f"Made in {made['count']} bricks", rows, ("mean over the bricks", "value"))


def _directions(run: RunConfig) -> dict[str, Any]:
    """Return how structure turns and scales, for engines that can do it."""
    given: dict[str, Any] = {}
    if run.scale is not None:
        given["scale"] = field_of("scale", run.scale, run.shape)
    if run.orientation is not None:
        given["orientation"] = read(Path(run.orientation)).array
        given["orientation_axis"] = run.orientation_axis
    if given and not ENGINES[run.engine].turns:
        name = next(iter(given))
        able = ", ".join(known for known, entry in ENGINES.items() if entry.turns)
        allowed = f"must not be given for the engine {run.engine}, only for {able}"
        raise ParameterError(name, getattr(run, name), allowed)
    return given
