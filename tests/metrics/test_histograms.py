"""Histograms, moments and histogram matching against NumPy, scikit-image and sorting."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from skimage.exposure import match_histograms
from tests.metrics.strategies import ORDERS, TYPES

from poresynth import metrics
from poresynth.errors import ParameterError
from poresynth.volume import Volume

SHAPES = hnp.array_shapes(min_dims=3, max_dims=3, min_side=1, max_side=5)
MORE_TYPES = [*TYPES, "int8", "uint32", "int32", "uint64", "float16", ">u2", ">f4", "longdouble"]


def volumes(dtype: str) -> st.SearchStrategy[np.ndarray]:
    """Volumes of few values, so that there are ties."""
    elements = st.integers(0, 1) if dtype == "bool" else st.integers(-4, 4)
    return hnp.arrays("int64", SHAPES, elements=elements).map(
        lambda a: (a + (4 if np.dtype(dtype).kind == "u" else 0)).astype(dtype)
    )


grays = st.sampled_from(MORE_TYPES).flatmap(volumes)


def twin(source: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Give each value the reference's value in the middle of its ranks."""
    ranked, wanted = np.sort(source, axis=None), np.sort(reference, axis=None)
    middle = np.searchsorted(ranked, source) + np.searchsorted(ranked, source, side="right")
    return wanted[middle * wanted.size // (2 * source.size)]


@given(grays, grays, st.sampled_from(list(ORDERS)))
def test_matching_is_by_rank(source: np.ndarray, reference: np.ndarray, order: str) -> None:
    found = metrics.match_histogram(ORDERS[order](source), ORDERS[order](reference))
    np.testing.assert_array_equal(found, twin(source, reference))
    assert found.dtype == reference.dtype.newbyteorder("=")


@given(grays, st.randoms(), st.integers(0, 99), st.sampled_from(list(ORDERS)))
def test_ties_dealt_at_random_reproduce_the_distribution(
    source: np.ndarray, shuffle: object, seed: int, order: str
) -> None:
    reference = np.arange(source.size, dtype="float32").reshape(source.shape) ** 2
    found = metrics.match_histogram(ORDERS[order](source), reference, ties="random", seed=seed)
    np.testing.assert_array_equal(np.sort(found, axis=None), reference.ravel())
    by_source = found.ravel()[np.argsort(source, axis=None, kind="stable")]
    levels = np.sort(source, axis=None)
    for level in np.unique(levels)[:-1]:
        assert by_source[levels <= level].max() < by_source[levels > level].min()
    again = metrics.match_histogram(source, reference, ties="random", seed=seed, threads=3)
    np.testing.assert_array_equal(again, found)


@pytest.mark.parametrize("dtype", ["float32", "float64", "int32", "uint16"])
def test_volumes_without_ties_exchange_their_values(dtype: str, rng: np.random.Generator) -> None:
    source = rng.permutation(60_000).reshape(30, 40, 50).astype(dtype)
    reference = (rng.permutation(60_000) + 5000).reshape(40, 50, 30).astype(dtype)
    found = metrics.match_histogram(source, reference)
    np.testing.assert_array_equal(np.sort(found, axis=None), np.sort(reference, axis=None))
    np.testing.assert_array_equal(np.argsort(found, axis=None), np.argsort(source, axis=None))


def test_scikit_image_differs_by_less_than_the_gap_between_neighbouring_values(
    rng: np.random.Generator,
) -> None:
    # scikit-image interpolates between the reference's values, so that it invents some.
    source, reference = rng.random((20, 20, 20)), rng.random((10, 20, 30)) ** 2
    theirs = match_histograms(source, reference)
    ours = metrics.match_histogram(source, reference)
    gap = np.diff(np.sort(reference, axis=None)).max()
    assert np.abs(theirs - ours).max() <= 2 * gap
    assert np.isin(ours, reference).all()
    assert not np.isin(theirs, reference).all()


def test_bits_with_a_sign_zeros_and_large_values() -> None:
    source = np.array([-0.0, 0.0, -1e300, 1e300, -1e-310, 5.0]).reshape(1, 2, 3)
    reference = np.array([2**63, 1, 2**64 - 1, 0, 7, 9], dtype="uint64").reshape(1, 2, 3)
    found = metrics.match_histogram(source, reference).ravel()
    assert found.tolist() == [9, 9, 0, 2**64 - 1, 1, 2**63]


def test_many_voxels_and_threads(rng: np.random.Generator) -> None:
    source = rng.normal(size=(70, 80, 90)).astype("float32")
    source[:30] = 0  # a bucket that is all ties
    reference = rng.gamma(2, size=(60, 50, 40)).astype("float32")
    expected = twin(source, reference)
    for threads in (1, 2, 8):
        found = metrics.match_histogram(source, reference, threads=threads)
        np.testing.assert_array_equal(found, expected)


def test_channels_are_matched_one_by_one(rng: np.random.Generator) -> None:
    source, reference = rng.integers(0, 255, (2, 4, 5, 6, 3)).astype("uint8")
    found = metrics.match_histogram(Volume(source), Volume(reference))
    for c in range(3):
        np.testing.assert_array_equal(found[..., c], twin(source[..., c], reference[..., c]))
    with pytest.raises(ParameterError, match=r"^reference.channels = 1: must be "):
        metrics.match_histogram(source, reference[..., 0])


@given(grays, st.one_of(st.none(), st.integers(1, 30)), st.sampled_from(list(ORDERS)))
def test_histograms_are_those_of_numpy(gray: np.ndarray, bins: int | None, order: str) -> None:
    found = metrics.intensity_histogram(ORDERS[order](gray), bins)
    values = gray.astype(float).ravel()
    counts, edges = np.histogram(
        values, found.edges if bins is None else bins, (values.min(), values.max())
    )
    np.testing.assert_array_equal(found.counts, [counts])
    np.testing.assert_array_equal(found.edges, edges)
    assert (found.density * np.diff(edges)).sum() == pytest.approx(1)
    if bins is None and gray.dtype.kind in "bui" and gray.dtype.itemsize <= 2:
        levels = np.arange(int(gray.min()), int(gray.max()) + 1)
        np.testing.assert_array_equal(found.centres, levels)


def test_histograms_of_a_range_and_of_channels(rng: np.random.Generator) -> None:
    gray = rng.normal(100, 30, (5, 6, 7, 2)).clip(0, 255)
    for dtype in ("uint8", "int16", "float32"):
        values = gray.astype(dtype)
        found = metrics.intensity_histogram(values, value_range=(90, 110.5))
        for c in range(2):
            expected = np.histogram(values[..., c].astype(float), found.edges)[0]
            np.testing.assert_array_equal(found.counts[c], expected)
    outside = metrics.intensity_histogram(gray.astype("uint8"), value_range=(-3, 300))
    assert outside.counts.shape == (2, 304)
    assert outside.counts.sum() == gray.size


@given(grays, st.sampled_from(list(ORDERS)))
def test_moments_are_those_of_numpy(gray: np.ndarray, order: str) -> None:
    found = metrics.channel_statistics(ORDERS[order](gray))
    values = gray.astype(float)
    assert found.mean == pytest.approx(values.mean(), abs=1e-12)
    assert found.standard_deviation == pytest.approx(values.std(), abs=1e-12)
    assert [found.minimum[0], found.maximum[0]] == [values.min(), values.max()]


def test_moments_far_from_zero_and_of_channels(rng: np.random.Generator) -> None:
    gray = (1e6 + rng.random((30, 40, 50, 2))).astype("float64")
    found = metrics.channel_statistics(gray)
    # NumPy's own sum over the first axes loses two digits.
    exact = [math.fsum(gray[..., c].ravel()) / gray[..., c].size for c in range(2)]
    np.testing.assert_allclose(found.mean, exact, rtol=1e-15)
    np.testing.assert_allclose(found.standard_deviation, gray.std(axis=(0, 1, 2)), rtol=1e-9)
    for threads in (1, 2, 8):
        again = metrics.channel_statistics(gray, threads=threads)
        np.testing.assert_array_equal(again.mean, found.mean)


@pytest.mark.parametrize(
    "bad", [np.zeros((0, 3, 3)), np.zeros((3, 3)), np.full((3, 3, 3), np.nan), np.zeros((2,) * 5)]
)
def test_what_is_no_volume_is_refused(bad: np.ndarray) -> None:
    good = np.zeros((3, 3, 3))
    for function in (metrics.channel_statistics, metrics.intensity_histogram):
        with pytest.raises(ParameterError, match=r"^volume = .*: must "):
            function(bad)
    with pytest.raises(ParameterError, match=r"^source = .*: must "):
        metrics.match_histogram(bad, good)
    with pytest.raises(ParameterError, match=r"^reference = .*: must "):
        metrics.match_histogram(good, bad)


@pytest.mark.parametrize(
    ("options", "parameter"),
    [
        ({"bins": 0}, "bins"),
        ({"bins": 2.5}, "bins"),
        ({"value_range": (2, 2)}, "value_range"),
        ({"value_range": (0, np.inf)}, "value_range"),
        ({"value_range": (0.2, 0.4)}, "value_range"),
    ],
)
def test_bad_parameters_of_a_histogram(options: dict[str, object], parameter: str) -> None:
    with pytest.raises(ParameterError, match=rf"^{parameter} = .*: must "):
        metrics.intensity_histogram(np.ones((3, 3, 3), "uint8"), **options)  # type: ignore[arg-type]


def test_bad_parameters_of_a_match() -> None:
    good = np.zeros((3, 3, 3))
    for options in ({"ties": "equal"}, {"seed": -1}):
        with pytest.raises(ParameterError, match=rf"^{next(iter(options))} = .*: must be "):
            metrics.match_histogram(good, good, **options)
