"""ScaffoldGAN as a user meets it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from safetensors import safe_open

from poresynth import io
from poresynth.engines import get_engine, load_model
from poresynth.engines.neural import matching
from poresynth.engines.neural.judge import Judge
from poresynth.engines.neural.matching import LabelMap, LevelMap
from poresynth.engines.request import Request
from poresynth.engines.scaffold_gan import ScaffoldGAN
from poresynth.engines.scaffold_gan.parameters import PRESETS, VARIANTS, resolve
from poresynth.engines.values import cut
from poresynth.errors import FileError, MemoryEstimateError, ParameterError
from poresynth.exemplars import spinodal
from poresynth.volume import Volume

# Networks of some hundred weights, which learn to make both phases and no more.
MICRO: dict[str, Any] = {
    "preset": "tiny",
    "device": "cpu",
    "latent": 4,
    "generator_maps": (8, 4),
    "discriminator_maps": (4, 8),
    "regions": (2, 1),
    "iterations": 12,
    "batch": 2,
    "learning_rate": 0.01,
    "ema": 0.0,
    "evaluate_every": 3,
    "output_bias": True,
}


def gray(seed: int = 0) -> np.ndarray:
    return spinodal((24, 26, 28), porosity=0.55, wavelength=8, seed=seed).array


def labels() -> np.ndarray:
    """Three phases: 0, 5 and 10."""
    return np.digitize(gray(), np.quantile(gray(), [0.4, 0.7])).astype(np.uint8) * 5


def engine_request(exemplar: np.ndarray, shape: Any, porosity: float | None) -> Request:
    nothing: dict[str, Any] = {"known": None, "known_mask": None, "mask": None, "threads": 0}
    options: dict[str, Any] = {"seed": 0, "boundary": "open", "porosity": porosity, **nothing}
    return Request.of(shape, least=1, exemplar=Volume(exemplar), **options)


def never(stage: str, fraction: float) -> None:
    raise AssertionError("the work began")


def micro(exemplar: Any = None, **changes: Any) -> ScaffoldGAN:
    given = {**MICRO, **changes}
    return ScaffoldGAN(**given).fit(gray() if exemplar is None else exemplar)


@pytest.fixture(scope="module")
def small() -> ScaffoldGAN:
    return micro()


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> ScaffoldGAN:
    """The preset for CPUs, for about a minute of one core."""
    exemplar = spinodal((64, 64, 64), porosity=0.6, seed=1)
    engine = ScaffoldGAN(preset="tiny", variant="extended", iterations=250, device="cpu")
    return engine.fit(exemplar, folder=tmp_path_factory.mktemp("trained"))


# --- what training achieves -------------------------------------------------------------------


def test_a_minute_of_training_beats_white_noise_and_an_untrained_network_by_far(
    trained: ScaffoldGAN, rng: np.random.Generator
) -> None:
    judge = Judge(trained._phases.phase > 0)
    shape = (96, 96, 96)
    matched = trained.sample(shape, seed=5)
    found = judge(matched.array > trained.threshold_, matched.array).figures
    noise = judge(rng.random(shape) > trained.porosity_, matched.array).figures

    untrained = ScaffoldGAN(preset="tiny", device="cpu")
    untrained._learn(trained.exemplar_)
    step = untrained._step(torch.from_numpy(untrained._scaling.field(trained.exemplar_)), None)
    network = step.networks["generator"]
    untrained._calibrate(network)
    untrained._adopt(network.state_dict(), torch.device("cpu"))
    untrained.training_, untrained.origin_ = {}, {}
    raw = untrained.sample(shape, seed=5)
    blank = judge(raw.array > trained.threshold_, raw.array).figures

    for name, noise_value, limit in (
        ("two_point_error_percent", 28, 10),
        ("covariance_error_percent", 99, 33),
    ):
        assert noise[name] > noise_value
        assert found[name] < limit
        assert found[name] < noise[name] / 2.5
        assert found[name] < blank[name] / 2.5
    # Of the generator by itself, and of the volume cut at the exemplar's porosity.
    own = matched.metadata["poresynth"]["raw_porosity"]
    assert own == pytest.approx(trained.porosity_, rel=0.05)
    assert found["porosity"] == pytest.approx(trained.porosity_, abs=1 / matched.array.size)
    assert found["axis_repeat"] < 0.3


def test_the_kept_generator_is_the_one_of_the_best_comparison(trained: ScaffoldGAN) -> None:
    facts = trained.training_
    assert facts["iterations"] == 250
    assert facts["kept"] in range(50, 251, 50)
    assert facts["figures"]["porosity_error_percent"] < 10


# --- what comes out ---------------------------------------------------------------------------


def test_porosity_and_histogram_are_the_exemplars(small: ScaffoldGAN) -> None:
    made = small.sample((40, 33, 37), seed=1)
    exemplar, threshold = small.exemplar_.array, small.threshold_
    assert made.dtype == exemplar.dtype
    assert made.shape == (40, 33, 37)
    assert abs((made.array <= threshold).mean() - small.porosity_) <= 1 / made.array.size
    for q in (0.05, 0.25, 0.5, 0.75, 0.95):
        assert abs(float(np.quantile(made.array, q)) - float(np.quantile(exemplar, q))) <= 2


def test_a_wanted_porosity_is_met(small: ScaffoldGAN) -> None:
    made = small.sample((30, 30, 30), porosity=0.3)
    assert (made.array <= small.threshold_).mean() == pytest.approx(0.3, abs=1 / 27000)


def test_a_porosity_map_is_followed(trained: ScaffoldGAN, tmp_path: Path) -> None:
    def ramp(z: np.ndarray, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        return 0.45 + 0.3 * z / 72 + 0 * (y + x)

    made = trained.sample((72, 48, 48), porosity=ramp)
    pore = made.array <= trained.threshold_
    for part in np.array_split(np.arange(72), 3):
        assert pore[part].mean() == pytest.approx(0.45 + 0.3 * (part.mean() + 0.5) / 72, abs=0.03)
    assert made.metadata["poresynth"]["grading"]["mean_absolute_error_percent"] < 1
    for wrong in (
        lambda: trained.sample((8, 8, 8), porosity=ramp, cut_at="exemplar"),
        lambda: trained.sample_to(tmp_path / "x.zarr", (8, 8, 8), porosity=ramp),  # type: ignore[arg-type]
    ):
        with pytest.raises(ParameterError, match="porosity"):
            wrong()


def test_the_exemplars_threshold_gives_the_raw_porosity(small: ScaffoldGAN) -> None:
    made = small.sample((30, 30, 30), cut_at="exemplar")
    raw = made.metadata["poresynth"]["raw_porosity"]
    assert (made.array <= small.threshold_).mean() == pytest.approx(raw)
    matched = small.sample((30, 30, 30))
    assert matched.metadata["poresynth"]["raw_porosity"] == raw


def test_seeds_repeat_and_differ(small: ScaffoldGAN) -> None:
    a, b, c = (small.sample((20, 20, 20), seed=s).array for s in (1, 1, 2))
    assert np.array_equal(a, b)
    assert (a != c).mean() > 0.2


@pytest.mark.parametrize("kind", ["bool", "binary", "dark", "label", "float", "uint16", "colours"])
def test_every_kind_of_exemplar_comes_out_as_its_kind(kind: str) -> None:
    volume = gray()
    options: dict[str, Any] = {}
    if kind == "bool":
        exemplar: np.ndarray = volume > 125
    elif kind == "binary":
        exemplar = np.where(volume > 125, 9, -3).astype(np.int16)
    elif kind == "dark":
        exemplar, options = 255 - volume, {"solid": "dark"}
    elif kind == "label":
        exemplar = labels()
    elif kind == "colours":
        exemplar = np.stack([volume, 255 - volume, volume // 2], -1)
    else:
        exemplar = volume.astype(kind) * 3
    engine = micro(exemplar, **options)
    made = engine.sample((30, 24, 26), seed=2)
    assert made.dtype == exemplar.dtype
    assert made.array.shape == (30, 24, 26, *exemplar.shape[3:])
    raw = engine.sample((30, 24, 26), seed=2, cut_at="exemplar").array
    assert raw.dtype == exemplar.dtype
    if kind in ("bool", "binary", "label"):
        assert set(np.unique(made.array)) == set(np.unique(exemplar))
        assert set(np.unique(raw)) <= set(np.unique(exemplar))
        for value in np.unique(exemplar):
            share = (exemplar == value).mean()
            assert (made.array == value).mean() == pytest.approx(share, abs=2 / made.array.size)
    else:
        first = made.array if made.array.ndim == 3 else made.array[..., 0]
        pore = first > engine.threshold_ if kind == "dark" else first <= engine.threshold_
        assert pore.mean() == pytest.approx(engine.porosity_, abs=0.002)


def test_a_mask_limits_what_counts(small: ScaffoldGAN) -> None:
    mask = np.zeros((30, 30, 30), bool)
    mask[5:20, 3:28, 10:30] = True
    made = small.sample(mask.shape, mask=mask).array
    assert (made[mask] <= small.threshold_).mean() == pytest.approx(small.porosity_, abs=2e-4)
    assert (made[~mask] == small.exemplar_.array.min()).all()


def test_provenance_says_all(small: ScaffoldGAN) -> None:
    origin = small.sample((16, 16, 16), seed=3).metadata["poresynth"]
    assert origin["engine"] == "scaffoldgan"
    assert origin["seed"] == 3
    assert origin["parameters"] == small.parameters_.model_dump(mode="json")
    assert origin["training"]["kept"] == small.training_["kept"]
    assert origin["exemplar"]["threshold"] == small.threshold_
    json.dumps(origin)


# --- windows ----------------------------------------------------------------------------------


def test_a_window_of_a_large_volume_has_the_bits_of_the_whole(trained: ScaffoldGAN) -> None:
    whole = trained.sample((110, 90, 70), seed=4, cut_at="exemplar").array
    part = trained.sample((50, 40, 30), seed=4, cut_at="exemplar", start=(31, 44, 17)).array
    assert np.array_equal(part, whole[31:81, 44:84, 17:47])
    one = trained.sample((110, 90, 70), seed=4, cut_at="exemplar", threads=1).array
    assert np.array_equal(one, whole)


def test_a_periodic_volume_tiles_without_a_seam(small: ScaffoldGAN) -> None:
    made = small.sample((32, 40, 36), seed=4, boundary="periodic", cut_at="exemplar")
    moved = small.sample(
        (32, 40, 36), seed=4, boundary="periodic", cut_at="exemplar", start=(5, -9, 50)
    )
    assert np.array_equal(np.roll(made.array, (-5, 9, -50), (0, 1, 2)), moved.array)
    with pytest.raises(ParameterError, match="must be multiples of 4 along each axis"):
        small.sample((32, 40, 37), boundary="periodic")


@pytest.mark.parametrize("name", ["new.tif", "new.zarr"])
def test_blocks_on_the_disk_are_the_volume_in_memory(
    trained: ScaffoldGAN, tmp_path: Path, name: str
) -> None:
    shape = (140, 40, 133)
    found = trained.sample_to(tmp_path / name, shape, seed=6, cut_at="exemplar")
    expected = trained.sample(shape, seed=6, cut_at="exemplar")
    written = io.read(tmp_path / name)
    assert np.array_equal(written.array, expected.array)
    raw = expected.metadata["poresynth"]["raw_porosity"]
    assert found == {"porosity": pytest.approx(raw), "raw_porosity": pytest.approx(raw)}
    assert written.metadata["poresynth"]["seed"] == 6


def test_blocks_on_the_disk_have_the_exemplars_porosity_and_grays(
    trained: ScaffoldGAN, tmp_path: Path
) -> None:
    shape = (140, 40, 133)
    found = trained.sample_to(tmp_path / "new.tif", shape, seed=6)
    written, expected = io.read(tmp_path / "new.tif").array, trained.sample(shape, seed=6)
    assert found["porosity"] == pytest.approx(trained.porosity_, abs=1e-3)
    assert (written <= trained.threshold_).mean() == pytest.approx(found["porosity"])
    assert found["raw_porosity"] == pytest.approx(expected.metadata["poresynth"]["raw_porosity"])
    # But for the levels, the ranks are those of the volume in memory.
    apart = np.abs(written.astype(float) - expected.array)
    assert np.quantile(apart, 0.99) <= 2
    wanted = trained.sample_to(tmp_path / "new.tif", shape, seed=6, porosity=0.35)
    assert wanted["porosity"] == pytest.approx(0.35, abs=1e-3)


@pytest.mark.parametrize("solid", ["bright", "dark"])
def test_the_map_of_levels_is_the_ranking(solid: str) -> None:
    exemplar = gray() if solid == "bright" else 255 - gray()
    engine = ScaffoldGAN(**MICRO, solid=solid)
    engine._learn(Volume(exemplar))
    field = np.tanh(np.random.default_rng(0).normal(0, 1, (1, 40, 40, 40))).astype(np.float32)
    level_map = LevelMap(engine._scaling, exemplar)
    for part in np.array_split(field, 3, axis=1):
        level_map.see(part)
    level_map.settle()
    values = level_map(field)
    pore = values <= engine.threshold_ if solid == "bright" else values > engine.threshold_
    assert pore.mean() == pytest.approx(engine.porosity_, abs=1e-4)
    order = np.argsort(field.ravel(), kind="stable")
    assert (np.diff(values.ravel()[order].astype(int)) >= 0).all()
    for q in (0.1, 0.3, 0.5, 0.7, 0.9):
        assert abs(float(np.quantile(values, q)) - float(np.quantile(exemplar, q))) <= 1


@pytest.mark.parametrize("porosity", [None, 0.2])
def test_the_map_of_labels_is_the_ranking(
    porosity: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All voxels in one sample: the cut of the volume in memory, but for a few; then a part."""
    exemplar = labels()
    engine = ScaffoldGAN(**MICRO)
    engine._learn(Volume(exemplar))
    random = np.random.default_rng(0)
    lead = np.array([1, 0, -2])[:, None, None, None]
    field = np.tanh(random.normal(0, 1, (3, 40, 40, 40)) + lead).astype(np.float32)
    request = engine_request(exemplar, field.shape[1:], porosity)
    expected = engine._phases.labels[cut(engine._phases, field, request)]
    wanted = engine._phases.wanted(field[0].size, porosity)
    for sample, share, apart in ((1 << 20, 2e-4, 3e-3), (20000, 0.01, 0.02)):
        monkeypatch.setattr(matching, "SAMPLE", sample)
        label_map = LabelMap(engine._scaling, field[0].size, porosity)
        for part in np.array_split(field, 3, axis=1):
            label_map.see(part)
        label_map.settle()
        found = label_map(field)
        counts = [(found == label).sum() for label in engine._phases.labels]
        assert np.abs(np.array(counts) - wanted).max() <= share * found.size
        assert (found != expected).mean() < apart


