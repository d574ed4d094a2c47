"""The rows of scaffoldgan_2021 Table 1 for any exemplar: six networks and the engines of the CPU.

    python benches/python/scaffoldgan_table.py bone.tif --folder models [--preset small]
        [--set iterations=2000 …] [--methods full volume …] [--samples 10] [--edge 120] [--device …]

Trained models and measured samples stay in the folder, one for each exemplar: a method that is
asked for again is sampled, not trained again, and one that was stopped goes on. The table, of all
that was measured, is written to FOLDER/table.md, with the paper's figures for its own exemplar of
bone beside it, and FOLDER/table.json holds all samples. Porosities are those at the exemplar's
threshold, as the networks make them; `volume` meets the porosity by construction, `solid` that of
the mid-slices that it learns from. Seconds are by the clock where there is a GPU, else of the CPU,
which other programs do not disturb.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import torch
from readme import machine

import poresynth
from poresynth import config, metrics
from poresynth.engines.phases import Phases
from poresynth.engines.scaffold_gan import ScaffoldGAN
from poresynth.engines.scaffold_gan.parameters import VARIANTS
from poresynth.engines.solid_texture import SolidTexture
from poresynth.engines.volume_texture import VolumeTexture
from poresynth.metrics.connectivity import FLOATING
from poresynth.volume import Volume

# Table 1, Bone_0: porosity error %, D2, components, floating parts, D_w, seconds.
PAPER: dict[str, tuple[float, float, int, int, float, float]] = {
    "solid, kopf": (20.27, 43.39, 268, 159, 5.18, 1922),
    "solid, chen_wang": (13.78, 32.39, 116, 106, 5.08, 2164),
    "volume, paper": (2.86, 8.97, 20, 11, 4.02, 1441),
    "adversarial": (1.51, 5.95, 40, 17, 4.60, 0.094),
    "patchgan": (1.49, 5.83, 30, 23, 4.38, 0.095),
    "gram": (1.16, 5.79, 26, 19, 4.26, 0.095),
    "structural": (0.71, 3.27, 8, 5, 1.79, 0.096),
    "full": (0.59, 3.05, 6, 3, 1.53, 0.096),
}
TEXTURE: dict[str, Callable[[], Any]] = {
    "solid, kopf": lambda: SolidTexture(preset="kopf"),
    "solid, chen_wang": lambda: SolidTexture(preset="chen_wang"),
    "volume, paper": lambda: VolumeTexture(preset="paper"),
    "volume, quality": lambda: VolumeTexture(preset="quality"),
}
METHODS = (*TEXTURE, *VARIANTS)


def network(name: str, exemplar: Volume, asked: argparse.Namespace) -> ScaffoldGAN:
    """The model of a variant, trained unless it is there."""
    folder = asked.folder / name
    done = folder / "done.json"
    settings = config.parse_settings(asked.set).get("parameters", {})
    engine = ScaffoldGAN(preset=asked.preset, variant=name, device=asked.device, **settings)
    if not done.exists():
        began = (folder / "checkpoint.safetensors").exists()
        engine.fit(exemplar, folder=folder, resume=began, progress=say(name))
        done.write_text(json.dumps(engine.training_, indent=1) + "\n")
    return ScaffoldGAN.load(folder, device=asked.device)


def say(name: str) -> Callable[[str, float], None]:
    """Print the progress of a training, a line every twentieth."""
    shown = -1

    def report(stage: str, fraction: float) -> None:
        nonlocal shown
        if int(20 * fraction) > shown:
            shown = int(20 * fraction)
            print(f"{name}: {stage}", flush=True)

    return report


def texture(name: str, exemplar: Volume) -> Any:
    """A texture engine, of the volume or of its mid-slices."""
    if not name.startswith("solid"):
        return TEXTURE[name]().fit(exemplar)
    images = [
        Volume(exemplar.array.take([exemplar.shape[axis] // 2], axis).swapaxes(0, axis))
        for axis in range(3)
    ]
    return TEXTURE[name]().fit(images)


def measure(name: str, exemplar: Volume, asked: argparse.Namespace) -> Iterator[dict[str, float]]:
    """Give the figures of the samples of a method, one after the other."""
    is_network = name in VARIANTS
    engine = network(name, exemplar, asked) if is_network else texture(name, exemplar)
    phases = Phases.of(exemplar, "auto", None, "bright")
    own = phases.phase > 0
    options: dict[str, Any] = {"cut_at": "exemplar"} if is_network else {}
    clock = time.perf_counter if torch.cuda.is_available() else time.process_time
    for seed in range(asked.samples):
        begin = clock()
        made = engine.sample((asked.edge,) * 3, seed=seed, **options)
        seconds = clock() - begin
        solid = phases.phase_of(made.array) > 0
        sizes = metrics.component_sizes(solid)
        row = {
            "porosity_error": 100 * abs(metrics.porosity(solid) / phases.porosity - 1),
            "two_point_error": metrics.two_point_error(own, solid),
            "components": float(len(sizes)),
            "floating_parts": float(np.count_nonzero(sizes < FLOATING)),
            "component_wasserstein": metrics.component_wasserstein(own, solid),
            "seconds": seconds,
        }
        print(f"{name}, seed {seed}: {row}", flush=True)
        yield row


def table(exemplar: Volume, found: dict[str, list[dict[str, float]]], asked: Any) -> str:
    """The table, in Markdown."""
    phases = Phases.of(exemplar, "auto", None, "bright")
    sizes = metrics.component_sizes(phases.phase > 0)
    floating = int(np.count_nonzero(sizes < FLOATING))
    lines = [
        f"Exemplar {asked.exemplar.name}, {' × '.join(map(str, exemplar.shape))}: porosity "
        f"{100 * phases.porosity:.2f} %, {len(sizes)} components, {floating} floating parts.",
        "",
        "| method | samples | ε_err % | D2 % | N_cc / N_f | D_w | time, s | the paper, its bone |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name in (name for name in METHODS if found.get(name)):
        rows = found[name]
        mean = {key: float(np.mean([row[key] for row in rows])) for key in rows[0]}
        cells = [
            name,
            f"{len(rows)}",
            f"{mean['porosity_error']:.2f}",
            f"{mean['two_point_error']:.2f}",
            f"{mean['components']:.0f} / {mean['floating_parts']:.0f}",
            f"{mean['component_wasserstein']:.2f}",
            f"{mean['seconds']:.2f}",
            paper(name),
        ]
        lines.append("| " + " | ".join(cells) + " |")
    settings = f" with {' '.join(asked.set)}" if asked.set else ""
    lines += [
        "",
        f"Means of samples of {asked.edge}³. Networks: preset {asked.preset}"
        f"{settings}, poresynth {poresynth.__version__}, {machine()}.",
    ]
    return "\n".join(lines) + "\n"


def paper(name: str) -> str:
    """The paper's figures of a method."""
    if name not in PAPER:
        return "–"
    error, d2, components, floating, distance, seconds = PAPER[name]
    return f"{error} · {d2} · {components} / {floating} · {distance} · {seconds} s"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("exemplar", type=Path)
    parser.add_argument("--folder", type=Path, required=True)
    parser.add_argument("--preset", default="small")
    parser.add_argument("--set", nargs="*", default=[])
    parser.add_argument("--methods", nargs="*", default=METHODS, choices=METHODS, metavar="NAME")
    parser.add_argument("--samples", type=int, default=10)
    parser.add_argument("--edge", type=int, default=120)
    parser.add_argument("--device", default="auto")
    asked = parser.parse_args()
    exemplar = poresynth.read(asked.exemplar)
    asked.folder.mkdir(parents=True, exist_ok=True)
    record = asked.folder / "table.json"
    found: dict[str, list[dict[str, float]]] = {}
    if record.exists():
        found = json.loads(record.read_text())
    for name in asked.methods:
        found[name] = []
        for row in measure(name, exemplar, asked):
            # After each sample, so that a run that is stopped leaves what it has.
            found[name].append(row)
            record.write_text(json.dumps(found, indent=1) + "\n")
            (asked.folder / "table.md").write_text(table(exemplar, found, asked), encoding="utf-8")
    print(table(exemplar, found, asked))


if __name__ == "__main__":
    main()
