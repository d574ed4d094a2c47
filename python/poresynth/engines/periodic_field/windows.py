"""Windows of the exemplar, and grids of points that are made to look like them."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

__all__ = ["Windows", "grid_phases"]


class Windows:
    """Windows of the exemplar at random places, with their guidance as further channels.

    Parameters
    ----------
    field : Tensor
        Shape (channel, edge, …).
    guide : Tensor, optional
        The guidance factor, shape (1, edge, …).
    patch : int, optional
        Edge of the patches that the factor tells of (Eq. 6), whose middle is a point of ``guide``.
        A window then has one factor, as in the paper: that of a patch which it lies in, or which
        lies in it, at random. With the factor of the patch around each point the network learns how
        solid that very point is, which a factor that is the same everywhere does not ask for.
        Without, each point has its own.
    """

    def __init__(
        self, field: Tensor, guide: Tensor | None = None, patch: int | None = None
    ) -> None:
        self.field, self._guide, self._patch = field, guide, patch

    @property
    def channels(self) -> int:
        """Channels of a window, with that of the guidance."""
        return len(self.field) + (self._guide is not None)

    def to(self, device: torch.device) -> Windows:
        """Return the same on a device."""
        guide = None if self._guide is None else self._guide.to(device)
        return Windows(self.field.to(device), guide, self._patch)

    def draw(self, offsets: Sequence[Tensor], count: int, random: torch.Generator) -> Tensor:
        """Return the exemplar on grids of points.

        Parameters
        ----------
        offsets : sequence of Tensor
            Places of the points of a grid along each axis, int64, ascending from 0.
        count : int
            Grids.
        random : torch.Generator
            Of the CPU.

        Returns
        -------
        Tensor
            Shape (count, channel, points, …).
        """
        corners, patches = self._places(offsets, count, random)
        found = _take(self.field, offsets, corners)
        guides = self._guides(offsets, corners, patches)
        return found if guides is None else torch.cat([found, guides], dim=1)

    def guides(
        self, offsets: Sequence[Tensor], count: int, random: torch.Generator
    ) -> Tensor | None:
        """Return the guidance of such grids alone, shape (count, 1, points, …), if there is any."""
        return self._guides(offsets, *self._places(offsets, count, random))

    def _places(
        self, offsets: Sequence[Tensor], count: int, random: torch.Generator
    ) -> tuple[list[Tensor], list[Tensor]]:
        """Return the first points of windows, and of their patches, along each axis."""
        corners, patches = [], []
        for points, edge in zip(offsets, self.field.shape[1:], strict=True):
            extent = int(points[-1]) + 1
            if self._patch is None:
                corners.append(torch.randint(edge - extent + 1, (count,), generator=random))
                continue
            patches.append(torch.randint(edge - self._patch + 1, (count,), generator=random))
            room = self._patch - extent
            inside = min(room, 0) + torch.randint(abs(room) + 1, (count,), generator=random)
            corners.append((patches[-1] + inside).clamp(0, edge - extent))
        return corners, patches

    def _guides(
        self, offsets: Sequence[Tensor], corners: list[Tensor], patches: list[Tensor]
    ) -> Tensor | None:
        if self._guide is None:
            return None
        if self._patch is None:
            return _take(self._guide, offsets, corners)
        middle = [torch.tensor([self._patch // 2])] * len(offsets)
        one = _take(self._guide, middle, patches)
        return one.expand(-1, -1, *map(len, offsets))


def _take(field: Tensor, offsets: Sequence[Tensor], corners: Sequence[Tensor]) -> Tensor:
    """Return a field on grids with these first points, shape (count, channel, points, …)."""
    index: list[Tensor | slice] = [slice(None)]
    for axis, (points, corner) in enumerate(zip(offsets, corners, strict=True)):
        shape = [len(corner)] + [1] * len(offsets)
        shape[axis + 1] = -1
        places = corner[:, None] + points.to(corner.device)
        index.append(places.reshape(shape).to(field.device))
    return field[tuple(index)].transpose(0, 1)


def grid_phases(offsets: Sequence[Tensor], frequency: Tensor, shift: Tensor) -> list[Tensor]:
    """Return the phases of grids of points.

    Parameters
    ----------
    offsets : sequence of Tensor
        As of `Windows.draw`.
    frequency : Tensor
        Phase of one pixel or voxel along each axis, shape (axis,): a of Eq. 3 in its units.
    shift : Tensor
        Phase of the first point of each grid, shape (count, axis).

    Returns
    -------
    list of Tensor
        One an axis, shape (count, points).
    """
    return [
        start[:, None] + places.to(rate.device) * rate
        for places, start, rate in zip(offsets, shift.T, frequency, strict=True)
    ]
