"""The engine's kernels against slow twins and independent libraries."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy import ndimage
from tests.references import volume_texture as twin
from tests.references import window_search as search_twin
from tests.references.random_key import Key

from poresynth import _core
from poresynth.errors import ParameterError

LEVEL = {
    "stages": [(4, 2)],
    "iterations": 1,
    "filters": 0,
    "filter_edge": 0,
    "deep": False,
    "alike": False,
    "regularisation": 1.0,
    "detail": False,
    "response_steps": (0, 0),
    "search": "brute_force",
    "candidates": 10,
    "temperature": 0.0,
    "bandwidth": None,
    "relaxation": 1.0,
    "mode_steps": 0,
}
OPTIONS = {
    "levels": [LEVEL],
    "tolerance": 0.0,
    "patience": 3,
    "start": "blocks",
    "block": 4,
    "starts": 1,
    "components": 64,
    "variance": 1.0,
    "emphasis": "none",
    "match_histogram": True,
    "index_weight": "off",
    "run_penalty": 0.0,
    "run_reach": 6,
    "exponent": 0.8,
    "adaptive": False,
    "gradient": 0.0,
    "boundary": "open",
}


def example(field: np.ndarray, **changes: object) -> dict[str, object]:
    """An exemplar of shape (channel, z, y, x), as the kernel takes it."""
    plain = {"field": field, "symmetry": "none", "keep_axis": None, "normal": None, "weight": 1.0}
    return {**plain, **changes}


def smooth_noise(shape: tuple[int, int, int], seed: int) -> np.ndarray:
    noise = np.random.default_rng(seed).random(shape)
    smooth = ndimage.gaussian_filter(noise, 1.0, mode="wrap")
    return (255 * (smooth - smooth.min()) / np.ptp(smooth)).astype(np.float32)


@pytest.mark.parametrize("boundary", ["open", "periodic"])
def test_one_iteration_equals_the_numpy_twin(boundary: str) -> None:
    exemplar = smooth_noise((12, 11, 13), 1)
    shape, seed, window, step = (10, 9, 12), 5, 4, 2
    field, [match_map], energy = _core.synthesize(
        [example(exemplar[None])], shape, {**OPTIONS, "boundary": boundary}, seed=seed
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
    level = {**LEVEL, "iterations": 6, "search": "coherent"}
    energies = [
        _core.synthesize(
            [example(exemplar[None])],
            (14, 14, 14),
            {**OPTIONS, "gradient": mu, "levels": [level]},
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


def test_arrays_of_any_memory_order_give_the_same() -> None:
    field = smooth_noise((8, 9, 10), 4)[None]
    made = [
        _core.synthesize([example(array)], (8, 8, 8), OPTIONS, seed=2)[0]
        for array in (field, np.asfortranarray(field), np.repeat(field, 2, axis=3)[..., ::2])
    ]
    np.testing.assert_array_equal(made[0], made[1])
    np.testing.assert_array_equal(made[0], made[2])


def test_what_does_not_fit_is_refused() -> None:
    field = smooth_noise((8, 8, 8), 4)[None]
    for change in (
        {"levels": [{**LEVEL, "search": "magic"}]},
        {"boundary": "closed"},
        {"emphasis": "strong"},
        {"levels": [LEVEL] * 3},
    ):
        with pytest.raises(ParameterError):
            _core.synthesize([example(field)], (8, 8, 8), {**OPTIONS, **change}, seed=0)
    for other in (example(field, symmetry="half"), example(field, normal=0)):
        with pytest.raises(ParameterError):
            _core.synthesize([other], (8, 8, 8), OPTIONS, seed=0)
    with pytest.raises(ParameterError, match="exemplars"):
        _core.synthesize([], (8, 8, 8), OPTIONS, seed=0)
    broken = field.copy()
    broken[0, 0, 0, 0] = np.nan
    with pytest.raises(ParameterError, match="finite"):
        _core.synthesize([example(broken)], (8, 8, 8), OPTIONS, seed=0)
    with pytest.raises(ParameterError, match="wanted"):
        _core.cut_phases(np.zeros((2, 5), np.float32), [1, 1], seed=0)


def described(seed: int = 1, variance: float = 1.0) -> list[np.ndarray]:
    exemplar, volume = smooth_noise((11, 12, 13), seed), smooth_noise((12, 10, 14), seed + 1)
    return _core.describe_windows(
        exemplar[None],
        volume[None],
        window=4,
        step=2,
        components=16,
        variance=variance,
        seed=3,
    )


def find(
    descriptors: np.ndarray,
    queries: np.ndarray,
    start: np.ndarray | None = None,
    search: str = "brute_force",
    candidates: int = 10,
    seed: int = 0,
    threads: int = 0,
) -> np.ndarray:
    if start is None:
        start = np.zeros(queries.shape[:3], np.int64)
    return _core.match_windows(
        descriptors,
        queries,
        start,
        step=2,
        search=search,
        candidates=candidates,
        seed=seed,
        threads=threads,
    )


def of_found(distances: np.ndarray, found: np.ndarray) -> np.ndarray:
    return np.take_along_axis(distances, found.reshape(-1, 1), axis=1)[:, 0]


def test_descriptors_keep_the_distances_of_principal_components() -> None:
    exemplar, volume = smooth_noise((11, 12, 13), 1), smooth_noise((12, 10, 14), 2)
    descriptors, queries = described()
    assert descriptors.shape == (8, 9, 10, 16)
    assert queries.shape == (5, 4, 6, 16)
    wanted = search_twin.squared_distances(
        *search_twin.components(
            search_twin.windows(exemplar, 4, 1), search_twin.windows(volume, 4, 2), 16
        )
    )
    got = search_twin.squared_distances(descriptors, queries)
    # Descriptors are scaled to fill their integers.
    np.testing.assert_allclose(got / (got.sum() / wanted.sum()), wanted, rtol=0.05)


def test_brute_force_finds_the_first_of_the_nearest_windows() -> None:
    descriptors, queries = described()
    descriptors[4:] = descriptors[:4]  # ties
    want = search_twin.squared_distances(descriptors, queries).argmin(axis=1)
    np.testing.assert_array_equal(find(descriptors, queries).ravel(), want)


@pytest.mark.parametrize("search", ["brute_force", "kd_tree", "coherent"])
def test_matches_depend_on_neither_threads_nor_memory_order(search: str) -> None:
    descriptors, queries = described()
    start = np.random.default_rng(0).integers(0, 720, queries.shape[:3])
    want = find(descriptors, queries, start, search)
    np.testing.assert_array_equal(find(descriptors, queries, start, search, threads=1), want)
    for order in (np.asfortranarray, lambda a: np.repeat(a, 2, axis=2)[:, :, ::2]):
        arrays = (order(a) for a in (descriptors, queries, start))
        np.testing.assert_array_equal(find(*arrays, search), want)


def test_the_kd_tree_is_exact_with_all_candidates_and_near_with_ten() -> None:
    descriptors, queries = described()
    distances = search_twin.squared_distances(descriptors, queries)
    best = distances.min(axis=1)
    every = of_found(distances, find(descriptors, queries, search="kd_tree", candidates=720))
    np.testing.assert_array_equal(every, best)
    near = of_found(distances, find(descriptors, queries, search="kd_tree"))
    assert best.sum() < near.sum() < 1.15**2 * best.sum()


def test_coherent_search_is_never_worse_than_its_start_and_better_pass_by_pass() -> None:
    descriptors, queries = described()
    distances = search_twin.squared_distances(descriptors, queries)
    found = np.random.default_rng(0).integers(0, 720, queries.shape[:3])
    passes = [of_found(distances, found)]
    for seed in range(40):
        found = find(descriptors, queries, found, "coherent", seed=seed)
        passes.append(of_found(distances, found))
        assert (passes[-1] <= passes[-2]).all()
    first, best = passes[0].mean(), distances.min(axis=1).mean()
    assert passes[1].mean() < 0.8 * first
    assert passes[-1].mean() < best + 0.1 * (first - best)


def test_coherent_search_continues_what_a_neighbour_found() -> None:
    exemplar = smooth_noise((12, 12, 12), 1)
    descriptors, queries = _core.describe_windows(
        exemplar[None], exemplar[None], window=4, step=2, components=16, variance=1.0, seed=0
    )
    copied = np.arange(9**3).reshape(9, 9, 9)[::2, ::2, ::2]
    start = np.zeros_like(copied)
    start[2, 2, 2] = copied[2, 2, 2]
    found = find(descriptors, queries, start, "coherent")
    for place in [(2, 2, 2), (1, 2, 2), (3, 2, 2), (2, 1, 2), (2, 3, 2), (2, 2, 1), (2, 2, 3)]:
        assert found[place] == copied[place]


def test_windows_that_do_not_fit_are_refused() -> None:
    field = smooth_noise((8, 8, 8), 4)[None]
    options = {"window": 4, "step": 2, "components": 8, "variance": 0.95, "seed": 0}
    for name, volume, change in (
        ("window", field, {"window": 0, "step": 0}),
        ("step", field, {"step": 5}),
        ("volume", field[:, :3], {}),
        ("volume", np.repeat(field, 2, axis=0), {}),
    ):
        with pytest.raises(ParameterError, match=name):
            _core.describe_windows(field, volume, **{**options, **change})
    descriptors, queries = described()
    start = np.zeros(queries.shape[:3], np.int64)
    for name, arrays, change in (
        ("descriptors", (descriptors[..., :15], queries[..., :15], start), {}),
        ("descriptors", (descriptors, np.repeat(queries, 2, axis=3), start), {}),
        ("descriptors", (descriptors[:0], queries, start), {}),
        ("queries", (descriptors, np.full_like(queries, -32768), start), {}),
        ("start", (descriptors, queries, start[1:]), {}),
        ("start", (descriptors, queries, start - 1), {}),
        ("start", (descriptors, queries, start + 720), {}),
        ("search", (descriptors, queries, start), {"search": "magic"}),
        ("candidates", (descriptors, queries, start), {"search": "kd_tree", "candidates": 0}),
    ):
        with pytest.raises(ParameterError, match=name):
            find(*arrays, **change)
    with pytest.raises(ParameterError, match="step"):
        _core.match_windows(
            descriptors, queries, start, step=0, search="coherent", candidates=1, seed=0
        )
