from __future__ import annotations

import pytest

from poresynth.io.units import NANOMETRES, OME_NAMES, convert, spell


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ("um", "µm"),
        ("\u03bcm", "µm"),
        ("\\u00B5m", "µm"),
        ("micron", "µm"),
        ("micrometer", "µm"),
        ("Millimetre", "mm"),
        ("pixel", "voxel"),
        ("", "voxel"),
        ('"mm"', "mm"),
        ("furlong", "furlong"),
    ],
)
def test_spellings(given: str, expected: str) -> None:
    assert spell(given) == expected


def test_units_have_names_and_are_their_own_spelling() -> None:
    assert NANOMETRES.keys() == OME_NAMES.keys()
    assert all(spell(unit) == unit == spell(OME_NAMES[unit]) for unit in NANOMETRES)


def test_conversion_has_no_rounding_error_where_people_look() -> None:
    assert convert((19.5, 39.0, 3.0), "µm", "mm") == (0.0195, 0.039, 0.003)
    assert convert((0.0195, 0.039, 0.003), "mm", "µm") == (19.5, 39.0, 3.0)
    assert convert((1, 1, 1), "inch", "cm") == (2.54, 2.54, 2.54)
