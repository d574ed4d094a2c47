"""Volumes made brick by brick."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import ndimage

from poresynth import exemplars, io
from poresynth.engines import bricks
from poresynth.engines.base import SynthesizedVolume
from poresynth.engines.request import Request
from poresynth.engines.volume_texture import VolumeTexture
from poresynth.errors import FileError, ParameterError

SHAPE = (70, 50, 60)


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bricks that take no time."""
    monkeypatch.setattr(bricks, "EDGE", 30)
    monkeypatch.setattr(bricks, "MARGIN", 12)


class Counter:
    """Stands in for an engine: says in each voxel which call made it."""

    def __init__(self) -> None:
        self.calls: list[dict[str, Any]] = []

    def sample(self, shape: tuple[int, int, int], **given: Any) -> SynthesizedVolume:
        self.calls.append({"shape": shape, **given})
        number = np.full(shape, len(self.calls), np.int32)
        if "known" in given:
            kept = given["known_mask"]
            number[kept] = given["known"][kept]
            assert (given["known"][kept] > 0).all()
            assert not (kept & ~given["mask"]).any()
        number[~given["mask"]] = -1
        facts = {"seam": {"steps": 2.0, "phase_changes": None}, "copying": {"share": 0.5}}
        return SynthesizedVolume(number, metadata={"poresynth": facts})


def lay(domain: np.ndarray | None, least: int = 8) -> tuple[np.ndarray, Counter, dict[str, Any]]:
    wall, engine = np.zeros(SHAPE, np.int32), Counter()
    facts = bricks.lay(
        wall, SHAPE, engine.sample, least=least, seed=1, domain=domain, outside=-1, progress=None
    )
    return wall, engine, facts


@pytest.mark.parametrize("least", [8, 20])
def test_every_voxel_is_made_once_by_its_brick(small: None, least: int) -> None:
    wall, engine, facts = lay(None, least)
    assert facts["count"] == len(engine.calls) == 3 * 2 * 2
    assert facts["margin"] == max(12, least)
    assert facts["seam"] == {"steps": 2.0}
    assert facts["copying"] == {"share": 0.5}
    assert (wall > 0).all()
    # A brick's voxels are its cell's, and all of them.
    sizes = np.bincount(wall.ravel())[1:]
    assert len(sizes) == 12
    assert sizes.min() > 20**3
    for number in range(1, 13):
        at = np.argwhere(wall == number)
        assert np.prod(at.max(0) - at.min(0) + 1) == len(at)
    assert all(min(call["shape"]) >= least for call in engine.calls)
    seeds = [call["seed"] for call in engine.calls]
    assert len(set(seeds)) == len(seeds)


def test_a_brick_sees_what_was_made_before_it(small: None) -> None:
    wall, engine, _ = lay(None)
    assert "known" not in engine.calls[0]
    for number, call in enumerate(engine.calls[1:], 2):
        assert call["known_mask"].any()
        new = call["mask"] & ~call["known_mask"]
        assert np.count_nonzero(new) == np.count_nonzero(wall == number)


def test_what_lies_outside_a_body_is_not_made(small: None) -> None:
    z, y, x = np.indices(SHAPE)
    body = (np.abs(y - z * 50 / 70) < 6) & (x > 34)
    wall, engine, facts = lay(body)
    assert facts["count"] == len(engine.calls) < 6
    assert (wall[body] > 0).all()
    assert (wall[~body] == -1).all()
    made = sum(int(np.prod(call["shape"])) for call in engine.calls)
    assert made < 0.6 * body.size
    assert sum(np.count_nonzero(c["mask"] & ~c.get("known_mask", False)) for c in engine.calls) == (
        np.count_nonzero(body)
    )


def test_a_thin_body_gets_bricks_that_an_engine_can_make(small: None) -> None:
    body = np.zeros(SHAPE, bool)
    body[0, 0, 0] = body[-1, -1, -1] = True
    wall, engine, facts = lay(body)
    assert facts["count"] == 2
    assert [call["shape"] for call in engine.calls] == [(12,) * 3, (13,) * 3]
    assert np.count_nonzero(wall > 0) == 2


@pytest.fixture(scope="module")
def engine() -> VolumeTexture:
    return VolumeTexture(preset="fast", windows=(6, 4), iterations=4).fit(
        exemplars.spinodal((40, 40, 40), porosity=0.6, wavelength=10, seed=1)
    )


