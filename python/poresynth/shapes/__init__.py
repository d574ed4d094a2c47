"""The shape of a part: bodies read from files or drawn, and the voxels inside them."""

from __future__ import annotations

from poresynth.shapes.body import Body, closed_body, read_body
from poresynth.shapes.domain import Domain, check_room, read_domain
from poresynth.shapes.figure import figure
from poresynth.shapes.shell import shell
from poresynth.shapes.voxels import voxelise

__all__ = [
    "Body",
    "Domain",
    "check_room",
    "closed_body",
    "figure",
    "read_body",
    "read_domain",
    "shell",
    "voxelise",
]
