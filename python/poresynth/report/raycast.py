"""A lit picture of a surface without a graphics card: one ray a pixel through the voxels.

Rays leap by the distance to the nearest solid (sphere tracing), so that a picture takes a second
or two; a matplotlib polygon collection of the same surface takes longer and draws hidden faces over
near ones.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from poresynth.report.scene import LEVEL, Scene, sample, shade

__all__ = ["raycast"]

# A ray leaps to this distance before the nearest solid voxel: the surface may lie before that.
MARGIN = 1.5
# Shortest leap, in voxels: thinner sheets than this could be missed.
SHORTEST = 0.5
BISECTIONS = 5


def raycast(scene: Scene) -> npt.NDArray[np.uint8]:
    """Draw a surface.

    Parameters
    ----------
    scene : Scene
        What to draw.

    Returns
    -------
    numpy.ndarray
        uint8, shape (height, width, 4): RGB and opacity; the background is transparent.
        Peak memory: 16 bytes a voxel of the scene and 100 bytes a pixel.
    """
    width, height = scene.size
    across = (np.arange(width) + 0.5 - width / 2) * scene.pixel
    upwards = (height / 2 - np.arange(height) - 0.5) * scene.pixel
    # Everything below is counted in voxels of the field.
    start = scene.centre + across[None, :, None] * scene.right + upwards[:, None, None] * scene.up
    start = (start / scene.spacing).reshape(-1, 3)
    forward = scene.forward / scene.spacing
    forward /= np.linalg.norm(forward)

    ray, depth = _first_hits(scene.field, start, forward)
    points = start[ray] + depth[:, None] * forward
    picture = np.zeros((height * width, 4), dtype=np.uint8)
    picture[ray, :3] = np.rint(255 * shade(scene, points))
    picture[ray, 3] = 255
    return picture.reshape(height, width, 4)


def _first_hits(
    field: npt.NDArray[np.float32], start: npt.NDArray[Any], forward: npt.NDArray[Any]
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.float64]]:
    """Return the rays that meet the surface, and how far they go."""
    from scipy import ndimage

    if not (field >= LEVEL).any():
        return np.empty(0, dtype=np.intp), np.empty(0)
    distance = ndimage.distance_transform_edt(field < LEVEL).astype(np.float32)
    last = np.array(field.shape) - 1
    with np.errstate(divide="ignore"):
        sides = np.sort([(0 - start) / forward, (last - start) / forward], axis=0)
    depth, end = sides[0].max(axis=1), sides[1].min(axis=1)
    ray = np.flatnonzero(depth < end)
    depth, end = depth[ray], end[ray]

    found: list[npt.NDArray[np.intp]] = []
    found_depth: list[npt.NDArray[np.float64]] = []
    while ray.size:
        points = start[ray] + depth[:, None] * forward
        z, y, x = np.clip(np.rint(points).astype(np.intp), 0, last).T
        gap = distance[z, y, x]
        near = np.flatnonzero(gap < MARGIN + SHORTEST)
        near = near[sample(field, points[near]) >= LEVEL]
        found.append(ray[near])
        found_depth.append(depth[near])
        depth = depth + np.maximum(gap - MARGIN, SHORTEST)
        going = depth < end
        going[near] = False
        ray, depth, end = ray[going], depth[going], end[going]
    hits = np.concatenate(found)
    behind = np.concatenate(found_depth)
    before = behind - SHORTEST
    for _ in range(BISECTIONS):
        middle = (before + behind) / 2
        inside = sample(field, start[hits] + middle[:, None] * forward) >= LEVEL
        behind = np.where(inside, middle, behind)
        before = np.where(inside, before, middle)
    return hits, behind
