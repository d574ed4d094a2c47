"""Charts of a report, each drawn for a light and a dark page."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from poresynth.report.words import explain

if TYPE_CHECKING:
    from poresynth.comparison import Curve, Histogram, Samples

__all__ = ["DARK", "LIGHT", "Theme", "boxes", "draw", "energy", "histogram", "novelty", "two_point"]

RESOLUTION = 200  # dots an inch: sharp on screens of twice the usual density, and in print
# An energy that falls by more than this factor needs a logarithmic axis.
LOGARITHMIC = 20.0


@dataclass(frozen=True)
class Theme:
    """Colours of a chart. Exemplar and volume differ in lightness and in dashes, too.

    Parameters
    ----------
    ink, faint : str
        Text, and lines that stay in the background.
    exemplar, volume : str
        The two curves.
    """

    ink: str
    faint: str
    exemplar: str
    volume: str


LIGHT = Theme(ink="#24292f", faint="#d5d9de", exemplar="#6b7480", volume="#0b62b8")
DARK = Theme(ink="#d6dae0", faint="#3b424b", exemplar="#98a2ae", volume="#6cb6ff")


def draw(plot: Callable[[Axes, Theme], None], theme: Theme, width: float = 4.6) -> bytes:
    """Draw a chart.

    Parameters
    ----------
    plot : callable
        Draws on the axes that it is given, in the colours that it is given.
    theme : Theme
        The colours.
    width : float, default 4.6
        Width in inches; two of the default stand side by side on a page.

    Returns
    -------
    bytes
        A PNG with a transparent background.
    """
    figure = Figure(figsize=(width, 2.9), layout="constrained")
    axes = figure.add_subplot()
    axes.set_facecolor("none")
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(theme.exemplar)
    axes.tick_params(colors=theme.ink, labelsize=8)
    axes.grid(color=theme.faint, linewidth=0.6)
    axes.set_axisbelow(True)
    plot(axes, theme)
    for text in (axes.xaxis.label, axes.yaxis.label):
        text.set(color=theme.ink, fontsize=8.5)
    legend = axes.get_legend()
    if legend is not None:
        legend.set_frame_on(False)
        for text in legend.get_texts():
            text.set(color=theme.ink, fontsize=8)
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=RESOLUTION, transparent=True)
    return stream.getvalue()


def boxes(samples: Mapping[str, Samples]) -> Callable[[Axes, Theme], None]:
    """Plot metrics of parts of both volumes, each scaled to the range of the exemplar's parts."""

    def plot(axes: Axes, theme: Theme) -> None:
        names, own, new = [], [], []
        for name, sample in samples.items():
            both = [np.array(side)[np.isfinite(side)] for side in (sample.exemplar, sample.volume)]
            if not len(both[0]) or not len(both[1]):
                continue
            low, reach = both[0].min(), np.ptp(both[0]) or abs(both[0].max()) or 1.0
            names.append(explain(name)[0])
            own.append((both[0] - low) / reach)
            new.append((both[1] - low) / reach)
        rows = np.arange(len(names), 0, -1)
        look = {"color": theme.exemplar, "linewidth": 1.2}
        axes.boxplot(
            own,
            positions=rows,
            orientation="horizontal",
            widths=0.5,
            manage_ticks=False,
            patch_artist=True,
            boxprops={"facecolor": theme.faint, "edgecolor": theme.exemplar},
            medianprops=look,
            whiskerprops=look,
            capprops=look,
            flierprops={"markeredgecolor": theme.exemplar, "markersize": 4},
        )
        for row, values in zip(rows, new, strict=True):
            axes.plot(values, np.full(len(values), row), "o", color=theme.volume, ms=2.5, alpha=0.5)
            axes.plot([values.mean()] * 2, [row - 0.35, row + 0.35], color=theme.volume, lw=2)
        axes.set_yticks(rows, names)
        # A value far outside would squeeze all others: it stands at the edge.
        axes.set_xlim(-1.5, 2.5)
        axes.set_xlabel("0 and 1: least and greatest of the exemplar's parts")

    return plot


