"""Diffusion and creeping flow by direct solution of equations written down face by face."""

from __future__ import annotations

import itertools

import numpy as np
from scipy import ndimage, sparse
from scipy.sparse.linalg import spsolve

Cell = tuple[int, int, int]


def percolating(pore: np.ndarray) -> np.ndarray:
    """The voxels of the components that touch the first and the last plane of axis 0."""
    labels = ndimage.label(pore)[0]
    both = np.intersect1d(labels[0], labels[-1])
    return np.isin(labels, both[both > 0])


def shifted(cell: Cell, axis: int, by: int) -> Cell:
    moved = list(cell)
    moved[axis] += by
    return (moved[0], moved[1], moved[2])


def diffusivity(solid: np.ndarray, spacing: tuple[float, float, float]) -> float:
    """D_eff / D_0 along axis 0 with an open boundary, by a sparse direct solver."""
    pore = percolating(~solid)
    if not pore.any():
        return 0.0
    numbers = np.full(pore.shape, -1)
    numbers[pore] = np.arange(np.count_nonzero(pore))
    weights = 1 / np.square(spacing)
    rows: list[np.ndarray] = []
    columns: list[np.ndarray] = []
    values: list[np.ndarray] = []
    diagonal = np.zeros(np.count_nonzero(pore))
    for axis in range(3):
        pair = [
            np.take(numbers, np.arange(n, pore.shape[axis] - 1 + n), axis).ravel() for n in (0, 1)
        ]
        linked = (pair[0] >= 0) & (pair[1] >= 0)
        for a, b in itertools.permutations([p[linked] for p in pair]):
            rows.append(a)
            columns.append(b)
            values.append(np.full(len(a), -weights[axis]))
            np.add.at(diagonal, a, weights[axis])
    inlet, outlet = numbers[0][pore[0]], numbers[-1][pore[-1]]
    for held in (inlet, outlet):
        np.add.at(diagonal, held, 2 * weights[0])
    right = np.zeros(len(diagonal))
    right[inlet] = 2 * weights[0]
    index = np.concatenate(rows), np.concatenate(columns)
    matrix = sparse.csc_matrix((np.concatenate(values), index), (len(right),) * 2)
    concentration = spsolve(matrix + sparse.diags(diagonal, format="csc"), right)
    flux = 2 * weights[0] * np.sum(np.atleast_1d(concentration)[outlet])
    return float(flux * pore.shape[0] / pore[0].size / weights[0])


class Stokes:
    """The staggered grid of a small volume, and its dense matrix."""

    def __init__(self, solid: np.ndarray, spacing: tuple[float, float, float], boundary: str):
        self.periodic = boundary == "periodic"
        self.pore = ~solid
        if not self.periodic:
            # The end planes go on to where the pressure is held.
            self.pore = np.pad(percolating(~solid), ((1, 1), (0, 0), (0, 0)), mode="edge")
        self.spacing = spacing
        faces = [
            (axis, cell)
            for axis in range(3)
            for cell in itertools.product(*map(range, self.pore.shape))
            if self.is_face(axis, cell)
        ]
        self.faces = {face: i for i, face in enumerate(faces)}
        cells = itertools.product(*map(range, self.pore.shape))
        self.cells = {
            cell: len(faces) + i
            for i, cell in enumerate(c for c in cells if self.pore[c] and not self.is_held(c))
        }

    def is_held(self, cell: Cell) -> bool:
        return not self.periodic and cell[0] in (0, self.pore.shape[0] - 1)

    def wrap(self, cell: Cell) -> Cell | None:
        """The cell itself, its copy in the volume, or nothing beyond an open border."""
        if self.periodic:
            z, y, x = (i % n for i, n in zip(cell, self.pore.shape, strict=True))
            return (z, y, x)
        inside = all(0 <= i < n for i, n in zip(cell, self.pore.shape, strict=True))
        return cell if inside else None

    def is_face(self, axis: int, cell: Cell) -> bool:
        ends = [self.wrap(cell), self.wrap(shifted(cell, axis, 1))]
        if any(end is None or not self.pore[end] for end in ends):
            return False
        return axis == 0 or not self.is_held(cell)

    def beyond(self, axis: int, cell: Cell, b: int, by: int) -> tuple[str, Cell]:
        to = shifted(cell, b, by)
        ends = [self.wrap(to), self.wrap(shifted(to, axis, 1))]
        if self.is_face(axis, to):
            wrapped = self.wrap(to)
            assert wrapped is not None
            return "face", wrapped
        if b == axis:
            return ("mirror" if axis == 0 and None in ends else "edge"), to
        if None in ends or (axis > 0 and self.is_held(to)):
            return "mirror", to
        walls = [not self.pore[end] for end in ends if end is not None]
        return ("wall" if all(walls) else "edge"), to

    def width(self, axis: int, cell: Cell, b: int, by: int) -> float:
        """Distance of the walls on both sides, seen from the one that is behind the cell."""
        width = 1
        while (found := self.beyond(axis, cell, b, by))[0] == "face":
            cell = found[1]
            width += 1
        return {"wall": width, "edge": width + 0.5, "mirror": 2 * width}[found[0]]

    def permeability(self) -> float:
        n = len(self.faces) + len(self.cells)
        matrix, right = np.zeros((n, n)), np.zeros(n)
        for (axis, cell), row in self.faces.items():
            right[row] = 1.0 if axis == 0 else 0.0
            for b, by in itertools.product(range(3), (-1, 1)):
                weight = 1 / self.spacing[b] ** 2
                kind, to = self.beyond(axis, cell, b, by)
                if kind == "face":
                    matrix[row, self.faces[axis, to]] -= weight
                    matrix[row, row] += weight
                elif kind == "edge":
                    matrix[row, row] += weight
                elif kind == "wall":
                    # u(y) = y (h − y) with the mean that the parabola has: shear / u(1/2)
                    h = self.width(axis, cell, b, -by)
                    matrix[row, row] += weight * 6 * h / (3 * h - 2)
            for end, sign in ((cell, -1), (self.wrap(shifted(cell, axis, 1)), 1)):
                if end in self.cells:
                    column = self.cells[end]
                    matrix[row, column] += sign / self.spacing[axis]
                    matrix[column, row] += sign / self.spacing[axis]
        solution = np.linalg.lstsq(matrix, right, rcond=None)[0]
        total = sum(solution[row] for (axis, _), row in self.faces.items() if axis == 0)
        planes = self.pore.shape[0] - (0 if self.periodic else 1)
        return float(total / planes / self.pore[0].size)