def test_a_phase_that_is_not_wanted_is_not_made() -> None:
    engine = ScaffoldGAN(**MICRO)
    engine._learn(Volume(labels()))
    label_map = LabelMap(engine._scaling, 8000, porosity=0.0)
    field = np.random.default_rng(0).uniform(-1, 1, (3, 20, 20, 20)).astype(np.float32)
    label_map.see(field)
    label_map.settle()
    assert set(np.unique(label_map(field))) == {5, 10}


def test_labels_on_the_disk_have_the_exemplars_shares(tmp_path: Path) -> None:
    exemplar = labels()
    engine = micro(exemplar)
    shape = (140, 40, 133)
    found = engine.sample_to(tmp_path / "new.zarr", shape, seed=6)
    written = io.read(tmp_path / "new.zarr").array
    for value in np.unique(exemplar):
        assert (written == value).mean() == pytest.approx((exemplar == value).mean(), abs=2e-3)
    assert found["porosity"] == pytest.approx((written == 0).mean())
    expected = engine.sample(shape, seed=6)
    assert found["raw_porosity"] == pytest.approx(expected.metadata["poresynth"]["raw_porosity"])
    assert (written != expected.array).mean() < 0.01


def test_channels_are_refused_before_the_work(tmp_path: Path) -> None:
    engine = micro(np.stack([gray(), 255 - gray()], -1), iterations=3)
    for cut_at in ("porosity", "exemplar"):
        with pytest.raises(ParameterError, match=r"channels = 2: .*block by block"):
            engine.sample_to(tmp_path / "new.zarr", (20, 20, 20), cut_at=cut_at, progress=never)
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_cannot_be_written_in_parts_is_refused_before_the_work(
    small: ScaffoldGAN, tmp_path: Path
) -> None:
    for name in ("new.png", "no/such.tif"):
        with pytest.raises(FileError, match=name):
            small.sample_to(tmp_path / name, (20, 20, 20), progress=never)
    for start in ((1, 2), "abc"):
        with pytest.raises(ParameterError, match="start"):
            small.sample_to(tmp_path / "new.tif", (20, 20, 20), start=start, progress=never)
    assert list(tmp_path.iterdir()) == []


