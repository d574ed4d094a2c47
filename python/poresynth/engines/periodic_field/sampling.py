"""The endless field of a trained generator, in tiles."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from poresynth.engines.neural.machine import DTYPES
from poresynth.engines.neural.noise import lattice_noise, mix_seed
from poresynth.engines.periodic_field.guidance import Guide
from poresynth.engines.periodic_field.latent import LatentField
from poresynth.engines.periodic_field.lattice import Cells
from poresynth.errors import ParameterError

__all__ = ["FieldTiles", "Frame", "tile_memory"]

Shape = tuple[int, int, int]
Field = npt.NDArray[np.float32]
Places = npt.NDArray[np.int64]

TILE: dict[str, dict[int, Shape]] = {
    "cpu": {2: (1, 128, 128), 3: (32, 32, 32)},
    "other": {2: (1, 512, 512), 3: (64, 64, 64)},
}
"""Edges of a tile, whose latent values are computed at once."""

_AT_ONCE = {"cpu": 1 << 12, "other": 1 << 18}
"""Points that go through the network at once. On a CPU 4096 points of 128 numbers stay in the
cache: 450,000 points a second and thread of the paper's network, against 170,000 of 64³ points."""

STRETCH = 1.25
"""Most that a periodic output may stretch or shrink the structure."""


@dataclass(frozen=True)
class Frame:
    """How voxels of an output become phases.

    Attributes
    ----------
    frequency : tuple of float
        Phase of one voxel along each axis that the field has.
    spacing : tuple of float
        Distance of the latent field's coarsest sites along each axis, as a phase.
    encoded : tuple of bool
        Whether the network sees the phase along each axis, or the latent field alone.
    origin : float
        Place of voxel 0 in voxels: not 0 where voxels are smaller or larger than the exemplar's, so
        that the corner of the first voxel stays where it is.
    period : tuple of int or None
        Voxels after which an output repeats, along each axis.
    sites : tuple of int or None
        Sites of the latent field's coarsest lattices in these.
    mirrored : tuple of int or None
        Voxels of an output whose second half along each axis is its first half turned over, and
        which then goes on in the same way.
    """

    frequency: tuple[float, ...]
    spacing: tuple[float, ...]
    encoded: tuple[bool, ...]
    origin: float = 0.0
    period: tuple[int, ...] | None = None
    sites: tuple[int, ...] | None = None
    mirrored: tuple[int, ...] | None = None

    @classmethod
    def open(
        cls,
        period: Sequence[float],
        spacing: Sequence[float],
        encoded: Sequence[bool],
        *,
        noise_scale: float = 1.0,
        resolution: float = 1.0,
        mirrored: Sequence[int] | None = None,
    ) -> Frame:
        """Return the frame of an endless output.

        Parameters
        ----------
        period : sequence of float
            Learned period along each axis, voxels of the exemplar.
        spacing : sequence of float
            Distance of the latent field's sites along each axis in training, as a phase.
        encoded : sequence of bool
            Whether the network sees the phase along each axis.
        noise_scale : float, default 1.0
            How much farther apart they are now.
        resolution : float, default 1.0
            Voxels of the output in a voxel of the exemplar, along each axis.
        mirrored : sequence of int, optional
            Voxels along each axis of an output that is to be mirrored.
        """
        return cls(
            tuple(2 / (length * resolution) for length in period),
            tuple(noise_scale * cell for cell in spacing),
            tuple(encoded),
            0.5 - 0.5 * resolution,
            mirrored=None if mirrored is None else tuple(mirrored),
        )

    def periodic(self, shape: Sequence[int]) -> tuple[Frame, tuple[float, ...]]:
        """Return the nearest frame that repeats after a shape, and how much that stretches.

        Parameters
        ----------
        shape : sequence of int
            Voxels along each axis that the field has.

        Returns
        -------
        Frame
        tuple of float
            Factor on the structure's size along each axis. The encoding must fit a whole number of
            times, and so must the cells of the latent field, whose spacing changes by itself. Along
            an axis that is not encoded only the cells must.

        Raises
        ------
        ParameterError
            If a factor is above 1.25 or below its inverse.
        """
        frequency, spacing, sites, stretch = [], [], [], []
        for edge, rate, cell, encoded in zip(
            shape, self.frequency, self.spacing, self.encoded, strict=True
        ):
            unit = 2.0 if encoded else cell  # a period, or a cell, as a phase
            whole = max(1, round(edge * rate / unit))
            factor = edge * rate / (unit * whole)
            if not 1 / STRETCH <= factor <= STRETCH:
                fits = ", ".join(f"{n * unit / rate:.0f}" for n in (1, 2, 3))
                allowed = f"must be near {fits} … voxels: a multiple of the structure's period"
                raise ParameterError("shape", tuple(shape), f"{allowed}, for a periodic output")
            frequency.append(unit * whole / edge)
            sites.append(max(1, round(unit * whole / cell)))
            spacing.append(unit * whole / sites[-1])
            stretch.append(factor)
        framed = Frame(
            tuple(frequency),
            tuple(spacing),
            self.encoded,
            self.origin,
            period=tuple(shape),
            sites=tuple(sites),
            mirrored=self.mirrored,
        )
        return framed, tuple(stretch)

    def phases(self, places: Sequence[Places]) -> tuple[list[Tensor], list[Tensor] | None]:
        """Return the phases of voxels along each axis, and the sites to go on from there.

        Voxels that are the same in an output that repeats get the same bits.
        """
        phases, laps = [], []
        for axis, place in enumerate(places):
            lap = np.zeros_like(place)
            if self.mirrored is not None:
                edge = self.mirrored[axis]
                place = np.minimum(place % edge, edge - 1 - place % edge)
            if self.period is not None and self.sites is not None:
                lap, place = np.divmod(place, self.period[axis])
                lap = lap * self.sites[axis]
            phases.append(torch.from_numpy((place + self.origin) * self.frequency[axis])[None])
            laps.append(torch.from_numpy(lap)[None])
        return phases, None if self.period is None else laps


