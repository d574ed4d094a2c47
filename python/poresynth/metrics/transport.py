"""Transport through the pore: effective diffusivity and permeability."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from poresynth import _core
from poresynth.errors import ParameterError
from poresynth.metrics.arguments import PhaseLike, as_phase, scale_of, whole_number

__all__ = ["Diffusivity", "Permeability", "effective_diffusivity", "permeability"]

Boundary = Literal["open", "periodic"]
Axis = Literal["z", "y", "x"]

_AXES: tuple[Axis, ...] = ("z", "y", "x")

DIFFUSION_TOLERANCE = 1e-4
"""Error of the concentration at which to stop: that of the diffusivity is its square."""

FLOW_TOLERANCE = 1e-3
"""Residual at which to stop: a sandstone's permeability is then exact to about 0.1 %."""

MOST_ITERATIONS = 1000
"""Far beyond what is needed: ten or twenty for diffusion, up to a hundred for flow."""


@dataclass(frozen=True)
class Diffusivity:
    """How a solute diffuses through the pore, along one axis.

    Attributes
    ----------
    axis : {"z", "y", "x"}
        Direction of the flux.
    diffusivity : float
        D_eff / D_0, effective diffusivity of the volume by that of the free pore: 1 without any
        solid, exactly 0 if the pore does not percolate. It is also the effective conductivity of
        an electrolyte in the pore, the inverse of the formation factor.
    tortuosity : float
        Tortuosity factor τ = ε D_0 / D_eff, with the whole porosity ε; infinite if the pore does
        not percolate.
    porosity : float
        Share of the volume that is pore.
    percolating_porosity : float
        Share of the volume that is in parts of the pore that percolate along the axis.
    flux_mismatch : float
        Largest less smallest flux through the planes across the axis, by their mean: how exactly
        the solute is conserved.
    iterations : int
        Iterations done.
    converged : bool
        Whether the tolerance was reached.
    """

    axis: Axis
    diffusivity: float
    tortuosity: float
    porosity: float
    percolating_porosity: float
    flux_mismatch: float
    iterations: int
    converged: bool


@dataclass(frozen=True)
class Permeability:
    """How a viscous fluid flows through the pore, along one axis.

    Attributes
    ----------
    axis : {"z", "y", "x"}
        Direction of the flow.
    permeability : float
        Absolute permeability k of Darcy's law, in the square of ``unit``; exactly 0 if the pore
        does not percolate, infinite if there is no solid.
    permeability_voxels : float
        The same by the square of a voxel's edge (of the cube root of its volume, if it is no cube).
    unit : str
        Unit of length; ``"voxel"`` if the scale is unknown.
    porosity : float
        Share of the volume that is pore.
    percolating_porosity : float
        Share of the volume that is in parts of the pore that percolate along the axis.
    flux_mismatch : float
        Largest less smallest flow through the planes across the axis, by their mean: how exactly
        the fluid is conserved.
    iterations : int
        Iterations done.
    converged : bool
        Whether the tolerance was reached.
    """

    axis: Axis
    permeability: float
    permeability_voxels: float
    unit: str
    porosity: float
    percolating_porosity: float
    flux_mismatch: float
    iterations: int
    converged: bool


