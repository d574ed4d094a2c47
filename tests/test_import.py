"""What a program pays for `import poresynth`."""

from __future__ import annotations

import subprocess
import sys

import pytest

HEAVY = ["torch", "scipy", "skimage", "matplotlib", "zarr", "pyvista", "pydantic", "rich"]


def loaded_after(statement: str) -> set[str]:
    """Names of the modules that are loaded in a fresh interpreter after a statement."""
    code = f"{statement}\nimport sys; print(*sys.modules)"
    result = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True
    )
    return set(result.stdout.split())


def test_importing_the_package_loads_nothing_heavy() -> None:
    assert not loaded_after("import poresynth") & set(HEAVY)


@pytest.mark.parametrize("name", ["Volume", "PoresynthError", "__version__"])
def test_ground_floor_names_load_nothing_heavy(name: str) -> None:
    assert not loaded_after(f"from poresynth import {name}") & set(HEAVY)


def test_help_loads_no_numerical_library() -> None:
    loaded = loaded_after("from poresynth.cli import main; main(['--help'])")
    assert not loaded & {"torch", "scipy", "skimage", "matplotlib", "zarr", "pyvista"}


def test_every_public_name_can_be_had() -> None:
    loaded_after("from poresynth import *")
