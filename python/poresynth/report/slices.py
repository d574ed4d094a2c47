"""Slices of two volumes, at one scale and with one range of grays."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import numpy.typing as npt

from poresynth.volume import Volume

__all__ = ["DIRECTIONS", "central_part", "gray_window", "png", "scale_bar", "slice_picture"]

# Name of a slice, the axis that it is across, the axes of the picture (downwards, to the right).
DIRECTIONS = (("xy", 0, (1, 2)), ("xz", 1, (0, 2)), ("yz", 2, (0, 1)))
# A volume wider than this many exemplars is shown by its central part, or nothing would be seen.
WIDEST = 2.5


def central_part(volume: Volume, exemplar: Volume) -> Volume:
    """Return the central part of a volume that can be shown beside its exemplar.

    Parameters
    ----------
    volume, exemplar : Volume
        The part has at most `WIDEST` times the edges of the exemplar.

    Returns
    -------
    Volume
        A view.
    """
    cut = []
    for edge, reference in zip(volume.shape, exemplar.shape, strict=True):
        shown = min(edge, int(WIDEST * reference))
        cut.append(slice((edge - shown) // 2, (edge - shown) // 2 + shown))
    return volume.with_array(volume.array[tuple(cut)])


def gray_window(array: npt.NDArray[Any]) -> tuple[float, float]:
    """Return the gray values to be shown as black and as white.

    Parameters
    ----------
    array : numpy.ndarray
        Usually the exemplar. One voxel in a thousand may be outside on each side.

    Returns
    -------
    (float, float)
    """
    if array.dtype == bool:
        return 0.0, 1.0
    # A regular sample is enough for a range, and quick for a large scan.
    values = array.ravel()[:: max(1, array.size // 1_000_000)]
    low, high = np.percentile(values, [0.1, 99.9])
    return (float(low), float(high)) if high > low else (float(low) - 1, float(low) + 1)


def slice_picture(volume: Volume, axis: int, window: tuple[float, float]) -> bytes:
    """Draw the middle slice across an axis, one pixel a voxel.

    Parameters
    ----------
    volume : Volume
        Gray, or with channels, of which the first three are taken as red, green and blue.
    axis : int
        The axis that the slice is across.
    window : (float, float)
        Values shown as black and as white.

    Returns
    -------
    bytes
        A PNG.
    """
    plane = volume.array.take(volume.shape[axis] // 2, axis=axis).astype(np.float64)
    low, high = window
    gray = np.clip((plane - low) / (high - low), 0, 1)
    if gray.ndim == 3:
        gray = gray[..., :3] if gray.shape[2] >= 3 else gray[..., 0]
    return png(np.rint(255 * gray).astype(np.uint8))


def png(picture: npt.NDArray[np.uint8]) -> bytes:
    """Encode a picture.

    Parameters
    ----------
    picture : numpy.ndarray
        uint8, shape (height, width[, 3 or 4]).

    Returns
    -------
    bytes
    """
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(picture).save(stream, format="png", optimize=True)
    return stream.getvalue()


def scale_bar(extent: float, unit: str) -> tuple[float, str]:
    """Choose the length of a scale bar.

    Parameters
    ----------
    extent : float
        Width of the smaller picture, in ``unit``.
    unit : str
        Unit of the extent.

    Returns
    -------
    (float, str)
        Length in ``unit``, a round number of about a third of the extent, and its label.
    """
    goal = extent / 3
    power = 10.0 ** np.floor(np.log10(goal))
    length = max(step * power for step in (1, 2, 5) if step * power <= goal)
    if unit in ("µm", "um", "μm") and length >= 1000:
        return length, f"{length / 1000:g} mm"
    plural = "s" if unit == "voxel" and length != 1 else ""
    return length, f"{length:g} {unit}{plural}"
