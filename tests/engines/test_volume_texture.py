"""The volume-texture engine as a user meets it."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import ndimage

from poresynth.engines import get_engine
from poresynth.engines.base import SynthesizedVolume
from poresynth.engines.phases import detect_kind
from poresynth.engines.volume_texture import VolumeTexture
from poresynth.errors import FileError, MemoryEstimateError, ParameterError
from poresynth.volume import Volume

SMALL: dict[str, Any] = {"levels": 2, "windows": (6, 4), "iterations": 3}
SHAPE = (22, 19, 25)


def gray(seed: int = 0, shape: tuple[int, ...] = (24, 22, 20)) -> np.ndarray:
    """Two phases with noise: solid near 180, pore near 60."""
    rng = np.random.default_rng(seed)
    structure = ndimage.gaussian_filter(rng.random(shape), 1.8, mode="wrap")
    solid = structure > np.quantile(structure, 0.6)
    smooth = ndimage.gaussian_filter(np.where(solid, 180.0, 60.0), 0.7)
    return np.clip(smooth + rng.normal(0, 8, shape), 0, 255).astype(np.uint8)


def binary(seed: int = 0) -> np.ndarray:
    volume = gray(seed)
    return volume > np.quantile(volume, 0.6)


def labels(seed: int = 0) -> np.ndarray:
    volume = gray(seed)
    return np.digitize(volume, np.quantile(volume, [0.4, 0.8])).astype(np.uint8) * 7


def make(exemplar: Any, **options: Any) -> SynthesizedVolume:
    sampling = {
        k: options.pop(k)
        for k in ("seed", "boundary", "porosity", "known", "known_mask", "mask", "threads")
        if k in options
    }
    shape = options.pop("shape", SHAPE)
    return VolumeTexture(**{**SMALL, **options}).fit(exemplar).sample(shape, **sampling)


# --- what comes out -------------------------------------------------------------------------


@pytest.mark.parametrize("field", ["distance", "intensity"])
@pytest.mark.parametrize("dtype", [np.uint8, np.int16, np.uint16, np.float32, np.float64])
def test_gray_comes_out_gray_with_exact_porosity_and_the_phases_histograms(
    field: str, dtype: type
) -> None:
    exemplar = gray().astype(dtype)
    engine = VolumeTexture(**SMALL, field=field).fit(exemplar)
    made = engine.sample(SHAPE, seed=1)
    assert made.dtype == dtype
    assert made.shape == SHAPE
    threshold = engine.threshold_
    own, new = exemplar > threshold, made.array > threshold
    assert abs(new.mean() - own.mean()) <= 1 / new.size
    for a, b in ((exemplar[own], made.array[new]), (exemplar[~own], made.array[~new])):
        for q in (0.05, 0.25, 0.5, 0.75, 0.95):
            assert abs(float(np.quantile(a, q)) - float(np.quantile(b, q))) <= 1.5


@pytest.mark.parametrize("values", [(False, True), (0, 255), (-3, 9), (0.25, 0.75)])
def test_binary_comes_out_binary_with_the_same_two_values(values: tuple[Any, Any]) -> None:
    exemplar = np.where(binary(), values[1], values[0])
    made = make(exemplar, seed=2).array
    assert made.dtype == exemplar.dtype
    assert set(np.unique(made)) == set(values)
    share = (exemplar == values[1]).mean()
    assert abs((made == values[1]).mean() - share) <= 1 / made.size


@pytest.mark.parametrize("field", ["distance", "intensity"])
def test_labels_come_out_hard_with_exact_shares(field: str) -> None:
    exemplar = labels()
    made = make(exemplar, field=field, seed=3).array
    for value in np.unique(exemplar):
        assert abs((made == value).mean() - (exemplar == value).mean()) <= 1 / made.size
    assert set(np.unique(made)) == set(np.unique(exemplar))


@pytest.mark.parametrize("field", ["distance", "intensity"])
def test_channels_are_kept(field: str) -> None:
    exemplar = np.stack([gray(), 255 - gray(), np.full_like(gray(), 9)], axis=-1)
    made = make(exemplar, field=field)
    assert made.array.shape == (*SHAPE, 3)
    assert (made.array[..., 2] == 9).all()
    both = made.array[..., :2].reshape(-1, 2).astype(float)
    assert np.corrcoef(both.T)[0, 1] < -0.8


def test_dark_solid_mirrors_bright_solid() -> None:
    exemplar = gray()
    engine = VolumeTexture(**SMALL, solid="dark").fit(exemplar)
    assert engine.porosity_ == pytest.approx((exemplar > engine.threshold_).mean())
    for field in ("distance", "intensity"):
        made = make(exemplar, solid="dark", field=field, porosity=0.3).array
        assert abs((made > engine.threshold_).mean() - 0.3) <= 1 / made.size


@pytest.mark.parametrize("porosity", [0.2, 0.6])
@pytest.mark.parametrize("exemplar", [gray(), binary(), labels()], ids=["gray", "binary", "label"])
def test_a_wanted_porosity_is_met_to_the_voxel(exemplar: np.ndarray, porosity: float) -> None:
    engine = VolumeTexture(**SMALL).fit(exemplar)
    made = engine.sample(SHAPE, porosity=porosity).array
    pore = made == exemplar.min()
    if engine.threshold_ is not None:
        pore = made <= engine.threshold_
    assert abs(pore.mean() - porosity) <= 1 / made.size


@pytest.mark.parametrize("shape", [(12, 40, 13), (37, 12, 12)])
@pytest.mark.parametrize("boundary", ["open", "periodic"])
def test_any_aspect(shape: tuple[int, int, int], boundary: Any) -> None:
    assert make(binary(), shape=shape, boundary=boundary).shape == shape


def test_a_periodic_volume_tiles_without_a_seam() -> None:
    made = make(gray(), boundary="periodic", shape=(32, 32, 32), iterations=8, seed=4).array
    solid = made > 120
    for axis in range(3):
        steps = np.array(
            [(solid.take(i, axis) != solid.take(i - 1, axis)).mean() for i in range(32)]
        )
        assert steps[0] <= 1.15 * steps[1:].max()


def test_scale_and_provenance_come_along() -> None:
    volume = Volume(gray(), (2.0, 1.0, 1.0), "µm")
    made = make(volume, seed=9, boundary="periodic")
    assert (made.voxel_size, made.unit) == ((2.0, 1.0, 1.0), "µm")
    record = made.metadata["poresynth"]
    assert record["seed"] == 9
    assert record["parameters"]["windows"] == [6, 4]
    assert len(record["exemplar"]["sha256"]) == 64
    assert 0 <= record["copying"]["copy_fraction"] <= 1
    assert record["copying"]["mean_copied_block"] > 0
    assert made.match_map is not None
    assert made.match_map.shape == SHAPE
    assert [e.level for e in made.energy] == sorted((e.level for e in made.energy), reverse=True)


# --- reproducibility -------------------------------------------------------------------------


@pytest.mark.parametrize("exemplar", [gray(), labels()], ids=["gray", "label"])
def test_the_same_bits_on_any_number_of_threads_and_any_memory_order(exemplar: np.ndarray) -> None:
    first = make(exemplar, seed=5, threads=1)
    for threads, array in itertools.product((2, 8), (exemplar, np.asfortranarray(exemplar))):
        again = make(array, seed=5, threads=threads)
        np.testing.assert_array_equal(first.array, again.array)
        np.testing.assert_array_equal(first.match_map.matches, again.match_map.matches)
        assert first.metadata == again.metadata
    other = make(exemplar, seed=6)
    assert (first.array != other.array).any()


def test_a_saved_engine_makes_the_same_volume(tmp_path: Path) -> None:
    engine = VolumeTexture(**SMALL, run_penalty=0.1).fit(Volume(gray(), 3.0, "µm"))
    engine.save(tmp_path / "bone.npz")
    again = VolumeTexture.load(tmp_path / "bone.npz")
    assert again.parameters_ == engine.parameters_
    np.testing.assert_array_equal(engine.sample(SHAPE).array, again.sample(SHAPE).array)
    (tmp_path / "bad.npz").write_bytes(b"not a file")
    for bad in ("bad.npz", "missing.npz"):
        with pytest.raises(FileError, match=bad):
            VolumeTexture.load(tmp_path / bad)


# --- constraints ------------------------------------------------------------------------------


@pytest.mark.parametrize("field", ["distance", "intensity"])
@pytest.mark.parametrize("exemplar", [gray(), binary(), labels()], ids=["gray", "binary", "label"])
def test_known_voxels_are_kept_exactly(exemplar: np.ndarray, field: str) -> None:
    known = np.zeros(SHAPE, exemplar.dtype)
    known[:, :, :12] = exemplar[:22, :19, :12]
    on = np.zeros(SHAPE, bool)
    on[:, :, :12] = True
    made = make(exemplar, known=known, known_mask=on, field=field).array
    np.testing.assert_array_equal(made[on], known[on])


def test_a_hole_is_filled_to_fit_its_surroundings() -> None:
    exemplar = gray(shape=(32, 32, 32))
    on = np.ones((32, 32, 32), bool)
    on[10:22, 10:22, 10:22] = False
    made = make(exemplar, shape=(32, 32, 32), known=exemplar, known_mask=on, iterations=8).array
    solid = made > 120
    across = (solid[9, 10:22, 10:22] != solid[10, 10:22, 10:22]).mean()
    inside = (exemplar[:-1] > 120) != (exemplar[1:] > 120)
    assert across < 2.0 * inside.mean() + 0.05


def test_outside_the_mask_is_pore_and_inside_has_the_porosity() -> None:
    z, y, x = np.ogrid[:22, :19, :25]
    ball = (z - 11) ** 2 + (y - 9) ** 2 + (x - 12) ** 2 < 64
    exemplar = gray()
    engine = VolumeTexture(**SMALL).fit(exemplar)
    made = engine.sample(SHAPE, mask=ball)
    assert (made.array[~ball] == exemplar.min()).all()
    inside = (made.array[ball] <= engine.threshold_).mean()
    assert abs(inside - engine.porosity_) <= 1 / ball.sum()
    # Nothing beyond the box round the ball was looked at.
    assert made.match_map.shape == (15, 15, 15)
    z, y, x = np.indices(SHAPE)
    corners = (z + y + x < 12) | (z + y + x > sum(SHAPE) - 15)
    made = engine.sample(SHAPE, mask=corners)
    assert made.match_map.shape == SHAPE
    assert (made.match_map.matches[..., 0] == 65535).any()
    assert (made.array[~corners] == exemplar.min()).all()


def test_a_box_at_the_border_is_as_large_as_the_engine_needs() -> None:
    exemplar = gray()
    engine = VolumeTexture(**SMALL).fit(exemplar)
    spot = np.zeros(SHAPE, bool)
    spot[-1, -1, -1] = True
    known = np.full(SHAPE, exemplar.max())
    made = engine.sample(SHAPE, mask=spot, known=known, known_mask=spot)
    assert made.array[-1, -1, -1] == exemplar.max()
    assert (made.array[~spot] == exemplar.min()).all()
    assert all(8 <= n <= 16 for n in made.match_map.shape)


# --- presets, options -------------------------------------------------------------------------


@pytest.mark.parametrize("preset", ["quality", "fast", "paper"])
def test_every_preset_runs(preset: str) -> None:
    exemplar = gray(shape=(40, 40, 40))
    made = VolumeTexture(preset=preset, iterations=2).fit(exemplar).sample((40, 40, 44), seed=1)
    assert made.shape == (40, 40, 44)


@pytest.mark.parametrize(
    "options",
    [
        {"symmetry": "flips"},
        {"symmetry": "rotations", "keep_axis": "z"},
        {"symmetry": "full", "search": "kd_tree"},
        {"search": "brute_force", "levels": 1, "windows": (4,)},
        {"index_weight": "normalised", "search": "kd_tree"},
        {"gradient": 0.5, "adaptive": True},
        {"smoothing": 0.0, "clip": 3},
        {"steps": (2, 4)},
    ],
    ids=str,
)
def test_every_option_runs(options: dict[str, Any]) -> None:
    made = make(binary(), **{"iterations": 2, **options}).array
    assert abs(made.mean() - binary().mean()) <= 1 / made.size


def test_progress_is_heard_and_can_stop_the_work() -> None:
    heard: list[tuple[str, float]] = []
    engine = VolumeTexture(**SMALL).fit(gray())
    engine.sample(SHAPE, progress=lambda stage, share: heard.append((stage, share)))
    shares = [share for _, share in heard]
    assert shares == sorted(shares)
    assert shares[-1] <= 1
    assert "window" in heard[0][0]

    def stop(stage: str, share: float) -> None:
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        engine.sample(SHAPE, progress=stop)


# --- bad input --------------------------------------------------------------------------------


def bad_exemplars() -> dict[str, np.ndarray]:
    broken = gray().astype(np.float32)
    broken[3, 2, 1] = np.nan
    infinite = gray().astype(np.float64)
    infinite[0, 0, 0] = np.inf
    return {
        "nan": broken,
        "inf": infinite,
        "constant": np.full((24, 24, 24), 7, np.uint8),
        "empty": np.zeros((0, 24, 24), np.uint8),
        "one voxel": np.ones((1, 1, 1), np.uint8),
        "1d": np.arange(100.0),
        "too small": gray(shape=(11, 24, 24)),
    }


@pytest.mark.parametrize("name", bad_exemplars())
def test_a_bad_exemplar_is_refused(name: str) -> None:
    with pytest.raises(ParameterError):
        VolumeTexture(**SMALL).fit(bad_exemplars()[name])


@pytest.mark.parametrize(
    "parameters",
    [
        {"preset": "best"},
        {"levels": 0},
        {"levels": 2.5},
        {"windows": ()},
        {"windows": (1,)},
        {"windows": (40,)},
        {"steps": (9, 2)},
        {"steps": (2,)},
        {"field": "colour"},
        {"run_penalty": -1.0},
        {"gradient": float("nan")},
        {"exponent": 3.0},
        {"threshold": 1e9},
        {"kind": "binary"},
        {"kind": "label"},
        {"keep_axis": "w"},
    ],
    ids=str,
)
def test_a_bad_parameter_is_named(parameters: dict[str, Any]) -> None:
    name = next(iter(parameters))
    name = "exemplar" if parameters.get("kind") == "label" else name
    with pytest.raises(ParameterError, match=name):
        VolumeTexture(**{**SMALL, **parameters}).fit(gray())


@pytest.mark.parametrize(
    "arguments",
    [
        {"shape": (8, 30, 30)},
        {"shape": (-5, 30, 30)},
        {"shape": (30, 30)},
        {"shape": (30.5, 30, 30)},
        {"shape": "big"},
        {"seed": -1},
        {"seed": 2**64},
        {"seed": 1.5},
        {"threads": -2},
        {"boundary": "closed"},
        {"porosity": 0.0},
        {"porosity": 1.5},
        {"mask": np.ones((3, 3, 3), bool)},
        {"mask": np.zeros(SHAPE, bool)},
        {"mask": np.full(SHAPE, 0.5)},
        {"known": np.zeros(SHAPE)},
        {"known": np.zeros((3, 3, 3)), "known_mask": np.ones(SHAPE, bool)},
        {"known": np.full(SHAPE, np.nan), "known_mask": np.ones(SHAPE, bool)},
        {"known": np.full(SHAPE, 0.5), "known_mask": np.ones(SHAPE, bool)},
    ],
    ids=lambda a: ",".join(a),
)
def test_a_bad_argument_is_named(arguments: dict[str, Any]) -> None:
    engine = VolumeTexture(**SMALL).fit(gray())
    shape = arguments.pop("shape", SHAPE)
    with pytest.raises(ParameterError, match=r"shape|seed|threads|boundary|porosity|mask|known"):
        engine.sample(shape, **arguments)


def test_a_volume_that_cannot_fit_is_refused_with_numbers() -> None:
    engine = VolumeTexture(**SMALL).fit(gray())
    with pytest.raises(MemoryEstimateError, match=r"GB|TB"):
        engine.sample((60_000, 60_000, 60_000))
    with pytest.raises(ParameterError, match="fit"):
        VolumeTexture().sample(SHAPE)


def test_kinds_are_recognised() -> None:
    assert detect_kind(gray()) == "gray"
    assert detect_kind(binary()) == "binary"
    assert detect_kind(labels()) == "label"
    assert detect_kind(gray().astype(float)) == "gray"
    assert detect_kind(np.zeros((2, 2, 2, 3))) == "gray"


def test_the_registry_knows_the_engine() -> None:
    assert get_engine("volume") is VolumeTexture
    with pytest.raises(ParameterError, match="volume"):
        get_engine("magic")
