"""Which model of random points the sections of images are nearest to."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.spatial import KDTree

from poresynth.engines.images import Images
from poresynth.engines.point_models import PointModel, models, nearest, points
from poresynth.engines.values import cut_share
from poresynth.metrics.correlation import normalised, relative_error, two_point_correlation
from poresynth.metrics.slice_statistics import (
    SliceStatistics,
    mean_error,
    mean_statistics,
    slice_statistics,
    window_statistics,
)

__all__ = ["mean_period", "near_models"]

SHARES = np.geomspace(0.4, 1.05, 8)
"""Spacings of the points that are tried, in mean distances from one strut to the next on a line."""

RELAXED = (1, 4)
"""How often they are relaxed: the more, the more are cells alike."""

_EDGE = 128
"""Edge of the sections at most, pixels."""

_PLANES = 2
"""Sections across each axis."""

_MEASURED = 16
"""Models whose sections are measured as a whole, after all were compared by their correlation."""


def near_models(images: Images, count: int) -> list[tuple[PointModel, float]]:
    """Return the models whose sections are nearest to the images, the nearest first.

    Parameters
    ----------
    images : Images
        Of two phases.
    count : int
        How many to return.

    Returns
    -------
    list of (PointModel, float)
        Each with how far its sections are from the images, percent: the mean of the error of the
        autocovariance and of the mean error of `slice_statistics`.

    Notes
    -----
    The smaller phase is taken for the struts, or for the pores between grains. A model's sum is cut
    where as much of it is solid as of the images. Peak memory: some 200 bytes for each of at most
    100,000 pixels.
    """
    solids = list(images.solids().values())
    edge = min(_EDGE, *[n for solid in solids for n in solid.shape[1:]])
    own = mean_statistics([w for solid in solids for w in window_statistics(solid, window=edge)])
    wanted = normalised(own.two_point, own.two_point[0])
    share = 1 - images.phases.porosity
    sign = 1 if share <= 0.5 else -1
    period = mean_period(images)
    box, at = np.full(3, float(edge)), _planes(edge)
    found = []
    for spacing in SHARES * period:
        for relaxed in RELAXED:
            distances = nearest(KDTree(points(box, spacing, relaxed, 0), boxsize=box), at)
            for name in models(3):
                model = PointModel(name, sign, float(spacing), relaxed)
                solid = cut_share(model.total(distances), share)
                curves = [two_point_correlation(s[None], len(wanted) - 1).radial for s in solid]
                curve = np.mean(curves, axis=0)
                off = relative_error(normalised(curve, curve[0]), wanted)
                found.append((off, model, solid))
    found.sort(key=lambda entry: entry[0])
    measured = [(model, (off + _error(own, solid)) / 2) for off, model, solid in found[:_MEASURED]]
    return sorted(measured, key=lambda entry: entry[1])[:count]


def mean_period(images: Images) -> float:
    """Return the mean distance on a line from a surface to the next but one, pixels."""
    solids = images.solids().values()
    changes = [(s[:, 1:] != s[:, :-1]).mean() + (s[..., 1:] != s[..., :-1]).mean() for s in solids]
    return 4 / float(np.mean(changes))


def _planes(edge: int) -> npt.NDArray[np.float64]:
    """Return the pixels of planes across each axis of a cube, shape (plane, edge, edge, 3)."""
    middles = np.arange(edge) + 0.5
    places = (np.arange(_PLANES) + 0.5) * edge / _PLANES
    flat = np.stack(np.meshgrid(places, middles, middles, indexing="ij"), axis=-1)
    return np.concatenate([np.roll(flat, axis, axis=-1) for axis in range(3)])


def _error(own: SliceStatistics, solid: npt.NDArray[np.bool_]) -> float:
    return mean_error(own.errors(slice_statistics(solid, window=own.window[0])).values())