# --- files ------------------------------------------------------------------------------------


def test_what_was_saved_samples_the_same(small: ScaffoldGAN, tmp_path: Path) -> None:
    path = tmp_path / "model.safetensors"
    small.save(path)
    again = ScaffoldGAN.load(path, device="cpu")
    assert again.parameters_ == small.parameters_
    assert again.training_ == small.training_
    for options in ({}, {"cut_at": "exemplar"}, {"boundary": "periodic"}):
        a, b = (e.sample((24, 24, 24), seed=8, **options).array for e in (small, again))
        assert np.array_equal(a, b)
    assert type(load_model(tmp_path)) is ScaffoldGAN
    assert path.stat().st_mode & 0o044


def test_a_model_is_tensors_and_json(small: ScaffoldGAN, tmp_path: Path) -> None:
    small.save(tmp_path / "m.safetensors")
    with safe_open(tmp_path / "m.safetensors", "np") as file:
        facts = json.loads(file.metadata()["poresynth"])
        assert np.array_equal(file.get_tensor("exemplar"), small.exemplar_.array)
    assert facts["engine"] == "scaffoldgan"
    assert facts["parameters"]["latent"] == 4


def test_a_mapped_exemplar_can_be_saved(tmp_path: Path) -> None:
    io.write(tmp_path / "e.tif", Volume(gray(), 5.0, "µm"))
    engine = micro(io.read(tmp_path / "e.tif"), iterations=3)
    engine.save(tmp_path / "m.safetensors")
    again = ScaffoldGAN.load(tmp_path / "m.safetensors")
    assert (again.exemplar_.voxel_size, again.exemplar_.unit) == ((5.0, 5.0, 5.0), "µm")


