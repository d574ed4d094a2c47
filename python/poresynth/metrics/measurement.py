"""All metrics of one volume."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from poresynth.metrics.chords import lineal_path
from poresynth.metrics.correlation import two_point_cluster
from poresynth.metrics.histograms import channel_statistics
from poresynth.metrics.registry import METRICS, TRANSPORT_METRICS
from poresynth.metrics.specimen import Specimen
from poresynth.metrics.structure import Structure, first_channel
from poresynth.metrics.windows import EDGES, local_porosity
from poresynth.volume import Volume, as_volume

__all__ = ["Progress", "measure"]

Progress = Callable[[str, float], object]
"""Called with what is being done and the share of the whole that is done."""

# Share of the time of a measurement with transport that the other metrics take.
_BEFORE_TRANSPORT = 0.05


def measure(
    volume: Volume | npt.ArrayLike,
    *,
    threshold: float | None = None,
    solid: Literal["bright", "dark"] = "bright",
    transport: bool = False,
    threads: int = 0,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Run every metric on one volume.

    Parameters
    ----------
    volume : Volume or array_like
        Shape (z, y, x) or (z, y, x, channel), of which the first channel decides. Gray, binary or
        labels.
    threshold : float, optional
        Value that parts solid from pore; Otsu's by default, the middle of two values, the middle
        of the two lowest labels.
    solid : {"bright", "dark"}, default "bright"
        Which side of the threshold is solid.
    transport : bool, default False
        Whether diffusion and flow through the pore are solved, along each axis: minutes instead of
        seconds.
    threads : int, default 0
        Number of threads; 0 takes all cores. The figures do not depend on it.
    progress : callable, optional
        Called with what is being done and the share of the whole that is done.

    Returns
    -------
    dict
        JSON-compatible and flat; undefined numbers are None.

        - Each of `METRICS` under its name, lengths in voxels (of voxels that are not cubic, in the
          cube root of their volume); if the voxel size is known, also as ``<name>_in_unit`` in
          ``unit`` to the metric's power.
        - Curves as lists: ``two_point_r`` (voxels), ``two_point``, ``two_point_z``, ``_y``, ``_x``
          and ``two_point_cluster`` of the solid; ``lineal_path_r``, ``lineal_path_solid``,
          ``lineal_path_pore``; ``tb_th_edges`` and ``tb_th_shares``, ``tb_sp_edges`` and
          ``tb_sp_shares``: shares of the phase's voxels by local thickness;
          ``local_porosity_windows`` and ``local_porosity_variance``.
        - ``intensity_mean`` and ``intensity_sd``, a list of more than one channel.
        - With ``transport``, for each axis ``effective_diffusivity_<axis>`` (relative to that
          without a solid), ``tortuosity_factor_<axis>`` and ``permeability_<axis>`` (voxel²;
          ``_in_unit``).
        - ``kind``, ``threshold``, ``solid``, ``shape``, ``voxel_size`` and ``unit``.

    Raises
    ------
    ParameterError
        If the volume is empty, constant or not finite, or the threshold is outside its values.

    Notes
    -----
    Peak memory: 18 bytes a voxel, without transport.
    """
    whole = as_volume(volume)
    structure = Structure.of(whole, threshold, solid)
    phase = structure.cut(first_channel(whole, "volume"))
    tell = progress or (lambda stage, share: None)
    share = _BEFORE_TRANSPORT if transport else 1.0

    def solving(stage: str, done: float) -> None:
        tell(stage, share + (1 - share) * done)

    specimen = Specimen(phase, whole.voxel_size, threads, solving)
    found: dict[str, Any] = {}
    for i, metric in enumerate(METRICS.values()):
        tell(metric.name.replace("_", " "), share * i / (len(METRICS) + 1))
        _add(found, whole, metric.name, metric.function(specimen), metric.power)
    tell("curves", share * len(METRICS) / (len(METRICS) + 1))
    found |= {name: _listed(curve) for name, curve in _curves(specimen).items()}
    statistics = channel_statistics(whole, threads=threads)
    for name, values in (("mean", statistics.mean), ("sd", statistics.standard_deviation)):
        listed = _listed(values)
        found[f"intensity_{name}"] = listed[0] if len(listed) == 1 else listed
    for metric in TRANSPORT_METRICS.values() if transport else ():
        _add(found, whole, metric.name, metric.function(specimen), metric.power)
    tell("done", 1.0)
    return found | {
        "kind": structure.kind,
        "threshold": structure.threshold,
        "solid": structure.solid,
        "shape": list(whole.shape),
        "voxel_size": list(whole.voxel_size),
        "unit": whole.unit,
    }


def _add(found: dict[str, Any], whole: Volume, name: str, value: float, power: int) -> None:
    number = json_number(value)
    found[name] = number
    if power and whole.unit != "voxel":
        edge = math.prod(whole.voxel_size) ** (1 / 3)
        found[f"{name}_in_unit"] = None if number is None else number * edge**power


def json_number(value: float | None) -> float | None:
    """Return a number that JSON can hold: None for NaN and the infinite."""
    plain = value.item() if isinstance(value, np.generic) else value
    return plain if plain is not None and math.isfinite(plain) else None


def _listed(values: Sequence[float] | npt.NDArray[Any]) -> list[float | None]:
    return [json_number(value) for value in np.asarray(values).tolist()]


def _curves(s: Specimen) -> Mapping[str, Any]:
    correlation = s.two_point
    cluster = two_point_cluster(s.solid, threads=s.threads)
    paths = [lineal_path(phase, threads=s.threads) for phase in (s.solid, s.pore)]
    edges = [edge for edge in EDGES if edge <= min(s.solid.shape)] or [min(s.solid.shape)]
    local = local_porosity(s.solid, edges, threads=s.threads)
    curves = {
        "two_point_r": correlation.r,
        "two_point": correlation.radial,
        **{f"two_point_{axis}": getattr(correlation, axis) for axis in "zyx"},
        "two_point_cluster": cluster.radial,
        "lineal_path_r": paths[0].r,
        "lineal_path_solid": paths[0].mean,
        "lineal_path_pore": paths[1].mean,
        "local_porosity_windows": edges,
        "local_porosity_variance": local.variance,
    }
    for name, thickness in (("tb_th", s.thickness), ("tb_sp", s.separation)):
        curves |= {f"{name}_edges": thickness.edges, f"{name}_shares": thickness.shares}
    return curves
