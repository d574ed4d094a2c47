"""The graph of a skeleton against known shapes, skan and networkx."""

from __future__ import annotations

import sys
import warnings

import networkx
import numpy as np
import pandas
import pytest
import skan
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage
from skimage import measure
from tests.metrics.strategies import ORDERS, phases

from poresynth import metrics
from poresynth.errors import MissingExtraError, ParameterError
from poresynth.volume import Volume

CORNERS = np.ones((3, 3, 3))


def box_frame(edge: int, thickness: int) -> np.ndarray:
    """The twelve edges of a cube."""
    rim = np.zeros(edge, bool)
    rim[:thickness] = rim[-thickness:] = True
    z, y, x = rim[:, None, None], rim[:, None], rim
    return np.pad(z & y | y & x | z & x, 2)


def rod_lattice(nodes: int, pitch: int) -> np.ndarray:
    """Struts of 3 × 3 voxels between the points of a cubic grid."""
    edge = pitch * (nodes - 1) + 3
    on = np.arange(edge) % pitch < 3
    z, y, x = on[:, None, None], on[:, None], on
    return np.pad(z & y | y & x | z & x, 2)


def smooth(edge: int, sigma: float) -> np.ndarray:
    noise = np.random.default_rng(0).standard_normal((edge,) * 3)
    return ndimage.gaussian_filter(noise, sigma) > 0


def skan_table(skeleton: np.ndarray, spacing: object = 1) -> pandas.DataFrame:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # skan's own, of pandas
        return skan.summarize(skan.Skeleton(skeleton, spacing=spacing), separator="-")