def test_what_is_no_model(tmp_path: Path, small: ScaffoldGAN) -> None:
    with pytest.raises(FileError, match="no such file or folder"):
        ScaffoldGAN.load(tmp_path / "none.safetensors")
    with pytest.raises(FileError, match="holds no model yet"):
        ScaffoldGAN.load(tmp_path)
    path = tmp_path / "m.safetensors"
    small.save(path)
    whole = path.read_bytes()
    for damaged in (whole[:-50], b"PK\x03\x04 a pickle", b""):
        path.write_bytes(damaged)
        with pytest.raises(FileError, match="not a model, or damaged"):
            ScaffoldGAN.load(path)


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"precision": "bfloat16", "channels_last": True, "accumulate": 2},
        {"precision": "float16", "channels_last": True, "accumulate": 2},
    ],
)
def test_a_resumed_training_is_the_uninterrupted_one_bit_for_bit(
    tmp_path: Path, changes: dict[str, Any]
) -> None:
    options = {**MICRO, "variant": "extended", "ema": 0.5, "table": 20, **changes}
    whole = ScaffoldGAN(**options).fit(gray(), folder=tmp_path / "whole")

    def stop(stage: str, fraction: float) -> None:
        if fraction > 0.6:
            raise InterruptedError

    with pytest.raises(InterruptedError):
        ScaffoldGAN(**options).fit(gray(), folder=tmp_path / "parts", progress=stop)
    again = ScaffoldGAN(**options).fit(gray(), folder=tmp_path / "parts", resume=True)
    a, b = whole.generator_.state_dict(), again.generator_.state_dict()
    assert all(torch.equal(a[name], b[name]) for name in a)
    lines = (tmp_path / "parts" / "log.jsonl").read_text().splitlines()
    assert [json.loads(line)["iteration"] for line in lines] == [3, 6, 9, 12]
    assert whole.training_["figures"] == again.training_["figures"]


