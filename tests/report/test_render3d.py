"""Pictures of surfaces: both ways of drawing, against geometry and against each other."""

from __future__ import annotations

import importlib.util
import subprocess

import numpy as np
import numpy.typing as npt
import pytest

from poresynth.report import offscreen as offscreen_module
from poresynth.report import render3d
from poresynth.report.offscreen import offscreen
from poresynth.report.raycast import raycast
from poresynth.report.scene import Scene, build_scene

CUBIC = (1.0, 1.0, 1.0)


def ball(radius: float, edge: int) -> npt.NDArray[np.bool_]:
    axes = np.arange(edge) - (edge - 1) / 2
    z, y, x = np.meshgrid(axes, axes, axes, indexing="ij")
    return z**2 + y**2 + x**2 <= radius**2


def struts(edge: int) -> npt.NDArray[np.bool_]:
    solid = np.zeros((edge, edge, edge), dtype=bool)
    solid[:, 5:9, 5:9] = solid[10:14, :, 16:20] = solid[18:22, 14:18, :] = True
    return solid


@pytest.fixture(scope="module")
def scene() -> Scene:
    return build_scene(struts(28), CUBIC, 0.2)


def test_a_ball_covers_its_disc() -> None:
    pixel = 0.25
    picture = raycast(build_scene(ball(12, 32), CUBIC, pixel))
    area = (picture[..., 3] > 0).sum() * pixel**2
    assert area == pytest.approx(np.pi * 12**2, rel=0.03)


def test_light_comes_from_above() -> None:
    picture = raycast(build_scene(ball(12, 32), CUBIC, 0.5)).astype(float)
    rows = np.flatnonzero(picture[..., 3].any(axis=1))
    brightness = [picture[r, picture[r, :, 3] > 0, :3].mean() for r in rows]
    assert np.mean(brightness[: len(rows) // 2]) > np.mean(brightness[len(rows) // 2 :])


def test_the_first_axis_points_up_and_the_view_is_right_handed() -> None:
    """Seen from the corner, ParaView shows the x axis going down to the right... of y."""
    edge = 24

    def centre_of(axis: int) -> npt.NDArray[np.float64]:
        solid = np.zeros((edge, edge, edge), dtype=bool)
        index = [slice(0, 4)] * 3
        index[axis] = slice(18, 24)
        solid[tuple(index)] = True
        return np.argwhere(raycast(build_scene(solid, CUBIC, 0.5))[..., 3] > 0).mean(axis=0)

    along_z, along_y, along_x = (centre_of(axis) for axis in range(3))
    assert along_z[0] < along_y[0]
    assert along_z[0] < along_x[0]
    assert along_x[1] < along_y[1]


def test_voxels_of_unequal_edges_are_drawn_to_scale() -> None:
    tall = raycast(build_scene(np.ones((10, 10, 10), dtype=bool), (3.0, 1.0, 1.0), 0.5))
    cubic = raycast(build_scene(np.ones((30, 10, 10), dtype=bool), CUBIC, 0.5))
    assert (tall[..., 3] > 0).sum() == pytest.approx((cubic[..., 3] > 0).sum(), rel=0.05)


def test_a_large_block_is_reduced() -> None:
    solid = np.zeros((30, 30, 600), dtype=bool)
    solid[..., 100:500] = True
    scene = build_scene(solid, CUBIC, 2.0)
    assert max(scene.field.shape) <= 256 + 4
    assert (raycast(scene)[..., 3] > 0).any()


@pytest.mark.parametrize("shape", [(1, 1, 1), (1, 9, 9), (8, 8, 8)])
@pytest.mark.parametrize("value", [False, True])
def test_degenerate_blocks(shape: tuple[int, int, int], value: bool) -> None:
    picture = raycast(build_scene(np.full(shape, value), CUBIC, 0.2))
    assert picture.dtype == np.uint8
    if not value:
        assert not picture.any()
    elif shape == (8, 8, 8):
        assert picture[..., 3].any()


needs_pyvista = pytest.mark.skipif(
    importlib.util.find_spec("pyvista") is None, reason="needs the extra view"
)


@needs_pyvista
def test_pyvista_draws_the_same_picture(scene: Scene) -> None:
    drawn = offscreen(scene)
    if drawn is None:
        pytest.skip("pyvista cannot draw on this machine")
    cast = raycast(scene)
    assert drawn.shape == cast.shape
    both = (drawn[..., 3] == 255) & (cast[..., 3] == 255)
    assert both.sum() > 0.9 * (cast[..., 3] > 0).sum()
    assert np.abs(drawn[both][:, :3].astype(int) - cast[both][:, :3]).mean() < 6


@needs_pyvista
def test_pyvista_draws_an_empty_block() -> None:
    drawn = offscreen(build_scene(np.zeros((5, 5, 5), dtype=bool), CUBIC, 0.5))
    assert drawn is None or not drawn.any()


def test_a_machine_where_pyvista_hangs_still_gets_a_picture(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    def hang(command: list[str], *, timeout: float, **_: object) -> None:
        raise subprocess.TimeoutExpired(command, timeout)

    monkeypatch.setattr(offscreen_module.subprocess, "run", hang)
    monkeypatch.setattr(render3d, "find_spec", lambda name: True)
    picture = render3d.surface_picture(struts(28), CUBIC, 0.2)
    np.testing.assert_array_equal(picture, raycast(scene))


def test_a_machine_where_pyvista_dies_still_gets_a_picture(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(offscreen_module.sys, "executable", "false")
    assert offscreen(scene) is None


def test_without_pyvista_rays_are_cast(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(render3d, "find_spec", lambda name: None)
    monkeypatch.setattr(render3d, "offscreen", None)
    picture = render3d.surface_picture(struts(28), CUBIC, 0.2)
    np.testing.assert_array_equal(picture, raycast(scene))
