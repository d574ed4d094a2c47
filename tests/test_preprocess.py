from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from skimage.filters import threshold_otsu
from skimage.measure import block_reduce

import poresynth
from poresynth.errors import ParameterError
from poresynth.preprocess import (
    as_image,
    binarize,
    crop,
    downsample,
    is_two_valued,
    threshold,
    validate_voxels,
)
from poresynth.volume import Volume

RANDOM = np.random.default_rng(0)
GRAY = RANDOM.integers(0, 255, (8, 9, 10)).astype(np.uint8)
SCALE: dict[str, Any] = {"voxel_size": (3, 2, 1), "unit": "µm", "metadata": {"a": 1}}


class Derived(Volume):
    """A volume that knows more of the whole."""


def test_public_names() -> None:
    assert poresynth.crop is crop
    assert poresynth.downsample is downsample
    assert poresynth.threshold is threshold
    assert poresynth.binarize is binarize


# Cropping


def test_crop_is_a_view_of_the_kind_given() -> None:
    box = (slice(1, 3), slice(2, 5), slice(3, 7))
    part = crop(GRAY, (1, 2, 3), (2, 3, 4))
    assert isinstance(part, np.ndarray)
    assert np.shares_memory(part, GRAY)
    np.testing.assert_array_equal(part, GRAY[box])
    volume = crop(Derived(GRAY, **SCALE), np.array([1, 2, 3]), [2, 3, 4])
    assert type(volume) is Volume
    np.testing.assert_array_equal(volume.array, GRAY[box])
    assert (volume.voxel_size, volume.unit, volume.metadata) == ((3, 2, 1), "µm", {"a": 1})
    assert crop(np.zeros((4, 5, 6, 2)), (0, 0, 0), (4, 5, 6)).shape == (4, 5, 6, 2)


