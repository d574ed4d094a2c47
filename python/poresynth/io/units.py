"""Units of length: the spellings that files use, and their ratios."""

from __future__ import annotations

__all__ = ["MILLIMETRES", "OME_NAMES", "convert", "spell"]

#: Millimetres in one unit, for the units that files can name.
MILLIMETRES = {"nm": 1e-6, "µm": 1e-3, "mm": 1.0, "cm": 10.0, "m": 1000.0, "inch": 25.4}

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
    """Return lengths in another unit; both must be in `MILLIMETRES`."""
    # A division keeps 19.5 µm → 0.0195 mm → 19.5 µm exact where a reciprocal would not.
    ratio = MILLIMETRES[to] / MILLIMETRES[unit]
    z, y, x = (s / ratio for s in size)
    return z, y, x
