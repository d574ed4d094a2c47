"""Volumes made brick by brick, beside those made in one piece: time, memory, and structure.

    python benches/python/bricks.py [--rows WORD …]

Cubes are written to a Zarr store brick by brick, and made in memory as a whole; a body is a rod
that lies across a cube, of which it fills a few percent. Each run has a process of its own, whose
peak memory is read. Figures go to benches/results/bricks.json and docs/shapes_and_gradation.md.
"""

from __future__ import annotations

import argparse
import multiprocessing
import resource
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from readme import load, machine, save, update_readme
from study import known, solids, structure_and_novelty

import poresynth
from poresynth import exemplars, metrics
from poresynth.volume import Volume

PAGE = "docs/shapes_and_gradation.md"
EXEMPLAR = 100
COMPARED = 300  # largest edge of a cube whose structure is measured
RADIUS = 0.08  # of the rod, by the edge of its box


def cube(edge: int, bricks: bool) -> dict[str, Any]:
    """Make a cube."""
    exemplar = exemplars.foam((EXEMPLAR,) * 3, seed=1)
    engine = poresynth.VolumeTexture().fit(exemplar)
    engine.sample((EXEMPLAR,) * 3, seed=0)  # imports, and pages of the libraries
    shape = (edge,) * 3
    figures: dict[str, Any] = {"inside": edge**3}
    with tempfile.TemporaryDirectory() as folder:
        start = time.process_time()
        if bricks:
            made = engine.sample_to(Path(folder) / "new.zarr", shape, seed=1)
            figures |= {"bricks": made["count"], "seam": known(made["seam"]["phase_changes"])}
        else:
            volume: Volume = engine.sample(shape, seed=1)
        figures |= spent(start)
        if edge <= COMPARED:
            if bricks:
                volume = poresynth.read(Path(folder) / "new.zarr")
            figures |= structure(exemplar, volume)
    return figures


def rod(edge: int, bricks: bool, **asked: Any) -> dict[str, Any]:
    """Make a rod from corner to corner of a cube, or all of its box."""
    exemplar = exemplars.foam((EXEMPLAR,) * 3, seed=1)
    engine = poresynth.VolumeTexture().fit(exemplar)
    engine.sample((EXEMPLAR,) * 3, seed=0)
    at = np.arange(edge, dtype=np.float32)
    y, x = at[:, None], at
    body = np.zeros((edge,) * 3, bool)
    for z, plane in zip(at, body, strict=True):  # Less memory than is to be measured.
        mean = (z + y + x) / 3
        plane[...] = (z - mean) ** 2 + (y - mean) ** 2 + (x - mean) ** 2 < (RADIUS * edge) ** 2
    inside = int(np.count_nonzero(body))
    if not bricks:
        # More than any volume takes: all is made in one piece.
        engine._brick_memory = lambda: 1 << 62  # type: ignore[method-assign]
    start = time.process_time()
    made = engine.sample((edge,) * 3, seed=1, mask=body, **asked)
    figures = {"inside": inside, **spent(start)}
    found = made.metadata["poresynth"].get("bricks")
    if found:
        figures |= {"bricks": found["count"], "seam": known(found["seam"]["phase_changes"])}
    return figures


def graded(edge: int, bricks: bool) -> dict[str, Any]:
    """Make the rod denser at the top."""
    return rod(edge, bricks, porosity=lambda z, y, x: 0.75 + 0.18 * z / edge)


def spent(start: float) -> dict[str, Any]:
    """Seconds of the processor since the start, and the peak memory of the process."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    return {"cpu_seconds": round(time.process_time() - start, 1), "peak_bytes": peak}


def structure(exemplar: Volume, volume: Volume) -> dict[str, Any]:
    """How like the exemplar a volume is."""
    own, others = solids(exemplar, [volume])
    found = structure_and_novelty(exemplar, [volume], own, others, 1)
    names = ("structure_error_percent", "novelty_12", "novelty_20")
    return {
        **{name: found[name] for name in names},
        "two_point_error_percent": known(metrics.two_point_error(own, others[0])),
    }


ROWS = {
    "cube 288³, one piece": (cube, 288, False),
    "cube 288³, bricks": (cube, 288, True),
    "cube 512³, one piece": (cube, 512, False),
    "cube 512³, bricks": (cube, 512, True),
    "rod in 512³, one piece": (rod, 512, False),
    "rod in 512³, bricks": (rod, 512, True),
    "rod in 512³, porosity map, one piece": (graded, 512, False),
    "rod in 512³, porosity map, bricks": (graded, 512, True),
}


def table(rows: dict[str, dict[str, Any]]) -> str:
    """The table of the page."""
    lines = [
        "| | 10⁶ voxels inside | bricks | seconds of the processor | peak memory, MB "
        "| changes of phase at the borders | structure error, % | novelty 12 / 20 | D2, % |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for name in ROWS:
        row = rows.get(name)
        if row is None:
            continue
        whole = "structure_error_percent" in row
        cells = [
            name,
            f"{row['inside'] / 1e6:.1f}",
            str(row.get("bricks", "–")),
            f"{row['cpu_seconds']:.0f}",
            f"{row['peak_bytes'] / 1e6:.0f}",
            f"{row['seam']:.2f}" if "seam" in row else "–",
            f"{row['structure_error_percent']:.1f}" if whole else "",
            f"{row['novelty_12']:.2f} / {row['novelty_20']:.2f}" if whole else "",
            f"{row['two_point_error_percent']:.1f}" if whole else "",
        ]
        lines.append("| " + " | ".join(cells) + " |")
    lines += [
        "",
        f"From a foam of {EXEMPLAR}³ voxels; the rod fills its box from corner to corner; peak "
        f"memory with the libraries, the mask and, in one piece, the output. {machine()}. "
        "`python benches/python/bricks.py`",
    ]
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rows", nargs="+", default=[""], help="parts of names")
    arguments = parser.parse_args()
    rows: dict[str, dict[str, Any]] = dict(load("bricks"))
    for name, (make, edge, bricks) in ROWS.items():
        if not any(word in name for word in arguments.rows):
            continue
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            rows[name] = pool.apply(make, (edge, bricks))
        print(name, rows[name], flush=True)
        save("bricks", rows)
    update_readme("bricks", table(rows), PAGE)


if __name__ == "__main__":
    main()
