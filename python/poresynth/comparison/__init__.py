"""A synthetic volume beside its exemplar, in numbers."""

from __future__ import annotations

from poresynth.comparison.comparing import compare
from poresynth.comparison.result import Comparison, Curve, Figure, Histogram, Samples, mark

__all__ = ["Comparison", "Curve", "Figure", "Histogram", "Samples", "compare", "mark"]
