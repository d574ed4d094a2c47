"""Volumes made from images whose material is known whole, and solids from colour images.

    python benches/python/images.py [WORD …] [--runs one three prieto kopf chen_wang]
                                    [--seeds 3] [--preset-seeds 1] [--edge 128]

A word is a part of a title: of a material (bone, Berea, …), of a colour image ("colour" takes all),
"speed" or "pictures"; all without a word. The procedural materials always run, scans and images if
the folder in the environment variable PORESYNTH_DATA holds them. Each material is made from slices
of it (`from_images/truths.py` has the rule), and judged against them and against the volume that
they were cut from. Figures go to benches/results/images.json and into README.md; a row that is not
run keeps the figures that it has.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import Any

from from_images import colours, materials, pictures, slices, speed
from from_images.making import RUNS
from from_images.truths import EDGE, truths
from readme import PICTURES, load, machine, save, update_readme
from specimens import chosen

RESULTS = "images"
STUDIES = {study.STUDY: study for study in (materials, slices, colours, speed)}


def measured(words: list[str], options: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Measure row by row."""
    edge = options.edge
    seeds = {
        name: options.seeds if run.preset == "quality" else options.preset_seeds
        for name, run in RUNS.items()
    }
    for truth in truths(words):
        for name in options.runs:
            if RUNS[name].preset == "quality":
                yield slices.measure(truth, name)
            yield materials.measure(truth, name, edge, seeds[name])
    for title, image in colours.images(words):
        for name in options.runs:
            if name in colours.METHODS:
                yield colours.measure(title, image, name, edge, seeds[name])
    if chosen(speed.TITLE, words):
        presets = {RUNS[name].preset for name in options.runs}
        for preset, times in speed.TIMES.items():
            for factor in times if preset in presets else ():
                yield speed.measure(preset, factor * edge)


def key(row: dict[str, Any]) -> tuple[str, str, str]:
    """What a row is, so that a new measurement replaces the old one."""
    return row["study"], row["title"], row["run"]


def update_tables(rows: list[dict[str, Any]]) -> None:
    """Write what has been measured into README.md."""
    for name, study in STUDIES.items():
        own = [row for row in rows if row["study"] == name]
        if own:
            update_readme(f"images_{name}", study.table(own))


def show_pictures() -> None:
    """Put the pages that there are into README.md."""
    pages = {
        pictures.MATERIALS: "Slices given, and sections of the volumes made of them",
        pictures.COLOURS: "Colour images, and the solids made of them",
    }
    lines = [
        f"![{words}](docs/images/{name}.png)"
        for name, words in pages.items()
        if (PICTURES / f"{name}.png").exists()
    ]
    lines.append(
        "One pixel a voxel. Struts of bone come out clumpy, its surfaces and those of Ketton "
        "limestone too rough, and pores of cement paste are not round. "
        "`python benches/python/images.py pictures`"
    )
    update_readme("images_pictures", "\n\n".join(lines))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("words", nargs="*", metavar="WORD", help="parts of titles; all without")
    parser.add_argument("--runs", nargs="+", default=list(RUNS), choices=RUNS)
    parser.add_argument("--seeds", type=int, default=3, help="volumes a row, preset quality")
    parser.add_argument("--preset-seeds", type=int, default=1, help="volumes a row, other presets")
    parser.add_argument("--edge", type=int, default=EDGE, help="of the volumes")
    options = parser.parse_args()
    words = options.words or [""]
    rows = {key(row): row for row in load(RESULTS)}
    for row in measured(words, options):
        rows[key(row)] = {**row, "machine": machine()}
        made = f": {row['seconds']} s, {row['mode']}" if "mode" in row else ""
        print(f"{row['title']}, {row['run']}, {row['study']}{made}", flush=True)
        save(RESULTS, list(rows.values()))
        update_tables(list(rows.values()))
    if chosen(pictures.TITLE, words):
        pictures.draw_all(options.edge)
        show_pictures()


if __name__ == "__main__":
    main()
