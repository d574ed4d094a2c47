"""Connected components: how many, how large, how alike."""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from poresynth import _core
from poresynth.metrics.arguments import PhaseLike, as_phase
from poresynth.metrics.wasserstein import wasserstein

__all__ = [
    "FLOATING",
    "Components",
    "component_sizes",
    "component_wasserstein",
    "components",
    "floating_parts",
    "label",
    "largest_component_fraction",
    "largest_share",
    "size_distance",
]

Boundary = Literal["open", "periodic"]
Connectivity = Literal[6, 18, 26]

FLOATING = 10
"""A component of fewer voxels floats (scaffoldgan_2021 §6.2)."""


class Components(NamedTuple):
    """Labelled components.

    Attributes
    ----------
    labels : numpy.ndarray of uint32
        Shape (z, y, x); 0 outside the phase, else 1, 2, … in C order of the components' first
        voxels.
    sizes : numpy.ndarray of uint64
        Voxels of components 1, 2, …, shape (n,).
    """

    labels: npt.NDArray[np.uint32]
    sizes: npt.NDArray[np.uint64]


def label(
    solid: PhaseLike,
    *,
    connectivity: Connectivity = 26,
    boundary: Boundary = "open",
    threads: int = 0,
) -> Components:
    """Label the connected components of a phase.

    Parameters
    ----------
    solid : Volume or array_like
        The phase, shape (z, y, x): bool, or at most 16 values of which 0 is not in it.
    connectivity : {26, 18, 6}, default 26
        Neighbours that touch: those that share a corner, an edge or a face. If the solid is
        measured with 26, its pore goes with 6.
    boundary : {"open", "periodic"}, default "open"
        Whether components go on at the opposite face.
    threads : int, default 0
        Number of threads; 0 takes all cores. The labels do not depend on it.

    Returns
    -------
    Components
        Labels, in the memory order of the phase, and sizes.

    Raises
    ------
    ParameterError
        If a parameter is outside its range.

    Notes
    -----
    Peak memory: 33 bits a voxel (32 for the labels) and 12 bytes a run of voxels along the rows.
    """
    return Components(
        *_core.label(as_phase(solid), connectivity=connectivity, boundary=boundary, threads=threads)
    )


def component_sizes(
    solid: PhaseLike,
    *,
    connectivity: Connectivity = 26,
    boundary: Boundary = "open",
    threads: int = 0,
) -> npt.NDArray[np.uint64]:
    """Return the sizes of the connected components of a phase, without labelling the voxels.

    Parameters
    ----------
    solid, connectivity, boundary, threads
        As for `label`.

    Returns
    -------
    numpy.ndarray of uint64
        Voxels of each component, in C order of their first voxels, shape (n,).

    Raises
    ------
    ParameterError
        If a parameter is outside its range.

    Notes
    -----
    Peak memory: 1 bit a voxel and 12 bytes a run of voxels along the rows.
    """
    phase = as_phase(solid)
    return _core.component_sizes(
        phase, connectivity=connectivity, boundary=boundary, threads=threads
    )


def components(
    solid: PhaseLike, *, connectivity: Connectivity = 26, boundary: Boundary = "open"
) -> int:
    """Count the connected components of a phase: N_cc of scaffoldgan_2021, Table 1.

    Parameters
    ----------
    solid, connectivity, boundary
        As for `label`.

    Returns
    -------
    int

    Raises
    ------
    ParameterError
        If a parameter is outside its range.
    """
    return len(component_sizes(solid, connectivity=connectivity, boundary=boundary))


def floating_parts(
    solid: PhaseLike, *, connectivity: Connectivity = 26, boundary: Boundary = "open"
) -> int:
    """Count the components of fewer than 10 voxels: N_f of scaffoldgan_2021, Table 1.

    Parameters
    ----------
    solid, connectivity, boundary
        As for `label`.

    Returns
    -------
    int

    Raises
    ------
    ParameterError
        If a parameter is outside its range.
    """
    sizes = component_sizes(solid, connectivity=connectivity, boundary=boundary)
    return int(np.count_nonzero(sizes < FLOATING))


def largest_component_fraction(
    solid: PhaseLike, *, connectivity: Connectivity = 26, boundary: Boundary = "open"
) -> float:
    """Return the share of a phase that is in its largest component: 1 if all of it hangs together.

    Parameters
    ----------
    solid, connectivity, boundary
        As for `label`.

    Returns
    -------
    float
        0 to 1; 0 for an empty phase.

    Raises
    ------
    ParameterError
        If a parameter is outside its range.
    """
    sizes = component_sizes(solid, connectivity=connectivity, boundary=boundary)
    return largest_share(sizes)


def largest_share(sizes: npt.NDArray[np.uint64]) -> float:
    """Return the share of the voxels in the largest of components of these sizes; 0 for none."""
    return float(sizes.max() / sizes.sum()) if len(sizes) else 0.0


def component_wasserstein(
    exemplar: PhaseLike,
    volume: PhaseLike,
    *,
    connectivity: Connectivity = 26,
    boundary: Boundary = "open",
) -> float:
    """Return how differently voxels are grouped into components: D_w of scaffoldgan_2021, Eq. 5.

    The 1-Wasserstein distance between the sizes of the components of two volumes, each size as a
    percentage of its volume and each component counting alike.

    Parameters
    ----------
    exemplar, volume : Volume or array_like
        The phase in the two volumes, shapes (z, y, x), as for `label`.
    connectivity, boundary
        As for `label`.

    Returns
    -------
    float
        In percent of a volume: 1 means that components of the same rank (quantile of size) differ
        by 1 % of the volume on average.

    Raises
    ------
    ParameterError
        If a parameter is outside its range.

    Notes
    -----
    The paper leaves the weights open; equal weights and percentages reproduce the size of its
    values (Table 1: 1.5 to 5.2). A giant component is one component among the others, with the
    weight 1 / N_cc: the distance is at least |φ_a / N_a − φ_b / N_b|, where φ is the phase in
    percent, so that it mostly compares the number of specks per giant. Specks grow in number with
    the volume while the giant stays one: compare volumes of one size. A volume without the phase
    counts as one component of size 0.
    """
    sizes, shares = [], []
    for name, phase in (("exemplar", exemplar), ("volume", volume)):
        array = as_phase(phase, name)
        found = component_sizes(array, connectivity=connectivity, boundary=boundary)
        sizes.append(found)
        shares.append(100 * found / array.size)
    return size_distance(*shares)


def size_distance(a: npt.NDArray[Any], b: npt.NDArray[Any]) -> float:
    """Return `component_wasserstein` of sizes in percent, shapes (n,) and (m,)."""
    a, b = (np.append(sizes, [] if len(sizes) else [0.0]) for sizes in (a, b))
    positions, index = np.unique(np.concatenate([a, b]), return_inverse=True)
    weights = [np.bincount(i, minlength=len(positions)) for i in (index[: len(a)], index[len(a) :])]
    return wasserstein(positions, *weights)
