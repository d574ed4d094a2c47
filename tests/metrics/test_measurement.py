"""All metrics of one volume."""

from __future__ import annotations

import json

import numpy as np
import pytest

from poresynth import exemplars, metrics
from poresynth.errors import ParameterError
from poresynth.volume import Volume


@pytest.fixture(scope="module")
def foam() -> Volume:
    return exemplars.foam((40, 44, 48), cell=16.0, seed=1)


def test_metrics_agree_with_the_functions_that_they_name(foam: Volume) -> None:
    found = metrics.measure(foam)
    solid = foam.array > found["threshold"]
    assert found["porosity"] == pytest.approx(metrics.porosity(solid))
    assert found["bv_tv"] == pytest.approx(1 - metrics.porosity(solid))
    assert found["components"] == metrics.components(solid)
    assert found["floating_parts"] == metrics.floating_parts(solid)
    assert found["euler_number"] == metrics.euler_number(solid)
    assert found["tb_th"] == pytest.approx(metrics.thickness(solid).mean)
    assert found["tb_sp"] == pytest.approx(metrics.thickness(~solid).mean)
    assert found["tb_n"] == pytest.approx(1 / (found["tb_th"] + found["tb_sp"]))
    assert found["bs_bv"] == pytest.approx(metrics.morphometry(solid).bs_bv)
    assert found["loops"] == found["betti_1"]
    assert found["two_point"][0] == pytest.approx(found["bv_tv"])
    assert sum(found["tb_th_shares"]) == pytest.approx(1)
    assert found["intensity_mean"] == pytest.approx(foam.array.mean())
    json.dumps(found, allow_nan=False)


def test_lengths_are_in_voxels_and_in_the_unit(foam: Volume) -> None:
    plain = metrics.measure(foam.array)
    scaled = metrics.measure(Volume(foam.array, 2.0, "mm"))
    for metric in metrics.METRICS.values():
        name = metric.name
        assert scaled[name] == pytest.approx(plain[name]), name
        assert f"{name}_in_unit" not in plain
        if metric.power:
            assert scaled[f"{name}_in_unit"] == pytest.approx(plain[name] * 2.0**metric.power), name
        else:
            assert f"{name}_in_unit" not in scaled


def test_voxels_that_are_not_cubic_keep_their_volume() -> None:
    solid = np.zeros((24, 24, 24), bool)
    solid[8:16] = True
    found = metrics.measure(Volume(solid, (4.0, 1.0, 2.0), "µm"))
    assert found["tb_th_in_unit"] == pytest.approx(8 * 4.0)
    assert found["tb_th"] == pytest.approx(8 * 4.0 / 2.0)  # the cube root of 4 · 1 · 2 is 2


def test_transport_is_solved_only_if_it_is_wanted() -> None:
    solid = np.zeros((8, 8, 8), bool)
    solid[:, :, :2] = True
    assert not set(metrics.TRANSPORT_METRICS) & set(metrics.measure(solid))
    shares: list[float] = []
    found = metrics.measure(solid, transport=True, progress=lambda _, share: shares.append(share))
    assert found["effective_diffusivity_z"] == pytest.approx(0.75, rel=1e-3)
    assert found["tortuosity_factor_z"] == pytest.approx(1, rel=1e-3)
    assert found["effective_diffusivity_x"] == 0
    assert found["tortuosity_factor_x"] is None
    assert found["permeability_z"] > 0
    assert found["permeability_x"] == 0
    assert shares == sorted(shares)
    assert shares[-1] == 1


@pytest.mark.parametrize("edge", [2, 3, 5])
def test_tiny_volumes_are_measured(edge: int) -> None:
    solid = np.zeros((edge,) * 3, bool)
    solid[0] = True
    found = metrics.measure(solid)
    assert found["components"] == 1
    json.dumps(found, allow_nan=False)


def test_every_metric_describes_itself() -> None:
    assert {"porosity", "components", "floating_parts", "largest_component_fraction"} <= set(
        metrics.METRICS
    )
    assert list(metrics.METRICS)[:2] == ["end_point_density", "euler_density"]
    for name, metric in {**metrics.METRICS, **metrics.TRANSPORT_METRICS}.items():
        assert metric.name == name
        assert metric.description
    assert metrics.unit_of("µm", 1) == "µm"
    assert metrics.unit_of("µm", 2) == "µm²"
    assert metrics.unit_of("µm", -1) == "1/µm"
    assert metrics.unit_of("mm", -3) == "1/mm³"
    assert metrics.unit_of("mm", 0) == ""


