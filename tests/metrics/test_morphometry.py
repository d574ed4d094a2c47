"""Bone morphometry of plates and of nothing."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from tests.metrics.shapes import plates

from poresynth import metrics
from poresynth.errors import ParameterError
from poresynth.volume import Volume


def test_plates_along_an_axis_are_exact_by_their_faces() -> None:
    solid = np.zeros((24, 10, 12), bool)
    solid.reshape(3, 8, 10, 12)[:, :3] = True
    bone = Volume(solid, (0.5, 1.0, 2.0), "mm")
    found = metrics.morphometry(bone, method="faces", boundary="periodic")
    t, p = 1.5, 4.0
    assert found.unit == "mm"
    assert (found.tv, found.bv) == (24 * 10 * 12, 9 * 10 * 12)
    assert found.bs == pytest.approx(6 * 10 * 24)
    assert found.bv_tv == pytest.approx(t / p)
    assert found.bs_bv == pytest.approx(2 / t)
    assert found.bs_tv == pytest.approx(2 / p)
    assert found.tb_th_plate == pytest.approx(t)
    assert found.tb_n_plate == pytest.approx(1 / p)
    assert found.tb_sp_plate == pytest.approx(p - t)
    assert found.tb_th is found.tb_sp is found.tb_n is None


@pytest.mark.parametrize("normal", [(1, 2, 3), (1, 0.3, -0.2), (-2, 5, 1.1)])
def test_tilted_plates(normal: tuple[float, float, float]) -> None:
    t, p = 5.0, 12.0
    found = metrics.morphometry(plates(96, t, p, normal))
    assert found.bv_tv == pytest.approx(t / p, rel=0.01)
    # One orientation is the worst case of 13 directions; they are right on average over all.
    assert found.bs_bv == pytest.approx(2 / t, rel=0.06)
    assert found.tb_th_plate == pytest.approx(t, rel=0.06)
    assert found.tb_n_plate == pytest.approx(1 / p, rel=0.06)
    assert found.tb_sp_plate == pytest.approx(p - t, rel=0.06)


def test_the_ratios_hang_together(rng: np.random.Generator) -> None:
    solid = rng.random((20, 21, 22)) < 0.3
    for method in ("crofton", "marching_cubes", "faces"):
        found = metrics.morphometry(solid, voxel_size=0.2, method=method)
        assert found.bs_bv == pytest.approx(found.bs / found.bv)
        assert found.bv_tv == pytest.approx(found.bv / found.tv)
        assert found.tb_th_plate == pytest.approx(2 / found.bs_bv)
        assert found.tb_n_plate == pytest.approx(found.bv_tv / found.tb_th_plate)
        assert found.tb_sp_plate == pytest.approx(1 / found.tb_n_plate - found.tb_th_plate)
        surface = metrics.surface_area(solid, voxel_size=0.2, method=method)
        assert found.bs_tv == surface.specific_surface


def test_the_direct_number_is_of_ridges() -> None:
    solid = plates(16, 4, 8, (1, 0, 0))
    found = metrics.morphometry(solid, thickness=0.2, separation=0.3, voxel_size=0.1)
    assert (found.tb_th, found.tb_sp) == (0.2, 0.3)
    assert found.tb_n == pytest.approx(2)
    assert metrics.morphometry(solid, thickness=0.2).tb_n is None
    assert metrics.morphometry(solid, thickness=0, separation=0).tb_n == math.inf


def test_a_phase_of_labels(rng: np.random.Generator) -> None:
    labels = rng.integers(0, 3, (6, 7, 8), np.uint8)
    found = metrics.morphometry(labels, phase=2)
    assert found == metrics.morphometry(labels == 2)
    assert dataclasses.asdict(found)["bv_tv"] == pytest.approx((labels == 2).mean())


def test_no_bone_and_nothing_else() -> None:
    empty, full = (metrics.morphometry(np.full((4, 5, 6), fill)) for fill in (False, True))
    assert empty.bv_tv == empty.bs_tv == empty.tb_n_plate == 0
    assert math.isnan(empty.bs_bv)
    assert math.isnan(empty.tb_th_plate)
    assert empty.tb_sp_plate == math.inf
    assert full.bv_tv == 1
    assert full.bs_bv == full.tb_n_plate == 0
    assert full.tb_th_plate == math.inf
    assert math.isnan(full.tb_sp_plate)


def test_one_voxel_has_no_surface_to_speak_of() -> None:
    found = metrics.morphometry(np.ones((1, 1, 1), bool))
    assert found.bv_tv == 1
    assert math.isnan(found.bs_bv)
    assert math.isnan(found.tb_th_plate)


@pytest.mark.parametrize("name", ["thickness", "separation"])
@pytest.mark.parametrize("value", [-1.0, math.nan, math.inf])
def test_bad_lengths_are_named(name: str, value: float) -> None:
    with pytest.raises(ParameterError, match=rf"^{name} = .*: must be "):
        metrics.morphometry(np.ones((2, 2, 2), bool), **{name: value})
