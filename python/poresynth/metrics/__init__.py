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
from poresynth.metrics.copying import Novelty, novelty
from poresynth.metrics.correlation import (
    TwoPointCorrelation,
    two_point_correlation,
    two_point_error,
)
from poresynth.metrics.distance import distance_transform
from poresynth.metrics.fractions import porosity
from poresynth.metrics.intensity import (
    HistogramDistance,
    gradient_ratio,
    histogram_distance,
    mean_gradient,
    seam,
)
from poresynth.metrics.registry import METRICS, Metric, measure, metric
from poresynth.metrics.thickness import (
    PoreSizeDistribution,
    Thickness,
    local_thickness,
    pore_size_distribution,
    thickness,
    trabecular_separation,
    trabecular_thickness,
)

__all__ = [
    "METRICS",
    "Components",
    "HistogramDistance",
    "Metric",
    "Novelty",
    "PoreSizeDistribution",
    "Thickness",
    "TwoPointCorrelation",
    "component_sizes",
    "component_wasserstein",
    "components",
    "distance_transform",
    "floating_parts",
    "gradient_ratio",
    "histogram_distance",
    "label",
    "largest_component_fraction",
    "local_thickness",
    "mean_gradient",
    "measure",
    "metric",
    "novelty",
    "pore_size_distribution",
    "porosity",
    "seam",
    "thickness",
    "trabecular_separation",
    "trabecular_thickness",
    "two_point_correlation",
    "two_point_error",
]
