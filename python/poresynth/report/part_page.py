"""The report of a part: what was made of a volume, in figures and pictures."""

from __future__ import annotations

import datetime
from collections.abc import Iterable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

from poresynth.report import html, parts
from poresynth.report.writer import write_files
from poresynth.volume import Volume

__all__ = ["write_part_report"]


def write_part_report(
    directory: str | PathLike[str],
    pictures: Mapping[str, Volume],
    header: Sequence[str],
    rows: Iterable[Sequence[str]],
    data: Mapping[str, Any],
    *,
    facts: Mapping[str, str],
    command: str,
) -> Path:
    """Write ``report.html``, which needs no other file, and ``report.json``.

    Parameters
    ----------
    directory : path_like
        Folder of the report; made if it does not exist. Its parent must exist.
    pictures : mapping of str to Volume
        What is shown side by side, by caption: bool, shape (z, y, x).
    header, rows : sequences of str
        The table of figures.
    data : mapping
        The figures for programs, JSON-compatible, with what to look at under ``"warnings"``.
    facts : mapping of str to str
        What belongs to the head of the page.
    command : str
        The command that makes the part again.

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
    Peak memory: 60 bytes for each voxel shown, at most 256³ of each volume.
    """
    from poresynth import __version__

    now = datetime.datetime.now().astimezone()
    says = "<p>Both at one scale; faces where the border cuts the volume are ochre.</p>"
    sections = [
        html.Section("Figures", html.explained_table(header, rows)),
        html.Section("Surfaces", says + parts.surfaces(pictures, "surfaces")),
        html.Section("The command that repeats it", html.code(command)),
    ]
    if data["warnings"]:
        sections.insert(0, html.Section("To look at", html.code("\n".join(data["warnings"]))))
    text = html.page(
        "A part from a volume",
        "What was made of the volume, and whether it can be printed.",
        {**facts, "reported": f"{now:%Y-%m-%d %H:%M %Z}, poresynth {__version__}"},
        sections,
        f"poresynth {__version__}. The same numbers for programs: report.json.",
    )
    found = {**data, "command": command, "version": __version__}
    found["date"] = now.isoformat(timespec="seconds")
    return write_files(Path(directory), "report", text, found)
