"""A report as a whole."""

from __future__ import annotations

import errno
import json
import os
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from poresynth.comparison import Comparison, compare
from poresynth.engines.base import EnergyRecord
from poresynth.errors import FileError
from poresynth.exemplars import spinodal
from poresynth.io import atomic
from poresynth.report import render3d, reserved, write_report
from poresynth.report.words import explain
from poresynth.volume import Volume

ENERGY = [EnergyRecord(1, 4, i, 9.0 / (i + 1), 5.0, 1.0, 1.0) for i in range(4)]


@pytest.fixture(scope="module")
def exemplar() -> Volume:
    gray = spinodal((32, 32, 32), porosity=0.6, wavelength=10, seed=1)
    return Volume(gray.array, (40.0, 20.0, 20.0), "µm")


@pytest.fixture(scope="module")
def volume() -> Volume:
    gray = spinodal((40, 36, 32), porosity=0.6, wavelength=10, seed=2)
    origin = {
        "engine": "volume",
        "seed": 7,
        "parameters": {"preset": "fast"},
        "field_reason": "distance, which explains all",
        "version": "9.8.7",
    }
    return Volume(gray.array, (40.0, 20.0, 20.0), "µm", {"poresynth": origin})


@pytest.fixture(scope="module")
def comparison(exemplar: Volume, volume: Volume) -> Comparison:
    return compare(exemplar, volume)


@pytest.fixture(autouse=True)
def without_pyvista(monkeypatch: pytest.MonkeyPatch) -> None:
    """Start no other process: `test_render3d.py` does."""
    monkeypatch.setattr(render3d, "find_spec", lambda name: None)


@pytest.fixture(scope="module")
def text(
    tmp_path_factory: pytest.TempPathFactory,
    exemplar: Volume,
    volume: Volume,
    comparison: Comparison,
) -> str:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(render3d, "find_spec", lambda name: None)
        page = write_report(
            tmp_path_factory.mktemp("report"),
            exemplar,
            volume,
            comparison,
            energy=ENERGY,
            configuration={
                "exemplar": "scans/bone.tif",
                "parameters": {"windows": [8, 4]},
                "seed": 7,
            },
            command="poresynth synthesize 'my bone.tif'",
        )
    assert page.name == "report.html"
    return page.read_text(encoding="utf-8")


def test_the_page_says_what_was_made_and_how(text: str) -> None:
    for words in (
        "32 × 32 × 32 voxels of 40 × 20 × 20 µm",
        "40 × 36 × 32 voxels",
        "volume, preset fast",
        "distance, which explains all",
        "poresynth 9.8.7",
        "poresynth synthesize &#x27;my bone.tif&#x27;",
        "<code>exemplar = &quot;scans/bone.tif&quot;\nseed = 7\n\n[parameters]\nwindows = [8, 4]<",
    ):
        assert words in text


def test_the_page_holds_every_figure(text: str, comparison: Comparison) -> None:
    assert comparison.figures
    for figure in comparison.figures.values():
        assert f"<code>{figure.name}</code>" in text
        assert explain(figure.name)[1], f"{figure.name} is not explained"


def test_the_page_holds_every_picture(text: str) -> None:
    for name in ("exemplar, xy", "new volume, xz", "new volume, yz"):
        assert f'alt="{name}"' in text
    for title in ("Two-point correlation", "Gray values", "Novelty", "Energy"):
        assert f'alt="{title}"' in text
    # Every chart for a light and a dark page.
    assert text.count("<picture>") == text.count("<source ")


def test_the_page_needs_nothing_from_elsewhere(text: str) -> None:
    without_pictures = re.sub(r"data:image/png;base64,[A-Za-z0-9+/=]*", "", text)
    for word in ("<script", "http:", "https:", "url(", "<link", "@import"):
        assert word not in without_pictures


def test_the_numbers_are_the_same_for_programs(
    tmp_path: Path, exemplar: Volume, volume: Volume, comparison: Comparison
) -> None:
    write_report(tmp_path / "out", exemplar, volume, comparison, energy=ENERGY, command="c")
    data = json.loads((tmp_path / "out" / "report.json").read_text())
    for key, value in json.loads(json.dumps(comparison.to_dict())).items():
        assert data[key] == value
    assert [record["energy"] for record in data["energy"]] == [9.0, 4.5, 3.0, 2.25]
    assert data["command"] == "c"
    assert data["curves"]


def test_plain_arrays_and_nothing_else(tmp_path: Path) -> None:
    exemplar, volume = (spinodal((24, 24, 24), wavelength=8, seed=s).array > 128 for s in (1, 2))
    page = write_report(tmp_path, exemplar, volume, compare(exemplar, volume))
    text = page.read_text(encoding="utf-8")
    assert "not recorded" in text
    assert "Configuration" not in text
    assert 'alt="Energy"' not in text


def test_a_much_larger_volume_is_shown_in_part(tmp_path: Path) -> None:
    exemplar = spinodal((16, 16, 16), wavelength=8, seed=1).array
    volume = spinodal((16, 16, 64), wavelength=8, seed=2).array
    page = write_report(tmp_path, exemplar, volume, compare(exemplar, volume))
    assert "its central part" in page.read_text(encoding="utf-8")


def snapshot(folder: Path) -> dict[str, Any]:
    return {p.name: p.read_bytes() for p in sorted(folder.iterdir())}


def test_an_earlier_report_stays_when_the_disk_is_full(
    tmp_path: Path,
    exemplar: Volume,
    volume: Volume,
    comparison: Comparison,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def full(descriptor: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    (tmp_path / "report.html").write_text("the earlier one")
    before = snapshot(tmp_path)
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(FileError, match="no room left"):
        write_report(tmp_path, exemplar, volume, comparison)
    assert snapshot(tmp_path) == before
    with pytest.raises(FileError, match="no room left"):
        write_report(tmp_path / "out", exemplar, volume, comparison)
    assert snapshot(tmp_path) == before


def test_a_folder_that_cannot_be(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    for path in (tmp_path / "file", tmp_path / "file" / "out", tmp_path / "missing" / "out"):
        with pytest.raises(FileError), reserved(path):
            pass


def test_one_report_at_a_time(tmp_path: Path) -> None:
    lock = tmp_path / ".report.html.lock"
    lock.write_text("1 another-host\n")
    with pytest.raises(FileError, match="being written"), reserved(tmp_path):
        pass


def test_a_reserved_folder_goes_when_the_work_fails(tmp_path: Path) -> None:
    def fail(folder: Path) -> None:
        with reserved(folder):
            assert folder.is_dir()
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail(tmp_path / "new")
    assert not (tmp_path / "new").exists()
    (tmp_path / "old").mkdir()
    (tmp_path / "old" / "notes.txt").touch()
    with pytest.raises(KeyboardInterrupt):
        fail(tmp_path / "old")
    assert [p.name for p in (tmp_path / "old").iterdir()] == ["notes.txt"]


def test_claims_nest(
    tmp_path: Path, exemplar: Volume, volume: Volume, comparison: Comparison
) -> None:
    with reserved(tmp_path / "out"), atomic.claim(tmp_path / "new.tif"):
        write_report(tmp_path / "out", exemplar, volume, comparison)
    assert np.size(list((tmp_path / "out").iterdir())) == 2
