"""Pruning: known structures, what must not change, real volumes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage
from tests.references import branches as plain
from tests.references import cells

from poresynth import Volume, _core, exemplars
from poresynth.errors import ParameterError, PoresynthError
from poresynth.metrics import (
    component_sizes,
    component_statistics,
    end_points,
    euler_number,
    label,
)
from poresynth.pruning import Edit, prune
from poresynth.pruning.elongation import _rotation
from poresynth.pruning.gray import repaint
from poresynth.pruning.pores import closed_pores, open_path
from poresynth.pruning.record import Standing


def frame(edge: int = 48, thick: int = 5, cell: int = 16) -> np.ndarray:
    """A lattice of square struts."""
    beam = np.arange(edge) % cell < thick
    z, y, x = np.meshgrid(beam, beam, beam, indexing="ij")
    return (z & y) | (y & x) | (z & x)


def hanging(solid: np.ndarray, length: int) -> np.ndarray:
    """The lattice with a strut of 3 × 3 voxels that grows into a cell and ends there."""
    out = solid.copy()
    out[21 : 21 + length, 17:20, 25:28] = True
    return out


def test_a_short_branch_goes_and_nothing_else() -> None:
    solid = frame()
    found = prune(hanging(solid, 5), parts="keep")
    assert [edit.kind for edit in found.edits if edit.kind != "surface moved"] == ["branch removed"]
    edit = found.edits[0]
    assert edit.perimeter == pytest.approx(64, rel=0.1)
    assert edit.length is not None
    assert edit.length < 0.2 * edit.perimeter
    # The surface takes up what the branch had, all over the lattice.
    assert found.solid.sum() == hanging(solid, 5).sum()
    assert np.count_nonzero(found.solid[23:26, 17:20, 25:28]) <= 9
    assert euler_number(found.solid) == euler_number(solid)


def test_a_long_branch_reaches_the_next_strut() -> None:
    solid = frame()
    loose = hanging(solid, 7)
    found = prune(loose, theta=0.05, parts="keep")
    grown = [edit for edit in found.edits if edit.kind == "branch elongated"]
    assert len(grown) == 1
    assert found.loose == 0
    # One more loop, and still one piece.
    assert euler_number(found.solid) == euler_number(loose) - 1
    assert len(component_sizes(found.solid)) == 1
    assert found.solid[28:33, 18, 26].all()


def test_branches_are_copied_with_their_gray_values() -> None:
    solid = frame()
    loose = hanging(solid, 7)
    texture = np.random.default_rng(0).integers(0, 20, loose.shape)
    gray = (40 + 150 * loose + texture).astype(np.uint8)
    model = (40 + 150 * solid + texture + 5).astype(np.uint8)
    found = prune(gray, exemplar=model, threshold=120, theta=0.05, parts="keep")
    assert found.edits[0].kind == "branch elongated"
    array = np.asarray(found.volume.array)
    assert array.dtype == np.uint8
    np.testing.assert_array_equal(array > 120, found.solid)
    new = found.solid & ~loose
    assert set(np.unique(array[new])) <= set(range(190, 216))
    same = ~ndimage.binary_dilation(found.solid != loose, iterations=8)
    np.testing.assert_array_equal(array[same], gray[same])


def test_parts_are_joined_removed_or_kept() -> None:
    solid = frame()
    solid[24:28, 24:28, 24:28] = True
    solid[9, 9, 9] = True
    kinds = {way: prune(solid, parts=way).counts() for way in ("join", "remove", "keep")}
    assert kinds["join"]["part joined"] == kinds["join"]["part removed"] == 1
    assert kinds["remove"]["part removed"] == 2
    assert not {"part joined", "part removed"} & set(kinds["keep"])
    for way, parts in (("join", 1), ("remove", 1), ("keep", 3)):
        found = prune(solid, parts=way)
        assert found.after.components == parts
        assert found.solid.sum() == solid.sum()


def test_closed_pores_are_filled() -> None:
    solid = np.ones((20, 20, 20), bool)
    solid[8:12, 8:12, 8:12] = False
    solid[:, 3, 3] = False
    labels, closed = closed_pores(solid)
    assert len(closed) == 1
    assert (labels == closed[0]).sum() == 64
    found = prune(solid, pores="close", parts="keep", porosity_tolerance=1)
    assert found.counts()["pore closed"] == 1
    assert found.after.closed_pores == 0
    assert found.solid.sum() == solid.sum()


@pytest.mark.parametrize("axis", range(3))
def test_a_way_is_opened_through_the_thinnest_wall(axis: int) -> None:
    solid = np.zeros((24, 24, 24), bool)
    wall = [slice(None)] * 3
    wall[axis] = slice(10, 16)
    solid[tuple(wall)] = True
    thin = [slice(6, 9)] * 3
    thin[axis] = slice(10, 14)
    solid[tuple(thin)] = False
    found = prune(solid, open_axes=["zyx"[axis]], parts="keep")
    assert component_statistics(~found.solid, connectivity=6).spans[:, axis].sum() == 1
    assert found.counts()["pore opened"] == 1
    place = next(edit for edit in found.edits if edit.kind == "pore opened").place
    assert all(4 <= place[i] <= 10 for i in range(3) if i != axis)
    assert found.solid.sum() == solid.sum()
    # What leads through already is left alone.
    score = np.zeros(solid.shape, np.float32)
    assert open_path(found.solid, score, axis, 3.0, None) is found.solid


def test_the_exemplars_own_ends_are_a_target() -> None:
    rng = np.random.default_rng(3)
    clean = frame(96, 5, 16)
    rough = clean.copy()
    posts = 0
    for z, y, x in np.ndindex(5, 5, 5):
        if rng.random() < 0.5:
            z0, y0, x0 = 16 * z + 5, 16 * y + 1, 16 * x + 9
            rough[z0 : z0 + 4, y0 : y0 + 3, x0 : x0 + 3] = True
            posts += 1
    before = end_points(rough).count
    found = prune(rough, exemplar=clean, target="exemplar", parts="keep")
    assert found.exemplar is not None
    assert found.exemplar.end_points == 0
    assert before > 20
    assert found.after.end_points <= 0.15 * before
    kept = prune(rough, exemplar=rough, target="exemplar", parts="keep")
    assert kept.after.end_points == before
    assert not kept.edits


def test_loops_are_cut_where_the_exemplar_has_fewer() -> None:
    solid = frame(64, 5, 20)
    more = solid.copy()
    for z, y in ((31, 31), (51, 51)):
        more[z : z + 3, y : y + 3, 5:60] = True
    joined = more.copy()
    joined[31:34, 25:60, 30:33] = True
    found = prune(joined, exemplar=solid, target="exemplar", parts="join")
    wanted = Standing.of(solid).euler_density
    assert abs(found.after.euler_density - wanted) < abs(found.before.euler_density - wanted)
    assert found.after.components == 1


def test_what_may_not_change_stays() -> None:
    loose = hanging(frame(), 5)
    free = np.ones(loose.shape, bool)
    free[18:40, 10:30, 20:35] = False
    found = prune(loose, free=free)
    np.testing.assert_array_equal(found.solid[~free], loose[~free])


def test_a_periodic_volume_still_tiles() -> None:
    noise = np.random.default_rng(8).random((40, 40, 40))
    smooth = ndimage.gaussian_filter(noise, 2, mode="wrap")
    solid = smooth > np.quantile(smooth, 0.75)
    found = prune(solid, boundary="periodic")
    assert found.edits
    for axis in range(3):
        for side in (0, 1, -2, -1):
            before, after = (np.take(s, side, axis) for s in (solid, found.solid))
            np.testing.assert_array_equal(before, after)
    assert len(component_sizes(found.solid, boundary="periodic")) == found.after.components
    assert found.after.components <= found.before.components


def test_values_that_may_not_change_stay_beside_a_grown_branch() -> None:
    loose = hanging(frame(), 7)
    texture = np.random.default_rng(0).integers(0, 20, loose.shape)
    gray = (40 + 150 * loose + texture).astype(np.uint8)
    # Beside the branch, from where its skin would be on.
    free = np.ones(loose.shape, bool)
    free[:, :, 29:] = False
    model = (gray + 5).astype(np.uint8)
    found = prune(gray, exemplar=model, threshold=120, theta=0.05, parts="keep", free=free)
    assert found.edits[0].kind == "branch elongated"
    np.testing.assert_array_equal(np.asarray(found.volume.array)[~free], gray[~free])


@pytest.mark.parametrize(
    "array",
    [
        np.zeros((9, 9, 9), bool),
        np.ones((9, 9, 9), np.uint8),
        np.ones((1, 1, 1), bool),
        np.full((4, 5, 6), 7.5),
    ],
)
def test_nothing_to_prune(array: np.ndarray) -> None:
    found = prune(array)
    np.testing.assert_array_equal(np.asarray(found.volume.array), array)
    assert found.edits == ()


@pytest.mark.parametrize("dtype", [bool, np.uint8, np.int16, np.uint16, np.float32, np.float64])
def test_every_dtype_and_order_gives_the_same_solid(dtype: Any) -> None:
    loose = hanging(frame(), 5)
    values = loose if dtype is bool else (loose * 100).astype(dtype)
    expected = prune(loose).solid
    for array in (values, np.asfortranarray(values), values[::-1][::-1]):
        found = prune(array)
        assert found.volume.dtype == dtype
        np.testing.assert_array_equal(found.solid, expected)
        np.testing.assert_array_equal(np.unique(found.volume.array), np.unique(values))


def test_labels_keep_their_values() -> None:
    loose = hanging(frame(), 5).astype(np.uint8)
    loose[:, :24][loose[:, :24] > 0] = 2
    found = prune(loose)
    assert set(np.unique(found.volume.array)) <= {0, 1, 2}
    np.testing.assert_array_equal(np.asarray(found.volume.array) > 0, found.solid)


def test_dark_solid_is_the_mirror_of_bright() -> None:
    loose = hanging(frame(), 5)
    bright = prune(np.where(loose, 200, 20).astype(np.uint8))
    dark = prune(np.where(loose, 20, 200).astype(np.uint8), solid="dark")
    np.testing.assert_array_equal(bright.solid, dark.solid)


@pytest.mark.parametrize(
    ("arguments", "parameter"),
    [
        ({"theta": -1}, "theta"),
        ({"theta": np.nan}, "theta"),
        ({"target": "none"}, "target"),
        ({"target": "exemplar"}, "target"),
        ({"parts": "glue"}, "parts"),
        ({"pores": "open"}, "pores"),
        ({"boundary": "closed"}, "boundary"),
        ({"open_axes": ["t"]}, "open_axes"),
        ({"solid": "gray"}, "solid"),
        ({"porosity_tolerance": 2}, "porosity_tolerance"),
        ({"free": np.ones((2, 2, 2), bool)}, "free"),
    ],
)
def test_bad_input_is_named(arguments: dict[str, Any], parameter: str) -> None:
    with pytest.raises(ParameterError, match=parameter):
        prune(frame(), **arguments)
    with pytest.raises(ParameterError, match="volume"):
        prune(np.full((4, 4, 4), np.nan))


def test_too_much_to_make_up_for_is_an_error() -> None:
    solid = np.zeros((20, 20, 20), bool)
    solid[0, 0, 0] = True
    solid[5:18, 5:18, 5:18] = True
    free = np.zeros(solid.shape, bool)
    free[0, 0, 0] = True
    with pytest.raises(PoresynthError, match="porosity_tolerance"):
        prune(solid, parts="remove", free=free, porosity_tolerance=0)


def test_the_voxel_size_scales_lengths() -> None:
    loose = hanging(frame(), 5)
    small, large = (prune(Volume(loose, size, "µm")) for size in (1.0, 20.0))
    np.testing.assert_array_equal(small.solid, large.solid)
    first: tuple[Edit, Edit] = (small.edits[0], large.edits[0])
    assert first[1].length == pytest.approx(20 * (first[0].length or 0))
    assert first[1].perimeter == pytest.approx(20 * (first[0].perimeter or 0))


def test_the_result_does_not_depend_on_threads() -> None:
    volume = exemplars.foam((48, 48, 48), seed=2)
    one, two = (prune(volume, threads=n) for n in (1, 2))
    np.testing.assert_array_equal(one.volume.array, two.volume.array)
    assert one.edits == two.edits


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    fraction=st.floats(0.1, 0.6),
    parts=st.sampled_from(["join", "remove", "keep"]),
)
def test_what_hung_together_still_does(seed: int, fraction: float, parts: Any) -> None:
    noise = ndimage.gaussian_filter(np.random.default_rng(seed).random((28, 30, 32)), 1.5)
    solid = noise > np.quantile(noise, 1 - fraction)
    found = prune(solid, parts=parts, porosity_tolerance=1)
    assert found.after.components <= found.before.components
    assert found.before.closed_pores == len(closed_pores(solid)[1])
    # No component of the result joins less of an old one: each old part lies in one new part,
    # as far as it is still there.
    if parts != "remove":
        old, new = label(solid).labels, label(found.solid).labels
        both = (old > 0) & (new > 0)
        pairs = np.unique(np.stack([old[both], new[both]]), axis=1)
        assert len(pairs[0]) == len(np.unique(pairs[0]))
    changed = int((found.solid != solid).sum())
    assert changed == 0 or found.edits
    assert abs(found.after.porosity - found.before.porosity) <= 1e-9 or found.solid.sum() < 60


@given(
    st.lists(st.tuples(st.integers(0, 6), st.integers(0, 6), st.integers(0, 5)), max_size=12),
)
def test_cell_perimeters_are_shortest_loops(branches: list[tuple[int, int, int]]) -> None:
    ends = np.array([b[:2] for b in branches], np.uint32).reshape(-1, 2)
    lengths = np.array([b[2] for b in branches], float)
    found = _core.cell_perimeters(7, ends, lengths, np.arange(7, dtype=np.uint32))
    expected = [cells.perimeter([b[:2] for b in branches], lengths.tolist(), n) for n in range(7)]
    np.testing.assert_array_equal(found, expected)


def test_repainted_values_keep_their_side_and_their_noise() -> None:
    rng = np.random.default_rng(5)
    before = ndimage.gaussian_filter(rng.random((40, 40, 40)), 3)
    before = before > np.median(before)
    after = ndimage.binary_erosion(before)
    blurred = ndimage.gaussian_filter(before.astype(float), 0.7)
    array = np.clip(60 + 100 * blurred + rng.normal(0, 5, before.shape), 0, 255).astype(np.uint8)
    level = 110
    solid = array > level
    painted = repaint(array, solid, after, gray=True)
    # Layers of one phase keep its values, but for the few voxels that noise took over the cut.
    assert np.mean((painted > level) == after) > 0.999
    far = np.abs(ndimage.distance_transform_edt(~after)) > 6
    np.testing.assert_allclose(painted[far].std(), array[far].std(), rtol=0.2)
    np.testing.assert_array_equal(repaint(array, solid, solid, gray=True), array)


@given(st.integers(0, 10**6))
def test_rotations_turn_one_direction_into_the_other(seed: int) -> None:
    a, b = np.random.default_rng(seed).normal(size=(2, 3))
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    turn = _rotation(a, b)
    np.testing.assert_allclose(b @ turn, a, atol=1e-6)
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-5)


def test_a_real_foam_loses_its_loose_ends() -> None:
    volume = exemplars.foam((64, 64, 64), seed=4)
    array = np.array(volume.array)
    rng = np.random.default_rng(1)
    # Specks and stubs, as a synthesis may leave them.
    spots = rng.integers(8, 56, (30, 3))
    for z, y, x in spots:
        array[z : z + 2, y : y + 2, x] = 255
    rough = volume.with_array(array)
    found = prune(rough, exemplar=volume, target="exemplar")
    assert found.after.components == 1
    assert found.before.components > 5
    assert found.after.porosity == pytest.approx(found.before.porosity, abs=1e-9)
    assert found.after.end_points <= found.before.end_points


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6), fraction=st.floats(0.15, 0.7))
def test_branches_go_as_the_plain_method_takes_them(seed: int, fraction: float) -> None:
    rng = np.random.default_rng(seed)
    noise = ndimage.gaussian_filter(rng.random((12, 11, 13)), 1.2)
    phase = noise > np.quantile(noise, 1 - fraction)
    solid = np.argwhere(phase)
    places = solid[rng.permutation(len(solid))[:20]].astype(np.uint32)
    radii = rng.choice([1.0, 1.5, 2.0, 3.0], len(places)).astype(np.float32)
    branches = np.sort(rng.integers(-1, 3, len(places)))
    branches = np.unique(branches, return_inverse=True)[1] - int(branches.min(initial=0) < 0)
    found, lost = _core.remove_branches(phase, places, radii, branches, manner="prune")
    expected, wanted = plain.prune(phase, places.astype(int), radii, branches)
    np.testing.assert_array_equal(found, expected)
    assert lost.tolist() == wanted
