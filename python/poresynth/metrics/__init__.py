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
from poresynth.metrics.copying import Novelty, novelty
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
from poresynth.metrics.registry import METRICS, Metric, measure, metric
from poresynth.metrics.windows import LocalPorosity, local_porosity

__all__ = [
    "METRICS",
    "ChannelStatistics",
    "ChordDistribution",
    "ChordLengths",
    "Components",
    "HistogramDistance",
    "IntensityHistogram",
    "LinealPath",
    "LocalPorosity",
    "Metric",
    "Novelty",
    "TwoPointCorrelation",
    "TwoPointMap",
    "TwoPointMatrix",
    "channel_statistics",
    "chord_lengths",
    "component_sizes",
    "component_wasserstein",
    "components",
    "floating_parts",
    "gradient_ratio",
    "histogram_distance",
    "intensity_histogram",
    "label",
    "largest_component_fraction",
    "lineal_path",
    "local_porosity",
    "match_histogram",
    "mean_gradient",
    "measure",
    "metric",
    "novelty",
    "porosity",
    "seam",
    "two_point_cluster",
    "two_point_correlation",
    "two_point_cross",
    "two_point_error",
    "two_point_map",
    "two_point_matrix",
]
