"""The structure of a window by public libraries, all but the local thickness."""

from __future__ import annotations

import cc3d
import numpy as np
from scipy import ndimage
from skimage import measure, morphology

FLOATING = 10
MARGIN = 3


def structure(solid: np.ndarray) -> dict[str, float]:
    """The quantities of `poresynth.metrics.structure_error` that have an exact reference."""
    firm = cc3d.dust(solid, threshold=FLOATING, connectivity=26).astype(bool)
    skeleton = morphology.skeletonize(firm) > 0
    around = ndimage.convolve(skeleton.astype(np.uint8), np.ones((3, 3, 3)), mode="constant")
    inner = (slice(MARGIN, -MARGIN),) * 3
    tips = (skeleton & (around == 2))[inner]
    vertices, faces, *_ = measure.marching_cubes(solid.astype(np.float32), 0.5)
    return {
        "largest_solid": _largest(solid, 26),
        "largest_pore": _largest(~solid, 6),
        "euler_density": 1e6 * measure.euler_number(firm, connectivity=3) / firm.size,
        "end_point_density": 1e3 * tips.mean(),
        "surface_density": measure.mesh_surface_area(vertices, faces) / solid.size,
    }


def _largest(phase: np.ndarray, connectivity: int) -> float:
    sizes = np.bincount(cc3d.connected_components(phase, connectivity=connectivity).ravel())[1:]
    return float(sizes.max() / sizes.sum())
