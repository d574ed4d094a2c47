"""Time and memory of a synthesis over the size of the output, both presets, one thread and all.

    python benches/python/scaling.py [--presets quality fast] [--edges 64 128 256 512]

The exemplar is a foam of 64³ voxels. Each run has a process of its own, whose peak memory is read.
Figures go to benches/results/scaling.json, and from there into README.md. One thread is timed up to
256³.
"""

from __future__ import annotations

import argparse
import multiprocessing
import resource
import time
from typing import Any

from readme import load, machine, save, update_readme

import poresynth
from poresynth import exemplars

EXEMPLAR = 64
ALONE = 256  # largest edge that one thread is timed at


def run(preset: str, edge: int, threads: int) -> dict[str, Any]:
    """Synthesise a small volume, then the one that counts."""
    exemplar = exemplars.foam((EXEMPLAR,) * 3, cell=20.0, seed=1)
    engine = poresynth.VolumeTexture(preset=preset).fit(exemplar)
    engine.sample((EXEMPLAR,) * 3, seed=0)  # imports, and pages of the libraries
    start = time.perf_counter()
    engine.sample((edge,) * 3, seed=1, threads=threads)
    seconds = time.perf_counter() - start
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    return {
        "preset": preset,
        "edge": edge,
        "threads": threads,
        "seconds": round(seconds, 3),
        "peak_bytes": peak,
    }


def table(rows: dict[tuple[str, int, int], dict[str, Any]]) -> str:
    """The README's table."""
    lines = [
        "| preset | output | seconds | µs a voxel | peak memory, MB | one thread, times as long |",
        "|---|---|---|---|---|---|",
    ]
    for (preset, edge, threads), row in sorted(rows.items(), key=lambda item: item[0]):
        if threads:
            continue
        alone = rows.get((preset, edge, 1))
        cells = [
            preset,
            f"{edge}³",
            f"{row['seconds']:.3g}",
            f"{1e6 * row['seconds'] / edge**3:.2f}",
            f"{row['peak_bytes'] / 1e6:.0f}",
            f"{alone['seconds'] / row['seconds']:.2f}" if alone else "–",
        ]
        lines.append("| " + " | ".join(cells) + " |")
    lines += [
        "",
        f"From a foam of {EXEMPLAR}³ voxels, the fit not counted; {machine()}. "
        "`python benches/python/scaling.py`",
    ]
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--presets", nargs="*", default=["quality", "fast"])
    parser.add_argument("--edges", nargs="*", type=int, default=[64, 128, 256, 512])
    arguments = parser.parse_args()
    rows = {(row["preset"], row["edge"], row["threads"]): row for row in load("scaling")}
    for preset in arguments.presets:
        for edge in arguments.edges:
            for threads in (0, 1) if edge <= ALONE else (0,):
                context = multiprocessing.get_context("spawn")
                with context.Pool(1) as pool:
                    row = pool.apply(run, (preset, edge, threads))
                rows[preset, edge, threads] = row
                print(row, flush=True)
                save("scaling", list(rows.values()))
    update_readme("scaling", table(rows))


if __name__ == "__main__":
    main()
