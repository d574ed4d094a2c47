"""What the command `prune` does, and `--prune` of the others."""

from __future__ import annotations

import shlex
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from poresynth import console
from poresynth.config import flags
from poresynth.workflow.files import read, reserve, write

if TYPE_CHECKING:
    from poresynth.config import PruneConfig, ReadConfig
    from poresynth.engines.base import SynthesizedVolume
    from poresynth.pruning import Pruned
    from poresynth.volume import Volume

__all__ = ["prune_file", "prune_new"]


def prune_file(
    path: Path,
    output: Path,
    how: PruneConfig,
    source: ReadConfig | None,
    *,
    exemplar: Path | None,
    threshold: float | None,
    solid: Literal["bright", "dark"],
    boundary: Literal["open", "periodic"],
    threads: int,
    report: Path | None,
) -> None:
    """Prune a volume, write it with what was done to it, and say what that was.

    Parameters
    ----------
    path : Path
        The volume.
    output : Path
        The pruned volume.
    how : PruneConfig
        What is done.
    source : ReadConfig, optional
        How the volume is read.
    exemplar : Path, optional
        What the volume was made of.
    threshold, solid, boundary, threads
        As of `poresynth.pruning.prune`.
    report : Path, optional
        Folder for a report.

    Raises
    ------
    PoresynthError
        If anything is wrong; no output is then left.
    """
    from poresynth import __version__

    said = {
        "exemplar": exemplar,
        "threshold": threshold,
        "solid": None if solid == "bright" else solid,
        **how.given(),
        **({} if source is None else source.given()),
    }
    words = ["poresynth", "prune", str(path), "-o", str(output), *flags(said)]
    command = shlex.join([*words, "--periodic"] if boundary == "periodic" else words)
    with reserve(output, report=report):
        volume = read(path, source)
        pruned = _prune(
            volume,
            how,
            exemplar=None if exemplar is None else read(exemplar),
            threshold=threshold,
            solid=solid,
            boundary=boundary,
            threads=threads,
            report=report,
            command=command,
        )
        # The record of the volume's making no longer repeats what the file holds.
        origin = {
            "version": __version__,
            "command": command,
            "pruning": _figures(pruned),
            "pruned": volume.metadata.get("poresynth"),
        }
        metadata = {**volume.metadata, "poresynth": origin}
        write(output, replace(pruned.volume, metadata=metadata))


def _figures(pruned: Pruned) -> dict[str, Any]:
    """Return what a file says of its pruning: all but the edits, which the report lists."""
    return {name: value for name, value in pruned.to_dict().items() if name != "edits"}


def _prune(
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

    The parameters are those of `poresynth.pruning.prune`; known voxels stay.
    """
    origin = volume.metadata["poresynth"]
    learned = origin["exemplar"]
    cut = learned[0] if isinstance(learned, list) else learned
    pruned = _prune(
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
    metadata = {**volume.metadata, "poresynth": {**origin, "pruning": _figures(pruned)}}
    return replace(volume, array=pruned.volume.array, metadata=metadata)
