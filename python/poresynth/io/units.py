"""Units of length: the spellings that files use, and their ratios."""

from __future__ import annotations

__all__ = ["NANOMETRES", "OME_NAMES", "convert", "spell"]

#: Nanometres in one unit, for the units that files can name: whole numbers, so that 0.0195 mm is
#: 19.5 µm without a rounding error.
NANOMETRES = {
    "nm": 1,
    "µm": 1_000,
    "mm": 1_000_000,
    "cm": 10_000_000,
    "m": 1_000_000_000,
    "inch": 25_400_000,
}

#: The names that OME-NGFF gives to the units.
OME_NAMES = {
    "nm": "nanometer",
    "µm": "micrometer",
    "mm": "millimeter",
    "cm": "centimeter",
    "m": "meter",
    "inch": "inch",
}

_SPELLINGS = {
    "um": "µm",
    "μm": "µm",  # Greek mu; the micro sign is the one kept.
    "\\u00b5m": "µm",  # ImageJ's escape.
    "micron": "µm",
    "microns": "µm",
    "in": "inch",
    "inches": "inch",
    "": "voxel",
    "pixel": "voxel",
    "pixels": "voxel",
    "voxels": "voxel",
    **{name: unit for unit, name in OME_NAMES.items()},
    **{name.replace("meter", "metre"): unit for unit, name in OME_NAMES.items()},
}


def spell(unit: str) -> str:
    """Return a unit in the package's spelling: ``"µm"``; ``"voxel"`` if it says no scale."""
    unit = unit.strip().strip('"')
    return _SPELLINGS.get(unit.lower(), unit)


def convert(size: tuple[float, float, float], unit: str, to: str) -> tuple[float, float, float]:
    """Return lengths in another unit; both must be in `NANOMETRES`."""
    z, y, x = (s * NANOMETRES[unit] / NANOMETRES[to] for s in size)
    return z, y, x
