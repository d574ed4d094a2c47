"""The periodic encoding, Eq. 3."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from tests.references import periodic_field as twin

from poresynth.engines.periodic_field.encoding import diagonals, encode, encoded_size


@pytest.mark.parametrize("bandwidth", [0, 1, 5])
def test_it_is_equation_3(bandwidth: int) -> None:
    phases = torch.linspace(-3, 3, 29, dtype=torch.float64)
    found = encode(phases, bandwidth).numpy()
    expected = [twin.encode(float(u), bandwidth) for u in phases]
    assert found.shape == (29, encoded_size(bandwidth))
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_its_period_is_a_phase_of_two() -> None:
    phases = torch.rand(3, 7, dtype=torch.float64)
    torch.testing.assert_close(encode(phases + 2, 5), encode(phases, 5), atol=1e-12, rtol=0)
    assert (encode(phases + 1, 5) - encode(phases, 5)).abs().max() > 0.5


def test_there_is_a_sum_for_every_diagonal() -> None:
    assert set(diagonals(2)) == {(1, 1), (1, -1)}
    found = diagonals(3)
    assert len(found) == len(set(found)) == 10
    assert all(tuple(-s for s in signs) not in found for signs in found)
