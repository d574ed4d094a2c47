"""The latent random field, Eq. 4."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from tests.references import periodic_field as twin
from torch import Tensor

from poresynth.engines.periodic_field.latent import LatentField, quintic
from poresynth.engines.periodic_field.lattice import Cells, shifts

SPACING = (0.3, 0.7, 0.45)


class Numbers:
    """Random numbers of three lattices, two windows and four numbers, from one table."""

    def __init__(self, axes: int) -> None:
        generator = torch.Generator().manual_seed(5)
        self.table = torch.rand((3, 2, 4, *[40] * axes), generator=generator)

    def at(self, group: int, window: int, site: tuple[int, ...]) -> np.ndarray:
        return self.table[(group, window, slice(None), *[s + 8 for s in site])].numpy()

    def __call__(self, lattices: range, numbers: int, cells: Cells) -> Tensor:
        rows = []
        for row, lattice in enumerate(lattices):
            for window in range(2):
                start = cells.first[row, window].tolist()
                box = [slice(s + 8, s + 8 + n) for s, n in zip(start, cells.sites, strict=True)]
                rows.append(self.table[(lattice, window, slice(numbers), *box)])
        return torch.stack(rows).unflatten(0, (len(lattices), 2))


def grid(axes: int, points: int = 5) -> list[Tensor]:
    generator = torch.Generator().manual_seed(7)
    starts = [torch.rand(2, 1, generator=generator, dtype=torch.float64) for _ in range(axes)]
    return [start * 2 + 0.21 * torch.arange(points) for start in starts]


@pytest.mark.parametrize("axes", [2, 3])
@pytest.mark.parametrize("kind", ["gradient", "quintic", "paper"])
@pytest.mark.parametrize("sigma", [0.2, 1.0])
def test_it_is_equation_4_or_separable(axes: int, kind: str, sigma: float) -> None:
    numbers = Numbers(axes)
    field = LatentField(axes, (), 3, 4, 2, SPACING[:axes], kind, sigma)  # type: ignore[arg-type]
    phases = grid(axes)
    found = field(phases, numbers)
    assert found.shape == (2, *[5] * axes, 12)
    offsets = shifts(axes, 3).numpy()
    for window in range(2):
        for index in np.ndindex(*[5] * axes):
            for group in range(3):
                place = [
                    # The second group's lattice is twice as fine.
                    float(phases[k][window, index[k]]) * (1, 2, 1)[group] / SPACING[k]
                    - offsets[group, k]
                    for k in range(axes)
                ]
                expected = twin.latent(
                    place, lambda site, g=group, w=window: numbers.at(g, w, site), kind, sigma
                )
                here = found[(window, *index)][4 * group : 4 * group + 4]
                np.testing.assert_allclose(here, expected, atol=5e-6)


def jump(kind: str, sigma: float) -> float:
    """Root mean square step across a face of the cells, over that of the field."""
    field = LatentField(3, (), 1, 64, 1, (1.0, 1.0, 1.0), kind, sigma)  # type: ignore[arg-type]
    line = torch.linspace(0.05, 7.95, 40, dtype=torch.float64)[None]
    generator = torch.Generator().manual_seed(3)
    table = 2 * torch.rand((1, 1, 64, 12, 12, 12), generator=generator) - 1

    def numbers(lattices: range, count: int, cells: Cells) -> Tensor:
        first = cells.first[0, 0].tolist()
        box = [slice(f, f + n) for f, n in zip(first, cells.sites, strict=True)]
        return table[(slice(None), slice(None), slice(None), *box)]

    sides = [
        field([torch.tensor([[4 + away]], dtype=torch.float64), line, line], numbers)
        for away in (-1e-7, 1e-7)
    ]
    spread = sides[0].std()
    return float((sides[1] - sides[0]).square().mean().sqrt() / spread)


def test_the_quintic_fields_are_continuous_and_equation_4_is_not() -> None:
    assert jump("quintic", 0.2) < 1e-5
    assert jump("gradient", 0.2) < 1e-5
    assert 0.005 < jump("paper", 0.2) < jump("paper", 0.5) < jump("paper", 1.0)


def test_the_period_gets_a_gradient_through_the_latent_field() -> None:
    numbers = Numbers(2)
    field = LatentField(2, (), 3, 4, 1, (0.3, 0.3), "quintic", 0.2)
    for_scale = torch.tensor(1.0, dtype=torch.float64, requires_grad=True)

    def total(scale: Tensor) -> Tensor:
        return field([phase * scale for phase in grid(2)], numbers).square().sum()

    total(for_scale).backward()
    step = 1e-4
    around = [float(total(torch.tensor(1 + s, dtype=torch.float64))) for s in (-step, step)]
    assert for_scale.grad is not None
    assert float(for_scale.grad) == pytest.approx((around[1] - around[0]) / (2 * step), rel=0.02)


def test_groups_are_spread_over_a_cell_and_the_first_is_the_papers() -> None:
    offsets = shifts(3, 4)
    assert not offsets[0].any()
    assert ((offsets >= 0) & (offsets < 1)).all()
    for axis in range(3):
        places = torch.sort(offsets[:, axis]).values
        gaps = torch.diff(torch.cat([places, places[:1] + 1]))
        assert gaps.max() < 0.5


def test_the_quintic_starts_and_ends_flat() -> None:
    t = torch.tensor([0.0, 0.5, 1.0], dtype=torch.float64, requires_grad=True)
    value = quintic(t)
    assert value.tolist() == [0.0, 0.5, 1.0]
    (slope,) = torch.autograd.grad(value.sum(), t, create_graph=True)
    (bend,) = torch.autograd.grad(slope.sum(), t)
    assert slope[[0, 2]].abs().max() == 0
    assert bend.abs().max() < 1e-12


def test_slopes_make_a_field_with_a_wavelength_as_large_as_values_do() -> None:
    def curve(kind: str) -> np.ndarray:
        field = LatentField(2, (), 1, 2, 1, (1.0, 1.0), kind, 0.2)  # type: ignore[arg-type]
        line = torch.arange(0, 200, 0.25, dtype=torch.float64)[None]
        generator = torch.Generator().manual_seed(1)

        def numbers(lattices: range, count: int, cells: Cells) -> Tensor:
            return 2 * torch.rand((1, 1, count, *cells.sites), generator=generator) - 1

        # An equal mix of both slopes, as a linear layer would make it.
        found = field([line, line], numbers)[0].sum(-1).numpy()
        found = found - found.mean()
        return np.array([(found[:, : 800 - k] * found[:, k:]).mean() for k in range(12)])

    slopes, values = curve("gradient"), curve("quintic")
    assert slopes[0] == pytest.approx(values[0], rel=0.35)
    assert slopes.min() < -0.1 * slopes[0]
    assert values.min() > -0.02 * values[0]
