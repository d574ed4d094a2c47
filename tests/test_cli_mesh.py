"""The command `mesh`: from a file of a volume to a file of a part."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from poresynth import io, meshes
from poresynth.cli import main
from poresynth.exemplars import spinodal
from poresynth.meshes import check
from poresynth.shapes import figure
from poresynth.volume import Volume


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    gray = spinodal((28, 26, 24), porosity=0.6, wavelength=10, seed=3)
    io.write("gray.tif", Volume(gray.array, 50.0, "µm"))
    return tmp_path


def run(*arguments: object) -> None:
    assert main([str(a) for a in arguments]) == 0


def refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """Return the one line that says why a command was refused; nothing new may lie about."""
    before = sorted(Path().rglob("*"))
    assert main([str(a) for a in arguments]) == 2
    said = capsys.readouterr().err
    assert "Traceback" not in said
    assert sorted(Path().rglob("*")) == before
    return said.splitlines()[-1].removeprefix("poresynth: error: ")


@pytest.mark.parametrize("suffix", [".stl", ".ply", ".obj", ".3mf"])
def test_a_surface_in_millimetres(suffix: str, folder: Path) -> None:
    run("mesh", "gray.tif", "-o", f"part{suffix}")
    report = check(meshes.read(f"part{suffix}"))
    assert report.printable
    assert report.size == pytest.approx((1.2, 1.3, 1.4), rel=1e-5)


def test_figures_are_printed_and_written(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run("mesh", "gray.tif", "-o", "part.stl", "--min-thickness", 200, "--json", "part.json")
    said = capsys.readouterr().out
    figures = json.loads(Path("part.json").read_text())
    for name in ("porosity", "weak_places", "loose_parts", "cavities", "watertight", "crossings"):
        assert name in said
    assert figures["weak_places_before"] > 0 == figures["weak_places_after"]
    assert figures["watertight"]
    assert abs(figures["volume_error_percent"]) < 5
    assert figures["unit"] == "µm"
    assert figures["porosity_after"] < figures["porosity_before"]


def test_a_report_shows_before_and_after(folder: Path) -> None:
    run("mesh", "gray.tif", "-o", "part.stl", "--smooth", 5, "--report", "out")
    page = Path("out/report.html").read_text(encoding="utf-8")
    assert page.count("<img") == 2
    assert "poresynth mesh gray.tif -o part.stl --smooth 5" in page
    found = json.loads(Path("out/report.json").read_text())
    assert found["configuration"] == {"smooth": 5}
    assert found["crossings"] == 0


def test_a_body_is_filled_under_a_shell_where_it_was(folder: Path) -> None:
    meshes.write("hare.stl", figure(20.0, resolution=48))
    from poresynth.shapes import read_domain

    domain = read_domain("hare.stl", voxel_size=0.5, unit="mm", body_unit="mm")
    foam = spinodal(domain.mask.shape, porosity=0.7, wavelength=8, seed=1)
    io.write("foam.npz", Volume(foam.array, 0.5, "mm"))
    run(
        "mesh", "foam.npz", "-o", "out.stl", "--mask", "hare.stl", "--mask-unit", "mm", "--shell", 1
    )
    part, body = meshes.read("out.stl"), meshes.read("hare.stl")
    np.testing.assert_allclose(part.bounds, body.bounds, atol=0.3)
    assert check(part).printable
    assert 0.3 < check(part).volume / check(body).volume < 0.9


def test_the_pore_for_a_flow_solver(folder: Path) -> None:
    run(
        *("mesh", "gray.tif", "-o", "pore.stl", "--phase", "pore"),
        *("--flow", "x", "--output-unit", "m"),
    )
    text = Path("pore.stl").read_text()
    for name in ("walls", "inlet", "outlet", "sides"):
        assert f"solid {name}\n" in text
        assert f"endsolid {name}\n" in text
    whole = check(meshes.read("pore.stl"))
    assert whole.printable
    assert whole.size == pytest.approx((1.2e-3, 1.3e-3, 1.4e-3), rel=1e-5)


def test_hexahedra(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run("mesh", "gray.tif", "-o", "part.inp", "--keep", "all", "--json", "part.json")
    porosity = json.loads(Path("part.json").read_text())["porosity_after"]
    elements = round((1 - porosity) * 28 * 26 * 24)
    assert f"part.inp: {elements} elements" in capsys.readouterr().out
    assert "lengths in mm" in Path("part.inp").read_text()[:100]


def test_without_a_scale_lengths_are_voxels(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    io.write("plain.npy", spinodal((16, 16, 16), wavelength=8).array)
    run("mesh", "plain.npy", "-o", "part.stl")
    assert "the size of a voxel is unknown" in capsys.readouterr().err
    assert check(meshes.read("part.stl")).size == pytest.approx((16, 16, 16))


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["-o", "part.step"], "part.step: unknown suffix '.step'; known are .stl, .3mf"),
        (["-o", "none/part.stl"], "the folder"),
        (["-o", "part.inp", "--smooth", 3], "smooth = 3: is for surfaces"),
        (["-o", "part.inp", "--decimate", 3], "decimate = 3.0: is for surfaces"),
        (["-o", "part.stl", "--flow", "z"], "flow = z: needs the phase pore"),
        (["-o", "p.ply", "--flow", "z", "--phase", "pore"], "flow = z: needs the phase pore"),
        (["-o", "part.stl", "--min-thickness", 60], "must be at least two voxels, 100 µm"),
        (["-o", "part.stl", "--shell", 1], "shell = 1.0: must be at least half a voxel"),
        (["-o", "part.stl", "--threshold", 300], "threshold = 300.0: must be at least"),
        (
            ["-o", "part.stl", "--mask", "gray.tif", "--mask-unit", "mm", "--min-thickness", -1],
            "min",
        ),
        (["-o", "part.stl", "--mask", "none.stl"], "none.stl: no such file"),
        (["-o", "part.stl", "--mask", "small.npy"], "small.npy: has 3 × 3 × 3 voxels"),
        (["-o", "part.stl", "--mask", "open.stl", "--mask-unit", "mm"], "open edges"),
        (["-o", "part.stl", "--mask", "hare.stl"], "the file does not say its unit"),
    ],
)
def test_what_is_refused(
    arguments: list[object], says: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    hare = figure(20.0, resolution=24)
    meshes.write("hare.stl", hare)
    kept = (hare.vertices[hare.faces][..., 2] < 18).all(axis=1)
    meshes.write("open.stl", meshes.Mesh(hare.vertices, hare.faces[kept]))
    io.write("small.npy", np.ones((3, 3, 3), np.uint8))
    assert says in refused(capsys, "mesh", "gray.tif", *arguments)


def test_help_has_examples(capsys: pytest.CaptureFixture[str]) -> None:
    run("mesh", "--help")
    said = capsys.readouterr().out
    assert "poresynth mesh bone.tif -o bone.stl" in said
    for option in ("--min-thickness", "--shell", "--mask-unit", "--decimate", "--flow", "--json"):
        assert option in said
