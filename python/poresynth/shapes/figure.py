"""A body to try things on: a sitting hare, drawn from ellipsoids."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from poresynth.errors import ParameterError
from poresynth.meshes import Mesh, isosurface

__all__ = ["figure"]

# Centre (x, y, z), radii, and turns in degrees about x then y; the hare looks along x, and its feet
# are on z = 0. In a frame in which it is about 2 high.
_PARTS = (
    ((-0.18, 0.00, 0.52), (0.60, 0.46, 0.52), (0, 18)),  # trunk
    ((0.16, 0.00, 0.72), (0.34, 0.33, 0.46), (0, -16)),  # chest
    ((0.40, 0.00, 1.16), (0.34, 0.26, 0.27), (0, 14)),  # head
    ((0.64, 0.00, 1.08), (0.16, 0.15, 0.14), (0, 0)),  # muzzle
    ((0.20, 0.15, 1.62), (0.10, 0.13, 0.42), (-10, -16)),  # ears
    ((0.20, -0.15, 1.62), (0.10, 0.13, 0.42), (10, -16)),
    ((-0.74, 0.00, 0.40), (0.19, 0.18, 0.18), (0, 0)),  # tail
    ((-0.22, 0.36, 0.32), (0.40, 0.20, 0.32), (0, 10)),  # thighs
    ((-0.22, -0.36, 0.32), (0.40, 0.20, 0.32), (0, 10)),
    ((0.10, 0.38, 0.10), (0.36, 0.13, 0.11), (0, 0)),  # hind feet
    ((0.10, -0.38, 0.10), (0.36, 0.13, 0.11), (0, 0)),
    ((0.42, 0.17, 0.30), (0.14, 0.12, 0.34), (0, -8)),  # forelegs
    ((0.42, -0.17, 0.30), (0.14, 0.12, 0.34), (0, -8)),
)
# Width of the fillets between them.
_BLEND = 0.09
_LOW, _HIGH = np.array([-1.0, -0.65, 0.0]), np.array([0.9, 0.65, 2.1])


def figure(height: float = 40.0, *, resolution: int = 120) -> Mesh:
    """Draw a sitting hare with long ears, a body that is thick and thin.

    Parameters
    ----------
    height : float, default 40.0
        Its height in mm.
    resolution : int, default 120
        Steps of the grid along the height, at least 24.

    Returns
    -------
    Mesh
        Closed, in mm, standing on z = 0; the same at every call.

    Raises
    ------
    ParameterError
        If a parameter is outside its range.

    Notes
    -----
    The surface of a smooth union of ellipsoids, by `isosurface`. Peak memory: about 20 bytes per
    grid point and 30 bytes a triangle: 30 MB for the default.
    """
    if not (np.isfinite(height) and height > 0):
        raise ParameterError("height", height, "must be positive")
    if resolution < 24:
        raise ParameterError("resolution", resolution, "must be at least 24")
    step = 2.1 / resolution
    axes = [np.arange(low + step / 2, high, step) for low, high in zip(_LOW, _HIGH, strict=True)]
    points = np.stack(np.meshgrid(*axes[::-1], indexing="ij")[::-1], axis=-1).astype(np.float32)
    field = _field(points)
    low = (float(_LOW[2]), float(_LOW[1]), float(_LOW[0]))
    mesh = isosurface(field, voxel_size=(step, step, step), origin=low, unit="mm")
    scale = height / (mesh.bounds[1, 2] - mesh.bounds[0, 2])
    return mesh.with_vertices(np.float32(scale) * mesh.vertices)


def _field(points: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Return about the depth below the surface in widths of a fillet, positive inside."""
    total = np.zeros(points.shape[:-1], dtype=np.float32)
    for centre, radii, (about_x, about_y) in _PARTS:
        across = np.array(radii, dtype=np.float32)
        own = (points - np.array(centre, dtype=np.float32)) @ _turn(about_x, about_y)
        ratio = own / across
        size = np.linalg.norm(ratio, axis=-1)
        slope = np.linalg.norm(ratio / across, axis=-1)
        depth = size * (1 - size) / np.maximum(slope, np.float32(1e-6))
        total += np.exp(np.clip(depth / np.float32(_BLEND), -60, 20))
    return np.log(total)


def _turn(about_x: float, about_y: float) -> npt.NDArray[np.float32]:
    """Return the matrix whose columns are the axes of a part."""
    a, b = np.deg2rad([about_x, about_y])
    x = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    y = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
    return np.asarray(y @ x, dtype=np.float32)
