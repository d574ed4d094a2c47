"""Races: one task, one input, several libraries, measured in turn."""

from __future__ import annotations

import functools
import importlib.metadata
import inspect
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import poresynth

OURS = "poresynth"
ONE_THREAD = "poresynth, one thread"
LONG = 4.0  # seconds: what takes longer runs once, for its time scatters little
STATUS = Path("/proc/self/status")


@dataclass(frozen=True)
class Contestant:
    """A library at a task.

    Parameters
    ----------
    name : str
        How the table names it.
    package : str
        Distribution whose version is recorded; the contestant is skipped if it is missing.
    run : callable
        Takes the arrays of the race, returns the result.
    most : int
        Largest size that it is given.
    """

    name: str
    package: str
    run: Callable[..., Any]
    most: int


@dataclass
class Race:
    """A task for several libraries; it enters `RACES` when it is made.

    Parameters
    ----------
    title : str
        What the task is.
    make : callable
        Takes a size, returns the arrays that every contestant gets.
    same : callable, optional
        Takes the results of poresynth and of another; false disqualifies the race.
    sizes : tuple of int
        Sizes of the inputs, edges in voxels.
    large : tuple of int
        Sizes of a long run.
    remark : callable, optional
        Takes the arrays, a contestant's result and its seconds; returns what the table says beside
        the time, for results that are not equally good.
    """

    title: str
    make: Callable[[int], list[np.ndarray]]
    same: Callable[[Any, Any], bool] = lambda ours, theirs: True
    sizes: tuple[int, ...] = (256,)
    large: tuple[int, ...] = (400,)
    remark: Callable[[list[np.ndarray], Any, float], str] = lambda inputs, result, seconds: ""
    contestants: dict[str, Contestant] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Enter the race."""
        RACES[self.title] = self

    def contestant(
        self, name: str, package: str | None = None, most: int = 10_000
    ) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
        """Enter a contestant: a decorator of its function.

        Ours enters a second time, on one thread, if it takes ``threads``.
        """

        def enter(run: Callable[..., Any]) -> Callable[..., Any]:
            self.contestants[name] = Contestant(name, package or name, run, most)
            if name == OURS and "threads" in inspect.signature(run).parameters:
                alone = functools.partial(run, threads=1)
                self.contestants[ONE_THREAD] = Contestant(ONE_THREAD, OURS, alone, most)
            return run

        return enter

    def run(self, size: int, repeats: int) -> Iterator[dict[str, Any]]:
        """Measure every contestant at one size: time in turn, memory each on its own."""
        present = []
        for contestant in self.contestants.values():
            if version(contestant) is None:
                print(f"{self.title}: {contestant.package} is not installed", flush=True)
            elif size <= contestant.most:
                present.append(contestant)
        inputs = self.make(size)
        small = self.make(min(size, 40))
        for contestant in present:
            contestant.run(*small)  # imports, compilers, thread pools
        seconds: dict[str, list[float]] = {c.name: [] for c in present}
        remarks: dict[tuple[str, float], str] = {}
        ours: Any = None
        for turn in range(repeats):
            for contestant in present:
                if max(seconds[contestant.name], default=0.0) > LONG:
                    continue
                start = time.perf_counter()
                result = contestant.run(*inputs)
                taken = time.perf_counter() - start
                seconds[contestant.name].append(taken)
                remarks[contestant.name, taken] = self.remark(inputs, result, taken)
                if turn == 0 and contestant.name == OURS:
                    ours = result
                elif turn == 0 and contestant.name != ONE_THREAD and not self.same(ours, result):
                    raise AssertionError(f"{self.title}: {contestant.name} finds something else")
                del result
        # One of the runs, so that its remark is about what the time is of.
        medians = {name: statistics.median_low(times) for name, times in seconds.items()}
        for contestant in present:
            median = medians[contestant.name]
            yield {
                "race": self.title,
                "size": size,
                "contestant": contestant.name,
                "version": version(contestant),
                "seconds": median,
                "remark": remarks[contestant.name, median],
                "times_as_long": median / medians[OURS],
                "bytes_per_voxel": self._memory(contestant, size, inputs, small),
            }

    def _memory(
        self, contestant: Contestant, size: int, inputs: list[np.ndarray], small: list[np.ndarray]
    ) -> float | None:
        """Peak memory beyond the inputs, measured in a process of its own."""
        if not STATUS.exists():
            return None
        with tempfile.TemporaryDirectory() as folder:
            for name, arrays in (("inputs", inputs), ("small", small)):
                for i, array in enumerate(arrays):
                    np.save(Path(folder) / f"{name}{i}.npy", array)
            command = [sys.executable, __file__, self.title, contestant.name, folder]
            output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        return int(output.split()[-1]) / size**3


RACES: dict[str, Race] = {}


def version(contestant: Contestant) -> str | None:
    """The contestant's version, None if it is not installed."""
    if contestant.package == OURS:
        return poresynth.__version__
    try:
        return importlib.metadata.version(contestant.package)
    except importlib.metadata.PackageNotFoundError:
        return None


def resident(key: str) -> int:
    """Resident memory of this process in bytes: "VmRSS" now, "VmHWM" at its peak."""
    line = next(x for x in STATUS.read_text().splitlines() if x.startswith(key))
    return int(line.split()[1]) * 1024


def measure_memory(title: str, name: str, folder: Path) -> int:
    """Run a contestant once; return the bytes that it took beyond its inputs."""
    run = RACES[title].contestants[name].run
    inputs, small = (
        [np.load(path) for path in sorted(folder.glob(f"{kind}*.npy"))]
        for kind in ("inputs", "small")
    )
    run(*small)
    before = resident("VmRSS")
    Path("/proc/self/clear_refs").write_text("5")  # forgets the peak
    result = run(*inputs)
    taken = resident("VmHWM") - before
    del result
    return taken


def load_races() -> None:
    """Import every file of the folder `races`."""
    for path in sorted((Path(__file__).parent / "races").glob("*.py")):
        importlib.import_module(f"races.{path.stem}")


if __name__ == "__main__":
    # The races enter the module `race`, which this file is not when it runs by itself.
    import race

    race.load_races()
    print(race.measure_memory(sys.argv[1], sys.argv[2], Path(sys.argv[3])))
