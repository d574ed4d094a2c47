"""Time and memory of PeriodicField: inference beside ipfn_2022 Table 2, and training.

    python benches/python/periodic_field.py [--edges 128 256] [--presets tiny paper] [--steps 10]

Networks are untrained: speed does not depend on the weights. Seconds are of the wall on a GPU, else
of the CPU on one thread, which others on the machine hardly disturb; memory is that of a process of
its own, beyond what it has before. On a CPU large volumes are timed by a slab of them, and training
of the preset paper by one crop and one step of each network: "share" says how much of the whole was
run. Figures go to benches/results/periodic_field.json.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import torch
from race import resident
from readme import save

from poresynth.engines.neural.machine import Machine
from poresynth.engines.neural.tiles import assemble
from poresynth.engines.periodic_field import PeriodicField
from poresynth.exemplars import spinodal
from poresynth.volume import Volume, as_volume

# ipfn_2022 Table 2 (a GTX 1080, milliseconds and gigabytes) and §4 (512³, seconds).
PAPER = {
    "image 128": {"seconds": 0.008, "gigabytes": 0.76},
    "image 256": {"seconds": 0.011, "gigabytes": 0.85},
    "image 512": {"seconds": 0.015, "gigabytes": 1.23},
    "image 1024": {"seconds": 0.024, "gigabytes": 2.81},
    "volume 512": {"seconds": 22.9},
}
EDGES = {"image": (128, 256, 512, 1024), "volume": (128, 256, 512)}
LOSSES = {"sliced": None, "adversarial": 0}
# Points that a CPU makes in some minutes.
MOST_POINTS = {"tiny": 1 << 25, "small": 1 << 23, "paper": 1 << 22}


def on_gpu() -> bool:
    return torch.cuda.is_available()


def clock() -> float:
    if on_gpu():
        torch.cuda.synchronize()
        return time.perf_counter()
    return time.process_time()


def exemplar(kind: str) -> Volume:
    volume = spinodal((128, 128, 128), porosity=0.7).array
    return as_volume(volume[:1] if kind == "image" else volume)


def engine(preset: str, kind: str, **parameters: Any) -> PeriodicField:
    """An engine as after `fit`, but for the training."""
    made = PeriodicField(preset=preset, start_iterations=0, **parameters)  # type: ignore[arg-type]
    made._learn(exemplar(kind))
    made._map = None
    step = made._step(torch.from_numpy(made._scaling.field(made.exemplar_)), None)
    generator = step.networks["generator"].to("cuda" if on_gpu() else "cpu")
    made.generator_ = generator.requires_grad_(False).eval()
    made.training_, made.origin_ = {}, {}
    return made


def inference(preset: str, kind: str, edge: int) -> dict[str, float]:
    """Seconds and peak memory of one output; a large volume goes to a store block by block."""
    torch.set_num_threads(1)
    precision = "bfloat16" if on_gpu() else "float32"
    made = engine(preset, kind, precision=precision)
    shape = (1, edge, edge) if kind == "image" else (edge, edge, edge)
    blockwise = math.prod(shape) > 3 * 10**7
    share = 1.0 if on_gpu() else min(1.0, MOST_POINTS[preset] / math.prod(shape))
    part = (max(1, round(shape[0] * share)), *shape[1:])

    def run(folder: str, shape: tuple[int, int, int]) -> None:
        if blockwise:
            path = Path(folder) / "out.zarr"
            made.sample_to(path, shape, cut_at="exemplar", threads=1)
        else:
            tiles = made._tiles(made.generator_, 1, shape, "open")
            assemble(tiles, (0, 0, 0), shape, threads=1)

    with tempfile.TemporaryDirectory() as folder:
        run(folder, (1, 64, 64) if kind == "image" else (32, 32, 32))  # Warms up.
    before = resident("VmRSS")
    with tempfile.TemporaryDirectory() as folder:
        begin = clock()
        run(folder, part)
        share = part[0] / shape[0]
        seconds = (clock() - begin) / share
    peak = torch.cuda.max_memory_allocated() if on_gpu() else resident("VmHWM") - before
    return {"seconds": seconds, "gigabytes": max(peak, 0) / 1e9, "share": share}


def alone(preset: str, kind: str, edge: int) -> dict[str, float]:
    """The same in a process of its own, so that memory is its own."""
    words = [sys.executable, __file__, "--one", preset, kind, str(edge)]
    done = subprocess.run(words, check=True, capture_output=True, text=True)
    found: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return found


def training(preset: str, kind: str, loss: str, steps: int) -> dict[str, float]:
    """Iterations a second."""
    torch.set_num_threads(1)
    small: dict[str, int] = {}
    share = 1.0
    if preset == "paper" and loss == "adversarial" and not on_gpu():
        # A step of 8 crops of 64³ would take many minutes.
        small = {"batch": 1, "critic_steps": 1, "generator_steps": 1}
        share, steps = 1 / (8 * 5), 1
    made = engine(preset, kind, sliced_iterations=LOSSES[loss], **small)
    step = made._step(torch.from_numpy(made._scaling.field(made.exemplar_)), None)
    machine = Machine(made.parameters_)
    step.prepare(machine)
    for iteration in range(steps + 1):
        if iteration == 1:
            begin = clock()
        losses = step.run(machine, iteration, torch.Generator().manual_seed(iteration))
        torch.stack(list(losses.values())).tolist()
    return {"iterations_a_second": share * steps / (clock() - begin), "share": share}


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--presets", nargs="+", default=["tiny", "paper"])
    arguments.add_argument("--edges", nargs="+", type=int, default=[128, 256, 512, 1024])
    arguments.add_argument("--steps", type=int, default=5)
    arguments.add_argument("--one", nargs=3, metavar=("PRESET", "KIND", "EDGE"))
    given = arguments.parse_args()
    if given.one:
        preset, kind, edge = given.one
        print(json.dumps(inference(preset, kind, int(edge))))
        return
    rows: dict[str, Any] = {}
    for preset in given.presets:
        for kind, edges in EDGES.items():
            for edge in (e for e in edges if e in given.edges):
                name = f"{kind} {edge}"
                rows.setdefault(name, {"ipfn_2022": PAPER.get(name)})[preset] = alone(
                    preset, kind, edge
                )
                print(name, preset, rows[name][preset], flush=True)
    rates = {}
    for preset in given.presets:
        for kind in EDGES:
            for loss in LOSSES if preset != "paper" else ("adversarial",):
                steps = given.steps if preset == "tiny" or on_gpu() else 1
                rates[f"{preset} {kind} {loss}"] = training(preset, kind, loss, steps)
                print(f"{preset} {kind} {loss}", rates[f"{preset} {kind} {loss}"], flush=True)
    save("periodic_field", {"inference": rows, "training": rates})


if __name__ == "__main__":
    main()
