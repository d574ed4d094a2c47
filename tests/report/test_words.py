"""Figures in words and in figures."""

from __future__ import annotations

import math

import pytest

from poresynth.report.words import explain, number


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "–"),
        (math.nan, "–"),
        (math.inf, "∞"),
        (0, "0"),
        (1.0, "1"),
        (1234567, "1 234 567"),
        (0.81234, "0.8123"),
        (-412.5, "-412.5"),
        (0.0000123, "1.23e-05"),
        (1.5e9, "1.50e+09"),
    ],
)
def test_numbers_are_written_for_people(value: float | None, text: str) -> None:
    assert number(value) == text


@pytest.mark.parametrize(
    ("name", "label"),
    [
        ("porosity", "Porosity"),
        ("novelty_12", "Novelty, blocks of 12³"),
        ("novelty_32_mirrors", "Novelty, 32³, mirrored"),
        ("phase_fraction_3", "Share of phase 3"),
        ("of_another_kind", "of another kind"),
    ],
)
def test_figures_have_labels(name: str, label: str) -> None:
    assert explain(name)[0] == label
