"""The structure of an exemplar: its phases, the field that is synthesised, the way back."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from poresynth import _core
from poresynth.errors import ParameterError
from poresynth.preprocess import (
    MOST_LABELS,
    is_two_valued,
    label_values,
    threshold,
)
from poresynth.volume import Volume

__all__ = ["Phases", "detect_kind"]

Kind = Literal["gray", "binary", "label"]


def detect_kind(array: npt.NDArray[Any]) -> Kind:
    """Return what the values of a volume mean.

    Two values are a binary volume; up to 16 different integers are labels; all else is gray. Gray
    volumes with few levels must be named gray.
    """
    if array.ndim == 4:
        return "gray"
    if is_two_valued(array):
        return "binary"
    return "label" if label_values(array) else "gray"


@dataclass(frozen=True)
class Phases:
    """An exemplar as phases.

    Attributes
    ----------
    kind : {"gray", "binary", "label"}
    labels : numpy.ndarray
        Values of the phases, pore first: two for binary and gray (unused) volumes.
    phase : numpy.ndarray
        Phase index of every voxel, uint8, shape (z, y, x); 0 is the pore.
    threshold : float or None
        Gray value that parts solid from pore, None for labels.
    solid : {"bright", "dark"}
    """

    kind: Kind
    labels: npt.NDArray[Any]
    phase: npt.NDArray[np.uint8]
    threshold: float | None
    solid: Literal["bright", "dark"]

    @classmethod
    def of(
        cls,
        volume: Volume,
        kind: Literal["auto", "gray", "binary", "label"],
        cut: float | None,
        solid: Literal["bright", "dark"],
    ) -> Phases:
        """Find the phases of an exemplar."""
        array = volume.array
        found = detect_kind(array) if kind == "auto" else kind
        if found != "gray" and array.ndim == 4:
            raise ParameterError("kind", kind, "must be 'gray' for a volume with channels")
        if found == "label":
            labels = np.unique(array)
            if not 2 <= len(labels) <= MOST_LABELS:
                raise ParameterError(
                    "exemplar", f"{len(labels)} labels", f"must have from 2 to {MOST_LABELS} labels"
                )
            if solid == "dark":
                labels = labels[::-1]
            order = np.argsort(labels)
            phase = order[np.searchsorted(labels, array, sorter=order)].astype(np.uint8)
            return cls(found, labels, phase, None, solid)
        structure = array if array.ndim == 3 else array[..., 0]
        if found == "binary" and not is_two_valued(structure):
            raise ParameterError("kind", kind, "must not be 'binary' for more than two values")
        value = threshold(structure, cut)
        phase = cls.cut(structure, value, solid).astype(np.uint8)
        fraction = float(phase.mean())
        if fraction in (0.0, 1.0):
            raise ParameterError(
                "threshold", value, "must leave both pore and solid in the exemplar"
            )
        low, high = structure.min(), structure.max()
        labels = np.array([low, high] if solid == "bright" else [high, low], structure.dtype)
        return cls(found, labels, phase, value, solid)

    @staticmethod
    def cut(
        structure: npt.NDArray[Any], value: float, solid: Literal["bright", "dark"]
    ) -> npt.NDArray[np.bool_]:
        """Return the solid of a gray or binary volume, which may have none."""
        bright = np.asarray(structure > value)
        return bright if solid == "bright" else ~bright

    def with_phase(self, phase: npt.NDArray[np.uint8]) -> Phases:
        """Return the same phases, as other voxels show them."""
        return replace(self, phase=phase)

    def phase_of(self, array: npt.NDArray[Any]) -> npt.NDArray[np.uint8]:
        """Return the phase indices of other voxels of the same material (shape (z, y, x[, c]))."""
        if self.kind == "label":
            order = np.argsort(self.labels)
            at = np.searchsorted(self.labels, array, sorter=order)
            index = order[np.minimum(at, len(order) - 1)].astype(np.uint8)
            if not np.array_equal(self.labels[index], array):
                raise ParameterError(
                    "known", "other labels", f"must be among {self.labels.tolist()}"
                )
            return index
        structure = array if array.ndim == 3 else array[..., 0]
        assert self.threshold is not None
        return self.cut(structure, self.threshold, self.solid).astype(np.uint8)

    @property
    def porosity(self) -> float:
        """Share of the pore."""
        return float(np.count_nonzero(self.phase == 0) / self.phase.size)

    def provenance(self, exemplar: Volume) -> dict[str, Any]:
        """Return what a result says of its exemplar."""
        array = exemplar.array
        return {
            "sha256": hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest(),
            "shape": list(array.shape),
            "dtype": str(array.dtype),
            "kind": self.kind,
            "solid": self.solid,
            "threshold": self.threshold,
            "porosity": self.porosity,
        }

    def wanted(self, voxels: int, porosity: float | None) -> list[int]:
        """Return how many of so many voxels each phase gets: the exemplar's shares.

        With a porosity, the pore gets that share and the other phases keep their proportions.
        """
        counts = np.bincount(self.phase.ravel(), minlength=len(self.labels)).astype(float)
        shares = counts / counts.sum()
        if porosity is not None:
            shares[1:] *= (1 - porosity) / shares[1:].sum()
            shares[0] = porosity
        # Largest remainders: the rounded counts sum to the voxels.
        exact = shares * voxels
        whole = np.floor(exact).astype(int)
        missing = voxels - int(whole.sum())
        for k in np.argsort(whole - exact, kind="stable")[:missing]:
            whole[k] += 1
        return [int(n) for n in whole]

    def distance_field(
        self,
        phase: npt.NDArray[np.uint8],
        clip: int,
        valid: npt.NDArray[np.bool_] | None = None,
    ) -> npt.NDArray[np.float32]:
        """Return clipped signed distances as a field of 0 to 255, shape (channel, z, y, x).

        Two phases share one channel, positive in the solid; more have one channel each.
        """
        which = [1] if len(self.labels) == 2 else range(len(self.labels))
        field = np.stack(
            [_core.signed_distance(phase == k, clip, boundary="open", valid=valid) for k in which]
        )
        field *= 127.5 / clip
        field += 127.5
        return field
