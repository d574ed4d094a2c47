"""The metrics by name, phases as they come, and all metrics of one volume."""

from __future__ import annotations

import json

import numpy as np
import pytest

from poresynth import metrics
from poresynth.errors import ParameterError
from poresynth.metrics.arguments import as_phase
from poresynth.volume import Volume


@pytest.fixture
def solid(rng: np.random.Generator) -> np.ndarray:
    return rng.random((9, 10, 11)) < 0.3


def test_every_metric_describes_itself() -> None:
    assert {"porosity", "components", "floating_parts", "largest_component_fraction"} <= set(
        metrics.METRICS
    )
    for name, metric in metrics.METRICS.items():
        assert metric.name == name == metric.function.__name__
        assert metric.description


def test_porosity(solid: np.ndarray) -> None:
    assert metrics.porosity(solid) == pytest.approx(1 - solid.mean())
    assert metrics.porosity(np.zeros((1, 1, 1), bool)) == 1
    assert metrics.porosity(np.ones((1, 1, 1), bool)) == 0


@pytest.mark.parametrize("solid_is", ["bright", "dark"])
def test_gray_two_valued_and_bool_volumes_measure_alike(solid: np.ndarray, solid_is: str) -> None:
    expected = {name: metric.function(solid) for name, metric in metrics.METRICS.items()}
    bright = solid if solid_is == "bright" else ~solid
    gray = np.where(bright, 180, 60) + np.arange(solid.size).reshape(solid.shape) % 20
    for volume, threshold in (
        (gray.astype(np.uint8), None),
        (gray.astype(float), 130.0),
        (bright * np.uint8(255), None),
        (bright, None),
    ):
        found = metrics.measure(volume, threshold=threshold, solid=solid_is)
        assert {name: found[name] for name in expected} == expected
        json.dumps(found, allow_nan=False)


def test_the_lowest_label_is_pore(solid: np.ndarray, rng: np.random.Generator) -> None:
    labels = np.where(solid, rng.integers(4, 6, solid.shape), 3)
    found = metrics.measure(Volume(labels, 2.0, "µm"))
    assert found["kind"] == "label"
    assert found["porosity"] == metrics.porosity(solid)
    assert (found["voxel_size"], found["unit"]) == ([2.0, 2.0, 2.0], "µm")


def test_the_first_channel_decides(solid: np.ndarray) -> None:
    channels = np.stack([solid, ~solid], axis=-1).astype(np.uint8)
    assert metrics.measure(channels)["porosity"] == metrics.porosity(solid)


def test_a_threshold_is_obeyed() -> None:
    gray = np.arange(1000.0).reshape(10, 10, 10)
    assert metrics.measure(gray, threshold=899)["porosity"] == pytest.approx(0.9)


@pytest.mark.parametrize(
    ("volume", "options", "message"),
    [
        (np.zeros((4, 4, 4)), {}, "volume = .*must not be constant"),
        (np.zeros((0, 4, 4)), {}, "volume = .*must hold voxels"),
        (np.zeros((4, 4)), {}, "array.ndim = 2: must be 3"),
        (np.full((4, 4, 4), np.nan), {}, "volume = .*must be finite"),
        (np.eye(4)[None].repeat(4, 0), {"solid": "red"}, "solid = red: must be"),
        (np.eye(4)[None].repeat(4, 0), {"threshold": 2}, "threshold = 2: must be"),
    ],
)
def test_bad_input_is_named(volume: np.ndarray, options: dict[str, object], message: str) -> None:
    with pytest.raises(ParameterError, match=f"^{message}"):
        metrics.measure(volume, **options)


@pytest.mark.parametrize("dtype", ["uint8", "int16", "float32"])
def test_a_gray_volume_is_no_phase(dtype: str) -> None:
    gray = np.arange(27).reshape(3, 3, 3).astype(dtype)
    with pytest.raises(ParameterError, match=r"^solid = gray volume.*poresynth\.binarize"):
        as_phase(gray)


def test_a_phase_is_not_copied(solid: np.ndarray) -> None:
    assert as_phase(Volume(solid)) is solid
    fortran = np.asfortranarray(solid)
    assert as_phase(fortran * np.uint8(9)).flags.f_contiguous
