"""Diffusion and flow against exact solutions, a direct solver and another library."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy import ndimage
from tests.metrics.strategies import ORDERS, TYPES, boundaries
from tests.references.transport import Stokes, diffusivity

from poresynth import metrics
from poresynth.errors import ParameterError
from poresynth.metrics import effective_diffusivity, permeability
from poresynth.volume import Volume

FUNCTIONS: list[Callable[..., Any]] = [effective_diffusivity, permeability]
small = hnp.arrays(
    bool,
    hnp.array_shapes(min_dims=3, max_dims=3, min_side=1, max_side=6),
    elements=st.sampled_from([True, False, False]),
)
spacings = st.sampled_from([(1.0, 1.0, 1.0), (2.0, 1.0, 1.0), (0.5, 1.5, 3.0)])


def figure(result: Any) -> float:
    return float(getattr(result, "permeability", None) or getattr(result, "diffusivity", 0.0))


def blobs(edge: int, quantile: float, seed: int = 0) -> np.ndarray:
    noise = np.random.default_rng(seed).standard_normal((edge,) * 3)
    smooth = ndimage.gaussian_filter(noise, 2, mode="wrap")
    return smooth < np.quantile(smooth, quantile)


def spheres(edge: int, fraction: float) -> tuple[np.ndarray, float]:
    """A sphere in a cell, and its radius."""
    radius = edge * (3 * fraction / (4 * np.pi)) ** (1 / 3)
    places = np.mgrid[:edge, :edge, :edge] - (edge - 1) / 2
    return np.square(places).sum(0) <= radius**2, radius


# Diffusion ---------------------------------------------------------------------------------------


@given(small, spacings)
def test_diffusivity_is_that_of_a_direct_solver(
    solid: np.ndarray, spacing: tuple[float, float, float]
) -> None:
    found = effective_diffusivity(solid, voxel_size=spacing, tolerance=1e-7)
    assert found.converged
    assert found.diffusivity == pytest.approx(diffusivity(solid, spacing), rel=1e-9)
    assert found.flux_mismatch < 1e-5


def test_a_volume_of_blobs_by_a_direct_solver() -> None:
    solid = blobs(24, 0.6)
    for axis in range(3):
        expected = diffusivity(np.moveaxis(solid, axis, 0), (1.0, 1.0, 1.0))
        found = effective_diffusivity(solid, axis=axis)
        assert found.diffusivity == pytest.approx(expected, rel=1e-6)
        assert found.flux_mismatch < 1e-3
        assert found.tortuosity == found.porosity / found.diffusivity


@pytest.mark.filterwarnings("ignore")
def test_tortuosity_is_that_of_taufactor() -> None:
    taufactor = pytest.importorskip("taufactor")
    solid = blobs(32, 0.5)
    solver = taufactor.Solver((~solid).astype(np.uint8), device="cpu")
    expected = float(solver.solve(verbose=False, conv_crit=1e-3)[0])
    assert effective_diffusivity(solid).tortuosity == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize("boundary", ["open", "periodic"])
def test_free_space_and_layers(boundary: Any) -> None:
    free = effective_diffusivity(np.zeros((5, 4, 3), bool), boundary=boundary)
    assert free.diffusivity == pytest.approx(1, abs=1e-12)
    assert free.tortuosity == pytest.approx(1, abs=1e-12)
    layers = np.zeros((6, 8, 5), bool)
    layers[:, ::4] = True
    along, across = (effective_diffusivity(layers, axis=a, boundary=boundary) for a in ("z", "y"))
    assert along.diffusivity == pytest.approx(0.75, abs=1e-12)
    assert along.tortuosity == pytest.approx(1, abs=1e-12)
    assert across.diffusivity == 0
    assert across.tortuosity == np.inf
    assert across.percolating_porosity == 0
    assert across.porosity == 0.75


@pytest.mark.parametrize("fraction", [0.05, 0.2, 0.4])
def test_diffusion_between_insulating_spheres(fraction: float) -> None:
    # Rayleigh 1892, with the correction of McKenzie, McPhedran and Derrick 1978. Stairs conduct
    # less than a sphere; the error halves with the voxel.
    ratios = []
    for edge in (20, 40):
        solid, _ = spheres(edge, fraction)
        c = solid.mean()
        exact = 1 - 3 * c / (2 + c - 1.306 * 0.75 * c ** (10 / 3))
        found = effective_diffusivity(solid, boundary="periodic")
        ratios.append(found.diffusivity / exact)
    assert 0.95 < ratios[0] < ratios[1] < 1
    assert 2 * ratios[1] - ratios[0] == pytest.approx(1, abs=0.006)


@given(small, spacings)
def test_solid_round_the_sides_of_a_volume_only_dilutes(
    solid: np.ndarray, spacing: tuple[float, float, float]
) -> None:
    padded = np.pad(solid, ((0, 0), (1, 2), (3, 0)), constant_values=True)
    before, after = (
        effective_diffusivity(s, voxel_size=spacing, tolerance=1e-7).diffusivity * s[0].size
        for s in (solid, padded)
    )
    assert after == pytest.approx(before, rel=1e-9)


# Flow --------------------------------------------------------------------------------------------


@settings(max_examples=60)
@given(small, spacings, boundaries)
def test_permeability_is_that_of_a_direct_solver(
    solid: np.ndarray, spacing: tuple[float, float, float], boundary: Any
) -> None:
    found = permeability(solid, voxel_size=spacing, boundary=boundary, tolerance=1e-5)
    assert found.converged
    if not solid.any():
        assert found.permeability == np.inf
        return
    expected = Stokes(solid, spacing, boundary).permeability()
    assert found.permeability == pytest.approx(expected, rel=2e-4, abs=1e-9)
    assert found.flux_mismatch < 1e-3


@pytest.mark.parametrize("boundary", ["open", "periodic"])
@pytest.mark.parametrize("width", [1, 2, 3, 7])
def test_flow_between_plates(width: int, boundary: Any) -> None:
    solid = np.zeros((4, width + 2, 3), bool)
    solid[:, [0, -1]] = True
    expected = width**3 / 12 / (width + 2)
    for axis in ("z", "x"):
        found = permeability(solid, axis=axis, boundary=boundary, tolerance=1e-5)
        assert found.permeability == pytest.approx(expected, rel=1e-5)
    voxel = (1.0, 0.5, 4.0)
    found = permeability(solid, voxel_size=voxel, boundary=boundary, tolerance=1e-5)
    assert found.permeability == pytest.approx(0.25 * expected, rel=1e-5)
    assert found.permeability_voxels == pytest.approx(found.permeability / 2 ** (2 / 3))
    assert permeability(solid, axis="y", boundary=boundary).permeability == 0


@pytest.mark.parametrize(("radius", "error"), [(3, 0.27), (6, 0.06), (10, 0.02), (20, 0.01)])
def test_flow_through_a_tube(radius: int, error: float) -> None:
    edge = 2 * radius + 4
    places = np.mgrid[:edge, :edge] - (edge - 1) / 2
    solid = np.repeat((np.square(places).sum(0) >= radius**2)[None], 3, axis=0)
    expected = np.pi * radius**4 / 8 / edge**2
    for boundary in ("open", "periodic"):
        found = permeability(solid, boundary=boundary)
        assert found.permeability == pytest.approx(expected, rel=error)


@pytest.mark.parametrize(("edge", "error"), [(1, 0.19), (2, 0.19), (4, 0.07), (8, 0.02)])
def test_flow_through_a_square_duct(edge: int, error: float) -> None:
    solid = np.pad(np.zeros((3, edge, edge), bool), ((0, 0), (1, 1), (1, 1)), constant_values=True)
    expected = 0.0351443 * edge**4 / (edge + 2) ** 2
    assert permeability(solid).permeability == pytest.approx(expected, rel=error)


@pytest.mark.parametrize(("edge", "error"), [(16, 0.11), (32, 0.03)])
def test_flow_between_dilute_spheres(edge: int, error: float) -> None:
    # Drag by that of a sphere alone (Hasimoto 1959).
    fraction = 0.027
    drag = 1 / (1 - 1.7601 * fraction ** (1 / 3) + fraction - 1.5593 * fraction**2)
    solid, radius = spheres(edge, fraction)
    found = permeability(solid, boundary="periodic")
    assert found.permeability == pytest.approx(edge**3 / (6 * np.pi * radius * drag), rel=error)


@pytest.mark.parametrize(("fraction", "drag"), [(0.125, 4.292), (0.343, 15.4), (0.5236, 42.14)])
def test_flow_between_dense_spheres(fraction: float, drag: float) -> None:
    # Drag in simple cubic arrays (Zick and Homsy 1982, Table 2); the last touch.
    solid, radius = spheres(32, fraction)
    found = permeability(solid, boundary="periodic")
    assert found.permeability == pytest.approx(32**3 / (6 * np.pi * radius * drag), rel=0.04)


def test_permeability_goes_with_the_square_of_the_voxel() -> None:
    solid = blobs(16, 0.4)
    voxels, micrometres = permeability(solid), permeability(Volume(solid, 5.3, "µm"))
    assert micrometres.unit == "µm"
    assert voxels.unit == "voxel"
    assert micrometres.permeability == pytest.approx(5.3**2 * voxels.permeability, rel=1e-9)
    assert micrometres.permeability_voxels == pytest.approx(voxels.permeability, rel=1e-9)
    metres = permeability(solid, voxel_size=5.3e-6).permeability
    assert metres == pytest.approx(5.3e-6**2 * voxels.permeability, rel=1e-9)


# Both --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("function", FUNCTIONS)
@pytest.mark.parametrize("boundary", ["open", "periodic"])
def test_turning_the_volume_turns_the_axes(function: Callable[..., Any], boundary: str) -> None:
    solid = blobs(14, 0.45)[:, :12, :10]
    options = {"boundary": boundary, "tolerance": 1e-5}
    for k in range(3):
        turned = np.moveaxis(solid, [0, 1, 2], [(i + k) % 3 for i in range(3)])[::-1, :, ::-1]
        for axis in range(3):
            expected = figure(function(solid, axis=axis, **options))
            found = figure(function(turned, axis=(axis + k) % 3, **options))
            assert found == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("function", FUNCTIONS)
def test_a_periodic_volume_may_be_rolled_and_tiled(function: Callable[..., Any]) -> None:
    solid = blobs(12, 0.5)
    options: dict[str, Any] = {"boundary": "periodic", "tolerance": 1e-5}
    expected = figure(function(solid, **options))
    assert expected > 0
    for other in (np.roll(solid, (3, 5, 7), (0, 1, 2)), np.tile(solid, (2, 1, 2))):
        assert figure(function(other, **options)) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("function", FUNCTIONS)
@pytest.mark.parametrize("boundary", ["open", "periodic"])
def test_threads_and_memory_order_do_not_matter(
    function: Callable[..., Any], boundary: str
) -> None:
    solid = blobs(28, 0.4)
    expected = function(solid, axis="x", boundary=boundary, threads=1)
    for threads in (2, 8):
        assert function(solid, axis="x", boundary=boundary, threads=threads) == expected
    for order in ORDERS.values():
        found = function(order(solid), axis="x", boundary=boundary, threads=3)
        assert found == expected


@pytest.mark.parametrize("function", FUNCTIONS)
@pytest.mark.parametrize("dtype", TYPES)
def test_every_type_and_a_named_phase(function: Callable[..., Any], dtype: str) -> None:
    solid = blobs(10, 0.4)
    expected = function(solid)
    assert function(Volume(solid.astype(dtype))) == expected
    assert function((~solid).astype(dtype), phase=0) == expected


@pytest.mark.parametrize("function", FUNCTIONS)
@pytest.mark.parametrize("boundary", ["open", "periodic"])
def test_what_does_not_percolate_carries_nothing(
    function: Callable[..., Any], boundary: str
) -> None:
    checkerboard = np.indices((6, 6, 6)).sum(0) % 2 == 0
    blind = np.ones((5, 5, 5), bool)
    blind[:4, 2, 2] = False
    for solid in (np.ones((1, 1, 1), bool), np.ones((4, 3, 5), bool), checkerboard, blind):
        found = function(solid, boundary=boundary)
        assert figure(found) == found.percolating_porosity == found.iterations == 0
        assert found.porosity == pytest.approx(1 - solid.mean())
        assert found.converged


@pytest.mark.parametrize("function", FUNCTIONS)
@pytest.mark.parametrize("boundary", ["open", "periodic"])
def test_one_voxel_of_pore(function: Callable[..., Any], boundary: str) -> None:
    found = function(np.zeros((1, 1, 1), bool), boundary=boundary)
    assert figure(found) == (1 if function is effective_diffusivity else np.inf)


@pytest.mark.parametrize("function", FUNCTIONS)
def test_progress_is_told_and_may_stop_the_work(function: Callable[..., Any]) -> None:
    solid = blobs(16, 0.5)
    told: list[float] = []
    found = function(solid, progress=lambda stage, share: told.append(share))
    assert len(told) >= found.iterations
    assert all(0 <= share <= 1 for share in told)
    assert told[-1] == 1

    def stop(stage: str, share: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        function(solid, progress=stop)


@pytest.mark.parametrize("function", FUNCTIONS)
def test_giving_up_is_told(function: Callable[..., Any]) -> None:
    found = function(blobs(16, 0.5), iterations=2, tolerance=1e-9)
    assert found.iterations == 2
    assert not found.converged


@pytest.mark.parametrize("function", FUNCTIONS)
@pytest.mark.parametrize(
    ("options", "parameter"),
    [
        ({"axis": 3}, "axis"),
        ({"axis": "w"}, "axis"),
        ({"axis": -1}, "axis"),
        ({"boundary": "mirror"}, "boundary"),
        ({"tolerance": 0.0}, "tolerance"),
        ({"tolerance": float("nan")}, "tolerance"),
        ({"iterations": 0}, "iterations"),
        ({"voxel_size": -1.0}, "voxel_size"),
        ({"phase": 7}, "phase"),
    ],
)
def test_bad_parameters_are_named(
    function: Callable[..., Any], options: dict[str, object], parameter: str
) -> None:
    with pytest.raises(ParameterError, match=rf"^{parameter} = .*: must be "):
        function(np.ones((2, 2, 2), bool), **options)


@pytest.mark.parametrize("name", ["berea_sandstone_binary_200.tif"])
def test_a_sandstone(data_dir: Any, name: str) -> None:
    tifffile = pytest.importorskip("tifffile")
    solid = tifffile.imread(data_dir / name)[:64, :64, :64] != 0
    expected = diffusivity(solid, (1.0, 1.0, 1.0))
    found = metrics.effective_diffusivity(solid)
    assert found.diffusivity == pytest.approx(expected, rel=1e-6)
