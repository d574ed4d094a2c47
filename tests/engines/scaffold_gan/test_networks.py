"""Networks, their shapes, and which latents a voxel depends on."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from tests.references import scaffold_losses as twin

from poresynth.engines.neural.tiles import assemble
from poresynth.engines.scaffold_gan.calibration import calibrate
from poresynth.engines.scaffold_gan.crops import Crops, turns
from poresynth.engines.scaffold_gan.lattice import latent_window
from poresynth.engines.scaffold_gan.networks import (
    Discriminator,
    Generator,
    initialise,
    patch_strides,
)
from poresynth.engines.scaffold_gan.parameters import resolve
from poresynth.engines.scaffold_gan.tiles import GeneratorTiles


def generator(maps: tuple[int, ...] = (6, 5, 4), latent: int = 3, channels: int = 1) -> Generator:
    net = Generator(latent, maps, channels)
    random = torch.Generator().manual_seed(4)
    initialise(net, random)
    with torch.no_grad():
        for layer in net.layers:
            layer.weight.mul_(8)  # So that tanh has something to do.
    calibrate(net, 5)
    return net


# --- shapes -----------------------------------------------------------------------------------


def test_the_papers_generator_layer_by_layer() -> None:
    p = resolve({"preset": "paper"})
    net = Generator(p.latent, p.generator_maps)
    seen: list[tuple[int, ...]] = []
    for norm in net.norms:
        norm.register_forward_hook(lambda module, given, out: seen.append(tuple(out.shape)))
    with torch.no_grad():
        out = net.eval()(torch.zeros(1, 100, 1, 1, 1))
    assert p.crop == 64
    assert seen == [(1, c, n, n, n) for c, n in ((512, 4), (256, 8), (128, 16), (64, 32))]
    assert out.shape == (1, 1, 64, 64, 64)
    kernels = [tuple(layer.weight.shape) for layer in net.layers]
    widths = [100, 512, 256, 128, 64, 1]
    assert kernels == [(a, b, 4, 4, 4) for a, b in itertools.pairwise(widths)]
    assert [n.num_features for n in net.norms] == [512, 256, 128, 64]


def test_the_papers_discriminator_layer_by_layer() -> None:
    p = resolve({"preset": "paper"})
    net = Discriminator(p.discriminator_maps)
    with torch.no_grad():
        logits, features = net(torch.zeros(2, 1, 64, 64, 64), 4)
    assert logits.shape == (2, 1, 1, 1, 1)
    maps = [(64, 32), (128, 16), (256, 8), (512, 4)]
    assert net.edges(64) == [n for _, n in maps]
    assert [tuple(f.shape) for f in features] == [(2, c, n, n, n) for c, n in maps]
    # None in the first layer, which would hide mean and contrast.
    assert [n.num_features for n in net.norms] == [128, 256, 512]
    # The regions of 8³, 4³ and 2³ fill the maps of l₀, l₁ and l₂.
    assert p.regions == (8, 4, 2)
    assert [n % width for (_, n), width in zip(maps, p.regions, strict=False)] == [0, 0, 0]


def test_features_are_those_after_the_activation() -> None:
    net = Discriminator((4, 8, 8))
    x = torch.randn(2, 1, 32, 32, 32)
    with torch.no_grad():
        _, features = net(x, 1)
        expected = torch.nn.functional.leaky_relu(net.layers[0](x), 0.2)
    assert torch.equal(features[0], expected)


def test_five_latents_make_the_papers_128_voxels_and_the_endless_rule_its_own() -> None:
    net = Generator(2, (2, 2, 2, 2)).eval()
    with torch.no_grad():
        assert net(torch.zeros(1, 2, 5, 5, 5)).shape[2:] == (128,) * 3
        for n in (6, 9):
            assert net(torch.zeros(1, 2, n, n, n), True).shape[2:] == (16 * n - 78,) * 3
    small = Generator(2, (2, 2, 2)).eval()
    with torch.no_grad():
        assert small(torch.zeros(1, 2, 7, 7, 7), True).shape[2:] == (8 * 7 - 38,) * 3


@pytest.mark.parametrize(("halvings", "field"), [(1, 28), (2, 46), (3, 70)])
def test_patch_discriminators_see_patches(halvings: int, field: int) -> None:
    net = Discriminator((2, 2, 2, 2), 1, patch_strides(5, halvings)).eval()
    x = torch.zeros(1, 1, 96, 96, 96, requires_grad=True)
    logits = net(x)[0]
    middle = logits.shape[2] // 2
    (seen,) = torch.autograd.grad(logits[0, 0, middle, middle, middle], x)
    where = seen[0, 0].nonzero()
    assert (where.max(0).values - where.min(0).values + 1).tolist() == [field] * 3


def test_weights_are_drawn_as_in_dcgan() -> None:
    net = Generator(100, (64, 64), 1)
    initialise(net, torch.Generator().manual_seed(0))
    weight = net.layers[0].weight
    assert float(weight.detach().mean()) == pytest.approx(0, abs=1e-3)
    assert float(weight.detach().std()) == pytest.approx(0.02, rel=0.02)
    assert float(net.norms[0].weight.detach().mean()) == pytest.approx(1, abs=0.01)
    again = Generator(100, (64, 64), 1)
    initialise(again, torch.Generator().manual_seed(0))
    assert torch.equal(weight, again.layers[0].weight)


# --- the endless lattice ----------------------------------------------------------------------


@pytest.mark.parametrize("doublings", [1, 2, 3])
def test_endless_output_is_that_of_full_sums(doublings: int) -> None:
    """Against transposed convolutions from their definition, on more latents than are needed."""
    maps = (4, 3, 2)[:doublings]
    net = generator(maps).double()
    extent = 8
    z = torch.randn(1, 3, extent, extent, extent, dtype=torch.float64)
    with torch.no_grad():
        found = net(z, True)[0].numpy()
        values, offset = z[0].numpy(), 0
        for i, layer in enumerate(net.layers):
            values = twin.transposed(values, layer.weight.numpy(), 2 if i else 1)
            offset = 2 * offset - 1 if i else 0
            if i < len(maps):
                norm = net.norms[i].eval()
                values = norm(torch.from_numpy(values)[None])[0].relu().numpy()
    values = np.tanh(values + net.layers[-1].bias.detach().numpy()[:, None, None, None])
    # The definition's outputs begin at voxel `offset`; the endless ones where the window says.
    window = latent_window(64, 65, doublings)
    start = 64 - window.offset - (window.start << doublings) - offset
    part = slice(start, start + found.shape[1])
    assert np.allclose(values[:, part, part, part], found, atol=1e-12)


@given(st.integers(-200, 200), st.integers(1, 60), st.integers(1, 4))
def test_a_window_needs_these_latents_and_no_more(start: int, extent: int, doublings: int) -> None:
    """Against the sets of inputs of each output, layer by layer."""
    needed = set(range(start, start + extent))
    for _ in range(doublings):
        near = ((o, i) for o in needed for i in range(o // 2 - 2, o // 2 + 3))
        needed = {i for o, i in near if 0 <= o - 2 * i + 1 < 4}
    needed = {o - k for o in needed for k in range(4)}
    window = latent_window(start, start + extent, doublings)
    assert (window.start, window.extent) == (min(needed), max(needed) - min(needed) + 1)
    made = (1 << doublings) * (window.extent - 5) + 2
    assert 0 <= window.offset <= window.offset + extent <= made


def test_a_voxel_needs_few_latents() -> None:
    assert max(latent_window(v, v + 1, 4).extent for v in range(64)) == 6


# --- windows ----------------------------------------------------------------------------------


@pytest.mark.parametrize("start", [(0, 0, 0), (-37, 5, 100)])
def test_a_window_has_the_bits_of_the_whole(start: tuple[int, int, int]) -> None:
    net = generator()
    tiles = GeneratorTiles(net, seed=8, crop=32)
    whole = assemble(tiles, start, (90, 70, 66))
    part = [a + o for a, o in zip(start, (30, 13, 25), strict=True)]
    window = assemble(GeneratorTiles(net, seed=8, crop=32), part, (41, 40, 39), threads=2)
    assert np.array_equal(window, whole[:, 30:71, 13:53, 25:64])
    assert whole.std() > 0.05


def test_tiles_join_as_one_pass_makes_them() -> None:
    """No seam: the volume of many tiles is that of all latents at once."""
    from poresynth.engines.neural.noise import lattice_noise

    net = generator()
    found = assemble(GeneratorTiles(net, seed=8, crop=32), (-10, 3, 0), (80, 70, 66))
    windows = [latent_window(a, a + n, 3) for a, n in ((-10, 80), (3, 70), (0, 66))]
    noise = lattice_noise(8, [w.start for w in windows], [w.extent for w in windows], channels=3)
    with torch.no_grad():
        made = net(torch.from_numpy(noise)[None], True)[0].numpy()
    box = tuple(slice(w.offset, w.offset + n) for w, n in zip(windows, (80, 70, 66), strict=True))
    assert np.allclose(found, made[(slice(None), *box)], atol=1e-5)


def test_a_periodic_volume_repeats() -> None:
    tiles = GeneratorTiles(generator(), seed=8, crop=32, period=(64, 72, 80))
    found = assemble(tiles, (0, 0, 0), (84, 92, 100))
    assert np.array_equal(found[:, :20], found[:, 64:])
    assert np.array_equal(found[:, :, :20], found[:, :, 72:])
    assert np.array_equal(found[..., :20], found[..., 80:])


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_bits_do_not_depend_on_threads(threads: int) -> None:
    net = generator((32, 32, 16), 16)
    expected = assemble(GeneratorTiles(net, 1, 32), (0, 0, 0), (100, 70, 70), threads=3)
    before = torch.get_num_threads()
    torch.set_num_threads(threads)
    try:
        found = assemble(GeneratorTiles(net, 1, 32), (0, 0, 0), (100, 70, 70), threads=threads)
    finally:
        torch.set_num_threads(before)
    assert np.array_equal(found, expected)


def test_calibrated_batch_norms_have_the_statistics_of_the_lattice() -> None:
    net = generator((16, 8), 8)
    inputs: list[torch.Tensor] = []
    hook = net.norms[0].register_forward_pre_hook(lambda m, given: inputs.append(given[0]))
    with torch.no_grad():
        net(torch.rand(64, 8, 7, 7, 7) * 2 - 1, True)
    hook.remove()
    variance = inputs[0].var((0, 2, 3, 4))
    assert torch.allclose(net.norms[0].running_var, variance, rtol=0.15)
    state = {k: v.clone() for k, v in net.state_dict().items()}
    calibrate(net, 5)
    assert all(torch.equal(v, state[k]) for k, v in net.state_dict().items())
    assert not net.training


# --- crops ------------------------------------------------------------------------------------


def test_crops_are_cut_from_the_exemplar_at_multiples_of_the_stride() -> None:
    exemplar = torch.arange(20 * 18 * 16.0).reshape(1, 20, 18, 16)
    crops = Crops(exemplar, 8, 2, turns("none"))
    drawn = crops.draw(400, torch.Generator().manual_seed(0))
    assert drawn.shape == (400, 1, 8, 8, 8)
    corners = {tuple(np.unravel_index(int(c[0, 0, 0, 0]), (20, 18, 16))) for c in drawn}
    assert {z for z, _, _ in corners} == {0, 2, 4, 6, 8, 10, 12}
    assert {x for _, _, x in corners} == {0, 2, 4, 6, 8}
    z, y, x = (int(i) for i in np.unravel_index(int(drawn[3, 0, 0, 0, 0]), (20, 18, 16)))
    assert torch.equal(drawn[3, 0], exemplar[0, z : z + 8, y : y + 8, x : x + 8])


def test_the_papers_exemplar_has_about_6000_crops() -> None:
    crops = Crops(torch.zeros(1, 100, 100, 100), 64, 2, turns("none"))
    assert int(np.prod(crops.places)) == 19**3 == 6859


@pytest.mark.parametrize(
    ("symmetry", "keep", "count"),
    [
        ("none", None, 1),
        ("flips", None, 8),
        ("rotations", None, 24),
        ("full", None, 48),
        ("full", "z", 16),
        ("rotations", "x", 8),
        ("flips", "y", 8),
    ],
)
def test_symmetries(symmetry: str, keep: str | None, count: int) -> None:
    found = turns(symmetry, keep)
    exemplar = torch.randn(1, 6, 6, 6, generator=torch.Generator().manual_seed(0))
    crops = Crops(exemplar, 6, 1, found)
    drawn = crops.draw(40 * count, torch.Generator().manual_seed(1))
    assert len({c.numpy().tobytes() for c in drawn}) == len(found) == count
    if keep == "z":
        planes = {exemplar[0, i].sum().item() for i in range(6)}
        sums = [c[0].sum((1, 2)) for c in drawn]
        for s in sums:
            assert all(min(abs(v - p) for p in planes) < 1e-4 for v in s.tolist())


def test_symmetries_are_those_of_a_cube() -> None:
    """Against quarter turns about the axes, one after another, and a mirror."""
    cube = np.arange(27).reshape(3, 3, 3)
    found = {"none": {cube.tobytes()}, "rotations": {cube.tobytes()}}
    while True:
        turned = {
            np.ascontiguousarray(np.rot90(np.frombuffer(c, cube.dtype).reshape(3, 3, 3), 1, axes))
            .tobytes()
            for c in found["rotations"]
            for axes in ((0, 1), (1, 2), (0, 2))
        }  # fmt: skip
        if turned <= found["rotations"]:
            break
        found["rotations"] |= turned
    mirrored = (np.frombuffer(c, cube.dtype).reshape(3, 3, 3)[::-1] for c in found["rotations"])
    found["full"] = found["rotations"] | {c.tobytes() for c in mirrored}
    found["flips"] = {
        cube[::z, ::y, ::x].tobytes() for z, y, x in itertools.product((1, -1), repeat=3)
    }
    for name, expected in found.items():
        copies = {
            np.flip(cube.transpose(turn.order), turn.mirrored).tobytes()
            for turn in turns(name)  # type: ignore[arg-type]
        }
        assert copies == expected
