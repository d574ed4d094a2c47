"""Bodies and domains: what is repaired and said, what is refused, and where a part then lies."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from poresynth import io, meshes
from poresynth.errors import FileError, ParameterError
from poresynth.meshes import Mesh, check
from poresynth.shapes import check_room, closed_body, figure, read_body, read_domain, shell
from poresynth.volume import Volume


def box(size: float = 10.0, unit: str = "mm") -> Mesh:
    whole = trimesh.creation.box((size, 2 * size, 3 * size))
    return Mesh(np.array(whole.vertices) + 100, np.array(whole.faces, np.int32), unit)


# Bodies


def test_a_sound_body_is_left_alone() -> None:
    mesh = box()
    body = closed_body(mesh)
    assert body.mesh is mesh
    assert body.repairs == ()


def test_inverted_normals_are_turned_and_said() -> None:
    mesh = box()
    body = closed_body(Mesh(mesh.vertices, mesh.faces[:, ::-1], "mm"))
    assert check(body.mesh).volume == pytest.approx(6000)
    assert body.repairs == ("the body was inside out (inverted normals) and was turned",)


def test_single_triangles_are_turned_and_said() -> None:
    faces = box().faces.copy()
    faces[[3, 7]] = faces[[3, 7], ::-1]
    body = closed_body(Mesh(box().vertices, faces, "mm"))
    assert check(body.mesh).printable
    assert body.repairs[0] == "2 triangles that looked to the other side were turned"


def test_a_small_hole_is_closed_and_said() -> None:
    body = closed_body(Mesh(box().vertices, box().faces[1:], "mm"))
    assert check(body.mesh).printable
    assert check(body.mesh).volume == pytest.approx(6000)
    assert body.repairs == ("holes along 3 open edges were closed",)


def test_a_large_hole_is_refused_with_its_number_of_edges() -> None:
    ball = trimesh.creation.icosphere(subdivisions=3)
    low = np.array(ball.triangles_center)[:, 2] < 0.8
    mesh = Mesh(np.array(ball.vertices), np.array(ball.faces[low], np.int32))
    open_edges = check(mesh).open_edges
    assert open_edges > 4
    with pytest.raises(ParameterError, match=f"ball.stl = .* at {open_edges} open edges"):
        closed_body(mesh, "ball.stl")


def test_a_sheet_has_no_volume() -> None:
    sheet = Mesh(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]]), np.array([[0, 1, 2], [0, 2, 1]]))
    with pytest.raises(ParameterError, match="must be positive"):
        closed_body(sheet)


def test_a_moebius_band_has_no_inside() -> None:
    """A closed surface without sides: a Klein bottle of squares."""
    n = 8
    index = np.arange(n * n).reshape(n, n)
    right = np.roll(index, -1, axis=1)
    down = np.concatenate([index[1:], index[:1, ::-1]])
    diagonal = np.roll(down, -1, axis=1)
    diagonal[-1] = np.roll(index[0, ::-1], -1)
    faces = np.concatenate(
        [np.stack([index, right, diagonal], -1), np.stack([index, diagonal, down], -1)]
    ).reshape(-1, 3)
    points = np.random.default_rng(1).random((n * n, 3))
    with pytest.raises(ParameterError, match=r"must have an inside|must be closed"):
        closed_body(Mesh(points, faces.astype(np.int32)))


@pytest.mark.parametrize("suffix", [".stl", ".3mf", ".ply", ".obj"])
def test_bodies_are_read_from_every_format(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"body{suffix}"
    meshes.write(path, box())
    body = read_body(path, unit="mm")
    assert body.mesh.unit == "mm"
    assert check(body.mesh).volume == pytest.approx(6000)


# Domains


@pytest.fixture
def stl(tmp_path: Path) -> Path:
    path = tmp_path / "body.stl"
    meshes.write(path, box())
    return path


def test_a_domain_lies_where_the_body_is(stl: Path) -> None:
    domain = read_domain(stl, voxel_size=500.0, unit="µm", body_unit="mm", margin=2)
    assert domain.mask.shape == (64, 44, 24)
    assert domain.mask.unit == "µm"
    assert domain.mask.array.sum() == 60 * 40 * 20
    assert domain.mask.array[2:-2, 2:-2, 2:-2].all()
    assert domain.origin == pytest.approx((85e3 - 1000, 90e3 - 1000, 95e3 - 1000))
    assert domain.to_dict()["voxels"] == 48000


def test_voxels_that_do_not_fit_are_shared_by_both_sides(stl: Path) -> None:
    domain = read_domain(stl, voxel_size=(0.7, 0.7, 0.7), unit="mm", body_unit="mm", margin=0)
    assert domain.mask.shape == (43, 29, 15)
    middle = np.array(domain.origin) + 0.35 * np.array(domain.mask.shape)
    assert middle == pytest.approx([100, 100, 100])


def test_without_units_a_unit_of_the_mesh_is_a_voxel(stl: Path) -> None:
    assert read_domain(stl, margin=0).mask.shape == (30, 20, 10)


def test_a_missing_unit_is_asked_for(stl: Path) -> None:
    with pytest.raises(ParameterError, match=r"a voxel is 19.5 µm; name it, one of nm, µm, mm"):
        read_domain(stl, voxel_size=19.5, unit="µm")
    with pytest.raises(ParameterError, match="size of a voxel must be known"):
        read_domain(stl, body_unit="mm")


def test_3mf_knows_its_unit(tmp_path: Path) -> None:
    meshes.write(tmp_path / "body.3mf", box())
    domain = read_domain(tmp_path / "body.3mf", voxel_size=1000, unit="µm", margin=0)
    assert domain.mask.shape == (30, 20, 10)


def test_wrong_units_are_suspected(stl: Path) -> None:
    with pytest.raises(ParameterError, match="10 × 20 × 30 µm: must be at least 4 voxels"):
        read_domain(stl, voxel_size=20, unit="µm", body_unit="µm")
    with pytest.raises(ParameterError, match="is its unit right"):
        read_domain(stl, voxel_size=1.0, unit="µm", body_unit="m")


def test_repairs_become_notes(tmp_path: Path) -> None:
    mesh = box()
    meshes.write(tmp_path / "turned.stl", Mesh(mesh.vertices, mesh.faces[:, ::-1]))
    domain = read_domain(tmp_path / "turned.stl", margin=0)
    assert domain.mask.array.all()
    assert "inverted normals" in domain.notes[0]


def test_masks_are_domains_too(tmp_path: Path, rng: np.random.Generator) -> None:
    mask = rng.random((6, 7, 8)) < 0.5
    io.write(tmp_path / "mask.npy", mask.astype(np.uint8) * 3)
    domain = read_domain(tmp_path / "mask.npy", voxel_size=(2, 1, 1), unit="mm")
    np.testing.assert_array_equal(domain.mask.array, mask)
    assert (domain.mask.voxel_size, domain.mask.unit) == ((2, 1, 1), "mm")
    io.write(tmp_path / "mask.tif", Volume(mask, 5.0, "µm"))
    domain = read_domain(tmp_path / "mask.tif", voxel_size=1, unit="mm")
    assert (domain.mask.voxel_size, domain.mask.unit) == ((5, 5, 5), "µm")
    io.write(tmp_path / "empty.npy", np.zeros((3, 3, 3)))
    with pytest.raises(ParameterError, match="must not be 0 everywhere"):
        read_domain(tmp_path / "empty.npy")
    with pytest.raises(FileError, match="no such file"):
        read_domain(tmp_path / "none.npy")


def test_a_body_needs_room_for_the_features_of_a_material() -> None:
    ball = np.sum((np.mgrid[:24, :24, :24] - 11.5) ** 2, axis=0) < 10**2
    mask = Volume(ball, 2.0, "µm")
    assert check_room(mask, 30) == pytest.approx(40, abs=4)
    with pytest.raises(ParameterError, match=r"thick: must be wider than .*exemplar, 50 µm"):
        check_room(mask, 50)


# Shells


@pytest.mark.parametrize("layers", [1, 2, 4])
def test_a_shell_of_a_box_has_as_many_layers(layers: int) -> None:
    found = shell(Volume(np.ones((12, 10, 14), bool), 0.5, "mm"), 0.5 * layers)
    inner = (12 - 2 * layers) * (10 - 2 * layers) * (14 - 2 * layers)
    assert found.sum() == 12 * 10 * 14 - inner
    assert not found[6, 5, 7]


def test_a_shell_of_a_ball_is_as_thick_everywhere() -> None:
    radius = np.sqrt(np.sum((np.mgrid[:48, :48, :48] - 23.5) ** 2, axis=0))
    found = shell(radius < 20, 5)
    assert found[(radius < 19.9) & (radius > 15.9)].all()
    assert not found[(radius > 20) | (radius < 14.0)].any()


def test_a_shell_in_voxels_that_are_no_cubes() -> None:
    found = shell(Volume(np.ones((20, 20, 20), bool), (1.0, 0.5, 2.0)), 2.0)
    assert found[:2].all()
    assert found[:, :4].all()
    assert found[:, :, :1].all()
    assert not found[5:-5, 6:-6, 3:-3].any()


@pytest.mark.parametrize("thickness", [0.0, 0.2, np.nan])
def test_a_shell_thinner_than_half_a_voxel_is_refused(thickness: float) -> None:
    with pytest.raises(ParameterError, match="shell"):
        shell(np.ones((4, 4, 4), bool), thickness)


# The figure


def test_the_figure_is_one_closed_body_of_its_height() -> None:
    mesh = figure(25.0, resolution=48)
    report = check(mesh)
    assert report.printable
    assert (report.shells, report.euler_characteristic) == (1, 2)
    assert report.size[2] == pytest.approx(25)
    assert mesh.bounds[0, 2] == 0
    assert mesh.unit == "mm"
    np.testing.assert_array_equal(mesh.vertices, figure(25.0, resolution=48).vertices)


def test_the_figure_is_alike_on_both_sides() -> None:
    mesh = figure(resolution=48)
    assert mesh.bounds[:, 1] == pytest.approx([-mesh.bounds[1, 1], mesh.bounds[1, 1]], abs=1e-3)


def test_bad_figures() -> None:
    with pytest.raises(ParameterError, match="height"):
        figure(0)
    with pytest.raises(ParameterError, match="resolution"):
        figure(resolution=8)
