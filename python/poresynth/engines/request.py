"""What a volume is asked for: the checked arguments of `sample`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from poresynth.errors import ParameterError
from poresynth.volume import Volume, as_volume

__all__ = ["Request"]

Shape = tuple[int, int, int]


@dataclass(frozen=True, eq=False)
class Request:
    """The arguments of `sample`, checked.

    Attributes
    ----------
    shape : (int, int, int)
    seed : int
    boundary : {"open", "periodic"}
    porosity : float or None
    known : numpy.ndarray or None
        Values that are kept, of the exemplar's channels.
    known_mask : numpy.ndarray of bool or None
        Where they count; None if and only if ``known`` is.
    domain : numpy.ndarray of bool or None
        The voxels that matter.
    threads : int
    """

    shape: Shape
    seed: int
    boundary: Literal["open", "periodic"]
    porosity: float | None
    known: npt.NDArray[Any] | None
    known_mask: npt.NDArray[np.bool_] | None
    domain: npt.NDArray[np.bool_] | None
    threads: int

    @classmethod
    def of(
        cls,
        shape: Shape,
        *,
        least: int,
        exemplar: Volume,
        seed: int,
        boundary: Literal["open", "periodic"],
        porosity: float | None,
        known: Volume | npt.ArrayLike | None,
        known_mask: npt.NDArray[np.bool_] | None,
        mask: npt.NDArray[np.bool_] | None,
        threads: int,
    ) -> Request:
        """Check the arguments; ``least`` is the smallest edge that the engine can make."""
        shape = _check_shape(shape, least)
        seed = _check_integer("seed", seed, 0, 2**64 - 1)
        threads = _check_integer("threads", threads, 0, 4096)
        if boundary not in ("open", "periodic"):
            raise ParameterError("boundary", boundary, "must be 'open' or 'periodic'")
        if porosity is not None and not 0 < porosity < 1:
            raise ParameterError("porosity", porosity, "must be above 0 and below 1")
        domain = None if mask is None else _check_mask("mask", mask, shape)
        given, on = _check_known(known, known_mask, shape, exemplar)
        return cls(shape, seed, boundary, porosity, given, on, domain, threads)

    @property
    def free(self) -> npt.NDArray[np.bool_] | None:
        """Voxels that the engine decides, None for all."""
        if self.domain is None:
            return None if self.known_mask is None else ~self.known_mask
        return self.domain if self.known_mask is None else self.domain & ~self.known_mask

    def filled(self, value: Any) -> npt.NDArray[Any] | None:
        """Return the known values, with one value elsewhere: there may be anything, NaN too."""
        if self.known is None or self.known_mask is None:
            return None
        filled: npt.NDArray[Any] = self.known.copy()
        filled[~self.known_mask] = value
        return filled

    def impose(self, array: npt.NDArray[Any], outside: Any) -> None:
        """Set known voxels to their values and those outside the domain to one value."""
        if self.known is not None and self.known_mask is not None:
            array[self.known_mask] = self.known[self.known_mask]
        if self.domain is not None:
            array[~self.domain] = outside

    def provenance(self) -> dict[str, Any]:
        """Return what a result says of its making."""
        return {
            "shape": list(self.shape),
            "seed": self.seed,
            "boundary": self.boundary,
            "porosity": self.porosity,
        }


def _check_shape(shape: Shape, least: int) -> Shape:
    try:
        z, y, x = (int(n) for n in shape if int(n) == n)
    except (TypeError, ValueError):
        raise ParameterError("shape", shape, "must be three integers (z, y, x)") from None
    if min(z, y, x) < least:
        allowed = f"must be at least {least} along each axis"
        reason = ": the largest window at the coarsest level" if least > 1 else ""
        raise ParameterError("shape", (z, y, x), allowed + reason)
    return (z, y, x)


def _check_integer(name: str, value: Any, low: int, high: int) -> int:
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)):
        raise ParameterError(name, value, "must be an integer")
    if not low <= value <= high:
        raise ParameterError(name, value, f"must be from {low} to {high}")
    return int(value)


def _check_mask(name: str, mask: npt.ArrayLike, shape: Shape) -> npt.NDArray[np.bool_]:
    array = np.asarray(mask)
    if array.shape != shape:
        raise ParameterError(name, array.shape, f"must have the shape {shape}")
    if array.dtype != bool and not np.isin(np.unique(array), (0, 1, 255)).all():
        raise ParameterError(name, array.dtype, "must be a mask: bool, or 0 and one other value")
    on = array.astype(bool)
    if not on.any():
        raise ParameterError(name, "empty", "must have at least one voxel")
    return on


def _check_known(
    known: Volume | npt.ArrayLike | None,
    known_mask: npt.NDArray[np.bool_] | None,
    shape: Shape,
    exemplar: Volume,
) -> tuple[npt.NDArray[Any] | None, npt.NDArray[np.bool_] | None]:
    if known is None and known_mask is None:
        return None, None
    if known is None or known_mask is None:
        raise ParameterError("known, known_mask", "one of them", "must be given together")
    on = _check_mask("known_mask", known_mask, shape)
    given = as_volume(known).array
    wanted = shape + exemplar.array.shape[3:]
    if given.shape != wanted:
        raise ParameterError("known", given.shape, f"must have the shape {wanted}")
    values = given[on]
    if np.issubdtype(given.dtype, np.inexact) and not np.isfinite(values).all():
        raise ParameterError("known", "NaN or infinite", "must be finite where it counts")
    dtype = exemplar.dtype
    if given.dtype != dtype and not np.array_equal(values.astype(dtype), values):
        raise ParameterError(
            "known", given.dtype, f"must hold values that the exemplar's dtype {dtype} can hold"
        )
    return given, on
