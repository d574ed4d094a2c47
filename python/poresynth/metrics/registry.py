"""The metrics by name: what `measure` reports of a volume, and `compare` of two."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from poresynth.metrics.connectivity import FLOATING, largest_share
from poresynth.metrics.specimen import AXES, Specimen

__all__ = ["METRICS", "TRANSPORT_METRICS", "Metric", "finite_mean", "unit_of"]

Better = Literal["equal", "smaller", "larger"]


@dataclass(frozen=True)
class Metric:
    """A number that describes the solid of a volume.

    Parameters
    ----------
    name : str
        Key in the results, snake_case.
    function : callable
        Takes a `Specimen`, returns the number; NaN where it is not defined.
    description : str
        What it is, in a few words.
    power : int, default 0
        Of the length in its unit: 1 for a length, −3 for a count per volume, 0 for a pure number.
    tolerance : float, optional
        Difference from the exemplar that passes in a comparison, as a share of the exemplar's
        value, even if the exemplar's own parts differ less. None keeps it out of comparisons, for
        what grows with the volume or says the same as another.
    better : {"equal", "smaller", "larger"}, default "equal"
        On which side of the exemplar's value there is nothing to blame.
    """

    name: str
    function: Callable[[Specimen], float]
    description: str
    power: int = 0
    tolerance: float | None = None
    better: Better = "equal"

    @property
    def unit(self) -> str:
        """Unit of the number in voxels; ``""`` for pure numbers."""
        return unit_of("voxel", self.power)


def unit_of(length: str, power: int) -> str:
    """Return a unit of length to a power, as people write it."""
    digits = str(abs(power)).translate(str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹"))
    raised = length if abs(power) == 1 else f"{length}{digits}"
    return "" if power == 0 else raised if power > 0 else f"1/{raised}"


def _number(value: float | None) -> float:
    return float("nan") if value is None else value


def _fabric(specimen: Specimen, name: str) -> float:
    return _number(None if specimen.fabric is None else getattr(specimen.fabric, name))


def finite_mean(values: npt.ArrayLike) -> float:
    """Return the mean of the values that are finite; NaN if none is."""
    array = np.asarray(values, dtype=float)
    finite = array[np.isfinite(array)]
    return float(finite.mean()) if len(finite) else float("nan")


# Ten percent: what two specimens of one bone or rock differ by at least.
_USUAL = 0.1

_TABLE = (
    # Those that tell a good structure from a poor one come first.
    Metric(
        "end_point_density",
        lambda s: s.end_points.density,
        "end points of the skeleton per volume: struts that lead nowhere",
        power=-3,
        tolerance=_USUAL,
        better="smaller",
    ),
    Metric(
        "euler_density",
        lambda s: s.euler / s.solid.size,
        "Euler number of the solid per volume: the lower, the more loops",
        power=-3,
        tolerance=_USUAL,
    ),
    Metric("porosity", lambda s: 1 - float(s.solid.mean()), "share of the volume that is pore"),
    Metric(
        "bv_tv",
        lambda s: s.morphometry.bv_tv,
        "BV/TV: share of the volume that is solid",
        tolerance=_USUAL,
    ),
    Metric(
        "bs_bv",
        lambda s: s.morphometry.bs_bv,
        "BS/BV: surface per volume of the solid",
        power=-1,
        tolerance=_USUAL,
    ),
    Metric("bs_tv", lambda s: s.morphometry.bs_tv, "BS/TV: surface per volume", power=-1),
    Metric(
        "tb_th",
        lambda s: s.thickness.mean,
        "Tb.Th: mean local thickness of the solid, a diameter",
        power=1,
        tolerance=_USUAL,
    ),
    Metric("tb_th_sd", lambda s: s.thickness.sd, "standard deviation of the thickness", power=1),
    Metric("tb_th_max", lambda s: s.thickness.max, "largest thickness", power=1),
    Metric(
        "tb_sp",
        lambda s: s.separation.mean,
        "Tb.Sp: mean local thickness of the pore, a diameter",
        power=1,
        tolerance=_USUAL,
    ),
    Metric("tb_sp_sd", lambda s: s.separation.sd, "standard deviation of the separation", power=1),
    Metric("tb_sp_max", lambda s: s.separation.max, "largest separation", power=1),
    Metric(
        "tb_n",
        lambda s: _number(s.morphometry.tb_n),
        "Tb.N without a model: 1 / (Tb.Th + Tb.Sp)",
        power=-1,
        tolerance=_USUAL,
    ),
    Metric(
        "tb_th_plate",
        lambda s: s.morphometry.tb_th_plate,
        "thickness of plates of the same BS/BV",
        power=1,
    ),
    Metric(
        "tb_sp_plate",
        lambda s: s.morphometry.tb_sp_plate,
        "separation of plates of the same BS/BV",
        power=1,
    ),
    Metric(
        "tb_n_plate",
        lambda s: s.morphometry.tb_n_plate,
        "number per length of plates of the same BS/BV",
        power=-1,
    ),
    Metric(
        "mil_mean",
        lambda s: _fabric(s, "mil_mean"),
        "mean intercept length, all directions",
        power=1,
        tolerance=_USUAL,
    ),
    Metric("mil_z", lambda s: _fabric(s, "mil_z"), "mean intercept length along z", power=1),
    Metric("mil_y", lambda s: _fabric(s, "mil_y"), "mean intercept length along y", power=1),
    Metric("mil_x", lambda s: _fabric(s, "mil_x"), "mean intercept length along x", power=1),
    Metric(
        "mil_anisotropy",
        lambda s: _fabric(s, "degree_of_anisotropy"),
        "DA: 0 isotropic, 1 all in one direction",
        tolerance=_USUAL,
    ),
    Metric("components", lambda s: len(s.solid_sizes), "26-connected parts of the solid"),
    Metric(
        "floating_parts",
        lambda s: int((s.solid_sizes < FLOATING).sum()),
        f"parts of the solid of fewer than {FLOATING} voxels",
    ),
    Metric(
        "largest_component_fraction",
        lambda s: largest_share(s.solid_sizes),
        "share of the solid in its largest part",
    ),
    Metric("pore_components", lambda s: len(s.pore_sizes), "6-connected parts of the pore"),
    Metric(
        "largest_pore_fraction",
        lambda s: largest_share(s.pore_sizes),
        "share of the pore in its largest part",
        tolerance=0.01,
    ),
    *(
        Metric(
            f"{phase}_spanning_{axis}",
            lambda s, phase=phase, i=i: getattr(s, f"{phase}_percolation").fractions[i],  # type: ignore[misc]
            f"share of the {phase} in parts that reach from face to face along {axis}",
        )
        for phase in ("solid", "pore")
        for i, axis in enumerate(AXES)
    ),
    Metric("euler_number", lambda s: s.euler, "Euler number of the solid, 26-connected"),
    Metric(
        "connectivity",
        lambda s: s.connectivity.connectivity,
        "1 − Δχ: struts that can be cut before the solid falls apart",
    ),
    Metric(
        "connectivity_density",
        lambda s: s.connectivity.density,
        "Conn.D: connectivity per volume",
        power=-3,
        tolerance=_USUAL,
    ),
    Metric("betti_0", lambda s: s.betti.b0, "parts of the solid"),
    Metric("betti_1", lambda s: s.betti.b1, "tunnels through the solid"),
    Metric("betti_2", lambda s: s.betti.b2, "cavities inside the solid"),
    Metric("branches", lambda s: len(s.graph.branches.length), "branches of the skeleton"),
    Metric("junctions", lambda s: s.graph.junctions, "junctions of the skeleton"),
    Metric("loops", lambda s: s.graph.loops, "independent loops of the skeleton"),
    Metric(
        "branch_length",
        lambda s: finite_mean(s.graph.branches.length),
        "mean length of the skeleton's branches",
        power=1,
        tolerance=_USUAL,
    ),
    Metric(
        "branch_tortuosity",
        lambda s: finite_mean(s.graph.branches.tortuosity),
        "mean of the branches' length over the distance of their ends",
        tolerance=0.05,
    ),
    Metric(
        "solid_chord",
        lambda s: s.solid_chords.mean,
        "mean length of the solid along the axes, from pore to pore",
        power=1,
        tolerance=_USUAL,
    ),
    Metric(
        "pore_chord",
        lambda s: s.pore_chords.mean,
        "mean length of the pore along the axes, from solid to solid",
        power=1,
        tolerance=_USUAL,
    ),
)

METRICS: dict[str, Metric] = {metric.name: metric for metric in _TABLE}
"""All metrics, by name, in the order of reading. One that is added here is known to `measure`,
`compare`, their reports and the command line."""

TRANSPORT_METRICS: dict[str, Metric] = {
    metric.name: metric
    for metric in (
        *(
            Metric(
                f"effective_diffusivity_{axis}",
                lambda s, axis=axis: s.transport.diffusion[axis].diffusivity,  # type: ignore[misc]
                f"diffusivity of the pore along {axis}, relative to that without a solid",
            )
            for axis in AXES
        ),
        *(
            Metric(
                f"tortuosity_factor_{axis}",
                lambda s, axis=axis: s.transport.diffusion[axis].tortuosity,  # type: ignore[misc]
                f"porosity over relative diffusivity along {axis}",
            )
            for axis in AXES
        ),
        *(
            Metric(
                f"permeability_{axis}",
                lambda s, axis=axis: s.transport.flow[axis].permeability,  # type: ignore[misc]
                f"absolute permeability along {axis}",
                power=2,
            )
            for axis in AXES
        ),
    )
}
"""Transport through the pore: solved only where it is asked for."""
