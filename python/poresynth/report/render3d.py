"""A lit picture of a volume's surface, by what the machine has."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np
import numpy.typing as npt

from poresynth.report.offscreen import offscreen
from poresynth.report.raycast import raycast
from poresynth.report.scene import build_scene

__all__ = ["surface_picture"]


def surface_picture(
    solid: npt.NDArray[np.bool_],
    voxel_size: tuple[float, float, float],
    pixel: float,
) -> npt.NDArray[np.uint8]:
    """Draw the surface of a solid.

    With the extra ``view`` pyvista draws; without it, or where it cannot, rays cast in NumPy make
    the same picture with slightly rougher edges.

    Parameters
    ----------
    solid : numpy.ndarray
        bool, shape (z, y, x).
    voxel_size : (float, float, float)
        Edge lengths of a voxel along (z, y, x).
    pixel : float
        Edge length of a pixel, in voxels: pictures with the same value are drawn to one scale.

    Returns
    -------
    numpy.ndarray
        uint8, shape (height, width, 4): RGB and opacity; the background is transparent.
        Peak memory: 60 bytes a voxel of at most 256³ and 100 bytes a pixel.
    """
    scene = build_scene(solid, voxel_size, pixel)
    picture = offscreen(scene) if find_spec("pyvista") else None
    return raycast(scene) if picture is None else picture
