"""Volumes from tiles of one size: any window of an endless field, in bounded memory.

A neural engine describes its field by a `Tiles`: a function of the tile's place that returns its
values. Every tile has the same shape and is computed by itself, with the same operations in the
same order, whatever is asked for: so a window of a large volume has the same bits as the same
window of the whole. On a CPU tiles are shared out among threads, each of which computes alone, so
that the number of threads does not change the bits either.
"""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt
import torch

from poresynth.engines.neural.memory import explained_memory

__all__ = ["Box", "Tiles", "assemble", "blocks"]

Field = npt.NDArray[np.float32]


class Tiles(Protocol):
    """An endless field, in tiles.

    Attributes
    ----------
    edge : tuple of int
        Shape of a tile in voxels, without the channels: (z, y, x), or (1, y, x) of an image.
    channels : int
        Values of a voxel.
    device : torch.device
        Where tiles are computed. On a CPU they are computed by several threads at once.
    """

    edge: tuple[int, int, int]
    channels: int
    device: torch.device

    def __call__(self, index: tuple[int, int, int]) -> Field:
        """Return the tile at ``index``, voxels from index · edge on; shape (channels, *edge)."""


class Box(NamedTuple):
    """A part of a window."""

    start: tuple[int, int, int]
    shape: tuple[int, int, int]

    @property
    def slices(self) -> tuple[slice, slice, slice]:
        """The part as an index of the window."""
        z, y, x = (slice(a, a + n) for a, n in zip(self.start, self.shape, strict=True))
        return (z, y, x)


def blocks(shape: Sequence[int], edge: int) -> list[Box]:
    """Cut a window into blocks of at most this edge, in the order of memory."""
    ranges = [range(0, n, edge) for n in shape]
    return [
        Box(corner, tuple(min(edge, n - c) for c, n in zip(corner, shape, strict=True)))  # type: ignore[arg-type]
        for corner in itertools.product(*ranges)
    ]


def assemble(
    tiles: Tiles,
    start: Sequence[int],
    shape: Sequence[int],
    *,
    domain: npt.NDArray[np.bool_] | None = None,
    threads: int = 0,
    progress: Callable[[float], object] | None = None,
) -> Field:
    """Return a window of the field.

    Parameters
    ----------
    tiles : Tiles
        The field.
    start : (int, int, int)
        First voxel of the window, any integers.
    shape : (int, int, int)
        Voxels along each axis.
    domain : numpy.ndarray of bool, optional
        The voxels that matter, of the window's shape: tiles without any are not computed, but 0.
    threads : int, default 0
        Tiles that are computed at once on a CPU; 0 takes all cores.
    progress : callable, optional
        Called with the share of the tiles that are done. An exception in it stops the work.

    Returns
    -------
    numpy.ndarray
        Shape (channels, *shape).

    Raises
    ------
    MemoryEstimateError
        If the device has too little memory for a tile.

    Notes
    -----
    Peak memory: the window, and what the tiles need that are computed at once.
    """
    # Of zeros the system makes pages only where a tile is written.
    out = np.zeros((tiles.channels, *shape), np.float32)
    ranges = [
        range(a // e, -((a + n) // -e)) for a, n, e in zip(start, shape, tiles.edge, strict=True)
    ]
    indices = [(z, y, x) for z, y, x in itertools.product(*ranges)]
    places = {index: _overlap(index, tiles.edge, start, shape) for index in indices}
    if domain is not None:
        indices = [index for index in indices if domain[places[index][1]].any()]
    for done, (index, tile) in enumerate(_computed(tiles, indices, threads), 1):
        inside, target = places[index]
        for channel, values in zip(out, tile, strict=True):
            channel[target] = values[inside]
        if progress is not None:
            progress(done / len(indices))
    return out


def _overlap(
    index: Sequence[int], edge: Sequence[int], start: Sequence[int], shape: Sequence[int]
) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    """Return where a tile and a window overlap, seen from the tile and from the window."""
    inside, target = [], []
    for i, e, a, n in zip(index, edge, start, shape, strict=True):
        first, last = max(i * e, a), min((i + 1) * e, a + n)
        inside.append(slice(first - i * e, last - i * e))
        target.append(slice(first - a, last - a))
    return tuple(inside), tuple(target)


def _computed(
    tiles: Tiles, indices: list[tuple[int, int, int]], threads: int
) -> Iterator[tuple[tuple[int, int, int], Field]]:
    """Give each tile, in order; at most two a thread are under way or waiting."""

    def compute(index: tuple[int, int, int]) -> Field:
        with torch.inference_mode(), explained_memory(tiles.device, remedy):
            return tiles(index)

    def remedy() -> str:
        less = "fewer threads need" if tiles.device.type == "cpu" else "device = cpu needs"
        return f"a tile of {' × '.join(map(str, tiles.edge))} voxels; {less} less of it"

    if tiles.device.type != "cpu":
        for index in indices:
            yield index, compute(index)
        return

    with _alone() as cores, ThreadPoolExecutor(workers := threads or cores) as pool:
        waiting: deque[tuple[tuple[int, int, int], Future[Field]]] = deque()
        try:
            for index in indices:
                waiting.append((index, pool.submit(compute, index)))
                if len(waiting) == 2 * workers:
                    first, future = waiting.popleft()
                    yield first, future.result()
            while waiting:
                first, future = waiting.popleft()
                yield first, future.result()
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


@contextmanager
def _alone() -> Iterator[int]:
    """Let every thread compute by itself; give how many PyTorch would have taken."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield before
    finally:
        torch.set_num_threads(before)
