"""From a synthesised field to phases, and from phases to the exemplar's values."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from poresynth import _core
from poresynth.engines.phases import Phases
from poresynth.engines.request import Request
from poresynth.metrics.histograms import match_histogram

__all__ = ["channels_first", "cut", "cut_share", "outside_value", "phase_values"]


def channels_first(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return (z, y, x[, channel]) as (channel, z, y, x), a view."""
    return array[None] if array.ndim == 3 else np.moveaxis(array, -1, 0)


def cut(phases: Phases, scores: npt.NDArray[np.float32], request: Request) -> npt.NDArray[np.uint8]:
    """Return the phase of every voxel, with exactly the wanted number in each.

    Parameters
    ----------
    phases : Phases
        The exemplar's; its shares, or the wanted porosity, say how many voxels each phase gets.
    scores : numpy.ndarray
        Shape (channel, z, y, x): one score a phase if there are more than two, else of the solid.
    request : Request
        What was asked for; voxels that are not free do not count.
    """
    free = request.free
    count = scores[0].size if free is None else int(np.count_nonzero(free))
    wanted = phases.wanted(count, request.porosity)
    flat = None if free is None else free.ravel()
    if len(wanted) > 2:
        rows = scores.reshape(len(wanted), -1)
        found = _core.cut_phases(rows, wanted, seed=request.seed, free=flat)
        return found.reshape(scores.shape[1:])
    solid = _core.cut_solid(scores[0].ravel(), wanted[1], seed=request.seed, free=flat)
    return solid.reshape(scores.shape[1:]).view(np.uint8)


def cut_share(
    scores: npt.NDArray[np.floating], share: float, seed: int = 0
) -> npt.NDArray[np.bool_]:
    """Return where scores are high, of any shape, with this share of them to the nearest one."""
    flat = np.ascontiguousarray(scores, np.float32).ravel()
    return _core.cut_solid(flat, round(share * flat.size), seed=seed).reshape(scores.shape)


def phase_values(
    phases: Phases,
    exemplar: npt.NDArray[Any],
    phase: npt.NDArray[np.uint8],
    gray: npt.NDArray[np.float32],
    request: Request,
) -> npt.NDArray[Any]:
    """Return the values of the output: the phases' own, or gray values phase by phase.

    Parameters
    ----------
    phases : Phases
        The exemplar's.
    exemplar : numpy.ndarray
        Shape (z, y, x[, channel]), of the shape of the exemplar's phases.
    phase : numpy.ndarray
        The output's phases, shape (z, y, x).
    gray : numpy.ndarray
        Shape (channel, z, y, x): in each phase its order says which voxel gets which of the
        exemplar's values, whose histogram it takes. Only of gray exemplars.
    request : Request
        What was asked for: the known voxels and the domain.

    Returns
    -------
    numpy.ndarray
        Of the exemplar's dtype, shape (z, y, x[, channel]).
    """
    array: npt.NDArray[Any]
    if phases.kind != "gray":
        array = phases.labels[phase]
        request.impose(array, outside_value(phases, exemplar))
        return array
    free = request.free
    channels = channels_first(exemplar)
    out = np.zeros((len(channels), *phase.shape), exemplar.dtype)
    for k in (0, 1):
        here = phase == k if free is None else (phase == k) & free
        if not here.any():
            continue
        for channel, values in enumerate(channels):
            # Rows are volumes of one line: the order of the voxels is all that counts.
            own, wanted = gray[channel][here], values[phases.phase == k]
            placed = match_histogram(
                own[None, None],
                wanted[None, None],
                ties="random",
                seed=request.seed,
                threads=request.threads,
            )
            out[channel][here] = placed.ravel()
    array = out[0] if exemplar.ndim == 3 else np.ascontiguousarray(np.moveaxis(out, 0, -1))
    request.impose(array, outside_value(phases, exemplar))
    return array


def outside_value(phases: Phases, exemplar: npt.NDArray[Any]) -> Any:
    """Return what lies outside the domain: the pore, of gray values the emptiest.

    Parameters
    ----------
    phases : Phases
        The exemplar's.
    exemplar : numpy.ndarray
        Shape (z, y, x[, channel]).

    Returns
    -------
    scalar or numpy.ndarray
        A value, or one a channel.
    """
    if phases.kind != "gray":
        return phases.labels[0]
    emptiest = np.max if phases.solid == "dark" else np.min
    return emptiest(exemplar, axis=(0, 1, 2))
