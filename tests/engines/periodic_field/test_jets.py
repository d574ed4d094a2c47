"""The loss on slopes and curvatures."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from tests.references import periodic_field as twin

from poresynth.engines.periodic_field.jets import JetLoss, invariants
from poresynth.engines.periodic_field.windows import Windows
from poresynth.exemplars import foam
from poresynth.metrics.topology import euler_number


def field(axes: int, channels: int = 1, edge: int = 6, places: int = 3) -> torch.Tensor:
    generator = torch.Generator().manual_seed(axes)
    return torch.rand((places, channels, *[edge] * axes), generator=generator)


@pytest.mark.parametrize(("axes", "channels"), [(2, 1), (2, 3), (3, 1), (3, 2)])
def test_invariants_are_those_of_the_stencil_at_each_node(axes: int, channels: int) -> None:
    made = field(axes, channels)
    found = invariants(made)
    kinds = 7 if axes == 3 else 5
    assert found.shape == (3 * 4**axes, channels * kinds)
    rows = found.reshape(3, *[4] * axes, channels, kinds)
    for index in np.ndindex(3, *[4] * axes):
        for channel in range(channels):
            box = tuple(slice(i, i + 3) for i in index[1:])
            expected = twin.invariants(made[(index[0], channel, *box)].double().numpy())
            np.testing.assert_allclose(rows[(*index, channel)], expected, atol=2e-5)


@pytest.mark.parametrize("axes", [2, 3])
def test_turning_a_field_changes_nothing(axes: int) -> None:
    made = field(axes, edge=3)
    turned = torch.rot90(made, 1, (2, 3))
    np.testing.assert_allclose(invariants(turned), invariants(made), atol=1e-5)
    np.testing.assert_allclose(invariants(made.flip(2)), invariants(made), atol=1e-5)


def test_a_ball_is_told_from_a_plane_of_the_same_slope() -> None:
    z, y, x = np.meshgrid(*[np.arange(3.0)] * 3, indexing="ij")
    plane = torch.tensor(z)[None, None]
    ball = torch.tensor(np.sqrt((z + 4) ** 2 + (y - 1) ** 2 + (x - 1) ** 2))[None, None]
    flat, curved = invariants(plane)[0], invariants(ball)[0]
    assert float(flat[1]) == pytest.approx(1)
    assert float(curved[1]) == pytest.approx(1, abs=1e-2)
    # The mean curvature of a sphere is 2 / r.
    assert float(flat[2]) == 0
    assert float(curved[2]) == pytest.approx(2 / 5, rel=0.02)


def distances(kind: str) -> torch.Tensor:
    """A foam, or lumps of the same values and correlation: phases of its waves at random."""
    from scipy import ndimage

    solid = foam((64, 64, 64), seed=1).array > 125
    values = ndimage.distance_transform_edt(solid) - ndimage.distance_transform_edt(~solid)
    values = np.clip(values / 6, -1, 1)
    if kind == "lumps":
        waves = np.fft.rfftn(values)
        noise = np.fft.rfftn(np.random.default_rng(0).standard_normal(values.shape))
        rough = np.fft.irfftn(np.abs(waves) * noise / np.abs(noise), values.shape, axes=(0, 1, 2))
        ranks = rough.ravel().argsort().argsort()
        values = np.sort(values.ravel())[ranks].reshape(values.shape)
    if kind == "half":
        values = np.roll(values[::-1], 13, 1)
    return torch.from_numpy((values[None] / 2 + 0.5).astype(np.float32))


def test_struts_are_told_from_lumps_of_the_same_correlation() -> None:
    own = distances("foam")
    random = torch.Generator().manual_seed(1)
    loss = JetLoss(Windows(own), reach=32, places=8192, random=random)
    assert [int(offsets[0][-1]) for offsets in loss.offsets] == [3, 6, 9, 12, 18]

    def mean(field: torch.Tensor) -> float:
        draw = torch.Generator().manual_seed(2)
        windows = Windows(field)
        return float(
            np.mean(
                [
                    float(loss(windows.draw(offsets, loss.places, draw), grid))
                    for grid, offsets in enumerate(loss.offsets)
                ]
            )
        )

    lumps = distances("lumps")
    assert euler_number((own[0] > 0.5).numpy()) < 0 < euler_number((lumps[0] > 0.5).numpy())
    # Another sample of the foam has the error of sampling.
    assert mean(distances("half")) < 0.2 * mean(lumps)


def test_a_small_exemplar_has_the_narrowest_stencil() -> None:
    made = field(2, edge=8, places=1)[0]
    random = torch.Generator().manual_seed(1)
    loss = JetLoss(Windows(made), reach=3, places=64, random=random)
    assert len(loss.offsets) == 1
    drawn = Windows(made).draw(loss.offsets[0], loss.places, random)
    assert torch.isfinite(loss(drawn, 0))


def test_a_constant_exemplar_and_field_give_zero() -> None:
    made = torch.full((1, 12, 12), 0.25)
    random = torch.Generator().manual_seed(1)
    loss = JetLoss(Windows(made), reach=6, places=64, random=random)
    drawn = Windows(made).draw(loss.offsets[0], loss.places, random)
    assert float(loss(drawn, 0)) == pytest.approx(0, abs=1e-6)
