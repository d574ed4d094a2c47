"""Fields of solids: on the side of every voxel, the surface where gray meets the threshold."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from poresynth import metrics
from poresynth.fabrication.fields import FIRM, field_of_gray, field_of_voxels
from poresynth.meshes import check, isosurface
from poresynth.metrics.structure import Structure
from poresynth.volume import Volume

solids = hnp.arrays(bool, hnp.array_shapes(min_dims=3, max_dims=3, min_side=1, max_side=7))


@given(solids)
def test_every_voxel_stays_on_its_side(solid: np.ndarray) -> None:
    field = field_of_voxels(solid)
    assert field.dtype == np.float32
    np.testing.assert_array_equal(field > 0, solid)
    assert (np.abs(field) >= np.float32(FIRM)).all()


@given(solids)
def test_the_surface_has_the_parts_of_the_voxels(solid: np.ndarray) -> None:
    parts = len(metrics.component_sizes(solid, connectivity=18)) if solid.any() else 0
    outside = np.pad(~solid, 1, constant_values=True)
    pores = len(metrics.component_sizes(outside, connectivity=6))
    report = check(isosurface(field_of_voxels(solid)))
    assert report.shells == parts + pores - 1
    assert report.printable or not solid.any()


def test_a_flat_surface_stays_where_it_is() -> None:
    solid = np.zeros((12, 6, 6), bool)
    solid[:5] = True
    assert check(isosurface(field_of_voxels(solid))).volume == pytest.approx(5 * 36)


@pytest.mark.parametrize("radius", [6.2, 12.7])
def test_a_ball_of_voxels_is_smooth(radius: float) -> None:
    points = np.mgrid[:32, :32, :32] - np.array([15.5, 15.7, 15.3])[:, None, None, None]
    ball = np.sqrt((points**2).sum(axis=0)) < radius
    plain, smooth = (check(isosurface(f)) for f in (ball - 0.5, field_of_voxels(ball)))
    area = 4 * np.pi * radius**2
    assert plain.area > 1.05 * area
    assert smooth.area == pytest.approx(area, rel=0.03)
    assert smooth.volume == pytest.approx(ball.sum(), rel=0.05)


@given(
    hnp.arrays(np.uint8, (4, 5, 6), elements=st.integers(90, 110)),
    st.sampled_from(["bright", "dark"]),
)
def test_gray_is_cut_at_the_threshold(gray: np.ndarray, solid: str) -> None:
    gray[0, 0, :3] = 0, 100, 255
    structure = Structure.of(Volume(gray), 100, solid)  # type: ignore[arg-type]
    np.testing.assert_array_equal(field_of_gray(gray, structure) > 0, structure.cut(gray))


@pytest.mark.parametrize("solid", ["bright", "dark"])
def test_gray_places_the_surface_between_voxels(solid: str) -> None:
    gray = np.tile(np.array([0, 0, 60, 160, 200, 200], np.uint8)[:, None, None], (1, 4, 4))
    structure = Structure.of(Volume(gray), 100.0, solid)  # type: ignore[arg-type]
    found = check(isosurface(field_of_gray(gray, structure))).volume / 16
    at = 2.5 + 40 / 100
    assert found == pytest.approx(6 - at if solid == "bright" else at)
