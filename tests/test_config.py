"""The configuration of a run."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from poresynth import config
from poresynth.errors import FileError, ParameterError

LEAST = {"exemplar": "bone.tif", "shape": [40, 40, 40]}

keys = st.text("abc", min_size=1, max_size=2)
leaves = st.one_of(st.integers(), st.text("xyz"), st.booleans())
documents = st.recursive(
    st.dictionaries(keys, leaves, max_size=3),
    lambda below: st.dictionaries(keys, st.one_of(leaves, below), max_size=3),
    max_leaves=8,
)


def leaf_paths(document: dict[str, Any], above: tuple[str, ...] = ()) -> dict[tuple[str, ...], Any]:
    paths = {}
    for key, value in document.items():
        if isinstance(value, dict) and value:
            paths |= leaf_paths(value, (*above, key))
        else:
            paths[(*above, key)] = value
    return paths


@given(documents, documents)
def test_the_later_document_wins(base: dict[str, Any], override: dict[str, Any]) -> None:
    before = json.dumps([base, override])
    merged = leaf_paths(config.merge(base, override))
    for path, value in leaf_paths(override).items():
        assert merged.get(path, value) == value
    assert set(merged) <= set(leaf_paths(base)) | set(leaf_paths(override))
    assert json.dumps([base, override]) == before


@given(documents)
def test_merging_with_nothing_changes_nothing(document: dict[str, Any]) -> None:
    assert config.merge(document) == config.merge(document, {}) == config.merge({}, document)


@pytest.mark.parametrize(
    ("setting", "document"),
    [
        ("levels=2", {"parameters": {"levels": 2}}),
        ("windows=[8, 4]", {"parameters": {"windows": [8, 4]}}),
        ("windows=8,4", {"parameters": {"windows": [8, 4]}}),
        ("unit=a, b", {"parameters": {"unit": "a, b"}}),
        ("run_penalty=0.1", {"parameters": {"run_penalty": 0.1}}),
        ("adaptive=true", {"parameters": {"adaptive": True}}),
        ("field=intensity", {"parameters": {"field": "intensity"}}),
        ('field="intensity"', {"parameters": {"field": "intensity"}}),
        ("input.downsample=2", {"input": {"downsample": 2}}),
        ("input.unit = µm", {"input": {"unit": "µm"}}),
        ("a.b.c=1", {"a": {"b": {"c": 1}}}),
        ("x=a=b", {"parameters": {"x": "a=b"}}),
    ],
)
def test_settings(setting: str, document: dict[str, Any]) -> None:
    assert config.parse_settings([setting]) == document


def test_settings_join() -> None:
    both = config.parse_settings(["levels=2", "input.downsample=3", "preset=fast", "levels=1"])
    assert both == {"parameters": {"levels": 1, "preset": "fast"}, "input": {"downsample": 3}}


@pytest.mark.parametrize("setting", ["levels", "=2", ".levels=2", "input.=2", ""])
def test_broken_settings(setting: str) -> None:
    with pytest.raises(ParameterError, match="key=value"):
        config.parse_settings([setting])


def test_the_least_configuration() -> None:
    run = config.validate(LEAST)
    assert (run.engine, run.seed, run.boundary, run.shape) == ("volume", 0, "open", (40, 40, 40))


def test_a_configuration_is_frozen() -> None:
    with pytest.raises(ValidationError, match="frozen"):
        config.validate(LEAST).seed = 3


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"sede": 1}, "sede = 1: is no key of the configuration; did you mean seed"),
        ({"zzz": 1}, "known are blockwise, boundary, engine"),
        ({"input": {"downsampel": 2}}, "did you mean input.downsample"),
        ({"parameters": {"level": 2}}, "no parameter of the engine volume; did you mean levels"),
        ({"shape": [1, 2]}, "shape"),
        ({"shape": [1, 2, -3]}, "shape = -3: input should be greater than 0"),
        ({"shape": [1, 2, 2.5]}, "shape"),
        ({"seed": -1}, "seed = -1"),
        ({"boundary": "closed"}, "boundary = closed"),
        ({"porosity": 0}, "porosity = 0"),
        ({"porosity": float("nan")}, "porosity = nan"),
        ({"engine": "magic"}, "engine = magic: must be one of ipfn, scaffoldgan, solid, volume"),
        ({"input": {"voxel_size": [1, 2, float("inf")]}}, "input.voxel_size"),
        ({"input": 3}, "input = 3"),
        ({"exemplar": None}, "exemplar = None: must be a text or a list of texts"),
        ({"exemplar": []}, "exemplar = []: must be a text or a list of texts"),
        ({"exemplar": ["a.png", 3]}, "exemplar = 3"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(change: dict[str, Any], says: str) -> None:
    with pytest.raises(ParameterError) as caught:
        config.validate({**LEAST, **change})
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("missing", ["exemplar", "shape"])
def test_what_is_missing_is_named(missing: str) -> None:
    with pytest.raises(ParameterError, match=f"^{missing}.*needed"):
        config.validate({key: value for key, value in LEAST.items() if key != missing})


def test_a_saved_configuration_is_the_same_configuration() -> None:
    document = {
        **LEAST,
        "boundary": "periodic",
        "porosity": 0.7,
        "mask": "mask.tif",
        "parameters": {"preset": "fast", "windows": [8, 4]},
        "input": {"crop": ["0:50", ":", ":"], "voxel_size": [2, 1, 1]},
    }
    run = config.validate(document)
    saved = json.loads(json.dumps(run.saved(("abc",))))
    again = config.validate(saved)
    assert again.exemplar_sha256 == ("abc",)
    assert again.version is not None
    neutral = {"exemplar_sha256": None, "version": None}
    assert again.model_copy(update=neutral) == run


def test_one_exemplar_needs_no_list() -> None:
    alone, listed = (config.validate({**LEAST, "exemplar": e}) for e in ("a.tif", ["a.tif"]))
    assert alone == listed
    assert alone.exemplar == ("a.tif",)
    # As files were written when there was never more than one, and are read by other programs.
    saved = alone.saved(("abc",))
    assert (saved["exemplar"], saved["exemplar_sha256"]) == ("a.tif", "abc")


def test_several_exemplars_are_saved_and_loaded(tmp_path: Path) -> None:
    run = config.validate({**LEAST, "exemplar": ["a.png", "b c.png"]})
    path = tmp_path / "new.tif.json"
    document = {"poresynth": {"configuration": run.saved(("abc", "def"))}}
    path.write_text(json.dumps(document))
    again = config.validate(config.load(path))
    assert again.exemplar == ("a.png", "b c.png")
    assert again.exemplar_sha256 == ("abc", "def")
    words = shlex.split(again.command("new.tif"))
    assert words[:6] == ["poresynth", "synthesize", "a.png", "b c.png", "-o", "new.tif"]


def test_a_saved_configuration_keeps_what_later_defaults_may_change() -> None:
    assert {"engine", "seed"} <= set(config.validate(LEAST).saved(("abc",)))


def test_the_command_says_all() -> None:
    document = {
        **LEAST,
        "exemplar": "my bone.tif",
        "boundary": "periodic",
        "porosity": 0.7,
        "known": "k.tif",
        "known_mask": "m.tif",
        "parameters": {"field": "intensity", "windows": [8, 4], "adaptive": True},
        "input": {"crop": ["0:50", ":", ":"], "downsample": 2, "raw_shape": [5, 6, 7]},
    }
    words = shlex.split(config.validate(document).command("new.tif"))
    assert words[:5] == ["poresynth", "synthesize", "my bone.tif", "-o", "new.tif"]
    text = " ".join(words)
    for part in (
        "--shape 40 40 40",
        "--periodic",
        "--porosity 0.7",
        "--known k.tif",
        "--known-mask m.tif",
        "--crop 0:50 : :",
        "--downsample 2",
        "--raw-shape 5 6 7",
    ):
        assert part in text
    settings = words[words.index("--set") + 1 :]
    assert config.parse_settings(settings) == {"parameters": document["parameters"]}


def test_reading_options_are_those_of_read() -> None:
    source = config.InputConfig(
        voxel_size=(1, 2, 3), array_name="scan", raw_shape=(4, 5, 6), crop=(":", ":", ":")
    )
    assert source.options() == {"voxel_size": (1, 2, 3), "name": "scan", "shape": (4, 5, 6)}


def test_toml_and_the_file_beside_a_result(tmp_path: Path) -> None:
    toml, sidecar = tmp_path / "run.toml", tmp_path / "new.tif.json"
    toml.write_text("seed = 3\n[parameters]\nlevels = 2\n")
    sidecar.write_text(json.dumps({"poresynth": {"configuration": {"seed": 4}}, "unit": "µm"}))
    assert config.load(toml) == {"seed": 3, "parameters": {"levels": 2}}
    assert config.load(sidecar) == {"seed": 4}


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("run.toml", b"seed = "),
        ("run.toml", b"\xff\xfe\x00"),
        ("new.json", b"{"),
        ("new.json", b"[1]"),
        ("new.json", b'{"poresynth": 3}'),
        ("new.json", b'{"poresynth": {"configuration": 3}}'),
    ],
)
def test_broken_files(name: str, content: bytes, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(FileError, match=name) as caught:
        config.load(path)
    assert "\n" not in str(caught.value)


def test_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="no such file"):
        config.load(tmp_path / "run.toml")
