"""From a volume to a part that can be printed or computed with (zhang_2017 §5.4)."""

from __future__ import annotations

from poresynth.fabrication.hexahedra import write_inp
from poresynth.fabrication.loose import Cavities, LooseParts, closed_cavities, drop_loose_parts
from poresynth.fabrication.part import Part, make_part
from poresynth.fabrication.patches import with_patches
from poresynth.fabrication.report import FabricationReport
from poresynth.fabrication.surface import Surface, surface_of
from poresynth.fabrication.thickening import Thickening, thicken, weakness

__all__ = [
    "Cavities",
    "FabricationReport",
    "LooseParts",
    "Part",
    "Surface",
    "Thickening",
    "closed_cavities",
    "drop_loose_parts",
    "make_part",
    "surface_of",
    "thicken",
    "weakness",
    "with_patches",
    "write_inp",
]
