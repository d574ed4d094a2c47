"""Structure that turns, stretches and scales from place to place."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from poresynth import VolumeTexture
from poresynth.engines.coordinates import material_coordinates
from poresynth.errors import ParameterError

SHAPE = (20, 24, 28)
SIZE = (1.0, 1.0, 1.0)


def layers(edge: int = 48, period: int = 8) -> np.ndarray:
    """Wavy plates across z."""
    z, y, x = np.indices((edge,) * 3)
    rough = ndimage.gaussian_filter(np.random.default_rng(1).random((edge,) * 3), 3)
    wave = np.sin(2 * np.pi * z / period) + 8 * (rough - rough.mean()) / rough.std() / 10
    return np.asarray(127 + 80 * np.clip(wave, -1, 1) + 0 * (y + x), np.uint8)


def intercepts(solid: np.ndarray) -> np.ndarray:
    """Mean length between changes of phase along each axis."""
    found = []
    for axis in range(3):
        along = np.moveaxis(solid, axis, 0)
        found.append(along[1:].size / max(np.count_nonzero(along[1:] != along[:-1]), 1))
    return np.array(found)


def everywhere(coordinates: Any) -> np.ndarray:
    return coordinates.places(slice(0, coordinates.shape[0]))


def test_no_wish_is_the_identity() -> None:
    found = everywhere(material_coordinates(SHAPE, SIZE, None, 1.0))
    steps = [np.diff(found[axis], axis=axis) for axis in range(3)]
    for step in steps:
        np.testing.assert_allclose(step, 1, atol=1e-4)


@settings(max_examples=20, deadline=None)
@given(
    direction=st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 0.2),
    length=st.floats(0.5, 3),
    scale=st.floats(0.3, 3),
)
def test_a_constant_wish_is_met_exactly(
    direction: tuple[float, float, float], length: float, scale: float
) -> None:
    way = np.array(direction) / np.linalg.norm(direction)
    found = material_coordinates(SHAPE, SIZE, length * way, scale)
    assert found.angle < 0.1
    assert found.scale < 1e-3
    places = everywhere(found)
    jacobian = np.stack([[np.diff(c, axis=a).mean() for a in range(3)] for c in places])
    # One voxel of the exemplar along z is `length × scale` voxels along the direction.
    along = np.linalg.inv(jacobian)[:, 0]
    np.testing.assert_allclose(np.abs(along @ way), length * scale, rtol=1e-3)
    np.testing.assert_allclose(np.linalg.norm(along), length * scale, rtol=1e-3)
    assert np.linalg.det(jacobian) == pytest.approx(1 / (length * scale**3), rel=1e-3)
    # All of it lies in the room, one voxel from its border.
    assert (places >= 0.99).all()
    assert all(p.max() <= n - 1 for p, n in zip(places, found.room, strict=True))


def test_a_growing_scale_is_met_nearly() -> None:
    found = material_coordinates((80, 40, 40), SIZE, None, lambda z, y, x: 1 + z / 80 + 0 * (y + x))
    assert found.scale < 0.1
    step = np.diff(everywhere(found)[0], axis=0).mean(axis=(1, 2))
    np.testing.assert_allclose(step[[2, 40, 76]], [1 / 1.04, 1 / 1.5, 1 / 1.96], rtol=0.1)


def test_a_twist_is_said_to_be_out_of_reach() -> None:
    def twist(z: np.ndarray, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        angle = 0.2 * x + 0 * (z + y)
        return np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)

    assert material_coordinates((40, 40, 40), SIZE, twist, None).angle > 10


def test_functions_and_coarse_fields_say_the_same() -> None:
    size = (2.0, 1.0, 0.5)
    shape = (32, 32, 32)
    fine = material_coordinates(shape, size, None, lambda z, y, x: 1 + z / 64 + 0 * (y + x))
    coarse = 1 + (np.arange(8) + 0.5) / 8
    coarse = np.broadcast_to(coarse[:, None, None], (8, 4, 4))
    np.testing.assert_allclose(
        fine.nodes, material_coordinates(shape, size, None, coarse).nodes, atol=1e-3
    )


def test_a_field_is_carried_as_interpolation_says() -> None:
    coordinates = material_coordinates(SHAPE, SIZE, [0.0, 1.2, 0.5], 0.8)
    rng = np.random.default_rng(3)
    field = ndimage.gaussian_filter(rng.random((2, *coordinates.room)), 2).astype(np.float32)
    carried = coordinates.carry(field)
    places = everywhere(coordinates)
    for mine, own in zip(carried, field, strict=True):
        expected = ndimage.map_coordinates(own, places, order=1, mode="nearest")
        np.testing.assert_allclose(mine, expected, atol=1e-6)
    # The domain holds all that interpolation looks at.
    domain = coordinates.domain(None)
    hidden = np.where(domain, field, np.nan)
    assert np.isfinite(coordinates.carry(hidden)).all()
    part = np.zeros(SHAPE, bool)
    part[:5] = True
    assert coordinates.domain(part).sum() < 0.6 * domain.sum()


@pytest.mark.parametrize("axis", ["z", "y", "x"])
def test_plates_follow_the_direction(axis: Any) -> None:
    exemplar = np.moveaxis(layers(), 0, "zyx".index(axis))
    engine = VolumeTexture(preset="fast").fit(np.ascontiguousarray(exemplar))
    for wanted in range(3):
        vector = np.eye(3)[wanted]
        made = engine.sample((40, 40, 40), seed=1, orientation=vector, orientation_axis=axis)
        lengths = intercepts(made.array > engine.threshold_)
        assert np.argmin(lengths) == wanted
        assert lengths[wanted] < 0.6 * np.sort(lengths)[1]
        figures = made.metadata["poresynth"]["coordinates"]
        assert figures["mean_angle_degrees"] < 0.1


def test_structure_scales_and_keeps_its_porosity() -> None:
    exemplar = layers()
    engine = VolumeTexture(preset="fast").fit(exemplar)
    plain, large = (engine.sample((40, 40, 40), seed=1, scale=s) for s in (1.0, 1.6))
    solids = [made.array > engine.threshold_ for made in (plain, large)]
    ratio = intercepts(solids[1])[0] / intercepts(solids[0])[0]
    assert ratio == pytest.approx(1.6, rel=0.15)
    for solid in solids:
        assert 1 - solid.mean() == pytest.approx(engine.porosity_, abs=1e-3)
    assert large.array.dtype == exemplar.dtype
    again = engine.sample((40, 40, 40), seed=1, scale=1.6, threads=1)
    np.testing.assert_array_equal(again.array, large.array)


def test_a_mask_and_a_map_go_with_a_scale() -> None:
    engine = VolumeTexture(preset="fast").fit(layers())
    z, y, x = np.indices((40, 40, 40)) - 19.5
    ball = z**2 + y**2 + x**2 < 18**2
    made = engine.sample((40, 40, 40), seed=1, scale=1.3, mask=ball, porosity=0.6)
    assert (made.array[~ball] == layers().min()).all()
    inside = made.array[ball] <= engine.threshold_
    assert inside.mean() == pytest.approx(0.6, abs=1e-3)


@pytest.mark.parametrize(
    ("arguments", "parameter"),
    [
        ({"scale": 0.0}, "scale"),
        ({"scale": 9.0}, "scale"),
        ({"scale": np.nan}, "scale"),
        ({"scale": "large"}, "scale"),
        ({"scale": np.ones((41, 40, 40))}, "scale"),
        ({"scale": np.ones((4, 4))}, "scale"),
        ({"orientation": [1.0, 0.0]}, "orientation"),
        ({"orientation": [0.0, 0.0, 0.0]}, "orientation"),
        ({"orientation": np.ones((4, 4, 4))}, "orientation"),
        ({"orientation": lambda z, y, x: z}, "orientation"),
        ({"orientation": [0, 0, 1.0], "orientation_axis": "t"}, "axis"),
        ({"scale": 1.2, "boundary": "periodic"}, "scale"),
    ],
)
def test_bad_wishes_are_named(arguments: dict[str, Any], parameter: str) -> None:
    engine = VolumeTexture(preset="fast").fit(layers())
    with pytest.raises(ParameterError, match=parameter):
        engine.sample((40, 40, 40), **arguments)
