"""Two-point cluster function: the two-point correlation, cluster by cluster."""

from __future__ import annotations

import numpy as np
from tests.references.two_point import two_point


def two_point_cluster(labels: np.ndarray, r_max: int, boundary: str) -> list[np.ndarray]:
    """C₂ for r = 0 … r_max: radial, along z, along y, along x."""
    total = two_point(np.zeros(labels.shape, bool), r_max, boundary)
    for value in range(1, int(labels.max(initial=0)) + 1):
        total = [
            a + b for a, b in zip(total, two_point(labels == value, r_max, boundary), strict=True)
        ]
    return total
