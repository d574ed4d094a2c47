"""Sections of volumes, across the axes and along a diagonal."""

from __future__ import annotations

import numpy as np
import pytest
from tests.metrics.strategies import ORDERS, TYPES

from poresynth import metrics
from poresynth.errors import ParameterError
from poresynth.metrics.sections import as_images
from poresynth.volume import Volume


def test_rows_and_columns_are_the_other_axes_in_their_order() -> None:
    array = np.arange(3 * 4 * 5).reshape(3, 4, 5)
    volume = Volume(array, (3.0, 2.0, 1.0), "µm", {"made": "by hand"})
    expected = {
        "z": ([array[i] for i in range(3)], (3.0, 2.0, 1.0)),
        "y": ([array[:, i] for i in range(4)], (2.0, 3.0, 1.0)),
        "x": ([array[:, :, i] for i in range(5)], (1.0, 3.0, 2.0)),
    }
    for axis, (slices, size) in expected.items():
        found = metrics.sections(volume, axis)
        np.testing.assert_array_equal(found.array, slices)
        assert (found.voxel_size, found.unit, found.metadata) == (size, "µm", {"made": "by hand"})
        assert np.shares_memory(found.array, array)
        channels = metrics.sections(array[..., np.newaxis] + [0, 100], axis)
        np.testing.assert_array_equal(channels.array[..., 1], found.array + 100)


def test_the_middle_diagonal_of_a_cube_is_the_plane_of_equal_y_and_x() -> None:
    # Along the diagonal y = x a plane wave across it is constant, and y + x grows by √2 a pixel.
    z, y, x = np.meshgrid(*[np.arange(9.0)] * 3, indexing="ij")
    (difference,) = metrics.diagonal_sections(y - x + 100 * z, 1)
    np.testing.assert_allclose(difference, 100 * z[:, :, 0])
    (total,) = metrics.diagonal_sections(y + x, 1)
    np.testing.assert_allclose(np.diff(total, axis=1), np.sqrt(2))
    np.testing.assert_allclose(total[:, 4], 8)


def test_parallel_diagonals_stay_inside_and_are_evenly_spaced() -> None:
    shapes = [(4, 11, 11), (4, 11, 20), (4, 20, 11), (5, 1, 6), (1, 7, 7)]
    for nz, ny, nx in shapes:
        _, y, x = np.meshgrid(np.zeros(nz), np.arange(ny), np.arange(nx), indexing="ij")
        planes = metrics.diagonal_sections((y - x).astype(float), 5)
        assert planes.shape == (5, nz, min(ny, nx))
        # Outside, the nearest voxel would bend the planes.
        np.testing.assert_allclose(planes - planes[:, :1, :1], 0, atol=1e-9)
        offsets = planes[:, 0, 0] / np.sqrt(2)
        np.testing.assert_allclose(np.diff(offsets), (min(ny, nx) - 1) * (np.sqrt(0.5) - 0.5) / 2)
        assert offsets[2] == pytest.approx((ny - nx) / 2 / np.sqrt(2))


@pytest.mark.parametrize("dtype", TYPES)
def test_two_values_stay_two(dtype: str, rng: np.random.Generator) -> None:
    solid = rng.random((6, 12, 13)) < 0.4
    low, high = (0, 1) if dtype == "bool" else (3, 100)
    found = metrics.diagonal_sections(np.where(solid, high, low).astype(dtype))
    assert found.dtype == dtype
    share = metrics.diagonal_sections(solid.astype(float) + 1e-9 * np.arange(13))
    tied = abs(share - 0.5) < 1e-6
    assert tied.mean() < 0.02
    np.testing.assert_array_equal(found[~tied], np.where(share > 0.5, high, low)[~tied])


def test_labels_stay_labels_and_gray_values_are_between(rng: np.random.Generator) -> None:
    labels = rng.integers(0, 3, (6, 12, 12)).astype(np.uint8) * 100
    assert set(np.unique(metrics.diagonal_sections(labels)).tolist()) == {0, 100, 200}
    gray = rng.integers(0, 256, (6, 12, 12)).astype(np.uint8)
    found = metrics.diagonal_sections(gray, 3)
    exact = metrics.diagonal_sections(gray.astype(float), 3)
    np.testing.assert_array_equal(found, np.rint(exact))
    assert len(np.setdiff1d(found, gray)) > 0


@pytest.mark.parametrize("order", ORDERS)
def test_memory_order_and_channels(order: str, rng: np.random.Generator) -> None:
    gray = rng.random((5, 8, 9))
    expected = metrics.diagonal_sections(gray)
    np.testing.assert_array_equal(metrics.diagonal_sections(ORDERS[order](gray)), expected)
    both = metrics.diagonal_sections(np.stack([gray, 2 * gray], axis=-1))
    np.testing.assert_array_equal(both[..., 0], expected)
    np.testing.assert_allclose(both[..., 1], 2 * expected)


def test_bad_parameters_are_named() -> None:
    array = np.zeros((3, 4, 5))
    with pytest.raises(ParameterError, match=r"^axis = 0: must be 'z', 'y' or 'x'"):
        metrics.sections(array, 0)
    with pytest.raises(ParameterError, match=r"^count = 0: must be at least 1"):
        metrics.diagonal_sections(array, 0)
    with pytest.raises(ParameterError, match=r"^volume = .*\(3, 0, 5\): must hold voxels"):
        metrics.diagonal_sections(array[:, :0])
    with pytest.raises(ParameterError, match=r"^array.ndim = 2: must be"):
        metrics.sections(array[0], "z")


def test_images_stand_for_axes() -> None:
    one, two = np.zeros((1, 4, 5)), Volume(np.zeros((1, 6, 7, 3)))
    found = as_images({"x": one, "z": two, "y": one})
    assert list(found) == ["z", "y", "x"]
    assert found["z"] is two
    assert found["y"] is found["x"]
    assert list(as_images(one)) == ["z", "y", "x"]
    assert as_images(two)["x"] is two
    for images, message in (
        ({}, r"^images = .*at least one image"),
        ({"t": one}, r"^images = t: must be images by 'z', 'y' or 'x'"),
        ({"y": np.zeros((2, 4, 5))}, r"^images\.y = array of shape \(2, 4, 5\): must be one slice"),
        ({"y": np.zeros((1, 0, 5))}, r"^images\.y = array of shape \(1, 0, 5\): must be one slice"),
    ):
        with pytest.raises(ParameterError, match=message):
            as_images(images)
