"""Loose ends, loops and floating parts before and after pruning, beside the exemplar's.

    python benches/python/pruning.py [--exemplars WORD …] [--edge 256] [--seeds 2]

Figures go to benches/results/pruning.json, and from there with a picture into docs/pruning.md.
Materials that are not measured keep the figures that they have.
"""

from __future__ import annotations

import argparse
import io
import statistics
import time
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from readme import load, machine, save, save_picture, update_readme
from specimens import Material, materials

import poresynth
from poresynth.metrics import label
from poresynth.pruning import Pruned, Standing, prune
from poresynth.volume import Volume

EXEMPLARS = ("trabecular", "Berea", "foam")
DRAWN = ("foam", "bone")  # the picture shows loose ends; of a rock they belong to it
TARGETS = ("exemplar", "zero")
AROUND = 28  # half the edge of what the picture shows, voxels
SHOWN = ("branch removed", "branch elongated")


def broken(found: Pruned) -> int:
    """Count the old parts of the solid that now lie in more than one."""
    old, new = (label(solid).labels for solid in (found.solid_before, found.solid))
    both = (old > 0) & (new > 0)
    pairs = np.unique(np.stack([old[both], new[both]]), axis=1)
    return int(len(pairs[0]) - len(np.unique(pairs[0])))


def row(title: str, target: str, edge: int, found: list[Pruned], seconds: float) -> dict[str, Any]:
    def mean(standings: list[Standing]) -> dict[str, float]:
        return {
            name: statistics.fmean(getattr(standing, name) for standing in standings)
            for name in vars(standings[0])
        }

    return {
        "exemplar": title,
        "target": target,
        "edge": edge,
        "seeds": len(found),
        "before": mean([f.before for f in found]),
        "after": mean([f.after for f in found]),
        "own": mean([f.exemplar for f in found if f.exemplar is not None]),
        "edits": statistics.fmean(len(f.edits) for f in found),
        "loose": statistics.fmean(f.loose for f in found),
        "broken": sum(broken(f) for f in found),
        "porosity_change": max(abs(f.after.porosity - f.before.porosity) for f in found),
        "seconds": round(seconds, 1),
    }


def measure(material: Material, edge: int, seeds: int) -> tuple[list[dict[str, Any]], Any]:
    """Make volumes, prune them both ways; return the rows and what the picture shows."""
    engine = poresynth.VolumeTexture().fit(material.exemplar)
    volumes = []
    for seed in range(seeds):
        made = engine.sample((edge,) * 3, seed=seed)
        volumes.append(Volume(made.array, made.voxel_size, made.unit))
    rows, shown = [], None
    for target in TARGETS:
        found, seconds = [], []
        for volume in volumes:
            start = time.perf_counter()
            found.append(prune(volume, exemplar=material.exemplar, target=target))
            seconds.append(time.perf_counter() - start)
        rows.append(row(material.title, target, edge, found, statistics.median(seconds)))
        shown = (volumes[0], found[0])
    return rows, shown


def picture(shown: dict[str, tuple[Volume, Pruned]]) -> bytes:
    """Draw the largest edit of each kind in each material, before and after."""
    figure = Figure(figsize=(2.2 * len(shown) * len(SHOWN), 4.8), layout="constrained")
    axes = figure.subplots(2, len(shown) * len(SHOWN))
    column = 0
    for title, (volume, pruned) in shown.items():
        for kind in SHOWN:
            edits = [edit for edit in pruned.edits if edit.kind == kind]
            for ax in axes[:, column]:
                ax.set_axis_off()
            if edits:
                z, y, x = max(edits, key=lambda edit: edit.voxels).place
                rows = slice(max(y - AROUND, 0), y + AROUND)
                columns = slice(max(x - AROUND, 0), x + AROUND)
                for ax, source in zip(axes[:, column], (volume, pruned.volume), strict=True):
                    plane = source.array[z, rows, columns]
                    low, high = float(volume.array.min()), float(volume.array.max())
                    ax.imshow(plane, cmap="gray", vmin=low, vmax=high, interpolation="nearest")
                axes[0, column].set_title(f"{title}\n{kind}", fontsize=8)
            column += 1
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=110)
    return stream.getvalue()


def table(rows: list[dict[str, Any]]) -> str:
    names = ("end points", "Euler number", "parts", "floating")
    head = " | ".join(f"{name}: before → after (exemplar)" for name in names)
    lines = [
        f"| exemplar | target | volumes | {head} | edits | broken | porosity change | seconds |",
        "|---" * (7 + len(names)) + "|",
    ]
    for r in rows:
        ends, euler, parts, floating = (
            _cells(r, name, scale)
            for name, scale in (
                ("end_point_density", 1e6),
                ("euler_density", 1e6),
                ("components", 0),
                ("floating_parts", 0),
            )
        )
        lines.append(
            f"| {r['exemplar']} | {r['target']} | {r['seeds']} × {r['edge']}³ | {ends} | {euler} | "
            f"{parts} | {floating} | {r['edits']:.0f} | {r['broken']} | "
            f"{r['porosity_change']:.1e} | {r['seconds']:.1f} |"
        )
    lines.append(
        "\nEnd points and Euler number by 10⁶ voxels, means over volumes; *broken*: parts of the "
        f"solid before that are in several after. {machine()}. `python benches/python/pruning.py`"
    )
    return "\n".join(lines)


def _cells(r: dict[str, Any], name: str, scale: float) -> str:
    values = [r[key][name] for key in ("before", "after", "own")]
    before, after, own = (f"{v * scale:.0f}" if scale else f"{v:.0f}" for v in values)
    return f"{before} → {after} ({own})"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--exemplars", nargs="*", default=EXEMPLARS)
    parser.add_argument("--edge", type=int, default=256)
    parser.add_argument("--seeds", type=int, default=2)
    given = parser.parse_args()
    rows = {(r["exemplar"], r["target"]): r for r in load("pruning")}
    shown = {}
    for material in materials(given.exemplars):
        measured, shown[material.title] = measure(material, given.edge, given.seeds)
        rows |= {(r["exemplar"], r["target"]): r for r in measured}
        print(table(measured))
    found = list(rows.values())
    save("pruning", found)
    update_readme("pruning", table(found), "docs/pruning.md")
    if len(shown) == len(EXEMPLARS):
        drawn = {title: s for title, s in shown.items() if any(word in title for word in DRAWN)}
        save_picture("pruning", picture(drawn))


if __name__ == "__main__":
    main()