def test_another_exemplar_or_network_is_not_resumed(tmp_path: Path) -> None:
    micro_folder = tmp_path / "m"
    ScaffoldGAN(**MICRO).fit(gray(), folder=micro_folder)
    with pytest.raises(ParameterError, match=r"exemplar = .* to be resumed"):
        ScaffoldGAN(**MICRO).fit(gray(1), folder=micro_folder, resume=True)
    other = {**MICRO, "latent": 5}
    with pytest.raises(FileError, match="a checkpoint of other networks"):
        ScaffoldGAN(**other).fit(gray(), folder=micro_folder, resume=True)


# --- variants and parameters ------------------------------------------------------------------


@pytest.mark.parametrize("variant", list(VARIANTS))
def test_every_variant_trains_with_its_losses(variant: str, tmp_path: Path) -> None:
    micro(variant=variant, patch_halvings=1, iterations=3, evaluate_every=3)
    engine = ScaffoldGAN(**{**MICRO, "variant": variant, "patch_halvings": 1, "iterations": 3})
    engine.fit(gray(), folder=tmp_path)
    line = json.loads((tmp_path / "log.jsonl").read_text())
    extra = {
        "gram": {"gram"},
        "structural": {"structural"},
        "full": {"gram", "structural"},
        "extended": {"gram", "structural", "porosity", "two_point"},
    }.get(variant, set())
    assert set(line["losses"]) >= {"discriminator", "adversarial", *extra}
    assert set(line["losses"]) <= {"discriminator", "adversarial", "sliced_wasserstein", *extra}


