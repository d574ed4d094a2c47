"""The loss on jets, a field's value, slope and curvature at a point: it tells struts from lumps."""

from __future__ import annotations

import torch
from torch import Tensor

from poresynth.engines.periodic_field.distributions import DistributionLoss, quantiles
from poresynth.engines.periodic_field.windows import Windows

__all__ = ["NODES", "JetLoss", "invariants"]

NODES = 4
"""Points along each axis of a grid that is evaluated at one place: in its inside are 2 along each
axis that have all neighbours."""

SPACINGS = (1, 2, 3, 4, 6)
"""Distances of these neighbours, pixels or voxels."""

_TABLE_PLACES = 1 << 13
"""Places of the exemplar whose invariants make the quantiles."""


class JetLoss(DistributionLoss):
    """Distance between the distributions of value, slope and curvature on a field and the exemplar.

    The value, the gradient g and the Hessian H of a field at a point decide how the surfaces around
    it lie: the densities of volume, surface, mean curvature and Euler number of {field > t} are
    means of functions of them alone (Adler and Taylor 2007), so that a field with the same joint
    distribution has them all. Weighted sums of values at a few places, which `ResponseLoss`
    compares, decide the same in the limit of very many, but where correlations are much the same a
    random sum sees hardly a difference.

    What is compared are the invariants of f, g and H under rotations, on stencils of several
    widths, each over its mean size and compressed by asinh, for products of slopes have long tails;
    and random sums of them; by sorted values.

    Parameters
    ----------
    windows : Windows
        Of the exemplar.
    reach : int
        Largest extent of a grid along an axis, below the edge of the exemplar.
    places : int
        Places that the field is evaluated at in a step.
    random : torch.Generator
        Of the CPU; draws the sums.
    sums : int, default 48
        Random sums of the invariants whose distributions are matched, beside those of each.

    Attributes
    ----------
    places : int
        Fewer than were asked for: a grid holds several points.

    Notes
    -----
    Peak memory: some 200 · places · channels bytes.
    """

    def __init__(
        self,
        windows: Windows,
        *,
        reach: int,
        places: int,
        random: torch.Generator,
        sums: int = 48,
    ) -> None:
        axes = windows.field.ndim - 1
        self.places = max(16, places // 2 ** (axes - 1))
        # The narrowest is there in the smallest exemplar, too.
        widths = [s for s in SPACINGS if s * (NODES - 1) <= max(reach, NODES - 1)]
        self.offsets = [[torch.arange(NODES) * s] * axes for s in widths]
        samples = self.places * (NODES - 2) ** axes
        self._sizes: list[tuple[Tensor, Tensor]] = []
        self._sums: list[Tensor] = []
        tables = []
        for grid, offsets in enumerate(self.offsets):
            found = invariants(windows.draw(offsets, _TABLE_PLACES, random))
            centre = torch.zeros_like(found[0])
            # The first invariant of each channel, the value, has a mean that is no size.
            values = slice(None, None, found.shape[1] // windows.channels)
            centre[values] = found[:, values].mean(0)
            size = (found - centre).abs().mean(0).clamp(min=1e-9)
            self._sizes.append((centre, size))
            small = self._small(found, grid)
            drawn = torch.randn(sums, small.shape[1], generator=random).to(small)
            drawn = drawn / drawn.square().sum(1, keepdim=True).sqrt()
            own = torch.eye(small.shape[1]).to(small)
            spread = small.std(0).clamp(min=1e-9)
            self._sums.append(torch.cat([own, drawn]) / spread)
            tables.append(quantiles(small @ self._sums[-1].T, samples))
        self.tables = tables

    def responses(self, field: Tensor, grid: int) -> Tensor:
        """Return the sums in standard deviations, shape (place, channel, node, …) → (jet, sum)."""
        return self._small(invariants(field), grid) @ self._sums[grid].T

    def _small(self, found: Tensor, grid: int) -> Tensor:
        """Return invariants over their mean sizes, compressed."""
        centre, size = self._sizes[grid]
        return torch.asinh((found - centre) / size)


def invariants(field: Tensor) -> Tensor:
    """Return what rotations leave of value, gradient and Hessian, by central differences.

    Parameters
    ----------
    field : Tensor
        On grids, shape (place, channel, node, …), at least 3 nodes along each axis, evenly spaced.

    Returns
    -------
    Tensor
        f, |g|², tr H, tr H², gᵀHg of each channel, and in 3D tr H³ and |Hg|², in units of the
        nodes' distance, at all nodes that have neighbours; shape (place · inner nodes, channel ·
        value).
    """
    axes = range(field.ndim - 2)

    def at(*steps: tuple[int, int]) -> Tensor:
        """Return the values so many nodes away along some axes, at all inner nodes."""
        away = dict(steps)
        index = [slice(None)] * 2
        index += [slice(1 + away.get(k, 0), n - 1 + away.get(k, 0)) for k, n in enumerate(nodes)]
        return field[tuple(index)]

    def second(i: int, j: int) -> Tensor:
        if i == j:
            return at((i, 1)) + at((i, -1)) - 2 * here
        same = at((i, 1), (j, 1)) + at((i, -1), (j, -1))
        return (same - at((i, 1), (j, -1)) - at((i, -1), (j, 1))) / 4

    nodes = field.shape[2:]
    here = at()
    gradient = torch.stack([(at((i, 1)) - at((i, -1))) / 2 for i in axes], -1)
    half = {(i, j): second(i, j) for i in axes for j in axes if i <= j}
    rows = [torch.stack([half[min(i, j), max(i, j)] for j in axes], -1) for i in axes]
    hessian = torch.stack(rows, -2)
    square = hessian @ hessian
    turned = (hessian @ gradient[..., None])[..., 0]
    found = [
        here,
        gradient.square().sum(-1),
        _trace(hessian),
        _trace(square),
        (gradient * turned).sum(-1),
    ]
    if len(axes) == 3:
        found += [(square * hessian).sum((-1, -2)), turned.square().sum(-1)]
    # (place, channel, node, …, value) → (place · node, channel · value)
    return torch.stack(found, -1).movedim(1, -2).flatten(-2).flatten(0, -2)


def _trace(matrix: Tensor) -> Tensor:
    return matrix.diagonal(dim1=-2, dim2=-1).sum(-1)
