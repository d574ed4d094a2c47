"""Volumes that the command line makes and writes brick by brick."""

from __future__ import annotations

import shlex
from pathlib import Path

import numpy as np
import pytest

from poresynth import exemplars, io, meshes, shapes
from poresynth.cli import main
from poresynth.engines import bricks

SMALL = ["--shape", "60", "44", "48", "--preset", "fast", "--set", "iterations=3"]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(bricks, "EDGE", 32)
    foam = exemplars.foam((48, 48, 48), cell=16, seed=1)
    io.write("foam.tif", foam)
    return tmp_path


def run(*words: object) -> None:
    assert main([str(word) for word in words]) == 0


@pytest.mark.parametrize("name", ["new.zarr", "new.tif"])
def test_a_volume_is_written_brick_by_brick(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    run("synthesize", "foam.tif", "-o", name, *SMALL, "--blockwise", "--seed", 3)
    said = capsys.readouterr().out
    assert "Made in 8 bricks" in said
    assert "phase_changes" in said
    made = io.read(name)
    assert made.shape == (60, 44, 48)
    origin = made.metadata["poresynth"]
    assert origin["configuration"]["blockwise"] is True
    assert "--blockwise" in origin["command"]
    run(*shlex.split(origin["command"].replace(name, f"again-{name}"))[1:])
    np.testing.assert_array_equal(io.read(f"again-{name}").array, made.array)


def test_a_body_is_filled_brick_by_brick() -> None:
    foam = io.read("foam.tif")
    io.write("foam.tif", type(foam)(foam.array, 1.0, "mm"))
    meshes.write("body.stl", shapes.figure(70.0))
    words = ["--mask", "body.stl", "--mask-unit", "mm", "--preset", "fast"]
    run("synthesize", "foam.tif", "-o", "new.tif", *words, "--blockwise", "--set", "iterations=3")
    made = io.read("new.tif")
    origin = made.metadata["poresynth"]
    assert origin["domain"]
    inside = shapes.read_domain("body.stl", voxel_size=(1.0,) * 3, unit="mm", body_unit="mm").mask
    assert made.shape == inside.shape
    low = foam.array.min()
    assert (made.array[~inside.array] == low).all()
    assert (made.array[inside.array] > low).mean() > 0.5


def test_what_needs_the_whole_volume_is_refused_first(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for wrong, said in (
        (["--report", "out"], "report = out: needs the whole volume"),
        (["--prune"], "prune = "),
        (["--periodic"], "boundary = periodic: needs the whole volume"),
        (["--scale", "2"], "scale = 2.0: needs the whole volume"),
        (["--porosity", "z=0.7:0.9"], "must be a number where a volume is written brick by brick"),
    ):
        assert main(["synthesize", "foam.tif", "-o", "new.tif", *SMALL, "--blockwise", *wrong]) == 2
        assert said in capsys.readouterr().err
    words = ["synthesize", "a.png", "-o", "new.tif", "--engine", "solid", "--blockwise"]
    assert main([*words, "--shape", "40", "40", "40"]) == 2
    assert "blockwise = solid: is for the engine volume" in capsys.readouterr().err
    words = ["synthesize", "foam.tif", "-o", "new.npy", *SMALL, "--blockwise"]
    assert main(words) == 2
    assert "only TIFF and Zarr can be written part by part" in capsys.readouterr().err
    assert sorted(path.name for path in Path().iterdir()) == ["foam.tif", "foam.tif.json"]
