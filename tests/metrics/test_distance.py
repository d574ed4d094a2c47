"""Distances against scipy and edt, and known values."""

from __future__ import annotations

import edt
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage
from tests.metrics.strategies import ORDERS, TYPES, boundaries, phases

from poresynth import metrics
from poresynth.errors import ParameterError
from poresynth.volume import Volume

sizes = st.sampled_from([1.0, 0.3, (1.0, 2.0, 1.0), (1.5, 1.1, 0.7), (0.5, 1e3, 2.0)])


def expected(solid: np.ndarray, size: object, boundary: str) -> np.ndarray:
    """What scipy finds, in three periods each way if periodic."""
    if solid.all():
        return np.full(solid.shape, np.inf)
    if boundary == "open":
        return ndimage.distance_transform_edt(solid, size)
    middle = tuple(slice(n, 2 * n) for n in solid.shape)
    return ndimage.distance_transform_edt(np.tile(solid, (3, 3, 3)), size)[middle]


@given(phases, sizes, boundaries)
def test_distances_are_those_of_scipy(solid: np.ndarray, size: object, boundary: str) -> None:
    found = metrics.distance_transform(solid, voxel_size=size, boundary=boundary)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, expected(solid, size, boundary), rtol=1e-6)


@given(phases, sizes, boundaries, st.sampled_from([0.4, 1.0, 1.5, 2.3, 40.0]))
def test_a_cap_only_clips(solid: np.ndarray, size: object, boundary: str, cap: float) -> None:
    found = metrics.distance_transform(solid, voxel_size=size, boundary=boundary, cap=cap)
    exact = np.minimum(expected(solid, size, boundary), cap)
    np.testing.assert_allclose(found, exact, rtol=1e-6)


@given(phases, boundaries, st.sampled_from(list(ORDERS)))
def test_memory_order_and_threads_do_not_matter(
    solid: np.ndarray, boundary: str, order: str
) -> None:
    options = {"voxel_size": (1.0, 1.3, 2.0), "boundary": boundary}
    first = metrics.distance_transform(solid, **options, threads=1)
    for threads in (2, 8):
        array = ORDERS[order](solid)
        found = metrics.distance_transform(array, **options, threads=threads)
        np.testing.assert_allclose(found, first, rtol=1e-6)
        again = metrics.distance_transform(array, **options, threads=1)
        np.testing.assert_array_equal(found, again)
        assert found.flags.f_contiguous >= array.flags.f_contiguous


@pytest.mark.parametrize("dtype", [t for t in TYPES if "float" not in t])
def test_every_type_and_label(dtype: str, rng: np.random.Generator) -> None:
    labels = rng.integers(0, 2 if dtype == "bool" else 4, (6, 7, 8)).astype(dtype)
    volume = Volume(labels, voxel_size=(2.0, 1.0, 1.0), unit="mm")
    for phase in np.unique(labels):
        found = metrics.distance_transform(volume, phase=int(phase))
        exact = ndimage.distance_transform_edt(labels == phase, (2.0, 1.0, 1.0))
        np.testing.assert_allclose(found, exact, rtol=1e-6)


@pytest.mark.parametrize("shape", [(1, 1, 1), (1, 1, 700), (600, 1, 1), (1, 640, 3), (3, 70, 520)])
@pytest.mark.parametrize("boundary", ["open", "periodic"])
def test_distances_beyond_any_window(shape: tuple[int, int, int], boundary: str) -> None:
    full = np.ones(shape, bool)
    assert np.isinf(metrics.distance_transform(full, boundary=boundary)).all()
    np.testing.assert_array_equal(metrics.distance_transform(full, boundary=boundary, cap=9), 9)
    assert not metrics.distance_transform(~full, boundary=boundary).any()
    one = full.copy()
    one[0, 0, 0] = False
    square = np.zeros(shape)
    for axis, n in enumerate(shape):
        steps = np.arange(n)
        if boundary == "periodic":
            steps = np.minimum(steps, n - steps)
        square = square + np.expand_dims(steps**2, tuple({0, 1, 2} - {axis}))
    exact = np.sqrt(square)
    found = metrics.distance_transform(one, boundary=boundary)
    np.testing.assert_array_equal(found, exact.astype(np.float32))
    capped = metrics.distance_transform(one, boundary=boundary, cap=300.5)
    np.testing.assert_array_equal(capped, np.minimum(exact, 300.5).astype(np.float32))


@pytest.mark.parametrize("size", [(1, 1, 1), (1.2, 1.0, 0.9)])
def test_few_voxels_outside(size: tuple[float, float, float], rng: np.random.Generator) -> None:
    solid = np.ones((40, 330, 300), bool)
    solid[tuple(rng.integers(0, solid.shape, (4, 3)).T)] = False
    found = metrics.distance_transform(solid, voxel_size=size)
    np.testing.assert_allclose(found, edt.edt(solid, anisotropy=size), rtol=1e-5)


@given(phases, boundaries, st.permutations([0, 1, 2]), st.sampled_from([0, 1, 2]))
def test_a_volume_may_be_turned_and_flipped(
    solid: np.ndarray, boundary: str, axes: list[int], flipped: int
) -> None:
    found = metrics.distance_transform(solid, boundary=boundary)
    turned = np.flip(solid.transpose(axes), flipped)
    again = metrics.distance_transform(turned, boundary=boundary)
    np.testing.assert_array_equal(again, np.flip(found.transpose(axes), flipped))


def test_the_border_is_no_wall() -> None:
    solid = np.ones((3, 3, 9), bool)
    solid[..., 0] = False
    np.testing.assert_array_equal(metrics.distance_transform(solid)[1, 1], np.arange(9))
    found = metrics.distance_transform(solid, boundary="periodic")[1, 1]
    np.testing.assert_array_equal(found, [0, 1, 2, 3, 4, 4, 3, 2, 1])


@pytest.mark.parametrize(
    ("options", "parameter"),
    [
        ({"cap": 0}, "cap"),
        ({"cap": float("nan")}, "cap"),
        ({"boundary": "mirror"}, "boundary"),
        ({"voxel_size": 0}, "voxel_size"),
        ({"phase": 7}, "phase"),
    ],
)
def test_bad_parameters_are_named(options: dict[str, object], parameter: str) -> None:
    with pytest.raises(ParameterError, match=rf"^{parameter} = .*: must be "):
        metrics.distance_transform(np.ones((2, 2, 2), bool), **options)
    with pytest.raises(ParameterError, match="shape"):
        metrics.distance_transform(np.ones((1, 1, 70_000), bool))


def test_distances_are_those_of_itk(rng: np.random.Generator) -> None:
    itk = pytest.importorskip("SimpleITK")
    solid = ndimage.gaussian_filter(rng.standard_normal((20, 24, 28)), 2) > 0
    image = itk.GetImageFromArray(solid.astype(np.uint8))
    image.SetSpacing((1.0, 1.5, 2.0))  # ITK counts axes from x
    outside = itk.SignedMaurerDistanceMap(
        image == 0, insideIsPositive=False, squaredDistance=False, useImageSpacing=True
    )
    expected = itk.GetArrayFromImage(outside)[solid]
    found = metrics.distance_transform(solid, voxel_size=(2.0, 1.5, 1.0))[solid]
    assert found == pytest.approx(expected, rel=1e-5)
