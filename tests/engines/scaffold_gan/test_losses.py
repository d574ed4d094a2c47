"""Each loss against its twin, its gradient against finite differences, and what it must not see."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from tests.references import scaffold_losses as twin
from torch import Tensor

from poresynth.engines.scaffold_gan.losses.adversarial import discriminator_loss, generator_loss
from poresynth.engines.scaffold_gan.losses.gram import gram_loss
from poresynth.engines.scaffold_gan.losses.porosity import STEEPNESS, porosity_loss, soft_solid
from poresynth.engines.scaffold_gan.losses.search import nearest
from poresynth.engines.scaffold_gan.losses.sliced_wasserstein import (
    random_filters,
    sliced_wasserstein_loss,
)
from poresynth.engines.scaffold_gan.losses.structural import (
    cuboids,
    look_up_table,
    region_grid,
    regions,
    structural_loss,
)
from poresynth.engines.scaffold_gan.losses.two_point import covariance, two_point_loss

CLOSE = 1e-5


def features(seed: int, *shape: int) -> Tensor:
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed))


def wide(tensor: Tensor) -> np.ndarray:
    return tensor.detach().numpy().astype(np.float64)


def close(found: Tensor, expected: float) -> None:
    assert float(found) == pytest.approx(expected, rel=CLOSE, abs=CLOSE * 0.1)


def check_gradient(loss: Callable[[Tensor], Tensor], at: Tensor) -> None:
    """Compare the gradient with central differences in random directions, in double precision."""
    at = at.double().requires_grad_()
    (gradient,) = torch.autograd.grad(loss(at), at)
    assert gradient.abs().max() > 0
    random, step = torch.Generator().manual_seed(9), 1e-5
    for _ in range(4):
        direction = torch.randn(at.shape, generator=random, dtype=torch.float64)
        with torch.no_grad():
            difference = (loss(at + step * direction) - loss(at - step * direction)) / (2 * step)
        expected = float((gradient * direction).sum())
        assert float(difference) == pytest.approx(expected, rel=2e-3, abs=1e-6)


# --- adversarial ------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", [(4, 1, 1, 1, 1), (2, 1, 6, 6, 6)])
def test_adversarial_losses_are_the_twins(shape: tuple[int, ...]) -> None:
    real, fake = 2 * features(0, *shape), 2 * features(1, *shape)
    close(discriminator_loss(real, fake), twin.discriminator_loss(wide(real), wide(fake)))
    for kind in ("non_saturating", "saturating"):
        close(generator_loss(fake, kind), twin.generator_loss(wide(fake), kind))
        check_gradient(lambda x, kind=kind: generator_loss(x, kind), fake)
    check_gradient(lambda x: discriminator_loss(real.double(), x), fake)


def test_logits_of_any_size_give_finite_losses() -> None:
    far = torch.tensor([-1e4, 1e4])
    assert torch.isfinite(discriminator_loss(far, far))
    assert torch.isfinite(generator_loss(far, "saturating"))


# --- structural -------------------------------------------------------------------------------

SHAPES = [((2, 2, 2), (2, 2, 2)), ((4, 2, 1), (4, 2, 1)), ((3, 3, 3), (1, 2, 3))]


@pytest.mark.parametrize(("shape", "stride"), SHAPES)
def test_regions_are_the_twins(shape: Any, stride: Any) -> None:
    maps = features(2, 2, 3, 5, 6, 7)
    found = regions(maps, shape, stride)
    assert np.array_equal(found.numpy(), np.stack(twin.regions(maps.numpy(), shape, stride)))
    assert len(found) == 2 * np.prod(region_grid((5, 6, 7), shape, stride))


@given(st.integers(0, 2**31), st.integers(1, 40), st.integers(1, 40), st.integers(1, 100))
def test_search_is_brute_force(seed: int, queries: int, rows: int, block: int) -> None:
    q, t = features(seed, queries, 6), features(seed + 1, rows, 6)
    assert nearest(q, t, block).tolist() == twin.nearest(wide(q), wide(t))


def test_search_keeps_its_digits_far_from_zero() -> None:
    # Rows that differ by 10⁻³ around 100: plain float32 products lose them.
    q, t = features(3, 50, 64), features(4, 200, 64)
    found = nearest(100 + 1e-3 * q, 100 + 1e-3 * t)
    exact = twin.nearest(wide(100 + 1e-3 * q), wide(100 + 1e-3 * t))
    assert np.mean(np.array(exact) == found.numpy()) > 0.95
    for row, own, best in zip(wide(100 + 1e-3 * q), found.tolist(), exact, strict=True):
        table = wide(100 + 1e-3 * t)
        near, nearer = (((row - table[i]) ** 2).sum() for i in (own, best))
        assert near <= 1.05 * nearer


def test_search_takes_the_first_of_equals_and_one_row_is_always_nearest() -> None:
    assert nearest(torch.ones(3, 2), torch.ones(5, 2)).tolist() == [0, 0, 0]
    assert nearest(features(0, 4, 3), features(1, 1, 3)).tolist() == [0] * 4


@pytest.mark.parametrize(("shape", "stride"), SHAPES)
def test_structural_loss_is_the_twin(shape: Any, stride: Any) -> None:
    fake, real = features(5, 2, 3, 5, 6, 7), features(6, 2, 3, 5, 6, 7)
    table = look_up_table(real, shape, stride, None)
    found = structural_loss(fake, table, shape, stride)
    close(found, twin.structural_loss(wide(fake), wide(table), shape, stride))
    check_gradient(lambda x: structural_loss(x, table.double(), shape, stride), fake)


def test_structural_loss_of_what_is_in_the_table_is_nothing_and_the_table_has_no_gradient() -> None:
    real = features(7, 2, 3, 4, 4, 4).requires_grad_()
    table = look_up_table(real, (2, 2, 2), (2, 2, 2), None)
    assert not table.requires_grad
    assert float(structural_loss(real.detach(), table, (2, 2, 2), (2, 2, 2))) == 0


def test_a_table_has_the_regions_of_its_anchors() -> None:
    real = features(8, 2, 3, 4, 4, 4)
    anchors = torch.tensor([5, 0, 11])
    whole = look_up_table(real, (2, 2, 2), (2, 2, 2), None)
    part = look_up_table(real, (2, 2, 2), (2, 2, 2), anchors)
    assert torch.equal(part, whole[anchors])


def test_structural_loss_means_the_same_at_any_size() -> None:
    table = look_up_table(features(9, 8, 2, 8, 8, 8), (2, 2, 2), (2, 2, 2), None)
    losses = [
        float(structural_loss(features(10, b, 2, n, n, n), table, (2, 2, 2), (2, 2, 2)))
        for b, n in ((4, 8), (1, 16), (8, 4))
    ]
    assert max(losses) < 1.1 * min(losses)


@pytest.mark.parametrize("width", [2, 4, 8])
def test_cuboids_have_the_volume_of_the_cube_and_one_long_axis_each(width: int) -> None:
    shapes = cuboids(width)
    assert {int(np.prod(shape)) for shape in shapes} == {width**3}
    assert sorted(int(np.argmax(shape)) for shape in shapes) == [0, 1, 2]


# --- Gram -------------------------------------------------------------------------------------


@pytest.mark.parametrize("slices", [1, 3, 9])
def test_gram_loss_is_the_twin(slices: int) -> None:
    fake, real = features(11, 2, 3, 4, 5, 6), features(12, 3, 3, 4, 5, 6)
    found = gram_loss(fake, real, slices)
    close(found, twin.gram_loss(wide(fake), wide(real), slices))
    if slices == 3:
        real = real.double()
        # In double precision, which the loss itself leaves.
        at = fake.clone().requires_grad_()
        (gradient,) = torch.autograd.grad(gram_loss(at, real.float(), slices), at)
        direction = features(13, *fake.shape)
        step = 1e-3
        ends = [
            twin.gram_loss(wide(fake + s * direction), wide(real), slices) for s in (step, -step)
        ]
        expected = (ends[0] - ends[1]) / (2 * step)
        assert float((gradient * direction).sum()) == pytest.approx(expected, rel=1e-3)


def test_gram_loss_does_not_see_where_things_are() -> None:
    real = features(14, 2, 3, 6, 6, 6)
    moved = real.flatten(2)[..., torch.randperm(216)].reshape(real.shape)
    assert float(gram_loss(real, real, 6)) == 0
    assert float(gram_loss(moved, real, 6)) < 1e-10


# --- beyond the paper -------------------------------------------------------------------------


def test_sliced_wasserstein_loss_is_the_twin() -> None:
    fake, real = features(15, 2, 1, 7, 7, 7), features(16, 2, 1, 7, 7, 7)
    filters = random_filters(3, 1, 3, torch.Generator().manual_seed(0))
    places = torch.rand(20, generator=torch.Generator().manual_seed(1))
    found = sliced_wasserstein_loss(fake, real, filters, scales=2, places=places)
    arrays = (wide(fake), wide(real), wide(filters))
    close(found, twin.sliced_wasserstein(*arrays, 2, places.numpy().astype(np.float32)))


def test_sliced_wasserstein_loss_has_the_gradient_of_its_twin() -> None:
    fake, real = features(17, 1, 1, 5, 5, 5), features(18, 1, 1, 5, 5, 5)
    filters = random_filters(2, 1, 3, torch.Generator().manual_seed(0))
    places = torch.rand(15, generator=torch.Generator().manual_seed(1))
    at = fake.clone().requires_grad_()
    loss = sliced_wasserstein_loss(at, real, filters, scales=1, places=places)
    (gradient,) = torch.autograd.grad(loss, at)
    direction, step = features(19, *fake.shape), 1e-4
    arrays = (wide(real), wide(filters), 1, places.numpy())
    up, down = (
        twin.sliced_wasserstein(wide(fake) + s * wide(direction), *arrays) for s in (step, -step)
    )
    expected = (up - down) / (2 * step)
    assert float((gradient * direction).sum()) == pytest.approx(expected, rel=1e-3)


def test_random_filters_have_norm_one() -> None:
    filters = random_filters(24, 2, 6, torch.Generator().manual_seed(0))
    assert torch.allclose(filters.flatten(1).norm(dim=1), torch.ones(24))


def test_covariance_is_the_twin() -> None:
    volumes, reach = features(20, 2, 1, 6, 7, 8).cumsum(2), 3
    found, expected = covariance(volumes, reach), twin.covariance(wide(volumes), reach)
    assert found.shape == (7, 7, 4)
    for (z, y, x), value in expected.items():
        assert float(found[z, y, x]) == pytest.approx(value, abs=1e-5)


def test_two_point_loss_sees_no_mean_and_no_contrast() -> None:
    real, fake = features(21, 2, 1, 8, 8, 8).cumsum(3), features(22, 2, 1, 8, 8, 8)
    first = two_point_loss(fake, real, 3)
    assert float(two_point_loss(3 * fake + 5, real, 3)) == pytest.approx(float(first), rel=1e-3)
    assert float(two_point_loss(real, real, 3)) < 1e-12
    assert float(two_point_loss(torch.zeros_like(real), real, 3)) < 10


def test_two_point_loss_has_the_gradient_of_its_twin() -> None:
    real, fake = features(23, 1, 1, 6, 6, 6).cumsum(2), features(24, 1, 1, 6, 6, 6)
    own = twin.covariance(wide(real), 2)

    def loss(volume: np.ndarray) -> float:
        found = twin.covariance(volume, 2)
        return float(np.mean([(found[lag] - own[lag]) ** 2 for lag in own]))

    close(two_point_loss(fake, real, 2), loss(wide(fake)))
    at = fake.clone().requires_grad_()
    (gradient,) = torch.autograd.grad(two_point_loss(at, real, 2), at)
    direction, step = features(25, *fake.shape), 1e-4
    up, down = (loss(wide(fake) + s * wide(direction)) for s in (step, -step))
    assert float((gradient * direction).sum()) == pytest.approx((up - down) / (2 * step), rel=1e-3)


def test_porosity_loss_is_the_twin() -> None:
    fake = torch.tanh(features(26, 2, 1, 4, 4, 4))
    close(
        porosity_loss(fake, 0.1, 0.3),
        twin.porosity_loss(wide(fake), 0.1, 0.3, STEEPNESS),
    )
    at = fake.clone().requires_grad_()
    (gradient,) = torch.autograd.grad(porosity_loss(at, 0.1, 0.3), at)
    direction, step = features(27, *fake.shape), 1e-4
    up, down = (
        twin.porosity_loss(wide(fake) + s * wide(direction), 0.1, 0.3, STEEPNESS)
        for s in (step, -step)
    )
    assert float((gradient * direction).sum()) == pytest.approx((up - down) / (2 * step), rel=1e-3)


def test_soft_solid_is_nearly_the_solid_of_clear_phases() -> None:
    values = torch.where(features(28, 1, 1, 20, 20, 20) > 0.5, 1.0, -1.0)
    share = float((values > 0).float().mean())
    assert float(soft_solid(values, 0.0)) == pytest.approx(share, abs=2e-3)


# --- what they are for ------------------------------------------------------------------------


def followed(loss: Callable[[Tensor], Tensor], start: Tensor, steps: int = 60) -> Tensor:
    """The volume that a loss makes of a start."""
    raw = start.clone().requires_grad_()
    adam = torch.optim.Adam([raw], 0.1)
    for _ in range(steps):
        adam.zero_grad()
        loss(torch.tanh(raw)).backward()  # type: ignore[no-untyped-call]
        adam.step()
    return torch.tanh(raw).detach()


def test_each_loss_brings_what_it_is_for() -> None:
    """White noise, led by one loss alone to sheets across z, of which a third is solid."""
    sheets = torch.where(torch.arange(24) % 6 < 2, 0.9, -0.9)[:, None, None].expand(24, 24, 24)
    real = (sheets + 0.05 * features(30, 24, 24, 24))[None, None]
    start = 0.3 * features(31, 1, 1, 24, 24, 24)
    shape = (6, 2, 2)
    table = look_up_table(real, shape, shape, None)

    filters, drawn = random_filters(24, 1, 4, torch.Generator().manual_seed(0)), itertools.count()

    def responses(volume: Tensor, seed: int) -> Tensor:
        places = torch.rand(2000, generator=torch.Generator().manual_seed(seed))
        return sliced_wasserstein_loss(volume, real, filters, scales=1, places=places)

    def solid(volume: Tensor) -> float:
        return abs(float((volume > 0).float().mean()) - 1 / 3)

    def order(volume: Tensor) -> float:
        """How far neighbours within a sheet, and across sheets, are from those of the sheets."""
        found, own = covariance(volume, 3), covariance(real, 3)
        return float((found - own).abs().mean())

    def tone(volume: Tensor) -> float:
        return abs(float(volume.square().mean()) - float(real.square().mean()))

    for loss, measure in (
        (lambda v: porosity_loss(v, 0.0, float(soft_solid(real, 0.0))), solid),
        (lambda v: two_point_loss(v, real, 3), order),
        # At other places each time.
        (lambda v: responses(v, next(drawn)), lambda v: float(responses(v, 10**6))),
        (lambda v: structural_loss(v, table, shape, shape), order),
        (lambda v: gram_loss(v, real, 24), tone),
    ):
        before, after = measure(torch.tanh(start)), measure(followed(loss, start))
        assert after < before / 2, (before, after)
