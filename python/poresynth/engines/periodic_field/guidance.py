"""Guidance factors: what a field is conditioned on (ipfn_2022 §3.3, §4.5)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from poresynth import _core
from poresynth.engines.phases import Phases
from poresynth.errors import ParameterError

__all__ = ["Factors", "Guidance", "Guide", "density", "implicit_plane", "mean_distance", "ranks"]

Field = npt.NDArray[np.float32]
Guidance = float | tuple[float, float] | npt.NDArray[Any]
"""A number; two, from the first voxel along x to the last; or a map of as many axes as the output,
of any shape, whose outermost points are the outermost voxels."""


def implicit_plane(lines: Sequence[npt.NDArray[Any]], coefficients: Sequence[float]) -> Field:
    """Return g = a x + b y + c of an image, or a x + b y + c z + d of a volume (§3.3).

    Parameters
    ----------
    lines : sequence of numpy.ndarray
        Coordinates of the points along (y, x) or (z, y, x).
    coefficients : sequence of float
        a, b, c, or a, b, c, d: one for each of x, y, z, then the constant.

    Returns
    -------
    numpy.ndarray
        Shape (y, x) or (z, y, x).

    Raises
    ------
    ParameterError
        If there is not one coefficient an axis and one more, or all but the last vanish.
    """
    normal = coefficients[:-1]
    if len(normal) != len(lines) or not any(normal) or not np.isfinite(coefficients).all():
        names = "a, b, c (a x + b y + c)" if len(lines) == 2 else "a, b, c, d (a x + b y + c z + d)"
        raise ParameterError("direction", tuple(coefficients), f"must be {names}, not constant")
    grid = np.meshgrid(*lines, indexing="ij")
    g = sum(factor * line for factor, line in zip(normal, reversed(grid), strict=True))
    return np.asarray(g + coefficients[-1], np.float32)


def mean_distance(distance: npt.NDArray[np.floating[Any]], edge: int) -> Field:
    """Return Eq. 6 of the patch around each point: the mean distance to the surface.

    Parameters
    ----------
    distance : numpy.ndarray
        Signed distances, any number of axes.
    edge : int
        Edge of a patch, at most that of the field; m of Eq. 6 is its number of points. Beyond the
        border the field is mirrored.

    Returns
    -------
    numpy.ndarray
        Of the same shape. The patch of a point p is p − edge // 2 … p − edge // 2 + edge − 1.
    """
    edges = [min(edge, n) for n in distance.shape]
    absolute = np.abs(distance).astype(np.float64)
    mean: Field = ndimage.uniform_filter(absolute, edges, mode="reflect").astype(np.float32)
    return mean


def density(solid: npt.NDArray[np.bool_], edge: int) -> Field:
    """Return how dense the structure is around each voxel (§4.5).

    Parameters
    ----------
    solid : numpy.ndarray of bool
        Shape (z, y, x), or (1, y, x) of an image.
    edge : int
        Edge of the patches of Eq. 6: that of the crops.

    Returns
    -------
    numpy.ndarray
        Of the same shape: minus Eq. 6, whose large values mean large holes.
    """
    distance = _core.signed_distance(solid, edge, boundary="open")
    return -mean_distance(distance, edge)


@dataclass(frozen=True, eq=False)
class Guide:
    """A guidance factor at every voxel of an output, linear between the points of a map.

    Attributes
    ----------
    map : numpy.ndarray
        At least one point along each axis, (z, y, x), the outermost ones on the outermost voxels.
    shape : (int, int, int)
        Of the output.
    """

    map: Field
    shape: tuple[int, int, int]

    def at(self, positions: Sequence[npt.NDArray[Any]]) -> Field:
        """Return the factor on a grid of voxels (z, y, x); beyond the output its border's."""
        values = self.map
        for axis, place in enumerate(positions):
            count, edge = self.map.shape[axis], self.shape[axis]
            share = np.clip(place / max(edge - 1, 1), 0, 1) * (count - 1)
            low = np.minimum(share.astype(np.intp), max(count - 2, 0))
            high = np.minimum(low + 1, count - 1)
            weight = (share - low).astype(np.float32)
            weight = weight.reshape([-1 if i == axis else 1 for i in range(3)])
            values = values.take(low, axis) * (1 - weight) + values.take(high, axis) * weight
        return np.asarray(values, np.float32)


