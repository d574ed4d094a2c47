"""The races of the benchmarks run, small: nobody else calls them when the package changes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

FOLDER = Path(__file__).parent.parent / "benches" / "python"

SCRIPT = """
from race import OURS, RACES, load_races
load_races()
for race in RACES.values():
    inputs = race.make(40)
    result = race.contestants[OURS].run(*inputs)
    race.remark(inputs, result, 1.0)
    print(race.title)
"""


def test_every_race_runs() -> None:
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], cwd=FOLDER, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) >= len(list((FOLDER / "races").glob("*.py")))
