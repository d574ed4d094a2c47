"""Windows of the endless field."""

from __future__ import annotations

import math
import shutil
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from poresynth.engines.neural.tiles import assemble
from poresynth.engines.periodic_field.generator import Generator
from poresynth.engines.periodic_field.guidance import Guide
from poresynth.engines.periodic_field.latent import LatentField
from poresynth.engines.periodic_field.sampling import FieldTiles, Frame, tile_memory
from poresynth.errors import ParameterError

PERIOD = (10.0, 12.5, 9.0)
SPACING = (0.5, 1.0, 0.7)
ENCODED = (True, True, True)


def tiles(
    axes: int = 3,
    kind: Any = "quintic",
    frame: Frame | None = None,
    guide: Guide | None = None,
    points: tuple[int, ...] = (),
    **options: Any,
) -> FieldTiles:
    torch.manual_seed(4)
    latent = LatentField(axes, points, 2, 3, 2, SPACING[:axes], kind, 0.2)
    made = Generator(
        axes=axes,
        channels=2,
        latents=latent.size,
        guides=0 if guide is None else 1,
        bandwidth=1,
        diagonal=axes == 2,
        width=16,
        depth=3,
    )
    # A field that varies: the weights of a new network make hardly any difference.
    with torch.no_grad():
        for weight in made.parameters():
            if weight.ndim == 2:
                weight *= 3
    made.requires_grad_(False)
    frame = Frame.open(PERIOD[:axes], SPACING[:axes], ENCODED[:axes]) if frame is None else frame
    return FieldTiles(made, latent, frame, seed=3, guide=guide, **options)


def whole(made: FieldTiles, start: tuple[int, ...], shape: tuple[int, ...], **options: Any) -> Any:
    return assemble(made, start, shape, **options)


@pytest.mark.parametrize(("kind", "points"), [("quintic", ()), ("paper", ()), ("gradient", (1, 3))])
def test_a_window_has_the_bits_of_the_whole(kind: str, points: tuple[int, ...]) -> None:
    made = tiles(kind=kind, points=points)
    large = whole(made, (-9, 3, -40), (30, 34, 45))
    assert large.std() > 0.05
    small = whole(made, (-2, 10, -13), (9, 20, 7))
    np.testing.assert_array_equal(small, large[:, 7:16, 7:27, 27:34])


@settings(max_examples=15)
@given(st.tuples(*[st.integers(-300, 300)] * 2), st.tuples(*[st.integers(1, 80)] * 2))
def test_windows_of_images_have_the_bits_of_the_whole(
    corner: tuple[int, int], edges: tuple[int, int]
) -> None:
    made = tiles(axes=2)
    found = whole(made, (0, *corner), (1, *edges))
    more = whole(made, (0, corner[0] - 5, corner[1] - 11), (1, edges[0] + 9, edges[1] + 13))
    np.testing.assert_array_equal(found, more[:, :, 5 : 5 + edges[0], 11 : 11 + edges[1]])


def test_the_number_of_threads_does_not_change_a_bit() -> None:
    made = tiles()
    one = whole(made, (0, 0, 0), (40, 33, 20), threads=1)
    np.testing.assert_array_equal(one, whole(made, (0, 0, 0), (40, 33, 20), threads=3))


@pytest.mark.parametrize("axes", [2, 3])
def test_the_size_of_a_tile_does_not_change_the_field(axes: int) -> None:
    shape = (1, 70, 50) if axes == 2 else (20, 40, 33)
    expected = whole(tiles(axes=axes, points=(1,)), (0, 5, -7), shape)
    edge = (1, 10, 24) if axes == 2 else (7, 48, 16)
    found = whole(tiles(axes=axes, points=(1,), edge=edge), (0, 5, -7), shape)
    np.testing.assert_allclose(found, expected, atol=1e-5)


@pytest.mark.parametrize("axes", [2, 3])
def test_the_memory_of_a_tile_has_room_for_its_latent_values(axes: int) -> None:
    made = tiles(axes=axes, points=(1,))
    values = made._latent.size * math.prod(made.edge)
    found = tile_memory(made.device, axes, latents=made._latent.size, width=16)
    assert 4 * values < found < 4 * 6 * values


