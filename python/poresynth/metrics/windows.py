"""Local porosity: how the porosity varies from place to place, at a given scale."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from typing import Literal

import numpy as np
import numpy.typing as npt

from poresynth import _core
from poresynth.errors import ParameterError
from poresynth.metrics.arguments import PhaseLike, as_phase, scale_of, whole_number

__all__ = ["LocalPorosity", "local_porosity"]

Boundary = Literal["open", "periodic"]
_Curve = npt.NDArray[np.float64]

EDGES = (10, 20, 40)
"""Edges of the windows: pores of synthetic and scanned exemplars measure 5 to 30 voxels."""
BINS = 100
"""Bins of the porosity: one a percent."""


@dataclass(frozen=True, eq=False)
class LocalPorosity:
    """Distribution of the porosity in windows, for several sizes of the window.

    Attributes
    ----------
    windows : numpy.ndarray of int64
        Edges of each window along (z, y, x) in voxels, shape (n, 3).
    edges : numpy.ndarray
        Edge of each window, the cube root of its volume, in ``unit``, shape (n,).
    porosity : numpy.ndarray
        Edges of the bins, from 0 to 1, shape (bins + 1,).
    counts : numpy.ndarray of int64
        Windows of each size in each bin, shape (n, bins); the last bin holds a porosity of 1.
    density : numpy.ndarray
        μ(φ, L): probability density of the porosity, the same shape; its integral is 1.
    mean, variance : numpy.ndarray
        Of the porosity of the windows of each size, shape (n,); exact, not from the bins.
    unit : str
        Unit of lengths; ``"voxel"`` if the scale is unknown.
    """

    windows: npt.NDArray[np.int64]
    edges: _Curve
    porosity: _Curve
    counts: npt.NDArray[np.int64]
    density: _Curve
    mean: _Curve
    variance: _Curve
    unit: str


def local_porosity(
    solid: PhaseLike,
    edges: int | Iterable[int] = EDGES,
    *,
    bins: int = BINS,
    phase: int | None = None,
    voxel_size: float | tuple[float, float, float] | None = None,
    boundary: Boundary = "open",
    threads: int = 0,
) -> LocalPorosity:
    """Return the distribution of the porosity in all cubic windows of one size, or of several.

    Parameters
    ----------
    solid : Volume or array_like
        The solid, shape (z, y, x): bool, or at most 16 values of which 0 is not in it. The
        porosity is the share of all else.
    edges : int or iterable of int, default (10, 20, 40)
        Edges L of the windows, in smallest edges of a voxel. Along longer edges of voxels a window
        has so many voxels that it is as near to a cube as can be, at least one. At most the
        volume's edges.
    bins : int, default 100
        Bins of the porosity from 0 to 1, at most 65536.
    phase : int, optional
        The value that is the solid, instead of all but 0.
    voxel_size : float or (float, float, float), optional
        Edges of a voxel along (z, y, x), instead of the volume's own.
    boundary : {"open", "periodic"}, default "open"
        Open: windows inside the volume, so that voxels near the border are in fewer of them.
        Periodic: a window at every voxel; they go on at the opposite face.
    threads : int, default 0
        Number of threads; 0 takes all cores. The counts do not depend on it.

    Returns
    -------
    LocalPorosity

    Raises
    ------
    ParameterError
        If a parameter is outside its range.

    Notes
    -----
    The local porosity distribution of R. Hilfer, "Geometric and dielectric characterization of
    porous media", Phys. Rev. B 44, 60 (1991). Exact. Peak memory: 4 bytes a voxel of one plane for
    each thread.
    """
    array, scale = as_phase(solid, phase=phase), scale_of(solid, voxel_size)
    bins = whole_number("bins", bins, 1)
    smallest = min(scale.voxel_size)
    sizes = [edges] if np.ndim(edges) == 0 else list(edges)  # type: ignore[arg-type]
    windows, counts, means, variances = [], [], [], []
    for size in sizes:
        edge = whole_number("edges", size, 1)
        window = tuple(max(1, round(edge * smallest / own)) for own in scale.voxel_size)
        if any(own > n for own, n in zip(window, array.shape, strict=True)):
            allowed = f"must be windows that fit into the volume's {array.shape} voxels"
            raise ParameterError("edges", edge, allowed)
        count, number, total, squares = _core.local_porosity(
            array,
            (window[0], window[1], window[2]),
            bins,
            boundary=boundary,
            threads=threads,
        )
        voxels = int(np.prod(window))
        mean = Fraction(total, number * voxels)
        windows.append(window)
        counts.append(count.astype(np.int64))
        means.append(float(mean))
        variances.append(float(Fraction(squares, number * voxels**2) - mean**2))
    shape = (len(sizes), bins)
    all_counts = np.array(counts, np.int64).reshape(shape)
    numbers = all_counts.sum(axis=1, keepdims=True)
    volumes = [float(np.prod(np.multiply(window, scale.voxel_size))) for window in windows]
    return LocalPorosity(
        np.array(windows, np.int64).reshape(len(sizes), 3),
        np.cbrt(volumes),
        np.linspace(0, 1, bins + 1),
        all_counts,
        all_counts * bins / numbers,
        np.array(means),
        np.array(variances),
        scale.unit,
    )
