"""The command line: training a network, going on with it, and sampling."""

from __future__ import annotations

import json
import re
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from poresynth import io
from poresynth.cli import main
from poresynth.exemplars import spinodal

MICRO = [
    "--preset", "tiny", "--set", "device=cpu", "latent=4", "generator_maps=8,4",
    "discriminator_maps=4,8", "regions=2,1", "batch=2", "learning_rate=0.01", "output_bias=true",
    "ema=0", "evaluate_every=3",
]  # fmt: skip


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    io.write("example.tif", spinodal((24, 26, 28), porosity=0.55, wavelength=8))
    return tmp_path


def run(*arguments: object) -> None:
    assert main([str(a) for a in arguments]) == 0


def refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    capsys.readouterr()
    assert main([str(a) for a in arguments]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert lines[-1].startswith("poresynth: error: ")
    return lines[-1].removeprefix("poresynth: error: ")


def train(*more: object) -> None:
    run("train", "example.tif", "-o", "model", *MICRO, "iterations=6", *more)


def test_train_then_sample(capsys: pytest.CaptureFixture[str]) -> None:
    train()
    out = capsys.readouterr().out
    assert "model: model (6 iterations; all iterations)" in out
    assert "two_point_error_percent" in out
    assert {"model.safetensors", "checkpoint.safetensors", "log.jsonl", "slices"} <= {
        p.name for p in Path("model").iterdir()
    }
    run("sample", "model", "-o", "new.tif", "--shape", 30, 24, 20, "--seed", 3)
    out = capsys.readouterr().out
    assert "new volume: new.tif" in out
    assert "novelty_12" in out
    made = io.read("new.tif")
    assert made.shape == (30, 24, 20)
    origin = made.metadata["poresynth"]
    assert origin["training"]["exemplar"] == "example.tif"
    first = made.array.copy()
    run(*shlex.split(origin["command"])[1:])
    assert np.array_equal(io.read("new.tif").array, first)


def test_the_command_of_a_training_repeats_it() -> None:
    train("--seed", 4, "--crop", "0:20", ":", "2:28")
    run("sample", "model", "-o", "a.npy", "--shape", 20, 20, 20)
    command = io.read("a.npy").metadata["poresynth"]["training"]["command"]
    assert "--crop 0:20 : 2:28" in command
    words = ["again" if word == "model" else word for word in shlex.split(command)]
    run(*words[1:])
    run("sample", "again/model.safetensors", "-o", "b.npy", "--shape", 20, 20, 20)
    assert np.array_equal(io.read("a.npy").array, io.read("b.npy").array)


def test_resume_goes_on_with_the_parameters_that_it_began_with(
    capsys: pytest.CaptureFixture[str],
) -> None:
    train()
    assert "holds a training; --resume goes on with it" in refused(
        capsys, "train", "example.tif", "-o", "model", *MICRO
    )
    run("train", "example.tif", "-o", "model", "--resume", "--set", "iterations=12")
    parts = Path("model/log.jsonl").read_text().splitlines()
    assert [json.loads(line)["iteration"] for line in parts] == [3, 6, 9, 12]
    run("train", "example.tif", "-o", "whole", *MICRO, "iterations=12")
    for name in ("model", "whole"):
        run("sample", name, "-o", f"{name}.npy", "--shape", 20, 20, 20)
    assert np.array_equal(io.read("model.npy").array, io.read("whole.npy").array)


def test_blockwise_goes_to_the_disk(capsys: pytest.CaptureFixture[str]) -> None:
    train()
    shape = ("--shape", 30, 24, 20)
    run("sample", "model", "-o", "a.zarr", *shape, "--blockwise", "--cut-at", "exemplar")
    said = capsys.readouterr()
    assert re.search(
        r"^porosity: (0\.\d+)\nporosity at the exemplar's threshold: \1$", said.out, re.M
    )
    stated = re.search(r"needs about ([\d.]+) MB of memory; .* is available", said.err)
    assert stated
    assert 64 < float(stated[1]) < 200
    run("sample", "model", "-o", "b.npy", *shape, "--cut-at", "exemplar", "--threads", 1)
    assert np.array_equal(io.read("a.zarr").array, io.read("b.npy").array)
    said = refused(capsys, "sample", "model", "-o", "a.npz", *shape, "--blockwise")
    assert "only TIFF and Zarr" in said
    said = refused(capsys, "sample", "model", "-o", "a.tif", *shape, "--blockwise", "--report", "r")
    assert "not with --blockwise" in said


def test_a_periodic_volume_and_a_report() -> None:
    train()
    run("sample", "model", "-o", "new.tif", "--shape", 32, 28, 24, "--periodic", "--report", "out")
    assert Path("out/report.html").exists()
    assert io.read("new.tif").metadata["poresynth"]["boundary"] == "periodic"


def test_a_sample_is_graded_and_pruned(capsys: pytest.CaptureFixture[str]) -> None:
    train()
    words = ["--shape", 36, 30, 30, "--porosity", "z=0.45:0.65", "--prune"]
    run("sample", "model", "-o", "new.tif", *words)
    origin = json.loads(Path("new.tif.json").read_text())["poresynth"]
    assert origin["pruning"]["after"]["components"] <= origin["pruning"]["before"]["components"]
    assert origin["pruning"]["after"]["porosity"] == pytest.approx(0.55, abs=0.01)
    assert "--porosity z=0.45:0.65 --prune" in origin["command"]
    assert "prune" in refused(capsys, "sample", "model", "-o", "b.zarr", *words, "--blockwise")
    said = refused(capsys, "sample", "model", "-o", "b.tif", *words[:4], "--cut-at", "none")
    assert (
        said == "cut_at = none: is for models of ipfn, which have a field; this is one of "
        "scaffoldgan"
    )


def test_synthesize_trains_and_samples(capsys: pytest.CaptureFixture[str]) -> None:
    settings = [*MICRO, "iterations=6"]
    run("synthesize", "example.tif", "-o", "new.tif", "--engine", "scaffoldgan", "--shape", 24, 20,
        22, *settings)  # fmt: skip
    out = capsys.readouterr().out
    assert "porosity at the exemplar's threshold: 0." in out
    made = io.read("new.tif").array.copy()
    run("synthesize", "-o", "again.tif", "--config", "new.tif.json")
    assert np.array_equal(io.read("again.tif").array, made)


def test_synthesize_refuses_before_it_trains(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from poresynth.engines.scaffold_gan import ScaffoldGAN

    def fit(*_: object, **__: object) -> None:
        raise AssertionError("trained")

    monkeypatch.setattr(ScaffoldGAN, "fit", fit)
    words = ["synthesize", "example.tif", "-o", "new.tif", "--engine", "scaffoldgan", *MICRO]
    io.write("mask.npy", np.ones((24, 24, 25), bool))
    for more, said in (
        (["--shape", 24, 24, 25, "--periodic"], "shape = (24, 24, 25): must be multiples of 4"),
        (["--shape", 24, 24, 24, "--porosity", "none.tif"], "none.tif: no such file"),
        (
            ["--shape", 24, 26, 28, "--known", "example.tif", "--known-mask", "mask.npy"],
            "known = example.tif: cannot be kept by the engine scaffoldgan",
        ),
    ):
        assert refused(capsys, *words, *more).startswith(said)


def test_what_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    command = ("train", "example.tif", "-o", "model")
    assert "did you mean latent" in refused(capsys, *command, "--set", "latemt=3")
    for name in ("gan", "volume"):
        said = refused(capsys, *command, "--engine", name)
        assert said == f"engine = {name}: must be one that is trained: ipfn, scaffoldgan"
    assert "16 for two generator_maps" in refused(capsys, *command, "--preset", "tiny")
    assert "at least 64 voxels" in refused(capsys, *command, "--preset", "small")
    assert "holds no checkpoint" in refused(capsys, *command, "--resume")
    assert "does not exist" in refused(capsys, "train", "example.tif", "-o", "no/such/model")
    shape = ("--shape", 20, 20, 20)
    assert "no such file" in refused(capsys, "sample", "none", "-o", "new.tif", *shape)
    assert "unknown suffix" in refused(capsys, "sample", "model", "-o", "new.docx", *shape)
    said = refused(capsys, "sample", "example.tif", "-o", "new.tif", *shape)
    assert "not a model, or damaged" in said
    assert not Path("new.tif").exists()


def test_ctrl_c_leaves_a_model_and_says_how_to_go_on() -> None:
    words = [sys.executable, "-m", "poresynth", "train", "example.tif", "-o", "model", *MICRO]
    program = subprocess.Popen([*words, "iterations=100000"], stderr=subprocess.PIPE, text=True)
    while not Path("model/checkpoint.safetensors").exists():
        assert program.poll() is None, program.stderr and program.stderr.read()
        time.sleep(0.05)
    program.send_signal(signal.SIGINT)
    said = program.communicate()[1]
    assert program.returncode == 130
    assert "the training lies in model; --resume goes on with it" in said
    run("sample", "model", "-o", "new.tif", "--shape", 20, 20, 20)
