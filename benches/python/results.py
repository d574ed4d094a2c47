"""Quality of every preset on every exemplar, as `poresynth.compare` measures it.

    python benches/python/results.py [--presets quality fast paper] [--edge 128] [--seed 0]

The procedural exemplars always run. Public micro-CT exemplars run if the folder in the environment
variable PORESYNTH_DATA holds them. Figures go to benches/results/results.json and into README.md.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from readme import load, machine, save, update_readme

import poresynth
from poresynth import exemplars
from poresynth.volume import Volume

EDGE = 100  # voxels of each exemplar: the size of the ScaffoldGAN paper's


def corner(volume: Volume) -> Volume:
    """The first 100³ voxels."""
    return poresynth.crop(volume, (0, 0, 0), tuple(min(EDGE, n) for n in volume.shape))


def half_corner(volume: Volume) -> Volume:
    """The first 200³ voxels at half the resolution."""
    return poresynth.downsample(poresynth.crop(volume, (0, 0, 0), (2 * EDGE,) * 3), 2)


# Title, file, what is taken of it.
FILES: list[tuple[str, str, Callable[[Volume], Volume]]] = [
    ("trabecular bone", "trabecular_bone_gray_100.tif", corner),
    ("trabecular bone, fine", "trabecular_bone_gray_200.tif", corner),
    ("Berea sandstone", "berea_sandstone_binary_200.tif", corner),
    ("Ketton limestone ÷ 2", "ketton_limestone_binary_256.tif", half_corner),
    ("cement paste", "cement_gray_128.tif", corner),
]

PROCEDURAL = {
    "spinodal": lambda: exemplars.spinodal((EDGE,) * 3, porosity=0.5, seed=1),
    "open-cell foam": lambda: exemplars.foam((EDGE,) * 3, seed=1),
}
TITLES = [*PROCEDURAL, *(title for title, _, _ in FILES)]


def cases() -> Iterator[tuple[str, Volume]]:
    """Titles and exemplars."""
    for title, make in PROCEDURAL.items():
        yield title, make()
    folder = os.environ.get("PORESYNTH_DATA")
    for title, name, take in FILES:
        path = Path(folder or ".") / name
        if folder is None or not path.exists():
            print(f"{title}: skipped, {name} is not in PORESYNTH_DATA")
            continue
        yield title, take(poresynth.read(path))


def run(title: str, exemplar: Volume, preset: Any, edge: int, seed: int) -> dict[str, Any]:
    """Synthesise once and compare."""
    start = time.perf_counter()
    engine = poresynth.VolumeTexture(preset=preset).fit(exemplar)
    made = engine.sample((edge,) * 3, seed=seed)
    seconds = time.perf_counter() - start
    figures = poresynth.compare(exemplar, made).to_dict()
    return {
        "exemplar": title,
        "preset": preset,
        "edge": edge,
        "seed": seed,
        "seconds": round(seconds, 2),
        "iterations": len(made.energy),
        **figures,
    }


def table(rows: list[dict[str, Any]]) -> str:
    """The README's table."""
    lines = [
        "| exemplar | preset | edge | porosity error, % | D2, % | largest part (exemplar) "
        "| gradient ratio | seam | novelty 12 / 20 / 32 | copied block | seconds |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]

    def number(row: dict[str, Any], key: str, digits: int) -> str:
        value = row.get(key)
        return "–" if value is None else f"{value:.{digits}f}"

    for row in rows:
        novelty = " / ".join(number(row, f"novelty_{n}", 2) for n in (12, 20, 32))
        largest = number(row, "largest_component_fraction", 4)
        own = number(row, "largest_component_fraction_exemplar", 4)
        cells = [
            row["exemplar"],
            row["preset"],
            str(row["edge"]),
            number(row, "porosity_error_percent", 4),
            number(row, "two_point_error_percent", 1),
            f"{largest} ({own})",
            number(row, "gradient_ratio", 3),
            number(row, "seam", 2),
            novelty,
            number(row, "mean_copied_block", 1),
            number(row, "seconds", 1),
        ]
        lines.append("| " + " | ".join(cells) + " |")
    first = rows[0]
    lines += [
        "",
        f"From {EDGE}³ voxels of each exemplar, seed {first['seed']}; {machine()}. "
        "`python benches/python/results.py`",
    ]
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--presets", nargs="*", default=["quality", "fast", "paper"])
    parser.add_argument("--edge", type=int, default=128)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    # What was measured before stays, so that presets can be run apart.
    rows = {(row["exemplar"], row["preset"]): row for row in load("results")}
    for title, exemplar in cases():
        for preset in arguments.presets:
            row = run(title, exemplar, preset, arguments.edge, arguments.seed)
            rows[title, preset] = row
            print(title, preset, f"{row['seconds']} s", flush=True)
            save("results", list(rows.values()))
    # Rows of exemplars that are not here now keep their places.
    ordered = sorted(rows.items(), key=lambda item: (TITLES.index(item[0][0]), item[0][1]))
    update_readme("results", table([row for _, row in ordered]))


if __name__ == "__main__":
    main()
