"""Figures in words and in figures, for people who do not live by them."""

from __future__ import annotations

import math
import re

__all__ = ["explain", "number"]

# Label and question that the figure answers, by the figure's name.
WORDS = {
    "end_point_density": ("Dead ends", "Do more struts lead nowhere than in the exemplar?"),
    "euler_density": ("Euler density", "Does the solid form as many loops as the exemplar?"),
    "structure_error_percent": (
        "Structure error",
        "How far are connectivity, dead ends, thickness and surface off, on the whole?",
    ),
    "bv_tv": ("BV/TV", "How much of the volume is solid?"),
    "bs_bv": ("BS/BV", "Has the solid as much surface as the exemplar's?"),
    "tb_th": ("Tb.Th", "Are struts and walls as thick?"),
    "tb_sp": ("Tb.Sp", "Are the pores as wide?"),
    "tb_n": ("Tb.N", "Are there as many struts and walls on the way?"),
    "mil_mean": ("MIL", "How long is the way from one strut or wall to the next?"),
    "mil_anisotropy": ("Anisotropy DA", "Are struts and walls aligned as in the exemplar?"),
    "largest_pore_fraction": ("Largest pore", "How much of the pore space holds together?"),
    "connectivity_density": ("Conn.D", "Is the solid as strongly connected?"),
    "branch_length": ("Branch length", "Are the struts as long?"),
    "branch_tortuosity": ("Branch tortuosity", "Are the struts as bent?"),
    "solid_chord": ("Solid chords", "How long is the way through the solid?"),
    "pore_chord": ("Pore chords", "How long is the way through the pore?"),
    "porosity": ("Porosity", "How much of the volume is pore?"),
    "porosity_error_percent": ("Porosity error", "How far is the porosity from the exemplar's?"),
    "two_point_error_percent": (
        "Two-point error D2",
        "Do solid and pores have the right sizes and spacings?",
    ),
    "components": ("Separate parts", "Into how many parts does the solid fall?"),
    "components_per_million": (
        "Separate parts, equal sizes",
        "Are more struts broken off than in the exemplar?",
    ),
    "floating_parts": ("Floating specks", "How many tiny parts hang in the void?"),
    "floating_parts_per_million": (
        "Floating specks, equal sizes",
        "Are there more loose specks than in the exemplar?",
    ),
    "largest_component_fraction": ("Largest part", "How much of the solid holds together?"),
    "component_wasserstein": ("Sizes of the parts", "Are the parts as large as the exemplar's?"),
    "gradient_ratio": ("Sharpness", "Is the scan as crisp as the exemplar? Below 1 it is blurred."),
    "seam": ("Seam", "Does a plane stand out as a visible cut?"),
    "histogram_distance": ("Gray values", "Are the gray values those of the exemplar?"),
    "histogram_distance_percent": (
        "Gray values, relative",
        "The same against the exemplar's own contrast.",
    ),
    "copy_fraction": ("Copied share", "How much continues the exemplar word for word?"),
    "slice_score_percent": (
        "Slices' error",
        "How far are the slices from the images, on the whole?",
    ),
    "thickness": ("Thickness", "Are the walls in the slices as thick?"),
    "spacing": ("Spacing", "Are the pores in the slices as wide?"),
    "perimeter": ("Perimeter", "Has the solid in the slices as long a border?"),
    "holes": ("Holes", "Are as many pores closed in?"),
    "tips": ("Tips", "Do more walls in the slices end in the pore?"),
    "gradient": ("Sharpness", "Are the slices as crisp as the image?"),
    "mean_copied_block": ("Mean copied block", "How large are the copied blocks?"),
}
PATTERNS = {
    r"phase_fraction_(.+)": ("Share of phase {}", "How much of the volume is this phase?"),
    r"mean(?:_(.+))?": ("Mean {}", "Is it as bright?"),
    r"standard_deviation(?:_(.+))?": ("Standard deviation {}", "Has it as much contrast?"),
    r"novelty_(\d+)": ("Novelty, blocks of {}³", "Are blocks of this size new, or found again?"),
    r"novelty_(\d+)_mirrors": (
        "Novelty, {}³, mirrored",
        "The same when a mirrored copy counts as a copy, too.",
    ),
}


def explain(name: str) -> tuple[str, str]:
    """Return what a figure is called and which question it answers.

    Parameters
    ----------
    name : str
        Name of the figure.

    Returns
    -------
    (str, str)
        Label and question; for a figure without words its name, readable, and nothing.
    """
    if name in WORDS:
        return WORDS[name]
    for pattern, (label, question) in PATTERNS.items():
        if match := re.fullmatch(pattern, name):
            return label.format((match[1] or "").replace("_", " ")).strip(), question
    return name.replace("_", " "), ""


def number(value: float | None) -> str:
    """Write a number with four figures, as a person would."""
    if value is None or math.isnan(value):
        return "–"
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    if float(value).is_integer() and abs(value) < 1e9:
        return f"{int(value):,}".replace(",", " ")
    return f"{value:.4g}" if 1e-3 <= abs(value) < 1e6 else f"{value:.2e}"
