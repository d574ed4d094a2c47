"""Which field to synthesise: the distance to the solid's surface, or the intensities."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from poresynth import _core
from poresynth.engines.phases import Phases

__all__ = ["TWO_PHASES", "choose_field", "explained_share"]

Field = Literal["distance", "intensity"]

TWO_PHASES = 0.935
"""Share from which the distance is taken: Gaussian random fields have 0.87 to 0.92, of any length,
spectrum and noise, scans of bone and cement 0.947 to 0.98. What lies between is made about as well
either way (`benches/python/field_choice.py`)."""

SMOOTHING = 1.0
"""Voxels; takes six sevenths of the standard deviation of white noise, and leaves every feature
that windows can match."""

REACH = 6
"""Voxels beyond which distances count as one. That of the default clip, but fixed: a smaller clip
does not make other phases."""


def choose_field(
    array: npt.NDArray[Any], phases: Phases, asked: Literal["auto", "distance", "intensity"]
) -> tuple[Field, str]:
    """Return what is synthesised, and why in a few words.

    Parameters
    ----------
    array : numpy.ndarray
        The exemplar, shape (z, y, x) or (z, y, x, channel).
    phases : Phases
        Its phases.
    asked : {"auto", "distance", "intensity"}
        A named field is taken without a measurement.
    """
    if asked != "auto":
        return asked, f"{asked}, as asked"
    if phases.kind != "gray":
        values = "two values" if phases.kind == "binary" else "labels"
        return "distance", f"distance, for the exemplar has {values}, not grays"
    share = explained_share(array if array.ndim == 3 else array[..., 0], phases)
    # Rounded down, so that no number stands on the wrong side of the limit.
    percent = np.floor(1000 * share) / 10
    limit = f"two clear phases: {100 * TWO_PHASES:g} % or more"
    if share >= TWO_PHASES:
        return "distance", f"distance, which explains {percent:.1f} % of the grays ({limit})"
    return "intensity", f"intensity, for distance explains {percent:.1f} % of the grays ({limit})"


def explained_share(gray: npt.NDArray[Any], phases: Phases) -> float:
    """Return how much of the structure of gray values follows from the distance to the surface.

    1 − C_r(1) / C_g(1), with the autocovariances at one voxel of the gray values g, smoothed
    against noise, and of what remains of them, r = g − E[g | signed distance]. Two phases have
    nearly all of it, however blurred their border and however noisy the scan; the cut of a Gaussian
    random field has about nine tenths. The histogram alone would not do: noise and blur fill its
    valley.

    Parameters
    ----------
    gray : numpy.ndarray
        Shape (z, y, x).
    phases : Phases
        Of a gray volume: whose threshold is the surface.

    Returns
    -------
    float
        0 to 1; 1 where nothing remains to explain, 0 where the distance says nothing.

    Notes
    -----
    Peak memory: about 40 bytes per voxel.
    """
    assert phases.threshold is not None
    # Zero at the surface and of span one, so that float32 holds every range.
    scaled = gray.astype(np.float64) - phases.threshold
    scaled /= scaled.max() - scaled.min()
    smooth = _core.gaussian(scaled.astype(np.float32)[None], SMOOTHING, boundary="open")[0]
    distance = _core.signed_distance(smooth > 0, REACH, boundary="open")
    # Bins of half a voxel: finer ones hold too few voxels in a small exemplar.
    place = np.rint(2 * (distance + REACH)).astype(np.intp).ravel()
    values = smooth.ravel().astype(np.float64)
    values -= values.mean()
    means = np.bincount(place, values) / np.maximum(np.bincount(place), 1)
    whole = _neighbours(values.reshape(gray.shape))
    left = _neighbours((values - means[place]).reshape(gray.shape))
    # White noise has next to no structure of which anything could be explained.
    return float(np.clip(1 - left / whole, 0, 1)) if whole > 0 else 0.0


def _neighbours(values: npt.NDArray[np.float64]) -> float:
    """Return the mean product of neighbouring voxels, a mean of the axes (of an image, two)."""
    lines = (np.moveaxis(values, axis, 0) for axis in range(3) if values.shape[axis] > 1)
    return float(np.mean([np.mean(line[1:] * line[:-1]) for line in lines]))
