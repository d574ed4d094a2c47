"""The page of a report: one file that opens anywhere, on a screen and on paper."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from typing import Any

from poresynth.report.words import explain, number

__all__ = ["Picture", "Section", "chart", "code", "figures_table", "page", "pairs"]

# Words and signs, so that a mark is understood without its colour.
MARKS = {"pass": "✓ pass", "near": "≈ near", "off": "✗ off", "info": "–"}
HEADER = (
    ("", "figure"),
    ("number", "new volume"),
    ("number", "exemplar"),
    ("number", "its range"),
    ("mark", "mark"),
    ("says", "what it says"),
)
MEANING = {
    "pass": "within the range of the exemplar's own parts, or within the tolerance that is given",
    "near": "within twice that",
    "off": "beyond",
}


@dataclass(frozen=True)
class Picture:
    """A picture of a pair that is shown to one scale.

    Parameters
    ----------
    png : bytes
        The picture.
    width : float
        Its width in units of the volume's length.
    caption : str
        What it shows.
    """

    png: bytes
    width: float
    caption: str


@dataclass(frozen=True)
class Section:
    """A part of the page.

    Parameters
    ----------
    title : str
        Heading.
    body : str
        HTML.
    """

    title: str
    body: str


def page(
    title: str, subtitle: str, facts: Mapping[str, str], sections: Iterable[Section], footer: str
) -> str:
    """Put a page together.

    Parameters
    ----------
    title, subtitle : str
        What this is, in a line each.
    facts : mapping of str to str
        What belongs to the head of the page: names and values.
    sections : iterable of Section
        The rest.
    footer : str
        Last line.

    Returns
    -------
    str
        HTML that needs nothing from elsewhere.
    """
    rows = "".join(
        f"<div><dt>{escape(name)}</dt><dd>{escape(value)}</dd></div>"
        for name, value in facts.items()
    )
    parts = "".join(f"<section><h2>{escape(s.title)}</h2>{s.body}</section>" for s in sections)
    style = files("poresynth.report").joinpath("page.css").read_text(encoding="utf-8")
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{style}</style></head><body>"
        f'<header><h1>{escape(title)}</h1><p class="soft">{escape(subtitle)}</p>'
        f'<dl class="facts">{rows}</dl></header><main>{parts}</main>'
        f"<footer>{escape(footer)}</footer></body></html>\n"
    )


def figures_table(groups: Mapping[str, Sequence[Any]]) -> str:
    """Return the verdict and the table of figures.

    Parameters
    ----------
    groups : mapping of str to sequence
        Figures of a comparison, by heading.

    Returns
    -------
    str
        HTML.
    """
    marks = [figure.mark for figures in groups.values() for figure in figures]
    verdict = "".join(
        f'<span class="{mark}">{marks.count(mark)} {MARKS[mark]}</span>'
        for mark in MEANING
        if mark in marks
    )
    rows = []
    for heading, figures in groups.items():
        rows.append(f'<tr class="group"><th colspan="6">{escape(heading)}</th></tr>')
        rows.extend(_row(figure) for figure in figures)
    legend = "; ".join(f"<b>{MARKS[mark]}</b>: {MEANING[mark]}" for mark in MEANING)
    header = "".join(f'<th class="{css}">{name}</th>' for css, name in HEADER)
    return (
        f'<div class="verdict">{verdict}</div><div class="scroll"><table><thead><tr>{header}'
        f"</tr></thead><tbody>{''.join(rows)}</tbody></table></div>"
        f'<p class="note">{legend}. The range comes from random parts of the exemplar, measured in '
        "the same way: by so much one specimen of this material differs from another.</p>"
    )


def _row(figure: Any) -> str:
    unit = f" {figure.unit}" if figure.unit else ""
    spread = (
        "–"
        if figure.low is None or figure.high is None
        else f"{number(figure.low)} to {number(figure.high)}"
    )
    cells = (number(figure.value) + unit, number(figure.exemplar), spread)
    numbers = "".join(f'<td class="number">{escape(cell)}</td>' for cell in cells)
    label, question = explain(figure.name)
    return (
        f"<tr><th>{escape(label)}<code>{escape(figure.name)}</code></th>{numbers}"
        f'<td class="mark {figure.mark}">{MARKS[figure.mark]}</td>'
        f'<td class="says"><b>{escape(question)}</b> {escape(figure.description)}</td></tr>'
    )


def pairs(rows: Iterable[Sequence[Picture]], bar: tuple[float, str] | None, css: str = "") -> str:
    """Return rows of pictures side by side at one scale.

    Parameters
    ----------
    rows : iterable of sequences of Picture
        The pictures of each row.
    bar : (float, str), optional
        Length of the scale bar in the unit of the widths, and its label.
    css : str, default ""
        Class of the rows.

    Returns
    -------
    str
        HTML.
    """
    rows = [list(row) for row in rows]
    # One scale for all rows: the widest fills the page.
    widest = max(sum(picture.width for picture in row) for row in rows)
    parts = []
    for row in rows:
        figures = []
        for picture in row:
            length = "" if bar is None else _bar(100 * bar[0] / picture.width, bar[1])
            figures.append(
                f'<figure style="width:{97 * picture.width / widest:.3f}%"><div class="framed">'
                f'<img alt="{escape(picture.caption)}" src="{_data(picture.png)}">{length}</div>'
                f"<figcaption>{escape(picture.caption)}</figcaption></figure>"
            )
        parts.append(f'<div class="pair {css}">{"".join(figures)}</div>')
    return "".join(parts)


def _bar(percent: float, label: str) -> str:
    return f'<div class="bar" style="width:{percent:.3f}%">{escape(label)}</div>'


def chart(title: str, says: str, light: bytes, dark: bytes) -> str:
    """Return a chart that follows the page's colours.

    Parameters
    ----------
    title, says : str
        What it shows, and how to read it.
    light, dark : bytes
        PNGs for a light and a dark page.

    Returns
    -------
    str
        HTML.
    """
    return (
        f"<figure><figcaption><b>{escape(title)}</b> {escape(says)}</figcaption><picture>"
        f'<source media="screen and (prefers-color-scheme: dark)" srcset="{_data(dark)}">'
        f'<img alt="{escape(title)}" src="{_data(light)}"></picture></figure>'
    )


def code(text: str) -> str:
    """Return a block of code."""
    return f"<pre><code>{escape(text)}</code></pre>"


def _data(png: bytes) -> str:
    return "data:image/png;base64," + base64.b64encode(png).decode("ascii")
