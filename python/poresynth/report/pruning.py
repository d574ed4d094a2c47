"""The page that says what pruning did: figures and pictures before and after."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from poresynth.report import html, parts
from poresynth.report.slices import gray_window, png
from poresynth.report.words import number
from poresynth.report.writer import write_files
from poresynth.volume import Volume

if TYPE_CHECKING:
    from poresynth.pruning import Pruned

__all__ = ["write_pruning_report"]

AROUND = 24
"""Half the edge, in voxels, of what is shown around an edit."""
SHOWN = 3
"""Edits of a kind that are shown: the largest."""

_ROWS = {
    "porosity": "Porosity",
    "end_points": "End points of the skeleton",
    "end_point_density": "End points per voxel",
    "euler_density": "Euler number per voxel",
    "components": "Parts of the solid",
    "floating_parts": "Parts of fewer than 10 voxels",
    "closed_pores": "Closed pores",
}


def write_pruning_report(
    directory: str | PathLike[str],
    volume: Volume,
    pruned: Pruned,
    *,
    command: str | None = None,
) -> Path:
    """Write ``pruning.html``, which needs no other file, and ``pruning.json``.

    Parameters
    ----------
    directory : path_like
        Folder of the report; made if it does not exist. Its parent must exist.
    volume : Volume
        The volume before, shape (z, y, x).
    pruned : Pruned
        What `poresynth.pruning.prune` made of it.
    command : str, optional
        The command that does it again.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    FileError
        If the folder cannot be written; what was there before is then untouched.

    Notes
    -----
    Peak memory: 60 bytes for each voxel of at most 256³ of each volume.
    """
    from poresynth import __version__

    solids = {
        "before": volume.with_array(pruned.solid_before),
        "after": volume.with_array(pruned.solid),
    }
    sections = [
        html.Section("Figures", _figures(pruned)),
        html.Section("Edits", _edits(pruned)),
        html.Section("Surface", parts.surfaces(solids, "surfaces")),
        html.Section("The largest edits, in the slice across z", _slices(volume, pruned)),
    ]
    if command is not None:
        sections.append(html.Section("The command that repeats the run", html.code(command)))
    facts = {
        "volume": parts.describe(volume),
        "loose": f"{pruned.loose} branches found no strut within reach",
        "made with": f"poresynth {__version__}",
    }
    text = html.page(
        "Pruning",
        f"{len(pruned.edits)} edits; porosity {pruned.after.porosity:.4f}",
        facts,
        sections,
        f"poresynth {__version__}. The same numbers for programs, and every edit: pruning.json.",
    )
    data = {**pruned.to_dict(), "command": command, "version": __version__}
    return write_files(Path(directory), "pruning", text, data)


def _figures(pruned: Pruned) -> str:
    columns = {"before": pruned.before, "after": pruned.after}
    if pruned.exemplar is not None:
        columns["exemplar"] = pruned.exemplar
    rows = (
        [label, *(number(getattr(standing, name)) for standing in columns.values())]
        for name, label in _ROWS.items()
    )
    return html.plain_table(["", *columns], rows)


def _edits(pruned: Pruned) -> str:
    found: Mapping[str, int] = pruned.counts()
    voxels = {kind: sum(e.voxels for e in pruned.edits if e.kind == kind) for kind in found}
    rows = ([kind, str(count), str(voxels[kind])] for kind, count in found.items())
    return html.plain_table(["what", "edits", "voxels that changed phase"], rows)


def _slices(volume: Volume, pruned: Pruned) -> str:
    window = gray_window(volume.array)
    rows = []
    for kind in pruned.counts():
        if kind != "surface moved":
            largest = sorted((e for e in pruned.edits if e.kind == kind), key=lambda e: -e.voxels)
            rows += [
                list(_pair(volume, pruned.volume, edit.place, kind, window))
                for edit in largest[:SHOWN]
            ]
    return html.pairs(rows, None) if rows else "<p>Nothing was changed but the surface.</p>"


def _pair(
    before: Volume,
    after: Volume,
    place: tuple[int, int, int],
    kind: str,
    window: tuple[float, float],
) -> Iterator[html.Picture]:
    low, high = window
    z, y, x = place
    rows = slice(max(y - AROUND, 0), y + AROUND)
    columns = slice(max(x - AROUND, 0), x + AROUND)
    for name, volume in (("before", before), ("after", after)):
        plane = volume.array[z, rows, columns].astype(float)
        gray = np.rint(255 * np.clip((plane - low) / (high - low), 0, 1)).astype(np.uint8)
        yield html.Picture(png(gray), gray.shape[1], f"{kind} at {z}, {y}, {x}: {name}")
