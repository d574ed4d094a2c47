"""A phase made one piece."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from poresynth import _core
from poresynth.errors import ParameterError
from poresynth.metrics.arguments import (
    PhaseLike,
    as_mask,
    as_phase,
    as_scalar_volume,
    whole_number,
)

__all__ = ["Connected", "connect"]


@dataclass(frozen=True, eq=False)
class Connected:
    """A solid of which one phase was made one piece, and what that took.

    Attributes
    ----------
    solid : numpy.ndarray of bool
        Shape (z, y, x).
    erased : int
        Islands of the phase that were handed to the other phase.
    joined : int
        Islands that a bridge made part of another component.
    apart : int
        Islands that remain, for no voxels that may change lead to them.
    missing : int
        Voxels that the phase lacks of the number it had; negative if it has more. 0 unless the
        phase is too small or too closely framed by voxels that may not change.
    """

    solid: npt.NDArray[np.bool_]
    erased: int
    joined: int
    apart: int
    missing: int


def connect(
    solid: PhaseLike,
    score: npt.ArrayLike,
    which: Literal["solid", "pore"],
    *,
    smallest: int = 40,
    width: float = 3.0,
    boundary: Literal["open", "periodic"] = "open",
    free: npt.NDArray[np.bool_] | None = None,
    domain: npt.NDArray[np.bool_] | None = None,
    threads: int = 0,
) -> Connected:
    """Make a phase one piece, with as many voxels as before.

    Small islands go to the other phase. Bridges join the others to the largest component where the
    score is nearest to the phase; all bridges together are the cheapest, as in a minimum spanning
    tree. Then the phase loses voxels of the lowest score at its surface, or gains those of the
    highest beside it, until it has its former number. Neither that nor the thickness of the bridges
    changes the topology. A phase of one piece is returned as it is.

    Parameters
    ----------
    solid : Volume or array_like
        Shape (z, y, x): bool, or two values of which 0 is the pore.
    score : array_like of float
        What the solid was cut from, in any unit, same shape: high in the solid, finite.
    which : {"solid", "pore"}
        The phase. Voxels of a solid touch by faces, edges or corners (26 neighbours), those of a
        pore by faces (6 neighbours).
    smallest : int, default 40
        Islands of fewer voxels are erased: in a cut of gray values they are noise. In binary
        volumes 6 will do. Islands that reach into voxels that may not change are joined.
    width : float, default 3.0
        Thickness of bridges in voxels, from 1 to 32. Thin bridges make thin struts.
    boundary : {"open", "periodic"}, default "open"
        Whether the phase goes on at the opposite face.
    free : numpy.ndarray of bool, optional
        Voxels that may change, same shape; all by default.
    domain : numpy.ndarray of bool, optional
        Where the material is, same shape; everywhere by default. What lies outside belongs to
        neither phase and never changes.
    threads : int, default 0
        Number of threads; 0 takes all cores. The result does not depend on it.

    Returns
    -------
    Connected

    Raises
    ------
    ParameterError
        If a parameter is outside its range, or shapes differ.

    Notes
    -----
    Peak memory: about 25 bytes per voxel.
    """
    if which not in ("solid", "pore"):
        raise ParameterError("which", which, "must be 'solid' or 'pore'")
    smallest = whole_number("smallest", smallest, 0)
    array = as_phase(solid)
    scores = np.asarray(as_scalar_volume(score, "score"), dtype=np.float32)
    free = as_mask("free", free, array.shape)
    domain = as_mask("domain", domain, array.shape)
    phase = array
    if which == "pore":
        # High scores belong to the phase.
        phase, scores = ~array, -scores
    if domain is not None:
        phase = phase & domain
        free = domain if free is None else free & domain
    connected, erased, joined, apart, missing = _core.connect_phase(
        phase,
        scores,
        connectivity=26 if which == "solid" else 6,
        boundary=boundary,
        smallest=min(smallest, array.size + 1),
        width=width,
        free=free,
        threads=threads,
    )
    result = connected if which == "solid" else ~connected
    if domain is not None:
        result = np.where(domain, result, array)
    return Connected(result, erased, joined, apart, missing)
