"""Volumes from images."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import ndimage

from poresynth import _core
from poresynth.engines import mode_choice
from poresynth.engines.image_fields import agreed
from poresynth.engines.point_models import PointModel
from poresynth.engines.roughness import interface_density, smoothing_like
from poresynth.engines.solid_texture import SolidTexture
from poresynth.errors import FileError, ParameterError
from poresynth.exemplars import foam
from poresynth.metrics.skeleton import end_points
from poresynth.volume import Volume

SHAPE = (32, 32, 32)
FAST: dict[str, Any] = {
    "mode": "responses",
    "levels": 2,
    "filters": 8,
    "response_steps": (8, 4),
}
PUBLISHED: dict[str, Any] = {"levels": 2, "iterations": (2,)}


def blobs(seed: int = 0, shape: tuple[int, int] = (48, 44), share: float = 0.4) -> np.ndarray:
    """A binary image."""
    smooth = ndimage.gaussian_filter(np.random.default_rng(seed).random(shape), 2, mode="wrap")
    return smooth > np.quantile(smooth, 1 - share)


def grays(seed: int = 0) -> np.ndarray:
    noise = np.random.default_rng(seed + 100).normal(0, 8, (48, 44))
    smooth = ndimage.gaussian_filter(np.where(blobs(seed), 180.0, 60.0), 0.8)
    return np.clip(smooth + noise, 0, 255).astype(np.uint8)


def colours(seed: int = 0) -> np.ndarray:
    base = grays(seed).astype(float)
    return np.stack([base, 255 - base, 0.5 * base + 40], axis=-1).astype(np.uint8)


def make(image: Any, shape: tuple[int, int, int] = SHAPE, **parameters: Any) -> Any:
    options = {**FAST, **parameters}
    sampled = {
        k: options.pop(k) for k in ("seed", "boundary", "porosity", "threads") if k in options
    }
    return SolidTexture(**options).fit(image).sample(shape, **sampled)


@pytest.mark.parametrize("dtype", [bool, np.uint8, np.uint16, np.float32])
def test_a_binary_image_gives_its_values_in_its_shares(dtype: type) -> None:
    image = blobs().astype(dtype)
    made = make(image)
    assert (made.shape, made.dtype) == (SHAPE, image.dtype)
    assert set(np.unique(made.array)) == set(np.unique(image))
    assert abs(made.array.mean(dtype=float) - image.mean(dtype=float)) <= 1 / made.array.size


def test_images_may_have_an_axis_of_one_and_a_voxel_size() -> None:
    image = grays()
    plain = make(image)
    volume = make(Volume(image[None], (2.0, 2.0, 2.0), "µm"))
    np.testing.assert_array_equal(plain.array, volume.array)
    assert (volume.voxel_size, volume.unit) == ((2.0, 2.0, 2.0), "µm")


@pytest.mark.parametrize("porosity", [None, 0.3])
def test_gray_values_cut_at_the_images_threshold_give_the_wanted_porosity(
    porosity: float | None,
) -> None:
    engine = SolidTexture(**FAST).fit(grays())
    made = engine.sample(SHAPE, porosity=porosity)
    wanted = engine.porosity_ if porosity is None else porosity
    assert engine.threshold_ is not None
    found = np.mean(made.array <= engine.threshold_)
    assert abs(found - wanted) <= 1.5 / made.array.size
    if porosity is None:
        assert abs(made.array.mean() - grays().mean()) < 0.5
        assert abs(made.array.std() - grays().std()) < 0.5


@pytest.mark.parametrize("mode", ["responses", "structured"])
def test_the_seed_decides_and_the_threads_do_not(mode: str) -> None:
    one, two, other = (
        make(grays(), mode=mode, iterations=(2,), seed=seed, threads=threads).array
        for seed, threads in ((3, 1), (3, 2), (4, 2))
    )
    np.testing.assert_array_equal(one, two)
    assert (one != other).any()


def test_a_periodic_volume_has_no_seam_and_an_open_one_any_shape() -> None:
    periodic = make(grays(), boundary="periodic").array.astype(float)
    steps = [np.abs(np.roll(periodic, -1, 0) - periodic)[k].mean() for k in range(SHAPE[0])]
    assert steps[-1] <= 1.3 * max(steps[:-1])
    assert make(grays(), (33, 34, 35)).shape == (33, 34, 35)


def test_three_phases_keep_their_shares() -> None:
    smooth = ndimage.gaussian_filter(np.random.default_rng(2).random((48, 48)), 2, mode="wrap")
    image = np.digitize(smooth, np.quantile(smooth, [0.3, 0.6])).astype(np.uint8) * 7
    made = make(image).array
    assert set(np.unique(made)) == {0, 7, 14}
    for label in (0, 7, 14):
        assert abs(np.mean(made == label) - np.mean(image == label)) < 2 / made.size


@pytest.mark.parametrize("mode", ["responses", "structured"])
def test_colours_keep_their_means_and_deviations(mode: str) -> None:
    """prieto_2011 Table 1: means within 1 %, standard deviations within 2 %."""
    image = colours()
    made = make(image, mode=mode, iterations=(1,)).array
    assert made.shape == (*SHAPE, 3)
    for own, new in zip(np.moveaxis(image, -1, 0), np.moveaxis(made, -1, 0), strict=True):
        assert abs(new.mean() / own.mean() - 1) < 0.01
        assert abs(new.std() / own.std() - 1) < 0.02


def test_each_axis_gets_its_own_image() -> None:
    rows = np.zeros((48, 48), bool)
    rows[np.arange(48) % 8 < 4] = True
    # Across z stripes along columns; across x the same stripes, seen from their side.
    made = make([rows.T, np.ones((48, 48), bool) & rows.T], axes=("z", "y")).array
    changes = [np.count_nonzero(np.diff(made.astype(np.int8), axis=a)) for a in range(3)]
    assert changes[2] > 2 * changes[0]
    assert changes[2] > 2 * changes[1]


def test_planes_across_an_axis_that_is_left_out_are_free() -> None:
    image = blobs()
    for axes in (("z",), ("y", "x")):
        made = make(image, axes=axes)
        assert made.metadata["poresynth"]["parameters"]["axes"] == list(axes)
    weighted = make(image, weights=(1.0, 1.0, 5.0)).array
    assert (weighted != make(image).array).any()


def test_a_feature_channel_comes_from_the_solid_or_from_masks() -> None:
    image = grays()
    mask = np.zeros(image.shape, bool)
    mask[10:30, 10:30] = True
    plain = make(image, field="intensity")
    own = make(image, field="intensity", feature="distance")
    engine = SolidTexture(**FAST, field="intensity", feature="distance").fit(image, [mask])
    masked = engine.sample(SHAPE)
    assert len({v.array.tobytes() for v in (plain, own, masked)}) == 3


def test_known_voxels_are_kept_and_those_outside_a_mask_are_pore() -> None:
    image = blobs().astype(np.uint8)
    known = np.zeros(SHAPE, np.uint8)
    known[:8] = np.tile(image[:32, :32], (8, 1, 1))
    on = np.zeros(SHAPE, bool)
    on[:8] = True
    mask = np.ones(SHAPE, bool)
    mask[:, :, 28:] = False
    engine = SolidTexture(**FAST).fit(image)
    made = engine.sample(SHAPE, known=known, known_mask=on, mask=mask).array
    np.testing.assert_array_equal(made[:8, :, :28], known[:8, :, :28])
    assert (made[:, :, 28:] == 0).all()


def test_a_connected_phase_is_one_piece_with_as_many_voxels() -> None:
    image = blobs(share=0.25)
    loose, joined = make(image).array, make(image, connected="solid")
    sizes = _core.component_sizes(joined.array, connectivity=26, boundary="open", threads=1)
    assert len(sizes) == 1
    assert joined.array.sum() == loose.sum()
    repair = joined.metadata["poresynth"]["repair"]["solid"]
    assert repair["joined"] + repair["erased"] > 0
    assert (repair["apart"], repair["missing"]) == (0, 0)


@pytest.mark.parametrize("preset", ["prieto", "kopf", "chen_wang"])
def test_the_published_methods_run(preset: str) -> None:
    options = {**PUBLISHED, "windows": (8,), "steps": (4,)}
    engine = SolidTexture(preset=preset, **options).fit(grays())  # type: ignore[arg-type]
    made = engine.sample(SHAPE, seed=1)
    assert engine.mode_ == "structured"
    assert engine.mode_reason_ == f"structured, of the preset {preset}"
    assert made.energy[-1].energy < made.energy[0].energy
    assert abs(made.array.mean() - grays().mean()) < 0.5


@pytest.mark.parametrize("best", [0.0, 100.0])
def test_without_a_named_mode_the_better_slices_decide(
    best: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mode_choice, "BEST", best)
    engine = SolidTexture(response_steps=(4, 2), filters=4, levels=2).fit(blobs())
    assert "responses" in engine.mode_reason_
    assert engine.parameters_.mode == engine.mode_
    if best == 0:
        assert engine.mode_ in ("responses", "structured")
        assert "structured" in engine.mode_reason_
    else:
        assert engine.mode_ == "responses", "a trial with neighbourhoods could not be better"
        assert "structured" not in engine.mode_reason_


def test_pores_between_grains_start_from_cells_and_those_of_a_random_field_do_not() -> None:
    grains = PointModel("edges and faces of cells", -1, 24, 1).field((48, 128, 128), 1, 1)[0, 24]
    noise = np.random.default_rng(0).standard_normal((128, 128))
    field = ndimage.gaussian_filter(noise, 4, mode="wrap")
    modes = []
    for values in (grains, field):
        engine = SolidTexture().fit(values > np.quantile(values, 0.13))
        modes.append(engine.mode_)
        assert ("holds pores together" in engine.mode_reason_) == (engine.mode_ == "cells")
    assert modes == ["cells", "responses"]


def struts() -> np.ndarray:
    """A section of a foam."""
    return np.asarray(foam((96, 96, 96), seed=3).array[40] > 125)


def test_a_network_starts_from_cells_and_has_fewer_dead_ends(tmp_path: Path) -> None:
    engine = SolidTexture(connected="solid").fit(struts())
    assert engine.mode_ == "cells"
    assert "edges" in engine.mode_reason_
    made = engine.sample((64, 64, 64), seed=1)
    origin = made.metadata["poresynth"]
    assert origin["start"]["name"] in engine.mode_reason_
    assert origin["start"]["sign"] == 1
    without = SolidTexture(connected="solid", mode="responses").fit(struts())
    assert "start" not in without.sample((64, 64, 64), seed=1).metadata["poresynth"]
    dead = [
        end_points(np.pad(one.sample((64, 64, 64), seed=1).array, 8, mode="wrap")).count
        for one in (engine, without)
    ]
    assert 1.5 * dead[0] < dead[1]
    again = engine.sample((64, 64, 64), seed=1, threads=1)
    np.testing.assert_array_equal(again.array, made.array)
    engine.save(tmp_path / "engine.npz")
    loaded = SolidTexture.load(tmp_path / "engine.npz")
    assert loaded.mode_ == "cells"
    np.testing.assert_array_equal(loaded.sample((64, 64, 64), seed=1).array, made.array)


def test_where_the_larger_phase_is_connected_or_none_is_cells_are_not_tried() -> None:
    options: dict[str, Any] = {"response_steps": (4, 2), "filters": 4, "levels": 2}
    for connected in ("none", "pore"):
        engine = SolidTexture(connected=connected, **options).fit(struts())
        assert engine.mode_ != "cells"
    striped = np.zeros((48, 48), bool)
    striped[::8] = striped[1::8] = True
    engine = SolidTexture(connected="solid", **options).fit(striped)
    assert engine.mode_ != "cells", "no model is near"


def test_pores_between_grains_may_be_the_network() -> None:
    engine = SolidTexture(**{**FAST, "mode": "cells"}).fit(~struts())
    start = engine.sample(SHAPE).metadata["poresynth"]["start"]
    assert start["sign"] == -1


@pytest.mark.parametrize(
    ("image", "options"),
    [
        (colours(), {}),
        (blobs().astype(np.uint8) + blobs(1), {"kind": "label"}),
        (grays(), {"feature": "distance"}),
        (grays(), {"filters": 0, "response_steps": (0,)}),
    ],
)
def test_cells_are_refused_where_there_is_more_than_one_channel(
    image: np.ndarray, options: dict[str, Any]
) -> None:
    with pytest.raises(ParameterError, match="mode"):
        SolidTexture(**{**FAST, "mode": "cells", **options}).fit(image)


def test_trials_hold_the_windows_of_many_levels() -> None:
    image = blobs(shape=(132, 130))
    engine = SolidTexture(levels=5, response_steps=(2,), filters=4).fit(image)
    assert engine.mode_ in ("responses", "structured")


def test_colours_are_kept_together() -> None:
    assert SolidTexture(levels=2).fit(colours()).mode_ == "structured"


def test_a_saved_engine_makes_the_same_volume(tmp_path: Path) -> None:
    engine = SolidTexture(**FAST, axes=("z", "x")).fit([grays(0), grays(1)])
    engine.save(tmp_path / "engine.npz")
    loaded = SolidTexture.load(tmp_path / "engine.npz")
    assert loaded.parameters_ == engine.parameters_
    np.testing.assert_array_equal(loaded.sample(SHAPE).array, engine.sample(SHAPE).array)
    (tmp_path / "other.npz").write_bytes(b"nothing")
    with pytest.raises(FileError):
        SolidTexture.load(tmp_path / "other.npz")


def test_the_provenance_says_how_it_was_made() -> None:
    origin = make(grays(), seed=5).metadata["poresynth"]
    assert origin["engine"] == "solid"
    assert (origin["seed"], origin["shape"]) == (5, list(SHAPE))
    assert origin["exemplar"]["kind"] == "gray"
    assert origin["mode_reason"] == "responses, as asked"
    assert origin["smoothing"] >= 0
    several = make([grays(0), grays(1)]).metadata["poresynth"]
    assert [e["kind"] for e in several["exemplar"]] == ["gray", "gray"]
    assert several["parameters"]["axes"] == ["z", "y"]


@pytest.mark.parametrize(
    ("image", "parameters", "message"),
    [
        (grays()[:20], {}, "at least 16|at least 32"),
        (np.zeros((20, 40, 40), np.uint8), {}, "must be an image"),
        ([grays()] * 4, {}, "one to three"),
        ([grays(), colours()], {}, "as the first image"),
        ([grays(), grays().astype(np.uint16)], {}, "as the first image"),
        ([grays(), grays(1)], {"axes": ("z",)}, "one axis for each"),
        (grays(), {"axes": ("z", "z")}, "named once"),
        (grays(), {"steps": (9,)}, "none larger"),
        (grays(), {"clip": 0}, "clip"),
        (np.full((40, 40), 3, np.uint8), {}, "."),
        (np.full((40, 40), np.nan, np.float32), {}, "."),
    ],
)
def test_what_does_not_fit_is_refused(image: Any, parameters: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        SolidTexture(**{**FAST, "levels": 3, **parameters}).fit(image)


def test_requests_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ParameterError, match="fit"):
        SolidTexture().sample(SHAPE)
    engine = SolidTexture(**FAST).fit(grays())
    with pytest.raises(ParameterError, match="shape"):
        engine.sample((8, 32, 32))
    with pytest.raises(ParameterError, match="masks"):
        SolidTexture(**FAST).fit(grays(), [blobs()])
    with pytest.raises(ParameterError, match="masks"):
        SolidTexture(**FAST, feature="distance").fit(grays(), [np.ones((48, 44), bool)])


@pytest.mark.parametrize(
    ("image", "parameters", "edge"),
    [
        (grays(), {"field": "distance"}, 3),
        (grays(), {"field": "intensity"}, 5),
        (blobs(), {"field": "intensity"}, 3),
        (colours(), {}, 3),
        (grays(), {"field": "intensity", "filter_edge": 4}, 4),
    ],
)
def test_filters_suit_the_field(image: Any, parameters: dict[str, Any], edge: int) -> None:
    engine = SolidTexture(mode="responses", **parameters).fit(image)
    assert engine.parameters_.filter_edge == edge


def test_second_responses_take_memory_at_the_finest_level_alone() -> None:
    def memory(**parameters: Any) -> int:
        engine = SolidTexture(mode="responses", field="intensity", **parameters).fit(colours())
        return engine.estimate_memory((32, 32, 32))

    without = memory(deep=(False,))
    assert memory() == memory(deep=(True, True, False)) == without
    assert memory(levels=2) == memory(deep=(True,)) == without + (3 + 7 * 3) * 32**3


def test_images_agree_about_distances() -> None:
    rng = np.random.default_rng(0)
    fields = [
        np.rint(rng.normal(mean, 20, (2, 1, 40, 30))).astype(np.float32) for mean in (80, 120)
    ]
    first, second = agreed(fields)
    for c in range(2):
        both = np.concatenate([field[c].ravel() for field in fields])
        for made, field in ((first, fields[0]), (second, fields[1])):
            # The order stays, and what is equal stays equal; the quantiles are those of both.
            order = np.argsort(field[c].ravel(), kind="stable")
            assert (np.diff(made[c].ravel()[order]) >= 0).all()
            assert len(np.unique(made[c])) <= len(np.unique(field[c]))
            wanted, found = (np.quantile(values, [0.1, 0.5, 0.9]) for values in (both, made[c]))
            assert np.abs(wanted - found).max() <= 1.5
    assert agreed(fields[:1])[0] is fields[0]
    assert all(np.array_equal(made, fields[0]) for made in agreed([fields[0], fields[0]]))


def test_gray_images_agree_about_values() -> None:
    dark, bright = grays(0), np.clip(grays(1) + np.uint8(30), 0, 255).astype(np.uint8)
    engine = SolidTexture(**FAST, field="intensity", axes=("z", "x")).fit([dark, bright])
    low, high = (np.quantile(field, [0.1, 0.5, 0.9]) for field in engine._fields)
    assert np.abs(low - high).max() < 2.0
    published = SolidTexture(preset="prieto", levels=2, axes=("z", "x")).fit([dark, bright])
    low, high = (np.quantile(field, 0.5) for field in published._fields)
    assert high - low > 5.0, "the papers' presets take images as they are"


def test_the_channels_of_several_images_stay_together() -> None:
    pair = [colours(0), colours(1)]
    alone = SolidTexture(**FAST).fit(np.concatenate(pair))._fields[0]
    both = SolidTexture(**FAST, axes=("z", "x")).fit(pair)._fields
    # One scale and one set of directions for both, and nothing else.
    np.testing.assert_allclose(np.concatenate(both, axis=2), alone, rtol=0, atol=1e-3)
    labels = [blobs(seed, share=0.3) + 2 * blobs(seed + 7, share=0.2) for seed in (0, 1)]
    images = [label.clip(max=2).astype(np.uint8) for label in labels]
    engine = SolidTexture(**FAST, kind="label", field="intensity", axes=("z", "x")).fit(images)
    for field in engine._fields:
        np.testing.assert_allclose(
            field.sum(axis=0), 255, atol=1e-2, err_msg="each pixel one phase"
        )


def test_interfaces_are_counted_in_the_plane() -> None:
    stripes = np.zeros((4, 8, 8), bool)
    stripes[:, ::2] = True
    assert interface_density(stripes, 1) == 0
    assert interface_density(stripes, 0) == pytest.approx(0.5)
    board = np.indices((6, 6, 6)).sum(axis=0) % 2 == 0
    assert [interface_density(board, axis) for axis in range(3)] == [1, 1, 1]


def test_the_blur_gives_sections_the_density_of_the_image() -> None:
    image = blobs(shape=(96, 96))
    solids: dict[Any, np.ndarray] = dict.fromkeys("zyx", image[None])
    rng = np.random.default_rng(1)
    smooth = ndimage.gaussian_filter(rng.random((64, 64, 64)), 2, mode="wrap").astype(np.float32)
    rough = smooth + rng.normal(0, 0.8 * smooth.std(), smooth.shape).astype(np.float32)
    sigma = smoothing_like(solids, 1 - image.mean(), rough, 0)
    assert 0.2 < sigma < 2
    blurred = _core.gaussian(rough[None], sigma, boundary="open")[0]
    solid = blurred > np.quantile(blurred, 1 - image.mean())
    found = np.mean([interface_density(solid, axis) for axis in range(3)])
    assert found == pytest.approx(interface_density(image[None], 0), rel=0.05)
    flat = ndimage.gaussian_filter(smooth, 6, mode="wrap")
    assert smoothing_like(solids, 1 - image.mean(), flat, 0) == 0


def change_by_pixel(planes: np.ndarray) -> float:
    """Mean square of the difference of neighbouring pixels along rows and columns."""
    values = planes.astype(float)
    return float(np.mean([(np.diff(values, axis=axis) ** 2).mean() for axis in (-1, -2)]))


@pytest.mark.parametrize(("grain", "low", "high"), [(0.0, 0.9, 1.25), (20.0, 0.9, 1.1)])
def test_gray_sections_are_as_rough_as_the_image(grain: float, low: float, high: float) -> None:
    noise = np.random.default_rng(3)
    smooth = ndimage.gaussian_filter(noise.standard_normal((128, 128)), 4, mode="wrap")
    image = 127.5 + 45 * smooth / smooth.std() + noise.normal(0, grain, smooth.shape)
    image = np.clip(image, 0, 255).astype(np.uint8)
    engine = SolidTexture(mode="responses", field="intensity", response_steps=(100, 40, 15))
    volume = engine.fit(image).sample((64, 64, 64), seed=1).array
    for axis in range(3):
        ratio = change_by_pixel(np.moveaxis(volume, axis, 0)) / change_by_pixel(image)
        assert low < ratio < high, (axis, ratio)


def test_images_are_alike_if_no_axis_stands_out() -> None:
    def stretched(along: float, across: float, seed: int) -> np.ndarray:
        noise = np.random.default_rng(seed).random((64, 64))
        smooth = ndimage.gaussian_filter(noise, (along, across), mode="wrap")
        return smooth > np.median(smooth)

    def alike(images: list[np.ndarray], **parameters: Any) -> bool:
        return SolidTexture(**FAST, **parameters).fit(images)._images.alike

    even = [stretched(2, 2, seed) for seed in range(3)]
    assert alike(even)
    assert alike(even[:2])
    assert not alike(even[:1]), "one image is its own"
    fibres = [stretched(2, 2, 0), stretched(8, 2, 1), stretched(8, 2, 2)]
    assert not alike(fibres)
    # Across y and across x, rows lie along z.
    assert not alike([stretched(8, 2, 1), stretched(8, 2, 2)], axes=("y", "x"))
    labels = [np.where(image, 2, stretched(2, 2, 9)).astype(np.uint8) for image in even]
    assert not alike(labels, kind="label")
    assert not alike([np.stack([255 * image.astype(np.uint8)] * 3, axis=-1) for image in even])
