from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy import ndimage

from poresynth import exemplars
from poresynth.errors import ParameterError
from poresynth.preprocess import binarize
from poresynth.volume import Volume

ALL = [exemplars.spinodal, exemplars.foam, exemplars.spheres]
SHAPE = (40, 48, 56)


@pytest.mark.parametrize("draw", ALL)
def test_the_seed_decides(draw: Callable[..., Volume]) -> None:
    volume = draw(SHAPE, seed=3)
    assert volume.shape == SHAPE
    assert volume.dtype == np.uint8
    np.testing.assert_array_equal(volume.array, draw(SHAPE, seed=3).array)
    assert (volume.array != draw(SHAPE, seed=4).array).any()


@pytest.mark.parametrize("draw", ALL)
@pytest.mark.parametrize("porosity", [0.3, 0.5, 0.9])
def test_porosity_is_what_was_asked(draw: Callable[..., Volume], porosity: float) -> None:
    volume = draw(SHAPE, porosity=porosity, seed=1)
    provenance = volume.metadata["poresynth"]
    assert provenance["porosity"] == pytest.approx(porosity, abs=1e-4)
    # The blur moves it a little, most where features are thin.
    assert 1 - binarize(volume).mean() == pytest.approx(porosity, abs=0.02)


@pytest.mark.parametrize("draw", ALL)
def test_the_two_phases_are_apart_and_the_edges_soft(draw: Callable[..., Volume]) -> None:
    array = draw((64, 64, 64), seed=1).array.astype(float)
    solid = binarize(array)
    inside, outside = (ndimage.binary_erosion(s, iterations=2) for s in (solid, ~solid))
    assert array[inside].mean() == pytest.approx(190, abs=3)
    assert array[outside].mean() == pytest.approx(60, abs=3)
    assert array[outside].std() == pytest.approx(6, abs=1)
    assert ((array > 90) & (array < 160)).mean() > 0.01


@pytest.mark.parametrize("draw", ALL)
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_volumes_are_periodic(draw: Callable[..., Volume], axis: int) -> None:
    array = np.moveaxis(draw(SHAPE, seed=2).array.astype(float), axis, 0)
    jumps = np.abs(np.diff(array, axis=0)).mean(axis=(1, 2))
    seam = np.abs(array[0] - array[-1]).mean()
    assert seam < jumps.max() * 1.15


@pytest.mark.parametrize("wavelength", [8.0, 16.0])
def test_the_wavelength_of_the_spinodal(wavelength: float) -> None:
    array = exemplars.spinodal((64, 64, 64), wavelength=wavelength, seed=1).array
    power = np.abs(np.fft.fftn(array - array.mean())) ** 2
    grid = np.meshgrid(*[np.fft.fftfreq(64)] * 3, indexing="ij")
    frequency = np.sqrt(sum(g**2 for g in grid))
    shells = np.round(frequency * 64).astype(int)
    radial = np.bincount(shells.ravel(), power.ravel()) / np.bincount(shells.ravel())
    assert np.argmax(radial[2:]) + 2 == pytest.approx(64 / wavelength, abs=1)


def test_the_struts_of_a_foam_hold_together() -> None:
    solid = binarize(exemplars.foam((64, 64, 64), seed=1))
    labels, _ = ndimage.label(np.tile(solid, (2, 2, 2)), np.ones((3, 3, 3)))
    sizes = np.bincount(labels.ravel())[1:]
    assert sizes.max() / sizes.sum() > 0.98
    # The pores too: the cells are open.
    labels, _ = ndimage.label(~solid)
    assert np.bincount(labels.ravel())[1:].max() / (~solid).sum() > 0.99


def test_spheres_are_a_boolean_model() -> None:
    # Its pores have S2(r) = porosity^(V2(r) / V), with V2 the union of two spheres r apart.
    radius, porosity = 8, 0.5
    pore = ~binarize(exemplars.spheres((128, 128, 128), porosity=porosity, radius=radius, seed=1))
    power = np.abs(np.fft.rfftn(pore)) ** 2
    correlation = np.fft.irfftn(power, pore.shape, (0, 1, 2)) / pore.size
    for r in (2, 4, 8, 12, 16):
        union = 1 + 3 * r / (4 * radius) - r**3 / (16 * radius**3)
        found = np.mean([correlation[r, 0, 0], correlation[0, r, 0], correlation[0, 0, r]])
        assert found == pytest.approx(porosity**union, rel=0.04)


@pytest.mark.parametrize("draw", ALL)
def test_scale_and_provenance(draw: Callable[..., Volume]) -> None:
    volume = draw((32, 32, 32), seed=5, voxel_size=19.5, unit="µm")
    assert (volume.voxel_size, volume.unit) == ((19.5, 19.5, 19.5), "µm")
    provenance = volume.metadata["poresynth"]
    assert provenance["engine"] == f"exemplars.{draw.__name__}"
    assert (provenance["seed"], provenance["shape"]) == (5, [32, 32, 32])
    assert provenance["boundary"] == "periodic"
    again = draw(tuple(provenance["shape"]), seed=5, **provenance["parameters"])
    np.testing.assert_array_equal(again.array, volume.array)


@pytest.mark.parametrize("draw", ALL)
@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"shape": (7, 40, 40)}, r"shape = \(7, 40, 40\): must be \(z, y, x\), at least 8"),
        ({"shape": 40}, "shape = 40: must be"),
        ({"shape": (40, 40)}, "shape = .*: must be"),
        ({"porosity": 0}, "porosity = 0: must be 0.01 to 0.99"),
        ({"porosity": 1.0}, "porosity = 1.0: must be"),
        ({"porosity": float("nan")}, "porosity = nan: must be"),
        ({"seed": -1}, "seed = -1: must not be negative"),
        ({"voxel_size": 0}, "voxel_size = 0: must be"),
    ],
)
def test_parameters_are_checked(
    draw: Callable[..., Volume], options: dict[str, Any], said: str
) -> None:
    with pytest.raises(ParameterError, match=said):
        draw(**{"shape": (40, 40, 40), **options})


@pytest.mark.parametrize(
    ("draw", "name", "low", "high"),
    [
        (exemplars.spinodal, "wavelength", 4, 28),
        (exemplars.foam, "cell", 8, 40),
        (exemplars.spheres, "radius", 2, 20),
    ],
)
def test_lengths_fit_the_shape(
    draw: Callable[..., Volume], name: str, low: float, high: float
) -> None:
    for value in (low, high):
        draw(SHAPE, **{name: value})
    for value in (low - 0.1, high + 0.1, float("nan")):
        with pytest.raises(ParameterError, match=f"{name} = .*: must be {low} to {high} voxels"):
            draw(SHAPE, **{name: value})
