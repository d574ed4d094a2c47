"""Struts and grains between random points, and which of them images are like."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import KDTree

from poresynth.engines.images import Images, as_images
from poresynth.engines.mode_choice import dead_ends_a_loop
from poresynth.engines.model_choice import near_models
from poresynth.engines.point_models import PointModel, models, nearest, points
from poresynth.engines.solid_parameters import SolidParameters

SHAPE, SCALE = (10, 14, 12), 4


def brute_force(model: PointModel, seed: int) -> np.ndarray:
    """Distances to all points and all their copies next door."""
    box = SCALE * np.array(SHAPE, float)
    placed = points(box, model.spacing, model.relaxed, seed)
    copies = np.stack(np.meshgrid(*[[-1, 0, 1]] * 3, indexing="ij"), -1).reshape(-1, 3)
    everywhere = (placed[:, None] + copies * box).reshape(-1, 3)
    middles = SCALE * (np.stack(np.indices(SHAPE), -1) + 0.5)
    away = np.linalg.norm(middles[..., None, :] - everywhere, axis=-1)
    nearest = np.sort(away, axis=-1)[..., :4]
    return np.asarray(model.sign * (nearest @ np.array(models(3)[model.name])))


@pytest.mark.parametrize("name", models(3))
@pytest.mark.parametrize("sign", [1, -1])
def test_fields_are_sums_of_distances_in_space_that_repeats(name: str, sign: int) -> None:
    model = PointModel(name, sign, 11.0, 1)
    field = model.field(SHAPE, SCALE, 3)
    assert (field.shape, field.dtype) == ((1, *SHAPE), np.float32)
    np.testing.assert_allclose(field[0], brute_force(model, 3), atol=1e-4)


def test_there_are_points_for_every_distance_in_the_smallest_box() -> None:
    field = PointModel("edges of cells", 1, 30.0, 4).field((2, 2, 2), 4, 0)
    assert np.isfinite(field).all()


def test_relaxed_points_are_as_many_and_farther_apart() -> None:
    box = np.array([60.0, 80.0, 100.0])
    nearest = []
    for relaxed in (0, 1, 4):
        placed = points(box, 12.0, relaxed, 1)
        assert len(placed) == round(np.prod(box / 12.0))
        assert ((placed >= 0) & (placed < box)).all()
        away = np.abs(placed[:, None] - placed)
        away = np.linalg.norm(np.minimum(away, box - away), axis=-1)
        nearest.append(np.sort(away, axis=1)[:, 1].min())
    assert nearest[0] < nearest[1] < nearest[2]


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("name", ["edges of cells", "balls around points"])
def test_a_section_of_a_model_is_near_to_it(name: str, sign: int) -> None:
    model = PointModel(name, sign, 18.0, 4)
    box, (y, x) = np.full(3, 128.0), np.indices((128, 128)) + 0.5
    tree = KDTree(points(box, model.spacing, model.relaxed, 5), boxsize=box)
    values = model.total(nearest(tree, np.stack([np.full_like(y, 60.0), y, x], axis=-1)))
    # What is made is the smaller phase.
    image = values > np.quantile(values, 0.8 if sign > 0 else 0.2)
    images = Images.of(as_images(image), SolidParameters())
    near = near_models(images, 5)
    assert near[0][1] < 16
    assert all(found.sign == sign for found, _ in near)
    # One section does not tell edges from corners that lie nearer.
    own = [found.spacing for found, _ in near if found.name == name]
    assert 0.8 < np.mean(own) / 18.0 < 1.25


def test_what_no_model_is_like_is_far_from_all() -> None:
    stripes = np.zeros((96, 96), bool)
    stripes[::8] = stripes[1::8] = True
    images = Images.of(as_images(stripes), SolidParameters())
    near = near_models(images, 3)
    assert len(near) == 3
    assert near[0][1] == min(error for _, error in near) > 40


def test_dead_ends_are_counted_by_the_loops() -> None:
    network = np.zeros((24, 24, 24), bool)
    assert dead_ends_a_loop(network) == 0
    # Three struts that meet in a node, each back to itself through the border: χ = 1 − 3.
    network[11:14, 11:14] = network[11:14, :, 11:14] = network[:, 11:14, 11:14] = True
    assert dead_ends_a_loop(network) == 0
    network[11:14, 3:10, 3:6] = True
    network[11:14, 3:6, 3:12] = True
    assert dead_ends_a_loop(network) == 0.5
    # A strut alone has two ends, and no loop.
    network[:] = False
    network[11:14, 11:14, 4:20] = True
    assert dead_ends_a_loop(network) == 2


def test_models_say_what_they_are() -> None:
    words = PointModel("edges of cells", 1, 20.4, 4).words()
    assert words == "edges of cells, 20 pixels apart, of points relaxed 4 times"
    words = PointModel("balls around points", -1, 9.0, 1).words()
    assert words == "all but balls around points, 9 pixels apart, of points relaxed once"
