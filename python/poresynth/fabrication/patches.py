"""Named parts of a surface, as flow solvers want them: inlet, outlet, sides, walls."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from poresynth.errors import ParameterError
from poresynth.meshes import Mesh

__all__ = ["PATCHES", "Axis", "with_patches"]

Axis = Literal["z", "y", "x"]

PATCHES = ("walls", "inlet", "outlet", "sides")
"""Names of the patches 0 to 3."""


def with_patches(
    mesh: Mesh,
    flow: Axis,
    low: tuple[float, float, float],
    high: tuple[float, float, float],
) -> Mesh:
    """Name the parts of a pore's surface.

    Parameters
    ----------
    mesh : Mesh
        The closed surface of the pore space of a block.
    flow : {"z", "y", "x"}
        Axis of the flow, from the inlet at its low end to the outlet.
    low, high : (float, float, float)
        Corners (x, y, z) of the block, in the mesh's unit.

    Returns
    -------
    Mesh
        With the patches `PATCHES`: inlet and outlet are the cut faces across the axis, sides the
        other cut faces, walls all else. Together they are closed.

    Raises
    ------
    ParameterError
        If the pore does not reach the inlet or the outlet.
    """
    axis = "xyz".index(flow)
    patches = np.zeros(len(mesh.faces), dtype=np.uint8)
    corners = np.stack([mesh.vertices[mesh.faces[:, i]] for i in range(3)], axis=1)
    for each in range(3):
        for end, place in enumerate((low[each], high[each])):
            on = (corners[:, :, each] == np.float32(place)).all(axis=1)
            patches[on] = 1 + end if each == axis else 3
    for patch in (1, 2):
        if not (patches == patch).any():
            allowed = f"the pore must reach the {PATCHES[patch]}; it does not"
            raise ParameterError("flow", flow, allowed)
    return replace(mesh, patches=patches, patch_names=PATCHES)
