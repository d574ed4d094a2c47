"""Files of the commands: held from the beginning, read as asked for, written whole."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from poresynth import console
from poresynth.errors import ParameterError

if TYPE_CHECKING:
    from poresynth.config import ReadConfig
    from poresynth.volume import Volume

__all__ = ["crop", "read", "reserve", "write", "write_json"]


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


def read(path: Path, source: ReadConfig | None = None) -> Volume:
    """Read a volume as the command line asks for it."""
    from poresynth import io

    return io.read(path, **({} if source is None else source.options()))


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
