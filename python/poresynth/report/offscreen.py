"""A lit picture of a surface by pyvista, in a process of its own.

A machine without a display or with a broken driver makes VTK hang or die, and Python with it.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from dataclasses import fields
from pathlib import Path

import numpy as np
import numpy.typing as npt

from poresynth.report.scene import LEVEL, Scene, shade

__all__ = ["offscreen"]

# A driver that answers at all draws a block of 256³ in a quarter of this.
SECONDS = 60


def offscreen(scene: Scene) -> npt.NDArray[np.uint8] | None:
    """Draw a surface.

    Parameters
    ----------
    scene : Scene
        What to draw.

    Returns
    -------
    numpy.ndarray or None
        uint8, shape (height, width, 4): RGB and opacity; None where pyvista cannot draw.
        Peak memory: 40 bytes a voxel of the scene, and the triangles.
    """
    with tempfile.TemporaryDirectory(prefix="poresynth-") as folder:
        request, answer = Path(folder, "scene.npz"), Path(folder, "picture.npy")
        np.savez(request, **{f.name: getattr(scene, f.name) for f in fields(scene)})
        command = [sys.executable, "-m", __name__, str(request), str(answer)]
        try:
            subprocess.run(command, check=True, capture_output=True, timeout=SECONDS)
            picture: npt.NDArray[np.uint8] = np.load(answer)
        except (subprocess.SubprocessError, OSError):
            return None
    # A driver that draws nothing also exits with 0.
    return picture if picture[..., 3].any() or not (scene.field >= LEVEL).any() else None


def _draw(scene: Scene) -> npt.NDArray[np.uint8]:
    import pyvista

    grid = pyvista.ImageData(dimensions=scene.field.shape[::-1], spacing=tuple(scene.spacing[::-1]))
    grid["field"] = scene.field.ravel()
    surface = grid.contour([LEVEL], scalars="field", method="flying_edges")
    if not surface.n_points:
        return np.zeros((*scene.size[::-1], 4), dtype=np.uint8)
    colours = shade(scene, surface.points[:, ::-1] / scene.spacing)
    surface["colour"] = np.rint(255 * colours).astype(np.uint8)

    plotter = pyvista.Plotter(off_screen=True, window_size=list(scene.size))
    plotter.add_mesh(surface, scalars="colour", rgb=True, lighting=False)
    plotter.camera.parallel_projection = True
    centre, forward = scene.centre[::-1], scene.forward[::-1]
    plotter.camera.focal_point = centre
    plotter.camera.position = centre - 2 * max(scene.size) * scene.pixel * forward
    plotter.camera.up = scene.up[::-1]
    plotter.camera.parallel_scale = scene.size[1] * scene.pixel / 2
    plotter.reset_camera_clipping_range()
    plotter.enable_anti_aliasing("ssaa")
    return np.asarray(plotter.screenshot(transparent_background=True, return_img=True))


if __name__ == "__main__":
    with np.load(sys.argv[1]) as stored:
        scene = Scene(**{name: stored[name] for name in stored.files})
    size = (int(scene.size[0]), int(scene.size[1]))
    np.save(sys.argv[2], _draw(Scene(**{**vars(scene), "size": size, "pixel": float(scene.pixel)})))
