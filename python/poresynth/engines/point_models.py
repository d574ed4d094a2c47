"""Models of stochastic geometry: what lies between random points, as struts and grains do."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import KDTree

__all__ = ["PointModel", "models", "nearest", "points"]

_SAMPLES = 30
"""Random places for each point by which the middle of its cell is found."""


def models(axes: int) -> dict[str, list[float]]:
    """Return weights of the distances to the nearest points, by what is where their sum is high."""

    def nearest_less(first: int, last: int) -> list[float]:
        """Return the weights of the nearest less the mean of these others."""
        count = last - first + 1
        return [1.0, *[-(first <= k <= last) / count for k in range(2, axes + 2)]]

    found = {
        "balls around points": [-1.0, *[0.0] * axes],
        "corners of cells": nearest_less(axes + 1, axes + 1),
        "edges of cells": nearest_less(axes, axes),
        "edges and corners of cells": nearest_less(2, axes + 1),
    }
    if axes == 3:
        found["faces of cells"] = nearest_less(2, 2)
        found["edges and faces of cells"] = nearest_less(2, 3)
        found["broad edges of cells"] = [0.5, 0.5, -1.0, 0.0]
    return found


@dataclass(frozen=True)
class PointModel:
    """A sum of the distances to the nearest of random points, in space that repeats.

    Attributes
    ----------
    name : str
        One of `models`.
    sign : int
        1: where the sum is high, the solid is; −1: all but that.
    spacing : float
        Edge of a cube of which there is one for each point, pixels.
    relaxed : int
        How often each point moves to the middle of its Voronoi cell (Lloyd): the more, the more
        are cells alike.
    """

    name: str
    sign: int
    spacing: float
    relaxed: int

    def words(self) -> str:
        """Say what it is in a few words."""
        but = "" if self.sign > 0 else "all but "
        often = {0: "random points", 1: "points relaxed once"}
        points = often.get(self.relaxed, f"points relaxed {self.relaxed} times")
        return f"{but}{self.name}, {self.spacing:.0f} pixels apart, of {points}"

    def field(
        self, shape: tuple[int, int, int], scale: int, seed: int, threads: int = 0
    ) -> npt.NDArray[np.float32]:
        """Return the sum at the middles of the voxels of a box that repeats, shape (1, z, y, x).

        Parameters
        ----------
        shape : (int, int, int)
            Voxels along (z, y, x).
        scale : int
            Edge of a voxel, pixels.
        seed : int
            Same seed, same points.
        threads : int, default 0
            0 takes all cores.
        """
        box = scale * np.array(shape, dtype=float)
        tree = KDTree(points(box, self.spacing, self.relaxed, seed, threads), boxsize=box)
        middles = [(np.arange(n) + 0.5) * scale for n in shape]
        out = np.empty((1, *shape), np.float32)
        # Plane by plane: distances take 16 times as much memory as what becomes of them.
        for z, plane in zip(middles[0], out[0], strict=True):
            at = np.stack(np.meshgrid(z, *middles[1:], indexing="ij"), axis=-1)[0]
            plane[:] = self.total(nearest(tree, at, threads))
        return out

    def total(self, distances: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Return the sum of distances of shape (…, point)."""
        weights = self.sign * np.array(models(3)[self.name])
        return np.asarray(distances @ weights, dtype=np.float64)


def nearest(tree: KDTree, at: npt.NDArray[np.float64], threads: int = 0) -> npt.NDArray[np.float64]:
    """Return the distances from places (…, axis) to the four nearest points, ascending."""
    found, _ = tree.query(at, 4, workers=threads or -1)
    return np.asarray(found)


def points(
    box: npt.NDArray[np.float64], spacing: float, relaxed: int, seed: int, threads: int = 0
) -> npt.NDArray[np.float64]:
    """Return random points of a box that repeats, moved to the middles of their cells."""
    random = np.random.default_rng(seed)
    # As many as distances are asked for, at least.
    count = max(4, round(float(np.prod(box / spacing))))
    placed = random.random((count, 3)) * box
    for _ in range(relaxed):
        samples = random.random((_SAMPLES * count, 3)) * box
        _, own = KDTree(placed, boxsize=box).query(samples, workers=threads or -1)
        away = (samples - placed[own] + box / 2) % box - box / 2
        sums = np.stack([np.bincount(own, away[:, axis], count) for axis in range(3)], axis=1)
        placed = (placed + sums / np.maximum(np.bincount(own, minlength=count), 1)[:, None]) % box
    return placed
