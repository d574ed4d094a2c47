"""Training samples: crops of the exemplar, drawn on the fly (scaffoldgan_2021 §4.1)."""

from __future__ import annotations

import itertools
from typing import Literal, NamedTuple

import numpy as np
import torch
from torch import Tensor

__all__ = ["Crops", "Turn", "turns"]


class Turn(NamedTuple):
    """A symmetry of the cube: a permutation of the axes, then mirrors along some of them."""

    order: tuple[int, int, int]
    mirrored: tuple[int, ...]


def turns(
    symmetry: Literal["none", "flips", "rotations", "full"],
    keep_axis: Literal["z", "y", "x"] | None = None,
) -> list[Turn]:
    """Return the symmetries of this name: 1, 8, 24 or 48, fewer that map an axis to itself."""
    if symmetry == "none":
        return [Turn((0, 1, 2), ())]
    found = []
    for order in itertools.permutations(range(3)):
        for mirrors in itertools.product((1, -1), repeat=3):
            if symmetry == "flips" and order != (0, 1, 2):
                continue
            sign = np.linalg.det(np.eye(3)[list(order)]) * np.prod(mirrors)
            if symmetry == "rotations" and sign < 0:
                continue
            if keep_axis is not None and order["zyx".index(keep_axis)] != "zyx".index(keep_axis):
                continue
            mirrored = tuple(axis for axis, mirror in enumerate(mirrors) if mirror < 0)
            z, y, x = order
            found.append(Turn((z, y, x), mirrored))
    return found


class Crops:
    """Draws cubes from an exemplar.

    Parameters
    ----------
    exemplar : Tensor
        Shape (channels, z, y, x), where the crops are wanted.
    edge : int
        Of a crop, voxels.
    stride : int
        Crops begin at multiples of it: 2 in the paper, 6859 places in 100³ for 64³.
    symmetries : list of Turn
        One of them, at random, for each crop.
    """

    def __init__(self, exemplar: Tensor, edge: int, stride: int, symmetries: list[Turn]) -> None:
        self.exemplar, self.edge, self.stride = exemplar, edge, stride
        self.symmetries = symmetries
        self.places = [(n - edge) // stride + 1 for n in exemplar.shape[1:]]

    def draw(self, count: int, random: torch.Generator) -> Tensor:
        """Return crops, shape (count, channels, edge, edge, edge)."""
        highs = torch.tensor([*self.places, len(self.symmetries)])
        drawn = (torch.rand(count, 4, generator=random, dtype=torch.float64) * highs).long()
        found = []
        for *corner, turn in drawn.tolist():
            z, y, x = (slice(i * self.stride, i * self.stride + self.edge) for i in corner)
            order, mirrored = self.symmetries[turn]
            crop = self.exemplar[:, z, y, x].permute(0, *(axis + 1 for axis in order))
            found.append(crop.flip([axis + 1 for axis in mirrored]))
        return torch.stack(found)
