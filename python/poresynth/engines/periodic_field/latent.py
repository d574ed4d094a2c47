"""The latent random field (ipfn_2022 §3.2): numbers of lattices, and distances to random points."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import torch
from torch import Tensor

from poresynth.engines.periodic_field.lattice import Cells, cells_around, shifts
from poresynth.engines.periodic_field.points import distances, nearest

__all__ = ["LatentField", "LatticeValues", "quintic"]

LatticeValues = Callable[[range, int, Cells], Tensor]
"""The random numbers, −1 to 1: called with the lattices, the numbers of a site, and the windows of
the lattices; returns the numbers, shape (lattice, batch, number, sites, …)."""


def quintic(t: Tensor) -> Tensor:
    """Return 6t⁵ − 15t⁴ + 10t³: from 0 to 1, with two derivatives that vanish at both ends."""
    return t * t * t * (t * (6 * t - 15) + 10)


@dataclass(frozen=True)
class LatentField:
    """f of Eq. 4 on grids of points.

    Attributes
    ----------
    axes : int
        2 for images, 3 for volumes.
    points : tuple of int
        How many sites the lattices of random points have where the coarsest has one, along an axis;
        none without points. There is one point in each cell, and a place of the field has the
        distances to the nearest of each lattice. They come before the lattices of numbers.
    groups : int
        Lattices of numbers, each shifted by its own fraction of a cell. One aligned
        lattice for all numbers prints itself into the result: the largest autocovariance along an
        axis, beyond 10 voxels, fell from 0.50 to 0.05 with four.
    numbers : int
        Numbers at each site of them.
    octaves : int
        Every group's lattice is twice as fine as that of the group before, over so many groups;
        then the first spacing comes again. Beside points the coarsest is half as coarse as
        theirs, for their cells are what is large.
    spacing : tuple of float
        Distance of the sites of the coarsest lattices along each axis, as a phase: 2 is a period of
        the encoding.
    interpolation : {"gradient", "quintic", "paper"}
        ``"quintic"``: value noise, separable, continuous with its first and second derivative.
        ``"gradient"``: the same of slopes instead of values (Perlin 2002): the numbers of a group
        are slopes along the axes in turn. Its autocovariance has a negative part, so that a
        structure can have a wavelength that no lattice and no phase dictates; functions of value
        noise have none. On a spinodal structure the error of the normalised autocovariance was 27
        instead of 33 % (one training each), and 19 % with sites a third farther apart and a period
        that is learned. ``"paper"``: Eq. 4, the softmax of −distance / σ over the corners of a
        cell. It jumps at the faces of the cells, for the corners beyond a face take part on one
        side only (in 3D by 4.5 % rms at σ = 0.2, by 34 % at 0.5), and takes 25 times as long.
    sigma : float
        σ of Eq. 4, in cells.
    """

    axes: int
    points: tuple[int, ...]
    groups: int
    numbers: int
    octaves: int
    spacing: tuple[float, ...]
    interpolation: Literal["gradient", "quintic", "paper"]
    sigma: float

    @property
    def size(self) -> int:
        """Values of a point: distances, then numbers."""
        return len(self.points) * nearest(self.axes) + self.groups * self.numbers

    def fineness(self) -> list[int]:
        """Return how many sites each lattice has where the coarsest has one, along an axis."""
        first = 2 if self.points else 1
        return [*self.points, *(first << group % self.octaves for group in range(self.groups))]

    def __call__(
        self,
        phases: Sequence[Tensor],
        values: LatticeValues,
        spacing: Sequence[float] | None = None,
        laps: Sequence[Tensor] | None = None,
    ) -> Tensor:
        """Return the field on grids.

        Parameters
        ----------
        phases : sequence of Tensor
            Phase of the points along each axis, shape (batch, points).
        values : callable
            The random numbers.
        spacing : sequence of float, optional
            Distance of the coarsest sites along each axis, as a phase; ``spacing`` by default.
        laps : sequence of Tensor, optional
            Sites of the coarsest lattices to go on from the phase at each point, int64, shape
            (batch, points): the phase of a point that has gone round a period is that of the
            beginning.

        Returns
        -------
        Tensor
            Shape (batch, points, …, value), of the type of the numbers, where they are.
        """
        spacing = self.spacing if spacing is None else spacing
        shift = shifts(self.axes, len(self.points) + self.groups)
        fineness = self.fineness()

        def cells_of(lattices: range, below: int = 0) -> Cells:
            at = slice(lattices.start, lattices.stop)
            return cells_around(phases, spacing, fineness[at], shift[at], laps, below)

        parts, first = [], 0
        # Those of one fineness together: the finer, the more sites there are in a window.
        for _, alike in itertools.groupby(self.points):
            lattices = range(first, first + len(list(alike)))
            cells = cells_of(lattices, below=1)
            found = values(lattices, self.axes, cells)
            # About as large as numbers are.
            parts.append(2 * distances(found, cells.like(found)) - 1.2)
            first = lattices.stop
        lattices = range(first, len(fineness))
        cells = cells_of(lattices)
        numbers = values(lattices, self.numbers, cells)
        cells = cells.like(numbers)
        if self.interpolation == "paper":
            field = _softmax(numbers, cells.index, cells.fraction, self.sigma)
        else:
            slopes = self.interpolation == "gradient"
            field = _separable(numbers, cells.index, cells.fraction, slopes)
        parts.append(field.movedim(2, -1))
        # (lattice, batch, points, …, value) → (batch, points, …, lattice · value)
        return torch.cat([part.movedim(0, -2).flatten(-2) for part in parts], dim=-1)


def _separable(
    numbers: Tensor, cells: Sequence[Tensor], fractions: Sequence[Tensor], slopes: bool
) -> Tensor:
    """Interpolate along one axis after the other; each goes to the end."""
    groups, batch, channels = numbers.shape[:3]
    for axis, (cell, fraction) in enumerate(zip(cells, fractions, strict=True)):
        t = fraction[..., None]  # (group, batch, points, 1)
        upper = quintic(t)
        weights = _two(numbers, cell, 1 - upper, upper)
        kinds = [weights] * channels
        if slopes:
            # As large as values are, within a few percent.
            own = _two(numbers, cell, 4 * (1 - upper) * t, 4 * upper * (t - 1))
            kinds = [own if k % len(cells) == axis else weights for k in range(channels)]
        rest = numbers.shape[4:]
        flat = numbers.reshape(groups, batch, channels, numbers.shape[3], -1)
        mixed = torch.einsum("gbclr,gbcnl->gbcrn", flat, torch.stack(kinds, dim=2))
        numbers = mixed.reshape(groups, batch, channels, *rest, fraction.shape[2])
    return numbers


def _two(like: Tensor, cell: Tensor, lower: Tensor, upper: Tensor) -> Tensor:
    """Return the weights of all sites, 0 but for the two around a point."""
    weights = like.new_zeros((*cell.shape, like.shape[3]))
    weights = weights.scatter(3, cell[..., None], lower)
    return weights.scatter(3, cell[..., None] + 1, upper)


def _softmax(
    numbers: Tensor, cells: Sequence[Tensor], fractions: Sequence[Tensor], sigma: float
) -> Tensor:
    """Mix the corners of each point's cell by Eq. 4."""
    axes, sites = len(cells), numbers.shape[3:]
    flat = numbers.flatten(3)
    logits, picked = [], []
    for corner in itertools.product((0, 1), repeat=axes):
        square, index = fractions[0].new_zeros(()), cells[0].new_zeros(())
        for axis, side in enumerate(corner):
            square = square + _along((fractions[axis] - side) ** 2, axis, axes)
            index = index + _along((cells[axis] + side) * math.prod(sites[axis + 1 :]), axis, axes)
        # The distance has no derivative at the corner itself; a tiny square gives it one.
        logits.append(-(square + 1e-12).sqrt() / sigma)  # (group, batch, points, …)
        at = index.flatten(2)[:, :, None].expand(-1, -1, numbers.shape[2], -1)
        picked.append(flat.gather(3, at).reshape(*at.shape[:3], *index.shape[2:]))
    weights = torch.stack(logits).softmax(0)[:, :, :, None]
    return (weights * torch.stack(picked)).sum(0)


def _along(values: Tensor, axis: int, axes: int) -> Tensor:
    """Shape (group, batch, points) → (group, batch, 1, …, points, …, 1)."""
    shape = [1] * axes
    shape[axis] = -1
    return values.reshape(*values.shape[:2], *shape)
