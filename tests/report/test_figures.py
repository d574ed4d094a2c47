"""Charts of a report."""

from __future__ import annotations

import math
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure

from poresynth.comparison import Curve, Histogram, Samples
from poresynth.report import figures

R = list(range(11))
FALLING = np.exp(-np.arange(11) / 3)
CURVE = Curve(R, *(list(FALLING + shift) for shift in (0, 0.1, -0.1, 0.2)))
GRAY = Histogram(R, [0.1] * 10, [0.2] * 5 + [0.0] * 5)
RECORDS = [
    SimpleNamespace(level=level, window=window, iteration=i, energy=energy / (i + 1))
    for level, window, energy in [(1, 8, 9e4), (1, 4, 2e4), (0, 4, 1e3)]
    for i in range(3)
]
NAN = math.nan
PLOTS = {
    "two_point": figures.two_point(CURVE),
    "histogram": figures.histogram(GRAY, 4.5),
    "novelty": figures.novelty({12: (0.5, 0.4), 20: (0.7, 0.6), 32: (1.3, 1.2)}),
    "novelty of small blocks only": figures.novelty({12: (0.5, 0.4), 20: (NAN, NAN)}),
    "energy": figures.energy(RECORDS),
    "one energy of 0": figures.energy([SimpleNamespace(level=0, window=4, iteration=0, energy=0)]),
}


def axes_of(name: str) -> object:
    axes = Figure().add_subplot()
    PLOTS[name](axes, figures.LIGHT)
    return axes


@pytest.mark.parametrize("theme", [figures.LIGHT, figures.DARK], ids=["light", "dark"])
@pytest.mark.parametrize("name", PLOTS)
def test_a_chart_is_a_picture(name: str, theme: figures.Theme) -> None:
    assert figures.draw(PLOTS[name], theme).startswith(b"\x89PNG")


def test_the_global_state_of_matplotlib_is_left_alone() -> None:
    assert (
        "matplotlib.pyplot" not in sys.modules or not sys.modules["matplotlib.pyplot"].get_fignums()
    )


def test_histograms_are_shares() -> None:
    stairs = axes_of("histogram").patches
    assert all(patch.get_data().values.sum() == pytest.approx(100) for patch in stairs)


def test_each_level_and_window_is_named_once() -> None:
    texts = [text.get_text() for text in axes_of("energy").texts]
    assert texts == ["level 1\n8³", "level 1\n4³", "level 0\n4³"]


def test_energies_that_fall_far_are_drawn_logarithmically() -> None:
    assert axes_of("energy").get_yscale() == "log"
    assert axes_of("one energy of 0").get_yscale() == "linear"


def test_boxes_are_drawn_also_where_values_are_missing() -> None:
    samples = {
        "tb_th": Samples([4.0, 5.0, 6.0], [5.0, NAN, 50.0]),
        "tb_sp": Samples([NAN, NAN], [1.0, 2.0]),
        "euler_density": Samples([-1.0, -1.0], [-1.0, -1.0]),
    }
    axes = Figure().add_subplot()
    figures.boxes(samples)(axes, figures.LIGHT)
    assert [label.get_text() for label in axes.get_yticklabels()] == ["Tb.Th", "Euler density"]
