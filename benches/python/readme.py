"""Where measured figures go: JSON files, tables in README.md and docs, and their pictures."""

from __future__ import annotations

import datetime
import io
import json
import os
import platform
from collections.abc import Iterable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "benches" / "results"
PICTURES = ROOT / "docs" / "images"


def machine() -> str:
    """The machine and the day, for the line under a table."""
    name = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        models = [
            x.split(":")[1].strip() for x in info.read_text().splitlines() if "model name" in x
        ]
        name = models[0] if models else name
    day = datetime.datetime.now(tz=datetime.timezone.utc).date()
    return f"{os.cpu_count()} cores of {name}, Python {platform.python_version()}, {day}"


def machines(rows: Iterable[dict[str, Any]]) -> str:
    """The machines and days of rows, which are not all measured at once."""
    return "; ".join(dict.fromkeys(row["machine"] for row in rows))


def save(name: str, figures: Any) -> None:
    """Write figures to benches/results/<name>.json."""
    RESULTS.mkdir(exist_ok=True)
    record = {"machine": machine(), "figures": figures}
    (RESULTS / f"{name}.json").write_text(json.dumps(record, indent=1) + "\n")


def load(name: str) -> Any:
    """Read the figures that `save` wrote, an empty list if there are none."""
    path = RESULTS / f"{name}.json"
    return json.loads(path.read_text())["figures"] if path.exists() else []


def update_readme(marker: str, table: str, page: str = "README.md") -> None:
    """Put a table between the two comments of a marker in README.md, or in another page."""
    readme = ROOT / page
    begin, end = f"<!-- {marker}:begin -->", f"<!-- {marker}:end -->"
    text = readme.read_text(encoding="utf-8")
    before, rest = text.split(begin)
    after = rest.split(end)[1]
    readme.write_text(f"{before}{begin}\n{table}\n{end}{after}", encoding="utf-8")


def save_picture(name: str, png: bytes) -> None:
    """Write a PNG to docs/images, in 256 colours: a third of the bytes, and no visible loss."""
    from PIL import Image

    PICTURES.mkdir(parents=True, exist_ok=True)
    picture = Image.open(io.BytesIO(png)).convert("RGB")
    picture.quantize(256, dither=Image.Dither.NONE).save(PICTURES / f"{name}.png", optimize=True)
