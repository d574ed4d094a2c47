"""Slice response matching, its start, and the periodic enlargement."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage
from tests.references import response_matching as twin
from tests.references.random_key import Key

from poresynth import _core
from poresynth.metrics import two_point_correlation

Image = tuple[int, np.ndarray, bool, float]


def smooth(shape: tuple[int, ...], seed: int, sigma: float = 1.0) -> np.ndarray:
    noise = np.random.default_rng(seed).random(shape)
    blurred = ndimage.gaussian_filter(noise, sigma, mode="wrap")
    return (255 * (blurred - blurred.min()) / np.ptp(blurred)).astype(np.float32)


def match(volume: np.ndarray, images: list[Image], **change: int) -> tuple[np.ndarray, list[float]]:
    options = {"steps": 1, "filters": 4, "edge": 4, "seed": 3, **change}
    return _core.match_responses(volume, images, **options)


def alike(images: list[np.ndarray]) -> list[Image]:
    return [(axis, image, True, 1.0) for axis, image in enumerate(images)]


@pytest.mark.parametrize(("deep", "alike"), [(False, False), (True, False), (True, True)])
@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("axes", [(0, 1, 2), (2,), (1, 0)])
def test_a_step_equals_the_numpy_twin(
    channels: int, axes: tuple[int, ...], deep: bool, alike: bool
) -> None:
    shape, edge, filters, seed = (9, 20, 6), 3, 5, 7
    volume = np.stack([smooth(shape, c) for c in range(channels)])
    images: list[Image] = []
    for axis in axes:
        image = np.stack([smooth((11 + axis, 9), 10 * axis + c) for c in range(channels)])
        images.append((axis, image, axis != 1, 1.0 + axis))
    regularisation = 2.0 if alike else 0.05
    got, energies = _core.match_responses(
        volume,
        images,
        steps=1,
        filters=filters,
        edge=edge,
        seed=seed,
        deep=deep,
        alike=alike,
        regularisation=regularisation,
    )
    key = Key.new(seed).with_(0)
    want, energy = twin.step(
        volume.astype(float), images, filters, edge, key, deep, alike, regularisation
    )
    assert energies[0] == pytest.approx(energy, rel=5e-3)
    for c in range(channels):
        values = np.concatenate([image[c].ravel() for _, image, *_ in images])
        ranks = np.argsort(np.argsort(want[c].ravel())) / (want[c].size - 1)
        matched = np.quantile(values, ranks).reshape(shape)
        off = np.abs(got[c] - matched)
        # Second responses jump where nothing is left of the first; without them it is 15 or more.
        assert off.mean() < (1.5 if deep else 1.0)


def test_images_too_small_for_second_responses_have_first_ones_only() -> None:
    volume = smooth((6, 7, 8), 1)[None]
    # Four pixels more than a filter are the least.
    for edge, alike_ in ((6, True), (7, False)):
        images = alike([smooth((9, edge), 2)[None]] * 3)
        shallow, _ = match(volume, images, edge=3)
        deep, _ = match(volume, images, edge=3, deep=True)
        assert np.array_equal(shallow, deep) == alike_


@pytest.mark.parametrize("shape", [(1, 1, 1), (1, 5, 2), (3, 3, 17)])
def test_second_responses_of_few_voxels_and_of_one_value(shape: tuple[int, ...]) -> None:
    volume = smooth((20, 20, 20), 4)[None, : shape[0], : shape[1], : shape[2]]
    found, energies = match(volume, alike([smooth((12, 9), 5)[None]] * 3), edge=3, deep=True)
    assert np.isfinite(found).all()
    assert np.isfinite(energies).all()
    flat, _ = match(volume, alike([np.full((1, 12, 9), 7, np.float32)] * 3), edge=3, deep=True)
    assert (flat == 7).all()


def test_second_responses_do_not_depend_on_the_threads() -> None:
    volume = np.stack([smooth((20, 18, 34), c) for c in range(2)])
    image = np.stack([smooth((24, 24), 7 + c) for c in range(2)])
    one, two = (
        match(volume, alike([image] * 3), steps=3, deep=True, threads=threads)[0]
        for threads in (1, 2)
    )
    np.testing.assert_array_equal(one, two)


def test_a_start_that_is_cut_has_the_two_point_correlation_of_the_cut_image() -> None:
    solid = smooth((128, 128), 5, 3.0) > 150
    image = np.where(solid, np.float32(200), np.float32(50))[None]
    targets: list[Image] = [(axis, image, True, 1.0) for axis in range(3)]
    start = _core.random_field(targets, (64, 64, 64), seed=2)
    cut = start[0] > 127.5
    assert cut.mean() == pytest.approx(solid.mean(), abs=1e-3)
    # Nearer than 4 voxels a Gaussian field that is cut is rougher than the image.
    wanted = two_point_correlation(solid[None], 24).radial[4:]
    found = two_point_correlation(cut, 24).radial[4:]
    assert np.linalg.norm(found - wanted) < 0.05 * np.linalg.norm(wanted)