def test_the_field_is_unbounded() -> None:
    made = tiles(axes=2)
    far = 40_000_000
    here, there = (whole(made, (0, 0, x), (1, 8, 400)) for x in (0, far))
    # As varied there as here, and neither clamped nor repeated.
    assert there.std() == pytest.approx(here.std(), rel=0.3)
    assert np.abs(here - there).max() > 0.05


def test_seeds_make_different_fields() -> None:
    first = tiles()
    other = FieldTiles(first._generator, first._latent, first._frame, seed=4)
    difference = whole(first, (0, 0, 0), (16, 16, 16)) - whole(other, (0, 0, 0), (16, 16, 16))
    assert np.abs(difference).max() > 0.05


@pytest.mark.parametrize(("kind", "points"), [("quintic", ()), ("paper", ()), ("gradient", (1, 3))])
@pytest.mark.parametrize("shape", [(20, 25, 18), (21, 24, 30)])
def test_a_periodic_output_goes_on_where_it_ends(
    kind: str, points: tuple[int, ...], shape: tuple[int, int, int]
) -> None:
    frame, stretch = Frame.open(PERIOD, SPACING, ENCODED).periodic(shape)
    assert all(0.8 <= factor <= 1.25 for factor in stretch)
    made = tiles(kind=kind, frame=frame, points=points)
    first = whole(made, (0, 0, 0), shape)
    for lap in ((1, 0, 0), (0, -1, 2), (3, 1, -1)):
        start = tuple(k * n for k, n in zip(lap, shape, strict=True))
        np.testing.assert_array_equal(whole(made, start, shape), first)
    across = whole(made, (-5, -6, -7), shape)
    np.testing.assert_array_equal(across, np.roll(first, (5, 6, 7), (1, 2, 3)))


@pytest.mark.parametrize("points", [(), (1,), (3, 1)])
def test_a_periodic_output_has_no_step_at_its_seam(points: tuple[int, ...]) -> None:
    shape = (20, 25, 18)
    frame, _ = Frame.open(PERIOD, SPACING, ENCODED).periodic(shape)
    field = whole(tiles(frame=frame, points=points), (0, 0, 0), shape)
    for axis in (1, 2, 3):
        steps = np.abs(np.diff(field, axis=axis))
        seam = np.abs(field.take(0, axis) - field.take(-1, axis))
        assert seam.max() <= steps.max() * 1.2


def test_what_does_not_fit_the_period_is_refused() -> None:
    with pytest.raises(ParameterError, match="must be near 10, 20, 30 … voxels"):
        Frame.open(PERIOD, SPACING, ENCODED).periodic((15, 25, 18))
    with pytest.raises(ParameterError, match="periodic output"):
        Frame.open(PERIOD, SPACING, ENCODED).periodic((5, 25, 18))


def test_the_stretch_is_what_it_says() -> None:
    frame, stretch = Frame.open(PERIOD, SPACING, ENCODED).periodic((22, 25, 18))
    assert stretch == pytest.approx((1.1, 1.0, 1.0))
    assert frame.frequency == pytest.approx((2 / 11, 2 / 12.5, 2 / 9))
    assert frame.sites == (8, 4, 6)


def test_an_axis_that_is_not_encoded_repeats_after_any_whole_number_of_cells() -> None:
    # Cells of 2.5, 6.25 and 3.15 voxels.
    shape = (16, 25, 19)
    frame, stretch = Frame.open(PERIOD, SPACING, (False, True, False)).periodic(shape)
    assert stretch == pytest.approx((16 / 15, 1.0, 19 / 18.9), rel=1e-3)
    assert frame.sites == (6, 4, 6)
    made = tiles(frame=frame)
    made._generator.encoded.copy_(torch.tensor(frame.encoded))
    first = whole(made, (0, 0, 0), shape)
    across = whole(made, (-5, -6, -7), shape)
    np.testing.assert_array_equal(across, np.roll(first, (5, 6, 7), (1, 2, 3)))
    for axis in (1, 2, 3):
        steps = np.abs(np.diff(first, axis=axis))
        seam = np.abs(first.take(0, axis) - first.take(-1, axis))
        assert seam.max() <= steps.max() * 1.2


