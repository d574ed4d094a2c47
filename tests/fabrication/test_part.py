"""From a volume to a part: order of the steps, what is removed, what is said."""

from __future__ import annotations

import json

import numpy as np
import pytest

from poresynth.errors import ParameterError
from poresynth.exemplars import spinodal
from poresynth.fabrication import (
    FabricationReport,
    closed_cavities,
    drop_loose_parts,
    make_part,
    surface_of,
    with_patches,
)
from poresynth.fabrication.fields import field_of_voxels
from poresynth.fabrication.patches import PATCHES
from poresynth.meshes import Mesh, check
from poresynth.shapes import Domain
from poresynth.volume import Volume


@pytest.fixture
def blob() -> np.ndarray:
    """Return a block of 8³ with a closed pore of 2³, and a loose bit of 3 voxels."""
    solid = np.zeros((16, 16, 16), bool)
    solid[2:10, 2:10, 2:10] = True
    solid[5:7, 5:7, 5:7] = False
    solid[13, 13, 11:14] = True
    return solid


def test_loose_parts_are_removed_and_counted(blob: np.ndarray) -> None:
    field = field_of_voxels(blob)
    found = drop_loose_parts(field)
    assert (found.found, found.removed, found.removed_voxels, found.largest_removed) == (1, 1, 3, 3)
    assert (field > 0).sum() == 8**3 - 2**3
    field = field_of_voxels(blob)
    assert drop_loose_parts(field, "all").removed == 0
    assert (field > 0).sum() == blob.sum()


def test_closed_pores_are_counted(blob: np.ndarray) -> None:
    found = closed_cavities(blob, voxel_size=(0.5, 1, 1), unit="mm")
    assert (found.count, found.voxels, found.largest_voxels) == (1, 8, 8)
    assert (found.volume, found.unit) == (4.0, "mm")
    blob[5, 5, :6] = False
    assert closed_cavities(blob).count == 0
    # A pore at the border is open.
    cup = np.pad(np.zeros((2, 2, 2), bool), 1, constant_values=True)[1:]
    assert closed_cavities(cup).count == 0


def test_parts_that_touch_by_an_edge_hold_as_in_the_mesh() -> None:
    solid = np.zeros((4, 4, 4), bool)
    solid[:2, :2], solid[2:, 2:] = True, True
    part = make_part(Volume(solid))
    assert part.loose.found == 0
    assert check(surface_of(part).mesh).shells == 1


def test_a_part_and_its_surface(blob: np.ndarray) -> None:
    part = make_part(Volume(blob, 0.5, "mm"))
    assert part.inside.sum() == 504
    assert part.porosity(part.inside) == pytest.approx(1 - 504 / 16**3)
    surface = surface_of(part)
    assert surface.report.printable
    assert surface.report.shells == 2
    assert surface.report.volume == pytest.approx(504 * 0.125, rel=0.08)  # Rounded edges.
    report = FabricationReport(part, surface)
    said = json.loads(json.dumps(report.to_dict()))
    assert said["cavities"] == 1
    assert said["loose_parts"] == 1
    assert said["watertight"] is True
    assert any("trap powder" in warning for warning in said["warnings"])


def test_gray_keeps_its_surface() -> None:
    gray = np.zeros((20, 20, 20))
    z, y, x = np.mgrid[:20, :20, :20] - 9.5
    gray[:] = 100 + 10 * (6.3 - np.sqrt(z**2 + y**2 + x**2))
    surface = surface_of(make_part(Volume(gray.astype(np.float32)), threshold=100))
    assert surface.report.volume == pytest.approx(4 / 3 * np.pi * 6.3**3, rel=0.02)


