"""The search phase of an iteration in mid-synthesis: for each window of the output one that fits.

All get the same descriptors of the windows of an exemplar half as wide as the output, and of every
fourth window of the output along each axis; ours alone knows what the iteration before found. The
run penalty is left out: no library knows such a thing. Times include building, which trees and
graphs are spared in later iterations: queries a second are told without it. "rms" is the root mean
square distance of what is found to what is looked for, in units of the exact search's.
"""

from __future__ import annotations

import functools
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from race import Race
from scipy.spatial import cKDTree

import poresynth
from poresynth import _core, exemplars

WINDOW, STEP = 8, 4
EF = 16  # candidates that a graph's search keeps; enough for results as good as the exact ones
LEADING = 8  # components that a kd-tree is still quick with
Found = tuple[np.ndarray, float]


def halfway(edge: int, components: int, variance: float) -> list[np.ndarray]:
    """Descriptors, queries, matches of the iteration before, squared distances of the best."""
    solid = exemplars.spinodal((max(edge // 2, 32),) * 3, seed=1)
    # Half of the preset's iterations: the energy is on its way down.
    engine = poresynth.VolumeTexture(preset="fast", windows=(WINDOW,), iterations=3).fit(solid)
    exemplar = engine._field(solid.array, engine._phases.phase)
    shape = (2 * len(solid.array),) * 3
    volume, [match_map], _ = _core.synthesize(
        [engine._example(exemplar)], shape, engine._options("open"), seed=0
    )
    descriptors, queries = _core.describe_windows(
        exemplar, volume, window=WINDOW, step=STEP, components=components, variance=variance, seed=0
    )
    before = nearest_sites(match_map, queries.shape[:3], descriptors.shape[:3])
    points, sought = rows(descriptors, queries)
    best, _ = cKDTree(points).query(sought, workers=-1)
    return [descriptors, queries, before, best**2]


def nearest_sites(
    match_map: _core.MatchMap, sites: tuple[int, ...], grid: tuple[int, ...]
) -> np.ndarray:
    """Positions of the matches of the nearest sites of a shifted lattice, continued to here."""
    origins = [STEP * np.arange(n) for n in sites]
    near = [
        np.abs(theirs - own[:, None]).argmin(1)
        for own, theirs in zip(origins, match_map.origins, strict=True)
    ]
    steps = [own - o[i] for own, o, i in zip(origins, match_map.origins, near, strict=True)]
    found = match_map.matches[np.ix_(*near)][..., 1:] + np.stack(
        np.meshgrid(*steps, indexing="ij"), axis=-1
    )
    return np.ravel_multi_index(tuple(np.moveaxis(found, -1, 0)), grid, mode="clip")


def rows(*windows: np.ndarray) -> list[np.ndarray]:
    """What a library gets: a window a row, without the zeros that fill ours up."""
    used = windows[0].any(axis=(0, 1, 2))
    return [np.float32(each[..., used].reshape(-1, used.sum())) for each in windows]


def remark(inputs: list[np.ndarray], found: Found, seconds: float) -> str:
    descriptors, queries, _, best = inputs
    positions, building = found
    matches = descriptors.reshape(-1, descriptors.shape[-1])[np.int64(positions.ravel())]
    squares = (matches.astype(np.int64) - queries.reshape(matches.shape)) ** 2
    rms = np.sqrt(squares.sum() / best.sum())
    return f"{len(matches) / (seconds - building) / 1000:,.1f} k queries/s, rms {rms:.2f}"


RACES = [
    Race(
        f"search phase, windows of {WINDOW}, {name}",
        functools.partial(halfway, components=32, variance=variance),
        sizes=(128,),
        large=(),
        remark=remark,
    )
    for name, variance in (("95 % of the variance", 0.95), ("32 components", 1.0))
]


def ours(inputs: tuple[np.ndarray, ...], search: str, threads: int = 0) -> Found:
    options = {"step": STEP, "search": search, "candidates": 10, "seed": 1, "threads": threads}
    return _core.match_windows(*inputs[:3], **options), 0.0


def theirs(
    descriptors: np.ndarray,
    queries: np.ndarray,
    build: Callable[[np.ndarray], Any],
    query: Callable[[Any, np.ndarray], np.ndarray],
) -> Found:
    """What an index of a library finds, and the seconds that it took to build."""
    start = time.perf_counter()
    points, sought = rows(descriptors, queries)
    index = build(points)
    building = time.perf_counter() - start
    return query(index, sought), building


for race in RACES:

    @race.contestant("poresynth")
    def _(*inputs: np.ndarray, threads: int = 0) -> Found:
        return ours(inputs, "coherent", threads)

    @race.contestant('poresynth, search="kd_tree"', "poresynth")
    def _(*inputs: np.ndarray) -> Found:
        return ours(inputs, "kd_tree")

    @race.contestant('poresynth, search="brute_force"', "poresynth")
    def _(*inputs: np.ndarray) -> Found:
        return ours(inputs, "brute_force")

    @race.contestant("scipy, cKDTree", "scipy")
    def _(descriptors: np.ndarray, queries: np.ndarray, *_: np.ndarray) -> Found:
        return theirs(descriptors, queries, cKDTree, lambda tree, x: tree.query(x, workers=-1)[1])

    @race.contestant("scipy, cKDTree, eps=1", "scipy")
    def _(descriptors: np.ndarray, queries: np.ndarray, *_: np.ndarray) -> Found:
        def query(tree: cKDTree, x: np.ndarray) -> np.ndarray:
            return tree.query(x, eps=1, workers=-1)[1]

        return theirs(descriptors, queries, cKDTree, query)

    @race.contestant(f"scipy, cKDTree, {LEADING} components", "scipy")
    def _(descriptors: np.ndarray, queries: np.ndarray, *_: np.ndarray) -> Found:
        leading = (windows[..., :LEADING] for windows in (descriptors, queries))
        return theirs(*leading, cKDTree, lambda tree, x: tree.query(x, workers=-1)[1])

    @race.contestant("scikit-learn, NearestNeighbors", "scikit-learn")
    def _(descriptors: np.ndarray, queries: np.ndarray, *_: np.ndarray) -> Found:
        from sklearn.neighbors import NearestNeighbors

        build = NearestNeighbors(n_neighbors=1, n_jobs=-1).fit
        return theirs(descriptors, queries, build, lambda index, x: index.kneighbors(x)[1])

    @race.contestant("faiss, IndexFlatL2", "faiss-cpu")
    def _(descriptors: np.ndarray, queries: np.ndarray, *_: np.ndarray) -> Found:
        def build(points: np.ndarray) -> Any:
            import faiss

            index = faiss.IndexFlatL2(points.shape[1])
            index.add(points)
            return index

        return theirs(descriptors, queries, build, lambda index, x: index.search(x, 1)[1])

    @race.contestant(f"faiss, IndexHNSWFlat, ef {EF}", "faiss-cpu")
    def _(descriptors: np.ndarray, queries: np.ndarray, *_: np.ndarray) -> Found:
        def build(points: np.ndarray) -> Any:
            import faiss

            index = faiss.IndexHNSWFlat(points.shape[1], 16)
            index.hnsw.efSearch = EF
            index.add(points)
            return index

        return theirs(descriptors, queries, build, lambda index, x: index.search(x, 1)[1])

    @race.contestant(f"hnswlib, ef {EF}", "hnswlib")
    def _(descriptors: np.ndarray, queries: np.ndarray, *_: np.ndarray) -> Found:
        def build(points: np.ndarray) -> Any:
            import hnswlib

            index = hnswlib.Index("l2", points.shape[1])
            index.init_index(len(points))
            index.add_items(points)
            index.set_ef(EF)
            return index

        return theirs(descriptors, queries, build, lambda index, x: index.knn_query(x, 1)[0])
