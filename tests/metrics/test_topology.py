"""Euler number, connectivity and Betti numbers against cells, libraries and known shapes."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from skimage import measure
from tests.metrics import shapes
from tests.metrics.strategies import ORDERS, TYPES, boundaries, phases
from tests.references import topology as twin

from poresynth import metrics
from poresynth.errors import ParameterError
from poresynth.volume import Volume

pairs = st.sampled_from([26, 6])


def turned(solid: np.ndarray) -> list[np.ndarray]:
    """The same shape in other positions."""
    return [
        *(np.rot90(solid, axes=axes) for axes in [(0, 1), (0, 2), (1, 2)]),
        *(np.flip(solid, axis) for axis in range(3)),
        solid.transpose(2, 0, 1),
    ]


# b0, b1 and b2 of both connectivities, 26 and 6.
KNOWN: dict[str, tuple[np.ndarray, tuple[int, int, int], tuple[int, int, int]]] = {
    "voxel": (shapes.voxel(), (1, 0, 0), (1, 0, 0)),
    "cube": (shapes.cube(), (1, 0, 0), (1, 0, 0)),
    "hollow cube": (shapes.hollow_cube(), (1, 0, 1), (1, 0, 1)),
    "torus": (shapes.torus(), (1, 1, 0), (1, 1, 0)),
    "cube with 3 through tunnels": (shapes.tunnelled_cube(), (1, 3, 0), (1, 3, 0)),
    "box frame": (shapes.box_frame(), (1, 5, 0), (1, 5, 0)),
    "rod lattice": (shapes.rod_lattice(), (1, 176, 0), (1, 176, 0)),
    "pair at a face": (shapes.pair((0, 0, 1)), (1, 0, 0), (1, 0, 0)),
    "pair at an edge": (shapes.pair((0, 1, 1)), (1, 0, 0), (2, 0, 0)),
    "pair at a corner": (shapes.pair((1, 1, 1)), (1, 0, 0), (2, 0, 0)),
}


@pytest.mark.parametrize(("solid", "b26", "b6"), KNOWN.values(), ids=KNOWN)
def test_known_shapes(solid: np.ndarray, b26: tuple[int, ...], b6: tuple[int, ...]) -> None:
    for connectivity, expected in ((26, b26), (6, b6)):
        found = metrics.betti_numbers(solid, connectivity=connectivity)
        assert (found.b0, found.b1, found.b2) == expected
        euler = expected[0] - expected[1] + expected[2]
        assert metrics.euler_number(solid, connectivity=connectivity) == euler
        # Nothing touches the border: no correction, and periodic is the same.
        corrected = metrics.connectivity_density(solid, connectivity=connectivity)
        assert corrected.edge_corrected == corrected.euler_number == euler
        periodic = metrics.euler_number(solid, connectivity=connectivity, boundary="periodic")
        assert periodic == euler


def test_known_euler_numbers() -> None:
    names = ["voxel", "cube", "hollow cube", "torus", "cube with 3 through tunnels"]
    euler = [metrics.euler_number(KNOWN[name][0]) for name in [*names, "box frame", "rod lattice"]]
    assert euler == [1, 1, 2, 0, -2, -4, 125 - 300]


@given(phases, pairs, boundaries, st.sampled_from(list(ORDERS)), st.sampled_from([1, 2, 8]))
def test_cells_are_counted(
    solid: np.ndarray, connectivity: int, boundary: str, order: str, threads: int
) -> None:
    found = metrics.euler_number(
        ORDERS[order](solid), connectivity=connectivity, boundary=boundary, threads=threads
    )
    assert found == twin.euler_number(solid, connectivity, boundary)


@pytest.mark.parametrize("shape", [(5, 6, 63), (40, 3, 64), (33, 4, 65), (3, 4, 200), (70, 1, 1)])
def test_rows_of_several_words(shape: tuple[int, int, int], rng: np.random.Generator) -> None:
    for fraction in (0.1, 0.5, 0.9, 1.0):
        solid = rng.random(shape) < fraction
        for connectivity in (26, 6):
            for boundary in ("open", "periodic"):
                options = {"connectivity": connectivity, "boundary": boundary}
                expected = twin.euler_number(solid, connectivity, boundary)
                for array in (solid, np.asfortranarray(solid), solid[:, ::-1], solid[::-1]):
                    for threads in (1, 2, 8):
                        found = metrics.euler_number(array, **options, threads=threads)
                        assert found == expected


@given(phases)
def test_agrees_with_scikit_image(solid: np.ndarray) -> None:
    assert metrics.euler_number(solid) == measure.euler_number(solid, connectivity=3)
    assert metrics.euler_number(solid, connectivity=6) == measure.euler_number(solid, 1)


@given(phases, pairs)
def test_position_and_padding_do_not_matter(solid: np.ndarray, connectivity: int) -> None:
    betti = metrics.betti_numbers(solid, connectivity=connectivity)
    corrected = metrics.connectivity_density(solid, connectivity=connectivity)
    for other in turned(solid):
        assert metrics.betti_numbers(other, connectivity=connectivity) == betti
        assert metrics.connectivity_density(other, connectivity=connectivity) == corrected
    padded = np.pad(solid, 1)
    assert metrics.betti_numbers(padded, connectivity=connectivity) == betti
    # With nothing at the border there is nothing to correct.
    loose = metrics.connectivity_density(padded, connectivity=connectivity)
    assert loose.edge_corrected == corrected.euler_number
    for side in [(1, 0), (0, 1)]:
        grown = np.pad(solid, [side] * 3)
        assert metrics.euler_number(grown, connectivity=connectivity) == corrected.euler_number


@given(phases, pairs, st.tuples(*[st.integers(0, 9)] * 3))
def test_a_periodic_volume_may_be_rolled(
    solid: np.ndarray, connectivity: int, shift: tuple[int, int, int]
) -> None:
    options = {"connectivity": connectivity, "boundary": "periodic"}
    expected = metrics.euler_number(solid, **options)
    assert metrics.euler_number(np.roll(solid, shift, axis=(0, 1, 2)), **options) == expected
    assert metrics.euler_number(np.tile(solid, (2, 1, 1)), **options) == 2 * expected
    for other in turned(solid):
        assert metrics.euler_number(other, **options) == expected


@given(phases, pairs)
def test_the_complement_has_the_dual_numbers(solid: np.ndarray, connectivity: int) -> None:
    # Alexander duality, with a complement that is one more component.
    dual = 32 - connectivity
    rest = ~np.pad(solid, 1)
    euler = metrics.euler_number(solid, connectivity=connectivity)
    assert metrics.euler_number(rest, connectivity=dual) == euler + 1
    ours = metrics.betti_numbers(solid, connectivity=connectivity)
    theirs = metrics.betti_numbers(rest, connectivity=dual)
    assert (theirs.b0, theirs.b1, theirs.b2) == (ours.b2 + 1, ours.b1, ours.b0)
    options = {"boundary": "periodic"}
    periodic = metrics.euler_number(solid, connectivity=connectivity, **options)
    assert metrics.euler_number(~solid, connectivity=dual, **options) == periodic


@given(phases, pairs, st.integers(0, 2), st.integers(0, 8))
def test_parts_that_share_a_plane_add_up(
    solid: np.ndarray, connectivity: int, axis: int, cut: int
) -> None:
    turned = np.moveaxis(solid, axis, 0)
    cut = min(cut, len(turned) - 1)
    both, plane = [turned[: cut + 1], turned[cut:]], turned[cut : cut + 1]
    first, second, shared = (
        metrics.euler_number(part, connectivity=connectivity) for part in (*both, plane)
    )
    assert metrics.euler_number(solid, connectivity=connectivity) == first + second - shared
    whole, *halves = (
        metrics.connectivity_density(part, connectivity=connectivity).edge_corrected
        for part in (turned, *both)
    )
    assert whole == sum(halves)


@given(phases, pairs)
def test_edge_correction_weights_cells(solid: np.ndarray, connectivity: int) -> None:
    found = metrics.connectivity_density(solid, connectivity=connectivity)
    assert found.edge_corrected == twin.edge_corrected(solid, connectivity)
    assert found.connectivity == 1 - found.edge_corrected
    assert found.euler_number == metrics.euler_number(solid, connectivity=connectivity)


@pytest.mark.parametrize("connectivity", [26, 6])
def test_corrected_numbers_of_tiles_add_up(connectivity: int, rng: np.random.Generator) -> None:
    # Tiles share their border planes; the last of an axis shares the volume's first plane.
    solid = rng.random((12, 9, 10)) < 0.4
    cuts = [[0, 5, 7, 12], [0, 4, 9], [0, 1, 6, 10]]
    spans = [
        [np.arange(a, b + 1) % n for a, b in itertools.pairwise(ends)]
        for ends, n in zip(cuts, solid.shape, strict=True)
    ]
    total = sum(
        metrics.connectivity_density(solid[np.ix_(*span)], connectivity=connectivity).edge_corrected
        for span in itertools.product(*spans)
    )
    assert total == metrics.euler_number(solid, connectivity=connectivity, boundary="periodic")
    assert total == twin.euler_number(solid, connectivity, "periodic")


@pytest.mark.parametrize("connectivity", [26, 6])
def test_windows_have_the_density_of_the_whole(connectivity: int, rng: np.random.Generator) -> None:
    solid = rng.random((6, 7, 8)) < 0.4
    options = {"connectivity": connectivity, "voxel_size": (1.0, 2.0, 3.0)}
    windows = [
        metrics.euler_density(np.roll(solid, shift, axis=(0, 1, 2))[:4, :3, :5], **options).density
        for shift in np.ndindex(solid.shape)
    ]
    whole = metrics.euler_density(solid, **options, boundary="periodic")
    assert np.mean(windows) == pytest.approx(whole.density, rel=1e-12)
    assert whole.density == whole.euler / (solid.size * 6)


def test_a_full_block_is_no_end_of_a_body() -> None:
    # BoneJ's own test: the correction of a full cube is 1, so that Δχ = 0.
    found = metrics.connectivity_density(np.ones((3, 3, 3), bool))
    assert (found.euler_number, found.edge_corrected, found.connectivity) == (1, 0, 1)


def test_rods_from_face_to_face_connect() -> None:
    # A cross of three rods is the node of an endless lattice: χ = 1 node − 3 rods.
    solid = np.zeros((5, 5, 5), bool)
    solid[2, 2, :] = solid[2, :, 2] = solid[:, 2, 2] = True
    found = metrics.connectivity_density(Volume(solid, (2.0, 2.0, 1.0), "mm"))
    assert (found.euler_number, found.edge_corrected, found.connectivity) == (1, -2, 3)
    assert (found.volume, found.unit) == (500, "mm")
    assert found.density == 3 / 500
    assert metrics.euler_number(solid, boundary="periodic") == -2
    assert metrics.euler_density(solid).density == -2 / 4**3


def test_quantimpy_is_wrong_about_borders_and_chains() -> None:
    # quantimpy 0.2.6 counts octants of 6-connected voxels, inside the array only: a voxel in a
    # corner of the array is an eighth of an object to it. That is the Δχ of a sample, not χ. A
    # chain of voxels, each at a face of the next, is one piece without a hole by any definition.
    corner, chain, ring = (np.zeros((6, 6, 6), bool) for _ in range(3))
    corner[0, 0, 0] = True
    chain[2:4, 2:4, 2:4] = [[[1, 0], [1, 1]], [[1, 1], [0, 0]]]
    ring[2:4, 2:4, 2:4] = [[[0, 1], [1, 1]], [[1, 1], [1, 0]]]
    solids = [corner, shapes.pair((1, 1, 1)), chain, ring]
    ours = [metrics.euler_number(solid, connectivity=6) for solid in solids]
    assert ours == [1, 2, 1, 0]
    assert ours == [measure.euler_number(solid, connectivity=1) for solid in solids]
    assert metrics.connectivity_density(corner).edge_corrected == 1 / 8
    try:
        from quantimpy import minkowski
    except (ImportError, ValueError):
        return  # Missing, or built for an older NumPy.
    theirs = [minkowski.functionals(solid)[3] * 4 * np.pi / 3 for solid in solids]
    assert theirs == pytest.approx([1 / 8, 2, 25 / 24, 1 / 4])


def test_no_voxel_and_all_voxels() -> None:
    empty, full = np.zeros((3, 4, 5), bool), np.ones((3, 4, 5), bool)
    for connectivity in (26, 6):
        options = {"connectivity": connectivity}
        assert metrics.euler_number(empty, **options) == 0
        assert metrics.euler_number(full, **options) == 1
        assert metrics.euler_number(full, boundary="periodic", **options) == 0
        assert metrics.betti_numbers(empty, **options) == metrics.BettiNumbers(0, 0, 0)
        assert metrics.betti_numbers(full, **options) == metrics.BettiNumbers(1, 0, 0)
        assert metrics.connectivity_density(empty, **options).connectivity == 1
    assert np.isnan(metrics.euler_density(np.ones((1, 5, 5), bool)).density)


@pytest.mark.parametrize("dtype", [t for t in TYPES if "float" not in t])
def test_every_type_and_phase(dtype: str, rng: np.random.Generator) -> None:
    solid = rng.random((5, 6, 7)) < 0.4
    expected = metrics.betti_numbers(solid)
    assert metrics.betti_numbers((solid * 1).astype(dtype)) == expected
    if dtype != "bool":
        labels = (solid * 3 + 1).astype(dtype)
        assert metrics.betti_numbers(labels, phase=4) == expected
        assert metrics.euler_number(labels, phase=4) == metrics.euler_number(solid)
        found = metrics.connectivity_density(labels, phase=4)
        assert found == metrics.connectivity_density(solid)
        assert metrics.euler_density(labels, phase=4) == metrics.euler_density(solid)


FUNCTIONS = [
    metrics.euler_number,
    metrics.betti_numbers,
    metrics.connectivity_density,
    metrics.euler_density,
]


@pytest.mark.parametrize("function", FUNCTIONS)
def test_bad_parameters_are_named(function: Callable[..., object]) -> None:
    solid = np.ones((2, 2, 2), bool)
    with pytest.raises(ParameterError, match=r"^connectivity = 18: must be 6 or 26"):
        function(solid, connectivity=18)
    with pytest.raises(ParameterError, match=r"^solid = array of shape \(2, 2\)"):
        function(solid[0])
    with pytest.raises(ParameterError, match=r"^phase = 3"):
        function(solid, phase=3)


@pytest.mark.parametrize("function", [metrics.euler_number, metrics.euler_density])
def test_a_bad_boundary_is_named(function: Callable[..., object]) -> None:
    with pytest.raises(ParameterError, match=r"^boundary = .mirror.: must be "):
        function(np.ones((2, 2, 2), bool), boundary="mirror")
