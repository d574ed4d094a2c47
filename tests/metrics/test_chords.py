"""Lineal path and chord lengths against counting, and against known values."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.metrics.media import overlapping_spheres
from tests.metrics.strategies import ORDERS, TYPES, boundaries, phases
from tests.references import chords as twin

from poresynth import metrics
from poresynth.errors import ParameterError
from poresynth.volume import Volume

AXES = ["z", "y", "x"]


@settings(max_examples=60)
@given(phases, boundaries, st.sampled_from(list(ORDERS)), st.sampled_from(["exclude", "include"]))
def test_chords_are_those_of_the_twin(
    solid: np.ndarray, boundary: str, order: str, border: str
) -> None:
    found = metrics.chord_lengths(ORDERS[order](solid), boundary=boundary, border=border)
    for axis, name in enumerate(AXES):
        inside, cut = twin.chords(solid, axis, boundary)
        chords: metrics.ChordDistribution = getattr(found, name)
        n = solid.shape[axis]
        expected = inside + (cut if border == "include" else [])
        np.testing.assert_array_equal(chords.counts, np.bincount(expected, minlength=n + 1)[1:])
        np.testing.assert_array_equal(chords.cut, np.bincount(cut, minlength=n + 1)[1:])
        assert chords.number == len(expected)
        if expected:
            assert chords.mean == pytest.approx(np.mean(expected))
            assert chords.standard_deviation == pytest.approx(np.std(expected), abs=1e-12)
            assert chords.density.sum() == pytest.approx(1)
        else:
            assert np.isnan(chords.mean)
            assert np.isnan(chords.density).all()


@settings(max_examples=60)
@given(phases, boundaries, st.sampled_from(list(ORDERS)), st.integers(0, 10))
def test_lineal_paths_are_those_of_the_twin(
    solid: np.ndarray, boundary: str, order: str, r_max: int
) -> None:
    found = metrics.lineal_path(ORDERS[order](solid), r_max, boundary=boundary)
    expected = [twin.lineal_path(solid, axis, r_max, boundary) for axis in range(3)]
    for name, curve in zip(AXES, expected, strict=True):
        np.testing.assert_allclose(getattr(found, name), curve, rtol=1e-12)
    np.testing.assert_allclose(found.mean, np.mean(expected, axis=0), rtol=1e-12)


@given(phases, boundaries)
def test_chords_fill_the_phase(solid: np.ndarray, boundary: str) -> None:
    for border in ("exclude", "include"):
        found = metrics.chord_lengths(solid, border=border, boundary=boundary)
        for name in AXES:
            axis = getattr(found, name)
            total = axis.counts + (axis.cut if border == "exclude" else 0)
            assert total @ axis.lengths == np.count_nonzero(solid)


@given(phases)
def test_a_turn_turns_the_axes_and_a_mirror_changes_nothing(solid: np.ndarray) -> None:
    before, mirrored = (metrics.chord_lengths(s) for s in (solid, solid[::-1, :, ::-1]))
    turned = metrics.chord_lengths(np.rot90(solid, axes=(0, 2)))
    for name, other in zip(AXES, "xyz", strict=True):
        counts = getattr(before, name).counts
        np.testing.assert_array_equal(counts, getattr(mirrored, name).counts)
        np.testing.assert_array_equal(counts, getattr(turned, other).counts)


@given(phases)
def test_padding_with_void_cuts_no_chord(solid: np.ndarray) -> None:
    included = metrics.chord_lengths(solid, border="include")
    padded = metrics.chord_lengths(np.pad(solid, 1))
    for name in AXES:
        np.testing.assert_array_equal(
            getattr(included, name).counts, getattr(padded, name).counts[:-2]
        )


def test_threads_do_not_matter(rng: np.random.Generator) -> None:
    solid = rng.random((20, 21, 130)) < 0.6
    one, *others = (metrics.chord_lengths(solid, threads=n) for n in (1, 2, 8))
    for other in others:
        for name in AXES:
            np.testing.assert_array_equal(getattr(one, name).counts, getattr(other, name).counts)


@pytest.mark.parametrize("dtype", [t for t in TYPES if "float" not in t])
def test_every_type_and_the_size_of_a_voxel(dtype: str, rng: np.random.Generator) -> None:
    solid = rng.random((5, 6, 70)) < 0.4
    expected = metrics.chord_lengths(solid)
    volume = Volume((solid * 100).astype(dtype), (2.0, 1.0, 0.5), "mm")
    found = metrics.chord_lengths(volume)
    assert found.unit == "mm"
    for name, edge in zip(AXES, (2, 1, 0.5), strict=True):
        assert getattr(found, name).mean == pytest.approx(edge * getattr(expected, name).mean)
    path = metrics.lineal_path(volume, 4)
    plain = metrics.lineal_path(solid, 4)
    np.testing.assert_array_equal(path.z, plain.z)
    # At 0.5 mm along y the path is halfway between 0 and 1 voxel.
    expected_at = (0.75 * plain.z[0] + 0.25 * plain.z[1], plain.y[:2].mean(), plain.x[1])
    assert path.mean[1] == pytest.approx(np.mean(expected_at))
    np.testing.assert_allclose(path.distance, 0.5 * np.arange(5))


def test_labels_are_named_by_their_value(rng: np.random.Generator) -> None:
    labels = rng.integers(0, 3, (6, 7, 8))
    found = metrics.lineal_path(labels, 3, phase=0)
    np.testing.assert_array_equal(found.x, metrics.lineal_path(labels == 0, 3).x)


def test_no_voxel_and_all_voxels() -> None:
    empty, full = np.zeros((3, 4, 5), bool), np.ones((3, 4, 5), bool)
    for boundary in ("open", "periodic"):
        assert not metrics.lineal_path(empty, boundary=boundary).mean.any()
        found = metrics.lineal_path(full, 4, boundary=boundary)
        np.testing.assert_array_equal(found.x, 1)
        np.testing.assert_array_equal(np.isnan(found.z), [False] * 3 + [True] * 2)
        assert np.isnan(metrics.chord_lengths(full, boundary=boundary).mean)
        lines = metrics.chord_lengths(full, border="include", boundary=boundary)
        assert [lines.z.mean, lines.y.mean, lines.x.mean] == [3, 4, 5]
    assert metrics.lineal_path(np.ones((1, 1, 1), bool)).mean.tolist() == [1]


def test_random_voxels_have_paths_of_a_geometric_series(rng: np.random.Generator) -> None:
    solid = rng.random((64, 64, 64)) < 0.6
    found = metrics.lineal_path(solid, 8, boundary="periodic")
    np.testing.assert_allclose(found.mean, 0.6 ** np.arange(1, 10), rtol=0.05)
    assert metrics.chord_lengths(solid, boundary="periodic").mean == pytest.approx(
        1 / 0.4, rel=0.02
    )


def test_overlapping_spheres_follow_the_exact_law(rng: np.random.Generator) -> None:
    # Void of overlapping spheres: L(z) = φ^(1 + 3 z / 4 R).
    radius = 8.0
    void = overlapping_spheres(128, radius, 450, rng)
    found = metrics.lineal_path(void, 40, boundary="periodic")
    exponent = 1 + 3 * found.r / (4 * radius)
    np.testing.assert_allclose(found.mean, void.mean() ** exponent, atol=0.015)


@given(phases, boundaries)
def test_a_path_is_at_most_a_pair_of_ends(solid: np.ndarray, boundary: str) -> None:
    r = min(solid.shape) // 2
    path = metrics.lineal_path(solid, r, boundary=boundary)
    pair = metrics.two_point_correlation(solid, r, boundary=boundary)
    for name in AXES:
        ours, theirs = getattr(path, name), getattr(pair, name)
        both = np.isfinite(theirs)
        assert (ours[both] <= theirs[both] + 1e-12).all()
        np.testing.assert_allclose(ours[both][:2], theirs[both][:2], atol=1e-12)


@pytest.mark.parametrize(
    ("call", "parameter"),
    [
        (lambda s: metrics.lineal_path(s, -1), "r_max"),
        (lambda s: metrics.lineal_path(s, 1.5), "r_max"),
        (lambda s: metrics.lineal_path(s, boundary="mirror"), "boundary"),
        (lambda s: metrics.chord_lengths(s, border="cut"), "border"),
        (lambda s: metrics.chord_lengths(s, voxel_size=0), "voxel_size"),
        (lambda s: metrics.chord_lengths(s[0]), "solid"),
    ],
)
def test_bad_parameters_are_named(call: object, parameter: str) -> None:
    with pytest.raises(ParameterError, match=rf"^{parameter} = .*: must be "):
        call(np.ones((3, 4, 5), bool))  # type: ignore[operator]
