"""What was made of a volume, in figures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from poresynth.fabrication.part import Part
from poresynth.fabrication.surface import Surface

__all__ = ["FabricationReport", "Figure"]


@dataclass(frozen=True)
class Figure:
    """A figure of a part.

    Attributes
    ----------
    name : str
        Its key in JSON; of a pair, with ``_before`` and ``_after``.
    before, after : float, int, bool or None
        Values; a figure that only the result has is None before.
    unit : str
        Unit.
    says : str
        What it is, in a line.
    """

    name: str
    before: Any
    after: Any
    unit: str
    says: str


@dataclass(frozen=True, eq=False)
class FabricationReport:
    """What was made of a volume.

    Attributes
    ----------
    part : Part
        The part.
    surface : Surface or None
        Its surface; None where voxels were written.
    """

    part: Part
    surface: Surface | None = None

    def figures(self) -> list[Figure]:
        """Return the figures in the order of reading."""
        part, unit = self.part, self.part.unit
        found = [
            Figure(
                "porosity",
                part.porosity(part.before),
                part.porosity(part.inside),
                "",
                "share of pore in the shape",
            ),
            Figure("loose_parts", part.loose.found, None, "", "parts that nothing holds"),
            Figure(
                "loose_voxels_removed",
                None,
                part.loose.removed_voxels,
                "voxels",
                "what was removed of them",
            ),
        ]
        if part.thickening is not None:
            made = part.thickening
            found += [
                Figure(
                    "weak_places",
                    made.weak_places_before,
                    made.weak_places_after,
                    "",
                    f"struts, walls and necks thinner than {made.minimum:g} {unit}",
                ),
                Figure(
                    "thin_percent",
                    made.thin_percent_before,
                    made.thin_percent_after,
                    "%",
                    "share of the part with a smaller local thickness, sharp edges included",
                ),
                Figure(
                    "thickness",
                    made.thickness_before,
                    made.thickness_after,
                    unit,
                    "mean local thickness",
                ),
            ]
        what = "pores" if part.phase == "solid" else "islands of solid"
        found += [
            Figure("cavities", None, part.cavities.count, "", f"closed {what}"),
            Figure("cavity_volume", None, part.cavities.volume, f"{unit}³", "their volume"),
        ]
        if self.surface is not None:
            mesh = self.surface.report
            found += [
                Figure("triangles", None, mesh.triangles, "", "triangles of the surface"),
                Figure("shells", None, mesh.shells, "", "separate surfaces, also of cavities"),
                Figure(
                    "watertight", None, mesh.watertight, "", "closed: two triangles at every edge"
                ),
                Figure("oriented", None, mesh.oriented, "", "all triangles look outwards"),
                Figure("crossings", None, mesh.crossings, "", "triangles that pass through others"),
                Figure("mesh_volume", None, mesh.volume, f"{unit}³", "volume inside the surface"),
                Figure("mesh_area", None, mesh.area, f"{unit}²", "area of the surface"),
                Figure(
                    "volume_error_percent",
                    None,
                    self.surface.volume_error_percent,
                    "%",
                    "difference of the volume from that of the voxels",
                ),
                Figure(
                    "area_error_percent",
                    None,
                    self.surface.area_error_percent,
                    "%",
                    "difference of the area from Crofton's estimate for the voxels",
                ),
            ]
        return found

    def warnings(self) -> list[str]:
        """Return what a person should look at before the part is made, a sentence each."""
        said = []
        part = self.part
        if part.phase == "solid" and part.cavities.count:
            said.append(
                f"{part.cavities.count} closed pores of {part.cavities.volume:.3g} {part.unit}³ in "
                "all trap powder or resin: leave drain holes"
            )
        if part.thickening is not None and part.thickening.weak_places_after:
            said.append(
                f"{part.thickening.weak_places_after} places are still thinner than "
                f"{part.thickening.minimum:g} {part.unit}: the shape leaves no room there"
            )
        if self.surface is not None and not self.surface.agrees:
            said.append(
                "volume or area of the surface differ from those of the voxels by more than usual: "
                "its features are hardly wider than a voxel, or it was smoothed too much"
            )
        return said

    def to_dict(self) -> dict[str, Any]:
        """Return all figures by name, flat and JSON-compatible."""
        found: dict[str, Any] = {
            "phase": self.part.phase,
            "unit": self.part.unit,
            "voxel_size": list(self.part.voxel_size),
            "origin": list(self.part.origin),
        }
        for figure in self.figures():
            if figure.before is not None and figure.after is not None:
                found[f"{figure.name}_before"] = figure.before
                found[f"{figure.name}_after"] = figure.after
            else:
                found[figure.name] = figure.after if figure.before is None else figure.before
        found["warnings"] = self.warnings()
        return found
