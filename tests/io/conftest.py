"""Volumes and folders that the tests of reading and writing share."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from poresynth.io import formats
from poresynth.io.format import Format


def _voxels(shape: tuple[int, ...], dtype: str, seed: int = 0) -> np.ndarray[Any, Any]:
    random = np.random.default_rng(seed)
    if dtype == "bool":
        return random.random(shape) > 0.5
    if dtype.startswith("float"):
        array = random.normal(size=shape).astype(dtype)
        array[random.random(shape) < 0.2] = np.nan
        array[random.random(shape) < 0.1] = -np.inf
        return array
    info = np.iinfo(dtype)
    return random.integers(info.min, info.max, shape, dtype=dtype, endpoint=True)


@pytest.fixture(scope="session")
def voxels() -> Callable[..., np.ndarray[Any, Any]]:
    """Voxels over the whole range of a type, with NaN and infinity among the floats."""
    return _voxels


@pytest.fixture(scope="session")
def provenance() -> dict[str, Any]:
    """What a synthetic volume carries."""
    return {"engine": "volume", "seed": 1, "note": 'µm, "a" \\ and\nb', "of": {"share": 0.125}}


@pytest.fixture(scope="session")
def format_named() -> Callable[[str], Format]:
    """Return the format of a name; skips if it cannot be used here."""

    def find(name: str) -> Format:
        found = next(f for f in formats() if f.name == name)
        if found.unavailable:
            pytest.skip(f"{name} {found.unavailable}")
        return found

    return find


@pytest.fixture
def public_folder() -> Iterator[Path]:
    """A folder that every user of the machine can reach, unlike pytest's own."""
    folder = Path(tempfile.mkdtemp())
    folder.chmod(0o755)
    yield folder
    shutil.rmtree(folder)


@pytest.fixture
def drop_privileges(public_folder: Path) -> Iterator[Callable[[], None]]:
    """Return what takes the rights of root away, if the test has them, until its end."""
    if os.name != "posix":
        pytest.skip("permissions are POSIX")
    root = os.geteuid() == 0
    yield lambda: os.seteuid(65534) if root else None
    if root:
        os.seteuid(0)
    for path in public_folder.iterdir():
        path.chmod(0o755)


@pytest.fixture
def tiny_disk(tmp_path: Path) -> Iterator[Path]:
    """A disk of 256 KiB."""
    if sys.platform != "linux" or not shutil.which("mount"):
        pytest.skip("a small disk is made by tmpfs of Linux")
    disk = tmp_path / "disk"
    disk.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=256k", "tmpfs", str(disk)]
    if subprocess.run(command, capture_output=True).returncode:
        pytest.skip("mounting a small disk is not permitted here")
    try:
        yield disk
    finally:
        subprocess.run(["umount", "--lazy", str(disk)], check=True)
