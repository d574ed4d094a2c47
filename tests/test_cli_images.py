"""The command line with exemplars that are images, of which a stand-in makes volumes."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image

import poresynth
from poresynth import io, report
from poresynth.cli import main
from poresynth.comparison.result import Figure
from poresynth.engines import ENGINES
from poresynth.engines.base import SynthesizedVolume
from poresynth.volume import Volume, as_volume

RANDOM = np.random.default_rng(0)
FIRST, SECOND, THIRD = RANDOM.integers(0, 255, (3, 24, 30)).astype(np.uint8)
SHAPE = ["--shape", "8", "9", "10"]
SOLID = ["-o", "new.tif", "--engine", "solid", *SHAPE]


class StandIn:
    """Takes images as the engine solid does; its voxels are drawn from those of the last."""

    fitted: Any = None

    def __init__(self, *, axes: list[str] | None = None, threshold: float | None = None) -> None:
        self.axes, self.threshold = axes, threshold

    def fit(self, exemplar: Any) -> StandIn:
        StandIn.fitted = exemplar
        self.several = isinstance(exemplar, list)
        self.images = [as_volume(image) for image in exemplar] if self.several else [exemplar]
        return self

    def estimate_memory(self, shape: tuple[int, int, int]) -> int:
        return int(np.prod(shape))

    def sample(self, shape: tuple[int, int, int], *, seed: int, **options: Any) -> Volume:
        pixels = self.images[-1].array.reshape(-1, *self.images[-1].array.shape[3:])
        chosen = np.random.default_rng(seed).integers(0, len(pixels), shape)
        learned = [{"threshold": 99.0 + i, "solid": "bright"} for i in range(len(self.images))]
        origin = {
            "parameters": {"axes": self.axes},
            "mode_reason": "phases, which the images have",
            "exemplar": learned if self.several else learned[0],
        }
        return SynthesizedVolume(pixels[chosen], metadata={"poresynth": origin})


@pytest.fixture(autouse=True)
def engine(monkeypatch: pytest.MonkeyPatch) -> None:
    stand_in = replace(ENGINES["solid"], module=__name__, attribute="StandIn")
    monkeypatch.setitem(ENGINES, "solid", stand_in)


@pytest.fixture(autouse=True)
def compared(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    """What was asked of `compare`, which finds a figure."""
    calls: list[dict[str, Any]] = []

    def compare(exemplar: Any, volume: Any, **options: Any) -> SimpleNamespace:
        calls.append({"exemplar": exemplar, **options})
        figure = Figure("section_error", 4.5, 0.0, 0.0, 6.0, "pass", "%")
        return SimpleNamespace(figures={"section_error": figure})

    monkeypatch.setattr(poresynth, "compare", compare)
    return calls


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    for name, array in (("a", FIRST), ("b", SECOND), ("c", THIRD)):
        Image.fromarray(array).save(f"{name}.png")
    np.save("volume.npy", RANDOM.integers(0, 255, (12, 13, 14)).astype(np.uint8))
    return tmp_path


def run(*arguments: object) -> None:
    assert main([str(a) for a in arguments]) == 0


def refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    capsys.readouterr()
    assert main([str(a) for a in arguments]) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    return said[0].removeprefix("poresynth: error: ")


def saved() -> dict[str, Any]:
    document: dict[str, Any] = json.loads(Path("new.tif.json").read_text())["poresynth"]
    return document


# What is made and said


def test_a_volume_of_one_image(
    capsys: pytest.CaptureFixture[str], compared: list[dict[str, Any]]
) -> None:
    run("synthesize", "a.png", *SOLID)
    assert io.read("new.tif").shape == (8, 9, 10)
    np.testing.assert_array_equal(StandIn.fitted.array, FIRST[np.newaxis])
    out = capsys.readouterr().out
    assert "synthesised: phases, which the images have" in out
    assert "section_error" in out
    assert "novelty" not in out
    assert compared[0]["exemplar"] is StandIn.fitted
    assert (compared[0]["threshold"], compared[0]["solid"]) == (99.0, "bright")
    assert saved()["configuration"]["exemplar"] == "a.png"
    assert isinstance(saved()["configuration"]["exemplar_sha256"], str)


def test_a_volume_of_three_images(
    capsys: pytest.CaptureFixture[str], compared: list[dict[str, Any]]
) -> None:
    run("synthesize", "a.png", "b.png", "c.png", *SOLID, "--axes", "x", "z", "y")
    for volume, array in zip(StandIn.fitted, (FIRST, SECOND, THIRD), strict=True):
        np.testing.assert_array_equal(volume.array, array[np.newaxis])
    configuration = saved()["configuration"]
    assert configuration["exemplar"] == ["a.png", "b.png", "c.png"]
    assert len(set(configuration["exemplar_sha256"])) == 3
    assert configuration["parameters"] == {"axes": ["x", "z", "y"]}
    assert "section_error" in capsys.readouterr().out
    assert compared[0]["exemplar"] == dict(zip("xzy", StandIn.fitted, strict=True))
    assert compared[0]["threshold"] == 99.0


def test_only_the_planes_that_an_image_stands_for_are_compared(
    compared: list[dict[str, Any]],
) -> None:
    run("synthesize", "a.png", *SOLID, "--axes", "y")
    assert compared[0]["exemplar"] == {"y": StandIn.fitted}
    run("synthesize", "a.png", *SOLID, "--axes", "y", "x", "z")
    assert compared[1]["exemplar"] is StandIn.fitted


def test_several_images_without_axes_are_compared_in_the_order_of_axes(
    compared: list[dict[str, Any]],
) -> None:
    run("synthesize", "a.png", "b.png", *SOLID)
    assert compared[0]["exemplar"] == dict(zip("zy", StandIn.fitted, strict=True))


@pytest.mark.parametrize("several", [False, True])
def test_the_report_gets_what_was_compared(
    several: bool, monkeypatch: pytest.MonkeyPatch, compared: list[dict[str, Any]]
) -> None:
    calls: list[Any] = []

    def write_report(directory: Path, exemplar: Any, *rest: Any, **options: Any) -> Path:
        calls.append((exemplar, options["configuration"]["exemplar"]))
        return directory / "report.html"

    monkeypatch.setattr(report, "write_report", write_report)
    names = ["a.png", "b.png"][: 1 + several]
    run("synthesize", *names, *SOLID, "--report", "out")
    assert calls == [(compared[0]["exemplar"], names if several else "a.png")]
    assert isinstance(calls[0][0], Mapping) == several


# Repetition


@pytest.mark.parametrize("axes", [[], ["--axes", "z", "x"]])
def test_a_run_of_several_images_repeats_itself(axes: list[str]) -> None:
    run("synthesize", "a.png", "b.png", *SOLID, "--seed", 3, *axes)
    new = io.read("new.tif").array
    run("synthesize", "-o", "again.tif", "--config", "new.tif.json")
    np.testing.assert_array_equal(io.read("again.tif").array, new)
    assert len(StandIn.fitted) == 2
    program, *arguments = shlex.split(saved()["command"])
    assert program == "poresynth"
    Path("new.tif").unlink()
    run(*arguments)
    np.testing.assert_array_equal(io.read("new.tif").array, new)
    parameters = saved()["configuration"].get("parameters")
    assert parameters == ({"axes": ["z", "x"]} if axes else None)


def test_the_image_that_changed_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    run("synthesize", "a.png", "b.png", *SOLID)
    Image.fromarray(THIRD).save("b.png")
    repeat = ["synthesize", "-o", "again.tif", "--config", "new.tif.json"]
    assert refused(capsys, *repeat).startswith("exemplar = b.png: is not the one of the saved run")
    run(*repeat[:1], "a.png", "b.png", *repeat[1:])


def test_as_many_hashes_as_images(capsys: pytest.CaptureFixture[str]) -> None:
    run("synthesize", "a.png", "b.png", *SOLID)
    document = json.loads(Path("new.tif.json").read_text())
    document["poresynth"]["configuration"]["exemplar"].append("c.png")
    Path("more.json").write_text(json.dumps(document))
    said = refused(capsys, "synthesize", "-o", "again.tif", "--config", "more.json")
    assert said == "exemplar_sha256 = 2 hashes: must be as many as exemplars, 3"


def test_a_configuration_lists_images() -> None:
    Path("run.toml").write_text(
        'exemplar = ["a.png", "b.png"]\nshape = [8, 9, 10]\nengine = "solid"\n'
        '[parameters]\naxes = ["z", "x"]\n'
    )
    run("synthesize", "-o", "new.tif", "--config", "run.toml")
    assert len(StandIn.fitted) == 2
    run("synthesize", "c.png", "-o", "new.tif", "--config", "run.toml", "--axes", "z")
    np.testing.assert_array_equal(StandIn.fitted.array, THIRD[np.newaxis])


# What an image is


def test_an_image_is_cropped_and_reduced_in_its_plane() -> None:
    crop = ["--crop", ":", "4:20", "6:", "--downsample", 2]
    run("synthesize", "a.png", "b.png", *SOLID, *crop)
    blocks = FIRST[4:20, 6:].reshape(8, 2, 12, 2).mean(axis=(1, 3))
    np.testing.assert_array_equal(StandIn.fitted[0].array[0], np.rint(blocks))
    assert [image.shape for image in StandIn.fitted] == [(1, 8, 12)] * 2


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_slice_of_a_volume_is_an_image(axis: int) -> None:
    crop = [":", ":", ":"]
    crop[axis] = "5:6"
    run("synthesize", "volume.npy", *SOLID, "--crop", *crop)
    wanted = np.load("volume.npy").take(5, axis=axis)
    np.testing.assert_array_equal(StandIn.fitted.array[0], wanted)


@pytest.mark.parametrize("channels", [2, 3, 4])
def test_a_plain_array_may_have_channels(channels: int) -> None:
    colours = RANDOM.integers(0, 255, (20, 22, channels)).astype(np.uint8)
    np.save("colours.npy", colours)
    run("synthesize", "colours.npy", *SOLID, "--crop", ":", "4:", ":9")
    np.testing.assert_array_equal(StandIn.fitted.array, colours[np.newaxis, 4:, :9])


def test_palettes_and_plain_arrays() -> None:
    picture = Image.fromarray(FIRST // 128).convert("P")
    picture.putpalette([255, 0, 0, 0, 0, 255])
    wanted = np.array([[255, 0, 0], [0, 0, 255]], np.uint8)[FIRST // 128]
    for name in ("palette.png", "palette.tif"):
        picture.save(name)
        run("synthesize", name, *SOLID)
        np.testing.assert_array_equal(StandIn.fitted.array[0], wanted)
    assert io.read("new.tif").channels == 3
    np.save("plain.npy", FIRST)
    run("synthesize", "plain.npy", *SOLID)
    np.testing.assert_array_equal(StandIn.fitted.array[0], FIRST)


# Bad input


def test_as_many_exemplars_as_the_engine_takes(capsys: pytest.CaptureFixture[str]) -> None:
    said = refused(capsys, "synthesize", "volume.npy", "a.png", "-o", "new.tif", *SHAPE)
    assert said == (
        "exemplar = volume.npy, a.png: are 2, but the engine volume learns from one volume; "
        "for images take --engine solid"
    )
    said = refused(capsys, "synthesize", "a.png", "b.png", "c.png", "a.png", *SOLID)
    assert said.endswith(": are 4, but the engine solid learns from 1 to 3 images")


def test_the_right_engine_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    said = refused(capsys, "synthesize", "a.png", "-o", "new.tif", *SHAPE)
    assert said == (
        "exemplar = a.png: is an image, but the engine volume learns from a volume; "
        "take --engine solid"
    )
    said = refused(capsys, "synthesize", "a.png", "volume.npy", *SOLID)
    assert said == (
        "exemplar = volume.npy: is a volume of 12 × 13 × 14 voxels, but the engine solid learns "
        "from images; take --engine volume, or a slice, such as --crop 6:7 : :"
    )


def test_axes_are_of_the_engine_solid(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["synthesize", "volume.npy", "-o", "new.tif", *SHAPE, "--axes"]
    said = refused(capsys, *words, "z", "y")
    assert said.startswith("axes = ['z', 'y']: is no parameter of the engine volume; known are")
    assert "--axes" in refused(capsys, *words, "q")
    assert "--axes" in refused(capsys, *words)
    assert "--axes" in refused(capsys, *words, *"zyxz")


def test_images_of_other_channels(capsys: pytest.CaptureFixture[str]) -> None:
    Image.fromarray(np.stack([FIRST, SECOND, THIRD], axis=2)).save("colour.png")
    said = refused(capsys, "synthesize", "a.png", "colour.png", *SOLID)
    assert said == "exemplar = a.png, colour.png: must have the same number of channels, not 1, 3"


@pytest.mark.parametrize("name", ["alpha.png", "alpha.tif"])
def test_alpha(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    Image.fromarray(FIRST).convert("RGBA").save(name)
    said = refused(capsys, "synthesize", "a.png", name, *SOLID)
    assert said.startswith(f"{name}: has transparency (an alpha channel)")


def test_an_image_that_is_missing(capsys: pytest.CaptureFixture[str]) -> None:
    said = refused(capsys, "synthesize", "a.png", "missing.png", *SOLID)
    assert said == "missing.png: no such file or folder"


# Slices of volumes, for those who have a volume and want to start from images


@pytest.mark.parametrize("name", ["slice.png", "slice.tif", "slice.npy"])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_crop_cuts_an_image_out_of_a_volume(axis: int, name: str) -> None:
    crop = [":", ":", ":"]
    crop[axis] = "5:6"
    run("crop", "volume.npy", *crop, "-o", name, "--voxel-size", 3, 2, 1, "--unit", "µm")
    image = io.read(name)
    np.testing.assert_array_equal(image.array[0], np.load("volume.npy").take(5, axis=axis))
    assert image.voxel_size == [(3, 2, 1), (2, 3, 1), (1, 3, 2)][axis]


def test_a_thick_part_is_no_png(capsys: pytest.CaptureFixture[str]) -> None:
    said = refused(capsys, "crop", "volume.npy", "5:7", ":", ":", "-o", "part.png")
    assert "PNG holds an image" in said
