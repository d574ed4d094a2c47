"""Structure against novelty, over the run penalty, levels and windows, for both fields.

    python benches/python/trade_off.py [--exemplars WORD …] [--seeds 2] [--edge 152]

Figures go to benches/results/trade_off.json, and from there into a picture of README.md. Points
that are not measured keep the figures that they have; with no word after --exemplars the picture
alone is drawn again.
"""

from __future__ import annotations

import argparse
import io
import math
from collections.abc import Iterator
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator
from readme import load, machine, save, save_picture, update_readme
from specimens import TITLES, Material, materials
from study import SECOND, solids, structure_and_novelty, synthesise

from poresynth.engines.texture_parameters import TextureParameters
from poresynth.report.figures import LIGHT

EXEMPLARS = ("trabecular", "Berea", "Ketton", "spinodal")
FIELDS = ("distance", "intensity")
DEFAULT = TextureParameters()
PENALTIES = sorted({0.0, 0.03, 0.1, 0.3, 1.0, DEFAULT.run_penalty})
LEVELS = (2, 3)
WINDOWS = ((10, 8, 4), (8, 4), (6, 4))

COLOURS = {"distance": LIGHT.volume, "intensity": LIGHT.exemplar}
STAR = "#c8641b"
TICKS = (0.5, 1, 2, 5, 10, 20, 50)

PICTURE = "structure_against_novelty"

Setting = dict[str, Any]


def settings() -> Iterator[Setting]:
    """Yield the parameters of every point."""
    own = (DEFAULT.levels, DEFAULT.windows)
    variants = [(levels, windows) for levels in LEVELS for windows in WINDOWS]
    for field in FIELDS:
        for penalty in PENALTIES:
            yield setting(field, penalty, *own)
        for variant in variants:
            if variant != own:
                yield setting(field, DEFAULT.run_penalty, *variant)


def setting(field: str, penalty: float, levels: int, windows: tuple[int, ...]) -> Setting:
    return {"field": field, "run_penalty": penalty, "levels": levels, "windows": list(windows)}


def key(row: dict[str, Any]) -> tuple[Any, ...]:
    """What a point is, so that a new measurement replaces the old one."""
    named = ("exemplar", "field", "run_penalty", "levels")
    return (*(row.get(name) for name in named), tuple(row.get("windows", ())))


def run(material: Material, chosen: Setting, edge: int, seeds: int) -> dict[str, Any]:
    """Make the volumes of a point and measure them."""
    exemplar, seconds = material.exemplar, None
    if chosen["field"] == SECOND:
        volumes = material.second
    else:
        volumes, seconds = synthesise(exemplar, edge, seeds, **chosen)
    return {
        "exemplar": material.title,
        **chosen,
        "seeds": seeds,
        "edge": edge,
        **structure_and_novelty(exemplar, volumes, *solids(exemplar, volumes), seeds),
        "seconds": None if seconds is None else round(seconds, 2),
    }


def draw(rows: list[dict[str, Any]]) -> bytes:
    """Draw a panel an exemplar."""
    titles = [title for title in TITLES if any(row["exemplar"] == title for row in rows)]
    columns = min(2, len(titles))
    lines = math.ceil(len(titles) / columns)
    figure = Figure(figsize=(4.3 * columns, 3.2 * lines + 0.5), layout="constrained")
    panels = figure.subplots(lines, columns, squeeze=False, sharex=True, sharey=True).ravel()
    for axes, title in zip(panels, titles, strict=False):
        panel(axes, title, [row for row in rows if row["exemplar"] == title])
    for axes in panels[len(titles) :]:
        axes.remove()
    label = {"color": LIGHT.ink, "fontsize": 10.5}
    words = (
        "novelty of blocks of 12³: 0 is a copy, 1 as new as one half of the exemplar to the other"
    )
    figure.supxlabel(words, **label)
    figure.supylabel("structure error (%)", **label)
    legend = figure.legend(
        handles=handles(), loc="outside upper center", ncols=3, frameon=False, fontsize=9.5
    )
    for text in legend.get_texts():
        text.set_color(LIGHT.ink)
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=150, facecolor="white")
    return stream.getvalue()


