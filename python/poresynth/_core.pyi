"""Compiled kernels. Private: the functions of the package check and document."""

from collections.abc import Callable
from typing import Any, final

import numpy as np
import numpy.typing as npt

__all__ = [
    "MatchMap",
    "__version__",
    "carry",
    "component_sizes",
    "cut_phases",
    "cut_solid",
    "diffusivity",
    "gaussian",
    "label",
    "novelty",
    "permeability",
    "ranks_by_phase",
    "signed_distance",
    "synthesize",
    "two_point",
]

__version__: str

@final
class MatchMap:
    """Where in the exemplar each window of a synthetic volume comes from."""

    @property
    def window(self) -> int: ...
    @property
    def shape(self) -> tuple[int, int, int]: ...
    @property
    def origins(self) -> list[npt.NDArray[np.int64]]: ...
    @property
    def matches(self) -> npt.NDArray[np.uint16]: ...
    def copying(self) -> tuple[float, float]: ...

def synthesize(
    exemplar: npt.NDArray[np.float32],
    shape: tuple[int, int, int],
    options: dict[str, Any],
    *,
    seed: int,
    known: npt.NDArray[np.float32] | None = None,
    known_mask: npt.NDArray[np.bool_] | None = None,
    domain: npt.NDArray[np.bool_] | None = None,
    threads: int = 0,
    progress: Callable[[str, float], object] | None = None,
) -> tuple[
    npt.NDArray[np.float32],
    MatchMap,
    list[tuple[int, int, int, float, float, float, float]],
]: ...
def carry(
    exemplar: npt.NDArray[np.float32],
    field: npt.NDArray[np.float32],
    values: npt.NDArray[np.float32],
    match_map: MatchMap,
    *,
    seed: int,
    slab: int,
    threads: int = 0,
) -> npt.NDArray[np.float32]: ...
def gaussian(
    field: npt.NDArray[np.float32], sigma: float, *, boundary: str
) -> npt.NDArray[np.float32]: ...
def signed_distance(
    phase: npt.NDArray[np.bool_],
    clip: int,
    *,
    boundary: str,
    valid: npt.NDArray[np.bool_] | None = None,
) -> npt.NDArray[np.float32]: ...
def cut_solid(
    values: npt.NDArray[np.float32],
    wanted: int,
    *,
    seed: int,
    free: npt.NDArray[np.bool_] | None = None,
) -> npt.NDArray[np.bool_]: ...
def cut_phases(
    scores: npt.NDArray[np.float32],
    wanted: list[int],
    *,
    seed: int,
    free: npt.NDArray[np.bool_] | None = None,
) -> npt.NDArray[np.uint8]: ...
def ranks_by_phase(
    gray: npt.NDArray[np.float32],
    solid: npt.NDArray[np.bool_],
    sizes: tuple[int, int],
    *,
    seed: int,
) -> npt.NDArray[np.uint32]: ...
def label(
    solid: npt.NDArray[np.bool_], *, connectivity: int, boundary: str, threads: int = 0
) -> tuple[npt.NDArray[np.uint32], npt.NDArray[np.uint64]]: ...
def component_sizes(
    solid: npt.NDArray[np.bool_], *, connectivity: int, boundary: str, threads: int = 0
) -> npt.NDArray[np.uint64]: ...
def two_point(
    solid: npt.NDArray[np.bool_], r_max: int, *, boundary: str, threads: int = 0
) -> list[npt.NDArray[np.float64]]: ...
def novelty(
    exemplar: npt.NDArray[np.float32],
    volume: npt.NDArray[np.float32],
    edge: int,
    *,
    probes: int,
    seed: int,
    threads: int = 0,
) -> tuple[float, float] | None: ...
def diffusivity(
    solid: npt.NDArray[np.bool_],
    axis: int,
    numbers: tuple[tuple[float, float, float], float, int],
    *,
    boundary: str,
    threads: int = 0,
    progress: Callable[[str, float], object] | None = None,
) -> tuple[int, int, float, float, float, int]: ...
def permeability(
    solid: npt.NDArray[np.bool_],
    axis: int,
    numbers: tuple[tuple[float, float, float], float, int],
    *,
    boundary: str,
    threads: int = 0,
    progress: Callable[[str, float], object] | None = None,
) -> tuple[int, int, float, float, float, int]: ...
