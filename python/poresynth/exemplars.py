"""Procedural exemplars: porous materials drawn from a seed, so that everything runs unaided.

All are gray uint8 volumes that look like micro-CT: two phases, blurred by a fraction of a voxel,
with noise. They are periodic: a volume continues at its opposite face.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from poresynth.errors import ParameterError
from poresynth.volume import Volume

__all__ = ["foam", "spheres", "spinodal"]

# Gray of pore and solid, blur and noise of a good micro-CT scan: the two peaks of the histogram
# lie twenty standard deviations of the noise apart, and an edge is about two voxels wide.
_PORE, _SOLID = 60.0, 190.0
_BLUR = 0.7
_NOISE = 6.0

_Shape = tuple[int, int, int]
_Size = float | tuple[float, float, float]
_Field = npt.NDArray[np.float32]


def spinodal(
    shape: _Shape = (96, 96, 96),
    *,
    porosity: float = 0.5,
    wavelength: float = 16.0,
    seed: int = 0,
    voxel_size: _Size = 1.0,
    unit: str = "voxel",
) -> Volume:
    """Draw a bicontinuous structure, as of a spinodal decomposition.

    A Gaussian random field whose spectrum is a thin shell is cut at the quantile that gives the
    porosity (Cahn, J. Chem. Phys. 42, 93 (1965)).

    Parameters
    ----------
    shape : (int, int, int), default (96, 96, 96)
        Edge lengths (z, y, x) in voxels, at least 8.
    porosity : float, default 0.5
        Fraction of pore voxels before the blur, 0.01 to 0.99.
    wavelength : float, default 16
        Distance from one ligament to the next in voxels, 4 to half of the longest edge.
    seed : int, default 0
        Same seed, same volume.
    voxel_size : float or (float, float, float), default 1.0
        Edge lengths of a voxel, in ``unit``.
    unit : str, default "voxel"
        Unit of ``voxel_size``.

    Returns
    -------
    Volume
        Gray uint8, solid bright, periodic.

    Raises
    ------
    ParameterError
        If a parameter is outside its range.

    Notes
    -----
    Peak memory: about 25 bytes per voxel.
    """
    from scipy import fft

    parameters = {"porosity": porosity, "wavelength": wavelength}
    shape = _check(shape, porosity, seed)
    _check_length("wavelength", wavelength, 4, max(shape) / 2)
    random = np.random.default_rng(seed)
    spectrum = fft.rfftn(random.standard_normal(shape, dtype=np.float32), workers=-1)
    z, y = (np.fft.fftfreq(n).astype(np.float32) for n in shape[:2])
    x = np.fft.rfftfreq(shape[2]).astype(np.float32)
    frequency = np.sqrt(
        (z**2)[:, np.newaxis, np.newaxis] + (y**2)[:, np.newaxis] + (x**2), dtype=np.float32
    )
    # A shell of 10 % relative width: narrower repeats itself, wider mixes sizes.
    spectrum *= np.exp(-0.5 * ((frequency * wavelength - 1) / 0.1) ** 2)
    field = fft.irfftn(spectrum, s=shape, workers=-1)
    return _scan("spinodal", field, parameters, seed, random, voxel_size, unit)


def foam(
    shape: _Shape = (96, 96, 96),
    *,
    porosity: float = 0.85,
    cell: float = 32.0,
    seed: int = 0,
    voxel_size: _Size = 1.0,
    unit: str = "voxel",
) -> Volume:
    """Draw an open-cell foam: struts along the edges of relaxed Voronoi cells.

    A point is the nearer to a strut the less its distances to the nearest and to the third
    nearest cell centre differ, which gives the struts the concave section of Plateau borders.

    Parameters
    ----------
    shape : (int, int, int), default (96, 96, 96)
        Edge lengths (z, y, x) in voxels, at least 8.
    porosity : float, default 0.85
        Fraction of pore voxels before the blur, 0.01 to 0.99.
    cell : float, default 32
        Edge of a cube of the volume of a cell in voxels, 8 to the shortest edge.
    seed : int, default 0
        Same seed, same volume.
    voxel_size : float or (float, float, float), default 1.0
        Edge lengths of a voxel, in ``unit``.
    unit : str, default "voxel"
        Unit of ``voxel_size``.

    Returns
    -------
    Volume
        Gray uint8, solid bright, periodic.

    Raises
    ------
    ParameterError
        If a parameter is outside its range.

    Notes
    -----
    Peak memory: about 30 bytes per voxel.
    """
    parameters = {"porosity": porosity, "cell": cell}
    shape = _check(shape, porosity, seed)
    _check_length("cell", cell, 8, min(shape))
    random = np.random.default_rng(seed)
    centres = _relaxed(random, shape, cell)
    # Squared distances to the three nearest centres. No point of an edge of a relaxed cell is more
    # than 1.1 cells away from its centre.
    nearest = np.full((3, *shape), np.inf, np.float32)
    for centre in centres:
        for box, square in _squares(centre, shape, 1.1 * cell):
            for rank in range(3):
                known = nearest[rank][box].copy()
                np.minimum(known, square, out=nearest[rank][box])
                square = np.maximum(known, square)
    np.sqrt(nearest, out=nearest)
    field = nearest[0] - nearest[2]
    return _scan("foam", field, parameters, seed, random, voxel_size, unit)


def spheres(
    shape: _Shape = (96, 96, 96),
    *,
    porosity: float = 0.4,
    radius: float = 8.0,
    seed: int = 0,
    voxel_size: _Size = 1.0,
    unit: str = "voxel",
) -> Volume:
    """Draw solid spheres that overlap where they like, as of a sintered powder.

    Centres are independent of each other (the Boolean model: porosity is exp(−n V), with n
    spheres of volume V per unit of volume); the radius is then adjusted for the exact porosity.

    Parameters
    ----------
    shape : (int, int, int), default (96, 96, 96)
        Edge lengths (z, y, x) in voxels, at least 8.
    porosity : float, default 0.4
        Fraction of pore voxels before the blur, 0.01 to 0.99.
    radius : float, default 8
        Radius of a sphere in voxels, 2 to half of the shortest edge.
    seed : int, default 0
        Same seed, same volume.
    voxel_size : float or (float, float, float), default 1.0
        Edge lengths of a voxel, in ``unit``.
    unit : str, default "voxel"
        Unit of ``voxel_size``.

    Returns
    -------
    Volume
        Gray uint8, solid bright, periodic.

    Raises
    ------
    ParameterError
        If a parameter is outside its range.

    Notes
    -----
    Peak memory: about 22 bytes per voxel.
    """
    parameters = {"porosity": porosity, "radius": radius}
    shape = _check(shape, porosity, seed)
    _check_length("radius", radius, 2, min(shape) / 2)
    random = np.random.default_rng(seed)
    count = -np.log(porosity) * np.prod(shape) / (4 / 3 * np.pi * radius**3)
    centres = random.random((max(1, round(count)), 3)) * shape
    # Squared distance to the nearest centre, up to far more than the radius needs adjusting.
    nearest = np.full(shape, (2 * radius) ** 2, np.float32)
    for centre in centres:
        for box, square in _squares(centre, shape, 2 * radius):
            np.minimum(nearest[box], square, out=nearest[box])
    field = -nearest
    return _scan("spheres", field, parameters, seed, random, voxel_size, unit)


def _check(shape: _Shape, porosity: float, seed: int) -> _Shape:
    try:
        z, y, x = (int(n) for n in shape)
    except (TypeError, ValueError):
        z = y = x = 0
    if min(z, y, x) < 8:
        raise ParameterError("shape", shape, "must be (z, y, x), at least 8 voxels each")
    if not 0.01 <= porosity <= 0.99:
        raise ParameterError("porosity", porosity, "must be 0.01 to 0.99")
    if seed < 0:
        raise ParameterError("seed", seed, "must not be negative")
    return z, y, x


def _check_length(name: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        raise ParameterError(name, value, f"must be {low:g} to {high:g} voxels for this shape")


def _relaxed(random: np.random.Generator, shape: _Shape, cell: float) -> npt.NDArray[Any]:
    """Return cell centres spread evenly: Lloyd's relaxation of random points."""
    from scipy.spatial import cKDTree

    count = max(4, round(np.prod(shape) / cell**3))
    centres = random.random((count, 3)) * shape
    samples = random.random((200 * count, 3)) * shape
    edges = np.array(shape, np.float64)
    for _ in range(6):  # Few, so that the cells stay as unequal as those of a foam.
        _, owner = cKDTree(centres, boxsize=edges).query(samples, workers=-1)
        step = samples - centres[owner]
        step -= np.round(step / shape) * shape
        total = np.stack([np.bincount(owner, step[:, i], count) for i in range(3)], axis=1)
        members = np.maximum(np.bincount(owner, minlength=count), 1)
        centres = (centres + total / members[:, np.newaxis]) % shape
    return centres


