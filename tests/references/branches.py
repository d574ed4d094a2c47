"""Branches taken out of a phase, voxel by voxel as it is told, for volumes of some voxels."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

BEYOND, PLATE, REST, FEW = 2.0, 3.0, 0.25, 100
ALL = np.ones((3, 3, 3))
FACES = [(-1, 0, 0), (0, -1, 0), (0, 0, -1), (0, 0, 1), (0, 1, 0), (1, 0, 0)]
EIGHTEEN = ndimage.generate_binary_structure(3, 2)


def simple(phase: np.ndarray, at: tuple[int, ...]) -> bool:
    """Whether a voxel of a padded phase may go: one piece of solid and one of void touch it."""
    box = phase[tuple(slice(i - 1, i + 2) for i in at)].copy()
    box[1, 1, 1] = False
    void = ~box & EIGHTEEN
    void[1, 1, 1] = False
    pieces, _ = ndimage.label(void)
    touching = {int(pieces[tuple(1 + np.array(step))]) for step in FACES} - {0}
    return ndimage.label(box, ALL)[1] == 1 and len(touching) == 1


def depths(
    shape: tuple[int, ...], places: np.ndarray, radii: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """How deep each voxel lies in a ball, and in which; infinite where in none."""
    deepest = np.full(shape, np.inf, np.float32)
    which = np.full(shape, -1)
    grid = np.indices(shape)
    for number, (place, radius) in enumerate(zip(places, radii, strict=True)):
        square = ((grid - np.reshape(place, (3, 1, 1, 1))) ** 2).sum(axis=0).astype(np.float32)
        depth = square - np.float32(radius) ** 2
        better = (square <= (np.float32(radius) + np.float32(BEYOND)) ** 2) & (depth < deepest)
        deepest[better], which[better] = depth[better], number
    return deepest, which


def owned(
    phase: np.ndarray, places: np.ndarray, radii: np.ndarray, mine: np.ndarray
) -> list[tuple[int, float, tuple[int, ...]]]:
    """Place number, depth and position of the voxels of a branch, in the order in which they go."""
    deep, which = depths(phase.shape, places[mine], radii[mine])
    others = depths(phase.shape, places[~mine], radii[~mine])[0]
    side = np.where(deep < others, 1, np.where(others < np.inf, 2, 0)) * phase
    front = [tuple(int(i) for i in at) for at in np.argwhere(side > 0)]
    while front:
        following = []
        for at in front:
            for step in FACES:
                to = tuple(a + s for a, s in zip(at, step, strict=True))
                inside = all(0 <= t < n for t, n in zip(to, phase.shape, strict=True))
                if inside and phase[to] and side[to] == 0:
                    side[to], which[to], deep[to] = side[at], which[at], deep[at] + 1
                    following.append(to)
        front = following
    found = [
        (int(which[tuple(at)]), float(deep[tuple(at)]), tuple(int(i) for i in at))
        for at in np.argwhere(side == 1)
    ]
    return sorted(found, key=lambda one: (one[0], -one[1], one[2]))


def flood(
    phase: np.ndarray, start: tuple[int, ...], most: int, seen: set[tuple[int, ...]]
) -> tuple[list[tuple[int, ...]], bool]:
    """Voxels that hang together with one, until more than ``most``; whether seen ones were met."""
    piece, own, met, following = [start], {start}, False, 0
    while following < len(piece) and len(piece) <= most:
        for step in np.ndindex(3, 3, 3):
            to = tuple(a + s - 1 for a, s in zip(piece[following], step, strict=True))
            if phase[to] and to not in own:
                own.add(to)
                met |= to in seen
                seen.add(to)
                piece.append(to)
        following += 1
    return piece, met


def take_rest(phase: np.ndarray, left: list[tuple[int, ...]], whole: int) -> int | None:
    """Take a thread with what hangs on it: how many voxels; None if it holds something together."""
    seen: set[tuple[int, ...]] = set()
    for at in left:
        if at not in seen:
            seen.add(at)
            part, met = flood(phase, at, max(whole, FEW), seen)
            if len(part) <= max(whole, FEW) and not met:
                return None
    for at in left:
        phase[at] = False
    taken, large = len(left), False
    seen = set()
    for at in left:
        for step in np.ndindex(3, 3, 3):
            start = tuple(a + s - 1 for a, s in zip(at, step, strict=True))
            if start == at or not phase[start] or start in seen:
                continue
            seen.add(start)
            piece, met = flood(phase, start, max(whole, FEW), seen)
            if len(piece) <= max(whole, FEW) and not met:
                for voxel in piece:
                    phase[voxel] = False
                taken += len(piece)
            elif large and not met:
                return None
            else:
                large = True
    return taken if taken <= max(whole, FEW) else None


def prune(
    phase: np.ndarray, places: np.ndarray, radii: np.ndarray, branches: np.ndarray
) -> tuple[np.ndarray, list[int]]:
    """The phase without branches 0, 1, …, and how many voxels each lost."""
    out = np.pad(phase, 1)
    lost = []
    count = int(branches.max(initial=-1)) + 1
    chosen = [owned(phase, places, radii, branches == number) for number in range(count)]
    for number, voxels in enumerate(chosen):
        squares = radii[branches == number].astype(float) ** 2
        tube = np.pi * (squares.sum() + 4 / 3 * np.sqrt(squares.mean()) ** 3) if len(squares) else 0
        if len(voxels) > PLATE * tube:
            lost.append(0)
            continue
        before, left = out.copy(), [tuple(i + 1 for i in voxel[2]) for voxel in voxels]
        while True:
            still = []
            for at in left:
                if simple(out, at):
                    out[at] = False
                else:
                    still.append(at)
            if len(still) == len(left):
                break
            left = still
        rest = take_rest(out, left, len(voxels)) if len(left) <= REST * len(voxels) else None
        if rest is None:
            out = before
            lost.append(0)
        else:
            lost.append(len(voxels) - len(left) + rest)
    return out[1:-1, 1:-1, 1:-1], lost