def test_solid_and_pore_share_the_block() -> None:
    volume = spinodal((32, 32, 32), porosity=0.5, wavelength=16, seed=2)
    solid, pore = (make_part(volume, phase=p, keep="all") for p in ("solid", "pore"))
    np.testing.assert_array_equal(solid.inside, ~pore.inside)
    assert solid.porosity(solid.inside) == pytest.approx(pore.porosity(pore.inside))
    volumes = [surface_of(p).report.volume for p in (solid, pore)]
    assert sum(volumes) == pytest.approx(32**3, rel=1e-3)
    dark = make_part(volume, solid="dark", keep="all")
    np.testing.assert_array_equal(dark.inside, pore.inside)


def domain_of(mask: np.ndarray) -> Domain:
    return Domain(Volume(mask, 2.0, "µm"), (10.0, 20.0, 30.0), "mask.tif")


def test_a_shell_under_a_shape() -> None:
    radius = np.sqrt(((np.mgrid[:40, :40, :40] - 19.5) ** 2).sum(axis=0))
    volume = spinodal((40, 40, 40), porosity=0.7, wavelength=12, seed=1, voxel_size=2, unit="µm")
    part = make_part(volume, domain=domain_of(radius < 16), shell=6.0)
    assert not part.inside[radius >= 16].any()
    assert part.inside[(radius < 16) & (radius > 14)].all()
    assert part.space == (radius < 16).sum()
    assert not part.inside[radius < 12].all()
    assert part.porosity(part.inside) < part.porosity(part.before)
    # A closed shell leaves no way out for the powder.
    assert part.cavities.count >= 1
    mesh = surface_of(part).mesh
    assert mesh.bounds.mean(axis=0) == pytest.approx([30 + 40, 20 + 40, 10 + 40], abs=0.1)


def test_a_shell_of_a_whole_block() -> None:
    part = make_part(np.pad(np.ones((2, 2, 2), bool), 5), shell=2)
    inside = part.inside
    assert inside[:2].all()
    assert inside[-2:].all()
    assert inside[:, :, :2].all()
    assert not inside[3:-3, 3:-3, 3:4].any()
    assert part.loose.removed == 1  # The block of 2³ in the middle.


def test_the_provenance_places_a_part() -> None:
    body = np.ones((6, 6, 6), bool)
    origin = {"shape": [6, 6, 6], "unit": "mm", "origin": [1.0, 2.0, 3.0]}
    volume = Volume(body, 1.0, "mm", {"poresynth": {"domain": origin}})
    assert surface_of(make_part(volume)).mesh.bounds[0] == pytest.approx([3, 2, 1])
    cropped = Volume(body[:5], 1.0, "mm", volume.metadata)
    assert surface_of(make_part(cropped)).mesh.bounds[0] == pytest.approx([0, 0, 0])


@pytest.mark.parametrize(("value", "solid", "empty"), [(1, "bright", False), (0, "bright", True)])
def test_full_and_empty_volumes(value: int, solid: str, empty: bool) -> None:
    volume = np.full((3, 4, 5), value, np.uint8)
    if empty:
        with pytest.raises(ParameterError, match="must be somewhere"):
            make_part(volume, solid=solid)  # type: ignore[arg-type]
    else:
        report = surface_of(make_part(volume)).report
        assert report.volume == pytest.approx(60)


def test_one_voxel() -> None:
    assert surface_of(make_part(np.ones((1, 1, 1), bool))).report.volume == pytest.approx(1)


def test_thickening_is_reported() -> None:
    solid = np.zeros((24, 24, 24), bool)
    solid[11:13, 11:13] = True
    part = make_part(Volume(solid, 0.1, "mm"), min_thickness=0.6)
    said = FabricationReport(part).to_dict()
    assert said["weak_places_before"] == 1
    assert said["weak_places_after"] == 0
    assert said["thickness_after"] >= 0.6 > said["thickness_before"]
    assert said["porosity_after"] < said["porosity_before"]


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"phase": "void"}, "phase"),
        ({"keep": "some"}, "keep"),
        ({"phase": "pore", "min_thickness": 4}, "min_thickness"),
        ({"min_thickness": 1}, "min_thickness"),
        ({"shell": 0.1}, "shell"),
        ({"shell": 2, "min_thickness": 3}, "must be at least the least thickness, 3 voxel"),
        ({"solid": "grey"}, "solid"),
        ({"domain": domain_of(np.ones((4, 4, 4), bool))}, r"mask.tif: has 4 × 4 × 4 voxels"),
    ],
)
def test_bad_parameters(options: dict[str, object], named: str, blob: np.ndarray) -> None:
    with pytest.raises(ParameterError, match=named):
        make_part(blob, **options)  # type: ignore[arg-type]


