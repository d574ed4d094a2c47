"""Connected components, 26 neighbours, of blobs."""

from __future__ import annotations

import numpy as np
from inputs import blobs
from race import Race

import poresynth.metrics


def same_labels(ours: np.ndarray, theirs: np.ndarray) -> bool:
    """The same grouping; the others number in orders of their own."""
    pairs = np.unique(ours.ravel().astype(np.int64) << 32 | theirs.ravel())
    return len(pairs) == int(ours.max()) + 1 == int(theirs.max()) + 1


def same_sizes(ours: np.ndarray, theirs: np.ndarray) -> bool:
    return np.array_equal(np.sort(ours), np.sort(theirs))


labels = Race("labels of 26-connected components", lambda edge: [blobs(edge)], same_labels)
sizes = Race("sizes of 26-connected components", lambda edge: [blobs(edge)], same_sizes)


@labels.contestant("poresynth")
def _(solid: np.ndarray, threads: int = 0) -> np.ndarray:
    return poresynth.metrics.label(solid, threads=threads).labels


@labels.contestant("cc3d", "connected-components-3d")
def label_cc3d(solid: np.ndarray) -> np.ndarray:
    import cc3d

    return cc3d.connected_components(solid, connectivity=26)


@labels.contestant("scipy.ndimage", "scipy")
def label_scipy(solid: np.ndarray) -> np.ndarray:
    from scipy import ndimage

    return ndimage.label(solid, np.ones((3, 3, 3)))[0]


@labels.contestant("scikit-image")
def label_skimage(solid: np.ndarray) -> np.ndarray:
    from skimage import measure

    return measure.label(solid, connectivity=3)


@sizes.contestant("poresynth")
def _(solid: np.ndarray, threads: int = 0) -> np.ndarray:
    return poresynth.metrics.component_sizes(solid, threads=threads)


@sizes.contestant("cc3d", "connected-components-3d")
def _(solid: np.ndarray) -> np.ndarray:
    return np.bincount(label_cc3d(solid).ravel())[1:]


@sizes.contestant("scipy.ndimage", "scipy")
def _(solid: np.ndarray) -> np.ndarray:
    return np.bincount(label_scipy(solid).ravel())[1:]


@sizes.contestant("scikit-image")
def _(solid: np.ndarray) -> np.ndarray:
    return np.bincount(label_skimage(solid).ravel())[1:]