def test_regions_of_other_aspect_ratios(tmp_path: Path) -> None:
    losses = {}
    for shapes in ("cubes", "cuboids", "both"):
        options = {"region_shapes": shapes, "regions": (2,), "iterations": 1, "evaluate_every": 1}
        ScaffoldGAN(**{**MICRO, **options}).fit(gray(), folder=tmp_path / shapes)
        line = json.loads((tmp_path / shapes / "log.jsonl").read_text())
        losses[shapes] = line["losses"]["structural"]
    # One cube and three cuboids have the same weight each.
    assert losses["cubes"] != pytest.approx(losses["cuboids"], rel=1e-3)
    assert 4 * losses["both"] == pytest.approx(losses["cubes"] + 3 * losses["cuboids"], rel=1e-4)


def test_soft_porosity_and_the_bias_hold_a_one_sided_exemplar(tmp_path: Path) -> None:
    """Of 92 % void: without them a generator swings between all void and half of it."""
    exemplar = spinodal((48, 48, 48), porosity=0.92, wavelength=10, seed=3)
    networks = {"latent": 8, "generator_maps": (16, 8), "discriminator_maps": (8, 16)}
    options = {**MICRO, **networks, "iterations": 60, "batch": 4, "learning_rate": 0.003}
    errors = []
    for on in (False, True):
        folder = tmp_path / str(on)
        losses = {"output_bias": on, "porosity_weight": 10.0 * on, "evaluate_every": 10}
        ScaffoldGAN(**{**options, **losses, "training_seed": 3}).fit(exemplar, folder=folder)
        lines = (folder / "log.jsonl").read_text().splitlines()
        found = [json.loads(line)["figures"]["porosity_error_percent"] for line in lines]
        errors.append(np.mean(found))
    assert errors[1] < errors[0] / 2


def test_endless_and_single_latents_both_train() -> None:
    for latents in ("one", "endless"):
        assert micro(latents=latents, iterations=3).parameters_.latents == latents


@pytest.mark.parametrize(
    "options",
    [{"channels_last": True}, {"precision": "bfloat16"}, {"precision": "float16"}],
)
def test_options_of_speed_train(options: dict[str, Any]) -> None:
    micro(iterations=3, **options)


@pytest.mark.parametrize("preset", list(PRESETS))
@pytest.mark.parametrize("variant", list(VARIANTS))
def test_presets_and_variants_go_together(preset: str, variant: str) -> None:
    p = resolve({"preset": preset, "variant": variant})
    assert (p.preset, p.variant) == (preset, variant)
    assert p.crop == (32 if preset == "tiny" else 64)


