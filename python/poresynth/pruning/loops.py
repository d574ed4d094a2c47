"""Loops of a network that may be opened."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

__all__ = ["Loops"]


class Loops:
    """Which branches of a graph may go without parting it.

    Parameters
    ----------
    ends : numpy.ndarray of int64
        Nodes at the ends of the branches, shape (m, 2).
    nodes : int
        Number of nodes.
    """

    def __init__(self, ends: npt.NDArray[np.int64], nodes: int) -> None:
        self._ends, self._nodes = ends, nodes
        self._left = np.ones(len(ends), bool)

    def may_lose(self, branch: int) -> bool:
        """Return whether the ends of a branch hang together without it."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import breadth_first_order

        keep = self._left.copy()
        keep[branch] = False
        first, last = self._ends[branch]
        ends = self._ends[keep]
        links = coo_array((np.ones(len(ends), bool), tuple(ends.T)), (self._nodes, self._nodes))
        reached = breadth_first_order(
            links.tocsr(), first, directed=False, return_predecessors=False
        )
        return bool(np.isin(last, reached)) and first != last

    def lose(self, branch: int) -> None:
        """Take a branch out."""
        self._left[branch] = False
