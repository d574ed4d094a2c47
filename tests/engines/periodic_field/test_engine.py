"""The engine: what a minute of training achieves, windows, files, images, errors."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from poresynth import io
from poresynth.engines import get_engine, load_model
from poresynth.engines.neural.judge import Judge
from poresynth.engines.periodic_field import PeriodicField
from poresynth.errors import FileError, ParameterError
from poresynth.exemplars import spinodal
from poresynth.volume import Volume

# A network and a training as small as they can be: for what does not depend on quality.
QUICK: dict[str, Any] = {
    "iterations": 60,
    "evaluate_every": 30,
    "learning_rate": 2e-2,
    "width": 16,
    "places": 64,
    "grids": 8,
    "filters": 16,
    "reach": 12,
    "start_iterations": 0,
    "device": "cpu",
}


def quick(exemplar: Any, **parameters: Any) -> PeriodicField:
    return PeriodicField(**{**QUICK, **parameters}).fit(exemplar)


def blobs(shape: tuple[int, ...] = (48, 40), seed: int = 0) -> np.ndarray:
    """Grays of an image or a volume with two phases."""
    from scipy import ndimage

    smooth = ndimage.gaussian_filter(np.random.default_rng(seed).random(shape), 2, mode="wrap")
    steep = 1 / (1 + np.exp(-40 * (smooth - np.median(smooth))))
    return (60 + 130 * steep).astype(np.uint8)


@pytest.fixture(scope="module")
def volume() -> Volume:
    return spinodal((64, 64, 64), seed=1)


@pytest.fixture(scope="module")
def trained(volume: Volume) -> PeriodicField:
    """What half a minute on one core makes."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        return PeriodicField(
            iterations=300, start_iterations=100, places=384, grids=32, device="cpu"
        ).fit(volume)
    finally:
        torch.set_num_threads(threads)


def test_a_tiny_training_is_far_better_than_white_noise(
    trained: PeriodicField, volume: Volume
) -> None:
    assert trained.threshold_ is not None
    own = volume.array > trained.threshold_
    judge = Judge(own)
    noise = np.random.default_rng(1).random(own.shape) < own.mean()
    worst = judge(noise, noise).figures
    repeat = judge(own, own).figures["axis_repeat"]
    for seed in (1, 2):
        # Two thresholds: the generator's own, and the exemplar's porosity.
        plain = trained.sample((80, 80, 80), seed=seed, cut_at="exemplar").array
        found = judge(plain > trained.threshold_, plain).figures
        assert found["porosity_error_percent"] < 5
        matched = trained.sample((80, 80, 80), seed=seed).array
        found = judge(matched > trained.threshold_, matched).figures
        assert found["porosity_error_percent"] < 0.01
        assert found["two_point_error_percent"] < 0.5 * worst["two_point_error_percent"]
        assert found["covariance_error_percent"] < 0.4 * worst["covariance_error_percent"]
        # No lattice shows.
        assert found["axis_repeat"] < 1.5 * repeat


def test_windows_of_values_have_the_bits_of_the_whole(trained: PeriodicField) -> None:
    whole = trained.sample((40, 50, 45), seed=7, cut_at="exemplar").array
    part = trained.sample((11, 20, 9), seed=7, cut_at="exemplar", start=(20, 5, 30)).array
    np.testing.assert_array_equal(part, whole[20:31, 5:25, 30:39])
    one = trained.sample((40, 50, 45), seed=7, cut_at="exemplar", threads=1).array
    np.testing.assert_array_equal(one, whole)


