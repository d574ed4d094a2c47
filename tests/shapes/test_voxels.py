"""Voxelisation: every centre on its right side, also where rays meet edges and vertices."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from tests.references.winding import winding_numbers

from poresynth.errors import ParameterError
from poresynth.meshes import Mesh, isosurface
from poresynth.shapes import voxelise


def mesh_of(whole: trimesh.Trimesh) -> Mesh:
    return Mesh(np.array(whole.vertices, float), np.array(whole.faces, np.int32))


def box(low: tuple[float, ...], high: tuple[float, ...]) -> Mesh:
    """Return a box between two corners (x, y, z)."""
    return mesh_of(trimesh.creation.box(bounds=[low, high]))


@settings(max_examples=60)
@given(
    hnp.arrays(np.float32, (4, 4, 4), elements=st.sampled_from([-1.0, -0.3, 0.4, 1.0])),
    st.sampled_from([1.0, 0.5, (0.7, 1.1, 0.4)]),
    st.sampled_from([(0.0, 0.0, 0.0), (-0.5, 0.25, -0.5), (0.1, -0.3, 0.2)]),
)
def test_any_mesh_against_solid_angles(
    field: np.ndarray, size: float | tuple[float, float, float], origin: tuple[float, float, float]
) -> None:
    """With vertices and edges right on rays wherever the grids agree."""
    mesh = isosurface(field)
    if not len(mesh.faces):
        return
    shape = (9, 8, 11)
    found = voxelise(mesh, shape, size, origin=origin)
    edges = np.broadcast_to(np.asarray(size), 3)
    index = np.argwhere(np.ones(shape, bool))
    centres = ((index + 0.5) * edges + origin)[:, ::-1]
    # A centre on the surface belongs to neither side.
    whole = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    near = np.abs(trimesh.proximity.closest_point_naive(whole, centres)[1]) > 1e-5
    wanted = winding_numbers(mesh.vertices[mesh.faces].astype(float), centres[near]) != 0
    np.testing.assert_array_equal(found[tuple(index[near].T)], wanted)


@pytest.mark.parametrize("low", [0.0, 0.25, 0.5, -3.0])
def test_a_box_has_as_many_voxels_as_its_volume(low: float) -> None:
    """Also with faces, edges and corners at centres of voxels."""
    found = voxelise(box((low, low, low), (low + 7, low + 5, low + 3)), (12, 12, 12), 1.0)
    start = max(int(np.ceil(low)), 0)
    wanted = np.zeros((12, 12, 12), bool)
    end = [int(np.ceil(low)) + n for n in (3, 5, 7)]
    wanted[start : end[0], start : end[1], start : end[2]] = True
    assert found.sum() == wanted.sum() == (np.array(end) - start).prod()


def test_halves_of_a_box_have_no_voxel_in_common_and_none_missing() -> None:
    left, right = box((1, 1, 1), (5.5, 8, 8)), box((5.5, 1, 1), (9, 8, 8))
    one, other = (voxelise(m, (10, 10, 10), 1.0) for m in (left, right))
    assert not (one & other).any()
    np.testing.assert_array_equal(one | other, voxelise(box((1, 1, 1), (9, 8, 8)), (10,) * 3, 1.0))


def test_a_ball_in_voxels_that_are_no_cubes() -> None:
    whole = trimesh.creation.icosphere(subdivisions=4, radius=9.0)
    size, shape = (1.0, 0.5, 0.75), (20, 40, 28)
    origin = tuple(-n * s / 2 for n, s in zip(shape, size, strict=True))
    found = voxelise(mesh_of(whole), shape, size, origin=(origin[0], origin[1], origin[2]))
    z, y, x = ((np.arange(n) + 0.5) * s + o for n, s, o in zip(shape, size, origin, strict=True))
    radius = np.sqrt(z[:, None, None] ** 2 + y[:, None] ** 2 + x**2)
    assert found[radius < 8.95].all()
    assert not found[radius > 9.0].any()
    assert found.sum() * np.prod(size) == pytest.approx(whole.volume, rel=0.005)


def test_overlapping_shells_unite_and_a_shell_turned_inwards_is_a_cavity() -> None:
    outer, inner = box((1, 1, 1), (9, 9, 9)), box((3, 3, 3), (7, 7, 7))

    def both(turned: bool) -> Mesh:
        faces = inner.faces[:, ::-1] if turned else inner.faces
        return Mesh(
            np.concatenate([outer.vertices, inner.vertices]),
            np.concatenate([outer.faces, faces + 8]),
        )

    assert voxelise(both(False), (10, 10, 10), 1.0).sum() == 8**3
    assert voxelise(both(True), (10, 10, 10), 1.0).sum() == 8**3 - 4**3


@pytest.mark.parametrize("shift", [(-4, 0, 0), (4, 0, 0), (0, -4, 0), (0, 0, 4)])
def test_what_lies_outside_the_grid_is_cut_off(shift: tuple[int, int, int]) -> None:
    low, high = np.array([2, 2, 2]) + shift, np.array([8, 8, 8]) + shift
    found = voxelise(box(tuple(low), tuple(high)), (10, 10, 10), 1.0)
    assert found.sum() == np.prod(np.minimum(high, 10) - np.maximum(low, 0))


def test_blocks_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = mesh_of(trimesh.creation.icosphere(subdivisions=2, radius=4.0))
    whole = voxelise(mesh, (9, 9, 9), 1.0, origin=(-4.4, -4.5, -4.6))
    monkeypatch.setattr("poresynth.shapes.voxels._BLOCK", 7)
    np.testing.assert_array_equal(voxelise(mesh, (9, 9, 9), 1.0, origin=(-4.4, -4.5, -4.6)), whole)


def test_an_open_mesh_and_a_huge_one_are_refused() -> None:
    mesh = box((1, 1, 1), (5, 5, 5))
    with pytest.raises(ParameterError, match="must be closed"):
        voxelise(Mesh(mesh.vertices, mesh.faces[2:]), (6, 6, 6), 1.0)
    with pytest.raises(ParameterError, match="is its unit right"):
        voxelise(mesh, (6, 6, 6), 1e-9)


def test_it_can_be_stopped() -> None:
    def stop(stage: str, share: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        voxelise(box((1, 1, 1), (5, 5, 5)), (6, 6, 6), 1.0, progress=stop)