def test_a_constant_latent_makes_a_field_of_the_encodings_period() -> None:
    made = tiles(constant=True, frame=Frame.open((10.0, 12.0, 8.0), SPACING, ENCODED))
    field = whole(made, (0, 0, 0), (30, 36, 24))
    assert field.std() > 0.05
    for axis, period in ((1, 10), (2, 12), (3, 8)):
        ahead = np.roll(field, -period, axis)
        keep = [slice(None)] * 4
        keep[axis] = slice(0, -period)
        np.testing.assert_allclose(ahead[tuple(keep)], field[tuple(keep)], atol=1e-5)


@pytest.mark.parametrize("shape", [(20, 25, 18), (7, 8, 16)])
def test_a_mirrored_output_is_its_own_mirror_image_and_goes_on(
    shape: tuple[int, int, int],
) -> None:
    made = tiles(frame=Frame.open(PERIOD, SPACING, ENCODED, mirrored=shape))
    field = whole(made, (0, 0, 0), shape)
    for axis in (1, 2, 3):
        np.testing.assert_array_equal(field, np.flip(field, axis))
    np.testing.assert_array_equal(whole(made, shape, shape), field)
    plain = whole(tiles(), (0, 0, 0), shape)
    half = (slice(None), *(slice(0, (n + 1) // 2) for n in shape))
    np.testing.assert_array_equal(field[half], plain[half])


@pytest.mark.parametrize("resolution", [3.0, 5.0, 1 / 3])
def test_a_finer_output_is_the_same_field(resolution: float) -> None:
    plain = tiles(axes=2)
    other = tiles(
        axes=2, frame=Frame.open(PERIOD[:2], SPACING[:2], ENCODED[:2], resolution=resolution)
    )
    # The middle of an odd number of voxels is that of the one voxel in their place.
    finer, coarser = (other, plain) if resolution > 1 else (plain, other)
    step = round(max(resolution, 1 / resolution))
    found = whole(finer, (0, 0, 0), (1, 8 * step, 8 * step))[:, 0]
    expected = whole(coarser, (0, 0, 0), (1, 8, 8))[:, 0]
    middle = slice(step // 2, None, step)
    np.testing.assert_allclose(found[:, middle, middle], expected, atol=1e-3)
    assert np.abs(np.diff(expected)).max() > 0.1


def test_a_larger_noise_scale_varies_more_slowly() -> None:
    def slope(scale: float) -> float:
        frame = Frame.open((1e6, 1e6), (16e-6, 16e-6), ENCODED[:2], noise_scale=scale)
        field = whole(tiles(axes=2, frame=frame), (0, 0, 0), (1, 128, 128))
        return float(np.abs(np.diff(field, axis=-1)).mean())

    # The encoding hardly turns here: all that varies is the noise.
    assert slope(1.0) > 1.6 * slope(2.0) > 2.5 * slope(4.0)


def test_guidance_reaches_each_voxel_by_its_place() -> None:
    values = np.random.default_rng(5).random((3, 4, 2)).astype(np.float32)
    guide = Guide(values, (20, 30, 24))
    made = tiles(guide=guide)
    field = whole(made, (0, 0, 0), (20, 30, 24))
    np.testing.assert_array_equal(whole(made, (3, 20, 11), (9, 8, 7)), field[:, 3:12, 20:28, 11:18])
    number = float(guide.at([np.array([5]), np.array([7]), np.array([9])])[0, 0, 0])
    even = tiles(guide=Guide(np.full((1, 1, 1), number, np.float32), (20, 30, 24)))
    alike = whole(even, (0, 0, 0), (20, 30, 24))
    np.testing.assert_allclose(alike[:, 5, 7, 9], field[:, 5, 7, 9], atol=1e-6)
    assert np.abs(alike - field).max() > 0.01


@pytest.mark.skipif(shutil.which("g++") is None, reason="PyTorch compiles by g++")
@pytest.mark.filterwarnings("ignore")  # Of the compiler, on its own code.
def test_a_compiled_perceptron_makes_the_same_field() -> None:
    plain, compiled = (whole(tiles(compiled=c), (0, 3, -5), (9, 20, 9)) for c in (False, True))
    np.testing.assert_allclose(compiled, plain, atol=1e-5)


def test_reduced_precision_makes_nearly_the_same_field() -> None:
    plain, reduced = (
        whole(tiles(precision=p), (0, 3, -5), (9, 20, 9)) for p in ("float32", "bfloat16")
    )
    assert reduced.dtype == np.float32
    assert 0 < np.abs(reduced - plain).max() < 0.1
