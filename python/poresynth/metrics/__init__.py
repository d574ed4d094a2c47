"""Numbers that describe a volume, and numbers that compare two.

Functions of a phase take it as a bool array, or as numbers of which 0 is not in it; functions of
two volumes take the exemplar first. All take volumes or plain arrays, in C or Fortran order.
"""

from __future__ import annotations

from poresynth.metrics.chords import (
    ChordDistribution,
    ChordLengths,
    LinealPath,
    chord_lengths,
    lineal_path,
)
from poresynth.metrics.connectivity import (
    Components,
    component_sizes,
    component_wasserstein,
    components,
    floating_parts,
    label,
    largest_component_fraction,
)
from poresynth.metrics.copying import Novelty, novelty, novelty_curve
from poresynth.metrics.correlation import (
    TwoPointCorrelation,
    TwoPointMap,
    TwoPointMatrix,
    two_point_cluster,
    two_point_correlation,
    two_point_cross,
    two_point_error,
    two_point_map,
    two_point_matrix,
)
from poresynth.metrics.distance import distance_transform
from poresynth.metrics.fabric import Fabric, mean_intercept_length
from poresynth.metrics.fractions import porosity
from poresynth.metrics.histograms import (
    ChannelStatistics,
    IntensityHistogram,
    channel_statistics,
    intensity_histogram,
    match_histogram,
)
from poresynth.metrics.intensity import (
    HistogramDistance,
    gradient_ratio,
    histogram_distance,
    mean_gradient,
    seam,
)
from poresynth.metrics.measurement import measure
from poresynth.metrics.morphometry import Morphometry, morphometry
from poresynth.metrics.parts import (
    ComponentStatistics,
    Percolation,
    component_statistics,
    largest_part,
    percolation,
    remove_small_parts,
)
from poresynth.metrics.registry import METRICS, TRANSPORT_METRICS, Metric, unit_of
from poresynth.metrics.sections import diagonal_sections, sections
from poresynth.metrics.skeleton import EndPoints, end_points, skeletonize
from poresynth.metrics.skeleton_graph import Branches, Nodes, SkeletonGraph, skeleton_graph
from poresynth.metrics.slice_statistics import (
    SliceScore,
    SliceStatistics,
    slice_score,
    slice_statistics,
)
from poresynth.metrics.specimen import Specimen
from poresynth.metrics.structure_error import StructureDifference, StructureError, structure_error
from poresynth.metrics.surface import SurfaceArea, surface_area
from poresynth.metrics.thickness import (
    PoreSizeDistribution,
    Thickness,
    local_thickness,
    pore_size_distribution,
    thickness,
    trabecular_separation,
    trabecular_thickness,
)
from poresynth.metrics.topology import (
    BettiNumbers,
    Connectivity,
    EulerDensity,
    betti_numbers,
    connectivity_density,
    euler_density,
    euler_number,
)
from poresynth.metrics.transport import (
    Diffusivity,
    Permeability,
    effective_diffusivity,
    permeability,
)
from poresynth.metrics.windows import LocalPorosity, local_porosity

__all__ = [
    "METRICS",
    "TRANSPORT_METRICS",
    "BettiNumbers",
    "Branches",
    "ChannelStatistics",
    "ChordDistribution",
    "ChordLengths",
    "ComponentStatistics",
    "Components",
    "Connectivity",
    "Diffusivity",
    "EndPoints",
    "EulerDensity",
    "Fabric",
    "HistogramDistance",
    "IntensityHistogram",
    "LinealPath",
    "LocalPorosity",
    "Metric",
    "Morphometry",
    "Nodes",
    "Novelty",
    "Percolation",
    "Permeability",
    "PoreSizeDistribution",
    "SkeletonGraph",
    "SliceScore",
    "SliceStatistics",
    "Specimen",
    "StructureDifference",
    "StructureError",
    "SurfaceArea",
    "Thickness",
    "TwoPointCorrelation",
    "TwoPointMap",
    "TwoPointMatrix",
    "betti_numbers",
    "channel_statistics",
    "chord_lengths",
    "component_sizes",
    "component_statistics",
    "component_wasserstein",
    "components",
    "connectivity_density",
    "diagonal_sections",
    "distance_transform",
    "effective_diffusivity",
    "end_points",
    "euler_density",
    "euler_number",
    "floating_parts",
    "gradient_ratio",
    "histogram_distance",
    "intensity_histogram",
    "label",
    "largest_component_fraction",
    "largest_part",
    "lineal_path",
    "local_porosity",
    "local_thickness",
    "match_histogram",
    "mean_gradient",
    "mean_intercept_length",
    "measure",
    "morphometry",
    "novelty",
    "novelty_curve",
    "percolation",
    "permeability",
    "pore_size_distribution",
    "porosity",
    "remove_small_parts",
    "seam",
    "sections",
    "skeleton_graph",
    "skeletonize",
    "slice_score",
    "slice_statistics",
    "structure_error",
    "surface_area",
    "thickness",
    "trabecular_separation",
    "trabecular_thickness",
    "two_point_cluster",
    "two_point_correlation",
    "two_point_cross",
    "two_point_error",
    "two_point_map",
    "two_point_matrix",
    "unit_of",
]
