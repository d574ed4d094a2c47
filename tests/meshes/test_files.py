"""Files of meshes: what is written comes back, in every format."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from poresynth import meshes
from poresynth.errors import FileError, MissingExtraError, ParameterError
from poresynth.meshes import Mesh, check, isosurface
from poresynth.meshes.files import READABLE, SUFFIXES


@pytest.fixture
def mesh(rng: np.random.Generator) -> Mesh:
    """Return an odd shape that a border cuts, in millimetres, away from the origin."""
    return isosurface(
        rng.standard_normal((5, 6, 7)), voxel_size=(0.02, 0.03, 0.04), origin=(3, 4, 5), unit="mm"
    )


@pytest.mark.parametrize("suffix", READABLE)
def test_round_trip(suffix: str, mesh: Mesh, tmp_path: Path) -> None:
    path = tmp_path / f"part{suffix}"
    meshes.write(path, mesh)
    back = meshes.read(path)
    assert back.unit == ("mm" if suffix == ".3mf" else "voxel")
    before, after = check(mesh), check(back)
    assert (after.vertices, after.triangles) == (before.vertices, before.triangles)
    assert after.printable
    assert after.volume == pytest.approx(before.volume, rel=1e-5)
    np.testing.assert_allclose(back.bounds, mesh.bounds, rtol=1e-6)
    assert meshes.read(path, unit="um").unit == "µm"


def test_vtp_comes_back_in_pyvista(mesh: Mesh, tmp_path: Path) -> None:
    pyvista = pytest.importorskip("pyvista")
    meshes.write(tmp_path / "part.vtp", mesh)
    back = pyvista.read(tmp_path / "part.vtp")
    np.testing.assert_array_equal(back.points, mesh.vertices)
    np.testing.assert_array_equal(back.regular_faces, mesh.faces)


def test_3mf_is_in_millimetres(mesh: Mesh, tmp_path: Path) -> None:
    meshes.write(tmp_path / "part.3mf", mesh.in_unit("µm"))
    back = meshes.read(tmp_path / "part.3mf")
    np.testing.assert_allclose(back.bounds, mesh.bounds, rtol=1e-5)


def test_binary_stl_has_normals_and_says_its_unit(mesh: Mesh, tmp_path: Path) -> None:
    meshes.write(tmp_path / "part.stl", mesh)
    content = (tmp_path / "part.stl").read_bytes()
    assert len(content) == 84 + 50 * len(mesh.faces)
    assert content[:80].rstrip() == b"poresynth, lengths in mm"
    records = np.frombuffer(
        content, np.dtype([("n", "<f4", 3), ("p", "<f4", (3, 3)), ("a", "<u2")]), offset=84
    )
    wanted = np.cross(*np.moveaxis(records["p"][:, 1:] - records["p"][:, :1], 1, 0))
    wanted /= np.linalg.norm(wanted, axis=1, keepdims=True)
    np.testing.assert_allclose(records["n"], wanted, atol=1e-3)


def test_patches_become_solids_of_ascii_stl(tmp_path: Path) -> None:
    whole = isosurface(np.ones((2, 3, 4)))
    low = (whole.vertices[whole.faces][:, :, 2] == 0).all(axis=1)
    patched = Mesh(
        whole.vertices, whole.faces, patches=low.astype(np.uint8), patch_names=("walls", "inlet")
    )
    path = tmp_path / "pore.stl"
    meshes.write(path, patched)
    scene = trimesh.load_scene(path)
    assert set(scene.geometry) == {"walls", "inlet"}
    assert scene.geometry["inlet"].area == pytest.approx(12)
    assert check(meshes.read(path)).volume == pytest.approx(24)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_mesh_without_triangles_is_not_written(suffix: str, tmp_path: Path) -> None:
    empty = Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32))
    with pytest.raises(ParameterError, match="no triangles"):
        meshes.write(tmp_path / f"part{suffix}", empty)
    assert not list(tmp_path.iterdir())


def test_what_fails_leaves_nothing(
    mesh: Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(self: Path, data: bytes) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", broken)
    with pytest.raises(FileError, match="no room"):
        meshes.write(tmp_path / "part.ply", mesh)
    assert not list(tmp_path.iterdir())


def test_an_unknown_suffix(mesh: Mesh, tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"'\.step'; known are \.stl"):
        meshes.write(tmp_path / "part.step", mesh)
    with pytest.raises(FileError, match=r"'\.vtp'; known are \.stl"):
        meshes.read(tmp_path / "part.vtp")


def test_a_missing_library_is_named(
    mesh: Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r"poresynth\[mesh\]"):
        meshes.write(tmp_path / "part.3mf", mesh)
    with pytest.raises(MissingExtraError, match=r"poresynth\[view\]"):
        meshes.check_output(tmp_path / "part.vtp")
    meshes.write(tmp_path / "part.stl", mesh)  # It needs none.
    with pytest.raises(MissingExtraError, match=r"poresynth\[mesh\]"):
        meshes.read(tmp_path / "part.stl")


@pytest.mark.parametrize("suffix", READABLE)
@pytest.mark.parametrize("content", [b"", b"neither this nor that", b"solid x\nendsolid x\n"])
def test_bad_files_get_one_line(suffix: str, content: bytes, tmp_path: Path) -> None:
    path = tmp_path / f"bad{suffix}"
    path.write_bytes(content)
    with pytest.raises(FileError, match=f"bad{suffix}") as error:
        meshes.read(path)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("suffix", [".stl", ".3mf", ".ply"])
def test_truncated_files_get_one_line(suffix: str, mesh: Mesh, tmp_path: Path) -> None:
    path = tmp_path / f"cut{suffix}"
    meshes.write(path, mesh)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 3])
    with pytest.raises(FileError, match=f"cut{suffix}") as error:
        meshes.read(path)
    assert "\n" not in str(error.value)


def test_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="no such file"):
        meshes.read(tmp_path / "none.stl")
