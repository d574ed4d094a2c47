"""The one distance between distributions that the metrics use."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

__all__ = ["wasserstein"]


def wasserstein(positions: npt.NDArray[Any], a: npt.NDArray[Any], b: npt.NDArray[Any]) -> float:
    """Return the 1-Wasserstein distance of two distributions on a line.

    Parameters
    ----------
    positions : numpy.ndarray
        Places that carry weight, ascending, shape (n,).
    a, b : numpy.ndarray
        Weights of the two distributions at these places, shape (n,); scaled to a sum of 1.

    Returns
    -------
    float
        ∫ |F_a − F_b| over the line, in the unit of ``positions``: how far the one distribution
        must be moved, on average, to become the other.
    """
    difference = np.cumsum(a / np.sum(a) - b / np.sum(b))[:-1]
    return float(np.sum(np.abs(difference) * np.diff(positions)))