def effective_diffusivity(
    solid: PhaseLike,
    *,
    phase: int | None = None,
    axis: Axis | int = "z",
    voxel_size: float | tuple[float, float, float] | None = None,
    boundary: Boundary = "open",
    tolerance: float = DIFFUSION_TOLERANCE,
    iterations: int = MOST_ITERATIONS,
    threads: int = 0,
    progress: Callable[[str, float], object] | None = None,
) -> Diffusivity:
    """Return the effective diffusivity and the tortuosity factor of the pore along an axis.

    Parameters
    ----------
    solid : Volume or array_like
        The phase that lets nothing through, shape (z, y, x): bool, or at most 16 values of which
        0 is not in it. The pore, which conducts, is all the rest.
    phase : int, optional
        The value that is the solid, instead of all but 0. With ``phase=0`` the rest conducts:
        the bone instead of the marrow.
    axis : {"z", "y", "x"} or int, default "z"
        Direction of the flux; 0, 1, 2 are z, y, x.
    voxel_size : float or (float, float, float), optional
        Edges of a voxel along (z, y, x), instead of the volume's own. Only their ratios matter.
    boundary : {"open", "periodic"}, default "open"
        Open: the two faces across the axis are held at two concentrations, and nothing passes the
        other faces, as in a measured sample. Periodic: the volume tiles space, and the
        concentration falls evenly from tile to tile.
    tolerance : float, default 1e-4
        Relative error of the concentration, in the norm of the dissipated energy, at which to stop.
        The error of the diffusivity is about its square, the flux mismatch about itself.
    iterations : int, default 1000
        Iterations after which to give up; a rock of 200³ voxels takes about 10.
    threads : int, default 0
        Number of threads; 0 takes all cores. The values do not depend on it.
    progress : callable, optional
        ``progress(stage, fraction)``, called between iterations on the calling thread. An exception
        in it stops the work.

    Returns
    -------
    Diffusivity

    Raises
    ------
    ParameterError
        If a parameter is outside its range.

    Notes
    -----
    Laplace's equation by finite differences (7 points) on the percolating pore voxels; voxels that
    share only an edge or a corner are not connected, as is usual (TauFactor, PuMa). It is solved by
    conjugate gradients, preconditioned with a multigrid cycle; the residual is kept in 48 bits, its
    preconditioner in 16, and of the concentration only its energy and its fluxes. Without solid
    the result is exactly 1. What limits it is resolution: stairs of voxels conduct less than the
    surface that they stand for, by 4.7 % between spheres 18 voxels across that are 40 % of the
    volume, by 2.6 % for 37 voxels, and so on with the voxel. Peak memory: 5 bytes a voxel (9
    with a periodic boundary) or, if that is more, 15 to 17 bytes a percolating voxel, 25 in narrow
    pores.

    See Also
    --------
    permeability : the same for a viscous fluid.
    """
    name, array, edges = _problem(solid, phase, axis, voxel_size)
    pore, percolating, diffusivity, mismatch, residual, done = _core.diffusivity(
        array,
        _AXES.index(name),
        (edges, _tolerance(tolerance), whole_number("iterations", iterations, 1)),
        boundary=boundary,
        threads=threads,
        progress=progress,
    )
    porosity = pore / array.size
    return Diffusivity(
        axis=name,
        diffusivity=diffusivity,
        tortuosity=porosity / diffusivity if diffusivity > 0 else math.inf,
        porosity=porosity,
        percolating_porosity=percolating / array.size,
        flux_mismatch=mismatch,
        iterations=done,
        converged=residual <= tolerance,
    )


