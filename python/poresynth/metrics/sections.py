"""Plane sections of a volume: across the axes, and along a diagonal."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from poresynth.errors import ParameterError
from poresynth.metrics.arguments import whole_number
from poresynth.metrics.transport import Axis
from poresynth.preprocess import is_two_valued, label_values
from poresynth.volume import Volume, as_volume

__all__ = ["SECTION_AXES", "Images", "as_images", "diagonal_sections", "sections"]

_Voxels = npt.NDArray[Any]

SECTION_AXES: tuple[Axis, ...] = ("z", "y", "x")
"""Axes that planes can be across."""

Images = Mapping[Axis, Volume | npt.ArrayLike] | Volume | npt.ArrayLike
"""The image of the planes across each axis, or one image of all three."""

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


def diagonal_sections(volume: Volume | npt.ArrayLike, count: int = DIAGONALS) -> _Voxels:
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
        along the diagonal, both one voxel apart. Values are interpolated linearly, which smooths
        gray ones; of two values the nearer one is taken then, and a label is that of the nearest
        voxel.

    Raises
    ------
    ParameterError
        If the count is less than 1, or the volume is empty or has not 3 or 4 dimensions.

    Notes
    -----
    Peak memory beside the result: 40 bytes a pixel of one section.
    """
    array = as_volume(volume).array
    count = whole_number("count", count, 1)
    if array.size == 0:
        raise ParameterError("volume", f"array of shape {array.shape}", "must hold voxels")
    nz, ny, nx = array.shape[:3]
    width = min(ny, nx)
    # A section of this width reaches the corners of the volume at the outermost offset.
    reach = (width - 1) * (np.sqrt(0.5) - 0.5)
    offsets = np.linspace(-reach, reach, count) if count > 1 else np.zeros(1)
    along = np.arange(width) - (width - 1) / 2
    sample = _sampler(array)
    channels = array[..., np.newaxis] if array.ndim == 3 else array
    found = np.empty((count, nz, width, channels.shape[3]), array.dtype)
    for section, offset in zip(found, offsets, strict=True):
        y = (ny - 1) / 2 + (along + offset) * np.sqrt(0.5)
        x = (nx - 1) / 2 + (along - offset) * np.sqrt(0.5)
        places = np.broadcast_arrays(np.arange(nz)[:, np.newaxis], y, x)
        for channel in range(channels.shape[3]):
            section[..., channel] = sample(channels[..., channel], places)
    return found[..., 0] if array.ndim == 3 else found


def _sampler(array: _Voxels) -> Callable[[_Voxels, Sequence[_Voxels]], _Voxels]:
    """Return what gives the values of a channel between its voxels."""
    from scipy import ndimage

    if label_values(array):
        return partial(ndimage.map_coordinates, order=0, mode="nearest")
    if not is_two_valued(array):
        return partial(ndimage.map_coordinates, order=1, mode="nearest")
    low, high = array.min(), array.max()

    def nearer(channel: _Voxels, places: Sequence[_Voxels]) -> _Voxels:
        # The nearest voxels would make a rougher border.
        values = ndimage.map_coordinates(channel, places, float, order=1, mode="nearest")
        return np.asarray(np.where(values > (float(low) + float(high)) / 2, high, low))

    return nearer


def as_images(images: Images) -> dict[Axis, Volume]:
    """Check the images that stand for the slices across the axes.

    Parameters
    ----------
    images : mapping, or Volume or array_like
        By the axis that the image is perpendicular to: shape (1, y, x) or (1, y, x, channel), with
        rows and columns as of `sections`. An image alone stands for all three axes.

    Returns
    -------
    dict of str to Volume
        In the order z, y, x; the same object for the same image.

    Raises
    ------
    ParameterError
        If there is no image, an axis is not known, or an image has more than one slice.
    """
    if not isinstance(images, Mapping):
        images = dict.fromkeys(SECTION_AXES, images)
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
