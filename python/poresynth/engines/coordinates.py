"""Structure that turns, stretches and scales from place to place: coordinates of the material."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from scipy import fft, ndimage

from poresynth.engines.interpolation import interpolated
from poresynth.errors import ParameterError
from poresynth.volume import Volume

__all__ = ["Coordinates", "FieldLike", "material_coordinates"]

FieldLike = Volume | npt.ArrayLike | Callable[..., npt.ArrayLike]
"""A field over the output: an array, or a function of the coordinates z, y, x of its voxels."""

_Floats = npt.NDArray[np.float32]
Shape = tuple[int, int, int]

NODES = 64
"""Most nodes an axis at which coordinates are solved for: fields of users are smooth."""
MOST_SCALE = 8.0
"""Largest factor by which structure is stretched or reduced."""


@dataclass(frozen=True, eq=False)
class Coordinates:
    """Where in the material each voxel of the output lies.

    Attributes
    ----------
    nodes : numpy.ndarray of float32
        Coordinates (z, y, x) in the material, in voxels, at the nodes of a coarse grid over the
        output, shape (3, a, b, c).
    shape : (int, int, int)
        Shape of the output.
    room : (int, int, int)
        Shape of the material that is needed.
    angle : float
        Mean angle between the wanted direction and the one that the coordinates give, degrees.
    scale : float
        Mean difference between the wanted scale and that of the coordinates, a fraction.
    """

    nodes: _Floats
    shape: Shape
    room: Shape
    angle: float
    scale: float

    def places(self, z: slice) -> _Floats:
        """Return the coordinates of some planes of voxels, shape (3, planes, y, x)."""
        return np.stack(
            [interpolated(axis, self.shape, box=(z,), beyond=True) for axis in self.nodes]
        )

    def domain(self, inside: npt.NDArray[np.bool_] | None) -> npt.NDArray[np.bool_]:
        """Return which voxels of the material the output, or a part of it, is made of."""
        used = np.zeros(self.room, np.bool_)
        for z in range(self.shape[0]):
            places = np.rint(self.places(slice(z, z + 1))[:, 0]).astype(np.intp)
            if inside is not None:
                places = places[:, inside[z]]
            used[tuple(places.reshape(3, -1))] = True
        # Enlarged structure leaves voxels between, and interpolation looks at neighbours.
        spread = 1 + int(np.ceil(self._reduction()))
        return np.asarray(ndimage.maximum_filter(used, 2 * spread + 1))

    def _reduction(self) -> float:
        """Most voxels of the material from one voxel of the output to the next."""
        steps = [
            np.abs(np.diff(self.nodes, axis=axis + 1)).max(initial=0.0)
            * (self.nodes.shape[axis + 1] / n)
            for axis, n in enumerate(self.shape)
        ]
        return float(max(steps))

    def carry(self, field: _Floats, order: Literal[0, 1] = 1) -> _Floats:
        """Bring a field of the material to the output.

        Parameters
        ----------
        field : numpy.ndarray of float32
            Shape (channel, *room).
        order : {0, 1}, default 1
            Take the nearest voxel, or interpolate linearly.

        Returns
        -------
        numpy.ndarray of float32
            Shape (channel, z, y, x).
        """
        carried = np.empty((len(field), *self.shape), np.float32)
        step = max(1, 2**22 // (self.shape[1] * self.shape[2]))
        for first in range(0, self.shape[0], step):
            planes = slice(first, min(first + step, self.shape[0]))
            places = self.places(planes)
            for source, target in zip(field, carried, strict=True):
                ndimage.map_coordinates(
                    source, places, output=target[planes], order=order, mode="nearest"
                )
        return carried

    def provenance(self) -> dict[str, Any]:
        """Return what a result says of its coordinates."""
        return {
            "material_shape": list(self.room),
            "mean_angle_degrees": self.angle,
            "mean_scale_error_percent": 100 * self.scale,
        }


def material_coordinates(
    shape: Shape,
    voxel_size: tuple[float, float, float],
    orientation: FieldLike | None,
    scale: float | FieldLike | None,
    axis: Literal["z", "y", "x"] = "z",
    least: int = 1,
) -> Coordinates:
    """Find coordinates in which the wanted structure is the exemplar's own.

    Parameters
    ----------
    shape : (int, int, int)
        Shape (z, y, x) of the output.
    voxel_size : (float, float, float)
        Edges of a voxel, for functions of position.
    orientation : Volume, array_like or callable, optional
        Vectors (z, y, x), shape (z, y, x, 3) or coarser, or a function of the voxels' coordinates
        that gives them: along them the exemplar's ``axis`` shall run, and by their length it shall
        be stretched. Opposite vectors mean the same.
    scale : float, Volume, array_like or callable, optional
        Factor by which the structure shall be larger than the exemplar's, 1/8 to 8.
    axis : {"z", "y", "x"}, default "z"
        The exemplar's axis that follows the vectors.
    least : int, default 1
        Smallest edge of the material.

    Returns
    -------
    Coordinates

    Raises
    ------
    ParameterError
        If a field is something else.

    Notes
    -----
    Few fields of directions are those of coordinates: a twist tears any lattice. The coordinates
    are the nearest in least squares, which one Poisson equation an axis gives (by cosine
    transforms, at most 64 nodes an axis); how far they are from what was wanted is measured.

    Peak memory: 15 MB, and what is carried.
    """
    if axis not in ("z", "y", "x"):
        raise ParameterError("axis", axis, "must be 'z', 'y' or 'x'")
    nodes = tuple(min(n, NODES) for n in shape)
    vectors = None
    if orientation is not None:
        vectors = _on_nodes("orientation", orientation, shape, nodes, voxel_size, 3)
    factor = np.ones((*nodes, 1), np.float32)
    if scale is not None:
        factor = _on_nodes("scale", scale, shape, nodes, voxel_size, 1)
    wanted = _jacobians(vectors, factor[..., 0], "zyx".index(axis))
    spacing = [n / m for n, m in zip(shape, nodes, strict=True)]
    solved = np.stack([_integrated(wanted[..., i, :], spacing) for i in range(3)])
    angle, error = _deviation(solved, wanted, spacing, "zyx".index(axis))
    low = solved.min(axis=(1, 2, 3), keepdims=True)
    # One voxel beyond on each side, for interpolation.
    solved = solved - low + 1
    z, y, x = (max(int(np.ceil(most)) + 2, least) for most in solved.max(axis=(1, 2, 3)))
    return Coordinates(solved.astype(np.float32), shape, (z, y, x), angle, error)


def _on_nodes(
    name: str,
    field: Any,
    shape: Shape,
    nodes: tuple[int, ...],
    voxel_size: tuple[float, float, float],
    channels: int,
) -> npt.NDArray[np.float32]:
    """Return a field at the nodes, shape (*nodes, channels)."""
    if callable(field):
        places = [
            (np.arange(m) + 0.5) * (n / m) * edge
            for n, m, edge in zip(shape, nodes, voxel_size, strict=True)
        ]
        z, y, x = np.meshgrid(*places, indexing="ij", sparse=True)
        try:
            values = np.asarray(field(z, y, x), np.float32)
            values = values[..., None] if channels == 1 else values
            values = np.broadcast_to(values, (*nodes, channels))
        except (TypeError, ValueError) as error:
            allowed = f"must give values that broadcast to the voxels ({error})"
            raise ParameterError(name, field, allowed) from error
    else:
        values = np.asarray(field)
        if values.dtype.kind not in "uif":
            raise ParameterError(name, f"values of type {values.dtype}", "must be numbers")
        values = values.astype(np.float32)
        if channels == 1 and values.ndim in (0, 3):
            values = values[..., None]
        if values.ndim == 1:
            values = values.reshape(1, 1, 1, -1)
        finer = values.ndim == 4 and any(n > m for n, m in zip(values.shape, shape, strict=False))
        if values.ndim != 4 or values.shape[3] != channels or values.size == 0 or finer:
            each = "vectors (z, y, x, 3)" if channels == 3 else "a number, or numbers (z, y, x)"
            what = f"array of shape {values.shape}"
            raise ParameterError(name, what, f"must be {each}, not finer than {shape}")
        values = np.stack(
            [interpolated(values[..., c], nodes, beyond=True) for c in range(channels)], axis=-1
        )
    if not np.isfinite(values).all():
        raise ParameterError(name, "NaN or infinite", "must be finite")
    size = np.linalg.norm(values, axis=-1) if channels == 3 else values[..., 0]
    if not (size >= 1 / MOST_SCALE).all() or not (size <= MOST_SCALE).all():
        what = f"from {size.min():.3g} to {size.max():.3g}"
        allowed = f"must {'have a length' if channels == 3 else 'be'} from 1/8 to 8 everywhere"
        raise ParameterError(name, what, allowed)
    return values


def _jacobians(
    vectors: npt.NDArray[np.float32] | None, factor: npt.NDArray[np.float32], axis: int
) -> npt.NDArray[np.float64]:
    """Return the wanted derivatives of the material's coordinates, shape (*nodes, 3, 3).

    A vector of the output is turned back by R, which takes the exemplar's axis to the direction on
    the shortest way, shrunk along the direction by its length, and by the scale.
    """
    wanted = np.broadcast_to(np.eye(3), (*factor.shape, 3, 3))
    if vectors is not None:
        length = np.linalg.norm(vectors, axis=-1).astype(np.float64)
        direction = vectors / length[..., None]
        direction = direction * np.where(direction[..., axis] < 0, -1, 1)[..., None]
        own = np.eye(3)[axis]
        cross = np.cross(own, direction)
        skew = np.zeros((*factor.shape, 3, 3))
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            skew[..., i, j], skew[..., j, i] = -cross[..., k], cross[..., k]
        cosine = direction[..., axis, None, None]
        turn = np.eye(3) + skew + skew @ skew / (1 + cosine)
        along = direction[..., :, None] * direction[..., None, :]
        shrink = np.eye(3) + (1 / length - 1)[..., None, None] * along
        wanted = np.swapaxes(turn, -1, -2) @ shrink
    return np.asarray(wanted / factor[..., None, None], np.float64)


def _integrated(gradient: npt.NDArray[np.float64], spacing: list[float]) -> npt.NDArray[np.float64]:
    """Return the function whose differences from node to node are nearest to those wanted.

    The normal equations are Poisson's with Neumann borders, diagonal in cosines.
    """
    shape = gradient.shape[:3]
    divergence = np.zeros(shape)
    symbol = np.zeros(shape)
    for axis, h in enumerate(spacing):
        along = np.moveaxis(gradient[..., axis], axis, 0)
        flow = h * (along[1:] + along[:-1]) / 2
        here = np.moveaxis(divergence, axis, 0)
        here[:-1] += flow
        here[1:] -= flow
        n = shape[axis]
        waves = 2 - 2 * np.cos(np.pi * np.arange(n) / n)
        symbol += waves.reshape([-1 if i == axis else 1 for i in range(3)])
    symbol[0, 0, 0] = 1
    spectrum = -fft.dctn(divergence, norm="ortho") / symbol
    spectrum[0, 0, 0] = 0
    return np.asarray(fft.idctn(spectrum, norm="ortho"), np.float64)


def _deviation(
    solved: npt.NDArray[np.float64],
    wanted: npt.NDArray[np.float64],
    spacing: list[float],
    axis: int,
) -> tuple[float, float]:
    """Return the mean angle in degrees and the mean difference of scale of what was solved."""
    if min(solved.shape[1:]) < 2:
        return 0.0, 0.0
    found = np.stack(
        [np.stack(np.gradient(component, *spacing), axis=-1) for component in solved], axis=-2
    )
    regular = np.abs(np.linalg.det(found)) > 1e-6
    found, wanted = found[regular], wanted[regular]
    ways = [np.linalg.inv(jacobian)[..., :, axis] for jacobian in (found, wanted)]
    ways = [way / np.linalg.norm(way, axis=-1, keepdims=True) for way in ways]
    cosine = np.abs((ways[0] * ways[1]).sum(axis=-1))
    angle = float(np.degrees(np.arccos(np.clip(cosine, 0, 1))).mean()) if len(cosine) else 90.0
    sizes = [np.abs(np.linalg.det(jacobian)) ** (-1 / 3) for jacobian in (found, wanted)]
    return angle, float(np.abs(sizes[0] / sizes[1] - 1).mean()) if len(cosine) else 1.0
