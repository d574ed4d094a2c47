"""Tortuosity factor of the pore to 1 %, open boundary."""

from __future__ import annotations

import numpy as np
from inputs import blobs
from race import Race

from poresynth.metrics import effective_diffusivity

race = Race(
    "tortuosity factor",
    lambda edge: [blobs(edge)],
    lambda ours, theirs: abs(theirs / ours - 1) < 0.02,
    sizes=(128,),
    large=(200,),
)


@race.contestant("poresynth")
def _(solid: np.ndarray, threads: int = 0) -> float:
    return effective_diffusivity(solid, threads=threads).tortuosity


@race.contestant("TauFactor", "taufactor")
def _(solid: np.ndarray) -> float:
    import taufactor

    solver = taufactor.Solver((~solid).astype(np.uint8), device="cpu")
    return float(solver.solve(verbose=False)[0])


@race.contestant("scipy, conjugate gradients", "scipy")
def _(solid: np.ndarray) -> float:
    from scipy import sparse
    from scipy.sparse.linalg import cg

    pore = ~solid
    numbers = np.cumsum(pore).reshape(pore.shape) - 1
    links = []
    for axis in range(3):
        first, second = (
            np.take(a, np.arange(k, pore.shape[axis] - 1 + k), axis)
            for a in (np.where(pore, numbers, -1),)
            for k in (0, 1)
        )
        linked = (first >= 0) & (second >= 0)
        links.append(np.stack([first[linked], second[linked]]))
    a, b = np.concatenate(links, axis=1)
    n = int(pore.sum())
    ones = np.ones(len(a))
    adjacency = sparse.csr_matrix((ones, (a, b)), (n, n))
    adjacency = adjacency + adjacency.T
    held = np.zeros(n)
    inlet, outlet = numbers[0][pore[0]], numbers[-1][pore[-1]]
    np.add.at(held, inlet, 2)
    np.add.at(held, outlet, 2)
    # Voxels of closed pores have a singular block: a trace of ground makes them 0.
    diagonal = np.asarray(adjacency.sum(1)).ravel() + held + 1e-9
    right = np.zeros(n)
    right[inlet] = 2
    matrix = sparse.diags(diagonal) - adjacency
    concentration, _ = cg(matrix, right, rtol=1e-4, maxiter=5000, M=sparse.diags(1 / diagonal))
    flux = 2 * concentration[outlet].sum()
    return float(pore.mean() / (flux * pore.shape[0] / pore[0].size))
