"""Guidance factors, Eq. 6 among them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.references import periodic_field as twin

from poresynth import _core
from poresynth.engines.periodic_field.guidance import (
    Factors,
    Guide,
    density,
    implicit_plane,
    mean_distance,
)
from poresynth.engines.phases import Phases
from poresynth.errors import ParameterError
from poresynth.exemplars import spinodal
from poresynth.volume import Volume


def phases_of(array: np.ndarray) -> Phases:
    return Phases.of(Volume(array), "auto", None, "bright")


@pytest.mark.parametrize(("shape", "edge"), [((1, 9, 12), 4), ((7, 6, 8), 3), ((5, 5, 5), 5)])
def test_the_mean_distance_is_equation_6_of_the_patch_around_a_voxel(
    shape: tuple[int, int, int], edge: int
) -> None:
    distance = np.random.default_rng(1).normal(size=shape)
    expected = twin.mean_distance(distance, edge)
    np.testing.assert_allclose(mean_distance(distance, edge), expected, rtol=1e-5)


def test_the_density_is_high_where_walls_are_near() -> None:
    solid = np.zeros((1, 64, 64), bool)
    solid[:, :32, ::3] = True
    solid[:, 32:, ::16] = True
    found = density(solid, 8)
    assert found[0, 8:24].min() > found[0, 40:56, :56].max()
    distance = _core.signed_distance(solid, 8, boundary="open")
    np.testing.assert_allclose(found, -twin.mean_distance(distance, 8), rtol=1e-5)


def test_a_line_has_the_papers_coordinates() -> None:
    # Pixel (p_x, p_y) of a w × h image is at (2 p_x / w − 1, 2 p_y / h − 1).
    lines = [2 * np.arange(n) / n - 1 for n in (4, 8)]
    g = implicit_plane(lines, (3.0, 5.0, 0.5))
    for y, x in np.ndindex(4, 8):
        assert g[y, x] == pytest.approx(3 * (2 * x / 8 - 1) + 5 * (2 * y / 4 - 1) + 0.5)
    plane = implicit_plane([np.array([-1.0, 0.0])] * 3, (1.0, 2.0, 4.0, 0.0))
    assert plane[0, 1, 1] == -4  # z
    assert plane[1, 0, 1] == -2  # y
    assert plane[1, 1, 0] == -1  # x


@pytest.mark.parametrize("direction", [(), (1.0, 2.0), (0.0, 0.0, 1.0), (1.0, np.nan, 0.0)])
def test_a_line_that_is_none_is_refused(direction: tuple[float, ...]) -> None:
    with pytest.raises(ParameterError, match="direction"):
        implicit_plane([np.arange(3.0)] * 2, direction)


@given(st.tuples(*[st.integers(1, 4)] * 3), st.tuples(*[st.integers(1, 9)] * 3), st.integers(0, 99))
def test_a_guide_is_linear_between_the_points_of_its_map(
    points: tuple[int, int, int], shape: tuple[int, int, int], seed: int
) -> None:
    values = np.random.default_rng(seed).random(points).astype(np.float32)
    found = Guide(values, shape).at([np.arange(-1, n + 1) for n in shape])
    for index in np.ndindex(*found.shape):
        expected = 0.0
        place = [
            np.clip((i - 1) / max(n - 1, 1), 0, 1) * (m - 1)
            for i, n, m in zip(index, shape, points, strict=True)
        ]
        low = [min(int(p), max(m - 2, 0)) for p, m in zip(place, points, strict=True)]
        for corner in np.ndindex(2, 2, 2):
            node = [min(a + c, m - 1) for a, c, m in zip(low, corner, points, strict=True)]
            weight = np.prod(
                [(p - a) if c else 1 - (p - a) for p, a, c in zip(place, low, corner, strict=True)]
            )
            expected += weight * values[tuple(node)]
        assert found[index] == pytest.approx(expected, abs=1e-5)


def factors(kind: str, array: np.ndarray, given: Any = None, direction: Any = None) -> Any:
    found = Factors.of(kind, direction, phases_of(array), 16, given)
    assert found is not None
    return found


def test_a_density_is_the_share_of_patches_that_are_less_dense() -> None:
    solid = spinodal((40, 40, 40)).array > 125
    found, own = factors("density", solid)
    assert (found.low, found.high, found.mean) == (0, 1, 0.5)
    # The middles of the 25³ patches of 16³ that lie inside.
    inside = (slice(8, 33),) * 3
    plain = density(solid, 16)
    order = np.argsort(plain[inside], axis=None)
    ranks = own[inside].ravel()[order]
    np.testing.assert_allclose(ranks, (np.arange(25**3) + 0.5) / 25**3, atol=1e-3)
    # Elsewhere they are compared with these.
    assert (np.diff(own.ravel()[np.argsort(plain, axis=None)]) >= 0).all()
    assert found.guide(0.25, (10, 10, 10)).map.ravel().tolist() == [0.25]
    assert found.guide(None, (10, 10, 10)).map.ravel().tolist() == [0.5]


def test_guidance_is_a_number_a_pair_or_a_map() -> None:
    image = np.random.default_rng(2).random((1, 20, 30)) > 0.5
    own = np.linspace(100, 300, 600).reshape(20, 30)
    found, scaled = factors("map", image, own)
    assert scaled.shape == (1, 20, 30)
    line = found.guide((100.0, 300.0), (1, 4, 5)).at([np.arange(n) for n in (1, 4, 5)])
    np.testing.assert_allclose(line[0], np.tile(np.linspace(0, 1, 5), (4, 1)), atol=1e-6)
    whole = found.guide(own, (1, 20, 30)).at([np.arange(n) for n in (1, 20, 30)])
    np.testing.assert_allclose(whole, scaled, atol=1e-5)
    for wrong in (np.zeros((2, 2, 2, 2)), np.zeros(3), float("nan"), np.zeros((0, 4))):
        with pytest.raises(ParameterError, match="guidance"):
            found.guide(wrong, (1, 4, 5))


def test_a_direction_spans_the_output_as_it_spans_the_exemplar() -> None:
    image = np.random.default_rng(2).random((1, 20, 30)) > 0.5
    found, scaled = factors("direction", image, direction=(1.0, 0.0, 0.0))
    np.testing.assert_allclose(scaled[0, 0], np.linspace(0, 1, 30), atol=1e-6)
    larger = found.guide(None, (1, 40, 60)).at([np.arange(n) for n in (1, 40, 60)])
    assert larger[0, 0, 0] == pytest.approx(0, abs=1e-6)
    assert larger[0, 0, 30] == pytest.approx(scaled[0, 0, 15], abs=1e-6)
    np.testing.assert_allclose(larger[0], np.tile(larger[0, :1], (40, 1)), atol=1e-6)


@pytest.mark.parametrize(
    ("kind", "given", "match"),
    [
        ("map", None, "must be given with"),
        ("density", np.zeros((4, 4)), "must be given with"),
        ("map", np.zeros((3, 3)), "shape"),
        ("map", np.zeros((20, 30)), "not the same everywhere"),
        ("map", np.full((20, 30), np.nan), "finite"),
    ],
)
def test_a_map_that_does_not_fit_is_refused(kind: str, given: Any, match: str) -> None:
    image = np.random.default_rng(2).random((1, 20, 30)) > 0.5
    with pytest.raises(ParameterError, match=match):
        Factors.of(kind, None, phases_of(image), 8, given)


def test_labels_have_no_density() -> None:
    labels = np.random.default_rng(2).integers(0, 3, (1, 20, 30))
    with pytest.raises(ParameterError, match="more than two phases"):
        Factors.of("density", None, phases_of(labels), 8, None)


def test_without_guidance_there_are_no_factors() -> None:
    image = np.random.default_rng(2).random((1, 20, 30)) > 0.5
    assert Factors.of("none", None, phases_of(image), 8, None) is None