def two_point(curve: Curve) -> Callable[[Axes, Theme], None]:
    """Plot a two-point correlation over the exemplar's own band."""

    def plot(axes: Axes, theme: Theme) -> None:
        axes.fill_between(
            curve.r,
            curve.low,
            curve.high,
            color=theme.exemplar,
            alpha=0.25,
            lw=0,
            label="exemplar's parts",
        )
        axes.plot(curve.r, curve.exemplar, color=theme.exemplar, lw=1.4, ls="--", label="exemplar")
        axes.plot(curve.r, curve.volume, color=theme.volume, lw=1.8, label="new volume")
        axes.set(xlabel="distance r (voxels)", ylabel="probability that both ends are solid")
        axes.set_xlim(0, curve.r[-1])
        axes.legend()

    return plot


def histogram(curve: Histogram, threshold: float | None) -> Callable[[Axes, Theme], None]:
    """Plot two histograms of gray values, and where the solid is cut, if it is cut by them."""

    def plot(axes: Axes, theme: Theme) -> None:
        volume, exemplar = (100 * np.asarray(h) for h in (curve.volume, curve.exemplar))
        axes.stairs(exemplar, curve.edges, fill=True, color=theme.exemplar, alpha=0.25)
        axes.stairs(exemplar, curve.edges, color=theme.exemplar, ls="--", lw=1.2, label="exemplar")
        axes.stairs(volume, curve.edges, color=theme.volume, lw=1.6, label="new volume")
        if threshold is not None:
            axes.axvline(threshold, color=theme.ink, lw=0.9, ls=":", label="threshold")
        axes.set(xlabel="gray value", ylabel="share of the voxels (%)")
        axes.set_xlim(curve.edges[0], curve.edges[-1])
        axes.set_ylim(bottom=0)
        axes.legend()

    return plot


def novelty(blocks: Mapping[int, tuple[float, float]]) -> Callable[[Axes, Theme], None]:
    """Plot how new blocks of growing size are.

    Parameters
    ----------
    blocks : mapping of int to (float, float)
        By edge in voxels: 0 for a copy, 1 for as different as two halves of the exemplar; without
        and with mirrored copies.
    """

    def plot(axes: Axes, theme: Theme) -> None:
        edges = sorted(blocks)
        plain, mirrored = zip(*(blocks[edge] for edge in edges), strict=True)
        for level, name in ((0.0, "a verbatim copy"), (1.0, "as two halves of the exemplar")):
            axes.axhline(level, color=theme.exemplar, lw=1.2, ls="--")
            axes.text(edges[-1], level + 0.02, name, color=theme.ink, fontsize=7.5, ha="right")
        style: dict[str, Any] = {"color": theme.volume, "marker": "o", "ms": 4.5}
        axes.plot(edges, plain, lw=1.8, label="new volume", **style)
        axes.plot(edges, mirrored, lw=1.2, ls=":", mfc="none", label="mirrored copies too", **style)
        axes.set(xlabel="edge of the block (voxels)", ylabel="novelty", xticks=edges)
        axes.set_ylim(-0.05, max(1.2, 1.1 * np.nanmax([*plain, *mirrored])))
        axes.legend(loc="lower center")

    return plot


def energy(records: Sequence[Any]) -> Callable[[Axes, Theme], None]:
    """Plot the energy of each iteration, by level and neighbourhood.

    Parameters
    ----------
    records : sequence
        Records with the fields ``level``, ``window``, ``iteration``, ``energy``, in their order.
    """

    def plot(axes: Axes, theme: Theme) -> None:
        values = [float(r.energy) for r in records]
        positive = min(values) > 0
        if positive and max(values) > LOGARITHMIC * min(values):
            axes.set_yscale("log")
        for start, stop, level, window in _stages(records):
            axes.plot(
                range(start + 1, stop + 1),
                values[start:stop],
                color=theme.volume,
                lw=1.6,
                marker="o",
                ms=2.8,
            )
            if start:
                axes.axvline(start + 0.5, color=theme.exemplar, lw=0.8, ls=":")
            axes.text(
                (start + stop + 1) / 2,
                1.01,
                f"level {level}\n{window}³",
                transform=axes.get_xaxis_transform(),
                ha="center",
                va="bottom",
                fontsize=6.5,
                color=theme.ink,
            )
        axes.set(xlabel="iteration", ylabel="energy")
        axes.set_xlim(0.5, len(values) + 0.5)

    return plot


def _stages(records: Sequence[Any]) -> Iterator[tuple[int, int, int, int]]:
    """Yield the runs of one level and one neighbourhood: start, stop, level, window."""
    start = 0
    for (level, window), run in groupby(records, key=lambda r: (r.level, r.window)):
        stop = start + len(list(run))
        yield start, stop, level, window
        start = stop
