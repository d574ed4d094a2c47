"""The generator, the critic and their losses."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from tests.references import periodic_field as twin

from poresynth.engines.periodic_field.adversarial import (
    critic_loss,
    generator_loss,
    gradient_penalty,
)
from poresynth.engines.periodic_field.critic import Critic
from poresynth.engines.periodic_field.encoding import diagonals
from poresynth.engines.periodic_field.generator import Generator
from poresynth.errors import ParameterError


@pytest.mark.parametrize("axes", [2, 3])
@pytest.mark.parametrize("guides", [0, 2])
@pytest.mark.parametrize("diagonal", [False, True])
def test_the_generator_is_a_perceptron_at_every_point(
    axes: int, guides: int, diagonal: bool
) -> None:
    torch.manual_seed(1)
    net = Generator(
        axes=axes,
        channels=3,
        latents=5,
        guides=guides,
        bandwidth=2,
        diagonal=diagonal,
        width=11,
        depth=4,
    )
    edges = (4, 3, 5)[:axes]
    phases = [torch.rand(2, n) for n in edges]
    latent = torch.rand(2, *edges, 5)
    guidance = torch.rand(2, guides, *edges) if guides else None
    with torch.no_grad():
        found = net(phases, latent, guidance).numpy()
    assert found.shape == (2, 3, *edges)
    linear = [net.first, *(m for m in net.hidden if isinstance(m, torch.nn.Linear)), net.last]
    assert len(linear) == 4
    layers = [(m.weight.detach().numpy(), m.bias.detach().numpy()) for m in linear]
    for batch in range(2):
        for index in np.ndindex(*edges):
            inputs: list[float] = []
            for axis, i in enumerate(index):
                inputs += twin.encode(float(phases[axis][batch, i]), 2)
            for signs in diagonals(axes) if diagonal else []:
                own = zip(signs, phases, index, strict=True)
                total = sum(sign * float(phase[batch, i]) for sign, phase, i in own)
                inputs += twin.encode(total, 2)
            inputs += latent[(batch, *index)].tolist()
            if guidance is not None:
                inputs += guidance[(batch, slice(None), *index)].tolist()
            expected = twin.perceptron(np.array(inputs), layers)
            np.testing.assert_allclose(found[(batch, slice(None), *index)], expected, atol=1e-5)


def test_the_papers_generator_has_ten_layers_of_width_128() -> None:
    net = Generator(
        axes=3, channels=1, latents=5, guides=0, bandwidth=5, diagonal=False, width=128, depth=10
    )
    shapes = [tuple(p.shape) for name, p in net.named_parameters() if name.endswith("weight")]
    assert shapes == [(128, 3 * 12 + 5), *[(128, 128)] * 8, (1, 128)]


def test_the_generator_starts_at_the_means() -> None:
    net = Generator(
        axes=2, channels=2, latents=1, guides=0, bandwidth=0, diagonal=False, width=4, depth=2
    )
    net.start_from([0.9, 0.0])
    assert net.last.bias.sigmoid().tolist() == pytest.approx([0.9, 0.01])


@pytest.mark.parametrize(("axes", "crop"), [(2, 32), (3, 16), (2, 21)])
def test_the_critic_gives_a_number_for_each_crop(axes: int, crop: int) -> None:
    critic = Critic(axes=axes, channels=3, maps=(4, 8, 16), crop=crop)
    assert critic(torch.rand(5, 3, *[crop] * axes)).shape == (5,)
    strides = [m.stride[0] for m in critic.layers if hasattr(m, "stride")]
    assert strides == [2, 2, 2]
    assert not any("norm" in type(m).__name__.lower() for m in critic.modules())


def test_a_critic_with_too_many_layers_for_the_crop_is_refused() -> None:
    with pytest.raises(ParameterError, match="crop = 15: must be at least 16"):
        Critic(axes=2, channels=1, maps=(4, 4, 4, 4), crop=15)


def test_the_gradient_penalty_is_that_of_finite_differences() -> None:
    torch.manual_seed(2)
    critic = Critic(axes=2, channels=1, maps=(3, 5), crop=6).double()
    real, fake = torch.rand(2, 3, 1, 6, 6, dtype=torch.float64)
    mix = torch.rand(3, dtype=torch.float64)

    def score(crop: np.ndarray) -> float:
        with torch.no_grad():
            return float(critic(torch.from_numpy(crop)[None]))

    found = gradient_penalty(critic, real, fake, mix)
    expected = twin.gradient_penalty(score, real.numpy(), fake.numpy(), mix.numpy())
    assert float(found.detach()) == pytest.approx(expected, rel=1e-5)
    found.backward()
    assert all(p.grad is None or p.grad.isfinite().all() for p in critic.parameters())


def test_the_penalty_of_a_line_of_slope_one_vanishes() -> None:
    def plane(crops: torch.Tensor) -> torch.Tensor:
        return crops.flatten(1)[:, 0]

    real, fake = torch.rand(2, 4, 1, 5, 5)
    assert float(gradient_penalty(plane, real, fake, torch.rand(4))) < 1e-10


def test_a_constant_critic_has_a_penalty_of_one_and_finite_derivatives() -> None:
    weight = torch.zeros(1, requires_grad=True)

    def flat(crops: torch.Tensor) -> torch.Tensor:
        return weight * crops.flatten(1).sum(1)

    found = gradient_penalty(flat, torch.rand(2, 1, 3, 3), torch.rand(2, 1, 3, 3), torch.rand(2))
    assert float(found.detach()) == pytest.approx(1, abs=1e-5)
    found.backward()
    assert weight.grad is not None
    assert weight.grad.isfinite().all()


def test_the_losses_are_wasserstein() -> None:
    def mean(crops: torch.Tensor) -> torch.Tensor:
        return crops.flatten(1).mean(1)

    real, fake = torch.full((2, 1, 4, 4), 3.0), torch.full((2, 1, 4, 4), 1.0)
    mix = torch.rand(2)
    slope = 1 / 4  # of a mean of 16 pixels
    expected = 1 - 3 + 10 * (slope - 1) ** 2
    assert float(critic_loss(mean, real, fake, mix, 10)) == pytest.approx(expected, rel=1e-4)
    assert float(generator_loss(mean, fake)) == -1
