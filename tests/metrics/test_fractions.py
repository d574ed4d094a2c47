"""Volume fractions."""

from __future__ import annotations

import numpy as np
import pytest

from poresynth import metrics


def test_porosity(rng: np.random.Generator) -> None:
    solid = rng.random((9, 10, 11)) < 0.3
    assert metrics.porosity(solid) == pytest.approx(1 - solid.mean())
    assert metrics.porosity(np.zeros((1, 1, 1), bool)) == 1
    assert metrics.porosity(np.ones((1, 1, 1), bool)) == 0
