"""Hexahedra: read back as Abaqus would, every voxel an element of its volume."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis.extra import numpy as hnp

from poresynth.errors import ParameterError
from poresynth.fabrication import write_inp


def parse(path: Path) -> tuple[dict[int, np.ndarray], dict[int, list[int]], dict[str, list[int]]]:
    nodes: dict[int, np.ndarray] = {}
    elements: dict[int, list[int]] = {}
    sets: dict[str, list[int]] = {}
    section = ""
    for line in path.read_text().splitlines():
        assert len(line) < 256
        if line.startswith("*"):
            section = line
            continue
        words = line.split(",")
        assert len(words) <= 16
        if section == "*NODE":
            nodes[int(words[0])] = np.array(words[1:], float)
        elif section.startswith("*ELEMENT"):
            assert section == "*ELEMENT,TYPE=C3D8,ELSET=SOLID"
            elements[int(words[0])] = [int(w) for w in words[1:]]
        elif section.startswith("*NSET"):
            sets.setdefault(section.split("=")[1], []).extend(int(w) for w in words)
    return nodes, elements, sets


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(hnp.arrays(bool, hnp.array_shapes(min_dims=3, max_dims=3, min_side=1, max_side=5)))
def test_any_solid(tmp_path: Path, solid: np.ndarray) -> None:
    if not solid.any():
        return
    size, origin = (0.5, 2.0, 1.0), (10.0, 20.0, 30.0)
    path = tmp_path / "part.inp"
    count = write_inp(path, solid, voxel_size=size, origin=origin)
    nodes, elements, sets = parse(path)
    assert count == (len(nodes), len(elements))
    assert list(elements) == list(range(1, solid.sum() + 1))
    assert list(nodes) == list(range(1, len(nodes) + 1))
    # Nodes are shared: no two at one place, none unused.
    assert len({tuple(p) for p in nodes.values()}) == len(nodes)
    assert {n for e in elements.values() for n in e} == set(nodes)
    corners = np.array([[nodes[n] for n in e] for e in elements.values()])
    a, b, d, e = corners[:, 0], corners[:, 1], corners[:, 3], corners[:, 4]
    volumes = np.einsum("ij,ij->i", np.cross(b - a, d - a), e - a)
    np.testing.assert_allclose(volumes, 1.0)
    np.testing.assert_allclose(corners[:, 2] - b, d - a)
    np.testing.assert_allclose(
        corners[:, 4:] - corners[:, :4], np.tile([0, 0, 0.5], (len(e), 4, 1))
    )
    centres = corners.mean(axis=1)[:, ::-1]
    index = np.round((centres - origin) / size - 0.5).astype(int)
    np.testing.assert_array_equal(index, np.argwhere(solid))
    low = np.array(origin)[::-1]
    high = low + np.array(size)[::-1] * solid.shape[::-1]
    for axis, name in enumerate("XYZ"):
        for end, place in (("MIN", low[axis]), ("MAX", high[axis])):
            wanted = {n for n, p in nodes.items() if p[axis] == place}
            assert set(sets.get(name + end, [])) == wanted


def test_a_block(tmp_path: Path) -> None:
    assert write_inp(tmp_path / "block.inp", np.ones((2, 3, 4), bool), unit="mm") == (60, 24)
    text = (tmp_path / "block.inp").read_text()
    assert text.startswith(
        "*HEADING\nporesynth: hexahedra of voxels, lengths in mm\n*NODE\n1,0,0,0\n"
    )
    assert "*ELEMENT,TYPE=C3D8,ELSET=SOLID\n1,1,2,7,6,21,22,27,26\n" in text


def test_many_rows_are_written_in_blocks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator
) -> None:
    solid = rng.random((4, 5, 6)) < 0.5
    write_inp(tmp_path / "whole.inp", solid)
    monkeypatch.setattr("poresynth.fabrication.hexahedra._ROWS", 3)
    write_inp(tmp_path / "blocks.inp", solid)
    assert (tmp_path / "whole.inp").read_bytes() == (tmp_path / "blocks.inp").read_bytes()


def test_nothing_to_write(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="no solid voxel"):
        write_inp(tmp_path / "none.inp", np.zeros((2, 2, 2), bool))
    assert not list(tmp_path.iterdir())
