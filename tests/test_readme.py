"""README.md: its commands and code run, on sizes that take seconds."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Any

import pytest

import poresynth
from poresynth import config, io, meshes, metrics, shapes
from poresynth.cli import main
from poresynth.exemplars import foam, spinodal
from poresynth.io.registry import formats
from poresynth.volume import Volume

ROOT = Path(__file__).parent.parent
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")

# The smallest volume that the default preset takes: a window of 10 voxels at three levels.
EDGE = 44


def blocks(language: str) -> list[str]:
    found = re.findall(rf"^```{language}\n(.*?)^```", TEXT, re.DOTALL | re.MULTILINE)
    assert found or language == ""
    return found


def small(code: str) -> str:
    """The same code for a volume of `EDGE` voxels."""
    shapes = re.compile(r"\b(?:200|128)(,? )(?:200|128)\1(?:200|128)\b")
    return shapes.sub(rf"{EDGE}\g<1>{EDGE}\g<1>{EDGE}", code).replace("0:64", "0:20")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("readme")
    io.write(path / "bone.tif", spinodal((EDGE, EDGE, EDGE), porosity=0.7, wavelength=12, seed=1))
    return path


def test_it_opens_with_two_commands() -> None:
    assert blocks("")[0] == "make demo\nmake test\n"
    assert TEXT.index("```") < 20


def test_make_knows_every_target() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    contributing = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    targets = set(re.findall(r"\bmake ([a-z][a-z-]*)$", TEXT + contributing, re.MULTILINE))
    targets |= set(re.findall(r"`make ([a-z-]+)`", TEXT + contributing))
    assert targets >= {"demo", "test", "bench", "lint"}
    for target in targets:
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target


def run_commands(code: str, capsys: pytest.CaptureFixture[str]) -> None:
    for line in small(code).splitlines():
        words = shlex.split(line, comments=True)
        if words:
            assert words[0] == "poresynth"
            assert main(words[1:]) == 0, f"{line}\n{capsys.readouterr().err}"


def test_the_commands_for_images_run(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    run_commands(TEXT.split("### From images")[1].split("```bash")[1].split("```")[0], capsys)
    assert io.read("solid.tif").shape == io.read("directed.tif").shape == (EDGE, EDGE, EDGE)


@pytest.fixture(scope="module")
def workshop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A foam, a bone, a volume of each, and a body that is filled."""
    path = tmp_path_factory.mktemp("workshop")
    material = foam((EDGE, EDGE, EDGE), cell=16, seed=1)
    for name in ("foam.tif", "bone.tif", "new.tif"):
        io.write(path / name, Volume(material.array, 0.6, "mm"))
    for name in ("body.stl", "hare.stl"):
        meshes.write(path / name, shapes.figure(40.0, resolution=60))
    return path


@pytest.mark.parametrize("page", ["README.md", "docs/pruning.md", "docs/shapes_and_gradation.md"])
def test_the_commands_for_parts_run(
    page: str, workshop: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(workshop)
    text = (ROOT / page).read_text(encoding="utf-8")
    text = text.split("### A part to print")[-1]
    run_commands(text.split("```bash")[1].split("```")[0].replace("\\\n", " "), capsys)
    if page != "docs/pruning.md":
        assert meshes.check(meshes.read(workshop / "part.stl", unit="mm")).watertight


def test_the_commands_for_models_run(
    workshop: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(workshop)
    code = TEXT.split("### Trained generators")[1].split("```bash")[1].split("```")[0]
    quick = "--preset tiny --set iterations=3 evaluate_every=3"
    assert "--preset tiny" in code
    run_commands(code.replace("--preset tiny", quick), capsys)
    assert io.read("large.tif").shape == (EDGE, EDGE, EDGE)


def test_the_code_for_gradation_runs(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    page = (ROOT / "docs" / "shapes_and_gradation.md").read_text(encoding="utf-8")
    code = small(page.split("```python")[1].split("```")[0]).replace("7800", str(39 * EDGE))
    found: dict[str, Any] = {"poresynth": poresynth}
    exec(code, found)
    solid = found["graded"].array > found["engine"].threshold_
    assert solid[: EDGE // 2].mean() > solid[EDGE // 2 :].mean() + 0.05


def test_the_commands_run(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    run_commands(blocks("bash")[0], capsys)
    for name in ("new.tif", "tile.tif", "again.tif", "figures.json", "out/report.html"):
        assert Path(name).exists(), name


@pytest.mark.parametrize("code", blocks("python"))
def test_the_python_code_runs(code: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    exec(compile(small(code), "README.md", "exec"), {})


@pytest.mark.parametrize("text", blocks("toml"))
def test_the_configuration_is_one(text: str, tmp_path: Path) -> None:
    path = tmp_path / "run.toml"
    path.write_text(text)
    run = config.validate(config.load(path))
    assert run.shape == (200, 200, 200)


def test_the_formats_are_those_of_the_registry() -> None:
    table = TEXT.split("## Files")[1].split("##")[0]
    for format_ in formats():
        name = format_.name.removeprefix("a ")
        row = next(line for line in table.splitlines() if name in line)
        assert (format_.extra or "") in row


def test_the_metrics_that_are_listed_exist() -> None:
    table = TEXT.split("## Measuring a volume")[1].split("```")[0]
    names = re.findall(r"`(\w+)`", table)
    assert len(names) > 20
    assert [name for name in names if not hasattr(metrics, name)] == []


def test_the_tables_have_their_places() -> None:
    for name in ("bench", "results", "exemplars"):
        assert TEXT.index(f"<!-- {name}:begin -->") < TEXT.index(f"<!-- {name}:end -->")


def test_what_it_links_to_is_there() -> None:
    links = re.findall(r"\]\((?!https?:)([^)#]+)\)", TEXT)
    assert len(links) >= 3
    assert [link for link in links if not (ROOT / link).exists()] == []
