"""Time and memory of volumes from one image, beside what papers state of the methods."""

from __future__ import annotations

import multiprocessing
import resource
from typing import Any

from readme import machines
from specimens import PROCEDURAL

from .making import synthesise
from .materials import plain
from .truths import EDGE, Truth

STUDY = "speed"
TITLE = "speed"
MATERIAL = "spinodal"  # needs no file

# How many times the edge of the volumes each preset is timed at: the presets of papers take long.
TIMES = {"quality": (1, 2), "prieto": (1,), "kopf": (1,), "chen_wang": (1,)}

# Seconds for 120³ voxels that ScaffoldGAN (2021), Table 1, states.
PUBLISHED = {"Kopf et al.": 1922, "Chen et al.": 2164}
PUBLISHED_EDGE = 120


def measure(preset: str, edge: int) -> dict[str, Any]:
    """Time a preset in a process of its own, whose peak memory is read."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(_run, (preset, edge))


def _run(preset: str, edge: int) -> dict[str, Any]:
    truth = Truth(MATERIAL, PROCEDURAL[MATERIAL]((EDGE,) * 3, 1))
    slices = truth.slices(1)
    image = list(slices.images.values())
    synthesise(image, 32, 1, mode="responses")  # imports, and pages of the libraries
    before = peak_memory()
    made = synthesise(image, edge, 1, preset=preset)
    return {
        "study": STUDY,
        "title": TITLE,
        "run": f"{preset} {edge}",
        "preset": preset,
        "edge": edge,
        "mode": made.mode,
        **made.seconds(),
        "peak_bytes": peak_memory() - before,
        "estimated_bytes": made.memory,
    }


def peak_memory() -> int:
    """Most memory that this process has had, bytes."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def table(rows: list[dict[str, Any]]) -> str:
    """The README's table."""
    names = [*PUBLISHED]
    lines = [
        "| preset | output | seconds | of these, fit | CPU seconds | µs a voxel "
        "| peak memory (estimated), MB | "
        + " | ".join(f"{name} as published, times as long a voxel" for name in names)
        + " |",
        "|---|---|---|---|---|---|---|" + "---|" * len(names),
    ]
    order = [*TIMES]
    for row in sorted(rows, key=lambda row: (order.index(row["preset"]), row["edge"])):
        each = row["seconds"] / row["edge"] ** 3
        cells = [
            row["preset"],
            f"{row['edge']}³",
            plain(row["seconds"], 1),
            plain(row["fit_seconds"], 1),
            plain(row["cpu_seconds"], 1),
            f"{1e6 * each:.2f}",
            f"{row['peak_bytes'] / 1e6:.0f} ({row['estimated_bytes'] / 1e6:.0f})",
            *(f"{PUBLISHED[name] / PUBLISHED_EDGE**3 / each:.3g}" for name in names),
        ]
        lines.append("| " + " | ".join(cells) + " |")
    stated = ", ".join(f"{seconds} s ({name})" for name, seconds in PUBLISHED.items())
    lines += [
        "",
        f"From a slice of {EDGE}² of the {MATERIAL}, on all cores; {machines(rows)}. As published: "
        f"{stated} for {PUBLISHED_EDGE}³ voxels, by ScaffoldGAN (2021), Table 1, on a machine of "
        "theirs. `python benches/python/images.py speed`",
    ]
    return "\n".join(lines)
