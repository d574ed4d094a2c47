"""Euler number, connectivity and Betti numbers: how a phase hangs together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from poresynth import _core
from poresynth.errors import ParameterError
from poresynth.metrics.arguments import PhaseLike, as_phase, scale_of

__all__ = [
    "BettiNumbers",
    "Connectivity",
    "EulerDensity",
    "betti_numbers",
    "connectivity_density",
    "euler_density",
    "euler_number",
]

Boundary = Literal["open", "periodic"]
VoxelSize = float | tuple[float, float, float]


@dataclass(frozen=True)
class BettiNumbers:
    """Betti numbers of a phase; their alternating sum b0 − b1 + b2 is the Euler number.

    Attributes
    ----------
    b0 : int
        Components.
    b1 : int
        Tunnels: handles that can be cut before a component falls apart.
    b2 : int
        Cavities: parts of the complement that the phase encloses.
    """

    b0: int
    b1: int
    b2: int


@dataclass(frozen=True)
class Connectivity:
    """Connectivity of a sample of a larger body.

    Attributes
    ----------
    euler_number : int
        χ of the sample as if it floated in space.
    edge_corrected : float
        Δχ, the sample's share in the Euler number of the body that it was cut from; a multiple of
        one eighth.
    connectivity : float
        1 − Δχ: the number of trabeculae that can be cut before the body falls apart, if it is one
        piece without cavities.
    density : float
        Conn.D: connectivity by volume, in ``unit`` to the power of −3.
    volume : float
        Volume of the sample, phase and complement, in ``unit`` to the power of 3.
    unit : str
        Unit of length.
    """

    euler_number: int
    edge_corrected: float
    connectivity: float
    density: float
    volume: float
    unit: str


@dataclass(frozen=True)
class EulerDensity:
    """Euler number by volume.

    Attributes
    ----------
    euler : float
        Euler number of the volume: χ if it is periodic, Δχ of `Connectivity` if it is open.
    density : float
        χ_V in ``unit`` to the power of −3; NaN for an open volume of one voxel along an axis.
    unit : str
        Unit of length.
    """

    euler: float
    density: float
    unit: str


def euler_number(
    solid: PhaseLike,
    *,
    phase: int | None = None,
    connectivity: Literal[26, 6] = 26,
    boundary: Boundary = "open",
    threads: int = 0,
) -> int:
    """Return the Euler number χ of a phase: components − tunnels + cavities.

    Parameters
    ----------
    solid : Volume or array_like
        The phase, shape (z, y, x): bool, or at most 16 values of which 0 is not in it.
    phase : int, optional
        The value that is the phase, instead of all but 0.
    connectivity : {26, 6}, default 26
        Neighbours that touch in the phase; in the complement it is the other one. If the solid is
        measured with 26, its pore goes with 6.
    boundary : {"open", "periodic"}, default "open"
        Open: the phase ends at the border, as if it floated in space. Periodic: it goes on at the
        opposite face.
    threads : int, default 0
        Number of threads; 0 takes all cores. The number does not depend on it.

    Returns
    -------
    int
        0 for an empty phase.

    Raises
    ------
    ParameterError
        If a parameter is outside its range.

    Notes
    -----
    χ = V − E + F − C over the vertices, edges, faces and cubes of a cubic complex: 26-connected
    voxels are closed unit cubes; 6-connected voxels are its vertices, and an edge, a face or a cube
    is in it where all of its voxels are. Rotations, flips and padding do not change χ. That of a
    whole periodic volume is 0, which is χ of the 3-torus.

    ``skimage.measure.euler_number`` agrees for both connectivities. ``quantimpy`` is 6-connected,
    gives what touches the border of the array a smaller weight, and is off by fractions where five
    or six voxels of a 2 × 2 × 2 block form a chain or a ring.

    Peak memory: less than 1 byte a voxel of two planes for each thread.
    """
    return _core.euler_number(
        as_phase(solid, phase=phase),
        connectivity=_pair(connectivity),
        boundary=boundary,
        threads=threads,
    )


def connectivity_density(
    solid: PhaseLike,
    *,
    phase: int | None = None,
    voxel_size: VoxelSize | None = None,
    connectivity: Literal[26, 6] = 26,
    threads: int = 0,
) -> Connectivity:
    """Return the connectivity of a sample of a larger body, and Conn.D.

    Parameters
    ----------
    solid, phase, connectivity, threads
        As for `euler_number`. Conn.D of bone is defined with 26.
    voxel_size : float or (float, float, float), optional
        Edges of a voxel along (z, y, x), instead of the volume's own.

    Returns
    -------
    Connectivity

    Raises
    ------
    ParameterError
        If a parameter is outside its range.

    Notes
    -----
    Odgaard & Gundersen (1993): what lies in a face of the sample belongs to two samples, in an edge
    to four, in a corner to eight, hence

        Δχ = χ − ½ Σ χ(6 faces) + ¼ Σ χ(12 edges) − ⅛ Σ χ(8 corners),

    where a face is a border plane of voxels, an edge a border row and a corner a voxel. (Over the
    *unions* of faces, edges and corners the same reads χ − ½ χ₂ − ¼ χ₁ − ⅛ χ₀, which is what BoneJ
    computes.) Δχ adds up exactly over samples that share their border planes, so that over the
    tiles of a periodic volume it gives the periodic Euler number.

    The density is by the volume of all voxels, as in BoneJ. The sample spans, strictly, the centres
    of its border voxels only; `euler_density` divides by that.

    Connectivity is negative where parts or cavities outnumber tunnels: remove them first
    (`largest_part`, on the phase and on its complement), as BoneJ asks.

    Peak memory: less than 1 byte a voxel of two planes for each thread.
    """
    array = as_phase(solid, phase=phase)
    scale = scale_of(solid, voxel_size)
    euler, eighths = _core.euler_corrected(array, connectivity=_pair(connectivity), threads=threads)
    corrected = eighths / 8
    volume = float(array.size * np.prod(scale.voxel_size))
    return Connectivity(
        euler, corrected, 1 - corrected, (1 - corrected) / volume, volume, scale.unit
    )


def euler_density(
    solid: PhaseLike,
    *,
    phase: int | None = None,
    voxel_size: VoxelSize | None = None,
    connectivity: Literal[26, 6] = 26,
    boundary: Boundary = "open",
    threads: int = 0,
) -> EulerDensity:
    """Return the Euler number of a phase by volume: χ_V, a Minkowski functional.

    Parameters
    ----------
    solid, phase, connectivity, boundary, threads
        As for `euler_number`. An open volume is taken as a sample of a larger body.
    voxel_size : float or (float, float, float), optional
        Edges of a voxel along (z, y, x), instead of the volume's own.

    Returns
    -------
    EulerDensity

    Raises
    ------
    ParameterError
        If a parameter is outside its range.

    Notes
    -----
    Periodic: χ by the volume of all voxels. Open: the edge-corrected Δχ of `connectivity_density`
    by the volume between the centres of the border voxels, which is free of bias: the mean over all
    windows of a periodic volume is its periodic density.

    Peak memory: less than 1 byte a voxel of two planes for each thread.
    """
    array = as_phase(solid, phase=phase)
    scale = scale_of(solid, voxel_size)
    pair = _pair(connectivity)
    edges = np.array(array.shape, float)
    if boundary == "open":
        edges -= 1
        euler = _core.euler_corrected(array, connectivity=pair, threads=threads)[1] / 8
    else:
        euler = float(
            _core.euler_number(array, connectivity=pair, boundary=boundary, threads=threads)
        )
    volume = float(np.prod(edges * scale.voxel_size))
    return EulerDensity(euler, euler / volume if volume else float("nan"), scale.unit)


def betti_numbers(
    solid: PhaseLike,
    *,
    phase: int | None = None,
    connectivity: Literal[26, 6] = 26,
    threads: int = 0,
) -> BettiNumbers:
    """Count the components, tunnels and cavities of a phase.

    Parameters
    ----------
    solid, phase, connectivity, threads
        As for `euler_number`. The phase ends at the border, and beyond it lies the complement.

    Returns
    -------
    BettiNumbers

    Raises
    ------
    ParameterError
        If a parameter is outside its range.

    Notes
    -----
    b0 counts the components of the phase, b2 those of the complement, in its own connectivity, that
    do not touch the border; b1 = b0 + b2 − χ.

    Peak memory: 1 bit a voxel, 12 bytes a run of voxels along the rows, and 80 bytes a component of
    the complement.
    """
    array = as_phase(solid, phase=phase)
    pair = _pair(connectivity)
    b0 = len(_core.component_sizes(array, connectivity=pair, boundary="open", threads=threads))
    b2 = _core.cavities(array, connectivity=32 - pair, threads=threads)
    euler = _core.euler_number(array, connectivity=pair, boundary="open", threads=threads)
    return BettiNumbers(b0, b0 + b2 - euler, b2)


def _pair(connectivity: int) -> int:
    """Return the connectivity of the phase if the complement can have the other one."""
    if connectivity not in (6, 26):
        raise ParameterError("connectivity", connectivity, "must be 6 or 26")
    return connectivity