@dataclass(frozen=True, eq=False)
class Factors:
    """What numbers of a user mean for the guidance factor of an exemplar.

    Attributes
    ----------
    kind : {"density", "direction", "map"}
    direction : tuple of float
        Coefficients of the line or plane.
    low, high : float
        The factors, in the user's unit, that the network knows as 0 and 1. A density is the share
        of the exemplar's patches that are less dense: 0 the least dense of them, 0.5 their median,
        1 the densest. Eq. 6 itself, scaled from least to most, has nearly all patches in a small
        part of its range, and hardly any weight beside the structure.
    mean : float
        Mean over the exemplar, or its patches, 0 to 1.
    """

    kind: str
    direction: tuple[float, ...]
    low: float
    high: float
    mean: float

    @classmethod
    def of(
        cls,
        kind: str,
        direction: tuple[float, ...] | None,
        phases: Phases,
        crop: int,
        given: npt.NDArray[Any] | None,
    ) -> tuple[Factors, Field] | None:
        """Find the factor of an exemplar, None without guidance.

        The second is the factor at every voxel, scaled to 0 … 1, shape (z, y, x).

        Parameters
        ----------
        kind, direction, crop
            The parameters; patches of the density are as large as crops.
        phases : Phases
            Of the exemplar.
        given : numpy.ndarray or None
            The user's map.

        Raises
        ------
        ParameterError
            If a map is missing, or given without need; if the factor is not finite, or the same
            everywhere.
        """
        shape = phases.phase.shape
        flat = shape[1:] if shape[0] == 1 else shape
        if (given is not None) != (kind == "map"):
            allowed = "must be given with the parameter guidance = 'map', and only then"
            raise ParameterError("guidance", "no map" if given is None else "a map", allowed)
        if kind == "none":
            return None
        if kind == "density":
            if len(phases.labels) > 2:
                raise ParameterError("guidance", kind, "must not be taken of more than two phases")
            values = ranks(density(phases.phase > 0, crop), crop)
        elif kind == "direction":
            values = implicit_plane([_line(n) for n in flat], direction or ()).reshape(shape)
        else:
            values = np.asarray(given, np.float64)
            if values.shape not in (shape, flat):
                allowed = f"must have the shape of the exemplar, {flat}"
                raise ParameterError("guidance", f"a map of shape {values.shape}", allowed)
            values = values.reshape(shape)
        low, high = float(values.min()), float(values.max())
        if not (np.isfinite(low) and np.isfinite(high) and high > low):
            raise ParameterError("guidance", kind, "must be finite, and not the same everywhere")
        if kind == "density":
            low, high = 0.0, 1.0
        scaled = ((values - low) / (high - low)).astype(np.float32)
        mean = 0.5 if kind == "density" else float(scaled.mean())
        return cls(kind, direction or (), low, high, mean), scaled

    def guide(self, guidance: Guidance | None, shape: tuple[int, int, int]) -> Guide:
        """Return the guidance of an output.

        Parameters
        ----------
        guidance : float, (float, float), numpy.ndarray or None
            In the user's unit. None: of a direction the same line or plane, on coordinates that
            span the output; else the exemplar's mean.
        shape : (int, int, int)
            Of the output.

        Raises
        ------
        ParameterError
            If it is not finite, or has other axes.
        """
        axes = 2 if shape[0] == 1 else 3
        if guidance is None and self.kind == "direction":
            ends = [np.array([-1.0, 1 - 2 / n]) for n in shape[3 - axes :]]
            guidance = implicit_plane(ends, self.direction)
        elif guidance is None:
            guidance = self.low + (self.high - self.low) * self.mean
        values = np.asarray(guidance, np.float64)
        if values.ndim == 0 or (isinstance(guidance, (tuple, list)) and values.shape == (2,)):
            values = values.reshape(1, 1, -1)
        elif values.ndim == axes:
            values = values.reshape((1,) * (3 - axes) + values.shape)
        if values.ndim != 3 or not values.size or not np.isfinite(values).all():
            allowed = f"must be a number, two, or a map of {axes} axes, and finite"
            raise ParameterError("guidance", f"shape {values.shape}", allowed)
        return Guide(((values - self.low) / (self.high - self.low)).astype(np.float32), shape)


def ranks(values: Field, edge: int) -> Field:
    """Return the share of the patches inside the exemplar whose value is less, 0 to 1.

    Parameters
    ----------
    values : numpy.ndarray of float32
        A value for the patch around each voxel, shape (z, y, x).
    edge : int
        Edge of a patch, voxels.
    """
    inner = tuple(
        slice(edge // 2, n - edge + edge // 2 + 1) if n > 1 else slice(None) for n in values.shape
    )
    own = np.sort(values[inner], axis=None)
    less = (np.searchsorted(own, values, side) for side in ("left", "right"))
    return np.asarray(sum(less) / (2 * own.size), np.float32)


def _line(edge: int) -> npt.NDArray[np.float64]:
    """Return the coordinates 2 p / n − 1 of n voxels along an axis: −1 to nearly 1."""
    return 2 * np.arange(edge) / edge - 1
