"""A solid shell under the surface of a body."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from poresynth.errors import ParameterError
from poresynth.metrics import distance_transform
from poresynth.volume import Volume, as_volume

__all__ = ["shell"]


def shell(mask: Volume | npt.ArrayLike, thickness: float) -> npt.NDArray[np.bool_]:
    """Return the outermost layer of a body.

    Parameters
    ----------
    mask : Volume or array_like
        The body, bool, shape (z, y, x). Beyond the border is outside.
    thickness : float
        Thickness of the layer, in the unit of the volume's voxel size; at least half a voxel's
        longest edge.

    Returns
    -------
    numpy.ndarray of bool
        Shape (z, y, x): the voxels of the body whose centres are nearer to its surface than the
        thickness. Under a flat face that lies along the voxels, as many layers as fit, rounded.

    Raises
    ------
    ParameterError
        If the thickness is too small.

    Notes
    -----
    Peak memory: 7 bytes a voxel.
    """
    volume = as_volume(mask)
    edge = max(volume.voxel_size)
    if not (np.isfinite(thickness) and thickness >= edge / 2):
        allowed = f"must be at least half a voxel, {edge / 2:g} {volume.unit}"
        raise ParameterError("shell", thickness, allowed)
    inside = np.pad(volume.array.astype(bool, copy=False), 1)
    # Distances are to the centres of voxels outside, half a voxel beyond the surface.
    reach = thickness + min(volume.voxel_size) / 2
    depth = distance_transform(inside, voxel_size=volume.voxel_size, cap=2 * reach)
    inner = slice(1, -1), slice(1, -1), slice(1, -1)
    return np.ascontiguousarray((inside & (depth < reach))[inner])
