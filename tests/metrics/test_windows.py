"""Local porosity against sliding windows, and against known values."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage
from tests.metrics.strategies import ORDERS, boundaries, phases

from poresynth import metrics
from poresynth.errors import ParameterError
from poresynth.volume import Volume


def porosities(solid: np.ndarray, window: tuple[int, ...], boundary: str) -> np.ndarray:
    """Pore voxels of every window."""
    if boundary == "periodic":
        solid = np.pad(solid, [(0, n - 1) for n in window], mode="wrap")
    views = np.lib.stride_tricks.sliding_window_view(~solid, window)
    return views.sum(axis=(3, 4, 5))


@settings(max_examples=60)
@given(phases, st.integers(1, 9), st.integers(1, 20), boundaries, st.sampled_from(list(ORDERS)))
def test_windows_are_counted_exactly(
    solid: np.ndarray, edge: int, bins: int, boundary: str, order: str
) -> None:
    edge = min(edge, min(solid.shape))
    found = metrics.local_porosity(ORDERS[order](solid), [edge, 1], bins=bins, boundary=boundary)
    pores = porosities(solid, (edge,) * 3, boundary)
    expected = np.bincount(np.minimum(pores.ravel() * bins // edge**3, bins - 1), minlength=bins)
    np.testing.assert_array_equal(found.counts[0], expected)
    assert found.mean[0] == pytest.approx((pores / edge**3).mean())
    assert found.variance[0] == pytest.approx((pores / edge**3).var(), abs=1e-12)
    np.testing.assert_allclose(found.density.sum(axis=1) / bins, 1)
    assert found.mean[1] == pytest.approx(metrics.porosity(solid))
    assert found.variance[1] == pytest.approx(found.mean[1] * (1 - found.mean[1]), abs=1e-12)


def test_larger_volumes_agree_with_scipy(rng: np.random.Generator) -> None:
    solid = ndimage.gaussian_filter(rng.standard_normal((40, 50, 60)), 2, mode="wrap") > 0
    sums = ndimage.uniform_filter(1.0 - solid, 7, mode="wrap")
    found = metrics.local_porosity(solid, 7, boundary="periodic")
    assert found.mean[0] == pytest.approx(sums.mean())
    assert found.variance[0] == pytest.approx(sums.var())
    assert found.counts.shape == (1, 100)


def test_threads_do_not_matter(rng: np.random.Generator) -> None:
    solid = rng.random((30, 21, 22)) < 0.4
    one, *others = (metrics.local_porosity(solid, [3, 9], threads=n) for n in (1, 2, 8))
    for other in others:
        np.testing.assert_array_equal(one.counts, other.counts)
        np.testing.assert_array_equal(one.variance, other.variance)


def test_random_voxels_vary_as_a_binomial(rng: np.random.Generator) -> None:
    solid = rng.random((64, 64, 64)) < 0.3
    found = metrics.local_porosity(solid, [2, 4, 8], boundary="periodic")
    np.testing.assert_allclose(found.mean, 1 - solid.mean())
    np.testing.assert_allclose(found.variance, 0.21 / np.array([8, 64, 512]), rtol=0.1)


@given(phases)
def test_a_turn_and_a_mirror_change_nothing(solid: np.ndarray) -> None:
    expected = metrics.local_porosity(solid, 1 + min(solid.shape) // 2)
    for other in (np.rot90(solid, axes=(0, 2)), np.rot90(solid), solid[:, ::-1]):
        found = metrics.local_porosity(other, 1 + min(solid.shape) // 2)
        np.testing.assert_array_equal(found.counts, expected.counts)
        assert found.variance == expected.variance


def test_voxels_that_are_no_cubes(rng: np.random.Generator) -> None:
    solid = rng.random((10, 20, 30)) < 0.5
    found = metrics.local_porosity(Volume(solid, (3.0, 1.5, 1.0), "µm"), [6, 1])
    assert found.windows.tolist() == [[2, 4, 6], [1, 1, 1]]
    assert found.unit == "µm"
    assert found.edges[0] == pytest.approx(6)
    pores = porosities(solid, (2, 4, 6), "open") / 48
    assert found.variance[0] == pytest.approx(pores.var())


def test_no_voxel_and_all_voxels() -> None:
    empty, full = np.zeros((3, 4, 5), bool), np.ones((3, 4, 5), bool)
    for solid, porosity in ((empty, 1), (full, 0)):
        found = metrics.local_porosity(solid, [1, 3], bins=7)
        assert found.mean.tolist() == [porosity] * 2
        assert found.variance.tolist() == [0, 0]
        assert found.counts[:, -1 if porosity else 0].tolist() == [60, 6]
    assert metrics.local_porosity(full, []).density.shape == (0, 100)


@pytest.mark.parametrize(
    ("options", "parameter"),
    [
        ({"edges": 0}, "edges"),
        ({"edges": [2, 2.5]}, "edges"),
        ({"edges": 4}, "edges"),
        ({"edges": 2, "bins": 0}, "bins"),
        ({"edges": 2, "bins": 100_000}, "bins"),
        ({"edges": 2, "boundary": "mirror"}, "boundary"),
    ],
)
def test_bad_parameters_are_named(options: dict[str, object], parameter: str) -> None:
    with pytest.raises(ParameterError, match=rf"^{parameter} = .*: must be "):
        metrics.local_porosity(np.ones((3, 4, 5), bool), **options)  # type: ignore[arg-type]
