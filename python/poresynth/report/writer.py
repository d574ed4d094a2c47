"""The report of a comparison: one page for people, one JSON file for programs."""

from __future__ import annotations

import datetime
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from poresynth.errors import FileError
from poresynth.io import atomic
from poresynth.report.page import render
from poresynth.volume import Volume, as_volume

if TYPE_CHECKING:
    import numpy.typing as npt

    from poresynth.comparison import Comparison
    from poresynth.metrics.sections import Images

__all__ = ["reserved", "write_files", "write_report"]


def write_report(
    directory: str | PathLike[str],
    exemplar: Images,
    volume: Volume | npt.ArrayLike,
    comparison: Comparison,
    *,
    energy: Sequence[Any] | None = None,
    configuration: Mapping[str, Any] | None = None,
    command: str | None = None,
) -> Path:
    """Write ``report.html``, which needs no other file, and ``report.json``.

    Parameters
    ----------
    directory : path_like
        Folder of the report; made if it does not exist. Its parent must exist.
    exemplar, volume : Volume or array_like
        What was compared, shape (z, y, x) or (z, y, x, channel); the exemplar may be a mapping of
        images by axis.
    comparison : Comparison
        Its figures and curves, from `poresynth.compare`.
    energy : sequence, optional
        Records with the fields ``level``, ``window``, ``iteration`` and ``energy``, as a
        synthetic volume carries them.
    configuration : mapping, optional
        What made the volume, JSON-compatible.
    command : str, optional
        The command that makes it again.

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
    volume = as_volume(volume)
    directory = Path(directory)
    now = datetime.datetime.now().astimezone()
    text = render(exemplar, volume, comparison, energy, configuration, command, now)
    data = _data(comparison, energy, configuration, command, now)
    return write_files(directory, "report", text, data)


def write_files(directory: Path, name: str, page: str, data: Mapping[str, Any]) -> Path:
    """Write a page and its figures, both whole or neither.

    Parameters
    ----------
    directory : Path
        Folder of the report; made if it does not exist. Its parent must exist.
    name : str
        Of both files, before the suffix.
    page : str
        HTML.
    data : mapping
        What the page says, JSON-compatible.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    FileError
        If the folder cannot be written; what was there before is then untouched.
    """
    paths = directory / f"{name}.html", directory / f"{name}.json"
    with reserved(directory), atomic.output(*paths) as (text, figures):
        text.write_text(page, encoding="utf-8")
        figures.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    return paths[0]


@contextmanager
def reserved(directory: str | PathLike[str]) -> Iterator[None]:
    """Hold the folder of a report while the work goes on that the report is about.

    Parameters
    ----------
    directory : path_like
        Made if it does not exist, and then removed again if the work leaves nothing in it.

    Raises
    ------
    FileError
        If the folder cannot be written, or another process is writing a report there.
    """
    directory = Path(directory)
    try:
        directory.mkdir()
        made = True
    except FileExistsError:
        made = False
    except OSError as error:
        raise FileError.because(directory, error) from error
    try:
        atomic.check_writable(directory / "report.html")
        with atomic.claim(directory / "report.html"):
            yield
    except BaseException:
        if made:
            with suppress(OSError):  # Something else has come into it.
                directory.rmdir()
        raise


def _data(
    comparison: Comparison,
    energy: Sequence[Any] | None,
    configuration: Mapping[str, Any] | None,
    command: str | None,
    now: datetime.datetime,
) -> dict[str, Any]:
    """Return what the page says, for programs: the keys of `compare`, and what goes with them."""
    from poresynth import __version__

    return {
        **comparison.to_dict(),
        "curves": {name: asdict(curve) for name, curve in comparison.curves.items()},
        "energy": [
            {
                "level": int(record.level),
                "window": int(record.window),
                "iteration": int(record.iteration),
                "energy": float(record.energy),
            }
            for record in energy or ()
        ],
        "configuration": configuration,
        "command": command,
        "version": __version__,
        "date": now.isoformat(timespec="seconds"),
    }
