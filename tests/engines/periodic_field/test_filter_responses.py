"""The sparse sliced-Wasserstein loss."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from poresynth.engines.periodic_field.distributions import quantiles
from poresynth.engines.periodic_field.responses import ResponseLoss, _filters, _lines
from poresynth.engines.periodic_field.windows import Windows

OPTIONS = {
    "reach": 20,
    "nodes": 4,
    "grids": 6,
    "filters": 32,
    "taps": (1, 5),
    "places": 512,
}


def blobs(axes: int = 2, channels: int = 1, seed: int = 0, edge: int = 48) -> torch.Tensor:
    noise = np.random.default_rng(seed).random((channels, *[edge] * axes))
    smooth = ndimage.gaussian_filter(noise, [0, *[2] * axes], mode="wrap")
    # The mean and the spread are the material's, not the specimen's.
    return torch.from_numpy((0.5 + 2.5 * (smooth - 0.5)).astype(np.float32))


def loss_of(exemplar: torch.Tensor, **options: object) -> ResponseLoss:
    random = torch.Generator().manual_seed(1)
    return ResponseLoss(Windows(exemplar), random=random, **{**OPTIONS, **options})  # type: ignore[arg-type]


def mean_loss(loss: ResponseLoss, field: torch.Tensor) -> float:
    random = torch.Generator().manual_seed(2)
    found = []
    for grid in range(len(loss.offsets)):
        windows = Windows(field).draw(list(loss.offsets[grid]), loss.places, random)
        found.append(float(loss(windows, grid)))
    return float(np.mean(found))


@pytest.mark.parametrize(("axes", "channels"), [(2, 1), (2, 3), (3, 2)])
def test_responses_are_weighted_sums_at_the_nodes(axes: int, channels: int) -> None:
    field = blobs(axes, channels)
    loss = loss_of(field)
    windows = Windows(field).draw(list(loss.offsets[1]), 10, torch.Generator().manual_seed(3))
    found = loss.responses(windows, 1)
    weights = loss._weights[1].reshape(32, channels, *[4] * axes)
    for place, filter_ in itertools.product(range(10), range(32)):
        expected = sum(
            float(weights[(filter_, slice(None), *node)] @ windows[(place, slice(None), *node)])
            for node in np.ndindex(*[4] * axes)
        )
        assert float(found[place, filter_]) == pytest.approx(expected, abs=1e-5)


def test_the_exemplars_responses_are_sorted_quantiles() -> None:
    field = blobs()
    loss = loss_of(field, places=64)
    random = torch.Generator().manual_seed(9)
    windows = Windows(field).draw(list(loss.offsets[2]), 40_000, random)
    many = (windows.flatten(1) @ loss._weights[2].T).numpy()
    expected = np.quantile(many, (np.arange(64) + 0.5) / 64, axis=0)
    assert (np.diff(loss.tables[2].numpy(), axis=0) >= 0).all()
    assert np.abs(loss.tables[2].numpy() - expected).mean() < 0.01 * many.std()


def test_the_loss_is_the_distance_of_sorted_responses() -> None:
    loss = loss_of(blobs())
    field = torch.rand(512, 1, 4, 4, generator=torch.Generator().manual_seed(4))
    responses = np.sort((field.flatten(1) @ loss._weights[0].T).numpy(), axis=0)
    expected = np.abs(responses - loss.tables[0].numpy()).mean()
    assert float(loss(field, 0)) == pytest.approx(expected, rel=1e-5)


@given(st.integers(1, 3), st.integers(2, 6), st.integers(0, 60), st.integers(0, 2**32))
def test_lines_are_distinct_and_within_reach(axes: int, nodes: int, more: int, seed: int) -> None:
    reach = nodes - 1 + more
    lines = _lines(axes, nodes, reach, torch.Generator().manual_seed(seed))
    assert lines.shape == (axes, nodes)
    assert (lines[:, 0] == 0).all()
    assert (torch.diff(lines, dim=1) >= 1).all()
    assert int(lines.max()) <= reach


def test_filters_have_the_taps_that_were_asked_for_and_unit_length() -> None:
    weights = _filters(300, 2, 16, (2, 5), torch.Generator().manual_seed(1)).reshape(300, 2, 16)
    taps = (weights != 0).any(1).sum(1)
    assert sorted(set(taps.tolist())) == [2, 3, 4, 5]
    torch.testing.assert_close(weights.square().sum((1, 2)), torch.ones(300))


def test_another_specimen_is_near_and_others_are_far() -> None:
    exemplar, other = blobs(edge=160), blobs(seed=1, edge=160)
    loss = loss_of(exemplar, reach=6)
    same = mean_loss(loss, other)
    order = np.random.default_rng(5).permutation(160 * 160)
    shuffled = other.reshape(-1)[order].reshape(other.shape)
    finer = torch.nn.functional.interpolate(other[None], scale_factor=3, mode="bilinear")[0]
    assert mean_loss(loss, exemplar) < 1.2 * same
    assert mean_loss(loss, shuffled) > 2 * same
    assert mean_loss(loss, finer) > 1.5 * same
    assert mean_loss(loss, other**2) > 3 * same


def test_its_gradient_is_that_of_finite_differences() -> None:
    loss = loss_of(blobs())
    field = torch.rand(512, 1, 4, 4, generator=torch.Generator().manual_seed(6))
    field.requires_grad_(True)
    loss(field, 0).backward()
    assert field.grad is not None
    direction = field.grad / field.grad.abs().max()
    step = 1e-2
    with torch.no_grad():
        ends = [float(loss(field + s * direction, 0)) for s in (-step, step)]
    slope = (ends[1] - ends[0]) / (2 * step)
    assert float((field.grad * direction).sum()) == pytest.approx(slope, rel=0.05)


def test_the_joint_distribution_with_a_guidance_channel_is_seen() -> None:
    guide = torch.linspace(0, 1, 48).expand(1, 48, 48)
    bound = torch.cat([blobs() * guide, guide])
    # The same field, and the same factors, but not where they belong to each other.
    apart = torch.cat([blobs() * guide, guide.flip(2)])
    loss = loss_of(bound)
    assert mean_loss(loss, apart) > 3 * mean_loss(loss, bound)


def test_half_precision_is_compared_in_full() -> None:
    loss = loss_of(blobs())
    field = torch.rand(512, 1, 4, 4, generator=torch.Generator().manual_seed(6))
    with torch.autocast("cpu", torch.bfloat16):
        low = loss(field.bfloat16(), 0)
    assert low.dtype == torch.float32
    assert float(low) == pytest.approx(float(loss(field, 0)), abs=2e-3)


@pytest.mark.parametrize("axes", [2, 3])
def test_windows_are_the_exemplar_at_the_offsets(axes: int) -> None:
    edges = (7, 5, 9)[:axes]
    # Every value says where it comes from.
    field = torch.arange(2 * int(np.prod(edges))).reshape(2, *edges)
    offsets = [torch.tensor([0, 1, 3]), torch.tensor([0, 4]), torch.tensor([0, 2, 5, 8])][:axes]
    windows = Windows(field).draw(offsets, 40, torch.Generator().manual_seed(1))
    assert windows.shape == (40, 2, *[len(o) for o in offsets])
    corners = set()
    for window in windows:
        corner = np.unravel_index(int(window[(0,) * (axes + 1)]), edges)
        corners.add(tuple(int(c) for c in corner))
        index = np.ix_(*[c + o.numpy() for c, o in zip(corner, offsets, strict=True)])
        assert (window.numpy() == field.numpy()[(slice(None), *index)]).all()
    # Along the second axis there is no room.
    assert {c[1] for c in corners} == {0}
    assert {c[0] for c in corners} == {0, 1, 2, 3}


@pytest.mark.parametrize("patch", [2, 4, 6])
def test_a_window_has_the_factor_of_a_patch_that_it_lies_in_or_holds(patch: int) -> None:
    edges = (9, 8)
    field = torch.arange(72).reshape(1, *edges)
    windows = Windows(field, -field, patch)
    offsets = [torch.tensor([0, 1, 3]), torch.tensor([0, 3])]
    drawn = windows.draw(offsets, 300, torch.Generator().manual_seed(1))
    assert drawn.shape == (300, windows.channels, 3, 2)
    pairs = set()
    for own, factor in drawn:
        corner = np.unravel_index(int(own[0, 0]), edges)
        assert (factor == factor[0, 0]).all()
        middle = np.unravel_index(-int(factor[0, 0]), edges)
        first = [int(m) - patch // 2 for m in middle]
        assert all(0 <= f <= edge - patch for f, edge in zip(first, edges, strict=True))
        room = patch - 4
        for c, f, edge in zip(corner, first, edges, strict=True):
            at_border = room < 0 and int(c) in (0, edge - 4)
            assert min(room, 0) <= int(c) - f <= max(room, 0) or at_border
        pairs.add((corner, middle))
    assert len(pairs) >= 30
    random = torch.Generator().manual_seed(1)
    guides = windows.guides(offsets, 300, random)
    assert guides is not None
    torch.testing.assert_close(guides, drawn[:, 1:])


@pytest.mark.parametrize("gradient", [False, True])
def test_quantiles_are_middles_of_equal_shares(gradient: bool) -> None:
    values = torch.randperm(60, generator=torch.Generator().manual_seed(4)).float()
    columns = torch.stack([values, -values], dim=1).requires_grad_(gradient)
    found = quantiles(columns, 6)
    assert found.tolist() == [[10 * k + 5, 10 * k + 5 - 59] for k in range(6)]
    assert quantiles(columns[:2], 4).shape == (4, 2)
