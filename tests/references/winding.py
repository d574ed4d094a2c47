"""How often a closed mesh winds round a point: the sum of the solid angles of its triangles."""

from __future__ import annotations

import numpy as np


def winding_numbers(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return the winding number of triangles, shape (m, 3, 3), round points, shape (n, 3).

    Van Oosterom and Strackee, IEEE Trans. Biomed. Eng. 30, 125 (1983).
    """
    total = np.zeros(len(points))
    for i, point in enumerate(points):
        a, b, c = np.moveaxis(corners - point, 1, 0)
        la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
        top = np.einsum("ij,ij->i", a, np.cross(b, c))
        dot = lambda u, v: np.einsum("ij,ij->i", u, v)  # noqa: E731
        bottom = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb
        total[i] = 2 * np.arctan2(top, bottom).sum()
    return np.round(total / (4 * np.pi)).astype(int)