def test_smoothing_and_simplification_are_checked() -> None:
    volume = spinodal((32, 32, 32), porosity=0.6, wavelength=16, seed=4)
    part = make_part(volume)
    plain = surface_of(part)
    moved = surface_of(part, smoothing=10, tolerance=0.1)
    assert moved.report.triangles < 0.7 * plain.report.triangles
    assert moved.report.printable
    assert moved.report.area < plain.report.area
    assert plain.report.crossings == moved.report.crossings == 0


def test_a_simplification_that_makes_crossings_is_done_with_less() -> None:
    from scipy import ndimage

    from poresynth.meshes import isosurface, simplify
    from poresynth.meshes.crossings import crossings

    noise = ndimage.gaussian_filter(np.random.default_rng(3).standard_normal((28, 28, 28)), 1.2)
    part = make_part(Volume(noise.astype(np.float32)), threshold=0, keep="all")
    assert len(crossings(simplify(isosurface(part.field), 1.0)))
    surface = surface_of(part, tolerance=1.0)
    assert check(surface.mesh).printable
    assert surface.report.triangles < 0.8 * surface_of(part).report.triangles


# Patches


def block_of_pore() -> tuple[Mesh, np.ndarray]:
    solid = np.zeros((8, 6, 7), bool)
    solid[:, 2:4, 3:5] = True
    part = make_part(Volume(solid, (0.5, 1, 1), "mm"), phase="pore")
    return with_patches(surface_of(part).mesh, "z", *part.corners), ~solid


def test_patches_cover_the_cut_faces_and_close_the_surface() -> None:
    mesh, pore = block_of_pore()
    assert mesh.patch_names == PATCHES
    assert mesh.patches is not None

    def area(name: str) -> float:
        own = mesh.faces[mesh.patches == PATCHES.index(name)]
        return check(Mesh(mesh.vertices, own)).area

    # The edges of the rod are rounded: there is a little more pore.
    for name, plane in (("inlet", pore[0]), ("outlet", pore[-1])):
        assert plane.sum() < area(name) < 1.06 * plane.sum()
    assert area("sides") == pytest.approx(4 * (6 + 7) * 2)
    assert check(mesh).printable
    sizes = [(mesh.patches == i).sum() for i in range(4)]
    assert sum(sizes) == len(mesh.faces)
    assert min(sizes) > 0


@pytest.mark.parametrize("flow", ["z", "y", "x"])
def test_the_flow_runs_from_low_to_high(flow: str) -> None:
    mesh, _ = block_of_pore()
    part = make_part(Volume(np.zeros((3, 4, 5), np.uint8)), phase="pore")
    mesh = with_patches(surface_of(part).mesh, flow, *part.corners)  # type: ignore[arg-type]
    axis = "xyz".index(flow)
    for patch, end in ((1, 0), (2, mesh.bounds[1, axis])):
        corners = mesh.vertices[mesh.faces[mesh.patches == patch]]
        assert (corners[..., axis] == end).all()


def test_a_pore_that_does_not_reach_the_inlet() -> None:
    solid = np.ones((6, 6, 6), bool)
    solid[2:, 2:4, 2:4] = False
    part = make_part(solid, phase="pore")
    with pytest.raises(ParameterError, match="must reach the inlet"):
        with_patches(surface_of(part).mesh, "z", *part.corners)
