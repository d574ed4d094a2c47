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
from poresynth.metrics.fractions import porosity
from poresynth.metrics.intensity import (
    HistogramDistance,
    gradient_ratio,
    histogram_distance,
    mean_gradient,
    seam,
)
from poresynth.metrics.registry import METRICS, Metric, measure, metric
from poresynth.metrics.transport import (
    Diffusivity,
    Permeability,
    effective_diffusivity,
    permeability,
)

__all__ = [
    "METRICS",
    "Components",
    "Diffusivity",
    "HistogramDistance",
    "Metric",
    "Novelty",
    "Permeability",
    "TwoPointCorrelation",
    "component_sizes",
    "component_wasserstein",
    "components",
    "effective_diffusivity",
    "floating_parts",
    "gradient_ratio",
    "histogram_distance",
    "label",
    "largest_component_fraction",
    "mean_gradient",
    "measure",
    "metric",
    "novelty",
    "permeability",
    "porosity",
    "seam",
    "two_point_correlation",
    "two_point_error",
]