def _squares(
    centre: npt.NDArray[Any], shape: _Shape, reach: float
) -> Iterator[tuple[tuple[slice, ...], _Field]]:
    """Yield the boxes of voxels around a point of a periodic volume, with squared distances."""
    axes = []
    for n, c in zip(shape, centre, strict=True):
        # A box that spans the volume holds every voxel once, at its shorter way.
        low, high = (int(np.ceil(c - reach)), int(c + reach) + 1) if 2 * reach < n else (0, n)
        pieces = []
        for lap in (-n, 0, n):
            start, stop = max(low, lap), min(high, lap + n)
            if start < stop:
                step = np.abs(np.arange(start, stop) - c)
                square = (np.minimum(step, n - step) ** 2).astype(np.float32)
                pieces.append((slice(start - lap, stop - lap), square))
        axes.append(pieces)
    for (z, dz), (y, dy), (x, dx) in itertools.product(*axes):
        yield (z, y, x), dz[:, np.newaxis, np.newaxis] + (dy[:, np.newaxis] + dx)


def _scan(
    name: str,
    field: _Field,
    parameters: dict[str, float],
    seed: int,
    random: np.random.Generator,
    voxel_size: _Size,
    unit: str,
) -> Volume:
    """Cut a field, solid where it is high, and turn it into what a scanner would show."""
    from scipy.ndimage import gaussian_filter

    from poresynth._core import __version__

    last_pore = round(parameters["porosity"] * field.size) - 1
    solid = field > np.partition(field, last_pore, axis=None)[last_pore]
    gray = gaussian_filter(solid.astype(np.float32), _BLUR, mode="wrap", truncate=3)
    gray *= _SOLID - _PORE
    gray += _PORE
    gray += _NOISE * random.standard_normal(field.shape, dtype=np.float32)
    array = np.clip(np.rint(gray, out=gray), 0, 255, out=gray).astype(np.uint8)
    provenance = {
        "version": __version__,
        "engine": f"exemplars.{name}",
        "parameters": parameters,
        "seed": seed,
        "shape": list(field.shape),
        "boundary": "periodic",
        "porosity": 1 - float(solid.mean()),
    }
    return Volume(array, voxel_size, unit, {"poresynth": provenance})  # type: ignore[arg-type]
