"""The porosity that a volume is asked for: a number, a map, or a function of position."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from poresynth.engines.cells import Box
from poresynth.engines.interpolation import interpolated
from poresynth.errors import ParameterError
from poresynth.volume import Volume

__all__ = ["PorosityLike", "PorosityMap", "as_porosity"]

PorosityLike = float | Volume | npt.ArrayLike | Callable[..., npt.ArrayLike]
"""Pore fraction: a number; a map of the output's shape or coarser; or a function that takes the
coordinates z, y, x of the voxels' centres, arrays that broadcast, in the unit of the voxel size."""

_Floats = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class PorosityMap:
    """A porosity at each voxel, which is worked out where it is needed.

    Attributes
    ----------
    at : callable
        Returns the porosity of the voxels of a box.
    shape : (int, int, int)
        Of the volume.
    """

    at: Callable[[Box], _Floats]
    shape: tuple[int, int, int]

    def within(self, box: Box) -> PorosityMap:
        """Return the map of a box alone."""

        def at(part: Box) -> _Floats:
            z, y, x = (
                slice(whole.start + inner.start, whole.start + inner.stop)
                for whole, inner in zip(box, part, strict=True)
            )
            return self.at((z, y, x))

        z, y, x = (part.stop - part.start for part in box)
        return PorosityMap(at, (z, y, x))

    @cached_property
    def figures(self) -> dict[str, float]:
        """The ``lowest`` value, the ``highest`` and the ``mean``."""
        depth, *edges = self.shape
        y, x = (slice(0, n) for n in edges)
        found = []
        for z in range(depth):  # A plane at a time: the whole may not fit into memory.
            plane = self.at((slice(z, z + 1), y, x))
            found.append((plane.min(), plane.max(), plane.mean(dtype=np.float64)))
        lowest, highest, mean = np.array(found).T
        return {
            "lowest": float(lowest.min()),
            "highest": float(highest.max()),
            "mean": float(mean.mean()),
        }


def as_porosity(
    porosity: PorosityLike | None,
    shape: tuple[int, int, int],
    voxel_size: tuple[float, float, float],
) -> float | PorosityMap | None:
    """Return a porosity as a number, or as a map of the output.

    Parameters
    ----------
    porosity : float, Volume, array_like or callable, optional
        See `PorosityLike`.
    shape : (int, int, int)
        Shape (z, y, x) of the output.
    voxel_size : (float, float, float)
        Edges of a voxel.

    Returns
    -------
    float, PorosityMap or None
        None stands for the exemplar's own.

    Raises
    ------
    ParameterError
        If a value is not between 0 and 1, or a map is finer than the output or not a volume.
    """
    if porosity is None:
        return None
    if callable(porosity):
        return _checked(_of_function(porosity, shape, voxel_size))
    values = np.asarray(porosity)
    if values.ndim == 0 and values.dtype.kind in "buif":
        number = float(values)
        if not 0 < number < 1:
            raise ParameterError("porosity", number, "must be above 0 and below 1")
        return number
    if values.ndim != 3 or values.size == 0 or values.dtype.kind not in "buif":
        what = f"array of shape {values.shape} and type {values.dtype}"
        raise ParameterError("porosity", what, "must be a number or a map of numbers (z, y, x)")
    if any(n > m for n, m in zip(values.shape, shape, strict=True)):
        allowed = f"must not be finer than the output, {shape}"
        raise ParameterError("porosity", f"map of shape {values.shape}", allowed)
    if values.shape == shape:
        return _checked(PorosityMap(lambda box: np.asarray(values[box], np.float32), shape))
    return _checked(PorosityMap(lambda box: interpolated(values, shape, box=box), shape))


def _of_function(
    function: Callable[..., npt.ArrayLike],
    shape: tuple[int, int, int],
    voxel_size: tuple[float, float, float],
) -> PorosityMap:
    """Evaluate a function of position; what depends on one axis alone is kept along that one."""
    places = [(np.arange(n) + 0.5) * edge for n, edge in zip(shape, voxel_size, strict=True)]
    z, y, x = np.meshgrid(*places, indexing="ij", sparse=True)
    try:
        values = np.broadcast_to(np.asarray(function(z, y, x), np.float32), shape)
    except (TypeError, ValueError) as error:
        allowed = f"must give an array that broadcasts to {shape} ({error})"
        raise ParameterError("porosity", function, allowed) from error
    return PorosityMap(lambda box: values[box], shape)


def _checked(found: PorosityMap) -> PorosityMap:
    figures = found.figures
    if not (figures["lowest"] > 0 and figures["highest"] < 1):
        what = "map from {lowest:.3g} to {highest:.3g}".format(**figures)
        raise ParameterError("porosity", what, "must be above 0 and below 1 everywhere")
    return found
