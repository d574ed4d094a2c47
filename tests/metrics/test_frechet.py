"""The Fréchet distance."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import linalg

from poresynth.errors import ParameterError
from poresynth.metrics.frechet import frechet_distance


@pytest.mark.parametrize(("samples", "features"), [(200, 6), (30, 1), (9, 20)])
def test_it_is_the_formula_with_the_root_of_the_product(samples: int, features: int) -> None:
    rng = np.random.default_rng(1)
    first = rng.normal(size=(samples, features)) @ rng.normal(size=(features, features))
    second = rng.normal(1, 2, size=(samples + 3, features))
    covariances = [np.atleast_2d(np.cov(v, rowvar=False)) for v in (first, second)]
    root = linalg.sqrtm(covariances[0] @ covariances[1])
    expected = np.square(first.mean(0) - second.mean(0)).sum()
    expected += np.trace(covariances[0] + covariances[1] - 2 * np.real(root))
    assert frechet_distance(first, second) == pytest.approx(expected, rel=1e-5)
    assert frechet_distance(second, first) == pytest.approx(expected, rel=1e-5)


def test_known_values() -> None:
    rng = np.random.default_rng(2)
    values = rng.normal(size=(500, 4))
    assert frechet_distance(values, values) == pytest.approx(0, abs=1e-9)
    assert frechet_distance(values, values + 3) == pytest.approx(4 * 9)
    centred = values - values.mean(0)
    # Twice as wide: the trace of C (1 − 2)².
    assert frechet_distance(centred, 2 * centred) == pytest.approx(np.trace(np.cov(values.T)))


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (np.zeros((1, 3)), np.zeros((5, 3))),
        (np.zeros((5, 3)), np.zeros((5, 2))),
        (np.zeros(5), np.zeros((5, 1))),
        (np.full((5, 2), np.nan), np.zeros((5, 2))),
    ],
)
def test_what_cannot_be_compared_is_refused(first: np.ndarray, second: np.ndarray) -> None:
    with pytest.raises(ParameterError):
        frechet_distance(first, second)
