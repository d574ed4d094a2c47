"""What the command line says: progress and notes on stderr, results on stdout."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

__all__ = ["error", "figures", "note", "progress", "result"]

# Without a terminal a line is printed at each of these shares of the work.
STEP = 0.1

COLOURS = {"pass": "green", "near": "yellow", "off": "red", "info": "default"}
MARKS = {"pass": "✓ pass", "near": "≈ near", "off": "✗ off", "info": ""}


def error(message: str) -> None:
    """Print what went wrong, as one line on stderr."""
    print(f"poresynth: error: {' '.join(message.split())}", file=sys.stderr)


def note(message: str) -> None:
    """Print what a person should know while the work goes on, as one line on stderr."""
    print(f"poresynth: {message}", file=sys.stderr, flush=True)


def result(message: str) -> None:
    """Print a line of a result on stdout."""
    print(message)


@contextmanager
def progress(work: str) -> Iterator[Callable[[str, float], None]]:
    """Show how far long work is: a bar on a terminal, now and then a line elsewhere.

    Parameters
    ----------
    work : str
        What is being done.

    Yields
    ------
    callable
        ``report(stage, fraction)`` with the share of the whole that is done, 0 to 1.
    """
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

    console = Console(stderr=True)
    if not console.is_terminal:
        yield _lines(work)
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        TextColumn("[dim]{task.fields[stage]}"),
    )
    with Progress(*columns, console=console, transient=True) as bars:
        task = bars.add_task(work, total=1.0, stage="")

        def report(stage: str, fraction: float) -> None:
            bars.update(task, completed=fraction, stage=stage)

        yield report


def _lines(work: str) -> Callable[[str, float], None]:
    shown = -STEP

    def report(stage: str, fraction: float) -> None:
        nonlocal shown
        if fraction >= shown + STEP or (fraction >= 1 > shown):
            shown = fraction
            note(f"{work}: {100 * fraction:.0f} % ({stage})")

    return report


def figures(title: str, rows: Iterable[Sequence[Any]], header: Sequence[str]) -> None:
    """Print a table on stdout.

    Parameters
    ----------
    title : str
        Heading.
    rows : iterable of sequences
        Cells; a cell that is a mark gets its colour.
    header : sequence of str
        Names of the columns.
    """
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(title=title, title_justify="left", title_style="bold")
    for i, name in enumerate(header):
        table.add_column(name, justify="left" if i == 0 or name == "mark" else "right")
    for row in rows:
        table.add_row(*(Text(MARKS.get(c, c), style=COLOURS.get(c, "")) for c in row))
    Console().print(table)
