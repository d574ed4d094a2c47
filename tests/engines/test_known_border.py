"""The border between known voxels and new ones."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from poresynth import VolumeTexture, exemplars
from poresynth.engines.seam import border_steps, expected_steps, seam
from poresynth.engines.settling import settle

SHAPE = (40, 36, 32)


def noise(seed: int, shape: tuple[int, ...] = SHAPE) -> np.ndarray:
    smooth = ndimage.gaussian_filter(np.random.default_rng(seed).random(shape), 2)
    return ((smooth - smooth.mean()) / smooth.std()).astype(np.float32)


def slices(every: int = 10) -> np.ndarray:
    known = np.zeros(SHAPE, bool)
    known[::every] = True
    return known


def naive_steps(values: np.ndarray, known: np.ndarray, domain: np.ndarray) -> float:
    total = 0.0
    for place in np.ndindex(*values.shape):
        for axis in range(3):
            other = tuple(p + (i == axis) for i, p in enumerate(place))
            inside = all(p < n for p, n in zip(other, values.shape, strict=True))
            if inside and known[place] != known[other] and domain[place] and domain[other]:
                total += abs(float(values[place]) - float(values[other]))
    return total


def test_steps_are_those_of_pairs_across_the_border() -> None:
    rng = np.random.default_rng(1)
    values = rng.random((5, 6, 7))
    known, domain = rng.random((5, 6, 7)) > 0.5, rng.random((5, 6, 7)) > 0.2
    assert border_steps(values, known, domain) == pytest.approx(naive_steps(values, known, domain))
    everywhere = np.ones(known.shape, bool)
    assert border_steps(values, known) == pytest.approx(naive_steps(values, known, everywhere))
    # Steps of 1, 2 and 3 along the axes; each pair counts by its axis.
    z, y, x = np.indices((5, 6, 7))
    assert expected_steps(z + 2 * y + 3 * x, known) == pytest.approx(
        border_steps(z + 2 * y + 3 * x, known)
    )


def test_one_texture_has_no_seam_and_two_have() -> None:
    whole, other = noise(1), noise(2)
    known = slices()
    same = seam((whole, whole > 0), (whole, whole > 0), known)
    assert same["steps"] == pytest.approx(1, abs=0.2)
    assert same["phase_changes"] == pytest.approx(1, abs=0.2)
    mixed = np.where(known, whole, other)
    torn = seam((mixed, mixed > 0), (whole, whole > 0), known)
    assert torn["steps"] is not None
    assert torn["steps"] > 3
    nothing = seam((whole, whole > 0), (whole, whole > 0), np.ones(SHAPE, bool))
    assert nothing == {"steps": None, "phase_changes": None}


@pytest.mark.parametrize("cut", [None, 0.0])
def test_settling_takes_the_steps_down_to_ordinary_ones(cut: float | None) -> None:
    exemplar, known = noise(1), slices()
    field = np.where(known, noise(1), noise(2))[None]
    settled = settle(field, exemplar[None], known, cut=cut)
    np.testing.assert_array_equal(settled[0][known], field[0][known])
    model, mine = (exemplar, settled[0]) if cut is None else (exemplar > 0, settled[0] > 0)
    before = border_steps(field[0] if cut is None else field[0] > 0, known)
    wanted = expected_steps(model, known)
    assert before > 2 * wanted
    # Two textures that have nothing in common meet halfway; those of a synthesis meet.
    assert border_steps(mine, known) < 0.6 * before
    # What has ordinary steps already is hardly touched.
    same = settle(exemplar[None], exemplar[None], slices(7), cut=cut)
    assert np.abs(same - exemplar).mean() < 0.1
    assert settle(field, exemplar[None], np.zeros(SHAPE, bool)) is field


@pytest.mark.parametrize("kind", ["gray", "binary"])
def test_slices_of_a_volume_are_met_without_a_seam(kind: str) -> None:
    exemplar = np.asarray(exemplars.spinodal((48, 48, 48), wavelength=14, seed=1).array)
    exemplar = exemplar if kind == "gray" else exemplar > 127
    known_mask = np.zeros(exemplar.shape, bool)
    known_mask[::12] = True
    engine = VolumeTexture(preset="fast").fit(exemplar)
    made = engine.sample(exemplar.shape, seed=2, known=exemplar, known_mask=known_mask)
    np.testing.assert_array_equal(made.array[known_mask], exemplar[known_mask])
    figures = made.metadata["poresynth"]["seam"]
    assert 0.5 < figures["phase_changes"] < 1.3
    assert figures["steps"] < 1.6
