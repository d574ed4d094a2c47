"""One iteration: in which order, with which discriminator, and who learns from what."""

from __future__ import annotations

from typing import Any

import pytest
import torch
from torch import Tensor

from poresynth.engines.neural.machine import Machine
from poresynth.engines.scaffold_gan import step as module
from poresynth.engines.scaffold_gan.losses.gram import gram_loss
from poresynth.engines.scaffold_gan.losses.structural import look_up_table, structural_loss
from poresynth.engines.scaffold_gan.parameters import resolve
from poresynth.engines.scaffold_gan.step import ScaffoldStep
from poresynth.exemplars import spinodal

SMALL: dict[str, Any] = {
    "preset": "tiny",
    "device": "cpu",
    "latent": 4,
    "generator_maps": (8, 4),
    "discriminator_maps": (4, 8),
    "regions": (2, 1),
    "batch": 2,
    "table": 5,
}


def made(**changes: Any) -> tuple[ScaffoldStep, Machine]:
    p = resolve({**SMALL, **changes})
    gray = torch.from_numpy(spinodal((24, 26, 28), porosity=0.6, wavelength=8).array).float()
    step = ScaffoldStep(p, gray[None] / 127.5 - 1, 0.0, None, None)  # type: ignore[arg-type]
    machine = Machine(p)
    step.prepare(machine)
    return step, machine


def run(step: ScaffoldStep, machine: Machine, iteration: int = 0) -> dict[str, Tensor]:
    return step.run(machine, iteration, torch.Generator().manual_seed(iteration))


def weights(step: ScaffoldStep, name: str) -> list[Tensor]:
    return [p.detach().clone() for p in step.networks[name].parameters()]


def same(a: list[Tensor], b: list[Tensor]) -> bool:
    return all(torch.equal(x, y) for x, y in zip(a, b, strict=True))


def test_the_losses_of_a_step_are_those_of_its_batches_and_of_the_updated_discriminator(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Against the parts put together by hand, with the weights as they are after its update."""
    step, machine = made(variant="full")
    step.optimizers["generator"].step = lambda *_, **__: None  # type: ignore[method-assign,assignment]
    fakes: list[Tensor] = []
    reals: list[Tensor] = []
    usual_fake, usual_draw = step._fake, step.crops.draw
    monkeypatch.setattr(step, "_fake", lambda *a: fakes.append(usual_fake(*a)) or fakes[-1])
    monkeypatch.setattr(step.crops, "draw", lambda *a: reals.append(usual_draw(*a)) or reals[-1])
    before = weights(step, "discriminator")
    for iteration in range(3):
        fakes.clear()
        reals.clear()
        found = run(step, machine, iteration)
        assert not same(before, weights(step, "discriminator"))
        discriminator = step.networks["discriminator"]
        with torch.no_grad():
            real = discriminator(reals[0], 2)[1]
            fake = discriminator(fakes[1], 2)[1]
            structural = sum(
                structural_loss(fake[layer], look_up_table(real[layer], s, d, a), s, d)
                for (layer, s, d), a in zip(step.regions, step.anchors, strict=True)
            )
            gram = sum(gram_loss(f, r, 4) for f, r in zip(fake, real, strict=True))
        assert len(reals) == 1
        assert len(fakes) == 2
        # λ_s = 1, λ_g = 0.1.
        assert float(found["structural"]) == pytest.approx(float(structural), rel=1e-5)
        assert float(found["gram"]) == pytest.approx(0.1 * float(gram), rel=1e-5)


def test_anchors_are_drawn_once_and_as_many_as_asked_for() -> None:
    step, machine = made()
    # Two crops of 16³: maps of 8³ and 4³, regions of 2³ and 1³.
    assert [len(a) for a in step.anchors] == [5, 5]
    assert all(len(set(a.tolist())) == 5 and int(a.max()) < 128 for a in step.anchors)
    before = [a.clone() for a in step.anchors]
    run(step, machine)
    assert same(before, step.anchors)
    assert same(before, made()[0].anchors)
    assert not same(before, made(training_seed=1)[0].anchors)
    assert made(table=None)[0].anchors == [None, None]


def test_anchors_lie_in_the_whole_batch_also_where_maps_are_not_halved() -> None:
    # Of a PatchGAN without halvings: maps of 15³ and 14³ of a crop of 16³.
    patches = {"variant": "patchgan", "patch_halvings": 0, "structural_weight": 1.0}
    step, machine = made(**patches, table=2 * 7**3 - 1)
    assert step.discriminator.edges(16) == [15, 14]
    assert int(step.anchors[0].max()) >= 2 * 7**3 - 2
    assert torch.isfinite(run(step, machine)["structural"])


@pytest.mark.parametrize("generator_loss", ["non_saturating", "saturating"])
def test_the_generators_losses_teach_the_generator_alone(
    generator_loss: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    step, machine = made(variant="extended", generator_loss=generator_loss)
    seen: list[list[Tensor]] = []
    usual = machine.update

    def update(optimizer: Any, *given: Any, **named: Any) -> dict[str, Tensor]:
        seen.append([*weights(step, "discriminator"), *weights(step, "generator")])
        found = usual(optimizer, *given, **named)
        seen.append([*weights(step, "discriminator"), *weights(step, "generator")])
        return found

    monkeypatch.setattr(machine, "update", update)
    run(step, machine)
    count = len(weights(step, "discriminator"))
    for before, after, own in (
        (seen[0], seen[1], slice(0, count)),
        (seen[2], seen[3], slice(count, None)),
    ):
        assert not any(torch.equal(x, y) for x, y in zip(before[own], after[own], strict=True))
        other = slice(count, None) if own.start == 0 else slice(0, count)
        assert same(before[other], after[other])
    assert all(p.requires_grad for p in step.networks["discriminator"].parameters())


@pytest.mark.parametrize("latents", ["one", "endless"])
@pytest.mark.parametrize("variant", ["full", "patchgan"])
def test_crops_and_fakes_have_one_shape(
    latents: str, variant: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    step, machine = made(latents=latents, variant=variant, accumulate=2, patch_halvings=1)
    shapes = []
    usual = module.discriminator_loss

    def loss(real: Tensor, fake: Tensor) -> Tensor:
        shapes.append((tuple(real.shape), tuple(fake.shape)))
        return usual(real, fake)

    monkeypatch.setattr(module, "discriminator_loss", loss)
    run(step, machine)
    # One logit a crop, or one a patch; two parts of one crop each.
    logits = (1, 1, 1, 1, 1) if variant == "full" else (1, 1, 6, 6, 6)
    assert shapes == [(logits, logits)] * 2


def test_the_fast_start_falls_to_nothing() -> None:
    step, machine = made(variant="extended", sliced_iterations=4)
    with_it = ["sliced_wasserstein" in run(step, machine, i) for i in range(6)]
    assert with_it == [True] * 4 + [False] * 2
    # A quarter of all by default.
    step, machine = made(variant="extended", iterations=4)
    assert ["sliced_wasserstein" in run(step, machine, i) for i in range(2)] == [True, False]
