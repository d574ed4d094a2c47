"""Which field is synthesised unless one is named."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import ndimage

from poresynth import io
from poresynth.engines.field_choice import REACH, TWO_PHASES, explained_share
from poresynth.engines.phases import Phases
from poresynth.engines.volume_texture import VolumeTexture
from poresynth.exemplars import foam, spheres, spinodal
from poresynth.volume import as_volume

SHAPE = (48, 48, 48)
# By how much a choice is clear: a third of the gap between exemplars of either kind.
MARGIN = 0.01
SMALL: dict[str, Any] = {"levels": 2, "windows": (6, 4), "iterations": 2}


def random_field(length: float, seed: int = 0) -> np.ndarray:
    """One phase, or infinitely many: gray values without a place to cut."""
    noise = np.random.default_rng(seed).standard_normal(SHAPE)
    field = ndimage.gaussian_filter(noise, length, mode="wrap")
    return (field - field.mean()) / field.std()


def scan(gray: Any, noise: float = 0.0, blur: float = 0.0) -> np.ndarray:
    noisy = ndimage.gaussian_filter(np.asarray(gray, float), blur)
    noisy += np.random.default_rng(5).normal(0, noise, gray.shape)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


def share(gray: np.ndarray, solid: Any = "bright") -> float:
    return explained_share(gray, Phases.of(as_volume(gray), "gray", None, solid))


def two_phases() -> dict[str, np.ndarray]:
    struts, walls = foam(SHAPE, cell=24, seed=1).array, spinodal(SHAPE, seed=1).array
    # Weak contrast, texture within the matrix, pores of many grays: as cement under a scanner.
    pores = spheres(SHAPE, porosity=0.85, radius=5, seed=2).array > 125
    inside = np.where(pores, 110 + 8 * random_field(2, 3), 170 + 6 * random_field(1.5, 4))
    return {
        "foam": struts,
        "spheres": spheres(SHAPE, seed=1).array,
        "spinodal": walls,
        "blurred": scan(walls, blur=2),
        "fine and blurred": scan(spinodal(SHAPE, wavelength=8, seed=1).array, blur=1.5),
        "noisy foam": scan(struts, noise=40),
        "noisy spinodal": scan(walls, noise=60),
        "cement-like": scan(inside, noise=3, blur=0.7),
        "through a steep sigmoid": scan(20 + 215 / (1 + np.exp(-4 * random_field(3)))),
    }


def no_two_phases() -> dict[str, np.ndarray]:
    fields = {f"of length {n}": scan(128 + 35 * random_field(n)) for n in (1, 2, 3, 4)}
    noisy = {f"noisy, {n}": scan(128 + 35 * random_field(n), noise=15) for n in (1, 2, 4)}
    several = sum(random_field(n, n) for n in (1, 2, 4, 8))
    return {
        **fields,
        **noisy,
        "lognormal": scan(40 * np.exp(0.7 * random_field(3))),
        "of several lengths": scan(128 + 20 * several),
        "white noise": scan(np.full(SHAPE, 128), noise=35),
    }


@pytest.mark.parametrize("name", two_phases())
def test_two_phases_are_made_by_distance(name: str) -> None:
    exemplar = two_phases()[name]
    assert share(exemplar) >= TWO_PHASES + MARGIN
    engine = VolumeTexture(**SMALL).fit(exemplar)
    assert engine.field_ == "distance"
    assert engine.field_reason_.startswith("distance, which explains 9")


@pytest.mark.parametrize(
    "name", ["trabecular_bone_gray_100.tif", "trabecular_bone_gray_200.tif", "cement_gray_128.tif"]
)
def test_real_scans_are_made_by_distance(data_dir: Path, name: str) -> None:
    gray = io.read(data_dir / name).array
    for start in (0, 28):
        part = tuple(slice(start, start + 64) for _ in range(3))
        assert share(gray[part]) >= TWO_PHASES + MARGIN
        assert share(scan(gray[part], noise=15)) >= TWO_PHASES


@pytest.mark.parametrize("name", no_two_phases())
def test_fields_without_two_phases_are_made_by_intensity(name: str) -> None:
    exemplar = no_two_phases()[name]
    assert share(exemplar) <= TWO_PHASES - MARGIN
    engine = VolumeTexture(**SMALL).fit(exemplar)
    assert engine.field_ == "intensity"
    assert engine.field_reason_.startswith("intensity, for distance explains ")


def test_noise_changes_no_choice() -> None:
    clean = foam(SHAPE, porosity=0.8, cell=24, seed=1).array
    shares = [share(scan(clean, noise=noise)) for noise in (0, 20, 40, 60)]
    assert min(shares) >= TWO_PHASES + MARGIN


def test_the_share_is_what_it_says() -> None:
    exemplar = scan(128 + 35 * random_field(2))
    phases = Phases.of(as_volume(exemplar), "gray", None, "bright")
    smooth = ndimage.gaussian_filter(exemplar.astype(float), 1, mode="nearest")
    solid = smooth > phases.threshold
    inner, outer = (ndimage.distance_transform_edt(phase) for phase in (solid, ~solid))
    distance = np.clip(np.where(solid, inner - 0.5, 0.5 - outer), -REACH, REACH)
    bins = np.rint(2 * distance)
    left = smooth.copy()
    for value in np.unique(bins):
        left[bins == value] -= smooth[bins == value].mean()
    smooth -= smooth.mean()

    def neighbours(a: np.ndarray) -> float:
        pairs = [a[1:] * a[:-1], a[:, 1:] * a[:, :-1], a[:, :, 1:] * a[:, :, :-1]]
        return float(np.mean([p.mean() for p in pairs]))

    expected = 1 - neighbours(left) / neighbours(smooth)
    assert share(exemplar) == pytest.approx(expected, abs=2e-3)


@pytest.mark.parametrize("exemplar", [two_phases()["foam"], no_two_phases()["of length 2"]])
def test_neither_scale_nor_type_nor_side_matters(exemplar: np.ndarray) -> None:
    expected = share(exemplar)
    for same in (
        np.asfortranarray(exemplar),
        exemplar.astype(np.uint16) * 200,
        exemplar * np.float64(1e100),
        exemplar + np.float64(1e7),
        exemplar.astype(np.float32) * np.float32(1e-10),
    ):
        assert share(same) == pytest.approx(expected, abs=2e-3)
    assert share(exemplar, "dark") == pytest.approx(expected, abs=1e-9)


def test_a_cut_far_from_all_grays_explains_nothing() -> None:
    exemplar = two_phases()["foam"]
    highest = float(exemplar.max()) - 0.5
    engine = VolumeTexture(**SMALL, threshold=highest).fit(exemplar)
    assert engine.field_ == "intensity"


def test_the_first_channel_decides() -> None:
    foam_, field = two_phases()["foam"], no_two_phases()["of length 2"]
    for channels, wanted in (((foam_, field), "distance"), ((field, foam_), "intensity")):
        engine = VolumeTexture(**SMALL).fit(np.stack(channels, axis=-1))
        assert engine.field_ == wanted


@pytest.mark.parametrize("values", [2, 3])
def test_binary_and_labels_are_made_by_distance(values: int) -> None:
    field = random_field(2)
    exemplar = np.digitize(field, np.quantile(field, np.arange(1, values) / values))
    engine = VolumeTexture(**SMALL).fit(exemplar.astype(np.uint8))
    assert engine.field_ == "distance"
    assert "values" in engine.field_reason_ or "labels" in engine.field_reason_


@pytest.mark.parametrize("exemplar", [two_phases()["foam"], no_two_phases()["of length 2"]])
@pytest.mark.parametrize("field", ["distance", "intensity"])
def test_a_named_field_is_taken(exemplar: np.ndarray, field: Any) -> None:
    engine = VolumeTexture(**SMALL, field=field).fit(exemplar)
    assert engine.field_ == field
    assert engine.field_reason_ == f"{field}, as asked"
    assert VolumeTexture(**SMALL, preset="paper").fit(exemplar).field_ == "intensity"


@pytest.mark.parametrize(
    "exemplar", [two_phases()["foam"], no_two_phases()["of length 2"]], ids=["foam", "field"]
)
def test_a_choice_is_that_of_the_named_field_and_is_recorded(
    exemplar: np.ndarray, tmp_path: Path
) -> None:
    engine = VolumeTexture(**SMALL).fit(exemplar)
    made = engine.sample((24, 24, 24), seed=3)
    record = made.metadata["poresynth"]
    assert (record["field"], record["field_reason"]) == (engine.field_, engine.field_reason_)
    assert record["parameters"]["field"] == "auto"
    named = VolumeTexture(**SMALL, field=engine.field_).fit(exemplar)
    np.testing.assert_array_equal(made.array, named.sample((24, 24, 24), seed=3).array)
    assert engine.estimate_memory(SHAPE) == named.estimate_memory(SHAPE)
    engine.save(tmp_path / "engine.npz")
    again = VolumeTexture.load(tmp_path / "engine.npz")
    assert again.field_reason_ == engine.field_reason_
    np.testing.assert_array_equal(made.array, again.sample((24, 24, 24), seed=3).array)