def test_a_body_in_a_large_box_is_made_in_bricks(
    small: None, engine: VolumeTexture, monkeypatch: pytest.MonkeyPatch
) -> None:
    z, y, x = np.indices((48, 48, 48)) - 23.5
    body = z**2 + y**2 + x**2 < 22**2
    whole = engine.sample(body.shape, seed=4, mask=body)
    assert "bricks" not in whole.metadata["poresynth"]
    most = engine.estimate_memory((42, 42, 42))
    monkeypatch.setattr(VolumeTexture, "_brick_memory", lambda self: most)
    made = engine.sample(body.shape, seed=4, mask=body)
    facts = made.metadata["poresynth"]
    assert facts["bricks"]["count"] == 8
    assert 0 <= facts["copying"]["copy_fraction"] <= 1
    solid = engine._phases.phase_of(made.array) > 0
    assert not solid[~body].any()
    assert abs(1 - solid[body].mean() - engine.porosity_) < 1e-3
    for threads in (1, 2):
        again = engine.sample(body.shape, seed=4, mask=body, threads=threads)
        np.testing.assert_array_equal(again.array, made.array)
    # Periodic, all is made in one piece.
    periodic = engine.sample(body.shape, seed=4, mask=body, boundary="periodic")
    assert "bricks" not in periodic.metadata["poresynth"]


def test_bricks_follow_a_porosity_map_together(
    small: None, engine: VolumeTexture, monkeypatch: pytest.MonkeyPatch
) -> None:
    z, y, x = np.indices((60, 48, 48)) - np.array([29.5, 23.5, 23.5])[:, None, None, None]
    body = (z / 29) ** 2 + (y / 23) ** 2 + (x / 23) ** 2 < 1
    wanted = np.broadcast_to(0.5 + 0.2 * (z + 29.5) / 59, body.shape)
    made = {}
    for in_bricks in (False, True):
        most = engine.estimate_memory((42, 42, 42)) if in_bricks else 1 << 40
        monkeypatch.setattr(VolumeTexture, "_brick_memory", lambda self, most=most: most)
        sample = engine.sample(body.shape, seed=4, mask=body, porosity=wanted)
        facts = sample.metadata["poresynth"]
        assert ("bricks" in facts) == in_bricks
        assert facts["grading"]["mean_absolute_error_percent"] < 1
        made[in_bricks] = engine._phases.phase_of(sample.array) > 0
        assert not made[in_bricks][~body].any()
        count = np.count_nonzero(~made[in_bricks] & body)
        assert count == pytest.approx(wanted[body].sum(), abs=1)
        # No skin is taken off where the body ends.
        rim = body & ~ndimage.binary_erosion(body, iterations=2)
        even = engine._phases.phase_of(engine.sample(body.shape, seed=4, mask=body).array) > 0
        gone = np.mean(even[rim]) - np.mean(made[in_bricks][rim])
        assert gone == pytest.approx(wanted[rim].mean() - engine.porosity_, abs=0.02)
        # The facts speak of all bricks together.
        assert facts["porosity_map"]["lowest"] == pytest.approx(0.5, abs=1e-3)


@pytest.mark.parametrize("name", ["new.zarr", "new.tif"])
@pytest.mark.parametrize("dtype", [bool, np.uint8])
def test_a_file_is_written_brick_by_brick(
    small: None, tmp_path: Path, name: str, dtype: type
) -> None:
    binary = exemplars.spinodal((40, 40, 40), porosity=0.6, wavelength=10, seed=1)
    solid = binary.array > binary.array.mean()
    exemplar = binary.with_array(solid if dtype is bool else np.uint8(7) + np.uint8(90) * solid)
    engine = VolumeTexture(preset="fast", windows=(6, 4), iterations=4).fit(exemplar)
    stages: list[float] = []
    facts = engine.sample_to(
        tmp_path / name, (50, 40, 44), seed=2, progress=lambda stage, share: stages.append(share)
    )
    assert facts["count"] == 8
    assert facts["seam"]["phase_changes"] > 0
    assert stages == sorted(stages)
    made = io.read(tmp_path / name)
    assert made.dtype == exemplar.dtype
    assert made.shape == (50, 40, 44)
    assert set(np.unique(made.array)) == set(np.unique(exemplar.array))
    own, new = (v.array == v.array.max() for v in (exemplar, made))
    assert abs(own.mean() - new.mean()) < 1e-3
    assert made.metadata["poresynth"]["bricks"]["margin"] == 12
    # In memory the same bricks give the same voxels.
    wall = np.zeros(made.shape, exemplar.dtype)
    request = Request.of(made.shape, least=engine._least, exemplar=exemplar, seed=2, threads=1)
    engine._lay(wall, request, None)
    np.testing.assert_array_equal(wall, made.array)


def test_what_cannot_be_written_so_is_refused(engine: VolumeTexture, tmp_path: Path) -> None:
    ramp: Any = np.linspace(0.5, 0.7, 44)[:, None, None]
    with pytest.raises(ParameterError, match="porosity = a map: must be a number"):
        engine.sample_to(tmp_path / "new.tif", (44, 44, 44), porosity=ramp)
    with pytest.raises(FileError, match="only TIFF and Zarr"):
        engine.sample_to(tmp_path / "new.npy", (44, 44, 44))

    def stop(stage: str, share: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        engine.sample_to(tmp_path / "new.tif", (44, 44, 44), progress=stop)
    assert list(tmp_path.iterdir()) == []
