"""Whether known voxels can be told from new ones at the border between them."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

__all__ = ["border_steps", "expected_steps", "seam"]

_Array = npt.NDArray[Any]
_Bools = npt.NDArray[np.bool_]


def seam(
    volume: tuple[_Array, _Bools],
    exemplar: tuple[_Array, _Bools],
    known: _Bools,
    domain: _Bools | None = None,
) -> dict[str, float | None]:
    """Compare the steps across the border of the known voxels with those in the exemplar.

    Parameters
    ----------
    volume, exemplar : (numpy.ndarray, numpy.ndarray of bool)
        Values, shape (z, y, x[, channel]), whose first channel is looked at, and the solid, shape
        (z, y, x).
    known : numpy.ndarray of bool
        Where the volume was given, shape (z, y, x).
    domain : numpy.ndarray of bool, optional
        Where it matters, same shape.

    Returns
    -------
    dict
        ``phase_changes``: how many pairs of neighbours across the border differ in phase, over how
        many of as many pairs along the same axes do in the exemplar. ``steps``: the same of the
        absolute differences of their values. 1 if nothing is to be seen; above, there is a seam.
        None where there is nothing to compare.
    """
    ratios: dict[str, float | None] = {}
    for number, name in enumerate(("steps", "phase_changes")):
        mine, own = (pair[number] for pair in (volume, exemplar))
        mine, own = (a if a.ndim == 3 else a[..., 0] for a in (mine, own))
        expected = expected_steps(own, known, domain)
        ratios[name] = border_steps(mine, known, domain) / expected if expected > 0 else None
    return ratios


def border_steps(values: _Array, known: _Bools, domain: _Bools | None = None) -> float:
    """Return the sum of the steps between neighbours of which one is known.

    Parameters
    ----------
    values : numpy.ndarray
        Shape (z, y, x), numbers or bool.
    known : numpy.ndarray of bool
        Same shape.
    domain : numpy.ndarray of bool, optional
        Where pairs count, same shape.
    """
    total = 0.0
    for axis in range(3):
        across = _across(known, domain, axis)
        low, high = (side[across].astype(np.float64) for side in _neighbours(values, axis))
        total += float(np.abs(low - high).sum())
    return total


def expected_steps(exemplar: _Array, known: _Bools, domain: _Bools | None = None) -> float:
    """Return the sum of as many steps along the same axes in an exemplar, shape (z, y, x)."""
    total = 0.0
    for axis in range(3):
        count = int(np.count_nonzero(_across(known, domain, axis)))
        low, high = _neighbours(exemplar, axis)
        if count and low.size:
            steps = np.abs(low.astype(np.float64) - high.astype(np.float64))
            total += count * float(steps.mean())
    return total


def _across(known: _Bools, domain: _Bools | None, axis: int) -> _Bools:
    """Return the pairs of neighbours of which one is known, in the domain."""
    first, second = _neighbours(known, axis)
    across: _Bools = first ^ second
    if domain is not None:
        inside = _neighbours(domain, axis)
        across &= inside[0] & inside[1]
    return across


def _neighbours(array: _Array, axis: int) -> tuple[_Array, _Array]:
    along = np.moveaxis(array, axis, 0)
    return along[:-1], along[1:]
