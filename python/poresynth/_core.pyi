"""Compiled kernels. Private: the functions of the package check and document."""

from collections.abc import Callable, Sequence
from typing import Any, final

import numpy as np
import numpy.typing as npt

__all__ = [
    "MatchMap",
    "__version__",
    "binned_counts",
    "carry",
    "cavities",
    "cell_perimeters",
    "component_sizes",
    "component_statistics",
    "connect_phase",
    "cut_phases",
    "cut_solid",
    "describe_windows",
    "diffusivity",
    "distance_transform",
    "enlarge_periodic",
    "euler_corrected",
    "euler_number",
    "gaussian",
    "gray_moments",
    "keep_parts",
    "label",
    "level_counts",
    "local_porosity",
    "local_thickness",
    "match_histogram",
    "match_responses",
    "match_windows",
    "novelty",
    "permeability",
    "point_distances",
    "random_field",
    "recount_phase",
    "remove_branches",
    "run_lengths",
    "secants",
    "signed_distance",
    "skeleton_graph",
    "surface_area",
    "synthesize",
    "thin",
    "two_point",
    "two_point_cluster",
    "two_point_map",
]

__version__: str

@final
class MatchMap:
    """Where in the exemplar each window of a synthetic volume comes from."""

    @property
    def window(self) -> tuple[int, int, int]: ...
    @property
    def shape(self) -> tuple[int, int, int]: ...
    @property
    def origins(self) -> list[npt.NDArray[np.int64]]: ...
    @property
    def matches(self) -> npt.NDArray[np.uint16]: ...
    def copying(self) -> tuple[float, float]: ...

