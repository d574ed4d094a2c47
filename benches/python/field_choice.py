"""What each field makes of exemplars with and without two phases: the reason of `field="auto"`.

    python benches/python/field_choice.py [--seeds 2] [--cases WORD …]

Public micro-CT exemplars run if the folder in the environment variable PORESYNTH_DATA holds them.
Figures go to benches/results/field_choice.json; a table is printed. Of the two fields:

- variogram: mean |log| of the ratio to the exemplar's gray variogram at 1 to 20 voxels, %
- jumps: the largest thousandth of differences of neighbouring voxels, over the exemplar's
- levels: two-point error of cuts at five quantiles of the gray values, smoothed against noise, %
- connectivity: structure error of such cuts at three quantiles, %
- cut: structure error at Otsu's threshold, %; of labels, the mean over the phases
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from readme import load, save
from scipy import ndimage

import poresynth
from poresynth import exemplars, metrics, preprocess
from poresynth.engines.field_choice import explained_share
from poresynth.engines.phases import Phases

EDGE, NEW = 64, 72
FIELDS = ("distance", "intensity")
FIGURES = ("variogram", "jumps", "levels", "connectivity", "cut", "two_point", "novelty")


def random_field(length: float, seed: int = 0) -> np.ndarray:
    """A Gaussian random field: white noise blurred by so many voxels."""
    noise = np.random.default_rng(seed).standard_normal((EDGE,) * 3)
    field = ndimage.gaussian_filter(noise, length, mode="wrap")
    return (field - field.mean()) / field.std()


def scan(gray: np.ndarray, noise: float = 0.0, blur: float = 0.0) -> np.ndarray:
    """Eight bits of gray values, blurred and noisy."""
    noisy = ndimage.gaussian_filter(gray.astype(float), blur)
    noisy += np.random.default_rng(5).normal(0, noise, gray.shape)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


def cases() -> Iterator[tuple[str, np.ndarray]]:
    """Titles and exemplars."""
    for length in (1, 2, 4, 8):
        yield f"random field {length}", scan(128 + 35 * random_field(length))
    yield "random field 4, noise 15", scan(128 + 35 * random_field(4), noise=15)
    yield "lognormal field 3", scan(40 * np.exp(0.7 * random_field(3)))
    for slope in (1, 2, 4, 30):
        sigmoid = 20 + 215 / (1 + np.exp(-slope * random_field(3)))
        yield f"field 3 through a sigmoid of slope {slope}", scan(sigmoid)
    spinodal = exemplars.spinodal((EDGE,) * 3, porosity=0.5, seed=1).array
    solid = spinodal > 125
    for length, cut, share in ((2.5, 0.0, 50), (1.5, 0.7, 25)):
        inside = np.where(random_field(length, 3) > cut, 240.0, 150.0)
        yield f"inclusions in {share} % of the solid", scan(np.where(solid, inside, 60), 6, 0.7)
    mottled = random_field(3, 7)
    yield "mottled solid", scan(np.where(solid, 150 + 30 * mottled, 60.0), 6, 0.7)
    yield "mottled solid and pore", scan(np.where(solid, 160.0, 90.0) + 25 * mottled, 6, 0.7)
    yield "spinodal", spinodal
    yield "spinodal, noise 40", scan(spinodal, noise=40)
    yield "spinodal, blur 2", scan(spinodal, blur=2)
    folder = os.environ.get("PORESYNTH_DATA")
    for title, name, start in (
        ("bone", "trabecular_bone_gray_100.tif", 18),
        ("bone, fine", "trabecular_bone_gray_200.tif", 60),
        ("cement, first part", "cement_gray_128.tif", 0),
        ("cement, middle", "cement_gray_128.tif", 32),
        ("Berea sandstone", "berea_sandstone_binary_200.tif", 60),
    ):
        path = Path(folder or ".") / name
        if folder is None or not path.exists():
            print(f"{title}: skipped, {name} is not in PORESYNTH_DATA")
            continue
        part = preprocess.crop(poresynth.read(path).array, (start,) * 3, (EDGE,) * 3)
        yield title, part
        if title == "bone":
            for noise in (30, 50, 80):
                yield f"bone, noise {noise}", scan(part, noise=noise)
    for seed in (2, 12):
        field = random_field(4, seed)
        for count in (3, 4):
            cuts = np.quantile(field, np.arange(1, count) / count)
            yield f"{count} nested labels, {seed}", np.digitize(field, cuts).astype(np.uint8)
            several = [random_field(3, 10 * seed + k) for k in range(count)]
            yield f"{count} free labels, {seed}", np.argmax(several, axis=0).astype(np.uint8)


def variogram(gray: np.ndarray) -> np.ndarray:
    """Half of the mean squared difference at 1 to 20 voxels, over the variance."""
    lines = [np.moveaxis(gray.astype(float), axis, 0) for axis in range(3)]
    squares = [[np.mean((x[h:] - x[:-h]) ** 2) for x in lines] for h in range(1, 21)]
    return np.mean(squares, axis=1) / (2 * gray.var())


def jump(gray: np.ndarray) -> float:
    """What one in a thousand differences of neighbouring voxels exceeds."""
    steps = [np.abs(np.diff(gray.astype(float), axis=axis)).ravel() for axis in range(3)]
    return float(np.quantile(np.concatenate(steps), 0.999))


def judge(exemplar: np.ndarray, made: list[np.ndarray]) -> dict[str, float]:
    """Every figure of the table."""
    labels = preprocess.label_values(exemplar)
    cut = None if labels else preprocess.threshold(exemplar)

    def phases(volume: np.ndarray) -> list[np.ndarray]:
        return [volume == label for label in labels] if labels else [volume > cut]

    found: dict[str, float] = {
        "novelty": np.mean([metrics.novelty(exemplar, m, 12).plain for m in made]),
        "cut": np.mean(
            [
                metrics.structure_error(own, list(new)).percent
                for own, *new in zip(phases(exemplar), *map(phases, made), strict=True)
            ]
        ),
        "two_point": np.mean(
            [
                metrics.two_point_error(own, new)
                for m in made
                for own, new in zip(phases(exemplar), phases(m), strict=True)
            ]
        ),
    }
    if not labels and not preprocess.is_two_valued(exemplar):
        own = variogram(exemplar)
        smooth = [ndimage.gaussian_filter(m.astype(np.float32), 1) for m in (exemplar, *made)]

        def level(share: float) -> list[np.ndarray]:
            return [s > np.quantile(s, share) for s in smooth]

        found["variogram"] = 100 * np.mean([np.abs(np.log(variogram(m) / own)) for m in made])
        found["jumps"] = np.mean([jump(m) for m in made]) / jump(exemplar)
        cuts = [level(q) for q in (0.1, 0.25, 0.5, 0.75, 0.9)]
        found["levels"] = np.mean(
            [metrics.two_point_error(cut[0], new) for cut in cuts for new in cut[1:]]
        )
        found["connectivity"] = np.mean(
            [metrics.structure_error(c[0], c[1:]).percent for c in map(level, (0.2, 0.5, 0.8))]
        )
    return {name: round(float(value), 3) for name, value in found.items()}


def run(title: str, exemplar: np.ndarray, seeds: int) -> dict[str, Any]:
    """Synthesise with both fields."""
    row: dict[str, Any] = {"exemplar": title, "seeds": seeds, "explained": None}
    volume = poresynth.Volume(exemplar)
    phases = Phases.of(volume, "auto", None, "bright")
    if phases.kind == "gray":
        row["explained"] = round(explained_share(exemplar, phases), 4)
    for field in FIELDS:
        engine = poresynth.VolumeTexture(field=field).fit(exemplar)
        made = [engine.sample((NEW,) * 3, seed=seed).array for seed in range(seeds)]
        row[field] = judge(exemplar, made)
    return row


def table(rows: list[dict[str, Any]]) -> str:
    """A line an exemplar, distance / intensity."""
    lines = ["| exemplar | explained, % | " + " | ".join(FIGURES) + " |"]
    lines.append("|---" * (2 + len(FIGURES)) + "|")
    for row in rows:
        share = "–" if row["explained"] is None else f"{100 * row['explained']:.1f}"
        cells = [row["exemplar"], share]
        for name in FIGURES:
            both = [row[field].get(name) for field in FIELDS]
            cells.append(" / ".join("–" if v is None else f"{v:.3g}" for v in both))
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--cases", nargs="*", default=[""], help="parts of titles")
    arguments = parser.parse_args()
    # What was measured before stays, so that cases can be run apart.
    rows = {row["exemplar"]: row for row in load("field_choice")}
    for title, exemplar in cases():
        if any(word in title for word in arguments.cases):
            rows[title] = run(title, exemplar, arguments.seeds)
            print(title, flush=True)
            save("field_choice", list(rows.values()))
    print(table(list(rows.values())))


if __name__ == "__main__":
    main()