def test_the_papers_preset_has_the_papers_numbers() -> None:
    p = resolve({"preset": "paper"})
    assert (p.batch, p.iterations, p.learning_rate, p.momentum) == (100, 40000, 2e-4, 0.5)
    assert (p.structural_weight, p.gram_weight) == (1.0, 0.1)
    assert (p.latent, p.stride, p.regions) == (100, 2, (8, 4, 2))
    assert (p.ema, p.symmetry, p.table, p.latents) == (0.0, "none", None, "one")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"latent": 0}, "latent = 0"),
        ({"preset": "huge"}, "preset = huge"),
        ({"variant": "wgan"}, "variant = wgan"),
        ({"batch": 10, "accumulate": 3}, "accumulate = 3: must divide the batch, 10"),
        ({"generator_maps": (8, 8, 8)}, "discriminator_maps"),
        ({"generator_maps": 8}, "generator_maps = 8: must be a list"),
        ({"regions": (16, 1)}, "regions"),
        ({"regions": ()}, r"regions = \(\): must have at least 1 item$"),
        ({"regions": (2, 0)}, r"regions = \(2, 0\): must be at least 1"),
        ({"regions": (2, 1), "region_shapes": "cuboids"}, "must be even .* for cuboids"),
        ({"regions": (2, 4), "region_shapes": "both"}, "8 voxels of layer 1, whose edge is 4"),
        ({"learning_rate": float("nan")}, "learning_rate"),
        ({"device": "quantum"}, "device = quantum"),
    ],
)
def test_bad_parameters_are_named(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        micro(**options)


@pytest.mark.parametrize(
    ("exemplar", "message"),
    [
        (np.zeros((24, 24, 24)), "constant"),
        (np.full((24, 24, 24), np.nan), "exemplar"),
        (np.zeros((0, 24, 24)), "exemplar"),
        (gray()[:12], "at least 16 voxels along each axis"),
        (gray()[0], "ndim"),
    ],
)
def test_bad_exemplars_are_named(exemplar: np.ndarray, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        micro(exemplar)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"shape": (0, 4, 4)}, "shape"),
        ({"shape": (4, 4)}, "shape"),
        ({"seed": -1}, "seed"),
        ({"boundary": "torus"}, "boundary"),
        ({"porosity": 1.5}, "porosity"),
        ({"porosity": 0.5, "cut_at": "exemplar"}, "porosity"),
        ({"cut_at": "otsu"}, "cut_at"),
        ({"known": gray()}, "known = given: cannot be kept"),
        ({"mask": np.zeros((16, 16, 16), bool)}, "mask"),
        ({"threads": -1}, "threads"),
        ({"start": (1, 2)}, r"start = \(1, 2\): must be three integers"),
        ({"start": (0.5, 0, 0)}, "start"),
        ({"start": 3}, "start"),
    ],
)
def test_bad_requests_are_named(small: ScaffoldGAN, options: dict[str, Any], message: str) -> None:
    shape = options.pop("shape", (16, 16, 16))
    with pytest.raises(ParameterError, match=message):
        small.sample(shape, **options)


def test_an_engine_that_saw_nothing_makes_nothing() -> None:
    with pytest.raises(ParameterError, match="must see an exemplar first"):
        ScaffoldGAN().sample((32, 32, 32))


def test_a_volume_that_cannot_fit_is_refused_with_the_numbers(small: ScaffoldGAN) -> None:
    with pytest.raises(MemoryEstimateError, match="needs about"):
        small.sample((10**5, 10**5, 10**5))


def test_memory_is_stated_before_the_work_and_blocks_bound_it(small: ScaffoldGAN) -> None:
    whole = [small.estimate_memory((n, n, n)) for n in (256, 512)]
    assert whole[1] > 7 * whole[0]
    blocks = [small.estimate_memory((n, n, n), blockwise=True) for n in (256, 1024)]
    assert blocks[0] == blocks[1] < whole[0]
    # Each thread has a tile under way.
    assert small.estimate_memory((64, 64, 64), threads=40) > small.estimate_memory((64, 64, 64))
    several = micro(labels(), iterations=3)
    more = several.estimate_memory((1024, 1024, 1024), blockwise=True)
    assert more > blocks[0] + 3 * 12 * 2**20


def test_sampling_can_be_interrupted(small: ScaffoldGAN, tmp_path: Path) -> None:
    def stop(stage: str, fraction: float) -> None:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        small.sample((64, 64, 64), progress=stop)
    with pytest.raises(ZeroDivisionError):
        small.sample_to(tmp_path / "new.tif", (64, 64, 64), progress=stop)
    assert list(tmp_path.iterdir()) == []


def test_it_is_an_engine_by_name() -> None:
    assert get_engine("scaffoldgan") is ScaffoldGAN
