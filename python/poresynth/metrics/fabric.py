"""Mean intercept length in many directions, and the fabric tensor made of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from poresynth import _core
from poresynth.errors import ParameterError
from poresynth.metrics.arguments import PhaseLike, as_phase, scale_of

__all__ = ["Fabric", "mean_intercept_length"]

Boundary = Literal["open", "periodic"]
_Array = npt.NDArray[np.float64]

_REACH = {13: 1, 49: 2, 145: 3}
"""Largest component of the lattice vectors that make so many directions."""


@dataclass(frozen=True, eq=False)
class Fabric:
    """Mean intercept length and the ellipsoid fitted to it.

    Vectors are (z, y, x). Lengths are in ``unit``; those without an intercept are infinite.

    Attributes
    ----------
    directions : numpy.ndarray
        Unit vectors, one of each pair of opposites, shape (n, 3).
    mil : numpy.ndarray
        Mean intercept length along each direction: length of the lines by the number of times that
        they enter or leave the phase. Shape (n,).
    weights : numpy.ndarray
        Share of all directions that each stands for; they add up to 1. Shape (n,).
    tensor : numpy.ndarray
        Symmetric, shape (3, 3): M of the ellipsoid 1 / MIL² = uᵀ M u (Harrigan and Mann 1984).
    eigenvalues : numpy.ndarray
        Eigenvalues of M, ascending: the first belongs to the longest axis. Shape (3,).
    eigenvectors : numpy.ndarray
        Axes of the ellipsoid, unit vectors in columns, in the order of the eigenvalues; the largest
        component is positive. Shape (3, 3).
    principal_mil : numpy.ndarray
        Half axes of the ellipsoid, longest first: MIL1, MIL2, MIL3. Shape (3,).
    degree_of_anisotropy : float
        DA = 1 − (shortest / longest half axis)², as in BoneJ: 0 for an isotropic phase, 1 for
        plates and straight rods. NaN if no line meets a surface.
    axis_ratio : float
        Longest by shortest half axis: the degree of anisotropy of other programs, from 1 to
        infinity.
    mil_mean : float
        Length of lines in all directions by their number of intercepts. 2 / ``mil_mean`` is the
        specific surface.
    mil_z, mil_y, mil_x : float
        Mean intercept length along the axes of the volume.
    unit : str
        Unit of length.
    """

    directions: _Array
    mil: _Array
    weights: _Array
    tensor: _Array
    eigenvalues: _Array
    eigenvectors: _Array
    principal_mil: _Array
    degree_of_anisotropy: float
    axis_ratio: float
    mil_mean: float
    mil_z: float
    mil_y: float
    mil_x: float
    unit: str


def mean_intercept_length(
    solid: PhaseLike,
    *,
    phase: int | None = None,
    voxel_size: float | tuple[float, float, float] | None = None,
    directions: Literal[13, 49, 145] = 49,
    boundary: Boundary = "open",
    threads: int = 0,
) -> Fabric:
    """Measure the mean intercept length of a phase and fit the fabric tensor.

    Parameters
    ----------
    solid : Volume or array_like
        The phase, shape (z, y, x): bool, or at most 16 values of which 0 is not in it. It and the
        rest have the same intercepts. At least 2 voxels along each axis unless periodic.
    phase : int, optional
        The value that is the phase, instead of all but 0.
    voxel_size : float or (float, float, float), optional
        Edges of a voxel along (z, y, x), instead of the volume's own; 1 for plain arrays.
    directions : {49, 13, 145}, default 49
        Number of directions: all whose lattice vectors have components of at most 2, 1 or 3. More
        directions fit the ellipsoid better (the degree of anisotropy is within 0.02, 0.06 and 0.01
        of that of all directions for crossing plates), but their steps miss more: from 3, 1.7 and
        4.7 voxels on they are certain to see a feature, and flat ones already from 2 with 49.
    boundary : {"open", "periodic"}, default "open"
        Open: lines end at the border, which is no intercept. Periodic: they go on at the opposite
        face.
    threads : int, default 0
        Number of threads; 0 takes all cores. The values do not depend on it.

    Returns
    -------
    Fabric

    Raises
    ------
    ParameterError
        If a parameter is outside its range.

    Notes
    -----
    Lines run through all voxels along the vectors of the lattice, from centre to centre; there is
    no random choice and no interpolation. Each direction is divided by the length of its own lines,
    so that a cubic volume needs no spherical mask. For plates that repeat after p, MIL =
    p / (2·|cos θ|) for any tilt.

    A line that visits every voxel on its way would count the stairs of a tilted surface instead:
    for it, all surfaces lie along the axes, and a fabric tilted by 45° looks like its mirror image.

    The ellipsoid is the least-squares fit of the quadratic form M to 1 / MIL², weighted by
    ``weights``. An eigenvalue below 0, which the fit can give where a direction has hardly an
    intercept, counts as 0 in the half axes and the degree of anisotropy.

    Peak memory: some planes of one bit a voxel for bool, 1 byte a voxel more for other types.
    """
    if directions not in _REACH:
        raise ParameterError("directions", directions, "must be 13, 49 or 145")
    scale = scale_of(solid, voxel_size)
    array = as_phase(solid, phase=phase)
    if boundary == "open" and min(array.shape) < 2:
        allowed = "must be at least 2 along each axis, or the boundary periodic"
        raise ParameterError("solid.shape", array.shape, allowed)
    steps, density, weights = _core.secants(
        array, _REACH[directions], scale.voxel_size, boundary=boundary, threads=threads
    )
    vectors = steps * np.asarray(scale.voxel_size)
    units = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    tensor = _quadratic_form(units, density**2, weights)
    eigenvalues, eigenvectors = np.linalg.eigh(tensor)
    largest = np.abs(eigenvectors).argmax(axis=0)
    eigenvectors = eigenvectors * np.sign(eigenvectors[largest, range(3)])
    # Zero but for rounding: what four digits less than those of a float cannot tell from it.
    squares = np.where(eigenvalues > 1e-12 * eigenvalues[-1], eigenvalues, 0.0)
    along = [density[(steps == axis).all(axis=1)] for axis in np.eye(3, dtype=int)]
    with np.errstate(divide="ignore", invalid="ignore"):
        return Fabric(
            directions=units,
            mil=1 / density,
            weights=weights,
            tensor=tensor,
            eigenvalues=eigenvalues,
            eigenvectors=eigenvectors,
            principal_mil=1 / np.sqrt(squares),
            degree_of_anisotropy=float(1 - squares[0] / squares[2]),
            axis_ratio=float(np.sqrt(squares[2] / squares[0])),
            mil_mean=float(1 / np.dot(weights, density)),
            mil_z=float(1 / along[0][0]),
            mil_y=float(1 / along[1][0]),
            mil_x=float(1 / along[2][0]),
            unit=scale.unit,
        )


def _quadratic_form(units: _Array, values: _Array, weights: _Array) -> _Array:
    """Return the symmetric M with the least squares of uᵀ M u − value, shape (3, 3)."""
    rows, columns = np.triu_indices(3)
    products = units[:, rows] * units[:, columns] * np.where(rows == columns, 1, 2)
    root = np.sqrt(weights)
    found = np.linalg.lstsq(products * root[:, None], values * root, rcond=None)[0]
    tensor = np.empty((3, 3))
    tensor[rows, columns] = tensor[columns, rows] = found
    return tensor
