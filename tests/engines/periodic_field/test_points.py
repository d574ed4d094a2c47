"""Distances to random points as latent values."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from tests.engines.periodic_field.test_latent import SPACING, Numbers, grid
from tests.references import periodic_field as twin
from torch import Tensor

from poresynth import _core
from poresynth.engines.periodic_field.latent import LatentField
from poresynth.engines.periodic_field.lattice import Cells, cells_around, shifts
from poresynth.engines.periodic_field.points import _FARTHEST, JITTER, _anywhere, _native
from poresynth.errors import ParameterError


def field(axes: int, points: tuple[int, ...] = (1, 1)) -> LatentField:
    return LatentField(axes, points, 1, 3, 1, SPACING[:axes], "gradient", 0.2)


class Centred(Numbers):
    """The same numbers from −1 to 1."""

    def __init__(self, axes: int) -> None:
        super().__init__(axes)
        self.table = 2 * self.table - 1


@pytest.mark.parametrize("axes", [2, 3])
@pytest.mark.parametrize("fineness", [(1, 1), (1, 3), (2, 1)])
def test_they_are_those_to_all_points_of_the_cells_around(
    axes: int, fineness: tuple[int, ...]
) -> None:
    numbers, phases = Centred(axes), grid(axes)
    made = field(axes, fineness)
    found = made(phases, numbers)
    assert found.shape == (2, *[5] * axes, made.size)
    assert made.size == 2 * (axes + 1) + 3
    offsets = shifts(axes, 3).numpy()
    for window in range(2):
        for index in np.ndindex(*[5] * axes):
            for lattice in range(2):
                place = [
                    float(phases[k][window, index[k]]) * fineness[lattice] / SPACING[k]
                    - offsets[lattice, k]
                    for k in range(axes)
                ]
                expected = twin.nearest_distances(
                    place,
                    lambda site, n=lattice, w=window: numbers.at(n, w, site)[:axes],
                    JITTER,
                    _FARTHEST,
                    reach=2,
                )
                first = (axes + 1) * lattice
                here = found[(window, *index)][first : first + axes + 1]
                np.testing.assert_allclose(here, 2 * expected - 1.2, atol=1e-5)


def test_numbers_come_after_them_on_a_lattice_half_as_coarse() -> None:
    numbers, phases = Centred(2), grid(2)
    found = field(2)(phases, numbers)[..., 6:]
    offsets = shifts(2, 3).numpy()
    for index in np.ndindex(5, 5):
        place = [2 * float(phases[k][1, index[k]]) / SPACING[k] - offsets[2, k] for k in range(2)]
        expected = twin.latent(place, lambda site: numbers.at(2, 1, site)[:3], "gradient", 0.2)
        np.testing.assert_allclose(found[(1, *index)], expected, atol=1e-5)


@pytest.mark.parametrize("axes", [2, 3])
def test_they_go_on_across_cells_with_a_slope_of_one(axes: int) -> None:
    made = LatentField(axes, (1,), 1, 1, 1, (1.0,) * axes, "gradient", 0.2)
    generator = torch.Generator().manual_seed(6)
    table = 2 * torch.rand((1, 1, 3, *[12] * axes), generator=generator) - 1

    def numbers(lattices: range, count: int, cells: Cells) -> Tensor:
        box = [
            slice(2 + f, 2 + f + n)
            for f, n in zip(cells.first[0, 0].tolist(), cells.sites, strict=True)
        ]
        return table[(slice(None), slice(None), slice(count), *box)]

    step = 0.01
    line = torch.arange(0.0, 4.0, step, dtype=torch.float64)[None]
    others = [torch.tensor([[0.3, 1.7]], dtype=torch.float64)] * (axes - 1)
    found = made([line, *others], numbers)[0, ..., : axes + 1]
    slope = (torch.diff(found, dim=0) / (2 * step)).abs()
    # No jump anywhere: no more than a step's length.
    assert slope.max() < 1.001
    inside = found[..., 0]
    assert 0 < (inside + 1.2).min() < 0.5 < (inside + 1.2).max() / 2 < 1.2


def test_no_gradient_flows_through_them() -> None:
    scale = torch.tensor(1.0, dtype=torch.float64, requires_grad=True)
    found = field(2)([phase * scale for phase in grid(2)], Centred(2))
    assert found[..., 6:].requires_grad
    (by_distances,) = torch.autograd.grad(found[..., :6].sum(), scale, retain_graph=True)
    assert by_distances == 0


@pytest.mark.parametrize("axes", [2, 3])
@pytest.mark.parametrize(("batch", "edge"), [(1, 1), (3, 5), (40, 4), (1, 19)])
def test_the_kernel_finds_what_the_operations_of_any_device_find(
    axes: int, batch: int, edge: int
) -> None:
    random = torch.Generator().manual_seed(7)
    phases = [2.3 * torch.rand(batch, edge, generator=random) - 1 for _ in range(axes)]
    cells = cells_around(phases, SPACING[:axes], [2, 2], shifts(axes, 2), None, 1)
    offsets = torch.rand((2, batch, axes, *cells.sites), generator=random) - 0.5
    places = 0.5 + JITTER * offsets
    cells = cells.like(places)
    found = _native(places, cells)
    assert found.shape == (2, batch, *[edge] * axes, axes + 1)
    torch.testing.assert_close(found, _anywhere(places, cells), atol=1e-6, rtol=0)
    assert (found.diff(dim=-1) >= 0).all()


@pytest.mark.parametrize("parameter", ["points", "cells", "kept"])
def test_the_kernel_refuses_what_does_not_fit(parameter: str) -> None:
    cells, fractions = np.ones(2, np.int64), np.zeros(2, np.float32)
    given = {
        "points": np.zeros(3 * 27, np.float32),
        "cells": [cells] * 3,
        "kept": 4,
    }
    given |= {
        "points": {"points": np.zeros(80, np.float32)},
        "cells": {"cells": [cells, cells, cells + 2]},
        "kept": {"kept": 5},
    }[parameter]
    with pytest.raises(ParameterError, match=parameter):
        _core.point_distances(
            given["points"],
            [3, 3, 3],
            given["cells"],
            [fractions] * 3,
            count=1,
            kept=given["kept"],
            farthest=1.0,
        )
