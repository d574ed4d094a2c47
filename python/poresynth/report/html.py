"""The page of a report: one file that opens anywhere, on a screen and on paper."""

from __future__ import annotations

import base64
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from typing import Any

from poresynth.report.words import explain, number

__all__ = [
    "Content",
    "Picture",
    "Section",
    "across",
    "chart",
    "code",
    "explained_table",
    "figures_table",
    "legend",
    "page",
    "pairs",
    "plain_table",
    "planes_table",
    "verdict",
]

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

_NOTHING = '<td class="number">–</td>'


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


@dataclass(frozen=True)
class Content:
    """What a page says of one kind of comparison.

    Parameters
    ----------
    title, subtitle : str
        What this is, in a line each.
    exemplar : str
        What the volume is compared with, in a few words.
    sections : list of Section
        The parts of the page.
    """

    title: str
    subtitle: str
    exemplar: str
    sections: list[Section]


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


def verdict(figures: Iterable[Any]) -> str:
    """Return how many figures of a comparison have each mark."""
    marks = [figure.mark for figure in figures]
    counts = "".join(
        f'<span class="{mark}">{marks.count(mark)} {MARKS[mark]}</span>'
        for mark in MEANING
        if mark in marks
    )
    return f'<div class="verdict">{counts}</div>'


def legend(parts: str) -> str:
    """Return what marks and ranges mean.

    Parameters
    ----------
    parts : str
        Where the range comes from, such as ``"random parts of the exemplar"``.

    Returns
    -------
    str
        HTML.
    """
    marks = "; ".join(f"<b>{MARKS[mark]}</b>: {MEANING[mark]}" for mark in MEANING)
    return (
        f'<p class="note">{marks}. The range comes from {escape(parts)}, measured in '
        "the same way: by so much one specimen of this material differs from another.</p>"
    )


def figures_table(groups: Mapping[str, Sequence[Any]]) -> str:
    """Return the table of figures.

    Parameters
    ----------
    groups : mapping of str to sequence
        Figures of a comparison, by heading.

    Returns
    -------
    str
        HTML.
    """
    rows = []
    for heading, figures in groups.items():
        rows.append(f'<tr class="group"><th colspan="6">{escape(heading)}</th></tr>')
        rows.extend(_row(figure) for figure in figures)
    header = "".join(f'<th class="{css}">{name}</th>' for css, name in HEADER)
    return _table(header, rows)


def planes_table(figures: Mapping[str, Any], planes: Sequence[Sequence[str]]) -> str:
    """Return the table of figures of sections: a column for each image and each plane.

    Parameters
    ----------
    figures : mapping of str to Figure
        Figures of a comparison, of which those are shown whose names end in that of a plane.
    planes : sequence of sequences of str
        Names of the planes that are compared with each of the images.

    Returns
    -------
    str
        HTML.
    """
    first = f"_{planes[0][0]}"
    header = "<th>figure</th>"
    for group in planes:
        header += f'<th class="number">image {across(group)}</th>'
        header += "".join(f'<th class="number">{across([plane])}</th>' for plane in group)
    columns = 2 + sum(1 + len(group) for group in planes)
    heading = f'<th colspan="{columns}">Slices beside their image, plane by plane</th>'
    rows = [f'<tr class="group">{heading}</tr>']
    for stem in (name.removesuffix(first) for name in figures if name.endswith(first)):
        cells = []
        for group in planes:
            found = [figures.get(f"{stem}_{plane}") for plane in group]
            cells.append(_image_cell(next((f for f in found if f is not None), None)))
            cells.extend(map(_plane_cell, found))
        label, question = explain(stem)
        rows.append(
            f"<tr><th>{escape(label)}<code>{escape(stem)}</code></th>{''.join(cells)}"
            f'<td class="says"><b>{escape(question)}</b> '
            f"{escape(figures[stem + first].description)}</td></tr>"
        )
    return _table(f'{header}<th class="says">what it says</th>', rows)


def explained_table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table whose first column names figures and whose last explains them.

    Parameters
    ----------
    header : sequence of str
        Names of the columns.
    rows : iterable of sequences of str
        Their cells.

    Returns
    -------
    str
        HTML.
    """
    classes = ["number"] * (len(header) - 2) + ["says"]
    names = ((f"<code>{escape(first)}</code>", *others) for first, *others in rows)
    return _words_table(classes, header, names)


def across(planes: Sequence[str]) -> str:
    """Return the name of a plane, or of several across axes, for people."""
    axes = [plane for plane in planes if plane in ("z", "y", "x")]
    return f"across {', '.join(axes)}" if axes else planes[0]


def _image_cell(figure: Any) -> str:
    if figure is None:
        return _NOTHING
    low, high = number(figure.low), number(figure.high)
    spread = "" if figure.low is None else f"<small>{low} to {high}</small>"
    return f'<td class="number">{number(figure.exemplar)}{spread}</td>'


def _plane_cell(figure: Any) -> str:
    if figure is None:
        return _NOTHING
    error = ""
    if figure.error_percent is not None and math.isfinite(figure.error_percent):
        error = f"<small>{figure.error_percent:+.1f} %</small>".replace("-", "−")
    words = MARKS[figure.mark]
    sign = f'<span class="{figure.mark}" title="{words}">{words.split()[0]}</span>'
    unit = f" {figure.unit}" if figure.unit == "%" else ""
    return f'<td class="number">{sign} {number(figure.value)}{unit}{error}</td>'


def plain_table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table of words and numbers.

    Parameters
    ----------
    header : sequence of str
        Names of the columns.
    rows : iterable of sequences of str
        Their cells; the first of each names the row.

    Returns
    -------
    str
        HTML.
    """
    names = ((escape(first), *others) for first, *others in rows)
    return _words_table(["number"] * (len(header) - 1), header, names)


def _words_table(
    classes: Sequence[str], header: Sequence[str], rows: Iterable[Sequence[str]]
) -> str:
    """Return a table; the first cell of a row is HTML, the others have these classes."""

    def cells(tag: str, texts: Sequence[str]) -> str:
        pairs = zip(classes, texts, strict=True)
        return "".join(f'<{tag} class="{css}">{escape(text)}</{tag}>' for css, text in pairs)

    body = (f"<tr><th>{first}</th>{cells('td', others)}</tr>" for first, *others in rows)
    return _table(f"<th>{escape(header[0])}</th>{cells('th', header[1:])}", body)


def _table(header: str, rows: Iterable[str]) -> str:
    return (
        f'<div class="scroll"><table><thead><tr>{header}</tr></thead>'
        f"<tbody>{''.join(rows)}</tbody></table></div>"
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
