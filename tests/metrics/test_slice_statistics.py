"""Figures of slices against public libraries, brute force and known shapes; the score of slices."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy import ndimage
from tests.metrics.strategies import ORDERS
from tests.references import slice_statistics as reference

from poresynth import metrics
from poresynth.errors import ParameterError
from poresynth.metrics.slice_statistics import MOST_WINDOWS, SLICE_FIGURES, window_boxes
from poresynth.volume import Volume

slices = hnp.arrays(bool, st.tuples(st.integers(2, 12), st.integers(2, 12))).filter(
    lambda s: s.any() and not s.all()
)


def blobs(shape: tuple[int, ...], seed: int, sigma: float = 2.5) -> np.ndarray:
    noise = np.random.default_rng(seed).standard_normal(shape)
    smooth = ndimage.gaussian_filter(noise, [sigma if n > 1 else 0 for n in shape], mode="wrap")
    return smooth > np.quantile(smooth, 0.6)


def disc(radius: float, edge: int) -> np.ndarray:
    y, x = np.ogrid[:edge, :edge]
    middle = (edge - 1) / 2
    return ((y - middle - 0.2) ** 2 + (x - middle + 0.1) ** 2 < radius**2)[np.newaxis]


@settings(max_examples=60)
@given(slices, st.sampled_from(list(ORDERS)))
def test_figures_are_those_of_public_libraries(solid: np.ndarray, order: str) -> None:
    found = metrics.slice_statistics(ORDERS[order](solid[np.newaxis]), threads=1)
    for name, value in reference.plane(solid).items():
        assert getattr(found, name) == pytest.approx(value, rel=1e-5), name
    r_max = min(solid.shape) // 2
    np.testing.assert_allclose(found.two_point, reference.two_point(solid, r_max), atol=1e-6)
    assert (found.window, found.windows) == (solid.shape, 1)


def test_the_correlation_ends_at_50_pixels_and_at_half_the_edge() -> None:
    solid = blobs((1, 110, 130), 1)
    assert len(metrics.slice_statistics(solid).two_point) == 51
    found = metrics.slice_statistics(solid, window=40).two_point
    assert len(found) == 21
    expected = reference.two_point(blobs((1, 40, 44), 1)[0], 20)
    alone = metrics.slice_statistics(blobs((1, 40, 44), 1)).two_point
    np.testing.assert_allclose(alone, expected, atol=1e-6)


@pytest.mark.parametrize("radius", [5, 8, 12.5, 20])
def test_a_disc_measures_what_it_should(radius: float) -> None:
    edge = 200
    found = metrics.slice_statistics(disc(radius, edge))
    per_pixel = 10_000 / edge**2
    assert found.solid_fraction * edge**2 == pytest.approx(np.pi * radius**2, rel=0.04)
    # Per area, lines are counted without their first pixels: 1 % of 200.
    assert found.perimeter * edge**2 == pytest.approx(2 * np.pi * radius, rel=0.02)
    # Less by the pixels' corners that lie closer than half a pixel: see `local_thickness`.
    assert 2 * radius * 0.88 < found.thickness < 2 * radius
    assert (found.components, found.holes) == (per_pixel, 0)
    inverse = metrics.slice_statistics(~disc(radius, edge))
    assert (inverse.components, inverse.holes) == (per_pixel, per_pixel)
    assert inverse.spacing == found.thickness
    assert inverse.perimeter == found.perimeter


def test_stripes_have_their_widths() -> None:
    solid = np.zeros((1, 100, 400), bool)
    solid[...] = np.arange(400) % 10 < 4
    found = metrics.slice_statistics(solid)
    # The border hides the end of the first stripe and of the last gap.
    assert found.thickness == pytest.approx(4, rel=0.03)
    assert found.spacing == pytest.approx(6, rel=0.03)
    assert found.perimeter == pytest.approx(2 / 10, rel=0.065)
    assert found.components == pytest.approx(10_000 * 40 / 40_000)
    assert (found.tips, found.holes) == (0, 0)
    np.testing.assert_allclose(found.two_point[0], 0.4)


def test_tips_are_ends_of_lines_away_from_the_border() -> None:
    solid = np.zeros((1, 40, 50), bool)
    solid[0, 10:13, 8:40] = True  # both ends count
    solid[0, 30:33, :20] = True  # one end is cut by the border
    found = metrics.slice_statistics(solid)
    assert found.tips == pytest.approx(10_000 * 3 / (34 * 44))
    gray = blobs((1, 64, 64), 3)
    skeleton = metrics.skeletonize(gray)[0]
    assert metrics.slice_statistics(gray).tips == pytest.approx(reference.tips(skeleton, 3))


def test_a_hole_at_the_border_is_none() -> None:
    solid = np.ones((1, 20, 20), bool)
    solid[0, 5:8, 5:8] = solid[0, 12, 12] = solid[0, 13, 13] = solid[0, :3, 10] = False
    # Two pixels that share a corner are two holes.
    assert metrics.slice_statistics(solid).holes == 10_000 * 3 / 400
    assert metrics.slice_statistics(solid).components == 10_000 / 400


def test_windows_cover_the_slices_and_their_mean_counts() -> None:
    stack = blobs((3, 50, 64), 1)
    found = metrics.slice_statistics(stack, window=32)
    assert (found.window, found.windows) == ((32, 32), 12)
    windows = [
        metrics.slice_statistics(stack[i : i + 1, y : y + 32, x : x + 32])
        for i in range(3)
        for y in (0, 18)
        for x in (0, 32)
    ]
    for name in SLICE_FIGURES:
        expected = np.mean([getattr(window, name) for window in windows])
        assert getattr(found, name) == pytest.approx(expected), name
    np.testing.assert_allclose(found.two_point, np.mean([w.two_point for w in windows], axis=0))


def test_of_many_slices_an_even_choice_is_measured() -> None:
    stack = np.zeros((320, 8, 8), bool)
    stack[5::10, 2:4, 2:4] = True
    found = metrics.slice_statistics(stack)
    assert found.windows == MOST_WINDOWS
    assert found.solid_fraction == 4 / 64


@pytest.mark.parametrize("shape", [(50, 64, 64), (9, 64, 96), (1, 300, 300), (40, 90, 33)])
def test_every_place_counts_alike(shape: tuple[int, int, int]) -> None:
    image = blobs((1, *shape[1:]), 1)
    boxes = list(window_boxes(shape, (32, 32)))
    assert len(set(map(str, boxes))) == len(boxes) <= MOST_WINDOWS
    places, counts = np.unique(
        [(y.start, x.start) for _, y, x in boxes], axis=0, return_counts=True
    )
    assert np.ptp(counts) <= 1
    assert places.min(axis=0).tolist() == [0, 0]
    # Thirty-two of more places: they still reach far.
    assert (places.max(axis=0) >= np.array(shape[1:]) - 64).all()
    slices_used = [i.start for i, _, _ in boxes]
    assert np.ptp(slices_used) >= 0.9 * (shape[0] - 1)
    if len(places) in (1, 2, 4):
        own, new = (
            metrics.slice_statistics(np.repeat(image, n, axis=0), window=32) for n in (1, shape[0])
        )
        assert new.thickness == pytest.approx(own.thickness)


def test_threads_do_not_matter() -> None:
    stack = blobs((24, 40, 40), 1)
    one, many = (metrics.slice_statistics(stack, window=32, threads=n) for n in (1, 5))
    for name in SLICE_FIGURES:
        assert getattr(one, name) == getattr(many, name)
    np.testing.assert_array_equal(one.two_point, many.two_point)


def test_empty_and_full_slices() -> None:
    for solid in (np.zeros((2, 9, 8), bool), np.ones((2, 9, 8), bool), np.ones((1, 1, 1), bool)):
        found = metrics.slice_statistics(solid)
        assert found.solid_fraction == solid.mean()
        assert found.holes == 0
        assert found.components == (10_000 / solid[0].size if solid.any() else 0)
        assert np.isnan([found.thickness, found.spacing]).all()
    mixed = np.concatenate([disc(3, 9), np.zeros((1, 9, 9), bool)])
    found = metrics.slice_statistics(mixed)
    assert found.thickness == metrics.slice_statistics(mixed[:1]).thickness


def test_errors_are_relative_to_what_is_resolved() -> None:
    own = metrics.slice_statistics(blobs((1, 64, 64), 1))
    new = metrics.slice_statistics(blobs((64, 64, 64), 2))
    errors = own.errors(new)
    assert list(errors) == [*SLICE_FIGURES, "two_point"]
    assert errors["thickness"] == pytest.approx(100 * (new.thickness / own.thickness - 1))
    assert errors["two_point"] == pytest.approx(
        100
        * np.linalg.norm(new.two_point[1:] - own.two_point[1:])
        / np.linalg.norm(own.two_point[1:])
    )
    solid = metrics.slice_statistics(~disc(20, 100))
    one_hole = metrics.slice_statistics(np.concatenate([disc(20, 100), ~disc(20, 100)]))
    # No hole in the one image: half a hole in each slice is half of what an image could show.
    assert metrics.slice_statistics(disc(20, 100)).errors(one_hole)["holes"] == 50
    assert solid.errors(one_hole)["holes"] == -50
    nothing = metrics.slice_statistics(np.zeros((1, 100, 100), bool))
    assert solid.errors(nothing)["spacing"] == np.inf
    assert np.isnan(nothing.errors(solid)["spacing"])
    assert nothing.errors(solid)["perimeter"] == np.inf
    assert nothing.errors(nothing)["perimeter"] == 0


def test_a_repeated_image_scores_0_across_its_axis() -> None:
    image = blobs((1, 48, 48), 1)
    extruded = np.repeat(image, 48, axis=0)
    found = metrics.slice_score({"z": image}, extruded)
    assert found.percent == pytest.approx(0, abs=1e-9)
    assert set(found.errors) == {"z"}
    assert max(map(abs, found.errors["z"].values())) < 1e-9
    turned = metrics.slice_score({"x": image}, extruded.transpose(1, 2, 0))
    assert turned.percent == pytest.approx(0, abs=1e-9)
    # Its slices along the axis are stripes.
    assert metrics.slice_score({"y": image, "x": image}, extruded).percent > 20


def test_the_score_is_the_mean_of_capped_errors() -> None:
    image, other = blobs((1, 64, 80), 1), blobs((1, 50, 70), 2, sigma=1.0)
    volume = blobs((64, 60, 72), 3, sigma=1.2)
    found = metrics.slice_score({"y": image, "z": other}, volume)
    assert list(found.errors) == ["z", "y"]
    assert found.images["y"].window == found.slices["z"].window == (50, 50)
    errors = [error for axis in found.errors.values() for error in axis.values()]
    assert max(errors) > 100
    assert found.percent == pytest.approx(np.mean(np.minimum(np.abs(errors), 100)))


def test_the_better_volume_scores_better() -> None:
    image = blobs((1, 64, 64), 1)
    images = {"z": image, "y": image, "x": image}
    same, finer = (metrics.slice_score(images, blobs((64,) * 3, 2, s)).percent for s in (2.5, 1.2))
    assert same < finer / 2


def test_types_of_images_and_volumes() -> None:
    image, volume = blobs((1, 32, 32), 1), blobs((32, 32, 32), 2)
    expected = metrics.slice_score({"z": image, "x": image}, volume)
    as_volumes = Volume((image * 255).astype(np.uint8), 2.0, "µm")
    found = metrics.slice_score({"z": as_volumes, "x": as_volumes}, Volume(volume), threads=2)
    assert found.errors == expected.errors
    assert found.images["z"] is found.images["x"]
    everywhere = metrics.slice_score(image, volume)
    assert everywhere.errors["x"] == expected.errors["x"]
    assert list(everywhere.errors) == ["z", "y", "x"]


def test_nothing_can_be_said_of_constant_images() -> None:
    found = metrics.slice_score({"z": np.zeros((1, 8, 8), bool)}, np.zeros((8, 8, 8), bool))
    assert found.percent == 0
    assert np.isnan(found.errors["z"]["thickness"])


@pytest.mark.parametrize(
    ("images", "volume", "message"),
    [
        ({}, np.ones((4, 4, 4), bool), r"images = "),
        ({"z": np.ones((4, 4), bool)}, np.ones((4, 4, 4), bool), r"array\.ndim = 2"),
        ({"z": np.ones((2, 4, 4), bool)}, np.ones((4, 4, 4), bool), r"images\.z = .*\(2, 4, 4\)"),
        ({"z": np.arange(64).reshape(1, 8, 8)}, np.ones((4, 4, 4), bool), r"images\.z = gray"),
        ({"z": np.ones((1, 4, 4), bool)}, np.ones((4, 4), bool), r"volume = .*\(4, 4\)"),
    ],
)
def test_bad_scores_are_named(images: dict, volume: np.ndarray, message: str) -> None:
    with pytest.raises(ParameterError, match=rf"^{message}.*must "):
        metrics.slice_score(images, volume)


@pytest.mark.parametrize(
    ("stack", "options", "message"),
    [
        (np.ones((2, 8, 9), bool), {"window": 9}, r"window = 9: must be at most 8"),
        (np.ones((2, 8, 9), bool), {"window": 0}, r"window = 0: must be at least 1"),
        (np.ones((2, 8, 9), bool), {"threads": -1}, r"threads = -1: must be at least 0"),
        (np.ones((8, 9), bool), {}, r"stack = .*: must be"),
        (np.ones((0, 8, 9), bool), {}, r"stack = .*: must hold"),
    ],
)
def test_bad_stacks_are_named(stack: np.ndarray, options: dict, message: str) -> None:
    with pytest.raises(ParameterError, match=rf"^{message}"):
        metrics.slice_statistics(stack, **options)
