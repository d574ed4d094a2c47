"""Plane sections of a volume: across the axes, and along a diagonal."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from poresynth.errors import ParameterError
from poresynth.metrics.arguments import whole_number
from poresynth.metrics.transport import Axis
from poresynth.preprocess import is_two_valued, label_values
from poresynth.volume import Volume, as_volume

__all__ = ["SECTION_AXES", "as_images", "diagonal_sections", "sections"]

SECTION_AXES: tuple[Axis, ...] = ("z", "y", "x")
"""Axes that planes can be across."""

DIAGONALS = 9
"""Diagonal sections that are cut unless another number is asked for: they lie closer together than
those across an axis, so that more of them would say little more."""


def sections(volume: Volume | npt.ArrayLike, axis: Axis) -> Volume:
    """Return the slices of a volume across an axis, one after the other.

    Parameters
    ----------
    volume : Volume or array_like
        Shape (z, y, x) or (z, y, x, channel).
    axis : {"z", "y", "x"}
        The axis that the slices are perpendicular to.

    Returns
    -------
    Volume
        Shape (slice, row, column[, channel]): rows lie along the first of the two other axes,
        columns along the second. A view, with the edges of its voxels in that order.

    Raises
    ------
    ParameterError
        If the axis is another, or the volume has not 3 or 4 dimensions.

    Notes
    -----
    Peak memory: none.
    """
    whole = as_volume(volume)
    if axis not in SECTION_AXES:
        raise ParameterError("axis", axis, "must be 'z', 'y' or 'x'")
    across = SECTION_AXES.index(axis)
    rows, columns = (i for i in range(3) if i != across)
    size = whole.voxel_size
    return Volume(
        np.moveaxis(whole.array, across, 0),
        (size[across], size[rows], size[columns]),
        whole.unit,
        whole.metadata,
    )


def diagonal_sections(
    volume: Volume | npt.ArrayLike, count: int = DIAGONALS
) -> npt.NDArray[np.generic]:
    """Cut a volume along planes that hold the z axis and halve the angle of the y and x axes.

    No image of a synthesis from images lies in these planes: what is only right across the axes
    shows here.

    Parameters
    ----------
    volume : Volume or array_like
        Shape (z, y, x) or (z, y, x, channel), voxels taken for cubes.
    count : int, default 9
        Number of parallel planes, evenly spaced about the plane y = x through the middle of the
        volume, as far out as they hold whole sections.

    Returns
    -------
    numpy.ndarray
        Shape (count, z, min(y, x)[, channel]), of the volume's type: rows lie along z, columns
        along the diagonal, both one voxel apart. Gray values are interpolated linearly, which
        smooths them; two values and labels are taken from the nearest voxel.

    Raises
    ------
    ParameterError
        If the count is less than 1, or the volume has not 3 or 4 dimensions.

    Notes
    -----
    Peak memory beside the result: 24 bytes a pixel of one section.
    """
    from scipy import ndimage

    array = as_volume(volume).array
    count = whole_number("count", count, 1)
    nz, ny, nx = array.shape[:3]
    width = min(ny, nx)
    # A section of this width reaches the corners of the volume at the outermost offset.
    reach = (width - 1) * (np.sqrt(0.5) - 0.5)
    offsets = np.linspace(-reach, reach, count) if count > 1 else np.zeros(1)
    along = np.arange(width) - (width - 1) / 2
    order = 0 if is_two_valued(array) or label_values(array) else 1
    channels = array[..., np.newaxis] if array.ndim == 3 else array
    found = np.empty((count, nz, width, channels.shape[3]), array.dtype)
    for section, offset in zip(found, offsets, strict=True):
        y = (ny - 1) / 2 + (along + offset) * np.sqrt(0.5)
        x = (nx - 1) / 2 + (along - offset) * np.sqrt(0.5)
        z, y, x = np.broadcast_arrays(np.arange(nz)[:, np.newaxis], y, x)
        for channel in range(channels.shape[3]):
            section[..., channel] = ndimage.map_coordinates(
                channels[..., channel], [z, y, x], order=order, mode="nearest"
            )
    return found[..., 0] if array.ndim == 3 else found


def as_images(images: Mapping[Axis, Volume | npt.ArrayLike]) -> dict[Axis, Volume]:
    """Check the images that stand for the slices across the axes.

    Parameters
    ----------
    images : mapping
        By the axis that the image is perpendicular to: shape (1, y, x) or (1, y, x, channel), with
        rows and columns as of `sections`.

    Returns
    -------
    dict of str to Volume
        In the order z, y, x; the same object for the same image.

    Raises
    ------
    ParameterError
        If there is no image, an axis is not known, or an image has more than one slice.
    """
    known: dict[int, Volume] = {}
    for axis, image in images.items():
        if axis not in SECTION_AXES:
            raise ParameterError("images", axis, "must be images by 'z', 'y' or 'x'")
        known[id(image)] = as_volume(image)
        shape = known[id(image)].array.shape
        if shape[0] != 1 or 0 in shape:
            what = f"array of shape {shape}"
            raise ParameterError(f"images.{axis}", what, "must be one slice (1, y, x)")
    if not known:
        raise ParameterError("images", "{}", "must hold at least one image")
    return {axis: known[id(images[axis])] for axis in SECTION_AXES if axis in images}
