"""The metrics of one phase by name, and `measure`, which runs them all."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, TypeVar

import numpy.typing as npt

from poresynth.metrics.structure import Structure, first_channel
from poresynth.volume import Volume, as_volume

__all__ = ["METRICS", "Metric", "measure", "metric"]

_Function = TypeVar("_Function", bound=Callable[..., float])


@dataclass(frozen=True)
class Metric:
    """A number that describes one phase.

    Parameters
    ----------
    name : str
        Key in the results, snake_case.
    function : callable
        Takes the phase, a bool array (z, y, x), and returns the number.
    unit : str
        Unit of the number; ``""`` for shares and counts.
    description : str
        What it is, in a few words.
    """

    name: str
    function: Callable[..., float]
    unit: str
    description: str


METRICS: dict[str, Metric] = {}
"""All metrics, by name."""


def metric(description: str, unit: str = "") -> Callable[[_Function], _Function]:
    """Register a function as a metric, under its own name.

    Parameters
    ----------
    description : str
        What it is, in a few words.
    unit : str, default ""
        Unit of what it returns.

    Returns
    -------
    callable
        A decorator that returns the function unchanged.
    """

    def register(function: _Function) -> _Function:
        METRICS[function.__name__] = Metric(function.__name__, function, unit, description)
        return function

    return register


def measure(
    volume: Volume | npt.ArrayLike,
    *,
    threshold: float | None = None,
    solid: Literal["bright", "dark"] = "bright",
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

    Returns
    -------
    dict
        JSON-compatible and flat: each metric under its name, and ``kind``, ``threshold``,
        ``solid``, ``shape``, ``voxel_size`` and ``unit`` of the volume.

    Raises
    ------
    ParameterError
        If the volume is empty, constant or not finite, or the threshold is outside its values.

    Notes
    -----
    Peak memory: 8 bytes a voxel.
    """
    whole = as_volume(volume)
    structure = Structure.of(whole, threshold, solid)
    phase = structure.cut(first_channel(whole, "volume"))
    return {
        **{name: metric.function(phase) for name, metric in METRICS.items()},
        "kind": structure.kind,
        "threshold": structure.threshold,
        "solid": structure.solid,
        "shape": list(whole.shape),
        "voxel_size": list(whole.voxel_size),
        "unit": whole.unit,
    }