class Network(Protocol):
    """What makes a field of phases and latent values, such as a generator.

    Attributes
    ----------
    axes, channels : int
        Axes of the field, and values of a point.
    device : torch.device
    """

    axes: int

    @property
    def channels(self) -> int: ...

    @property
    def device(self) -> torch.device: ...

    def __call__(
        self, phases: Sequence[Tensor], latent: Tensor, guidance: Tensor | None = None
    ) -> Tensor:
        """Return the field, 0 to 1, as `Generator.forward`."""


class FieldTiles:
    """The endless field of a generator (`poresynth.engines.neural.tiles.Tiles`), −1 to 1.

    Parameters
    ----------
    generator : Network
        Trained, on the device that is to compute.
    latent : LatentField
        As in training.
    frame : Frame
    seed : int
    constant : bool, default False
        Whether the latent numbers are those of one site everywhere (§4.4).
    guide : Guide, optional
        The guidance factor.
    precision : str, default "float32"
        Of the matrix products.
    compiled : bool, default False
        Whether PyTorch compiles the perceptron, once for all tiles: they have one shape.
    edge : tuple of int, optional
        Voxels of a tile along each axis; by default what suits a network on the device.
    """

    def __init__(
        self,
        generator: Network,
        latent: LatentField,
        frame: Frame,
        *,
        seed: int,
        constant: bool = False,
        guide: Guide | None = None,
        precision: str = "float32",
        compiled: bool = False,
        edge: Shape | None = None,
    ) -> None:
        self.device, self.channels = generator.device, generator.channels
        self.edge = edge or TILE[_kind(self.device)][generator.axes]
        # Where a tile is cut along the first axis of the field.
        first, *others = self.edge[3 - generator.axes :]
        step = max(1, _AT_ONCE[_kind(self.device)] // math.prod(others))
        self._cuts = [*range(0, first, step), first]
        self._generator, self._latent, self._frame = generator, latent, frame
        self._call: Callable[..., Tensor] = torch.compile(generator) if compiled else generator
        self._seed = seed
        self._constant, self._guide, self._precision = constant, guide, precision

    def __call__(self, index: Shape) -> Field:
        """Return a tile, shape (channel, z, y, x)."""
        axes = self._generator.axes
        places = [i * e + np.arange(e) for i, e in zip(index, self.edge, strict=True)]
        phases, laps = self._frame.phases(places[3 - axes :])
        latent = self._latent(phases, self._noise, self._frame.spacing, laps)
        # One period is a phase of 2; what is left is small enough for float32.
        turned = [(phase % 2).float().to(self.device) for phase in phases]
        guide = None
        if self._guide is not None:
            factors = self._guide.at(places).reshape(1, 1, *self.edge[3 - axes :])
            guide = torch.from_numpy(factors).to(self.device)
        reduced = self._precision != "float32"
        with torch.autocast(self.device.type, DTYPES[self._precision], enabled=reduced):
            parts = [
                self._call(
                    [turned[0][:, a:b], *turned[1:]],
                    latent[:, a:b],
                    None if guide is None else guide[:, :, a:b],
                )
                for a, b in itertools.pairwise(self._cuts)
            ]
            made = 2 * torch.cat(parts, dim=2) - 1
        field: Field = made[0].float().cpu().numpy()
        return field.reshape(self.channels, *self.edge)

    def _noise(self, lattices: range, numbers: int, cells: Cells) -> Tensor:
        """Return the numbers on lattices, shape (lattice, 1, number, sites, …)."""
        rows = []
        for lattice, start in zip(lattices, cells.first[:, 0].tolist(), strict=True):
            seed, fine = mix_seed(self._seed, lattice), self._latent.fineness()[lattice]
            if self._constant:
                one = lattice_noise(seed, [0] * len(start), [1] * len(start), channels=numbers)
                rows.append(np.broadcast_to(one, (numbers, *cells.sites)))
            else:
                laps = self._frame.sites
                period = None if laps is None else [fine * count for count in laps]
                rows.append(
                    lattice_noise(seed, start, cells.sites, channels=numbers, period=period)
                )
        return torch.from_numpy(np.stack(rows))[:, None].to(self.device)


def tile_memory(device: torch.device, axes: int, *, latents: int, width: int) -> int:
    """Return the bytes that a tile takes: its latent values, and the layers that see a part of it.

    Parameters
    ----------
    device : torch.device
    axes : int
        2 for images, 3 for volumes.
    latents, width : int
        Latent values of a point, and width of the network.
    """
    kind = _kind(device)
    # What an operation reads, what it writes, and what it needs between.
    return 3 * 4 * (latents * math.prod(TILE[kind][axes]) + width * _AT_ONCE[kind])


def _kind(device: torch.device) -> str:
    return "cpu" if device.type == "cpu" else "other"
