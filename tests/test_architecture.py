"""Arrows between the parts of the package go one way."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PYTHON = ROOT / "python" / "poresynth"
RUST = ROOT / "rust" / "src"

GROUND = {"errors", "volume"}
# What each part of the Python package may import. The package itself (`poresynth/__init__.py`)
# names every part, lazily.
PYTHON_ARROWS = {
    "errors": set(),
    "_core": set(),
    "console": set(),
    "resources": {"errors"},
    "volume": {"errors"},
    "io": GROUND,
    "preprocess": GROUND | {"_core"},
    "exemplars": GROUND | {"_core"},
    "metrics": GROUND | {"_core", "preprocess"},
    "meshes": GROUND | {"io"},
    "shapes": GROUND | {"io", "meshes", "metrics"},
    "fabrication": GROUND | {"_core", "io", "preprocess", "metrics", "meshes", "shapes"},
    "pruning": GROUND | {"_core", "preprocess", "metrics"},
    "engines": GROUND | {"_core", "io", "preprocess", "metrics", "pruning", "resources"},
    "comparison": GROUND | {"_core", "preprocess", "metrics"},
    "report": GROUND | {"io", "preprocess", "metrics", "comparison", "pruning"},
    "config": {"errors", "engines"},
    "workflow": GROUND
    | {"io", "preprocess", "engines", "metrics", "comparison", "pruning", "resources"}
    | {"meshes", "shapes", "fabrication", "report", "config", "console"},
    "cli": {"errors", "io", "preprocess", "exemplars", "metrics", "report", "config"}
    | {"console", "workflow"},
    "__main__": {"cli"},
}
# Packages that may import torch; what else may import them.
TORCH = {"engines/neural", "engines/scaffold_gan", "engines/periodic_field"}

RUST_GROUND = {"bits", "error", "fourier", "rng", "volume", "monitor", "threads"}
AREAS = {"points", "texture", "intensity", "topology", "geometry", "correlation", "transport"}
RUST_ARROWS = {
    "bits": set(),
    "large_pages": set(),
    "error": set(),
    "rng": {"error"},
    "volume": {"error"},
    "monitor": {"error"},
    "fourier": {"error", "monitor", "rng", "threads", "volume"},
    "threads": {"error"},
    "points": RUST_GROUND,
    "geometry": RUST_GROUND,
    "intensity": RUST_GROUND,
    "topology": RUST_GROUND,
    "correlation": RUST_GROUND,
    "transport": RUST_GROUND | {"large_pages"},
    "texture": RUST_GROUND | {"geometry", "intensity"},
    "bindings": RUST_GROUND | AREAS,
    "lib": RUST_GROUND | AREAS | {"bindings"},
}


def part_of(path: Path, root: Path) -> str:
    """The part that a file belongs to: the first folder, or the file itself."""
    return path.relative_to(root).parts[0].split(".")[0]


def python_modules() -> list[Path]:
    return [p for p in sorted(PYTHON.rglob("*.py")) if p != PYTHON / "__init__.py"]


def imports(path: Path) -> Iterator[str]:
    """Full names of all that a file imports, wherever in the file."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: a relative import"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def python_edges(path: Path) -> set[str]:
    names = [name.split(".") for name in imports(path) if name.startswith("poresynth.")]
    # The version comes from the kernels, by way of the package.
    return {"_core" if n[1] == "__version__" else n[1] for n in names} - {part_of(path, PYTHON)}


def rust_edges(path: Path) -> set[str]:
    text = re.sub(r"//.*", "", path.read_text(encoding="utf-8"))
    named = set(re.findall(r"\bcrate::(\w+)", text))
    for group in re.findall(r"\bcrate::\{([^;]*)\}", text):
        named |= set(re.findall(r"(?:^|,)\s*(\w+)", group))
    return named - {part_of(path, RUST)}


@pytest.mark.parametrize("arrows", [PYTHON_ARROWS, RUST_ARROWS], ids=["python", "rust"])
def test_arrows_make_no_circle(arrows: Mapping[str, set[str]]) -> None:
    left = dict(arrows)
    while left:
        ground = [part for part, below in left.items() if not below & set(left)]
        assert ground, f"a circle among {sorted(left)}"
        for part in ground:
            del left[part]


@pytest.mark.parametrize("path", python_modules(), ids=lambda p: str(p.relative_to(PYTHON)))
def test_python_arrows(path: Path) -> None:
    part = part_of(path, PYTHON)
    allowed = PYTHON_ARROWS[part]
    # `__version__` is a fact that every part may state.
    assert python_edges(path) - {"_core"} <= allowed - {"_core"}
    direct = any(name.startswith("poresynth._core") for name in imports(path))
    assert not direct or "_core" in allowed
    neural = "/".join(path.relative_to(PYTHON).parts[:2]) in TORCH
    names = [name.split(".") for name in imports(path)]
    assert neural or not any(n[0] in ("torch", "safetensors") for n in names)
    assert neural or not any("/".join(n[1:3]) in TORCH for n in names)


@pytest.mark.parametrize("path", sorted(RUST.rglob("*.rs")), ids=lambda p: str(p.relative_to(RUST)))
def test_rust_arrows(path: Path) -> None:
    part = part_of(path, RUST)
    assert rust_edges(path) <= RUST_ARROWS[part]
    python = re.search(r"\b(pyo3|numpy)::", path.read_text(encoding="utf-8"))
    assert python is None or part == "bindings"
