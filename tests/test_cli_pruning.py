"""Pruning on the command line: alone, and of a new volume."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import numpy as np
import pytest

from poresynth import exemplars, io
from poresynth.cli import main
from poresynth.volume import Volume


def run(*words: object) -> None:
    assert main([str(word) for word in words]) == 0


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    volume = exemplars.foam((48, 48, 48), seed=1)
    array = np.array(volume.array)
    array[20:23, 20:23, 4:8] = array.max()
    array[5, 5, 5] = array.max()
    io.write("foam.tif", volume)
    io.write("rough.tif", volume.with_array(array))
    return tmp_path


def test_a_volume_is_pruned_and_reported(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--exemplar", "foam.tif", "--report", "out"]
    run("prune", "rough.tif", "-o", "clean.tif", *words)
    before, after = io.read("rough.tif"), io.read("clean.tif")
    assert (after.shape, after.dtype, after.voxel_size) == (
        before.shape,
        before.dtype,
        before.voxel_size,
    )
    said = capsys.readouterr().out
    assert "part removed" in said or "part joined" in said
    figures = json.loads(Path("out/pruning.json").read_text())
    assert figures["after"]["components"] == 1
    assert figures["before"]["components"] > 1
    assert sum(figures["counts"].values()) == len(figures["edits"])
    assert all(len(edit["place"]) == 3 and edit["voxels"] > 0 for edit in figures["edits"])
    page = Path("out/pruning.html").read_text(encoding="utf-8")
    assert page.count("<img") >= 4
    assert "before" in page
    origin = json.loads(Path("clean.tif.json").read_text())["poresynth"]
    assert origin["pruning"] == {k: v for k, v in figures.items() if k in origin["pruning"]}
    assert origin["pruning"]["after"]["components"] == 1
    assert origin["command"] in page
    assert main(shlex.split(origin["command"].replace("clean.tif", "again.tif"))[1:]) == 0
    np.testing.assert_array_equal(io.read("again.tif").array, after.array)
    run("prune", "rough.tif", "-o", "again.tif", "--exemplar", "foam.tif", "--threads", 1)
    np.testing.assert_array_equal(io.read("again.tif").array, after.array)


def test_wrong_input_leaves_nothing(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for words, parameter in (
        (("--theta", "-1"), "theta"),
        (("--target", "exemplar"), "target"),
        (("--exemplar", "nothing.tif"), "nothing.tif"),
    ):
        assert main(["prune", "rough.tif", "-o", "clean.tif", *words]) == 2
        said = capsys.readouterr().err
        assert parameter in said
        assert "Traceback" not in said
    assert not Path("clean.tif").exists()


def test_a_new_volume_is_pruned(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    small = ["--shape", 40, 40, 40, "--preset", "fast"]
    run("synthesize", "foam.tif", "-o", "plain.tif", *small)
    run("synthesize", "foam.tif", "-o", "new.tif", *small, "--prune")
    origin = json.loads(Path("new.tif.json").read_text())["poresynth"]
    assert origin["pruning"]["after"]["components"] == 1
    assert origin["pruning"]["exemplar"]["components"] >= 1
    assert "--prune" in origin["command"]
    new, plain = io.read("new.tif").array, io.read("plain.tif").array
    assert (new != plain).any()
    # The same run again, and one with another target.
    run("synthesize", "-o", "again.tif", "--config", "new.tif.json")
    np.testing.assert_array_equal(io.read("again.tif").array, new)
    settings = ["--set", "prune.target=zero", "prune.parts=remove"]
    run("synthesize", "foam.tif", "-o", "zero.tif", *small, *settings)
    origin = json.loads(Path("zero.tif.json").read_text())["poresynth"]
    assert origin["configuration"]["prune"] == {"target": "zero", "parts": "remove"}
    assert "part joined" not in origin["pruning"]["counts"]


def test_a_body_keeps_its_surface(folder: Path) -> None:
    z, y, x = np.indices((40, 40, 40)) - 19.5
    ball = z**2 + y**2 + x**2 < 18**2
    io.write("ball.tif", Volume(ball.astype(np.uint8)))
    io.write("fine.tif", exemplars.foam((48, 48, 48), cell=16, seed=1))
    small = ["--shape", 40, 40, 40, "--preset", "fast", "--mask", "ball.tif"]
    run("synthesize", "fine.tif", "-o", "plain.tif", *small)
    run("synthesize", "fine.tif", "-o", "new.tif", *small, "--prune")
    plain, new = (np.asarray(io.read(name).array) for name in ("plain.tif", "new.tif"))
    np.testing.assert_array_equal(new[~ball], plain[~ball])
    figures = json.loads(Path("new.tif.json").read_text())["poresynth"]["pruning"]
    assert figures["after"]["porosity"] == pytest.approx(figures["before"]["porosity"], abs=1e-9)
    assert figures["before"]["porosity"] == pytest.approx(figures["exemplar"]["porosity"], abs=0.01)


def test_a_body_smaller_than_the_features_is_refused(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    z, y, x = np.indices((40, 40, 40)) - 19.5
    io.write("ball.tif", Volume((z**2 + y**2 + x**2 < 5**2).astype(np.uint8)))
    words = ["foam.tif", "-o", "new.tif", "--shape", 40, 40, 40, "--mask", "ball.tif"]
    assert main(["synthesize", *map(str, words)]) == 2
    assert "must be wider than the features" in capsys.readouterr().err
    assert not Path("new.tif").exists()


def test_a_part_has_a_report_of_its_own(folder: Path) -> None:
    small = ["--shape", 40, 40, 40, "--preset", "fast", "--report", "out", "--part", "part.stl"]
    run("synthesize", "foam.tif", "-o", "new.tif", *small)
    pages = ("report.html", "part/report.html")
    whole, part = (Path("out", page).read_text(encoding="utf-8") for page in pages)
    assert "A part from a volume" in part
    assert "A part from a volume" not in whole
    assert "novelty_12" in json.loads(Path("out/report.json").read_text())


def test_what_cannot_be_a_part_is_refused_first(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["synthesize", "foam.tif", "-o", "new.tif", "--shape", "40", "40", "40"]
    for wrong, said in (
        (["--part", "part.xyz"], "unknown suffix"),
        (["--part", "part.inp", "--set", "part.smooth=3"], "smooth"),
        (["--shell", "2"], "needs --part"),
    ):
        assert main([*words, *wrong]) == 2
        assert said in capsys.readouterr().err
        assert not Path("new.tif").exists()
