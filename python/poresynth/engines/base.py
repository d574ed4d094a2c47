"""What every engine offers, and what it returns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from poresynth.engines.porosity import PorosityLike
from poresynth.volume import Volume

if TYPE_CHECKING:
    from typing_extensions import Self

    from poresynth._core import MatchMap

__all__ = ["EnergyRecord", "ProgressCallback", "SynthesizedVolume", "Synthesizer"]

ProgressCallback = Callable[[str, float], object]
"""Called with what is being done and the share of the whole that is done, 0 to 1."""


class EnergyRecord(NamedTuple):
    """Energy of zhang_2017 Eq. 1 after one iteration, a mean over the voxels of the windows."""

    level: int
    window: int
    iteration: int
    energy: float
    data: float
    gradient: float
    factor: float


@dataclass(frozen=True, eq=False)
class SynthesizedVolume(Volume):
    """A volume that an engine made, with the record of its making.

    Parameters
    ----------
    match_map : MatchMap, optional
        Where in the exemplar each window comes from, for engines that copy.
    energy : tuple of EnergyRecord
        One record an iteration, coarse to fine.

    Notes
    -----
    ``metadata["poresynth"]`` holds the provenance: version, engine, parameters, seed, shape, the
    exemplar's hash, and ``copying`` (`copy_fraction`, `mean_copied_block`).
    """

    match_map: MatchMap | None = None
    energy: tuple[EnergyRecord, ...] = ()


class Synthesizer(Protocol):
    """An engine: parameters in, then an exemplar, then as many volumes as wanted."""

    def __init__(self, **parameters: Any) -> None:
        """Store the parameters; `fit` checks them."""

    def fit(self, exemplar: Volume | npt.ArrayLike, **options: Any) -> Self:
        """Learn from an exemplar and return the engine itself; engines that train take options."""

    def sample(
        self,
        shape: tuple[int, int, int],
        *,
        seed: int = 0,
        boundary: Literal["open", "periodic"] = "open",
        porosity: PorosityLike | None = None,
        known: Volume | npt.ArrayLike | None = None,
        known_mask: npt.NDArray[np.bool_] | None = None,
        mask: npt.NDArray[np.bool_] | None = None,
        threads: int = 0,
        progress: ProgressCallback | None = None,
    ) -> SynthesizedVolume:
        """Make a volume of this shape."""

    def estimate_memory(self, shape: tuple[int, int, int]) -> int:
        """Peak memory of `sample` in bytes."""

    def save(self, path: str | Path) -> None:
        """Write the fitted engine to a file."""

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a fitted engine from a file."""