def permeability(
    solid: PhaseLike,
    *,
    phase: int | None = None,
    axis: Axis | int = "z",
    voxel_size: float | tuple[float, float, float] | None = None,
    boundary: Boundary = "open",
    tolerance: float = FLOW_TOLERANCE,
    iterations: int = MOST_ITERATIONS,
    threads: int = 0,
    progress: Callable[[str, float], object] | None = None,
) -> Permeability:
    """Return the absolute permeability of the pore along an axis.

    Parameters
    ----------
    solid : Volume or array_like
        The phase that lets nothing through, shape (z, y, x): bool, or at most 16 values of which
        0 is not in it. The pore, where the fluid is, is all the rest.
    phase : int, optional
        The value that is the solid, instead of all but 0.
    axis : {"z", "y", "x"} or int, default "z"
        Direction of the flow; 0, 1, 2 are z, y, x.
    voxel_size : float or (float, float, float), optional
        Edges of a voxel along (z, y, x), instead of the volume's own; in the volume's unit.
    boundary : {"open", "periodic"}, default "open"
        Open: pressure is held half a voxel beyond the two faces across the axis, to where the end
        planes are prolonged; the other faces are mirrors, which neither let pass nor slow the
        fluid. Periodic: the volume tiles space, and pressure falls evenly from tile to tile.
    tolerance : float, default 1e-3
        Relative residual of the pressure, in the preconditioner's norm, at which to stop. The
        permeability of blobs, a sandstone, noise and a foam is then right to 0.06 %, or 0.01 % at
        1e-4; flows through planes differ by more, see ``flux_mismatch``.
    iterations : int, default 1000
        Iterations after which to give up; a sandstone of 200³ voxels takes 11, a foam 8.
    threads : int, default 0
        Number of threads; 0 takes all cores. The values do not depend on it.
    progress : callable, optional
        ``progress(stage, fraction)``, called between iterations on the calling thread. An exception
        in it stops the work.

    Returns
    -------
    Permeability
        1 µm² is 1.0133 darcy.

    Raises
    ------
    ParameterError
        If a parameter is outside its range.

    Notes
    -----
    k is the mean velocity over the whole volume, solid and pore, of a fluid of viscosity 1 that a
    pressure gradient of 1 drives so slowly that inertia does not count: Stokes' equations by finite
    differences on a staggered grid (marker and cell), solved by conjugate gradients for the
    pressure, with those for the velocities of one axis after the other inside.

    What limits the result is resolution. The shear at a wall takes the curvature of the profile
    between it and the opposite wall into account, so that the flow between parallel plates is
    h³ / 12 for every whole h. Elsewhere a stair of voxels is not the wall that it stands for. By
    the exact values: square ducts of 1, 4, 8 voxels 1.19, 1.06, 1.02; tubes of the radius 3, 6, 10,
    20 within ±26, 6, 2, 1 %; simple cubic arrays of spheres in cells of 16, 32, 48 voxels within
    11, 4, 2 %. Peak memory: 5 bytes a voxel (9 with a periodic boundary) or, if that is more, 6
    bytes a voxel and 10 more a percolating voxel, 18 in narrow pores, and 9 MB: 16 bytes a voxel
    for the pores of a foam, 9 for a sandstone.

    See Also
    --------
    effective_diffusivity : the same for a solute.
    """
    name, array, edges = _problem(solid, phase, axis, voxel_size)
    unit = scale_of(solid, voxel_size).unit
    pore, percolating, k, mismatch, residual, done = _core.permeability(
        array,
        _AXES.index(name),
        (edges, _tolerance(tolerance), whole_number("iterations", iterations, 1)),
        boundary=boundary,
        threads=threads,
        progress=progress,
    )
    return Permeability(
        axis=name,
        permeability=k,
        permeability_voxels=k / math.prod(edges) ** (2 / 3),
        unit=unit,
        porosity=pore / array.size,
        percolating_porosity=percolating / array.size,
        flux_mismatch=mismatch,
        iterations=done,
        converged=residual <= tolerance,
    )


def _problem(
    solid: PhaseLike,
    phase: int | None,
    axis: Any,
    voxel_size: float | tuple[float, float, float] | None,
) -> tuple[Axis, npt.NDArray[np.bool_], tuple[float, float, float]]:
    """Check the axis, the phase and the voxel size."""
    if axis in _AXES:
        name: Axis = axis
    else:
        try:
            name = _AXES[whole_number("axis", axis, 0)]
        except (ParameterError, IndexError):
            allowed = "must be 'z', 'y', 'x' or 0, 1, 2"
            raise ParameterError("axis", axis, allowed) from None
    return name, as_phase(solid, phase=phase), scale_of(solid, voxel_size).voxel_size


def _tolerance(tolerance: float) -> float:
    if not 0 < tolerance < 1:
        raise ParameterError("tolerance", tolerance, "must be above 0 and below 1")
    return float(tolerance)
