"""The engine's kernels against slow twins and independent libraries."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy import ndimage
from tests.references import volume_texture as twin
from tests.references.random_key import Key

from poresynth import _core
from poresynth.errors import ParameterError

OPTIONS = {
    "levels": 1,
    "stages": [(4, 2)],
    "iterations": 1,
    "tolerance": 0.0,
    "block": 4,
    "components": 64,
    "variance": 1.0,
    "symmetry": "none",
    "keep_axis": None,
    "search": "brute_force",
    "candidates": 10,
    "index_weight": "off",
    "run_penalty": 0.0,
    "run_reach": 6,
    "exponent": 0.8,
    "adaptive": False,
    "gradient": 0.0,
    "boundary": "open",
    "slab": 4,
}


def smooth_noise(shape: tuple[int, int, int], seed: int) -> np.ndarray:
    noise = np.random.default_rng(seed).random(shape)
    smooth = ndimage.gaussian_filter(noise, 1.0, mode="wrap")
    return (255 * (smooth - smooth.min()) / np.ptp(smooth)).astype(np.float32)


@pytest.mark.parametrize("boundary", ["open", "periodic"])
def test_one_iteration_equals_the_numpy_twin(boundary: str) -> None:
    exemplar = smooth_noise((12, 11, 13), 1)
    shape, seed, window, step = (10, 9, 12), 5, 4, 2
    field, match_map, energy = _core.synthesize(
        exemplar[None], shape, {**OPTIONS, "boundary": boundary}, seed=seed
    )
    key = Key.new(seed)
    start = twin.random_blocks(exemplar, shape, 4, boundary, key.with_(0))
    iteration = key.with_(1).with_(2)
    origins = [
        twin.axis_origins(shape[a], window, step, iteration.below(a, step), boundary)
        for a in range(3)
    ]
    for got, want in zip(match_map.origins, origins, strict=True):
        np.testing.assert_array_equal(got, want)
    expected = twin.iterate(exemplar, start, window, origins)
    got = match_map.matches.reshape(-1, 4)
    assert (got[:, 0] == 0).all()
    agree = (got[:, 1:] == np.array(expected.matches)).all(1)
    assert agree.mean() > 0.98  # descriptors are quantised: a near tie may fall the other way
    assert energy[0][4] == pytest.approx(expected.data, rel=0.02)
    matched = twin.match_histogram(expected.blended, exemplar)
    off = np.abs(field[0] - matched)
    assert np.median(off) < 0.5
    assert off.mean() < 2.0


def test_the_gradient_term_moves_the_blend_towards_the_exemplars_gradients() -> None:
    exemplar = smooth_noise((14, 14, 14), 2)
    energies = [
        _core.synthesize(
            exemplar[None],
            (14, 14, 14),
            {**OPTIONS, "gradient": mu, "iterations": 6, "search": "coherent"},
            seed=1,
        )[2][-1][5]
        / mu
        for mu in (1e-6, 0.5)
    ]
    assert energies[1] < energies[0]


@pytest.mark.parametrize("shape", [(1, 1, 1), (5, 4, 3), (9, 12, 10)])
@pytest.mark.parametrize("clip", [1, 4, 20])
def test_signed_distance_equals_scipy(shape: tuple[int, int, int], clip: int) -> None:
    phase = np.random.default_rng(0).random(shape) < 0.5
    phase.ravel()[0] = True
    got = _core.signed_distance(phase, clip, boundary="open")
    if phase.all():
        np.testing.assert_array_equal(got, clip)
        return
    inside = ndimage.distance_transform_edt(phase) - 0.5
    outside = ndimage.distance_transform_edt(~phase) - 0.5
    np.testing.assert_allclose(
        got, np.clip(np.where(phase, inside, -outside), -clip, clip), rtol=1e-6
    )


@pytest.mark.parametrize("boundary", ["open", "periodic"])
@pytest.mark.parametrize("sigma", [0.5, 1.3])
def test_gaussian_equals_scipy(boundary: str, sigma: float) -> None:
    field = smooth_noise((9, 10, 11), 3)
    got = _core.gaussian(field[None], sigma, boundary=boundary)[0]
    mode = {"open": "nearest", "periodic": "wrap"}[boundary]
    want = ndimage.gaussian_filter(field, sigma, mode=mode, radius=int(np.ceil(3 * sigma)))
    np.testing.assert_allclose(got, want, rtol=1e-4, atol=1e-3)


@given(
    values=hnp.arrays(np.float32, st.integers(0, 300), elements=st.floats(-1e6, 1e6, width=32)),
    share=st.floats(0, 1),
    seed=st.integers(0, 2**64 - 1),
)
@settings(max_examples=60, deadline=None)
def test_the_cut_takes_exactly_the_wanted_largest_values(
    values: np.ndarray, share: float, seed: int
) -> None:
    wanted = round(share * values.size)
    solid = _core.cut_solid(values, wanted, seed=seed)
    assert solid.sum() == wanted
    if 0 < wanted < values.size:
        assert values[solid].min() >= values[~solid].max()


@given(
    gray=hnp.arrays(np.float32, 200, elements=st.floats(0, 255, width=32)),
    solid=hnp.arrays(bool, 200),
    sizes=st.tuples(st.integers(1, 400), st.integers(1, 400)),
)
@settings(max_examples=60, deadline=None)
def test_ranks_keep_the_order_within_a_phase(
    gray: np.ndarray, solid: np.ndarray, sizes: tuple[int, int]
) -> None:
    ranks = _core.ranks_by_phase(gray, solid, sizes, seed=0)
    for phase in (0, 1):
        own, values = ranks[solid == phase], gray[solid == phase]
        order = np.lexsort((own, values))
        assert (np.diff(own[order].astype(int)) >= 0).all()
        assert (own < sizes[phase]).all()


def test_arrays_of_any_memory_order_give_the_same() -> None:
    field = smooth_noise((8, 9, 10), 4)[None]
    made = [
        _core.synthesize(array, (8, 8, 8), OPTIONS, seed=2)[0]
        for array in (field, np.asfortranarray(field), np.repeat(field, 2, axis=3)[..., ::2])
    ]
    np.testing.assert_array_equal(made[0], made[1])
    np.testing.assert_array_equal(made[0], made[2])


def test_what_does_not_fit_is_refused() -> None:
    field = smooth_noise((8, 8, 8), 4)[None]
    for change in (
        {"search": "magic"},
        {"boundary": "closed"},
        {"symmetry": "half"},
        {"levels": 3},
    ):
        with pytest.raises(ParameterError):
            _core.synthesize(field, (8, 8, 8), {**OPTIONS, **change}, seed=0)
    broken = field.copy()
    broken[0, 0, 0, 0] = np.nan
    with pytest.raises(ParameterError, match="finite"):
        _core.synthesize(broken, (8, 8, 8), OPTIONS, seed=0)
    with pytest.raises(ParameterError, match="wanted"):
        _core.cut_phases(np.zeros((2, 5), np.float32), [1, 1], seed=0)
