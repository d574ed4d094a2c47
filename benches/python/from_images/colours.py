"""Solids from colour images, and the test of prieto_2011, Table 1: means and deviations of colours.

**The rule for images.** The smallest whole factor that brings the shorter edge to at most 192
pixels reduces the image, blocks of pixels averaged; then the square in the middle is cut out.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from readme import machines
from specimens import chosen
from study import known

import poresynth
from poresynth import metrics
from poresynth.volume import Volume

from .making import RUNS, synthesise
from .materials import plain

STUDY = "colour"
MOST = 192  # pixels along an edge
METHODS = ("one", "prieto")  # the default, and the method whose table this is
CHANNELS = ("red", "green", "blue")


def images(words: Sequence[str]) -> Iterator[tuple[str, Volume]]:
    """Yield titles and colour images, as far as they are here."""
    folder = os.environ.get("PORESYNTH_DATA")
    paths = sorted(Path(folder, "2d").glob("*.jpg")) if folder else []
    if not paths and chosen(STUDY, words):
        print("colours: skipped, there is no 2d/*.jpg in PORESYNTH_DATA")
    for path in paths:
        title = f"{STUDY}, {path.stem.split('_')[0]}"
        if chosen(title, words):
            yield title, prepared(poresynth.read(path))


def prepared(image: Volume) -> Volume:
    """Reduce and cut an image by the rule."""
    shorter = min(image.shape[1:])
    small = poresynth.downsample(image, -(-shorter // MOST), labels=False)
    rows, columns = small.shape[1:]
    edge = min(rows, columns)
    return poresynth.crop(small, (0, (rows - edge) // 2, (columns - edge) // 2), (1, edge, edge))


def measure(title: str, image: Volume, name: str, edge: int, seeds: int) -> dict[str, Any]:
    """Make the solids of a row and compare their colours, means over the seeds."""
    made = synthesise([image], edge, seeds, preset=RUNS[name].preset)
    own = metrics.channel_statistics(image)
    new = [metrics.channel_statistics(volume) for volume in made.volumes]
    figures = {}
    for figure in ("mean", "standard_deviation"):
        theirs = np.asarray(getattr(own, figure))
        ours = np.mean([getattr(found, figure) for found in new], axis=0)
        figures[figure] = {
            "image": [known(value) for value in theirs.tolist()],
            "solid": [known(value) for value in ours.tolist()],
            "error_percent": [
                known(value) for value in (100 * np.abs(ours - theirs) / theirs).tolist()
            ],
        }
    return {
        "study": STUDY,
        "title": title,
        "run": name,
        "seeds": seeds,
        "edge": edge,
        "image_edge": image.shape[1],
        "mode": made.mode,
        **figures,
        **made.seconds(),
    }


def table(rows: list[dict[str, Any]]) -> str:
    """The README's table."""
    lines = [
        "| image | preset | volumes | channel | mean, image → solid | error, % "
        "| standard deviation, image → solid | error, % | CPU seconds |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for row in sorted(rows, key=lambda row: (row["title"], METHODS.index(row["run"]))):
        for i, channel in enumerate(CHANNELS):
            head = [
                f"{row['title'].removeprefix(STUDY + ', ')}, {row['image_edge']}²",
                RUNS[row["run"]].preset,
                f"{row['seeds']} × {row['edge']}³",
            ]
            cells = [
                *(head if i == 0 else [""] * len(head)),
                channel,
                *_pair(row["mean"], i),
                *_pair(row["standard_deviation"], i),
                plain(row["cpu_seconds"], 0) if i == 0 else "",
            ]
            lines.append("| " + " | ".join(cells) + " |")
    lines += [
        "",
        f"{machines(rows)}. The three images again: `python benches/python/images.py colour`",
    ]
    return "\n".join(lines)


def _pair(found: dict[str, list[float | None]], i: int) -> tuple[str, str]:
    own, new = plain(found["image"][i], 1), plain(found["solid"][i], 1)
    return f"{own} → {new}", plain(found["error_percent"][i], 2)
