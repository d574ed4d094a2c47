"""A synthetic volume beside its exemplar, or beside images, in numbers."""

from __future__ import annotations

from poresynth.comparison.comparing import compare
from poresynth.comparison.result import (
    Comparison,
    Curve,
    Figure,
    Histogram,
    Samples,
    SectionComparison,
    VolumeComparison,
    mark,
)
from poresynth.comparison.sections import compare_sections

__all__ = [
    "Comparison",
    "Curve",
    "Figure",
    "Histogram",
    "Samples",
    "SectionComparison",
    "VolumeComparison",
    "compare",
    "compare_sections",
    "mark",
]
