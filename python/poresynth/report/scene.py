"""What a picture of a surface shows: the smoothed solid, the direction of view, the colours."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

__all__ = [
    "LEVEL",
    "Scene",
    "build_scene",
    "sample",
    "shade",
]

# Looking down at the corner of the block, the first axis (slices of a scan) upwards.
AZIMUTH = 55.0
ELEVATION = 28.0
# Colours of the surface and of the faces where the block is cut, linear RGB 0 to 1.
BONE = (0.90, 0.84, 0.73)
CUT = (0.90, 0.74, 0.53)
# The surface is where the smoothed solid crosses this level.
LEVEL = 0.5
# Empty voxels round the block, which close the surface at its faces.
PADDING = 2
# A wider block is reduced: a screen shows no more, and the time grows with the voxels.
LARGEST_EDGE = 256
# Smoothing in voxels: hides the staircase, keeps struts of two voxels.
SMOOTHING = 0.8
# Lights in the frame of the picture: azimuth from up, towards the right; altitude; strength.
LIGHTS = ((-50.0, 40.0, 0.75), (70.0, 20.0, 0.25))
AMBIENT = 0.30
# How much darker it is deep inside a pore, and how wide a pore is open to light, in voxels.
OCCLUSION = 0.65
OCCLUSION_WIDTH = 5.0


@dataclass(frozen=True)
class Scene:
    """A block ready to be drawn.

    Parameters
    ----------
    field : numpy.ndarray
        float32, shape (z, y, x): smoothed solid with `PADDING` empty voxels on each side.
    spacing : numpy.ndarray
        Edge lengths (z, y, x) of a voxel of ``field``, in voxels of the volume (cubic: equal).
    forward, right, up : numpy.ndarray
        Unit vectors (z, y, x) of the picture.
    size : (int, int)
        Width and height of the picture, pixels.
    pixel : float
        Edge length of a pixel, in voxels of the volume.
    """

    field: npt.NDArray[np.float32]
    spacing: npt.NDArray[np.float64]
    forward: npt.NDArray[np.float64]
    right: npt.NDArray[np.float64]
    up: npt.NDArray[np.float64]
    size: tuple[int, int]
    pixel: float

    @property
    def centre(self) -> npt.NDArray[np.float64]:
        """Centre (z, y, x) of the block, in voxels of the volume."""
        return (np.array(self.field.shape) - 1) / 2 * self.spacing


def build_scene(
    solid: npt.NDArray[np.bool_],
    voxel_size: tuple[float, float, float],
    pixel: float,
) -> Scene:
    """Smooth a solid and set the camera up.

    Parameters
    ----------
    solid : numpy.ndarray
        bool, shape (z, y, x).
    voxel_size : (float, float, float)
        Edge lengths of a voxel along (z, y, x).
    pixel : float
        Edge length of a pixel, in voxels: scenes with the same value are drawn to one scale.

    Returns
    -------
    Scene
        Peak memory: 9 bytes a voxel.
    """
    from scipy import ndimage

    factor = -(-max(solid.shape) // LARGEST_EDGE)
    field = _block_mean(solid, factor) if factor > 1 else solid.astype(np.float32)
    field = ndimage.gaussian_filter(np.pad(field, PADDING), SMOOTHING)
    spacing = factor * np.array(voxel_size) / min(voxel_size)

    azimuth, elevation = np.deg2rad([AZIMUTH, ELEVATION])
    forward = -np.array(
        [
            np.sin(elevation),
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
        ]
    )
    # Right-handed in (x, y, z), as ParaView draws the same file.
    right = np.array([0.0, np.sin(azimuth), -np.cos(azimuth)])
    up = np.array(
        [
            np.cos(elevation),
            -np.sin(elevation) * np.cos(azimuth),
            -np.sin(elevation) * np.sin(azimuth),
        ]
    )
    extent = np.array(field.shape) * spacing
    width, height = (int(np.ceil(np.abs(axis) @ extent / pixel)) for axis in (right, up))
    return Scene(field, spacing, forward, right, up, (width, height), pixel)


def _block_mean(solid: npt.NDArray[np.bool_], factor: int) -> npt.NDArray[np.float32]:
    """Mean over blocks of ``factor`` voxels; what is left over at the far faces is dropped."""
    z, y, x = (edge // factor for edge in solid.shape)
    blocks = solid[: z * factor, : y * factor, : x * factor]
    blocks = blocks.reshape(z, factor, y, factor, x, factor)
    mean: npt.NDArray[np.float32] = blocks.mean(axis=(1, 3, 5), dtype=np.float32)
    return mean


def sample(field: npt.NDArray[Any], points: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return the trilinear values of a field at points, shape (n, 3), in its voxels."""
    from scipy import ndimage

    values: npt.NDArray[Any] = ndimage.map_coordinates(field, points.T, order=1)
    return values


def shade(scene: Scene, points: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return the lit colour (RGB, 0 to 1) of points on the surface, shape (n, 3), in voxels."""
    from scipy import ndimage

    steps = np.eye(3)
    normal = np.stack(
        [sample(scene.field, points - s) - sample(scene.field, points + s) for s in steps], axis=1
    )
    normal /= scene.spacing
    normal /= np.linalg.norm(normal, axis=1, keepdims=True) + 1e-9

    light = np.full(len(points), AMBIENT)
    for azimuth, altitude, strength in LIGHTS:
        a, b = np.deg2rad([azimuth, altitude])
        towards = np.cos(b) * (np.sin(a) * scene.right + np.cos(a) * scene.up)
        towards = towards - np.sin(b) * scene.forward
        light += strength * np.clip(normal @ towards, 0, None)
    crowding = ndimage.gaussian_filter(scene.field, OCCLUSION_WIDTH)
    openness = 1.15 * (1 - sample(crowding, points + 0.8 * OCCLUSION_WIDTH * normal))
    light *= 1 - OCCLUSION * (1 - np.clip(openness, 0, 1))

    near, far = PADDING + 0.7, np.array(scene.field.shape) - 1.7 - PADDING
    cut = np.any((points < near) | (points > far), axis=1, keepdims=True)
    colour: npt.NDArray[Any] = np.clip(np.where(cut, CUT, BONE) * light[:, None], 0, 1)
    return colour
