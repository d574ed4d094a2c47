"""The shortest loop through a node, by leaving out each of its branches in turn."""

from __future__ import annotations

from collections.abc import Sequence

import networkx
import numpy as np


def perimeter(ends: Sequence[tuple[int, int]], lengths: Sequence[float], node: int) -> float:
    """Shortest way from one end of a branch at the node to the other, without that branch."""
    best = np.inf
    for out, (a, b) in enumerate(ends):
        if node not in (a, b):
            continue
        graph = networkx.Graph()
        graph.add_nodes_from((a, b))
        for i, ((c, d), length) in enumerate(zip(ends, lengths, strict=True)):
            old = graph.get_edge_data(c, d, {"weight": np.inf})["weight"]
            if i != out:
                graph.add_edge(c, d, weight=min(old, length))
        try:
            best = min(best, lengths[out] + networkx.dijkstra_path_length(graph, a, b))
        except networkx.NetworkXNoPath:
            continue
    return float(best)
