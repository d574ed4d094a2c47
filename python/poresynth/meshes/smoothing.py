"""Taubin's smoothing of a mesh."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from poresynth.errors import ParameterError
from poresynth.meshes.crossings import Progress, crossings
from poresynth.meshes.mesh import Mesh

__all__ = ["smooth"]

# Steps towards the mean of the neighbours and back, of Taubin's paper: waves longer than about ten
# edges keep their height (the pass band is 1/SHRINK + 1/GROW = 0.1).
SHRINK, GROW = 0.5, -1 / 1.9


def smooth(mesh: Mesh, iterations: int, *, progress: Progress | None = None) -> Mesh:
    """Smooth a mesh without shrinking it.

    Parameters
    ----------
    mesh : Mesh
        A closed mesh.
    iterations : int
        Pairs of steps; 10 take the steps of voxels away, 50 also rough grains of some voxels.
    progress : callable, optional
        ``progress(stage, fraction)``; what it raises ends the work.

    Returns
    -------
    Mesh
        The same triangles. Vertices on the faces of the box around the mesh stay on them, so that
        cut faces stay flat.

    Raises
    ------
    ParameterError
        If ``iterations`` is negative.

    Notes
    -----
    Taubin (SIGGRAPH 1995): each vertex moves towards the mean of its neighbours by a share λ, then
    back by a slightly larger share −μ. Where that makes triangles cross, which were apart before,
    their vertices are put back, and in a second round their neighbours, until none cross. Peak
    memory: 60 bytes a triangle, and as for `crossings`.
    """
    if iterations < 0:
        raise ParameterError("iterations", iterations, "must be at least 0")
    if not iterations or not len(mesh.faces):
        return mesh
    mean = _neighbour_mean(mesh)
    low, high = mesh.bounds
    free = (mesh.vertices != low.astype(mesh.vertices.dtype)) & (
        mesh.vertices != high.astype(mesh.vertices.dtype)
    )
    vertices = mesh.vertices.copy()
    for i in range(iterations):
        for step in (SHRINK, GROW):
            vertices += np.float32(step) * free * (mean @ vertices - vertices)
        if progress is not None:
            progress("smoothing", (i + 1) / iterations)
    return _untangled(mesh, vertices, mean, progress)


def _untangled(
    mesh: Mesh, vertices: npt.NDArray[Any], mean: Any, progress: Progress | None
) -> Mesh:
    """Put the vertices of triangles that cross back to where they were, and wider if need be."""
    back = np.zeros(len(vertices), dtype=bool)
    while True:
        moved = mesh.with_vertices(np.where(back[:, None], mesh.vertices, vertices))
        tangled = mesh.faces[crossings(moved, progress=progress)].ravel()
        fresh = tangled[~back[tangled]]
        if not len(tangled):
            return moved
        back[tangled] = True
        if not len(fresh):
            # They cross what still moves around them.
            wider = (mean @ back.astype(np.float32)) > 0
            if (wider <= back).all():
                return moved
            back |= wider


def _neighbour_mean(mesh: Mesh) -> Any:
    """Return the matrix that takes the mean over the neighbours of each vertex."""
    from scipy import sparse

    count = len(mesh.vertices)
    # Each edge of a closed mesh runs once in either direction.
    ends = (mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel())
    ones = np.ones(len(ends[0]), dtype=np.float32)
    matrix = sparse.csr_array((ones, ends), shape=(count, count))
    matrix.data /= np.repeat(np.diff(matrix.indptr), np.diff(matrix.indptr))
    return matrix
