"""Numbers that describe a volume, and numbers that compare two.

Functions of a phase take it as a bool array, or as numbers of which 0 is not in it; functions of
two volumes take the exemplar first. All take volumes or plain arrays, in C or Fortran order.
"""

from __future__ import annotations

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
    two_point_correlation,
    two_point_error,
)
from poresynth.metrics.fabric import Fabric, mean_intercept_length
from poresynth.metrics.fractions import porosity
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
from poresynth.metrics.skeleton import EndPoints, end_points, skeletonize
from poresynth.metrics.skeleton_graph import Branches, Nodes, SkeletonGraph, skeleton_graph
from poresynth.metrics.specimen import Specimen
from poresynth.metrics.structure_error import StructureDifference, StructureError, structure_error
from poresynth.metrics.surface import SurfaceArea, surface_area
from poresynth.metrics.topology import (
    BettiNumbers,
    Connectivity,
    EulerDensity,
    betti_numbers,
    connectivity_density,
    euler_density,
    euler_number,
)

__all__ = [
    "METRICS",
    "TRANSPORT_METRICS",
    "BettiNumbers",
    "Branches",
    "ComponentStatistics",
    "Components",
    "Connectivity",
    "EndPoints",
    "EulerDensity",
    "Fabric",
    "HistogramDistance",
    "Metric",
    "Morphometry",
    "Nodes",
    "Novelty",
    "Percolation",
    "SkeletonGraph",
    "Specimen",
    "StructureDifference",
    "StructureError",
    "SurfaceArea",
    "TwoPointCorrelation",
    "betti_numbers",
    "component_sizes",
    "component_statistics",
    "component_wasserstein",
    "components",
    "connectivity_density",
    "end_points",
    "euler_density",
    "euler_number",
    "floating_parts",
    "gradient_ratio",
    "histogram_distance",
    "label",
    "largest_component_fraction",
    "largest_part",
    "mean_gradient",
    "mean_intercept_length",
    "measure",
    "morphometry",
    "novelty",
    "novelty_curve",
    "percolation",
    "porosity",
    "remove_small_parts",
    "seam",
    "skeleton_graph",
    "skeletonize",
    "structure_error",
    "surface_area",
    "two_point_correlation",
    "two_point_error",
    "unit_of",
]
