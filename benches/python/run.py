"""Race poresynth against public libraries, all in one run, as ratios.

    python benches/python/run.py [--races WORD …] [--large] [--repeats 3]

Figures go to benches/results/bench.json, and from there into README.md. A race that is not run
keeps the figures that it has.
"""

from __future__ import annotations

import argparse
from typing import Any

from race import LONG, OURS, RACES, load_races
from readme import load, machine, save, update_readme


def table(rows: list[dict[str, Any]]) -> str:
    """The README's table."""
    lines = [
        "| task | size | poresynth | bytes a voxel | beside it | takes | times as long "
        "| bytes a voxel |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        ours = next(
            r
            for r in rows
            if (r["race"], r["size"], r["contestant"]) == (row["race"], row["size"], OURS)
        )
        if row is ours:
            continue
        cells = [
            row["race"],
            f"{row['size']}³",
            taken(ours),
            amount(ours["bytes_per_voxel"]),
            f"{row['contestant']} ({row['version']})",
            taken(row),
            f"{row['times_as_long']:.2g}",
            amount(row["bytes_per_voxel"]),
        ]
        lines.append("| " + " | ".join(cells) + " |")
    lines += [
        "",
        f"Medians of runs in turn (one, over {LONG:.0f} s), on all cores where not said "
        "otherwise; memory beyond the input; rms: root mean square distance of the matches, in "
        f"units of the exact search's. {machine()}. "
        "`python benches/python/run.py`",
    ]
    return "\n".join(lines)


def taken(row: dict[str, Any]) -> str:
    """The time, and what is to be said of its result."""
    remark = row.get("remark")
    return duration(row["seconds"]) + (f" ({remark})" if remark else "")


def duration(seconds: float) -> str:
    """Seconds or milliseconds, with three digits."""
    return f"{seconds:.3g} s" if seconds >= 1 else f"{1000 * seconds:.3g} ms"


def amount(count: float | None) -> str:
    """Bytes a voxel."""
    return "–" if count is None else f"{max(count, 0):.1f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--races", nargs="+", default=[""], help="parts of titles")
    parser.add_argument(
        "--large", action="store_true", help="larger inputs too, once each: many minutes"
    )
    parser.add_argument("--repeats", type=int, default=3, help="of sizes that are not large")
    arguments = parser.parse_args()
    load_races()
    chosen = [
        race for race in RACES.values() if any(word in race.title for word in arguments.races)
    ]
    rows = {(row["race"], row["size"], row["contestant"]): row for row in load("bench")}
    for race in chosen:
        for size in race.sizes + (race.large if arguments.large else ()):
            for row in race.run(size, 1 if size in race.large else arguments.repeats):
                rows[row["race"], row["size"], row["contestant"]] = row
                print(
                    f"{row['race']}, {size}³, {row['contestant']}: {taken(row)}, "
                    f"{row['times_as_long']:.2f} ×, {amount(row['bytes_per_voxel'])} B/voxel",
                    flush=True,
                )
            save("bench", list(rows.values()))
    titles = list(RACES)
    ordered = sorted(rows.values(), key=lambda row: (titles.index(row["race"]), row["size"]))
    update_readme("bench", table(ordered))


if __name__ == "__main__":
    main()
