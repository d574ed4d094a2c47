"""Porosity from place to place."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from scipy import ndimage

from poresynth import Volume, VolumeTexture, exemplars
from poresynth.engines.grading import feature_size, grade
from poresynth.engines.porosity import PorosityMap, as_porosity
from poresynth.engines.solid_texture import SolidTexture
from poresynth.errors import ParameterError

SHAPE = (64, 40, 40)


def medium(shape: tuple[int, ...] = SHAPE, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Smooth noise as a score, and its solid half."""
    score = ndimage.gaussian_filter(np.random.default_rng(seed).random(shape), 2, mode="wrap")
    score = ((score - score.mean()) / score.std()).astype(np.float32)
    return score, score > 0


def mapped(values: np.ndarray) -> PorosityMap:
    found = as_porosity(values, values.shape, (1.0, 1.0, 1.0))
    assert isinstance(found, PorosityMap)
    return found


def whole(porosity: Any) -> np.ndarray:
    """The values of a map at all voxels."""
    assert isinstance(porosity, PorosityMap)
    return porosity.at(tuple(slice(0, n) for n in porosity.shape))


def ramp(low: float, high: float, shape: tuple[int, ...] = SHAPE) -> np.ndarray:
    along = np.linspace(low, high, shape[0], dtype=np.float32)
    return np.ascontiguousarray(np.broadcast_to(along[:, None, None], shape))


@pytest.mark.parametrize("period", [8, 10, 20])
def test_the_feature_size_of_plates_is_their_period(period: int) -> None:
    plates = np.indices((120, 120, 120))[0] % period < period // 2
    # Only one axis of three crosses them.
    assert feature_size(plates) == pytest.approx(3 * period, rel=0.1)


@pytest.mark.parametrize(("low", "high"), [(0.3, 0.7), (0.6, 0.4), (0.5, 0.5), (0.2, 0.8)])
def test_windows_follow_the_map(low: float, high: float) -> None:
    score, solid = medium()
    wanted = ramp(low, high)
    found = grade(solid, mapped(wanted), feature_size(solid), seed=1, score=score)
    assert found.error < 0.01
    assert np.count_nonzero(~found.solid) == pytest.approx(wanted.sum(), abs=1)
    for part in np.array_split(np.arange(SHAPE[0]), 4):
        assert 1 - found.solid[part].mean() == pytest.approx(wanted[part].mean(), abs=0.02)


def test_the_structure_stays_where_its_porosity_is_wanted() -> None:
    score, solid = medium((96, 48, 48))
    wanted = np.full(solid.shape, 0.5, np.float32)
    wanted[48:] = np.linspace(0.5, 0.7, 48, dtype=np.float32)[:, None, None]
    found = grade(solid, mapped(wanted), feature_size(solid), seed=1, score=score).solid
    assert np.mean(found[:32] != solid[:32]) < 0.08
    # Where the porosity rises the solid only loses, but for the balance of its neighbourhood.
    assert np.mean(found[80:] & ~solid[80:]) < 0.01
    # The surface moves smoothly: no plane differs from the next by more than its neighbours do.
    share = found.mean(axis=(1, 2))
    own = solid.mean(axis=(1, 2))
    assert np.abs(np.diff(share)).max() < np.abs(np.diff(own)).max() + 0.03


def test_only_free_voxels_change_and_count() -> None:
    score, solid = medium()
    z, y, x = np.indices(SHAPE) - np.array([31.5, 19.5, 19.5])[:, None, None, None]
    free = (z / 30) ** 2 + (y / 19) ** 2 + (x / 19) ** 2 < 1
    wanted = ramp(0.4, 0.6)
    found = grade(solid, mapped(wanted), feature_size(solid), seed=1, free=free, score=score)
    np.testing.assert_array_equal(found.solid[~free], solid[~free])
    assert np.count_nonzero(~found.solid & free) == pytest.approx(wanted[free].sum(), abs=1)
    assert found.error < 0.01


def test_cells_are_graded_as_one(monkeypatch: pytest.MonkeyPatch) -> None:
    score, solid = medium()
    z, y, x = np.indices(SHAPE) - np.array([31.5, 19.5, 19.5])[:, None, None, None]
    body = (z / 30) ** 2 + (y / 19) ** 2 + (x / 19) ** 2 < 1
    for options in ({"score": score}, {}, {"free": body, "domain": body}):
        whole = grade(solid, mapped(ramp(0.4, 0.6)), feature_size(solid), seed=1, **options)
        with monkeypatch.context() as small:
            small.setattr("poresynth.engines.grading.EDGE", 24)
            small.setattr("poresynth.engines.grading.HALO", 16)
            parts = grade(solid, mapped(ramp(0.4, 0.6)), feature_size(solid), seed=1, **options)
        # Voxels of one depth are drawn in another order.
        assert np.mean(parts.solid != whole.solid) < 0.002
        assert np.count_nonzero(parts.solid) == np.count_nonzero(whole.solid)
        assert parts.error == pytest.approx(whole.error, abs=1e-3)


def test_where_nothing_is_known_is_neither_solid_nor_pore() -> None:
    _, solid = medium()
    z, y, x = np.indices(SHAPE) - np.array([31.5, 19.5, 19.5])[:, None, None, None]
    body = (z / 30) ** 2 + (y / 19) ** 2 + (x / 19) ** 2 < 1

    def differs(**options: Any) -> float:
        made = [
            grade(
                np.where(body, solid, outside),
                mapped(ramp(0.4, 0.6)),
                feature_size(solid),
                seed=1,
                free=body,
                **options,
            ).solid[body]
            for outside in (False, True)
        ]
        return float(np.mean(made[0] != made[1]))

    # What is left is the thickness of the struts that the border cuts.
    assert differs(domain=body) < 0.75 * differs()


