"""Sizes, bounding boxes and centroids of 26-connected components, and small parts removed."""

from __future__ import annotations

import numpy as np
from inputs import blobs, foam
from race import Race

import poresynth.metrics


def same_statistics(ours: list[np.ndarray], theirs: list[np.ndarray]) -> bool:
    """The same parts; the others number in orders of their own."""
    first, second = (np.column_stack(arrays) for arrays in (ours, theirs))
    ordered = [rows[np.lexsort(rows.T[:-3])] for rows in (first, second)]
    return ordered[0].shape == ordered[1].shape and np.allclose(*ordered, rtol=1e-4)


title = "sizes, boxes and centroids of 26-connected components"
races = [
    Race(f"{title}, blobs", lambda edge: [blobs(edge)], same_statistics),
    Race(f"{title}, foam", lambda edge: [foam(edge)], same_statistics),
]
dust = Race("parts of fewer than 10 voxels removed", lambda edge: [blobs(edge)], np.array_equal)


def ours(solid: np.ndarray, threads: int = 0) -> list[np.ndarray]:
    found = poresynth.metrics.component_statistics(solid, threads=threads)
    return [found.sizes, found.bounding_boxes.reshape(-1, 6), found.centroids]


def cc3d_statistics(solid: np.ndarray) -> list[np.ndarray]:
    import cc3d

    labels = cc3d.connected_components(solid, connectivity=26)
    found = cc3d.statistics(labels, no_slice_conversion=True)
    boxes = found["bounding_boxes"].astype(int)
    boxes[:, 1::2] += 1
    return [found["voxel_counts"][1:], boxes[1:], found["centroids"][1:]]


def scipy_statistics(solid: np.ndarray) -> list[np.ndarray]:
    from scipy import ndimage

    labels, n = ndimage.label(solid, np.ones((3, 3, 3)))
    boxes = [[(s.start, s.stop) for s in box] for box in ndimage.find_objects(labels)]
    centroids = ndimage.center_of_mass(solid, labels, np.arange(1, n + 1))
    sizes = np.bincount(labels.ravel())[1:]
    return [sizes, np.reshape(boxes, (n, 6)), np.reshape(centroids, (n, 3))]


for each in races:
    each.contestant("poresynth")(ours)
    each.contestant("cc3d", "connected-components-3d")(cc3d_statistics)
    each.contestant("scipy.ndimage", "scipy", most=256)(scipy_statistics)


@dust.contestant("poresynth")
def _(solid: np.ndarray, threads: int = 0) -> np.ndarray:
    return poresynth.metrics.remove_small_parts(solid, 10, threads=threads)


@dust.contestant("cc3d", "connected-components-3d")
def _(solid: np.ndarray) -> np.ndarray:
    import cc3d

    return cc3d.dust(solid, 10, connectivity=26)


@dust.contestant("scikit-image")
def _(solid: np.ndarray) -> np.ndarray:
    from skimage import morphology

    return morphology.remove_small_objects(solid, max_size=9, connectivity=3)