def synthesize(
    examples: list[dict[str, Any]],
    shape: tuple[int, int, int],
    options: dict[str, Any],
    *,
    seed: int,
    start: npt.NDArray[np.float32] | None = None,
    known: npt.NDArray[np.float32] | None = None,
    known_mask: npt.NDArray[np.bool_] | None = None,
    domain: npt.NDArray[np.bool_] | None = None,
    threads: int = 0,
    progress: Callable[[str, float], object] | None = None,
) -> tuple[
    npt.NDArray[np.float32],
    list[MatchMap],
    list[tuple[int, int, int, float, float, float, float]],
]: ...
def carry(
    exemplar: npt.NDArray[np.float32],
    field: npt.NDArray[np.float32],
    values: npt.NDArray[np.float32],
    match_map: MatchMap,
    *,
    seed: int,
    threads: int = 0,
) -> npt.NDArray[np.float32]: ...
def describe_windows(
    exemplar: npt.NDArray[np.float32],
    volume: npt.NDArray[np.float32],
    *,
    window: int,
    step: int,
    components: int,
    variance: float,
    seed: int,
    threads: int = 0,
) -> list[npt.NDArray[np.int16]]: ...
def match_windows(
    descriptors: npt.NDArray[np.int16],
    queries: npt.NDArray[np.int16],
    start: npt.NDArray[np.int64],
    *,
    step: int,
    search: str,
    candidates: int,
    seed: int,
    threads: int = 0,
) -> npt.NDArray[np.int64]: ...
def match_responses(
    volume: npt.NDArray[np.float32],
    images: list[tuple[int, npt.NDArray[np.float32], bool, float]],
    *,
    steps: int,
    filters: int,
    edge: int,
    seed: int,
    deep: bool = False,
    alike: bool = False,
    regularisation: float = 0.05,
    threads: int = 0,
) -> tuple[npt.NDArray[np.float32], list[float]]: ...
def point_distances(
    points: npt.NDArray[np.float32],
    sites: Sequence[int],
    cells: Sequence[npt.NDArray[np.int64]],
    fractions: Sequence[npt.NDArray[np.float32]],
    *,
    count: int,
    kept: int,
    farthest: float,
    threads: int = 0,
) -> npt.NDArray[np.float32]: ...
def random_field(
    images: list[tuple[int, npt.NDArray[np.float32], bool, float]],
    shape: tuple[int, int, int],
    *,
    seed: int,
    threads: int = 0,
) -> npt.NDArray[np.float32]: ...
def enlarge_periodic(
    volume: npt.NDArray[np.float32], shape: tuple[int, int, int], *, threads: int = 0
) -> npt.NDArray[np.float32]: ...
def gaussian(
    field: npt.NDArray[np.float32], sigma: float, *, boundary: str
) -> npt.NDArray[np.float32]: ...
def distance_transform(
    phase: npt.NDArray[np.bool_],
    voxel_size: tuple[float, float, float],
    *,
    boundary: str,
    cap: float | None = None,
    threads: int = 0,
) -> npt.NDArray[np.float32]: ...
def local_thickness(
    phase: npt.NDArray[np.bool_],
    voxel_size: tuple[float, float, float],
    *,
    boundary: str,
    threads: int = 0,
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
def label(
    solid: npt.NDArray[np.bool_], *, connectivity: int, boundary: str, threads: int = 0
) -> tuple[npt.NDArray[np.uint32], npt.NDArray[np.uint64]]: ...
def component_sizes(
    solid: npt.NDArray[np.bool_], *, connectivity: int, boundary: str, threads: int = 0
) -> npt.NDArray[np.uint64]: ...
def component_statistics(
    solid: npt.NDArray[np.bool_],
    *,
    connectivity: int,
    boundary: str,
    labels: bool = False,
    threads: int = 0,
) -> tuple[
    npt.NDArray[np.uint64],
    npt.NDArray[np.int64],
    npt.NDArray[np.float64],
    npt.NDArray[np.bool_],
    npt.NDArray[np.uint32] | None,
]: ...
def connect_phase(
    phase: npt.NDArray[np.bool_],
    score: npt.NDArray[np.float32],
    *,
    connectivity: int,
    boundary: str,
    smallest: int,
    width: float,
    free: npt.NDArray[np.bool_] | None = None,
    threads: int = 0,
) -> tuple[npt.NDArray[np.bool_], int, int, int, int]: ...
def recount_phase(
    phase: npt.NDArray[np.bool_],
    score: npt.NDArray[np.float32],
    wanted: int,
    *,
    connectivity: int,
    boundary: str,
    free: npt.NDArray[np.bool_] | None = None,
    threads: int = 0,
) -> tuple[npt.NDArray[np.bool_], int]: ...
def remove_branches(
    phase: npt.NDArray[np.bool_],
    places: npt.NDArray[np.uint32],
    radii: npt.NDArray[np.float32],
    branches: npt.NDArray[np.int64],
    *,
    manner: str,
    free: npt.NDArray[np.bool_] | None = None,
    threads: int = 0,
) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.uint64]]: ...
def cell_perimeters(
    nodes: int,
    branches: npt.NDArray[np.uint32],
    lengths: npt.NDArray[np.float64],
    asked: npt.NDArray[np.uint32],
    *,
    threads: int = 0,
) -> npt.NDArray[np.float64]: ...
def cavities(solid: npt.NDArray[np.bool_], *, connectivity: int, threads: int = 0) -> int: ...
def keep_parts(
    solid: npt.NDArray[np.bool_],
    size: int | None,
    *,
    connectivity: int,
    boundary: str,
    threads: int = 0,
) -> npt.NDArray[np.bool_]: ...
def euler_number(
    solid: npt.NDArray[np.bool_], *, connectivity: int, boundary: str, threads: int = 0
) -> int: ...
def euler_corrected(
    solid: npt.NDArray[np.bool_], *, connectivity: int, threads: int = 0
) -> tuple[int, int]: ...
def thin(
    solid: npt.NDArray[np.bool_], *, kind: str, method: str, threads: int = 0
) -> npt.NDArray[np.bool_]: ...
def skeleton_graph(
    skeleton: npt.NDArray[np.bool_],
    voxel_size: tuple[float, float, float],
    *,
    threads: int = 0,
) -> tuple[
    npt.NDArray[np.float64],
    npt.NDArray[np.uint8],
    npt.NDArray[np.int64],
    npt.NDArray[np.int64],
    npt.NDArray[np.float64],
    npt.NDArray[np.uint32],
    npt.NDArray[np.int64],
]: ...
def gray_moments(
    values: npt.NDArray[Any], *, threads: int = 0
) -> tuple[float, float, float, float]: ...
def binned_counts(
    values: npt.NDArray[Any], edges: npt.NDArray[np.float64], *, threads: int = 0
) -> npt.NDArray[np.uint64]: ...
def level_counts(
    values: npt.NDArray[Any], kind: str, *, threads: int = 0
) -> npt.NDArray[np.uint64]: ...
def match_histogram(
    source: npt.NDArray[Any],
    source_kind: str,
    reference: npt.NDArray[Any],
    reference_kind: str,
    out: npt.NDArray[Any],
    *,
    seed: int | None = None,
    threads: int = 0,
) -> None: ...
def two_point(
    first: npt.NDArray[np.bool_],
    r_max: int,
    *,
    boundary: str,
    voxel_size: tuple[float, float, float],
    second: npt.NDArray[np.bool_] | None = None,
    threads: int = 0,
) -> list[npt.NDArray[np.float64]]: ...
def secants(
    solid: npt.NDArray[np.bool_],
    reach: int,
    voxel_size: tuple[float, float, float],
    *,
    boundary: str,
    threads: int = 0,
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.float64], npt.NDArray[np.float64]]: ...
def surface_area(
    solid: npt.NDArray[np.bool_],
    voxel_size: tuple[float, float, float],
    *,
    method: str,
    boundary: str,
    threads: int = 0,
) -> tuple[float, float]: ...
def two_point_map(
    first: npt.NDArray[np.bool_],
    r_max: int,
    *,
    boundary: str,
    second: npt.NDArray[np.bool_] | None = None,
    threads: int = 0,
) -> npt.NDArray[np.float64]: ...
def two_point_cluster(
    labels: npt.NDArray[np.uint32],
    clusters: int,
    r_max: int,
    *,
    boundary: str,
    voxel_size: tuple[float, float, float],
    threads: int = 0,
) -> list[npt.NDArray[np.float64]]: ...
def run_lengths(
    solid: npt.NDArray[np.bool_], *, boundary: str, threads: int = 0
) -> list[tuple[npt.NDArray[np.uint64], npt.NDArray[np.uint64]]]: ...
def local_porosity(
    solid: npt.NDArray[np.bool_],
    window: tuple[int, int, int],
    bins: int,
    *,
    boundary: str,
    threads: int = 0,
) -> tuple[npt.NDArray[np.uint64], int, int, int]: ...
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
