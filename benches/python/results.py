"""Quality of every preset on every exemplar, beside a second specimen of the same material.

    python benches/python/results.py [--exemplars WORD …] [--presets quality fast paper second]
                                     [--seeds 3] [--edge N]

The procedural exemplars always run; public micro-CT scans run if the folder in the environment
variable PORESYNTH_DATA holds them (`specimens.py` lists them). Figures go to
benches/results/results.json and into README.md. A row that is not run keeps the figures that it
has.
"""

from __future__ import annotations

import argparse
import statistics
from typing import Any

from readme import load, machine, save, update_readme
from specimens import EDGE, TITLES, Material, materials, sources
from study import SECOND, known, solids, structure_and_novelty, synthesise

from poresynth import metrics

# The paper's search takes minutes for what takes the others seconds.
EDGES = {"quality": 152, "fast": 152, "paper": 80}
ROWS = {**{preset: preset for preset in EDGES}, "second": SECOND}


def run(material: Material, preset: str, edge: int, seeds: int) -> dict[str, Any]:
    """Make the volumes of a row and measure them."""
    exemplar, seconds = material.exemplar, None
    if preset == SECOND:
        volumes = material.second
    else:
        volumes, seconds = synthesise(exemplar, edge, seeds, preset=preset)
    own, others = solids(exemplar, volumes)
    porosity = metrics.porosity(own)
    largest = metrics.largest_component_fraction(own)
    shares = [metrics.largest_component_fraction(solid) for solid in others]
    seams = [metrics.seam(exemplar, volume) for volume in volumes]
    return {
        "exemplar": material.title,
        "preset": preset,
        "seeds": seeds,
        "shapes": [volume.shape for volume in volumes],
        **structure_and_novelty(exemplar, volumes, own, others, seeds),
        "worst_porosity_error_percent": known(
            max(100 * abs(metrics.porosity(solid) - porosity) / porosity for solid in others)
        ),
        "two_point_error_percent": known(
            statistics.mean(metrics.two_point_error(own, solid) for solid in others)
        ),
        "worst_largest_component": known(max(shares, key=lambda share: abs(share - largest))),
        "largest_component_exemplar": known(largest),
        "gradient_ratio": known(
            statistics.mean(metrics.gradient_ratio(exemplar, volume) for volume in volumes)
        ),
        "seam": known(statistics.mean(seams)),
        "worst_seam": known(max(seams)),
        "seconds": None if seconds is None else round(seconds, 2),
    }


def table(rows: list[dict[str, Any]]) -> str:
    """The README's table."""
    lines = [
        "| exemplar | preset | volumes | structure error, % | novelty 12 / 20 "
        "| porosity error, % | D2, % | largest part (exemplar) | gradient ratio | seam (worst) "
        "| seconds |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]

    def number(row: dict[str, Any], key: str, digits: int) -> str:
        return "–" if row[key] is None else f"{row[key]:.{digits}f}"

    for row in rows:
        largest = number(row, "worst_largest_component", 4)
        cells = [
            row["exemplar"],
            row["preset"] if row["preset"] != SECOND else f"*{SECOND}*",
            sizes(row["shapes"]),
            number(row, "structure_error_percent", 1),
            f"{number(row, 'novelty_12', 2)} / {number(row, 'novelty_20', 2)}",
            number(row, "worst_porosity_error_percent", 4 if row["preset"] != SECOND else 1),
            number(row, "two_point_error_percent", 1),
            f"{largest} ({number(row, 'largest_component_exemplar', 4)})",
            number(row, "gradient_ratio", 3),
            f"{number(row, 'seam', 2)} ({number(row, 'worst_seam', 2)})",
            number(row, "seconds", 1),
        ]
        lines.append("| " + " | ".join(cells) + " |")
    lines += [
        "",
        f"From {EDGE}³ voxels of each exemplar, pooled over the volumes: structure and novelty of "
        "all, mirrored copies counted; mean D2, gradient and seam; the worst porosity and largest "
        f"part; the median time. {machine()}. One row again: "
        "`python benches/python/results.py --exemplars spinodal --presets quality`, and "
        "`--presets second` for its second specimen.",
    ]
    return "\n".join(lines)


def sizes(shapes: list[list[int]]) -> str:
    """How many volumes of which size."""
    edges = sorted(shapes[0])
    if edges[0] == edges[-1]:
        return f"{len(shapes)} × {edges[0]}³"
    return f"{len(shapes)} slabs of {edges[0]}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--exemplars", nargs="*", default=[""], metavar="WORD", help="parts of titles"
    )
    parser.add_argument("--presets", nargs="+", default=list(ROWS), choices=ROWS)
    parser.add_argument("--seeds", type=int, default=3, help="volumes a row")
    parser.add_argument("--edge", type=int, help="of the volumes; 152, for the preset paper 80")
    arguments = parser.parse_args()
    rows = {(row["exemplar"], row["preset"]): row for row in load("results")}
    for material in materials(arguments.exemplars):
        for preset in (ROWS[name] for name in arguments.presets):
            if preset == SECOND and not material.second:
                continue
            edge = arguments.edge or EDGES.get(preset, EDGE)
            row = run(material, preset, edge, arguments.seeds)
            rows[material.title, preset] = row
            print(
                f"{material.title}, {preset}, {sizes(row['shapes'])}: structure error "
                f"{row['structure_error_percent']} %, novelty {row['novelty_12']} (12³), "
                f"{row['novelty_20']} (20³), {row['seconds']} s",
                flush=True,
            )
            save("results", list(rows.values()))
    order = list(ROWS.values())
    ordered = sorted(rows, key=lambda key: (TITLES.index(key[0]), order.index(key[1])))
    update_readme("results", table([rows[key] for key in ordered]))
    update_readme("exemplars", sources())


if __name__ == "__main__":
    main()
