"""A phase made one piece, against plain Dijkstra and by what must not change."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage
from tests.references import bridges

from poresynth import _core
from poresynth.errors import ParameterError
from poresynth.pruning import connect

CONNECTIVITY = {"solid": 26, "pore": 6}


def cut(
    seed: int, fraction: float, shape: tuple[int, ...] = (40, 44, 48), sigma: float = 2.0
) -> tuple[np.ndarray, np.ndarray]:
    """Thresholded smooth noise: its solid and its scores."""
    noise = np.random.default_rng(seed).random(shape)
    score = ndimage.gaussian_filter(noise, sigma, mode="wrap").astype(np.float32)
    return score > np.quantile(score, 1 - fraction), score


def parts(solid: np.ndarray, which: str, boundary: str = "open") -> int:
    phase = solid if which == "solid" else ~solid
    found = _core.component_sizes(phase, connectivity=CONNECTIVITY[which], boundary=boundary)
    return len(found)


@pytest.mark.parametrize("which", ["solid", "pore"])
@pytest.mark.parametrize("boundary", ["open", "periodic"])
@pytest.mark.parametrize("width", [1, 3])
def test_one_piece_of_the_same_size(which: str, boundary: str, width: float) -> None:
    solid, score = cut(1, 0.12 if which == "solid" else 0.88)
    before = parts(solid, which, boundary)
    assert before > 5
    found = connect(solid, score, which, smallest=10, width=width, boundary=boundary)
    assert found.erased > 0
    assert found.joined > 0
    assert found.apart == found.missing == 0
    assert 1 + found.erased + found.joined == before
    assert parts(found.solid, which, boundary) == 1
    assert np.count_nonzero(found.solid) == np.count_nonzero(solid)


@pytest.mark.parametrize("which", ["solid", "pore"])
@pytest.mark.parametrize("boundary", ["open", "periodic"])
@pytest.mark.parametrize("seed", range(3))
def test_only_the_joins_change_the_euler_number(which: str, boundary: str, seed: int) -> None:
    solid, score = cut(seed, 0.12 if which == "solid" else 0.88)
    found = connect(solid, score, which, smallest=0, boundary=boundary)
    options = {"connectivity": CONNECTIVITY[which], "boundary": boundary}
    phases = (solid, found.solid) if which == "solid" else (~solid, ~found.solid)
    before, after = (_core.euler_number(phase, **options) for phase in phases)
    assert found.joined > 5
    assert after == before - found.joined


def two_parts(draw: Any, shape: tuple[int, int, int]) -> np.ndarray:
    solid = np.zeros(shape, bool)
    solid[0, : draw(st.integers(1, 3)), 0] = True
    solid[-1, -1, -draw(st.integers(1, 3)) :] = True
    return solid


@st.composite
def pairs(draw: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Two components far apart, random scores and some walls."""
    shape = draw(st.tuples(st.integers(1, 6), st.integers(5, 7), st.integers(5, 8)))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    solid = two_parts(draw, shape)
    score = rng.normal(size=shape).astype(np.float32)
    score[solid] += 4
    return solid, score, rng.random(shape) > draw(st.sampled_from([0, 0.2]))


@given(pairs(), st.sampled_from([6, 26]), st.booleans())
def test_no_bridge_is_cheaper(
    scene: tuple[np.ndarray, np.ndarray, np.ndarray], connectivity: int, periodic: bool
) -> None:
    phase, score, free = scene
    boundary = "periodic" if periodic else "open"
    options = {"connectivity": connectivity, "boundary": boundary}
    labels, sizes = _core.label(phase, **options)
    out, erased, joined, apart, _ = _core.connect_phase(
        phase, score, free=free, smallest=0, width=1, **options
    )
    assert erased == 0
    assert joined + apart == len(sizes) - 1
    toll = bridges.tolls(phase, score, free)
    if len(sizes) == 1:
        np.testing.assert_array_equal(out, phase)
        return
    cost = bridges.spanning_cost(toll, labels, connectivity, periodic)
    if apart:
        assert cost == np.inf
        return
    # What was added is a way between the two, and no way is cheaper.
    toll[~(phase | out)] = np.inf
    assert bridges.spanning_cost(toll, labels, connectivity, periodic) == pytest.approx(cost, 1e-5)


@pytest.mark.parametrize("connectivity", [6, 26])
@pytest.mark.parametrize("seed", range(3))
def test_bridges_of_many_parts_cost_no_more_than_a_spanning_tree(
    connectivity: int, seed: int
) -> None:
    phase, score = cut(seed, 0.08, (10, 11, 12), 0.9)
    options = {"connectivity": connectivity, "boundary": "open"}
    labels, sizes = _core.label(phase, **options)
    out, _, joined, *_ = _core.connect_phase(phase, score, smallest=0, width=1, **options)
    assert joined == len(sizes) - 1 > 3
    toll = bridges.tolls(phase, score, np.ones_like(phase))
    # Bridges may meet each other, and steps may be longer than the voxels that they add.
    tree = bridges.spanning_cost(toll, labels, connectivity, False)
    assert toll[out & ~phase].sum() <= tree * (1 + 1e-5)


