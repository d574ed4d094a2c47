"""Surface area of blobs."""

from __future__ import annotations

import numpy as np
from inputs import blobs
from race import Race

import poresynth.metrics


def close(ours: float, theirs: float) -> bool:
    """Crofton's estimate beside that of meshes, which have corners."""
    return abs(ours / theirs - 1) < 0.1


crofton = Race("surface area, Crofton", lambda edge: [blobs(edge)], close)
cubes = Race(
    "surface area, marching cubes",
    lambda edge: [blobs(edge)],
    lambda ours, theirs: abs(ours / theirs - 1) < 0.02,
)


@crofton.contestant("poresynth")
def _(solid: np.ndarray, threads: int = 0) -> float:
    return poresynth.metrics.surface_area(solid, threads=threads).area


@cubes.contestant("poresynth")
def _(solid: np.ndarray, threads: int = 0) -> float:
    return poresynth.metrics.surface_area(solid, method="marching_cubes", threads=threads).area


def vtk(solid: np.ndarray) -> float:
    import pyvista

    grid = pyvista.ImageData(dimensions=solid.shape[::-1])
    grid.point_data["solid"] = solid.ravel().view(np.uint8)
    return grid.contour([0.5], scalars="solid", method="flying_edges").area


def skimage(solid: np.ndarray) -> float:
    from skimage import measure

    vertices, faces, *_ = measure.marching_cubes(solid.astype(np.float32), 0.5)
    return measure.mesh_surface_area(vertices, faces)


# Flying edges makes other triangles than marching cubes where two voxels touch by an edge.
for each in (crofton, cubes):
    each.contestant("VTK, flying edges", "vtk")(vtk)
    each.contestant("scikit-image", most=256)(skimage)