def test_the_error_of_windows_is_that_of_their_voxels() -> None:
    _, solid = medium((48, 40, 44))
    wanted = ramp(0.45, 0.55, solid.shape)
    found = grade(solid, mapped(wanted), 8.0, seed=2)
    assert found.window == 24
    starts = [range(0, n - 23, 6) for n in (48, 40, 44)]
    missed = (~found.solid - wanted).astype(np.float64)
    errors = [
        abs(missed[z : z + 24, y : y + 24, x : x + 24].mean())
        for z, y, x in itertools.product(*starts)
    ]
    # Blocks at the far borders are narrower; windows that hold them are few.
    assert found.error == pytest.approx(np.mean(errors), rel=0.2)


def test_where_nothing_may_change_nothing_does() -> None:
    _, solid = medium()
    found = grade(solid, mapped(ramp(0.1, 0.9)), 8.0, seed=1, free=np.zeros(SHAPE, bool))
    np.testing.assert_array_equal(found.solid, solid)
    assert found.error == 0


def test_a_map_that_is_missed_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    score, solid = medium()
    monkeypatch.setattr("poresynth.engines.grading.ROUNDS", 0)
    with pytest.raises(ParameterError, match=r"0\.1 to 0\.9.*out of reach"):
        grade(solid, mapped(ramp(0.1, 0.9)), 4.0, seed=1, score=score)


def test_maps_and_functions_say_the_same() -> None:
    size = (2.0, 1.0, 0.5)

    def function(z: np.ndarray, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        assert (z.shape, y.shape, x.shape) == ((64, 1, 1), (1, 40, 1), (1, 1, 40))
        return 0.3 + 0.4 * z / 128 + 0 * x

    found = whole(as_porosity(function, SHAPE, size))
    np.testing.assert_allclose(found[:, 0, 0], 0.3 + 0.4 * (np.arange(64) + 0.5) / 64, rtol=1e-5)
    coarse = found[::2, ::2, ::2] / 2 + found[1::2, 1::2, 1::2] / 2
    again = as_porosity(coarse, SHAPE, size)
    np.testing.assert_allclose(whole(again)[1:-1], found[1:-1], rtol=1e-4)
    assert as_porosity(np.float32(0.25), SHAPE, size) == 0.25
    assert as_porosity(None, SHAPE, size) is None
    same = as_porosity(Volume(found), SHAPE, size)
    np.testing.assert_array_equal(whole(same), found)
    # A box of a map has the values of the whole.
    box = (slice(8, 30), slice(3, 40), slice(11, 12))
    for porosity in (again, same):
        assert isinstance(porosity, PorosityMap)
        np.testing.assert_array_equal(porosity.at(box), whole(porosity)[box])
        np.testing.assert_array_equal(whole(porosity.within(box)), whole(porosity)[box])
        assert porosity.figures["mean"] == pytest.approx(0.5, abs=1e-3)


@pytest.mark.parametrize(
    "porosity",
    [
        *(0.0, 1.0, -1, np.nan, [0.5, 0.6], "dense"),
        *(np.full((2, 2, 2), value) for value in (1.0, np.nan)),
        *(np.full((65, 40, 40), 0.5), np.zeros((0, 2, 2))),
        *(lambda z, y, x: 2.0, lambda z, y, x: np.zeros(7), lambda z: z),
    ],
)
def test_bad_porosities_are_named(porosity: Any) -> None:
    with pytest.raises(ParameterError, match="porosity"):
        as_porosity(porosity, SHAPE, (1.0, 1.0, 1.0))


def engines(kind: str) -> tuple[Any, np.ndarray]:
    """A quick engine of each kind that has learned a spinodal, and its exemplar."""
    exemplar = np.asarray(exemplars.spinodal((40, 40, 40), wavelength=12, seed=1).array)
    if kind == "binary":
        exemplar = exemplar > 127
    if kind == "image":
        return SolidTexture(levels=2, windows=(8,)).fit(exemplar[20]), exemplar
    if kind == "colour":
        exemplar = np.stack([exemplar, exemplar // 2, 255 - exemplar], axis=-1)
    return VolumeTexture(preset="fast").fit(exemplar), exemplar


@pytest.mark.parametrize("kind", ["gray", "binary", "image", "colour"])
def test_engines_follow_a_map(kind: str) -> None:
    engine, exemplar = engines(kind)
    shape = (72, 48, 48)
    wanted = ramp(0.35, 0.65, shape)
    made = engine.sample(shape, seed=3, porosity=wanted)
    array = np.asarray(made.array)
    assert array.dtype == exemplar.dtype
    structure = array[..., 0] if array.ndim == 4 else array
    solid = structure if structure.dtype == bool else structure > engine.threshold_
    for part in np.array_split(np.arange(72), 3):
        assert 1 - solid[part].mean() == pytest.approx(wanted[part].mean(), abs=0.04)
    figures = made.metadata["poresynth"]["grading"]
    assert 0 <= figures["mean_absolute_error_percent"] < 1
    low, high = (made.metadata["poresynth"]["porosity_map"][k] for k in ("lowest", "highest"))
    assert (low, high) == (pytest.approx(0.35), pytest.approx(0.65))
    again = engine.sample(shape, seed=3, porosity=lambda z, y, x: 0.35 + 0.3 * (z - 0.5) / 71)
    assert np.mean(again.array != made.array) < 0.01


def test_labels_take_a_number_only() -> None:
    labels = np.digitize(medium((32, 32, 32))[0], [-0.5, 0.5]).astype(np.uint8)
    engine = VolumeTexture(preset="fast").fit(labels)
    with pytest.raises(ParameterError, match="more than two phases"):
        engine.sample((32, 32, 32), porosity=ramp(0.3, 0.4, (32, 32, 32)))