@pytest.mark.parametrize("which", ["solid", "pore"])
def test_what_is_one_piece_already_is_unchanged(which: str) -> None:
    solid, score = cut(2, 0.12 if which == "solid" else 0.88)
    once = connect(solid, score, which, smallest=5).solid
    again = connect(once, score, which, smallest=10**9)
    np.testing.assert_array_equal(again.solid, once)
    assert again.erased == again.joined == again.apart == again.missing == 0


@pytest.mark.parametrize("which", ["solid", "pore"])
def test_pore_and_solid_are_mirror_images(which: str) -> None:
    """The kernel sees the same either way, but for the neighbours that touch."""
    solid, score = cut(3, 0.1)
    options = {"boundary": "open", "smallest": 4, "width": 2.0}
    direct = _core.connect_phase(solid, score, connectivity=CONNECTIVITY[which], **options)[0]
    if which == "solid":
        found = connect(solid, score, "solid", smallest=4, width=2).solid
    else:
        found = ~connect(~solid, -score, "pore", smallest=4, width=2).solid
    np.testing.assert_array_equal(found, direct)


def test_voxels_that_may_not_change_stay() -> None:
    solid, score = cut(4, 0.12)
    free = np.random.default_rng(0).random(solid.shape) > 0.1
    free[:, 20] = False
    found = connect(solid, score, "solid", smallest=10, free=free)
    np.testing.assert_array_equal(found.solid[~free], solid[~free])
    assert np.count_nonzero(found.solid) == np.count_nonzero(solid)
    assert parts(found.solid, "solid") == 1 + found.apart


def test_the_pore_of_a_domain_does_not_lead_through_the_outside() -> None:
    solid = np.ones((9, 9, 24), bool)
    domain = np.zeros_like(solid)
    domain[1:8, 1:8, 1:-1] = True
    solid[~domain] = False
    for x in (1, 15):
        solid[1:4, 3:6, x : x + 6] = False
    score = np.where(solid, 1.0, -1.0)
    found = connect(solid, score, "pore", smallest=0, width=2, domain=domain)
    assert (found.joined, found.apart, found.missing) == (1, 0, 0)
    np.testing.assert_array_equal(found.solid[~domain], solid[~domain])
    # A pore that goes on outside would need no bridge.
    pore = ~found.solid & domain
    assert len(_core.component_sizes(pore, connectivity=6, boundary="open")) == 1
    assert np.count_nonzero(pore) == 2 * 3 * 3 * 6
    # Its bridge leads through the material.
    assert (~found.solid & domain)[:, :, 7:15].any(axis=(0, 1)).all()


@pytest.mark.parametrize("solid", [True, False])
@pytest.mark.parametrize("which", ["solid", "pore"])
@pytest.mark.parametrize("shape", [(1, 1, 1), (1, 5, 1), (3, 1, 4)])
def test_empty_full_and_flat(shape: tuple[int, int, int], which: str, solid: bool) -> None:
    volume = np.full(shape, solid)
    for boundary in ("open", "periodic"):
        found = connect(volume, np.zeros(shape), which, boundary=boundary)
        np.testing.assert_array_equal(found.solid, volume)
        assert found.erased == found.joined == found.apart == found.missing == 0


def test_threads_and_memory_order_do_not_matter() -> None:
    solid, score = cut(5, 0.12)
    expected = connect(solid, score, "solid", threads=1).solid
    for threads in (2, 7):
        found = connect(
            np.asfortranarray(solid), score[:, :, ::-1][:, :, ::-1], "solid", threads=threads
        )
        np.testing.assert_array_equal(found.solid, expected)


@pytest.mark.parametrize(
    ("name", "changed"),
    [
        ("which", {"which": "void"}),
        ("smallest", {"smallest": -1}),
        ("smallest", {"smallest": 1.5}),
        ("width", {"width": 0.5}),
        ("width", {"width": float("nan")}),
        ("boundary", {"boundary": "closed"}),
        ("score", {"score": np.full((4, 5, 6), np.nan)}),
        ("score.shape", {"score": np.zeros((4, 5, 7))}),
        ("free", {"free": np.ones((4, 5, 7), bool)}),
        ("free", {"free": np.ones((4, 5, 6))}),
        ("domain", {"domain": np.ones((4, 5), bool)}),
        ("solid", {"solid": np.zeros((4, 5))}),
    ],
)
def test_bad_input_is_named(name: str, changed: dict[str, Any]) -> None:
    given = {"solid": np.zeros((4, 5, 6), bool), "score": np.zeros((4, 5, 6)), "which": "solid"}
    with pytest.raises(ParameterError, match=name) as error:
        connect(**(given | changed))
    assert error.value.parameter == name