def panel(axes: Axes, title: str, rows: list[dict[str, Any]]) -> None:
    """Draw the points of an exemplar."""
    axes.set_title(title, color=LIGHT.ink, fontsize=11, loc="left")
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(LIGHT.exemplar)
    axes.tick_params(colors=LIGHT.ink, labelsize=9, labelbottom=True, labelleft=True)
    axes.grid(color=LIGHT.faint, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(FixedLocator(TICKS))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    for field in FIELDS:
        points = [row for row in rows if row["field"] == field]
        own = [row for row in points if is_own(row)]
        own.sort(key=lambda row: row["run_penalty"])
        axes.plot(*position(own), "-o", color=COLOURS[field], lw=1.8, ms=4.5)
        for row in (own[0], own[-1]) if own else ():  # those between follow in their order
            axes.annotate(
                f"{row['run_penalty']:g}",
                (row["novelty_12"], row["structure_error_percent"]),
                xytext=(0, 9 if field == FIELDS[0] else -9),
                textcoords="offset points",
                ha="center",
                va="center",
                color=COLOURS[field],
                fontsize=8.5,
            )
        others = [
            row for row in points if not is_own(row) and row["run_penalty"] == DEFAULT.run_penalty
        ]
        axes.plot(*position(others), "o", color=COLOURS[field], mfc="white", ms=5)
        if field == FIELDS[0]:
            chosen = [row for row in own if row["run_penalty"] == DEFAULT.run_penalty]
            axes.plot(*position(chosen), "o", color=LIGHT.ink, mfc="none", ms=11, mew=1.6)
    second = [row for row in rows if row["field"] == SECOND]
    axes.plot(*position(second), "*", color=STAR, ms=15, mec="white")
    axes.set_xlim(left=-0.04)  # room for the marks of copies


def is_own(row: dict[str, Any]) -> bool:
    """Whether levels and windows are the default's."""
    return (row["levels"], tuple(row["windows"])) == (DEFAULT.levels, DEFAULT.windows)


def position(rows: list[dict[str, Any]]) -> tuple[list[float], list[float]]:
    return [row["novelty_12"] for row in rows], [row["structure_error_percent"] for row in rows]


def handles() -> list[Line2D]:
    """What the marks mean."""

    def mark(name: str, colour: str, **look: Any) -> Line2D:
        return Line2D([], [], color=colour, label=name, **look)

    span = f"run penalty {PENALTIES[0]:g} to {PENALTIES[-1]:g}"
    lines = [
        mark(f"{field}, {span}", COLOURS[field], marker="o", ms=4.5, lw=1.8) for field in FIELDS
    ]
    ring = {"lw": 0, "marker": "o", "mfc": "none"}
    return [
        *lines,
        mark("default", LIGHT.ink, ms=11, mew=1.6, **ring),
        mark("other levels and windows", LIGHT.volume, ms=5, **ring),
        mark(SECOND, STAR, lw=0, marker="*", ms=13, mec="white"),
    ]


def caption(rows: list[dict[str, Any]]) -> str:
    """What README.md says of the picture."""
    made = [row for row in rows if row["field"] != SECOND]
    seeds, edges = ({row[name] for row in made} for name in ("seeds", "edge"))
    size = f"{one_or_range(seeds)} × {one_or_range(edges)}³ voxels a point"
    return "\n".join(
        [
            f"![Structure error against novelty](docs/images/{PICTURE}.png)",
            "",
            "A copy has the structure of its exemplar, so that structure counts only with novelty: "
            "to the right is newer, lower is closer to the exemplar, and a setting beside the star "
            "is as good as another piece of the material (none is left of a scan that is the "
            f"exemplar itself). {size}; {machine()}. `python benches/python/trade_off.py`",
        ]
    )


def one_or_range(values: set[int]) -> str:
    return "–".join(str(value) for value in sorted({min(values), max(values)}))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--exemplars", nargs="*", default=EXEMPLARS, metavar="WORD", help="parts of titles"
    )
    parser.add_argument("--seeds", type=int, default=2, help="volumes a point")
    parser.add_argument("--edge", type=int, default=152)
    arguments = parser.parse_args()
    rows = {key(row): row for row in load("trade_off")}
    for material in materials(arguments.exemplars):
        chosen = [*settings(), *([{"field": SECOND}] if material.second else [])]
        for i, parameters in enumerate(chosen, 1):
            row = run(material, parameters, arguments.edge, arguments.seeds)
            rows[key(row)] = row
            print(
                f"{material.title}, {i} of {len(chosen)}, {parameters}: structure error "
                f"{row['structure_error_percent']} %, novelty {row['novelty_12']} (12³)",
                flush=True,
            )
            save("trade_off", list(rows.values()))
    if rows:
        save_picture(PICTURE, draw(list(rows.values())))
        update_readme("trade_off", caption(list(rows.values())))


if __name__ == "__main__":
    main()
