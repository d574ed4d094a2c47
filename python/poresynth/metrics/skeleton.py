"""Skeletons by thinning, and how many dead ends they have."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from poresynth import _core
from poresynth.errors import ParameterError
from poresynth.metrics.arguments import PhaseLike, as_phase, scale_of, whole_number

__all__ = ["MARGIN", "EndPoints", "end_points", "skeletonize"]

MARGIN = 8
"""Voxels at the border whose end points do not count: the radius of the thickest usual strut."""

_END = 1  # of the kinds that `_core.skeleton_graph` gives


def skeletonize(
    solid: PhaseLike,
    *,
    phase: int | None = None,
    kind: Literal["curve", "surface"] = "curve",
    method: Literal["strict", "lee"] = "strict",
    threads: int = 0,
) -> npt.NDArray[np.bool_]:
    """Thin a phase to its skeleton, after Lee, Kashyap and Chu (1994).

    Parameters
    ----------
    solid : Volume or array_like
        The phase, shape (z, y, x): bool, or at most 16 values of which 0 is not in it. What lies
        beyond the border counts as void.
    phase : int, optional
        The value that is the phase, instead of all but 0.
    kind : {"curve", "surface"}, default "curve"
        What stays: centre lines, or the medial surface. The medial surface keeps the voxels that
        have void at two opposite faces (the surface end points of Palágyi 2008).
    method : {"strict", "lee"}, default "strict"
        Strict: a voxel is removed only if at that very moment it is simple. The skeleton then has
        the components, tunnels and cavities of the solid, and no part vanishes. Lee: at that moment
        it is only asked whether the voxel's neighbours hang together, as ImageJ, ITK and
        scikit-image do; equal voxel by voxel to scikit-image 0.26, for comparison with them. Parts
        of even thickness may then vanish, and tunnels and cavities appear or go.
    threads : int, default 0
        Number of threads; 0 takes all cores. The skeleton does not depend on it.

    Returns
    -------
    numpy.ndarray of bool
        The voxels of the skeleton, shape (z, y, x), in Fortran order if the phase was.

    Raises
    ------
    ParameterError
        If a parameter is outside its range.

    Notes
    -----
    The six sides of the solid are thinned in turn: of the border voxels of a side, those that are
    no end and are simple (their removal changes neither the components nor the Euler number, with
    26 neighbours for the solid and 6 for the void) are looked at again one by one, and removed if
    they still may go. The strict method looks again at the eight subfields of equal parity of z, y
    and x in turn, none of whose voxels touch; in C order, as the old method does, a bar of even
    thickness is eaten from its first end to its last once it is two voxels wide.

    Sides and subfields give a preference where the middle lies between two voxels: of a turned,
    mirrored or shifted solid the skeleton's topology is the same, its voxels may differ. A volume
    that is one voxel thick is thinned as an image.

    Peak memory: 1½ bytes a voxel, the skeleton counted, and 16 MB for answers that are remembered
    (32 MB with "lee").

    References
    ----------
    Lee, Kashyap and Chu: Building skeleton models via 3-D medial surface/axis thinning algorithms.
    CVGIP: Graphical Models and Image Processing 56 (1994).
    Palágyi: A 3D fully parallel surface-thinning algorithm. Theoretical Computer Science 406
    (2008).
    """
    return _core.thin(as_phase(solid, "solid", phase), kind=kind, method=method, threads=threads)


@dataclass(frozen=True, eq=False)
class EndPoints:
    """The end points of a skeleton, away from the border.

    Attributes
    ----------
    count : int
        Number of end points.
    per_voxel : float
        End points per voxel of the volume inside the margin.
    density : float
        End points per unit of volume, 1/``unit``³.
    places : numpy.ndarray of int64
        Where they are, in voxels (z, y, x) of the whole volume, shape (count, 3).
    unit : str
        Unit of lengths.
    """

    count: int
    per_voxel: float
    density: float
    places: npt.NDArray[np.int64]
    unit: str


def end_points(
    solid: PhaseLike,
    *,
    phase: int | None = None,
    skeleton: npt.ArrayLike | None = None,
    margin: int = MARGIN,
    voxel_size: float | tuple[float, float, float] | None = None,
    threads: int = 0,
) -> EndPoints:
    """Count the dead ends of a structure: the voxels of its skeleton with exactly one neighbour.

    A network of struts that carries load has few; a structure with broken or hanging struts has
    many.

    Parameters
    ----------
    solid : Volume or array_like
        The phase, shape (z, y, x): bool, or at most 16 values of which 0 is not in it.
    phase : int, optional
        The value that is the phase, instead of all but 0.
    skeleton : array_like of bool, optional
        The skeleton of the solid where it is already known, shape (z, y, x); `skeletonize` with its
        defaults makes it otherwise.
    margin : int, default 8
        Voxels at each face of the volume in which end points do not count: a strut that the border
        cuts is no dead end, and its skeleton ends up to a strut's radius before the border. Take at
        least the radius of the thickest strut.
    voxel_size : float or (float, float, float), optional
        Edges of a voxel along (z, y, x), instead of the volume's own.
    threads : int, default 0
        Number of threads; 0 takes all cores. The result does not depend on it.

    Returns
    -------
    EndPoints

    Raises
    ------
    ParameterError
        If a parameter is outside its range, or the margin leaves nothing of the volume.

    Notes
    -----
    Two neighbours share a face, an edge or a corner. Rough surfaces give the skeleton short spurs,
    which count: compare volumes of one resolution and one smoothness. Peak memory: that of
    `skeletonize`, and about 40 bytes a voxel of the skeleton.
    """
    margin = whole_number("margin", margin, 0)
    scale = scale_of(solid, voxel_size)
    if skeleton is None:
        thinned = skeletonize(solid, phase=phase, threads=threads)
    else:
        thinned = as_phase(skeleton, "skeleton")
    inner = [n - 2 * margin for n in thinned.shape]
    if min(inner) < 1:
        raise ParameterError(
            "margin", margin, f"must leave a part of a volume of shape {thinned.shape}"
        )
    nodes, kinds, *_ = _core.skeleton_graph(thinned, scale.voxel_size, threads=threads)
    places = nodes[kinds == _END].astype(np.int64)
    shape = np.array(thinned.shape)
    places = places[((places >= margin) & (places < shape - margin)).all(axis=1)]
    per_voxel = len(places) / float(np.prod(inner))
    density = per_voxel / float(np.prod(scale.voxel_size))
    return EndPoints(len(places), per_voxel, density, places, scale.unit)
