"""Time and memory of ScaffoldGAN: a training step with each set of losses, and sampling.

    python benches/python/gan.py [--preset tiny] [--steps 20] [--sampling tiny small] [--edges 120]
        [--files 420 1024]

A step is compared with that of the plain baseline, in turn with it in one run; peak memory is that
of a process of its own, beyond what it has before the first step. Volumes of the edges --files are
written block by block, as Zarr and as TIFF. Figures go to benches/results/gan.json. On a machine
with a GPU that is what is measured.
"""

from __future__ import annotations

import argparse
import itertools
import json
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import torch
from race import resident
from readme import machine, save

from poresynth.engines.neural.machine import Machine, choose_device
from poresynth.engines.neural.tiles import assemble
from poresynth.engines.scaffold_gan import ScaffoldGAN
from poresynth.engines.scaffold_gan.calibration import calibrate
from poresynth.engines.scaffold_gan.networks import Generator, initialise
from poresynth.engines.scaffold_gan.parameters import VARIANTS, resolve
from poresynth.engines.scaffold_gan.step import ScaffoldStep
from poresynth.engines.scaffold_gan.tiles import GeneratorTiles
from poresynth.exemplars import spinodal

BASELINE = "adversarial"
WARM_UP = 2
AFTER_THE_START = 10**6
"""An iteration when the sliced-Wasserstein loss has fallen to nothing."""
PAPER_SECONDS = {120: 0.096}  # On a GTX 1080, scaffoldgan_2021 Table 1.


def make(preset: str, variant: str) -> tuple[ScaffoldStep, Machine]:
    """A step of this variant on the procedural exemplar."""
    parameters = resolve({"preset": preset, "variant": variant})
    gray = torch.from_numpy(spinodal((100, 100, 100), porosity=0.7).array).float()
    step = ScaffoldStep(parameters, gray[None] / 127.5 - 1, 0.0, None, None)  # type: ignore[arg-type]
    machine_ = Machine(parameters)
    step.prepare(machine_)
    return step, machine_


def run(step: ScaffoldStep, machine_: Machine, iteration: int) -> float:
    """Seconds of one step: by the clock on a GPU, else of the CPU, which others do not disturb."""
    clock = time.perf_counter if machine_.device.type == "cuda" else time.process_time
    random = torch.Generator().manual_seed(iteration)
    begin = clock()
    losses = step.run(machine_, iteration, random)
    torch.stack(list(losses.values())).tolist()  # Waits for a GPU.
    return clock() - begin


def times(preset: str, steps: int) -> dict[str, list[float]]:
    """Seconds of the steps of every set of losses, taken in turn."""
    made = {v: (*make(preset, v), AFTER_THE_START) for v in VARIANTS}
    made["extended, at the start"] = (*make(preset, "extended"), 0)
    found: dict[str, list[float]] = {name: [] for name in made}
    for iteration in range(WARM_UP + steps):
        for name, (step, machine_, first) in made.items():
            seconds = run(step, machine_, first + iteration)
            if iteration >= WARM_UP:
                found[name].append(seconds)
    return found


def peak(preset: str, variant: str) -> int:
    """Peak memory of a step in bytes, in a process of its own."""
    words = [sys.executable, __file__, "--preset", preset, "--memory-of", variant]
    done = subprocess.run(words, check=True, capture_output=True, text=True)
    return int(json.loads(done.stdout))


def memory(preset: str, variant: str) -> int:
    """Peak memory of two steps in this process, beyond what it began with."""
    step, machine_ = make(preset, variant)
    Path("/proc/self/clear_refs").write_text("5")  # Forgets the peak.
    before = resident("VmRSS")
    for iteration in range(2):
        run(step, machine_, iteration)
    if machine_.device.type == "cuda":
        return torch.cuda.max_memory_allocated()
    return resident("VmHWM") - before


def sampling(preset: str, edge: int) -> dict[str, Any]:
    """Seconds of a volume by an untrained generator: the weights do not change the time."""
    p = resolve({"preset": preset})
    generator = Generator(p.latent, p.generator_maps)
    initialise(generator, torch.Generator().manual_seed(0))
    calibrate(generator, 0)
    device = "cuda" if torch.cuda.is_available() else "cpu"
    tiles = GeneratorTiles(generator.to(device), 0, p.crop)
    assemble(tiles, (0, 0, 0), (8, 8, 8))
    begin, cpu = time.perf_counter(), time.process_time()
    assemble(tiles, (0, 0, 0), (edge,) * 3)
    seconds, cpu = time.perf_counter() - begin, time.process_time() - cpu
    taken = {"seconds": seconds, "cpu_seconds": cpu, "paper": PAPER_SECONDS.get(edge)}
    return {"preset": preset, "edge": edge, **taken}


