"""The command line: fields of images and volumes, with guidance."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy import ndimage

from poresynth import io, meshes
from poresynth.cli import main
from poresynth.exemplars import spinodal
from poresynth.meshes import check, isosurface
from poresynth.volume import Volume

MICRO = [
    "device=cpu", "iterations=40", "evaluate_every=20", "learning_rate=0.02", "width=16",
    "places=64", "grids=8", "filters=16", "reach=10", "start_iterations=0",
]  # fmt: skip


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    io.write("example.tif", spinodal((24, 26, 28), porosity=0.55, wavelength=8))
    smooth = ndimage.gaussian_filter(np.random.default_rng(1).random((48, 40)), 2, mode="wrap")
    io.write("image.png", Volume(np.where(smooth > 0.5, 200, 50).astype(np.uint8)[None]))
    return tmp_path


def run(*arguments: object) -> None:
    assert main([str(a) for a in arguments]) == 0


def refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    capsys.readouterr()
    assert main([str(a) for a in arguments]) == 2
    return capsys.readouterr().err.splitlines()[-1].removeprefix("poresynth: error: ")


def test_a_volume_is_synthesised_and_compared(capsys: pytest.CaptureFixture[str]) -> None:
    run("synthesize", "example.tif", "-o", "new.tif", "--engine", "ipfn", "--shape", 30, 24, 20,
        "--set", *MICRO)  # fmt: skip
    assert "new volume: new.tif" in capsys.readouterr().out
    made = io.read("new.tif")
    assert made.shape == (30, 24, 20)
    origin = made.metadata["poresynth"]
    assert (origin["engine"], origin["parameters"]["width"]) == ("ipfn", 16)
    run("synthesize", "-o", "again.tif", "--config", "new.tif.json")
    np.testing.assert_array_equal(io.read("again.tif").array, made.array)


def test_an_image_is_synthesised(capsys: pytest.CaptureFixture[str]) -> None:
    run("synthesize", "image.png", "-o", "new.png", "--engine", "ipfn", "--shape", 1, 90, 80,
        "--set", *MICRO)  # fmt: skip
    made = io.read("new.png").array
    assert made.shape == (1, 90, 80)
    assert set(np.unique(made)) == {50, 200}


def test_a_guided_model_is_trained_and_sampled(capsys: pytest.CaptureFixture[str]) -> None:
    run("train", "image.png", "-o", "model", "--engine", "ipfn", "--set", *MICRO,
        "guidance=density", "crop=12", "iterations=100")  # fmt: skip
    run("sample", "model", "-o", "graded.png", "--shape", 1, 64, 64, "--set", "guidance=0.1,0.9")
    origin = io.read("graded.png").metadata["poresynth"]
    assert origin["guidance"] == [0.1, 0.9]
    assert "--set 'guidance=[0.1, 0.9]'" in origin["command"]
    ramp = np.tile(np.linspace(0, 1, 16, dtype=np.float32), (8, 1))
    io.write("map.npy", ramp[None])
    run("sample", "model", "-o", "mapped.png", "--shape", 1, 64, 64, "--set", "guidance=map.npy")
    assert io.read("mapped.png").metadata["poresynth"]["guidance"] == "a map of shape (8, 16)"
    run("sample", "model", "-o", "mirror.png", "--shape", 1, 64, 64, "--cut-at", "exemplar",
        "--set", "noise_scale=1.5", "mirrored=true")  # fmt: skip
    made = io.read("mirror.png").array
    np.testing.assert_array_equal(made, made[:, ::-1, ::-1])
    said = refused(capsys, "sample", "model", "-o", "a.png", "--shape", 1, 9, 9, "--set", "warp=2")
    assert said.startswith("warp = 2: is no option of sampling by ipfn; known are")
    said = refused(capsys, "sample", "model", "-o", "a.png", "--shape", 9, 9, 9)
    assert said.startswith("shape = (9, 9, 9): must be (1, y, x)")
    assert not Path("a.png").exists()


def test_several_images_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    said = refused(capsys, "synthesize", "image.png", "image.png", "-o", "new.png", "--engine",
                   "ipfn", "--shape", 1, 20, 20)  # fmt: skip
    assert "learns from one volume or image" in said


@pytest.mark.parametrize("suffix", [".stl", ".3mf"])
def test_a_mesh_is_learned_and_meshed_finer_than_its_voxels(
    suffix: str, capsys: pytest.CaptureFixture[str]
) -> None:
    gray = spinodal((24, 26, 28), porosity=0.55, wavelength=8).array
    solid = np.pad((gray > np.quantile(gray, 0.55)).astype(np.float32), 1) - 0.5
    body = isosurface(solid, voxel_size=(0.1, 0.1, 0.1), unit="mm")
    meshes.write(f"body{suffix}", body)
    command = ["train", f"body{suffix}", "-o", "model", "--engine", "ipfn", "--set", *MICRO]
    said = refused(capsys, *command)
    assert said.startswith("voxel_size = (not given): is needed, z y x")
    said = refused(capsys, *command, "--voxel-size", 9, 9, 9, "--unit", "mm")
    assert said.startswith(f"exemplar = body{suffix}: 2.8 × 2.6 × 2.4 mm: must be")
    run(*command, "--voxel-size", 0.1, 0.1, 0.1, "--unit", "mm")
    run("sample", "model", "-o", "new.npz", "--shape", 20, 20, 20)
    made = io.read("new.npz")
    assert (made.dtype, made.unit, made.voxel_size) == (np.dtype(bool), "mm", (0.1,) * 3)
    run("sample", "model", "-o", "field.tif", "--shape", 40, 40, 40, "--cut-at", "none",
        "--set", "resolution=2")  # fmt: skip
    field = io.read("field.tif")
    assert (field.dtype, field.voxel_size) == (np.dtype(np.float32), (0.05,) * 3)
    assert field.metadata["poresynth"]["cut_at"] == "none"
    run("mesh", "field.tif", "-o", "part.stl", "--threshold", 0, "--keep", "all")
    report = check(meshes.read("part.stl"))
    assert report.printable
    share = report.volume / 2.0**3
    assert share == pytest.approx(float((field.array > 0).mean()), rel=0.05)


def test_a_field_is_not_cut(capsys: pytest.CaptureFixture[str]) -> None:
    run("train", "image.png", "-o", "model", "--engine", "ipfn", "--set", *MICRO)
    command = ["sample", "model", "-o", "a.tif", "--shape", 1, 9, 9, "--cut-at", "none"]
    for words in (["--porosity", 0.4], ["--prune"], ["--blockwise"], ["--report", "out"]):
        assert "not with --cut-at none" in refused(capsys, *command, *words)
    assert not Path("a.tif").exists()