def test_seeds_differ_and_the_same_seed_does_not(trained: PeriodicField) -> None:
    first, again, other = (trained.sample((24, 24, 24), seed=s).array for s in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert (first != other).mean() > 0.2


@pytest.mark.parametrize("porosity", [None, 0.3])
def test_the_porosity_is_exact(trained: PeriodicField, porosity: float | None) -> None:
    made = trained.sample((40, 40, 40), porosity=porosity)
    wanted = trained.porosity_ if porosity is None else porosity
    assert abs((made.array <= trained.threshold_).mean() - wanted) <= 1.5 / made.array.size
    assert 0 < made.metadata["poresynth"]["raw_porosity"] < 1


def test_a_periodic_volume_of_any_shape_wraps(trained: PeriodicField) -> None:
    shape = (47, 60, 71)
    made = trained.sample(shape, boundary="periodic", cut_at="exemplar")
    origin = made.metadata["poresynth"]
    assert all(abs(factor - 1) < 0.15 for factor in origin["stretch"])
    across = trained.sample(shape, boundary="periodic", cut_at="exemplar", start=(-9, 5, 20))
    np.testing.assert_array_equal(across.array, np.roll(made.array, (9, -5, -20), (0, 1, 2)))
    part = trained.sample(
        (12, 9, 10), boundary="periodic", cut_at="exemplar", start=(-3, 2, 50), whole=shape
    )
    expected = np.roll(made.array, (3, -2, -50), (0, 1, 2))[:12, :9, :10]
    np.testing.assert_array_equal(part.array, expected)
    with pytest.raises(ParameterError, match="for a periodic output"):
        trained.sample((4, 60, 60), boundary="periodic")


def test_a_field_is_had_finer_than_voxels(trained: PeriodicField, volume: Volume) -> None:
    plain = trained.sample_field((24, 24, 24), seed=3)
    fine = trained.sample_field((72, 72, 72), seed=3, resolution=3)
    assert fine.voxel_size == pytest.approx((1 / 3,) * 3)
    # The middle of every third voxel is that of a voxel of the exemplar's size.
    np.testing.assert_allclose(fine.array[1::3, 1::3, 1::3], plain.array, atol=1e-3)
    assert np.abs(plain.array).max() <= trained.parameters_.clip
    # It is a distance: its slope near the surface is about one voxel a voxel.
    slope = np.linalg.norm(np.gradient(fine.array, 1 / 3), axis=0)
    near = np.abs(fine.array) < 1
    assert 0.5 < np.median(slope[near]) < 1.6


def test_blocks_on_the_disk_are_the_volume(trained: PeriodicField, tmp_path: Path) -> None:
    shape = (140, 30, 33)
    found = trained.sample_to(tmp_path / "large.zarr", shape, seed=4, cut_at="exemplar")
    expected = trained.sample(shape, seed=4, cut_at="exemplar")
    stored = io.read(tmp_path / "large.zarr")
    np.testing.assert_array_equal(stored.array, expected.array)
    assert found["raw_porosity"] == pytest.approx(
        expected.metadata["poresynth"]["raw_porosity"], abs=1e-9
    )
    found = trained.sample_to(tmp_path / "large.tif", shape, seed=4)
    assert found["porosity"] == pytest.approx(trained.porosity_, abs=1e-3)
    fine = trained.sample_to(tmp_path / "fine.tif", (20, 20, 20), cut_at="exemplar", resolution=2)
    assert 0 < fine["porosity"] < 1
    assert io.read(tmp_path / "fine.tif").voxel_size == (0.5, 0.5, 0.5)


def test_a_saved_engine_samples_the_same(trained: PeriodicField, tmp_path: Path) -> None:
    trained.save(tmp_path / "model.safetensors")
    made = trained.sample((20, 24, 28), seed=9)
    for loaded in (
        PeriodicField.load(tmp_path / "model.safetensors", device="cpu"),
        load_model(tmp_path / "model.safetensors", device="cpu"),
    ):
        assert loaded.period_ == trained.period_
        np.testing.assert_array_equal(loaded.sample((20, 24, 28), seed=9).array, made.array)
    (tmp_path / "broken.safetensors").write_bytes(b"nothing of the kind")
    with pytest.raises(FileError, match="broken"):
        PeriodicField.load(tmp_path / "broken.safetensors")


def test_the_noise_scale_changes_the_structure_and_one_does_not(trained: PeriodicField) -> None:
    plain = trained.sample((40, 40, 40), seed=1, cut_at="exemplar").array
    same = trained.sample((40, 40, 40), seed=1, cut_at="exemplar", noise_scale=1.0).array
    np.testing.assert_array_equal(plain, same)
    fields = [trained.sample_field((64, 64, 64), noise_scale=s).array for s in (0.7, 2.0)]
    slopes = [np.abs(np.diff(f, axis=0)).mean() for f in fields]
    assert slopes[0] > 1.2 * slopes[1]


def test_a_constant_latent_tiles() -> None:
    engine = quick(lattice(16, 22), kind="gray")
    assert engine.period_reason_ == "phases encoded along y, x, where the period is clear or given"
    shape = (1, *(round(t) for t in engine.period_))
    options = {"latent": "constant", "boundary": "periodic"}
    tile = engine.sample_field(shape, **options).array
    assert tile.std() > 0.1
    twice = (1, *(2 * n for n in shape[1:]))
    found = engine.sample_field(twice, **options, whole=shape).array
    np.testing.assert_array_equal(found, np.tile(tile, (1, 2, 2)))


def test_a_mirrored_output_is_symmetric(trained: PeriodicField) -> None:
    mirrored = trained.sample_field((33, 40, 36), mirrored=True).array
    for axis in range(3):
        np.testing.assert_array_equal(mirrored, np.flip(mirrored, axis))


def test_a_medium_without_a_period_has_no_place_that_differs(trained: PeriodicField) -> None:
    assert trained.period_reason_ == "no phase encoded, for along no axis is a period clear"
    with pytest.raises(ParameterError, match="latent = constant: needs a period that is encoded"):
        trained.sample((8, 8, 8), latent="constant")
    asked = quick(blobs(), encoded="all")
    assert asked.generator_.encoded.all()
    assert asked.period_reason_.endswith("as asked")


def test_a_period_may_be_but_the_scale_of_the_latent_field() -> None:
    given = {"start_iterations": 5, "start_model": "edges of cells", "points": (1, 4)}
    engine = quick(lattice(16, 22), kind="gray", period=20.0, encoded="none", **given)
    assert not engine.generator_.encoded.any()
    assert engine.period_reason_ == "no phase encoded, as asked"
    # Points are a period apart, and are not left out, though a period is clear.
    assert engine.generator_.spacing.tolist() == [2.0, 2.0]
    assert engine.training_["start"].startswith("edges of cells")
    assert engine.parameters_.points == (1, 4)
    assert engine.sample((1, 30, 30), seed=1).array.std() > 0


def test_a_mask_is_where_it_matters(trained: PeriodicField) -> None:
    mask = np.zeros((30, 30, 30), bool)
    mask[5:25, 5:25, 5:25] = True
    made = trained.sample((30, 30, 30), mask=mask, porosity=0.4).array
    assert (made[~mask] <= trained.threshold_).all()
    assert (made[mask] <= trained.threshold_).mean() == pytest.approx(0.4, abs=1e-3)


def test_the_provenance_says_how_it_was_made(trained: PeriodicField) -> None:
    origin = trained.sample((16, 16, 16), seed=5, noise_scale=1.5).metadata["poresynth"]
    assert origin["engine"] == "ipfn"
    assert (origin["seed"], origin["noise_scale"], origin["latent"]) == (5, 1.5, "random")
    assert origin["parameters"]["bandwidth"] == 1
    assert len(origin["period"]) == 3
    assert origin["field"] == "distance"


# --- training --------------------------------------------------------------------------------


def test_a_training_repeats_itself_and_goes_on_exactly(tmp_path: Path) -> None:
    image, steady = blobs(), {**QUICK, "schedule": "constant"}
    whole = PeriodicField(**steady).fit(image)
    again = PeriodicField(**steady).fit(image)
    np.testing.assert_array_equal(whole.sample((1, 40, 40)).array, again.sample((1, 40, 40)).array)
    part = PeriodicField(**{**steady, "iterations": 30}).fit(image, folder=tmp_path / "run")
    assert part.training_["iterations"] == 30
    rest = PeriodicField(**steady).fit(image, folder=tmp_path / "run", resume=True)
    for name, tensor in whole.generator_.state_dict().items():
        torch.testing.assert_close(rest.generator_.state_dict()[name], tensor, rtol=0, atol=0)
    assert (tmp_path / "run" / "log.jsonl").exists()


def stripes(period: float) -> np.ndarray:
    line = 127.5 + 100 * np.sin(2 * np.pi * np.arange(128) / period)
    return np.tile(line, (128, 1)).astype(np.uint8)


def lattice(along_x: float, along_y: float) -> np.ndarray:
    y, x = np.meshgrid(np.arange(128), np.arange(128), indexing="ij")
    waves = np.cos(2 * np.pi * x / along_x) + np.cos(2 * np.pi * y / along_y)
    return (127.5 + 60 * waves).astype(np.uint8)


@pytest.mark.parametrize(
    ("image", "starts", "true"),
    [
        (stripes(16), (20.0, 18.5), (None, 16.0)),
        (lattice(16, 22), (18.5, 19.0), (22.0, 16.0)),
    ],
    ids=["stripes", "lattice"],
)
def test_a_wrong_period_is_put_right(
    image: np.ndarray, starts: tuple[float, float], true: tuple[float | None, float]
) -> None:
    engine = PeriodicField(
        kind="gray",
        period=starts,
        period_rate=1e-2,
        # With waves along the diagonals, too, a wrong period may do as well.
        diagonal=False,
        iterations=500,
        evaluate_every=500,
        places=192,
        reach=48,
        device="cpu",
    ).fit(image)
    for found, period in zip(engine.period_, true, strict=True):
        if period is not None:
            # A multiple of the period is one, too.
            assert found / round(found / period) == pytest.approx(period, rel=0.05)


def test_the_exemplars_period_is_where_training_starts() -> None:
    engine = quick(stripes(16), kind="gray", learn_period=False)
    assert engine.period_[1] == pytest.approx(16, rel=0.02)


def test_without_deformation_the_period_stays() -> None:
    engine = quick(blobs(), period="crop", learn_period=False, crop=32)
    assert engine.period_ == pytest.approx((31.0, 31.0))
    learned = quick(blobs(), period="crop", crop=32)
    assert learned.period_ != pytest.approx((31.0, 31.0), rel=1e-4)


@pytest.mark.parametrize("shift", ["period", "paper", "none"])
def test_the_shift_is_a_switch(shift: str) -> None:
    made = quick(blobs(), shift=shift).sample((1, 32, 32)).array
    assert made.shape == (1, 32, 32)


def test_the_papers_loss_and_field_train_too() -> None:
    engine = quick(
        blobs(),
        sliced_iterations=58,
        interpolation="paper",
        spacing=1.0,
        latents=5,
        groups=1,
        crop=32,
        batch=2,
        critic_maps=(4, 8),
        critic_steps=2,
        generator_steps=2,
    )
    assert engine.training_["iterations"] == 60
    assert engine.sample((1, 20, 20)).array.std() > 0


def test_the_papers_preset_is_the_papers() -> None:
    from poresynth.engines.periodic_field.parameters import resolve

    p = resolve({"preset": "paper"}, 3)
    assert (p.bandwidth, p.width, p.depth, p.latents, p.groups, p.spacing) == (5, 128, 10, 5, 1, 1)
    assert (p.crop, p.batch, p.iterations, p.learning_rate) == (64, 8, 12500, 1e-4)
    assert (p.critic_steps, p.generator_steps, p.penalty, p.sliced) == (5, 5, 10, 0)
    assert (p.critic_maps, p.interpolation, p.shift) == ((64, 128, 256, 512), "paper", "paper")
    assert resolve({"preset": "paper"}, 2).crop == 128
    assert resolve({"preset": "paper"}, 2, 3) == resolve({"preset": "paper"}, 2)


@pytest.mark.parametrize("preset", ["tiny", "small"])
def test_colours_are_trained_by_a_critic_and_other_exemplars_are_not(preset: str) -> None:
    from poresynth.engines.periodic_field.parameters import resolve

    given = {"preset": preset}
    assert resolve(given, 2, 3).sliced == 300 < resolve(given, 2, 3).iterations
    for axes, channels in ((2, 1), (3, 1), (3, 3)):
        found = resolve(given, axes, channels)
        assert found.sliced == found.iterations
    # What is given goes before.
    assert resolve({"preset": preset, "sliced_iterations": 7}, 2, 3).sliced == 7


# --- images ------------------------------------------------------------------------------------


@pytest.mark.parametrize("dtype", [bool, np.uint8, np.uint16, np.float32])
def test_images_of_every_type(dtype: type) -> None:
    image = blobs() > 125 if dtype is bool else blobs().astype(dtype)
    made = quick(image).sample((1, 60, 50))
    assert (made.shape, made.dtype) == ((1, 60, 50), image.dtype)
    cut = 0.5 if dtype is bool else 125
    assert 0 < (made.array > cut).mean() < 1


def test_colours_keep_their_channels() -> None:
    base = blobs().astype(float)
    image = np.stack([base, 255 - base, 0.5 * base + 40], axis=-1).astype(np.uint8)
    engine = quick(image, iterations=240)
    # Figures are of one channel: of colours the last generator is kept.
    assert engine.training_["kept"] == 240
    made = engine.sample((1, 64, 64))
    assert made.array.shape == (1, 64, 64, 3)
    red, green, _ = (made.array[..., k].astype(float).ravel() for k in range(3))
    assert np.corrcoef(red, green)[0, 1] < -0.6
    assert quick(np.concatenate([image] * 3, axis=-1)[None]).sample((1, 8, 8)).channels == 9


def test_labels_come_back_unblurred() -> None:
    labels = np.digitize(blobs(), (90, 150)) * 100
    made = quick(labels.astype(np.uint8), iterations=240).sample((1, 50, 50))
    assert set(np.unique(made.array)) <= {0, 100, 200}
    shares = np.bincount(made.array.ravel() // 100, minlength=3) / made.array.size
    own = np.bincount(labels.ravel() // 100, minlength=3) / labels.size
    np.testing.assert_allclose(shares, own, atol=1e-3)


def test_a_dark_solid() -> None:
    engine = quick(255 - blobs(), solid="dark", field="intensity")
    made = engine.sample((1, 40, 40))
    assert abs((made.array > engine.threshold_).mean() - engine.porosity_) < 2e-3


def test_a_distance_field_is_an_exemplar_of_its_own() -> None:
    from poresynth import _core

    solid = spinodal((32, 32, 32)).array > 125
    distance = _core.signed_distance(solid, 6, boundary="open")
    engine = quick(distance, threshold=0.0, kind="gray", field="intensity")
    made = engine.sample((20, 20, 20))
    assert made.dtype == np.float32
    assert abs((made.array <= 0).mean() - engine.porosity_) < 1e-3


# --- guidance ----------------------------------------------------------------------------------


def test_density_follows_the_guidance() -> None:
    # Stripes that are narrow on one side of the image and wide on the other.
    phase = np.cumsum(np.linspace(0.15, 1.2, 128))
    image = np.tile(np.sin(phase) > 0, (128, 1))
    engine = quick(
        image,
        guidance="density",
        crop=24,
        iterations=300,
        start_iterations=100,
        places=128,
        width=32,
    )

    def holes(guidance: Any) -> np.ndarray:
        field = engine.sample_field((1, 128, 128), seed=2, guidance=guidance).array[0]
        return np.abs(field)

    assert holes(0.0).mean() > 1.3 * holes(1.0).mean()
    gradient = holes((0.0, 1.0))
    assert gradient[:, :32].mean() > 1.2 * gradient[:, -32:].mean()
    ramp = np.linspace(0, 1, 128)[:, None] * np.ones((1, 128))
    turned = holes(ramp)
    assert turned[:32].mean() > 1.2 * turned[-32:].mean()


def test_a_direction_and_a_map_are_learned_and_saved(tmp_path: Path) -> None:
    image = blobs((48, 48))
    ramp = np.tile(np.linspace(5, 9, 48), (48, 1))
    for engine in (
        PeriodicField(**QUICK, guidance="direction", direction=(1.0, 0.0, 0.0)).fit(image),
        PeriodicField(**QUICK, guidance="map").fit(image, guidance=ramp),
    ):
        engine.save(tmp_path / "model.safetensors")
        loaded = PeriodicField.load(tmp_path / "model.safetensors", device="cpu")
        given = 6.0 if engine.parameters_.guidance == "map" else None
        first, second = (e.sample((1, 30, 30), guidance=given).array for e in (engine, loaded))
        np.testing.assert_array_equal(first, second)


def test_the_critic_sees_the_guidance() -> None:
    engine = PeriodicField(
        **{**QUICK, "sliced_iterations": 58},
        guidance="direction",
        direction=(0.0, 1.0, 0.0),
        crop=16,
        batch=2,
        critic_maps=(4, 8),
    )
    assert engine.fit(blobs()).training_["iterations"] == 60


# --- errors ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("parameters", "match"),
    [
        ({"crop": 99}, "crop = 99: must be at most 40"),
        ({"reach": 40}, "reach = 40: must be at most 39"),
        ({"latents": 7}, "multiple of groups"),
        ({"taps": (5, 3)}, "fewest and the most"),
        ({"betas": (0.5, 1.5)}, "betas"),
        ({"direction": (1.0, 0.0, 0.0)}, "must come with"),
        ({"guidance": "direction"}, "must come with"),
        ({"guidance": "map"}, "must be given with"),
        ({"width": 0}, "width"),
        ({"points": (1, 0)}, "points.1 = 0"),
        ({"start_model": "noise", "start_iterations": 0}, "start_model = noise: needs"),
        ({"start_model": "noise", "points": ()}, "start_model = noise: needs"),
        ({"start_model": "noise", "period": 20.0}, "start_model = noise: needs"),
        ({"start_model": "struts"}, "start_model = struts: must be one of .*edges of cells"),
        ({"period": (3.0, 4.0, 5.0)}, "one number, or 2"),
        ({"sliced_iterations": 0, "crop": 16, "critic_maps": (4,) * 5}, "at least 32"),
    ],
)
def test_bad_parameters_are_named(parameters: dict[str, Any], match: str) -> None:
    with pytest.raises(ParameterError, match=match):
        quick(blobs(), **parameters)


@pytest.mark.parametrize(
    "array",
    [np.zeros((20, 20)), np.full((20, 20), np.nan), np.zeros((0, 5)), np.zeros((1, 1, 9))],
    ids=["constant", "nan", "empty", "line"],
)
def test_bad_exemplars_are_named(array: np.ndarray) -> None:
    with pytest.raises(ParameterError, match="exemplar"):
        quick(array)


def test_bad_requests_are_named(trained: PeriodicField) -> None:
    image = quick(blobs())
    for engine, shape, options, match in (
        (image, (2, 8, 8), {}, "must be \\(1, y, x\\)"),
        (trained, (8, 8, 8), {"guidance": 0.5}, "was not trained"),
        (trained, (8, 8, 8), {"noise_scale": 0.0}, "noise_scale"),
        (trained, (8, 8, 8), {"resolution": -1.0}, "resolution"),
        (trained, (8, 8, 8), {"latent": "none"}, "latent"),
        (trained, (8, 8, 8), {"known": np.zeros((8, 8, 8))}, "known"),
        (trained, (0, 8, 8), {}, "shape"),
        (trained, (8, 8, 8), {"cut_at": "exemplar", "porosity": 0.4}, "porosity"),
        (trained, (8, 8, 8), {"start": (1, 2)}, "start"),
    ):
        with pytest.raises(ParameterError, match=match):
            engine.sample(shape, **options)
    with pytest.raises(ParameterError, match="start"):
        trained.sample_field((8, 8, 8), start="abc")  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="call fit"):
        PeriodicField().sample((8, 8, 8))


def test_an_interruption_stops_sampling(trained: PeriodicField) -> None:
    def stop(stage: str, share: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        trained.sample((64, 64, 64), progress=stop)


def test_the_engine_is_known_by_name() -> None:
    assert get_engine("ipfn") is PeriodicField
