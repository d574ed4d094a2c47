"""Bone morphometry: ratios of volume and surface, and what plates of such ratios would measure."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from poresynth.errors import ParameterError
from poresynth.metrics.arguments import PhaseLike, as_phase, scale_of
from poresynth.metrics.surface import surface_area

__all__ = ["Morphometry", "morphometry"]

Boundary = Literal["open", "periodic"]
Method = Literal["crofton", "marching_cubes", "faces"]


@dataclass(frozen=True)
class Morphometry:
    """Morphometry of bone, or of any solid, in the nomenclature of the ASBMR.

    Bouxsein et al. 2010, J. Bone Miner. Res. 25, 1468. Lengths are in ``unit``. A ratio of 0 to 0
    is NaN, as the thickness of no bone.

    Attributes
    ----------
    tv : float
        TV, total volume.
    bv : float
        BV, bone volume: that of the solid.
    bs : float
        BS, bone surface: the surface that the total volume holds at the specific surface BS/TV.
    bv_tv : float
        BV/TV, bone volume fraction.
    bs_bv : float
        BS/BV, specific bone surface.
    bs_tv : float
        BS/TV, bone surface density.
    tb_th_plate : float
        Tb.Th of the plate model, 2 / (BS/BV): the thickness of the plates.
    tb_n_plate : float
        Tb.N of the plate model, (BV/TV) / Tb.Th: plates per length.
    tb_sp_plate : float
        Tb.Sp of the plate model, 1 / Tb.N − Tb.Th: the gap between the plates.
    tb_th : float or None
        Tb.Th, the mean local thickness (a diameter) that was given.
    tb_sp : float or None
        Tb.Sp, the mean local thickness of the pore that was given.
    tb_n : float or None
        Tb.N without a model, 1 / (Tb.Th + Tb.Sp): one over the mean distance of the ridges. None if
        thickness and separation are not both given.
    unit : str
        Unit of length.
    """

    tv: float
    bv: float
    bs: float
    bv_tv: float
    bs_bv: float
    bs_tv: float
    tb_th_plate: float
    tb_n_plate: float
    tb_sp_plate: float
    tb_th: float | None
    tb_sp: float | None
    tb_n: float | None
    unit: str


def morphometry(
    solid: PhaseLike,
    *,
    phase: int | None = None,
    voxel_size: float | tuple[float, float, float] | None = None,
    thickness: float | None = None,
    separation: float | None = None,
    method: Method = "crofton",
    boundary: Boundary = "open",
    threads: int = 0,
) -> Morphometry:
    """Measure volume and surface of a solid, and the plates that would have the same.

    Parameters
    ----------
    solid : Volume or array_like
        The solid (bone), shape (z, y, x): bool, or at most 16 values of which 0 is not solid.
    phase : int, optional
        The value that is the solid, instead of all but 0.
    voxel_size : float or (float, float, float), optional
        Edges of a voxel along (z, y, x), instead of the volume's own; 1 for plain arrays.
    thickness, separation : float, optional
        Mean local thickness, a diameter, of the solid and of the pore, in the unit of the voxel
        size: with both there is a trabecular number that assumes no plates.
    method, boundary, threads
        As for `surface_area`.

    Returns
    -------
    Morphometry

    Raises
    ------
    ParameterError
        If a parameter is outside its range.

    Notes
    -----
    The plate model (Parfitt et al. 1983) turns the specific surface into lengths: plates of
    thickness t that repeat after p have BV/TV = t / p, BS/BV = 2 / t, Tb.N = 1 / p. Rods of the
    same ratios are twice as thick: do not compare the model's values with direct ones.

    With ``method="crofton"`` these are the parameters of the directed secants (prieto_2011 §4.2):
    P_L, the intersections per length of lines in all directions, is half of BS/TV and thus Tb.N.
    The mean intercept length itself is `mean_intercept_length`.

    The total volume is the whole array. Peak memory: as for `surface_area`.
    """
    for name, value in (("thickness", thickness), ("separation", separation)):
        if value is not None and not (math.isfinite(value) and value >= 0):
            raise ParameterError(name, value, "must be a length of at least 0")
    scale = scale_of(solid, voxel_size)
    bone = as_phase(solid, phase=phase)
    surface = surface_area(
        bone, voxel_size=scale.voxel_size, method=method, boundary=boundary, threads=threads
    )
    tv = bone.size * math.prod(scale.voxel_size)
    bv_tv = float(np.count_nonzero(bone) / bone.size)
    bs_tv = surface.specific_surface
    spacing = None if thickness is None or separation is None else thickness + separation
    return Morphometry(
        tv=tv,
        bv=tv * bv_tv,
        bs=tv * bs_tv,
        bv_tv=bv_tv,
        bs_bv=_ratio(bs_tv, bv_tv),
        bs_tv=bs_tv,
        tb_th_plate=_ratio(2 * bv_tv, bs_tv),
        tb_n_plate=bs_tv / 2,
        tb_sp_plate=_ratio(2 * (1 - bv_tv), bs_tv),
        tb_th=thickness,
        tb_sp=separation,
        tb_n=None if spacing is None else _ratio(1.0, spacing),
        unit=scale.unit,
    )


def _ratio(a: float, b: float) -> float:
    """Return a / b; infinite for b = 0, NaN for 0 / 0."""
    if b:
        return a / b
    return math.inf if a > 0 else math.nan
