"""The command line: what it makes, what it says, and what it leaves behind when it fails."""

from __future__ import annotations

import errno
import json
import os
import shlex
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import tifffile

import poresynth
from poresynth import io
from poresynth.cli import main
from poresynth.exemplars import spinodal
from poresynth.io import atomic
from poresynth.volume import Volume

# The smallest run that still has two levels.
SMALL = ["--set", "levels=2", "windows=[4]", "iterations=2", "block=4"]
SHAPE = ["--shape", "20", "18", "16"]


@pytest.fixture(scope="module")
def example(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("example") / "example.tif"
    gray = spinodal((24, 24, 24), porosity=0.6, wavelength=8, seed=3)
    io.write(path, Volume(gray.array, 39.0, "µm"))
    return path


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(*arguments: object) -> None:
    assert main([str(a) for a in arguments]) == 0


def synthesize(example: Path, *arguments: object, shape: Sequence[str] = SHAPE) -> np.ndarray:
    """Run a small synthesis and return its voxels."""
    run("synthesize", example, "-o", "new.tif", *shape, *SMALL, *arguments)
    return io.read("new.tif").array


def refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """Return the one line that says why a command was refused; nothing new may lie about."""
    before = sorted(Path().rglob("*"))
    assert main([str(a) for a in arguments]) == 2
    said = capsys.readouterr()
    lines = [line for line in said.err.splitlines() if "error" in line or "Traceback" in line]
    assert len(lines) == 1, said.err
    assert lines[0].startswith("poresynth: error: ")
    assert said.err.splitlines()[-1] == lines[0]
    assert sorted(Path().rglob("*")) == before
    return lines[0].removeprefix("poresynth: error: ")


# What it says of itself


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    run("--version")
    assert capsys.readouterr().out.strip() == poresynth.__version__


def test_help_lists_the_commands(capsys: pytest.CaptureFixture[str]) -> None:
    run("--help")
    out = capsys.readouterr().out
    for command in ("synthesize", "compare", "measure", "crop", "downsample", "threshold", "demo"):
        assert command in out


@pytest.mark.parametrize(
    "command",
    ["synthesize", "compare", "measure", "prune", "crop", "downsample", "threshold", "demo"],
)
def test_help_of_a_command_has_an_example(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    run(command, "--help")
    assert f"poresynth {command}" in capsys.readouterr().out.split("Parameters")[0]


def test_it_is_a_module_too() -> None:
    command = [sys.executable, "-m", "poresynth", "--version"]
    said = subprocess.run(command, check=True, capture_output=True, text=True)
    assert said.stdout.strip() == poresynth.__version__


# Synthesis


def test_synthesize_writes_a_volume_and_all_that_made_it(example: Path, folder: Path) -> None:
    new = synthesize(example, "--seed", 5)
    assert new.shape == (20, 18, 16)
    volume = io.read("new.tif")
    assert (volume.voxel_size, volume.unit) == ((39.0, 39.0, 39.0), "µm")
    origin = json.loads(Path("new.tif.json").read_text())["poresynth"]
    assert origin["seed"] == 5
    assert origin["version"] == poresynth.__version__
    assert len(origin["exemplar"]["sha256"]) == 64
    assert origin["configuration"]["parameters"]["windows"] == [4]


def test_it_says_what_was_synthesised_and_why(
    example: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for settings, field in (((), "distance, which explains"), (["--preset", "paper"], "intensity")):
        synthesize(example, *settings, "--set", "search=coherent")
        origin = json.loads(Path("new.tif.json").read_text())["poresynth"]
        assert origin["field_reason"].startswith(field)
        assert field.startswith(origin["field"])
        assert f"synthesised: {origin['field_reason']}" in capsys.readouterr().out


def test_a_result_repeats_itself(example: Path, folder: Path) -> None:
    new = synthesize(example, "--seed", 5, "--periodic", "--porosity", 0.5)
    run("synthesize", "-o", "again.tif", "--config", "new.tif.json", "--threads", 1)
    np.testing.assert_array_equal(io.read("again.tif").array, new)


def test_the_command_in_a_result_repeats_it(example: Path, folder: Path) -> None:
    new = synthesize(example, "--seed", 5, "--preset", "fast", "--crop", "2:22", ":", ":20")
    origin = json.loads(Path("new.tif.json").read_text())["poresynth"]
    program, *arguments = shlex.split(origin["command"])
    assert program == "poresynth"
    Path("new.tif").unlink()
    run(*arguments)
    np.testing.assert_array_equal(io.read("new.tif").array, new)


def test_another_exemplar_is_not_a_repetition(
    example: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mine = folder / "mine.tif"
    io.write(mine, io.read(example))
    synthesize(mine)
    changed = io.read(example).array.copy()
    changed[0, 0, 0] ^= 1
    io.write(mine, changed)
    repeat = ["synthesize", "-o", "again.tif", "--config", "new.tif.json"]
    assert "sha256" in refused(capsys, *repeat)
    run(*repeat[:1], mine, *repeat[1:])


def test_another_version_is_mentioned(
    example: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    synthesize(example)
    sidecar = Path("new.tif.json")
    document = json.loads(sidecar.read_text())
    document["poresynth"]["configuration"]["version"] = "0.0.1"
    Path("old.json").write_text(json.dumps(document))
    capsys.readouterr()
    run("synthesize", "-o", "again.tif", "--config", sidecar)
    assert "saved by version" not in capsys.readouterr().err
    run("synthesize", "-o", "again.tif", "--config", "old.json")
    assert "saved by version 0.0.1" in capsys.readouterr().err


def test_settings_may_follow_one_another_or_be_repeated(example: Path, folder: Path) -> None:
    together = synthesize(example)
    words = [word for setting in SMALL[1:] for word in ("--set", setting)]
    run("synthesize", example, "-o", "other.tif", *SHAPE, *words)
    np.testing.assert_array_equal(io.read("other.tif").array, together)


def test_the_command_line_wins_over_the_file(example: Path, folder: Path) -> None:
    Path("run.toml").write_text(
        f'exemplar = "{example}"\nshape = [20, 18, 16]\nseed = 1\nboundary = "periodic"\n'
        "[parameters]\nlevels = 2\nwindows = [4]\niterations = 2\nblock = 4\n"
    )
    run("synthesize", "-o", "one.tif", "--config", "run.toml")
    run("synthesize", "-o", "two.tif", "--config", "run.toml", "--seed", 2)
    one, two = io.read("one.tif").array, io.read("two.tif").array
    assert not np.array_equal(one, two)
    np.testing.assert_array_equal(synthesize(example, "--seed", 1, "--periodic"), one)
    np.testing.assert_array_equal(synthesize(example, "--seed", 2, "--periodic"), two)
    run("synthesize", "-o", "open.tif", "--config", "run.toml", "--open")
    np.testing.assert_array_equal(synthesize(example, "--seed", 1), io.read("open.tif").array)


def test_known_voxels_stay(example: Path, folder: Path) -> None:
    known = np.zeros((20, 18, 16), dtype=np.uint8)
    known[:, :, :6] = io.read(example).array[:20, :18, :6]
    where = np.zeros(known.shape, dtype=bool)
    where[:, :, :6] = True
    io.write("known.tif", known)
    io.write("where.tif", where)
    new = synthesize(example, "--known", "known.tif", "--known-mask", "where.tif")
    np.testing.assert_array_equal(new[where], known[where])


def test_outside_the_mask_nothing_is_made(example: Path, folder: Path) -> None:
    mask = np.zeros((20, 18, 16), dtype=bool)
    mask[2:18, 2:17, 1:15] = True
    io.write("mask.npy", mask)
    new = synthesize(example, "--mask", "mask.npy")
    assert len(np.unique(new[~mask])) == 1
    # The mask says the shape.
    np.testing.assert_array_equal(synthesize(example, "--mask", "mask.npy", shape=[]), new)


def test_the_exemplar_is_cropped_and_reduced_as_it_is_read(example: Path, folder: Path) -> None:
    options = ["--crop", "0:24", ":", "2:", "--downsample", "2"]
    run("synthesize", example, "-o", "new.npy", *SHAPE, *SMALL, *options)
    origin = json.loads(Path("new.npy.json").read_text())["poresynth"]
    assert origin["exemplar"]["shape"] == [12, 12, 11]


def test_headerless_files(example: Path, folder: Path) -> None:
    array = io.read(example).array
    Path("scan.raw").write_bytes(b"head" + array.astype(">u2").tobytes())
    raw = ["--raw-shape", *array.shape, "--raw-dtype", "uint16"]
    raw += ["--raw-byte-order", "big", "--raw-offset", 4, "--voxel-size", 2, 1, 1, "--unit", "mm"]
    run("crop", "scan.raw", ":", "1:3", ":", "-o", "part.tif", *raw)
    part = io.read("part.tif")
    np.testing.assert_array_equal(part.array, array[:, 1:3])
    assert (part.voxel_size, part.unit) == ((2.0, 1.0, 1.0), "mm")


def test_a_run_with_a_report(
    example: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    synthesize(example, "--report", "out")
    out = capsys.readouterr().out
    assert "porosity" in out
    assert "out/report.html" in out
    report = json.loads(Path("out/report.json").read_text())
    assert report["configuration"]["exemplar"] == str(example)
    assert report["command"].startswith("poresynth synthesize")
    assert "of the grays" in Path("out/report.html").read_text(encoding="utf-8")
    assert len(report["energy"]) > 1
    assert report["porosity_error_percent"] < 0.1


def test_without_a_terminal_progress_is_plain_lines(
    example: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    synthesize(example)
    lines = capsys.readouterr().err.splitlines()
    assert "of memory" in lines[0]
    assert any("100 %" in line for line in lines)
    assert all(line.startswith("poresynth: ") for line in lines)


# The other commands


def test_compare(example: Path, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run("compare", example, example, "--json", "figures.json", "--report", "out")
    assert "porosity" in capsys.readouterr().out
    figures = json.loads(Path("figures.json").read_text())
    assert figures["porosity_error_percent"] == 0
    assert figures["two_point_error_percent"] == pytest.approx(0, abs=1e-6)
    assert Path("out/report.html").exists()


def test_measure(example: Path, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run("measure", example, "--json", "figures.json")
    assert "porosity" in capsys.readouterr().out
    figures = json.loads(Path("figures.json").read_text())
    assert figures["porosity"] == pytest.approx(0.6, abs=0.05)
    assert figures["components"] >= 1


def test_crop(example: Path, folder: Path) -> None:
    run("crop", example, "2:5", ":", "20:", "-o", "part.npy")
    part = io.read("part.npy")
    np.testing.assert_array_equal(part.array, io.read(example).array[2:5, :, 20:])
    assert part.unit == "µm"


def test_downsample(example: Path, folder: Path) -> None:
    run("downsample", example, 2, "-o", "half.tif")
    half = io.read("half.tif")
    assert half.shape == (12, 12, 12)
    assert half.voxel_size == (78.0, 78.0, 78.0)


def test_threshold(example: Path, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run("threshold", example, "--value", 100, "-o", "solid.tif")
    np.testing.assert_array_equal(io.read("solid.tif").array != 0, io.read(example).array > 100)
    assert "threshold: 100" in capsys.readouterr().out
    run("threshold", example, "--value", 100, "--solid", "dark", "-o", "dark.tif")
    assert "porosity" in capsys.readouterr().out
    np.testing.assert_array_equal(io.read("dark.tif").array != 0, io.read(example).array <= 100)


# Bad input: exit code 2, one line, nothing left behind

SYNTHESIZE = ["synthesize", "example.npy", "-o", "new.tif", *SHAPE, *SMALL]


def noise(*shape: int, dtype: str = "uint8") -> np.ndarray:
    return np.random.default_rng(0).integers(0, 255, shape).astype(dtype)


def with_value(value: float) -> np.ndarray:
    array = noise(12, 12, 12, dtype="float32")
    array[3, 4, 5] = value
    return array


@pytest.mark.parametrize(
    ("array", "says"),
    [
        (with_value(np.nan), "NaN"),
        (with_value(np.inf), "finite"),
        (with_value(-np.inf), "finite"),
        (np.full((12, 12, 12), 7), "constant"),
        (np.zeros((0, 12, 12)), "no voxels"),
        (noise(12), "1"),
        (noise(12, 12, 12)[:, :, :6], "8"),
        (noise(12, 12, 12).astype("complex64"), "complex64"),
    ],
    ids=["NaN", "inf", "-inf", "constant", "empty", "1D", "small", "complex"],
)
def test_bad_exemplars(
    array: np.ndarray, says: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    np.save("example.npy", array)
    assert says in refused(capsys, *SYNTHESIZE)


@pytest.mark.parametrize(
    ("shape", "says"),
    [
        (("-20", "18", "16"), "shape"),
        (("0", "18", "16"), "shape"),
        (("20", "18"), "--shape"),
        (("20", "18", "x"), "--shape"),
        (("20", "18", "5"), "at least 8"),
        (("100000", "100000", "100000"), "memory"),
        (("9" * 30, "9" * 30, "9" * 30), "shape"),
    ],
)
def test_bad_shapes(
    shape: tuple[str, ...],
    says: str,
    example: Path,
    folder: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    words = ["synthesize", example, "-o", "new.tif", "--shape", *shape, *SMALL]
    assert says in refused(capsys, *words)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--set", "level=3"], "did you mean levels"),
        (["--set", "input.downsampel=3"], "did you mean input.downsample"),
        (["--set", "levels"], "key=value"),
        (["--set", "levels=[0.5"], "levels"),
        (["--preset", "best"], "preset"),
        (["--engine", "volum"], "engine"),
        (["--porosity", "1.5"], "porosity"),
        (["--seed", "-1"], "seed"),
        (["--solid", "white"], "--solid"),
        (["--downsample", "0"], "downsample"),
        (["--downsample", "20"], "exemplar"),
        (["--crop", "5:2", ":", ":"], "crop z"),
        (["--crop", ":", "0:99", ":"], "within 0:24"),
        (["--crop", ":", ":", "a:b"], "crop x"),
        (["--threads", "-2"], "threads"),
        (["--known", "example.npy"], "known"),
        (["--mask", "missing.tif"], "missing.tif"),
        (["--config", "missing.toml"], "missing.toml"),
        (["--raw-dtype", "uint8"], "dtype"),
        (["--sed", "1"], "--seed"),
        (["surplus.tif"], "surplus.tif"),
    ],
)
def test_bad_options(
    words: list[str], says: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    np.save("example.npy", spinodal((24, 24, 24), wavelength=8, seed=3).array)
    assert says in refused(capsys, *SYNTHESIZE, *words)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("sed = 1", "did you mean seed"),
        ("seed = 'one'", "seed"),
        ("seed = ", "not a configuration"),
        ("[input]\nvoxelsize = 1", "did you mean input.voxel_size"),
        ("[parameters]\nwindow = 3", "did you mean windows"),
    ],
)
def test_bad_configurations(
    text: str, says: str, example: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("run.toml").write_text(text)
    words = ["synthesize", example, "-o", "new.tif", *SHAPE, "--config", "run.toml"]
    assert says in refused(capsys, *words)


def test_a_sidecar_without_a_configuration(
    example: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for text in ("{}", "[]", '{"poresynth": {}}', "{"):
        Path("other.json").write_text(text)
        words = ["synthesize", example, "-o", "new.tif", "--config", "other.json"]
        assert "other.json" in refused(capsys, *words)


@pytest.mark.parametrize(
    ("output", "says"),
    [
        ("new.xyz", "unknown suffix"),
        ("missing/new.tif", "does not exist"),
        ("example.npy/new.tif", "file"),
        ("/proc/new.tif", "/proc"),
        ("folder.tif", "folder"),
    ],
)
@pytest.mark.parametrize("command", ["synthesize", "crop", "downsample", "threshold"])
def test_bad_outputs_fail_before_the_input_is_read(
    command: str, output: str, says: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("example.npy").write_text("not an array: nobody has looked")
    Path("folder.tif").mkdir()
    rest = {"crop": [":", ":", ":"], "downsample": ["2"], "synthesize": SHAPE}.get(command, [])
    assert says in refused(capsys, command, "example.npy", "-o", output, *rest)


@pytest.mark.parametrize("report", ["missing/out", "example.npy", "example.npy/out", "/proc/out"])
def test_bad_report_folders_fail_at_once(
    report: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("example.npy").write_text("not an array: nobody has looked")
    assert report.split("/")[-2:][0] in refused(capsys, *SYNTHESIZE, "--report", report)
    words = ["compare", "example.npy", "example.npy", "--report", report]
    assert report.split("/")[-2:][0] in refused(capsys, *words)


def test_a_truncated_tiff(example: Path, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    whole = example.read_bytes()
    Path("cut.tif").write_bytes(whole[: len(whole) // 2])
    words = ["synthesize", "cut.tif", "-o", "new.tif", *SHAPE]
    assert "cut.tif" in refused(capsys, *words)


@pytest.mark.parametrize("path", ["missing.tif", "file/below.tif", "empty.tif", "text.tif"])
@pytest.mark.parametrize("command", ["synthesize", "compare", "measure", "threshold"])
def test_unreadable_inputs(
    command: str, path: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("file").write_text("a file, not a folder")
    Path("empty.tif").touch()
    Path("text.tif").write_text("not a TIFF at all, but long enough to look like one")
    words = {"synthesize": ["-o", "new.tif", *SHAPE], "threshold": ["-o", "new.tif"]}
    both = [path] if command == "compare" else []
    said = refused(capsys, command, path, *both, *words.get(command, []))
    assert said.startswith(path)


def test_compare_with_a_volume_of_other_channels(
    example: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    np.save("flat.npy", np.full((20, 20, 20), 3, dtype=np.uint8))
    refused(capsys, "compare", "flat.npy", example)


def test_a_full_disk(
    example: Path,
    folder: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def full(descriptor: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    words = ["synthesize", example, "-o", "new.tif", *SHAPE, *SMALL, "--report", "out"]
    assert "no room left" in refused(capsys, *words)


def test_two_runs_to_one_output(
    example: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = [sys.executable, "-m", "poresynth", "synthesize", str(example), "-o", "new.tif"]
    with atomic.claim("new.tif"):
        said = subprocess.run([*command, *SHAPE, *SMALL], capture_output=True, text=True)
    assert said.returncode == 2
    assert said.stderr.splitlines() == [
        f"poresynth: error: new.tif: is being written by process {os.getpid()}"
    ]
    assert not list(folder.iterdir())


@pytest.mark.skipif(os.name != "posix", reason="signals are sent as on POSIX")
def test_ctrl_c_leaves_nothing(example: Path, folder: Path) -> None:
    command = [sys.executable, "-m", "poresynth", "synthesize", str(example), "-o", "new.tif"]
    command += ["--shape", "200", "200", "200", "--report", "out", *SMALL]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        for line in process.stderr:
            if "synthesis" in line:
                break
        process.send_signal(signal.SIGINT)
        rest = process.stderr.read().splitlines()
        assert process.wait() == 130
    assert [line for line in rest if "%" not in line] == ["poresynth: interrupted"]
    assert not list(folder.iterdir())


def test_what_was_there_before_stays(
    example: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tifffile.imwrite("new.tif", noise(3, 3, 3))
    before = Path("new.tif").read_bytes()
    np.save("example.npy", with_value(np.nan))
    refused(capsys, *SYNTHESIZE)
    assert Path("new.tif").read_bytes() == before


# The demonstration


def test_demo(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run("demo", "-o", "shown")
    assert "porosity" in capsys.readouterr().out
    names = {path.name for path in Path("shown").iterdir()}
    assert names >= {"exemplar.tif", "new.tif", "new.tif.json", "report.html", "report.json"}


# Porosity from place to place


def test_porosity_follows_a_ramp_or_a_map(
    example: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # Long beside the features, so that its ends can differ.
    long = ["--shape", "60", "18", "16"]
    ramp = synthesize(example, "--porosity", "z=0.4:0.7", "--seed", 2, shape=long)
    origin = json.loads(Path("new.tif.json").read_text())["poresynth"]
    level = origin["exemplar"]["threshold"]
    assert 1 - np.mean(ramp > level) == pytest.approx(0.55, abs=0.01)
    assert np.mean(ramp[:30] > level) > np.mean(ramp[30:] > level) + 0.1
    assert origin["grading"]["mean_absolute_error_percent"] < 3
    assert "--porosity z=0.4:0.7" in origin["command"]
    places = (np.arange(60) + 0.5) / 60
    mapped = np.broadcast_to((0.4 + 0.3 * places)[:, None, None], (60, 18, 16))
    np.save("map.npy", mapped.astype(np.float32))
    again = synthesize(example, "--porosity", "map.npy", "--seed", 2, shape=long)
    assert np.mean(again != ramp) < 0.01
    for wrong, said in (
        ("1.5", "porosity"),
        ("z=a:b", "porosity"),
        ("z=0:1.5", "porosity"),
        ("nothing.npy", "nothing.npy"),
    ):
        words = [example, "-o", "bad.tif", *SHAPE, *SMALL, "--porosity", wrong]
        assert said in refused(capsys, "synthesize", *words)


def test_structure_scales_and_turns(
    example: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    large = synthesize(example, "--scale", "x=1:1.5", "--seed", 2)
    assert large.shape == (20, 18, 16)
    origin = json.loads(Path("new.tif.json").read_text())["poresynth"]
    assert origin["coordinates"]["mean_angle_degrees"] == pytest.approx(0, abs=5)
    vectors = np.zeros((1, 1, 1, 3), np.float32)
    vectors[..., 2] = 1.2
    np.save("way.npy", vectors)
    turned = synthesize(example, "--orientation", "way.npy", "--seed", 2)
    origin = json.loads(Path("new.tif.json").read_text())["poresynth"]
    assert "--orientation way.npy --orientation-axis z" in origin["command"]
    run("synthesize", "-o", "again.tif", "--config", "new.tif.json")
    np.testing.assert_array_equal(io.read("again.tif").array, turned)
    words = [example, "-o", "bad.tif", *SHAPE, *SMALL]
    assert "scale" in refused(capsys, "synthesize", *words, "--scale", 20)
    image = folder / "image.tif"
    run("crop", example, "5:6", ":", ":", "-o", image)
    words = [image, "-o", "bad.tif", "--engine", "solid", "--shape", 16, 16, 16, "--scale", 2]
    assert "engine solid" in refused(capsys, "synthesize", *words)