def test_a_metric_that_is_added_is_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    metric = metrics.Metric("half", lambda s: s.solid.mean() / 2, "half of the solid's share")
    monkeypatch.setitem(metrics.METRICS, "half", metric)
    solid = np.arange(64).reshape(4, 4, 4) % 2 == 0
    assert metrics.measure(solid)["half"] == pytest.approx(0.25)


@pytest.mark.parametrize("solid_is", ["bright", "dark"])
def test_gray_two_valued_and_bool_volumes_measure_alike(
    solid_is: str, rng: np.random.Generator
) -> None:
    solid = rng.random((9, 10, 11)) < 0.3
    expected = metrics.measure(solid)
    bright = solid if solid_is == "bright" else ~solid
    gray = np.where(bright, 180, 60) + np.arange(solid.size).reshape(solid.shape) % 20
    for volume, threshold in (
        (gray.astype(np.uint8), None),
        (gray.astype(float), 130.0),
        (bright * np.uint8(255), None),
        (np.asfortranarray(bright), None),
    ):
        found = metrics.measure(volume, threshold=threshold, solid=solid_is)
        for name in metrics.METRICS:
            assert found[name] == pytest.approx(expected[name], nan_ok=True), name


def test_the_lowest_label_is_pore(rng: np.random.Generator) -> None:
    solid = rng.random((9, 10, 11)) < 0.3
    labels = np.where(solid, rng.integers(4, 6, solid.shape), 3)
    found = metrics.measure(Volume(labels, 2.0, "µm"))
    assert found["kind"] == "label"
    assert found["porosity"] == pytest.approx(metrics.porosity(solid))
    assert (found["voxel_size"], found["unit"]) == ([2.0, 2.0, 2.0], "µm")


def test_the_first_channel_decides(rng: np.random.Generator) -> None:
    solid = rng.random((9, 10, 11)) < 0.3
    found = metrics.measure(np.stack([solid, ~solid], axis=-1).astype(np.uint8))
    assert found["porosity"] == pytest.approx(metrics.porosity(solid))
    assert found["intensity_mean"] == pytest.approx([solid.mean(), 1 - solid.mean()])


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


# Thinning visits voxels in an order: where its skeleton lies, and the short spurs at rough places,
# depend on the directions of the axes. What is connected to what does not.
OF_THE_SKELETON = {
    "end_point_density",
    "branches",
    "junctions",
    "loops",
    "branch_length",
    "branch_tortuosity",
}


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("order", [(1, 2, 0), (2, 1, 0), (0, 2, 1)])
def test_a_turned_or_mirrored_volume_measures_alike(seed: int, order: tuple[int, int, int]) -> None:
    from scipy import ndimage

    noise = np.random.default_rng(seed).standard_normal((26, 30, 34))
    solid = ndimage.gaussian_filter(noise, 2, mode="nearest") > 0.02
    turned = np.transpose(solid, order)[::-1, :, ::-1]
    before, after = metrics.measure(solid), metrics.measure(turned)
    for name in metrics.METRICS:
        same = name
        if name[-2:] in ("_z", "_y", "_x"):
            same = name[:-1] + "zyx"[order["zyx".index(name[-1])]]
        elif name in OF_THE_SKELETON:
            continue
        assert after[name] == pytest.approx(before[same], rel=1e-5), name


def test_void_round_a_volume_changes_what_it_must() -> None:
    from scipy import ndimage

    noise = np.random.default_rng(2).standard_normal((24, 24, 24))
    solid = np.pad(ndimage.gaussian_filter(noise, 2) > 0.02, 8)
    before, after = metrics.measure(solid), metrics.measure(np.pad(solid, 4))
    grown = (32 + 16) ** 3 / 40**3
    assert after["porosity"] == pytest.approx(1 - (1 - before["porosity"]) / grown)
    for name in ("bs_bv", "tb_th", "tb_th_sd", "tb_th_max", "solid_chord", "euler_number"):
        assert after[name] == pytest.approx(before[name], rel=0.02 if name == "bs_bv" else 1e-6), (
            name
        )
    for name in ("components", "floating_parts", "betti_0", "betti_1", "betti_2", "branches"):
        assert after[name] == before[name], name
