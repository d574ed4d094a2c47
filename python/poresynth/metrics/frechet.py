"""The Fréchet distance between two sets of features."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from poresynth.errors import ParameterError

__all__ = ["frechet_distance"]


def frechet_distance(first: npt.ArrayLike, second: npt.ArrayLike) -> float:
    """Return the squared Fréchet distance between the normal laws of two sets of features.

    ‖μ₁ − μ₂‖² + tr(C₁ + C₂ − 2 (C₁ C₂)^½): of Inception features of many images this is the FID
    (Heusel et al. 2017), of those at all places of one image the SIFID (Shaham et al. 2019).

    Parameters
    ----------
    first, second : array_like
        Shape (samples, features), at least two samples each.

    Returns
    -------
    float
        0 for equal means and covariances.

    Raises
    ------
    ParameterError
        If there are fewer than two samples, other numbers of features, or values that are not
        finite.

    Notes
    -----
    The trace of the root is that of the roots of the eigenvalues of C₁^½ C₂ C₁^½, which is
    symmetric: no complex root comes up where covariances are singular, as they are for fewer
    samples than features.
    """
    sets = [np.asarray(values, np.float64) for values in (first, second)]
    for name, values in zip(("first", "second"), sets, strict=True):
        if values.ndim != 2 or len(values) < 2:
            allowed = "must be (samples, features), with two samples or more"
            raise ParameterError(name, values.shape, allowed)
        if not np.isfinite(values).all():
            raise ParameterError(name, "NaN or infinite", "must be finite")
    if sets[0].shape[1] != sets[1].shape[1]:
        allowed = f"must have as many features as first, {sets[0].shape[1]}"
        raise ParameterError("second", sets[1].shape, allowed)
    (mean, own), (other_mean, other) = (
        (values.mean(0), np.atleast_2d(np.cov(values, rowvar=False))) for values in sets
    )
    root = _root(own)
    product = np.linalg.eigvalsh(root @ other @ root)
    mixed = np.sqrt(np.maximum(product, 0)).sum()
    distance = np.square(mean - other_mean).sum() + np.trace(own) + np.trace(other) - 2 * mixed
    return max(0.0, float(distance))


def _root(matrix: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return the symmetric root of a symmetric matrix without negative eigenvalues."""
    values, vectors = np.linalg.eigh(matrix)
    return np.asarray((vectors * np.sqrt(np.maximum(values, 0))) @ vectors.T)
