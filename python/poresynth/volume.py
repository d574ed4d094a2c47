"""A volume: an array with the size of its voxels."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from poresynth.errors import ParameterError

__all__ = ["Volume", "as_volume", "voxel_edges"]


@dataclass(frozen=True, eq=False)
class Volume:
    """An image or volume with its physical scale.

    Parameters
    ----------
    array : numpy.ndarray
        Voxels, shape (z, y, x) or (z, y, x, channel); an image is (1, y, x[, channel]).
        bool, any integer, float32 or float64. Not copied.
    voxel_size : float or (float, float, float), default 1.0
        Edge lengths of a voxel along (z, y, x), in ``unit``; one number means cubic voxels.
    unit : str, default "voxel"
        Unit of ``voxel_size``, such as ``"µm"``. ``"voxel"`` means that the scale is unknown.
    metadata : dict, optional
        What else is known of the volume, JSON-compatible: the provenance of a synthetic volume,
        the header fields of a file.

    Raises
    ------
    ParameterError
        If the array does not have 3 or 4 dimensions or a voxel size is not positive.

    Notes
    -----
    NumPy functions take a volume as its array. Peak memory: none beyond the array.
    """

    array: npt.NDArray[Any]
    voxel_size: tuple[float, float, float] = (1.0, 1.0, 1.0)
    unit: str = "voxel"
    metadata: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check the array and spell the voxel size out."""
        array = np.asanyarray(self.array)
        if array.ndim not in (3, 4):
            raise ParameterError(
                "array.ndim", array.ndim, "must be 3 (z, y, x) or 4 (z, y, x, channel)"
            )
        object.__setattr__(self, "array", array)
        object.__setattr__(self, "voxel_size", voxel_edges(self.voxel_size))

    @property
    def shape(self) -> tuple[int, int, int]:
        """Edge lengths (z, y, x) in voxels, without the channels."""
        z, y, x = self.array.shape[:3]
        return (z, y, x)

    @property
    def channels(self) -> int:
        """Number of channels: 1 for a plain (z, y, x) array."""
        return 1 if self.array.ndim == 3 else int(self.array.shape[3])

    @property
    def dtype(self) -> np.dtype[Any]:
        """Data type of the voxels."""
        return self.array.dtype

    def with_array(self, array: npt.NDArray[Any]) -> Volume:
        """Return the same scale and metadata around another array."""
        return replace(self, array=array)

    def __array__(
        self, dtype: npt.DTypeLike | None = None, copy: bool | None = None
    ) -> npt.NDArray[Any]:
        """Return the voxels, for NumPy."""
        if copy:
            return np.array(self.array, dtype=dtype)
        return np.asarray(self.array, dtype=dtype)


def as_volume(volume: Volume | npt.ArrayLike) -> Volume:
    """Return ``volume`` itself, or a plain array as a volume of unknown scale.

    Parameters
    ----------
    volume : Volume or array_like
        Shape (z, y, x) or (z, y, x, channel).

    Returns
    -------
    Volume

    Raises
    ------
    ParameterError
        If the array does not have 3 or 4 dimensions.
    """
    return volume if isinstance(volume, Volume) else Volume(np.asanyarray(volume))


def voxel_edges(voxel_size: float | tuple[float, float, float]) -> tuple[float, float, float]:
    """Return the edges of a voxel along (z, y, x).

    Parameters
    ----------
    voxel_size : float or (float, float, float)
        One number means cubic voxels.

    Returns
    -------
    (float, float, float)

    Raises
    ------
    ParameterError
        If there are not one or three positive numbers.
    """
    size = np.atleast_1d(np.asarray(voxel_size, dtype=float))
    if size.shape not in ((1,), (3,)) or not (np.isfinite(size).all() and (size > 0).all()):
        raise ParameterError(
            "voxel_size", voxel_size, "must be one or three positive numbers (z, y, x)"
        )
    z, y, x = np.broadcast_to(size, 3).tolist()
    return (z, y, x)
