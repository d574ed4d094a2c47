"""A solid while it is pruned: each step, and the record of what it did."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from poresynth import _core
from poresynth.metrics import component_sizes, euler_density, label
from poresynth.metrics.connectivity import FLOATING
from poresynth.pruning.connecting import connect
from poresynth.pruning.cut import Cut
from poresynth.pruning.elongation import Growth, Stock, grow
from poresynth.pruning.loops import Loops
from poresynth.pruning.pores import closed_pores, open_path
from poresynth.pruning.record import Edit, EditKind, Standing
from poresynth.pruning.spurs import Network, Spurs

__all__ = ["Work"]

_Bools = npt.NDArray[np.bool_]

SMOOTHING = 1.0
"""Blur of the solid, voxels, that says where the surface moves to restore the porosity: it fills
notches and takes ridges, so that no new branches start."""
FARTHEST = 48.0
"""Voxels beyond which no strut is looked for."""


@dataclass(eq=False)
class Work:
    """A solid while it is pruned."""

    solid: _Bools
    free: _Bools | None
    voxel_size: tuple[float, float, float]
    boundary: Literal["open", "periodic"]
    inside: npt.NDArray[np.float32] | None
    threads: int
    edits: list[Edit] = field(default_factory=list)
    growths: list[Growth] = field(default_factory=list)
    loose: int = 0
    best: tuple[int, _Bools, int, int] | None = None

    def mend_parts(self, parts: str) -> None:
        """Join or remove the parts that float."""
        if parts == "keep":
            return
        found = label(self.solid, boundary=self.boundary, threads=self.threads)
        if len(found.sizes) < 2:
            return
        most = self.solid.size if parts == "remove" else FLOATING
        joined = connect(
            self.solid,
            self._score(),
            "solid",
            smallest=most,
            boundary=self.boundary,
            free=self.free,
            threads=self.threads,
        )
        first = _first_places(found.labels, len(found.sizes))
        largest = int(np.argmax(found.sizes)) + 1
        for part, (size, place) in enumerate(zip(found.sizes, first, strict=True), 1):
            if part != largest:
                kind: EditKind = "part removed" if size < most else "part joined"
                self.edits.append(Edit(kind, place, int(size)))
        self._surface(self.solid, joined.solid)
        self.solid = joined.solid

    def prune_branches(self, theta: float, goal: Standing | None, stock: Stock | None) -> bool:
        """Remove or grow loose ends; return whether anything changed."""
        network = Network.of(self.solid, self.voxel_size, threads=self.threads)
        spurs = Spurs.of(network, inside=self.inside, threads=self.threads)
        if not self._better(len(spurs.paths)):
            return False
        count, grown = len(spurs.paths), len(spurs.paths)
        if goal is not None:
            now = self.standing(network.skeleton)
            if now.end_point_density > 0:
                excess = 1 - goal.end_point_density / now.end_point_density
                count = round(max(excess, 0) * count)
            grown = round((now.euler_density - goal.euler_density) * self._material())
        short = spurs.ratio < theta
        removed = [i for i in range(count) if short[i]]
        stock = Stock.of(self.solid, network) if stock is None else stock
        self.loose = 0
        changed = False
        scale = float(np.mean(self.voxel_size))
        for i in (i for i in range(count) if not short[i]):
            if grown <= 0:
                removed.append(i)
                continue
            reach = min(spurs.perimeter[i] / (np.pi * scale), FARTHEST)
            growth = grow(self.solid, network, spurs.paths[i], reach, stock, self.free)
            if growth is None:
                self.loose += 1
                continue
            self.solid[tuple(growth.voxels.T)] = True
            self.growths.append(growth)
            self._note("branch elongated", spurs, i, len(growth.voxels))
            grown -= 1
            changed = True
        if removed:
            paths = [spurs.paths[i] for i in removed]
            self.solid, lost = network.without(
                self.solid, paths, "prune", self.free, threads=self.threads
            )
            for i, voxels in zip(removed, lost, strict=True):
                if voxels:
                    self._note("branch removed", spurs, i, int(voxels))
                    changed = True
        return changed

    def _better(self, spurs: int) -> bool:
        """Keep a state that has fewer loose ends than those before; go back to the best if not."""
        if self.best is not None and spurs >= self.best[0]:
            _, self.solid, edits, growths = self.best
            del self.edits[edits:], self.growths[growths:]
            return False
        self.best = (spurs, self.solid.copy(), len(self.edits), len(self.growths))
        return True

    def cut_loops(self, goal: Standing) -> None:
        """Cut as many loops as the exemplar has less, at their thinnest branches."""
        density = euler_density(self.solid, boundary=self.boundary, threads=self.threads).density
        density *= self.solid.size / self._material()
        missing = round((goal.euler_density - density) * self._material())
        if missing <= 0:
            return
        network = Network.of(self.solid, self.voxel_size, threads=self.threads)
        graph = network.graph
        inner = [int(branch) for branch in np.flatnonzero(graph.branches.type == 2)]
        paths = {branch: graph.path(branch) for branch in inner}
        radius = [
            float(network.radius[tuple(p.T)].mean()) if len(p) >= 3 else np.inf
            for p in paths.values()
        ]
        loops = Loops(graph.branches.nodes, len(graph.nodes.kind))
        chosen: list[int] = []
        for i in np.argsort(radius, kind="stable"):
            if len(chosen) == missing or radius[i] == np.inf:
                break
            if loops.may_lose(inner[i]):
                loops.lose(inner[i])
                chosen.append(inner[i])
        parts = self._parts(self.solid)
        # All at once; one by one where the voxels hang together less than their skeleton.
        if not self._cut(network, {branch: paths[branch] for branch in chosen}, parts):
            for branch in chosen:
                self._cut(network, {branch: paths[branch]}, parts)

    def _cut(self, network: Network, paths: dict[int, npt.NDArray[np.uint32]], parts: int) -> bool:
        """Cut branches unless that makes more parts; return whether it was done."""
        cut, lost = network.without(
            self.solid, list(paths.values()), "cut", self.free, threads=self.threads
        )
        if self._parts(cut) != parts:
            return False
        self.solid = cut
        for (branch, path), voxels in zip(paths.items(), lost, strict=True):
            if voxels:
                z, y, x = (int(i) for i in path[len(path) // 2])
                length = float(network.graph.branches.length[branch])
                self.edits.append(Edit("loop cut", (z, y, x), int(voxels), length))
        return True

    def fill_new_pores(self, before: _Bools) -> None:
        """Fill what grown branches enclosed: it was open before."""
        labels, closed = closed_pores(self.solid, threads=self.threads)
        old_labels, old = closed_pores(before, threads=self.threads)
        was_closed = np.isin(old_labels, old)
        kept = np.unique(labels[was_closed])
        self._fill(labels, np.setdiff1d(closed, kept))

    def close_pores(self) -> None:
        """Fill the pores that do not reach the border."""
        self._fill(*closed_pores(self.solid, threads=self.threads))

    def _fill(self, labels: npt.NDArray[np.uint32], closed: npt.NDArray[np.int64]) -> None:
        fill = np.isin(labels, closed)
        if self.free is not None:
            fill &= self.free
        places = _first_places(labels, int(labels.max()))
        sizes = np.bincount(labels[fill], minlength=len(places) + 1)
        for number in closed:
            if sizes[number]:
                self.edits.append(Edit("pore closed", places[number - 1], int(sizes[number])))
        self.solid |= fill

    def open_axis(self, axis: int) -> None:
        """Open a way for the pore along an axis."""
        opened = open_path(self.solid, self._score(), axis, 3.0, self.free, threads=self.threads)
        taken = self.solid & ~opened
        if taken.any():
            place = tuple(int(i) for i in np.argwhere(taken)[0])
            self.edits.append(Edit("pore opened", place, int(taken.sum())))  # type: ignore[arg-type]
            self.solid = opened

    def restore(self, wanted: int) -> None:
        """Move the surface until the solid has its former number of voxels."""
        moved, _ = _core.recount_phase(
            self.solid,
            self._score(),
            wanted,
            connectivity=26,
            boundary=self.boundary,
            free=self.free,
            threads=self.threads,
        )
        self._surface(self.solid, moved)
        self.solid = moved

    def paint_growth(self, values: npt.NDArray[Any], source: npt.NDArray[Any], cut: Cut) -> None:
        """Give grown branches the values of those that they were copied from."""
        for growth in self.growths:
            places = np.concatenate([growth.voxels, growth.skin])
            copied = source[tuple(growth.source.T)]
            fits = cut.solid(copied[None, None])[0, 0] == self.solid[tuple(places.T)]
            values[tuple(places[fits].T)] = copied[fits]

    def _parts(self, solid: _Bools) -> int:
        return len(component_sizes(solid, boundary=self.boundary, threads=self.threads))

    def _material(self) -> int:
        return self.solid.size if self.inside is None else int(np.count_nonzero(self.inside))

    def standing(self, skeleton: _Bools | None = None) -> Standing:
        """Measure the solid as it is now; its skeleton need not be made anew where it is known."""
        return Standing.of(
            self.solid,
            boundary=self.boundary,
            inside=self.inside,
            skeleton=skeleton,
            threads=self.threads,
        )

    def _score(self) -> npt.NDArray[np.float32]:
        """Return how far inside the solid a voxel lies, for bridges and for the surface."""
        from scipy.ndimage import gaussian_filter

        score = self.solid.astype(np.float32)
        gaussian_filter(score, SMOOTHING, output=score, mode="nearest")
        score -= 0.5
        return score

    def _surface(self, before: _Bools, after: _Bools) -> None:
        moved = np.argwhere(before != after)
        if len(moved):
            z, y, x = (int(i) for i in moved[0])
            self.edits.append(Edit("surface moved", (z, y, x), len(moved)))

    def _note(self, kind: EditKind, spurs: Spurs, number: int, voxels: int) -> None:
        z, y, x = (int(i) for i in spurs.paths[number][0])
        perimeter = float(spurs.perimeter[number])
        known = perimeter if np.isfinite(perimeter) else None
        self.edits.append(Edit(kind, (z, y, x), voxels, float(spurs.length[number]), known))


def _first_places(labels: npt.NDArray[np.uint32], count: int) -> list[tuple[int, int, int]]:
    """Return the first voxel of each of the labels 1 to ``count``."""
    flat = labels.ravel()
    first = np.full(count + 1, 0, np.int64)
    at = np.flatnonzero(flat)[::-1]
    first[flat[at]] = at
    places = np.stack(np.unravel_index(first[1:], labels.shape), axis=1)
    return [(int(z), int(y), int(x)) for z, y, x in places]