def polyline(*corners: tuple[int, int, int]) -> np.ndarray:
    """Voxels on straight or diagonal ways between corners, in a volume of 24³."""
    volume = np.zeros((24, 24, 24), bool)
    for a, b in zip(np.array(corners[:-1]), np.array(corners[1:]), strict=True):
        steps = int(np.abs(b - a).max())
        for i in range(steps + 1):
            volume[tuple(a + (b - a) * i // steps)] = True
    return volume


def test_a_box_frame_has_eight_nodes_and_twelve_branches() -> None:
    for thickness in (3, 4):
        solid = box_frame(20, thickness)
        graph = metrics.skeleton_graph(metrics.skeletonize(solid), solid=solid)
        assert measure.euler_number(solid, connectivity=3) == -4
        assert graph.nodes.kind.tolist() == ["junction"] * 8
        assert graph.nodes.degree.tolist() == [3] * 8
        assert graph.branches.type.tolist() == [2] * 12
        assert (graph.loops, graph.components, graph.end_points, graph.junctions) == (5, 1, 0, 8)
        assert np.abs(graph.branches.euclidean - (20 - thickness)).max() < 2
        assert graph.branches.tortuosity.min() >= 1
        assert graph.branches.tortuosity.max() < 1.2


def test_a_rod_lattice() -> None:
    solid = rod_lattice(5, 8)
    graph = metrics.skeleton_graph(metrics.skeletonize(solid), solid=solid)
    assert len(graph.branches.nodes) == 300
    assert (graph.junctions, graph.end_points, graph.components) == (125, 0, 1)
    assert graph.loops == 1 + 300 - 125 == 1 - measure.euler_number(solid, connectivity=3)
    # Straight branches along the axis of the struts, 3 voxels thick.
    assert np.median(graph.branches.length) == pytest.approx(8, abs=0.3)
    assert np.median(graph.branches.thickness) == 3


def test_a_bar_is_one_branch() -> None:
    solid = np.pad(np.ones((5, 5, 30), bool), 2)
    graph = metrics.skeleton_graph(metrics.skeletonize(solid), solid=solid)
    assert graph.branches.type.tolist() == [0]
    assert graph.nodes.kind.tolist() == ["end", "end"]
    assert graph.branches.length == graph.branches.euclidean == len(graph.branches.voxels) - 1
    assert graph.branches.thickness[0] == pytest.approx(5)
    assert graph.branches.thickness_deviation[0] == pytest.approx(0)
    assert graph.end_point_density == 2 / solid.size


def test_thickness_of_a_volume_is_in_its_unit() -> None:
    solid = np.pad(np.ones((5, 5, 30), bool), 2)
    skeleton = metrics.skeletonize(solid)
    volume = Volume(solid, voxel_size=0.5, unit="mm")
    graph = metrics.skeleton_graph(skeleton, solid=volume)
    assert graph.unit == "mm"
    assert graph.branches.thickness[0] == pytest.approx(2.5)
    assert graph.branches.length[0] == (np.count_nonzero(skeleton) - 1) / 2
    again = metrics.skeleton_graph(skeleton, solid=solid.astype(int) + 1, phase=2, voxel_size=0.5)
    assert again.branches.thickness[0] == pytest.approx(2.5)
    full = np.ones((3, 3, 9), bool)
    graph = metrics.skeleton_graph(metrics.skeletonize(full), solid=full)
    assert np.isinf(graph.branches.thickness[0])


def test_any_map_is_averaged_along_the_branches() -> None:
    skeleton = polyline((2, 2, 2), (2, 2, 12))
    values = np.arange(24.0) * np.ones((24, 24, 24))
    for kind in (np.float32, np.int16):
        graph = metrics.skeleton_graph(skeleton, thickness=values.astype(kind))
        assert graph.branches.thickness.tolist() == [7]
        assert graph.branches.thickness_deviation[0] == pytest.approx(np.std(np.arange(2, 13)))
    assert np.isnan(metrics.skeleton_graph(skeleton).branches.thickness[0])


def test_anisotropic_voxels() -> None:
    size = (3.0, 2.0, 1.0)
    for corner, length in [((12, 2, 2), 30), ((2, 12, 2), 20), ((12, 12, 12), 10 * 14**0.5)]:
        graph = metrics.skeleton_graph(polyline((2, 2, 2), corner), voxel_size=size)
        assert graph.branches.length[0] == pytest.approx(length)
        assert graph.branches.euclidean[0] == pytest.approx(length)
        table = graph.to_table()
        ends = {tuple(table[f"coord-{end}-{a}"][0] for a in range(3)) for end in ("src", "dst")}
        assert ends == {(6, 4, 2), tuple(np.multiply(corner, size))}


SINGLE_JUNCTIONS = {
    "line": polyline((2, 2, 2), (2, 2, 20)),
    "bent": polyline((2, 2, 2), (12, 12, 2), (12, 22, 12)),
    "two lines": polyline((2, 2, 2), (2, 2, 20)) | polyline((12, 2, 2), (22, 12, 12)),
    "star": polyline((4, 4, 4), (20, 20, 20))
    | polyline((20, 4, 4), (12, 12, 12))
    | polyline((4, 20, 4), (12, 12, 12)),
    "ring": polyline((2, 10, 4), (2, 4, 10), (2, 10, 16), (2, 16, 10), (2, 10, 4)),
}


@pytest.mark.parametrize("spacing", [1.0, (3.0, 2.0, 1.0)])
@pytest.mark.parametrize("name", SINGLE_JUNCTIONS)
def test_branches_are_those_of_skan_where_junctions_are_single_voxels(
    name: str, spacing: object
) -> None:
    skeleton = SINGLE_JUNCTIONS[name]
    expected = skan_table(skeleton, spacing)
    graph = metrics.skeleton_graph(skeleton, voxel_size=spacing)  # type: ignore[arg-type]
    found = pandas.DataFrame(graph.to_table())
    assert list(found.columns) == list(expected.columns)
    keys = ["branch-type", "branch-distance", "euclidean-distance"]
    order = [f[keys].round(9).sort_values(keys).reset_index(drop=True) for f in (found, expected)]
    pandas.testing.assert_frame_equal(*order, check_dtype=False)
    assert found["skeleton-id"].nunique() == expected["skeleton-id"].nunique()


def test_skan_adds_ends_to_thick_junctions() -> None:
    # A block of 2³ voxels with three arms: skan cuts its inner links to a tree, which has tips of
    # its own, and counts branches inside. One node with three arms is right.
    skeleton = np.zeros((24, 24, 24), bool)
    skeleton[10:12, 10:12, 10:12] = True
    skeleton[2:10, 10, 10] = skeleton[11, 12:20, 11] = skeleton[10, 11, 12:20] = True
    neighbours = ndimage.convolve(skeleton.astype(int), CORNERS, mode="constant") - 1
    graph = metrics.skeleton_graph(skeleton)
    assert graph.end_points == np.count_nonzero(skeleton & (neighbours == 1)) == 3
    assert (len(graph.branches.nodes), graph.junctions, graph.loops) == (3, 1, 0)
    assert len(skan_table(skeleton)) > 3


@pytest.mark.parametrize("sigma", [2, 3])
def test_loops_are_those_of_the_solid(sigma: float) -> None:
    solid = smooth(64, sigma)
    skeleton = metrics.skeletonize(solid)
    graph = metrics.skeleton_graph(skeleton)
    euler = measure.euler_number(np.pad(solid, 1), connectivity=3)
    components = ndimage.label(solid, CORNERS)[1]
    cavities = ndimage.label(~np.pad(solid, 1))[1] - 1
    assert graph.components == components
    assert graph.loops == components + cavities - euler
    # Every voxel is in one branch or one junction.
    assert len(np.unique(graph.branches.voxels, axis=0)) == len(graph.branches.voxels)
    nodes = graph.nodes.size[np.isin(graph.nodes.kind, ["junction", "isolated"])]
    assert len(graph.branches.voxels) + nodes.sum() == np.count_nonzero(skeleton)
    assert np.nanmin(graph.branches.tortuosity) >= 1 - 1e-12


@given(phases, st.sampled_from(list(ORDERS)))
def test_graph_of_any_phase(skeleton: np.ndarray, order: str) -> None:
    # Not only thin ones.
    graph = metrics.skeleton_graph(skeleton, threads=1)
    neighbours = ndimage.convolve(skeleton.astype(int), CORNERS, mode="constant") - 1
    assert graph.components == ndimage.label(skeleton, CORNERS)[1]
    assert graph.end_points == np.count_nonzero(skeleton & (neighbours == 1))
    assert np.count_nonzero(graph.nodes.kind == "isolated") == np.count_nonzero(
        skeleton & (neighbours == 0)
    )
    assert graph.nodes.degree.sum() == 2 * len(graph.branches.nodes)
    assert np.all(graph.nodes.degree[graph.nodes.kind == "end"] == 1)
    steps = [
        np.abs(np.diff(graph.path(i).astype(int), axis=0)) for i in range(len(graph.branches.nodes))
    ]
    assert all(step.max(initial=1) == 1 for step in steps)
    again = metrics.skeleton_graph(ORDERS[order](skeleton), threads=2)
    for part in ("nodes", "branches"):
        for name, values in vars(getattr(graph, part)).items():
            np.testing.assert_array_equal(getattr(getattr(again, part), name), values)


@given(phases, st.permutations(range(3)), st.tuples(*[st.booleans()] * 3))
def test_figures_do_not_depend_on_the_pose(
    skeleton: np.ndarray, axes: list[int], flips: tuple[bool, ...]
) -> None:
    turned = np.flip(skeleton.transpose(axes), [a for a in range(3) if flips[a]])
    turned = np.pad(turned, 1)
    a, b = (metrics.skeleton_graph(s) for s in (skeleton, turned))
    assert (a.loops, a.components, a.junctions) == (b.loops, b.components, b.junctions)
    np.testing.assert_array_equal(np.bincount(a.branches.type), np.bincount(b.branches.type))
    np.testing.assert_allclose(np.sort(a.branches.length), np.sort(b.branches.length))


def test_nothing_and_one_voxel() -> None:
    empty = metrics.skeleton_graph(np.zeros((3, 4, 5), bool), solid=np.zeros((3, 4, 5), bool))
    assert (empty.loops, empty.components, empty.end_points, empty.junctions) == (0, 0, 0, 0)
    assert empty.branches.voxels.shape == (0, 3)
    assert all(len(column) == 0 for column in empty.to_table().values())
    assert len(empty.to_networkx()) == 0
    one = metrics.skeleton_graph(np.ones((1, 1, 1), bool))
    assert one.nodes.kind.tolist() == ["isolated"]
    assert (one.loops, one.components, one.end_points) == (0, 1, 0)


def test_networkx_finds_the_same_loops_and_components() -> None:
    graph = metrics.skeleton_graph(metrics.skeletonize(smooth(48, 2)), voxel_size=2.0)
    found = graph.to_networkx()
    assert networkx.number_connected_components(found) == graph.components
    loops = found.number_of_edges() - found.number_of_nodes() + graph.components
    assert loops == graph.loops
    assert [found.degree(i) for i in range(len(found))] == graph.nodes.degree.tolist()
    lengths = {key: length for *_, key, length in found.edges(keys=True, data="length")}
    assert [lengths[i] for i in range(len(lengths))] == graph.branches.length.tolist()
    assert found.graph == {"unit": "voxel", "voxel_size": (2.0, 2.0, 2.0)}


def test_the_extra_is_named_where_networkx_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "networkx", None)
    graph = metrics.skeleton_graph(np.ones((1, 1, 3), bool))
    with pytest.raises(MissingExtraError, match=r"poresynth\[graph\]"):
        graph.to_networkx()


def test_bad_parameters_are_named() -> None:
    line = np.ones((1, 1, 3), bool)
    with pytest.raises(ParameterError, match=r"^thickness\.shape = .*: must be that of"):
        metrics.skeleton_graph(line, thickness=np.ones((1, 3)))
    with pytest.raises(ParameterError, match=r"^thickness = .*: must be numbers"):
        metrics.skeleton_graph(line, thickness=np.full(line.shape, "a"))
    with pytest.raises(ParameterError, match=r"^solid\.shape = .*: must be that of"):
        metrics.skeleton_graph(line, solid=np.ones((3, 3, 3), bool))
    with pytest.raises(ParameterError, match=r"^voxel_size = "):
        metrics.skeleton_graph(line, voxel_size=-1.0)
    with pytest.raises(ParameterError, match=r"^branch = 1: must be from 0 to 0"):
        metrics.skeleton_graph(line).path(1)
