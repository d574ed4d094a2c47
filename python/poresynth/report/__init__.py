"""Reports: numbers first, pictures second."""

from __future__ import annotations

from poresynth.report.part_page import write_part_report
from poresynth.report.pruning import write_pruning_report
from poresynth.report.writer import reserved, write_report

__all__ = ["reserved", "write_part_report", "write_pruning_report", "write_report"]