def written(preset: str, edge: int, suffix: str) -> dict[str, Any]:
    """Time and memory of a volume that goes to a file, by an untrained generator."""
    engine = ScaffoldGAN(preset=preset)
    engine._learn(spinodal((64, 64, 64), porosity=0.6, seed=1))
    network = engine._generator()
    initialise(network, torch.Generator().manual_seed(0))
    engine._calibrate(network)
    engine._adopt(network.state_dict(), choose_device("auto"))
    engine.training_, engine.origin_ = {}, {}
    shape = (edge, edge, edge)
    stated = engine.estimate_memory(shape, blockwise=True)
    with tempfile.TemporaryDirectory() as folder:
        engine.sample_to(Path(folder) / f"warm{suffix}", (8, 8, 8), cut_at="exemplar")
        Path("/proc/self/clear_refs").write_text("5")
        before, begin, cpu = resident("VmRSS"), time.perf_counter(), time.process_time()
        engine.sample_to(Path(folder) / f"new{suffix}", shape, cut_at="exemplar")
        seconds, cpu = time.perf_counter() - begin, time.process_time() - cpu
    peak = resident("VmHWM") - before
    facts = {"seconds": seconds, "cpu_seconds": cpu, "peak_bytes": peak, "stated_bytes": stated}
    return {"preset": preset, "edge": edge, "suffix": suffix, **facts}


def print_files(rows: list[dict[str, Any]]) -> None:
    """Print the table of volumes that went to files."""
    print("\n| networks | volume | file | seconds | of the CPU | memory, stated | measured |")
    print("|---|---|---|---|---|---|---|")
    for row in rows:
        times_ = f"{row['seconds']:.0f} | {row['cpu_seconds']:.0f}"
        memory_ = f"{row['stated_bytes'] / 1e6:.0f} MB | {row['peak_bytes'] / 1e6:.0f} MB"
        print(f"| {row['preset']} | {row['edge']}³ | {row['suffix']} | {times_} | {memory_} |")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--preset", default="tiny")
    parser.add_argument("--steps", type=int, default=20)
    parser.add_argument("--sampling", nargs="*", default=["tiny", "small"])
    parser.add_argument("--edges", nargs="*", type=int, default=[120])
    parser.add_argument("--files", nargs="*", type=int, default=[])
    parser.add_argument("--memory-of", help=argparse.SUPPRESS)
    parser.add_argument("--write", nargs=2, help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.write:
        print(json.dumps(written(asked.preset, int(asked.write[0]), asked.write[1])))
        return
    if asked.memory_of:
        print(memory(asked.preset, asked.memory_of))
        return
    seconds = times(asked.preset, asked.steps)
    base = statistics.median(seconds[BASELINE])
    rows = []
    for variant, taken in seconds.items():
        # Of pairs that ran one after the other, so that a busy minute harms both.
        ratios = [a / b for a, b in zip(taken, seconds[BASELINE], strict=True)]
        rows.append(
            {
                "preset": asked.preset,
                "variant": variant,
                "seconds": statistics.median(taken),
                "ratio": statistics.median(ratios),
                "peak_bytes": peak(asked.preset, variant.split(",")[0]),
            }
        )
    print(f"| losses ({asked.preset}) | a step | times the baseline | peak memory |")
    print("|---|---|---|---|")
    for row in rows:
        cells = f"{1000 * row['seconds']:.0f} ms | {row['ratio']:.2f}"
        print(f"| {row['variant']} | {cells} | {row['peak_bytes'] / 1e6:.0f} MB |")
    print(f"\nBaseline {1000 * base:.0f} ms. {torch.get_num_threads()} threads, {machine()}\n")
    samples = [sampling(p, edge) for p in asked.sampling for edge in asked.edges]
    print("| networks | volume | seconds | of the CPU | the paper, GTX 1080 |")
    print("|---|---|---|---|---|")
    for s in samples:
        paper = f"{s['paper']} s" if s["paper"] else "–"
        times_ = f"{s['seconds']:.2f} | {s['cpu_seconds']:.2f}"
        print(f"| {s['preset']} | {s['edge']}³ | {times_} | {paper} |")
    files = []
    for edge, suffix in itertools.product(asked.files, (".zarr", ".tif")):
        words = [sys.executable, __file__, "--preset", asked.preset, "--write", str(edge), suffix]
        done = subprocess.run(words, check=True, capture_output=True, text=True)
        files.append(json.loads(done.stdout))
    if files:
        print_files(files)
    threads = torch.get_num_threads()
    save("gan", {"steps": rows, "sampling": samples, "files": files, "threads": threads})


if __name__ == "__main__":
    main()
