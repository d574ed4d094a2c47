"""Known voxels: can they be told from the new ones at their border?

    python benches/python/known_voxels.py [WORD …]

A word is a part of a row. Parts of a scan are kept and the rest is made from another corner of it;
scans are in the folder that the environment variable PORESYNTH_DATA names, and the foam is drawn.
Figures go to benches/results/known_voxels.json and docs/shapes_and_gradation.md.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import numpy.typing as npt
from readme import load, machine, save, update_readme
from specimens import chosen, scans
from study import known

import poresynth
from poresynth import exemplars
from poresynth.volume import Volume

PAGE = "docs/shapes_and_gradation.md"
EDGE = 128
LEARNED = 100

Mask = npt.NDArray[np.bool_]


def hole() -> Mask:
    mask = np.ones((EDGE,) * 3, bool)
    mask[34:94, 34:94, 34:94] = False
    return mask


def core() -> Mask:
    y, x = np.indices((EDGE, EDGE)) - (EDGE - 1) / 2
    return np.broadcast_to(y**2 + x**2 < 20**2, (EDGE,) * 3)


def slices() -> Mask:
    mask = np.zeros((EDGE,) * 3, bool)
    mask[::32] = True
    return mask


KEPT: dict[str, Callable[[], Mask]] = {
    "all but a hole of 60³": hole,
    "a core of 40 voxels across": core,
    "every 32nd slice": slices,
}


def wholes() -> Iterator[tuple[str, Volume]]:
    """The materials that are large enough."""
    yield "open-cell foam", exemplars.foam((200, 200, 200), seed=1)
    yield from scans(["fine bone", "Berea"])


def measure(scan: Volume, kept: Mask) -> dict[str, Any]:
    """Make what is not kept of one corner of a scan from the opposite one."""
    engine = poresynth.VolumeTexture().fit(poresynth.crop(scan, (0, 0, 0), (LEARNED,) * 3))
    first = tuple(n - EDGE for n in scan.shape)
    given = poresynth.crop(scan, first, (EDGE,) * 3)
    start = time.process_time()
    made = engine.sample(given.shape, seed=1, known=given, known_mask=kept)
    seconds = time.process_time() - start
    return {
        "cpu_seconds": round(seconds, 1),
        **{name: known(value) for name, value in made.metadata["poresynth"]["seam"].items()},
    }


def table(rows: dict[str, dict[str, Any]]) -> str:
    """The table of the page."""
    lines = [
        f"| {EDGE}³ voxels, engine `volume` | changes of phase | steps of gray | CPU seconds |",
        "|---|---|---|---|",
    ]
    for name, row in rows.items():
        cells = [
            name,
            f"{row['phase_changes']:.2f}",
            f"{row['steps']:.2f}",
            f"{row['cpu_seconds']:.0f}",
        ]
        lines.append("| " + " | ".join(cells) + " |")
    lines += [
        "",
        f"From the {LEARNED}³ voxels of the opposite corner. {machine()}. "
        "`python benches/python/known_voxels.py`",
    ]
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("words", nargs="*", metavar="WORD", help="parts of rows; all without")
    words = parser.parse_args().words or [""]
    rows: dict[str, dict[str, Any]] = dict(load("known_voxels"))
    for title, scan in wholes():
        for name, mask in KEPT.items():
            if not chosen(row := f"{title}, {name}", words):
                continue
            rows[row] = measure(scan, mask())
            print(row, rows[row], flush=True)
            save("known_voxels", rows)
    update_readme("known_voxels", table(rows), PAGE)


if __name__ == "__main__":
    main()
