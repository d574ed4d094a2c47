"""What a volume is asked for: the checked arguments of `sample`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from poresynth.engines.porosity import PorosityLike, PorosityMap, as_porosity
from poresynth.errors import ParameterError
from poresynth.volume import Volume, as_volume

__all__ = ["Request"]

Shape = tuple[int, int, int]

MAP_MEMORY = 50
"""Most bytes that it takes to follow a porosity map, a voxel of a cell and its surroundings."""
MAP_CELL = 192**3
"""Voxels of such a cell."""
KNOWN_MEMORY = 30
"""Most bytes a voxel that it takes to lead new voxels up to known ones."""


@dataclass(frozen=True, eq=False)
class Request:
    """The arguments of `sample`, checked.

    Attributes
    ----------
    shape : (int, int, int)
    seed : int
    boundary : {"open", "periodic"}
    porosity : float or None
    porosity_map : PorosityMap or None
        Wanted porosity of each voxel; at most one of the two is given.
    known : numpy.ndarray or None
        Values that are kept, of the exemplar's channels.
    known_mask : numpy.ndarray of bool or None
        Where they count; None if and only if ``known`` is.
    domain : numpy.ndarray of bool or None
        The voxels that matter.
    threads : int
    least : int
        Smallest edge that the engine can make, voxels.
    """

    shape: Shape
    seed: int
    boundary: Literal["open", "periodic"]
    porosity: float | None
    porosity_map: PorosityMap | None
    known: npt.NDArray[Any] | None
    known_mask: npt.NDArray[np.bool_] | None
    domain: npt.NDArray[np.bool_] | None
    threads: int
    least: int

    @classmethod
    def of(
        cls,
        shape: Shape,
        *,
        least: int,
        exemplar: Volume,
        seed: int = 0,
        boundary: Literal["open", "periodic"] = "open",
        porosity: PorosityLike | None = None,
        known: Volume | npt.ArrayLike | None = None,
        known_mask: npt.NDArray[np.bool_] | None = None,
        mask: npt.NDArray[np.bool_] | None = None,
        threads: int = 0,
    ) -> Request:
        """Check the arguments; ``least`` is the smallest edge that the engine can make."""
        shape = _check_shape(shape, least)
        seed = _check_integer("seed", seed, 0, 2**64 - 1)
        threads = _check_integer("threads", threads, 0, 4096)
        if boundary not in ("open", "periodic"):
            raise ParameterError("boundary", boundary, "must be 'open' or 'periodic'")
        wanted = as_porosity(porosity, shape, exemplar.voxel_size)
        number, porosity_map = (None, wanted) if isinstance(wanted, PorosityMap) else (wanted, None)
        domain = None if mask is None else _check_mask("mask", mask, shape)
        given, on = _check_known(known, known_mask, shape, exemplar)
        return cls(shape, seed, boundary, number, porosity_map, given, on, domain, threads, least)

    @property
    def free(self) -> npt.NDArray[np.bool_] | None:
        """Voxels that the engine decides, None for all."""
        if self.domain is None:
            return None if self.known_mask is None else ~self.known_mask
        return self.domain if self.known_mask is None else self.domain & ~self.known_mask

    @property
    def memory(self) -> int:
        """Most bytes that a porosity map or known voxels take besides the synthesis."""
        voxels = int(np.prod(self.shape, dtype=object))
        known = 0 if self.known is None else KNOWN_MEMORY * voxels
        if self.porosity_map is None:
            return known
        free = self.free
        changing = voxels if free is None else int(np.count_nonzero(free))
        # Two solids, and either a cell and the depths so far, or what is made of all depths.
        cell = MAP_MEMORY * min(voxels, MAP_CELL)
        return max(known, 2 * voxels + max(cell + 4 * changing, 16 * changing))

    def around_domain(self) -> tuple[Request, tuple[slice, ...]]:
        """Return the request for the box round the domain, and where that is.

        All is asked for if there is no domain, or the volume is periodic. The box is at least as
        large as the engine needs.
        """
        everything = tuple(slice(0, n) for n in self.shape)
        if self.domain is None or self.boundary == "periodic":
            return self, everything
        where = []
        for axis, n in enumerate(self.shape):
            others = tuple(i for i in range(3) if i != axis)
            inside = np.flatnonzero(self.domain.any(axis=others))
            first, edge = int(inside[0]), int(inside[-1] - inside[0]) + 1
            edge = max(edge, self.least)
            start = min(first, n - edge)
            where.append(slice(start, start + edge))
        z, y, x = where
        box = (z, y, x)

        def cut(array: npt.NDArray[Any] | None) -> npt.NDArray[Any] | None:
            return None if array is None else np.ascontiguousarray(array[box])

        known_mask, known = cut(self.known_mask), cut(self.known)
        if known_mask is not None and not known_mask.any():
            known_mask = known = None
        inner = replace(
            self,
            shape=(z.stop - z.start, y.stop - y.start, x.stop - x.start),
            porosity_map=None if self.porosity_map is None else self.porosity_map.within(box),
            known=known,
            known_mask=known_mask,
            domain=cut(self.domain),
        )
        return inner, box

    def whole(
        self, array: npt.NDArray[Any], where: tuple[slice, ...], outside: Any
    ) -> npt.NDArray[Any]:
        """Return what was made for a box in the volume that was asked for."""
        if array.shape[:3] == self.shape:
            return array
        full = np.empty(self.shape + array.shape[3:], array.dtype)
        full[...] = outside
        full[where] = array
        return full

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
        made = {
            "shape": list(self.shape),
            "seed": self.seed,
            "boundary": self.boundary,
            "porosity": self.porosity,
        }
        if self.porosity_map is not None:
            made["porosity_map"] = self.porosity_map.figures
        return made


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