@pytest.mark.parametrize(
    ("start", "shape", "said"),
    [
        ((-1, 0, 0), (1, 1, 1), r"start = \(-1, 0, 0\): must be at least 0"),
        ((0, 0, 0), (1, 0, 1), r"shape = \(1, 0, 1\): must be at least 1"),
        ((0, 0, 5), (1, 1, 6), r"from \(0, 0, 5\) must end inside .* \(8, 9, 10\)"),
        ((0, 0), (1, 1, 1), "start = .*: must be three whole numbers"),
        ((0, 0, 0.5), (1, 1, 1), "start = .*: must be three whole numbers"),
        ((0, 0, 0), 4, "shape = 4: must be three whole numbers"),
    ],
)
def test_crop_checks_its_box(start: Any, shape: Any, said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        crop(GRAY, start, shape)


# Images


@pytest.mark.parametrize(
    ("axis", "size"), [(0, (3, 2, 1)), (1, (2, 3, 1)), (2, (1, 3, 2))], ids=["z", "y", "x"]
)
def test_a_thin_volume_becomes_an_image(axis: int, size: tuple[int, int, int]) -> None:
    thin = GRAY.take([4], axis=axis)
    image = as_image(Volume(thin, **SCALE))
    np.testing.assert_array_equal(image.array[0], GRAY.take(4, axis=axis))
    assert (image.voxel_size, image.unit, image.metadata) == (size, "µm", {"a": 1})
    assert np.shares_memory(as_image(thin), thin)
    coloured = np.stack([thin, 255 - thin], axis=3)
    np.testing.assert_array_equal(as_image(coloured)[..., 1], 255 - as_image(thin))


def test_an_image_stays_as_it_is() -> None:
    for array in (GRAY[:1], GRAY[:1, :1], GRAY[:1, :, :1]):
        np.testing.assert_array_equal(as_image(array), array)


def test_a_thick_volume_is_no_image() -> None:
    with pytest.raises(ParameterError, match=r"volume.shape = \(8, 9, 10\): must be one voxel"):
        as_image(GRAY)
    with pytest.raises(ParameterError, match="must be one voxel thick"):
        as_image(GRAY[..., np.newaxis])


# Down-sampling


@pytest.mark.parametrize("dtype", ["uint8", "int16", "uint16", "int32", "float32", "float64"])
@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("factor", [1, 2, 3])
def test_gray_is_the_mean(factor: int, order: str, dtype: str) -> None:
    array = np.asarray((GRAY * 1.7 - 100).astype(dtype), order=order)
    found = downsample(array, factor)
    nz, ny, nx = (n // factor * factor for n in array.shape)
    mean = block_reduce(array[:nz, :ny, :nx].astype(float), (factor,) * 3, np.mean)
    assert found.dtype == dtype
    if dtype.startswith("float"):
        np.testing.assert_allclose(found, mean, rtol=1e-6)
    else:
        np.testing.assert_array_equal(found, np.rint(mean))


@settings(max_examples=40, deadline=None)
@given(
    array=hnp.arrays(
        st.sampled_from([np.uint8, np.int16, np.int64, np.float32]),
        hnp.array_shapes(min_dims=3, max_dims=3, min_side=2, max_side=5),
        elements=st.integers(0, 3),
    ),
    factor=st.integers(1, 3),
)
def test_labels_are_the_majority(array: np.ndarray, factor: int) -> None:
    factor = min(factor, *array.shape)
    found = downsample(array, factor, labels=True)
    assert found.dtype == array.dtype
    assert found.shape == tuple(n // factor for n in array.shape)
    for position in np.ndindex(found.shape):
        block = array[tuple(slice(factor * i, factor * (i + 1)) for i in position)]
        values, counts = np.unique(block, return_counts=True)
        assert found[position] == values[np.argmax(counts)]


def test_ties_go_to_the_lower_label() -> None:
    block = np.array([7, 7, 7, 7, 2, 2, 2, 2]).reshape(2, 2, 2)
    assert downsample(block, 2, labels=True) == 2
    assert downsample(block == 7, 2).dtype == bool
    assert not downsample(block == 7, 2).any()
    assert not downsample(block == 2, 2).any()


def test_two_values_stay_two() -> None:
    two = np.where(GRAY > 99, 255, 0).astype(np.uint8)
    assert set(np.unique(downsample(two, 2))) == {0, 255}
    assert len(np.unique(downsample(two, 2, labels=False))) > 2
    assert downsample(GRAY > 99, 2).dtype == bool


@pytest.mark.parametrize("labels", [False, True])
def test_channels_are_down_sampled_apart(labels: bool) -> None:
    array = RANDOM.integers(0, 4, (4, 6, 8, 3)).astype(np.uint8)
    found = downsample(array, 2, labels)
    assert found.shape == (2, 3, 4, 3)
    for c in range(3):
        np.testing.assert_array_equal(found[..., c], downsample(array[..., c], 2, labels))


def test_the_scale_grows() -> None:
    volume = downsample(Derived(GRAY, **SCALE), 2)
    assert type(volume) is Volume
    assert volume.shape == (4, 4, 5)
    assert (volume.voxel_size, volume.unit, volume.metadata) == ((6, 4, 2), "µm", {"a": 1})


def test_an_image_is_down_sampled_in_its_plane() -> None:
    volume = downsample(Volume(GRAY[:1], **SCALE), 3)
    assert volume.shape == (1, 3, 3)
    assert volume.voxel_size == (3, 6, 3)


@pytest.mark.parametrize("factor", [0, -1, 9, 2.0, None])
def test_factors_are_checked(factor: Any) -> None:
    with pytest.raises(ParameterError, match=rf"factor = {factor}: must be"):
        downsample(GRAY, factor)


# Thresholds


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "int16", "float32", "float64"])
def test_otsu(dtype: str) -> None:
    array = np.concatenate([GRAY // 4, GRAY // 4 + 150]).astype(dtype)
    expected = threshold_otsu(array)
    assert threshold(array) == expected
    assert isinstance(threshold(Volume(array)), float)
    np.testing.assert_array_equal(binarize(array), array > expected)
    np.testing.assert_array_equal(binarize(array, solid="dark"), array <= expected)


def test_two_values_are_cut_half_way() -> None:
    assert threshold(np.where(GRAY > 99, 255, 0).astype(np.uint8)) == 127.5
    assert threshold(np.where(GRAY > 99, 3, -1).astype(np.int16)) == 1
    np.testing.assert_array_equal(binarize(GRAY > 99), GRAY > 99)
    np.testing.assert_array_equal(binarize(GRAY > 99, solid="dark"), GRAY <= 99)


def test_a_given_threshold_must_part_the_volume() -> None:
    assert threshold(GRAY, 99) == 99
    low, high = int(GRAY.min()), int(GRAY.max())
    assert threshold(GRAY, low) == low
    np.testing.assert_array_equal(binarize(Volume(GRAY), 99.5), GRAY > 99.5)
    for value in (low - 0.1, high, 300, np.nan):
        with pytest.raises(ParameterError, match=r"threshold = .*or one phase is empty"):
            threshold(GRAY, value)


def test_what_cannot_be_cut() -> None:
    with pytest.raises(ParameterError, match=r"volume\.channels = 3: must have one channel"):
        binarize(np.arange(24).reshape(2, 2, 2, 3))
    with pytest.raises(ParameterError, match="must not be constant"):
        binarize(np.ones((3, 3, 3)))
    with pytest.raises(ParameterError, match="solid = gray: must be 'bright' or 'dark'"):
        binarize(GRAY, solid="gray")


@pytest.mark.parametrize(
    ("array", "expected"),
    [
        (np.zeros((2, 2, 2)), True),
        (GRAY > 99, True),
        (np.where(GRAY > 99, 254, 1), True),
        (GRAY, False),
        (np.array([[[0, 1, 2]]]), False),
        (np.zeros((0, 2, 2)), True),
        (np.array([[[0.0, np.nan, 1.0]]]), False),
    ],
)
def test_is_two_valued(array: np.ndarray, expected: bool) -> None:
    assert is_two_valued(array) is expected
    assert is_two_valued(Volume(array)) is expected


# Validation


def test_good_voxels_pass() -> None:
    volume = Volume(GRAY)
    assert validate_voxels(volume) is volume
    for array in (GRAY, GRAY > 9, GRAY.astype(float), GRAY[:1], GRAY[..., np.newaxis], GRAY.T):
        assert validate_voxels(array).array is array


def test_infinite_voxels_are_counted_and_located() -> None:
    array = GRAY.astype(np.float32)
    array[2, 3, 4], array[2, 3, 5], array[7, 0, 0] = np.nan, np.inf, -np.inf
    said = r"^exemplar = 3 NaN or infinite voxels, the first at \(2, 3, 4\): must be finite$"
    with pytest.raises(ParameterError, match=said):
        validate_voxels(array, "exemplar")
    with pytest.raises(ParameterError, match=r"the first at \(2, 3, 4, 0\)"):
        validate_voxels(array[..., np.newaxis])


@pytest.mark.parametrize(
    ("array", "said"),
    [
        (np.full((3, 3, 3), 7), "x = 7 everywhere: must not be constant"),
        (np.zeros((3, 3, 3), bool), "x = False everywhere"),
        (np.ones((3, 3, 3, 2)), r"x = \[1. 1.\] everywhere"),
        (np.zeros((1, 1, 1)), "at least two edges longer than one voxel"),
        (np.arange(5).reshape(1, 1, 5), r"array of shape \(1, 1, 5\): .*at least two edges"),
        (np.zeros((0, 3, 3)), r"x = array of shape \(0, 3, 3\): must hold voxels"),
        (np.arange(5), r"x = array of shape \(5,\): must be \(z, y, x\)"),
        (np.eye(3), r"x = array of shape \(3, 3\): must be \(z, y, x\)"),
        (np.ones((3, 3, 3), complex), "x = array of complex128: must be bool, integer or float"),
        (np.full((3, 3, 3), "a"), "must be bool, integer or float"),
        (np.full((3, 3, 3), None), "x = array of object: must be bool, integer or float"),
    ],
)
def test_bad_voxels_are_named(array: np.ndarray, said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        validate_voxels(array, "x")


def test_three_labels_are_taken_for_labels_unless_said_otherwise() -> None:
    phases = np.random.default_rng(0).choice(np.array([0, 7, 200], np.uint8), (6, 6, 6))
    np.testing.assert_array_equal(downsample(phases, 2), downsample(phases, 2, labels=True))
    assert len(np.unique(downsample(phases, 2, labels=False))) > 3
