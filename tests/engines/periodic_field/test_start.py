"""What a training starts from."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import torch
from scipy import ndimage

from poresynth.engines.periodic_field import PeriodicField
from poresynth.engines.periodic_field.latent import LatentField
from poresynth.engines.periodic_field.lattice import Cells
from poresynth.engines.periodic_field.period import Period
from poresynth.engines.periodic_field.start import (
    Start,
    choose_start,
    model_names,
    models,
    spacings,
)
from poresynth.engines.periodic_field.windows import Windows
from poresynth.exemplars import foam
from poresynth.metrics.structure_error import structure_error


def latent(spacing: tuple[float, ...]) -> LatentField:
    return LatentField(len(spacing), (1, 1), 2, 3, 1, spacing, "gradient", 0.2)


def distances(solid: np.ndarray, clip: int = 6) -> np.ndarray:
    signed = ndimage.distance_transform_edt(solid) - ndimage.distance_transform_edt(~solid)
    return np.asarray(np.clip(signed / clip, -1, 1) / 2 + 0.5, np.float32)


def voronoi(edge: int, cell: float, axes: int, weights: list[float], seed: int) -> np.ndarray:
    """Sums of the distances to the nearest of points in jittered cells, found by a tree."""
    from scipy.spatial import cKDTree

    count = int(np.ceil(edge / cell)) + 4
    sites = np.stack(np.meshgrid(*[np.arange(count)] * axes, indexing="ij"), -1)
    sites = sites.reshape(-1, axes)
    jitter = np.random.default_rng(seed).uniform(-0.375, 0.375, sites.shape)
    places = np.stack(np.meshgrid(*[np.arange(edge)] * axes, indexing="ij"), -1) + 2 * cell
    near = cKDTree((sites + 0.5 + jitter) * cell).query(places, axes + 1)[0]
    return np.asarray(near @ np.array(weights))


def chosen(field: np.ndarray, wavelength: float, **options: Any) -> Start:
    axes = field.ndim
    period = Period((4 * wavelength,) * axes, (False,) * axes)
    windows = Windows(torch.from_numpy(field[None]), options.pop("guide", None))
    # 0.7, 0.85 and one wavelength.
    tried = spacings(period, (0.5,) * axes, (True,) * axes)[3:6]
    return choose_start(windows, 24, latent, period.length, tried, 3, **options)


def somewhere(start: Start) -> torch.Tensor:
    """Latent values at 4000 independent places, shape (4000, 1, …, value)."""
    made = latent(start.spacing)
    generator = torch.Generator().manual_seed(1)
    phases = [
        4 * torch.rand(4000, 1, generator=generator, dtype=torch.float64) for _ in start.spacing
    ]

    def numbers(lattices: range, count: int, cells: Cells) -> torch.Tensor:
        shape = (len(lattices), 4000, count, *cells.sites)
        return 2 * torch.rand(shape, generator=generator) - 1

    return made(phases, numbers)


@pytest.mark.parametrize(
    ("axes", "name"), [(2, "edges of cells"), (3, "edges of cells"), (2, "balls around points")]
)
def test_a_model_is_recognised_with_the_distance_of_its_points(axes: int, name: str) -> None:
    edge, cell = {2: (256, 20.0), 3: (72, 20.0)}[axes]
    values = voronoi(edge, cell, axes, models(axes)[name], seed=1)
    field = distances(values > np.quantile(values, 0.7))
    start = chosen(field, wavelength=cell / 0.85)
    assert start.name == name
    # A phase of 2 is a period of four wavelengths.
    assert start.spacing == pytest.approx((0.5 * 0.85,) * axes)
    assert start.error < 40


def test_a_model_that_is_asked_for_is_taken_though_another_is_nearer() -> None:
    values = voronoi(192, 20.0, 2, models(2)["edges of cells"], seed=1)
    field = distances(values > np.quantile(values, 0.7))
    nearest = chosen(field, wavelength=20.0)
    asked = "all but corners of cells"
    start = chosen(field, wavelength=20.0, model=asked)
    assert nearest.name == "edges of cells"
    assert start.name == asked
    assert start.weights == tuple(-w for w in models(2)["corners of cells"]) + (0.0,) * 9
    assert start.error > nearest.error


def test_every_model_has_a_name() -> None:
    for axes in (2, 3):
        names = model_names(axes)
        assert len(set(names)) == len(names) == 2 * len(models(axes)) + 1


def test_the_field_of_a_start_has_the_values_of_the_exemplar() -> None:
    values = voronoi(256, 20.0, 2, models(2)["edges of cells"], seed=2)
    field = distances(values > np.quantile(values, 0.8))
    start = chosen(field, wavelength=20.0)
    found = start(somewhere(start))
    assert found.shape == (4000, 1, 1, 1)
    shares = np.linspace(0.02, 0.98, 49)
    away = np.quantile(found.numpy(), shares) - np.quantile(field, shares)
    # Distances in an image have steps.
    assert np.abs(away).mean() < 0.02


def test_guidance_chooses_among_the_exemplars_values() -> None:
    # Half of the image is dense.
    made = voronoi(192, 16.0, 2, models(2)["edges of cells"], seed=2)
    dense = np.arange(192)[None] * np.ones((192, 1)) >= 96
    cut = np.where(dense, np.quantile(made, 0.4), np.quantile(made, 0.9))
    field = distances(made > cut)
    guide = torch.from_numpy(np.where(dense, 1.0, 0.0).astype(np.float32))[None]
    start = chosen(field, wavelength=16.0, guide=guide)
    assert start.guides.tolist() == sorted(start.guides.tolist())
    values = somewhere(start)
    thin, thick = (start(values, torch.full((4000, 1, 1, 1), g)) for g in (0.0, 1.0))
    assert float((thin > 0.5).float().mean()) == pytest.approx(0.1, abs=0.04)
    assert float((thick > 0.5).float().mean()) == pytest.approx(0.6, abs=0.04)


def test_colours_follow_the_order_that_most_of_them_have() -> None:
    values = voronoi(128, 16.0, 2, models(2)["edges of cells"], seed=2)
    bright = (values > np.quantile(values, 0.8)).astype(np.float32)
    colours = np.stack([0.2 + 0.6 * bright, 0.9 - 0.5 * bright, 0 * bright + 0.3])
    period = Period((64.0, 64.0), (False, False))
    start = choose_start(
        Windows(torch.from_numpy(colours.astype(np.float32))),
        24,
        latent,
        period.length,
        [(0.5, 0.5)],
        3,
    )
    found = start(torch.randn(1, 50, 50, latent((0.5, 0.5)).size))[0].flatten(1).T
    for colour in found:
        far = min(
            float((colour - torch.tensor(c)).abs().max())
            for c in ((0.2, 0.9, 0.3), (0.8, 0.4, 0.3))
        )
        assert far < 0.61
    assert found[:, 2].sub(0.3).abs().max() < 1e-5


def test_distances_along_axes_that_are_not_free_stay() -> None:
    period = Period((80.0, 20.0, 40.0), (False, True, False))
    tried = spacings(period, (0.5, 2.0, 0.5), (True, False, True))
    # Own wavelengths, half as stretched, and their geometric mean.
    assert len(tried) == 24
    assert {one[1] for one in tried} == {2.0}
    half, same = tried[8 + 5], tried[16 + 5]
    assert half[0] * 80 / (half[2] * 40) == pytest.approx(2**0.5)
    assert same[0] * 80 / 2 == pytest.approx(same[2] * 40 / 2) == pytest.approx(200**0.5)
    assert tried[5] == pytest.approx((0.5, 2.0, 0.5))
    assert spacings(period, (0.5, 2.0, 0.5), (False,) * 3) == [(0.5, 2.0, 0.5)]


def test_struts_of_a_foam_hang_together() -> None:
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        exemplar = foam((72, 72, 72), cell=24.0, seed=1)
        engine = PeriodicField(
            iterations=250, start_iterations=120, places=256, grids=32, device="cpu"
        ).fit(exemplar)
    finally:
        torch.set_num_threads(threads)
    assert engine.training_["start"].startswith("edges")
    solid = exemplar.array > engine.threshold_
    made = [engine.sample((72, 72, 72), seed=s).array > engine.threshold_ for s in (1, 2)]
    found = structure_error(solid, made)
    # From a flat field 45 %, with a largest part of half of the solid.
    assert found.percent < 25
    assert found.differences["largest_solid"].volume > 0.9
