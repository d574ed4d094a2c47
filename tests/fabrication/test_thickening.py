"""Thickening: what is thin becomes as thick as wanted, what is thick stays as it was."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from poresynth import metrics
from poresynth.errors import ParameterError
from poresynth.fabrication import thicken, weakness
from poresynth.fabrication.fields import field_of_voxels


def rod(diameter: float, axis: tuple[float, float, float], edge: int = 44) -> np.ndarray:
    """Return a rod through the middle, ends within the volume."""
    points = np.mgrid[:edge, :edge, :edge] - (edge / 2 - 0.5) + 0.17
    unit = np.array(axis) / np.linalg.norm(axis)
    along = np.tensordot(unit, points, 1)
    across = np.sqrt(np.maximum((points**2).sum(axis=0) - along**2, 0))
    return np.asarray((across < diameter / 2) & (np.abs(along) < edge / 2 - 8))


AXES = [(0, 0, 1), (1, 1, 0), (1, 2, 3), (1, 1, 1), (0.2, 0.3, 1)]


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("diameter", [2, 3, 5])
def test_rods_get_the_least_thickness(diameter: float, axis: tuple[float, float, float]) -> None:
    thin = rod(diameter, axis)
    field, made = thicken(field_of_voxels(thin), 6)
    thick = field > 0
    assert (made.weak_places_before, made.weak_places_after) == (1, 0)
    assert (made.thin_percent_before, made.thin_percent_after) == (100, 0)
    local = metrics.local_thickness(thick)[thick]
    assert local.min() >= 6
    # No thicker than a ball of the diameter swept along, its middle a voxel off at most.
    assert local.max() < 10
    assert not (thin & ~thick).any()
    assert len(metrics.component_sizes(thick)) == 1
    assert made.voxels_added == thick.sum() - thin.sum()


@pytest.mark.parametrize("walls", [1, 2, 3, 4])
def test_walls_get_the_least_thickness(walls: int) -> None:
    wall = np.zeros((30, 36, 36), bool)
    wall[13 : 13 + walls, 4:32, 4:32] = True
    field, made = thicken(field_of_voxels(wall), 8)
    thick = (field > 0)[:, 16, 16].sum()
    assert 8 <= thick <= 10
    assert made.thin_percent_after < 1


def turned_cube(half: float, edge: int = 44) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    points = np.mgrid[:edge, :edge, :edge] - (edge / 2 - 0.5)
    turned = np.tensordot(Rotation.from_euler("xyz", [0.3, 0.6, 0.9]).as_matrix(), points, 1)
    return np.asarray((np.abs(turned) < half).all(axis=0))


@pytest.mark.parametrize("minimum", [4, 6, 10, 16])
def test_edges_and_corners_of_thick_parts_stay(minimum: float) -> None:
    """They are thin by the local thickness, but no struts."""
    for body in (turned_cube(11), np.pad(np.ones((24, 22, 20), bool), 6)):
        field = field_of_voxels(body)
        after, made = thicken(field, minimum)
        assert made.thin_percent_before > 0 or minimum < 6
        assert made.weak_places_before == made.voxels_added == 0
        np.testing.assert_array_equal(after, field)


@pytest.mark.parametrize("gap", [4, 6, 10])
def test_a_bridge_between_thick_parts_is_thickened(gap: int) -> None:
    body = np.zeros((32, 32, 56), bool)
    body[4:28, 4:28, 2:22] = body[4:28, 4:28, 22 + gap : 42 + gap] = True
    body[15:17, 15:17, 22 : 22 + gap] = True
    field, made = thicken(field_of_voxels(body), 8)
    assert (made.weak_places_before, made.weak_places_after) == (1, 0)
    assert (field > 0)[:, :, 22 + gap // 2].sum() > 40
    # The far ends are what they were.
    for end in (slice(0, 14), slice(30 + gap, 56)):
        np.testing.assert_array_equal((field > 0)[:, :, end], body[:, :, end])


def test_voxels_that_are_no_cubes() -> None:
    """A wall of 2 voxels of 0.5 across z beside one of 1 voxel of 2 across x."""
    wall = np.zeros((40, 20, 20), bool)
    wall[19:21, 3:17, 3:17] = True
    field, made = thicken(field_of_voxels(wall), 4.0, voxel_size=(0.5, 1.0, 2.0), unit="mm")
    assert 4.0 <= 0.5 * (field > 0)[:, 10, 10].sum() <= 7.0
    assert made.unit == "mm"
    assert made.thin_percent_after == 0


def test_growth_stays_in_the_domain() -> None:
    thin = rod(3, (0, 0, 1))
    domain = np.zeros(thin.shape, bool)
    domain[:, :26] = True
    field, made = thicken(field_of_voxels(thin), 8, domain=domain)
    grown = (field > 0) & ~thin
    assert grown.any()
    assert not (grown & ~domain).any()
    assert grown[:, 25].any()
    assert made.weak_places_before == 1


def test_a_strut_that_the_domain_cuts_lengthwise_is_not_weak() -> None:
    solid = rod(12, (0, 0, 1))
    domain = np.zeros(solid.shape, bool)
    domain[:, :18] = True
    solid &= domain
    assert weakness(solid, 8).places > 0
    assert weakness(solid, 8, domain=domain).places == 0


@settings(max_examples=10)
@given(st.integers(0, 10_000), st.sampled_from([3.0, 4.5, 6.0]))
def test_it_only_adds_and_never_parts(seed: int, minimum: float) -> None:
    from scipy import ndimage

    noise = np.random.default_rng(seed).standard_normal((24, 24, 24))
    solid = ndimage.gaussian_filter(noise, 1.5) > 0.05
    field, made = thicken(field_of_voxels(solid), minimum)
    thick = field > 0
    assert not (solid & ~thick).any()
    assert len(metrics.component_sizes(thick)) <= len(metrics.component_sizes(solid))
    assert made.weak_places_after <= made.weak_places_before
    assert made.thin_percent_after <= made.thin_percent_before


def test_threads_change_nothing() -> None:
    solid = rod(3, (1, 2, 3))
    one, two = (thicken(field_of_voxels(solid), 6, threads=n)[0] for n in (1, 2))
    np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize("fill", [False, True])
def test_empty_and_full_volumes(fill: bool) -> None:
    solid = np.full((6, 6, 6), fill)
    field, made = thicken(field_of_voxels(solid), 4)
    np.testing.assert_array_equal(field > 0, solid)
    assert made.weak_places_before == made.weak_places_after == 0
    assert not weakness(solid, 4).middles.any()


def test_a_real_bone(data_dir: object) -> None:
    from pathlib import Path

    from poresynth import binarize, read

    assert isinstance(data_dir, Path)
    gray = read(data_dir / "trabecular_bone_gray_100.tif").array[:60, :60, :60]
    solid = metrics.largest_part(binarize(gray))
    field, made = thicken(field_of_voxels(solid), 6)
    assert (made.weak_places_before, made.weak_places_after) == (1, 0)
    assert made.thin_percent_before > 50
    assert made.thin_percent_after < 1
    assert len(metrics.component_sizes(field > 0)) == 1


@pytest.mark.parametrize("minimum", [0, 1.5, np.nan, np.inf])
def test_less_than_two_voxels_is_refused(minimum: float) -> None:
    with pytest.raises(ParameterError, match="min_thickness"):
        thicken(np.ones((4, 4, 4), np.float32), minimum)


def test_it_can_be_stopped() -> None:
    def stop(stage: str, share: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        thicken(field_of_voxels(rod(3, (0, 0, 1))), 6, progress=stop)
