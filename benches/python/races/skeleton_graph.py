"""The graph of a skeleton of blobs, with a table of its branches."""

from __future__ import annotations

import warnings

import numpy as np
from inputs import blobs
from race import Race

import poresynth.metrics

race = Race(
    "graph of a skeleton",
    lambda edge: [poresynth.metrics.skeletonize(blobs(edge))],
    # skan counts each voxel of a junction as a node: components are what must agree.
    lambda ours, theirs: ours == theirs,
)


@race.contestant("poresynth")
def _(skeleton: np.ndarray, threads: int = 0) -> int:
    table = poresynth.metrics.skeleton_graph(skeleton, threads=threads).to_table()
    return len(np.unique(table["skeleton-id"]))


@race.contestant("skan")
def _(skeleton: np.ndarray) -> int:
    import skan

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # its own, of pandas
        table = skan.summarize(skan.Skeleton(skeleton), separator="-")
    return table["skeleton-id"].nunique()
