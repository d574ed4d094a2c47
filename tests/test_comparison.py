"""The comparison: its figures, its marks, its JSON."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
import tifffile
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

import poresynth
from poresynth import metrics
from poresynth.comparison import Comparison, Figure, compare, mark
from poresynth.errors import ParameterError
from poresynth.exemplars import spheres, spinodal
from poresynth.volume import Volume

NAN = float("nan")
SHAPE = (48, 44, 40)
ALWAYS = {
    "porosity",
    "porosity_error_percent",
    "two_point_error_percent",
    "components",
    "components_per_million",
    "floating_parts",
    "floating_parts_per_million",
    "largest_component_fraction",
    "component_wasserstein",
    "gradient_ratio",
    "seam",
    "novelty_12",
    "novelty_12_mirrors",
    "novelty_20",
    "novelty_20_mirrors",
    "novelty_32",
    "novelty_32_mirrors",
    "structure_error_percent",
} | {name for name, metric in metrics.METRICS.items() if metric.tolerance is not None}
GRAY = {"histogram_distance", "histogram_distance_percent"}


@pytest.fixture(scope="module")
def exemplar() -> Volume:
    return spinodal(SHAPE, wavelength=10, seed=1, voxel_size=39.0, unit="µm")


@pytest.fixture(scope="module")
def volume() -> Volume:
    return spinodal((40, 48, 56), wavelength=10, seed=2, voxel_size=39.0, unit="µm")


@pytest.fixture(scope="module")
def comparison(exemplar: Volume, volume: Volume) -> Comparison:
    return compare(exemplar, volume)


def test_the_figures_are_those_of_the_metrics(
    exemplar: Volume, volume: Volume, comparison: Comparison
) -> None:
    threshold = poresynth.threshold(exemplar)
    assert comparison.threshold == threshold
    e, v = exemplar.array > threshold, volume.array > threshold
    assert set(comparison.figures) == ALWAYS | GRAY
    expected = {
        "porosity": (metrics.porosity(v), metrics.porosity(e)),
        "porosity_error_percent": (
            100 * abs(metrics.porosity(e) - metrics.porosity(v)) / metrics.porosity(e),
            0,
        ),
        "two_point_error_percent": (metrics.two_point_error(e, v), 0),
        "components": (metrics.components(v), metrics.components(e)),
        "floating_parts": (metrics.floating_parts(v), metrics.floating_parts(e)),
        "largest_component_fraction": tuple(metrics.largest_component_fraction(s) for s in (v, e)),
        "gradient_ratio": (metrics.gradient_ratio(exemplar, volume), 1),
        "seam": (metrics.seam(exemplar, volume), 1),
        "histogram_distance": (metrics.histogram_distance(exemplar, volume).gray_levels, 0),
        "novelty_20_mirrors": (metrics.novelty(exemplar, volume, 20).mirrored, None),
    }
    for name, (value, own) in expected.items():
        figure = comparison.figures[name]
        assert figure.name == name
        assert figure.value == pytest.approx(value), name
        assert figure.exemplar == (None if own is None else pytest.approx(own)), name


def test_metrics_are_means_over_parts_of_one_size(comparison: Comparison) -> None:
    assert list(comparison.figures)[:2] == ["end_point_density", "euler_density"]
    for name, sample in comparison.samples.items():
        figure = comparison.figures[name]
        assert len(sample.exemplar) == len(sample.volume) == 8
        assert figure.value == pytest.approx(np.nanmean(sample.volume)), name
        assert figure.exemplar == pytest.approx(np.nanmean(sample.exemplar)), name
        assert figure.low == pytest.approx(np.nanmin(sample.exemplar)), name
    numbers = comparison.to_dict()
    assert numbers["tb_th_in_unit"] == pytest.approx(39.0 * numbers["tb_th"])
    assert numbers["bs_bv_in_unit"] == pytest.approx(numbers["bs_bv"] / 39.0)
    assert numbers["euler_density_in_unit"] == pytest.approx(numbers["euler_density"] / 39.0**3)


def test_what_is_compared_with_what_is_of_one_size(comparison: Comparison) -> None:
    assert comparison.subvolume_shape == (24, 22, 20)
    per_million = comparison.figures["components_per_million"]
    step = 1e6 / (24 * 22 * 20)
    assert per_million.low is not None
    assert per_million.low / step == pytest.approx(round(per_million.low / step))


def test_another_specimen_passes(comparison: Comparison) -> None:
    judged = {name: f.mark for name, f in comparison.figures.items() if f.mark != "info"}
    structure = [mark for name, mark in judged.items() if not name.startswith("novelty")]
    # Parts of one small specimen differ less than two specimens do.
    assert "off" not in structure
    assert structure.count("pass") >= len(structure) - 2


def test_a_copy_passes_everything_but_novelty(exemplar: Volume) -> None:
    found = compare(exemplar, exemplar).figures
    for name, figure in found.items():
        if name.startswith("novelty_12"):
            assert (figure.value, figure.mark) == (0, "off")
        elif not name.startswith("novelty"):
            assert figure.mark in ("pass", "info"), name


def test_faults_are_seen(exemplar: Volume, volume: Volume, rng: np.random.Generator) -> None:
    gray = volume.array.astype(float)
    speckled = np.where(rng.random(gray.shape) < 0.01, 255 - gray, gray)
    halves = gray.copy()
    halves[:, 24:] = gray[::-1, 24:, ::-1]
    cases = {
        "gradient_ratio": ndimage.gaussian_filter(gray, 1),
        "floating_parts_per_million": speckled,
        "porosity_error_percent": gray + 40,
        "two_point_error_percent": spheres(SHAPE, porosity=0.8, seed=1).array,
        "seam": halves,
    }
    for name, faulty in cases.items():
        found = compare(exemplar, Volume(faulty.clip(0, 255).astype(np.uint8))).figures
        assert found[name].mark in ("near", "off"), (name, found[name])


def test_the_curves_are_complete(comparison: Comparison) -> None:
    names = ["two_point", "two_point_z", "two_point_y", "two_point_x", "histogram"]
    assert list(comparison.curves) == names
    for name in names[:-1]:
        curve = comparison.curves[name]
        assert curve.r == list(range(len(curve.r)))
        assert len(curve.r) > 15
        for values in (curve.volume, curve.exemplar, curve.low, curve.high):
            assert len(values) == len(curve.r)
            assert all(0 <= v <= 1 for v in values)
        assert all(low <= high for low, high in zip(curve.low, curve.high, strict=True))
    histogram = comparison.curves["histogram"]
    assert np.sum(histogram.volume) == pytest.approx(1)
    assert np.sum(histogram.exemplar) == pytest.approx(1)
    assert len(histogram.edges) == len(histogram.volume) + 1 <= 129
    assert np.unique(np.diff(histogram.edges)).size == 1


def test_the_histogram_counts_what_numpy_counts(exemplar: Volume, volume: Volume) -> None:
    for dtype in (np.uint8, np.int32, np.float32):
        e, v = (Volume(w.array.astype(dtype)) for w in (exemplar, volume))
        found = compare(e, v, subvolumes=2).curves["histogram"]
        for values, own in ((e, found.exemplar), (v, found.volume)):
            expected = np.histogram(values.array, found.edges)[0] / values.array.size
            np.testing.assert_allclose(own, expected, atol=1e-3)


def test_json_is_flat_and_valid(comparison: Comparison) -> None:
    document = comparison.to_dict()
    json.dumps(document, allow_nan=False)
    for name in ALWAYS | GRAY:
        assert name in document
        assert document[f"{name}_mark"] in ("pass", "near", "off", "info")
    assert document["porosity_low"] <= document["porosity_high"]
    assert document["novelty_32"] is None
    assert document["unit"] == "µm"
    assert not any(isinstance(value, dict) for value in document.values())


def test_the_record_of_copying_is_reported_in_voxels_and_in_the_unit(
    exemplar: Volume, volume: Volume
) -> None:
    record = {"copying": {"copy_fraction": 0.25, "mean_copied_block": 8.0}}
    found = compare(
        exemplar, Volume(volume.array, (2.0, 4.0, 1.0), "µm", {"poresynth": record})
    ).to_dict()
    assert (found["copy_fraction"], found["mean_copied_block"]) == (0.25, 8.0)
    assert found["mean_copied_block_in_unit"] == pytest.approx(16.0)
    assert found["copy_fraction_mark"] == "info"


def test_threads_seed_and_memory_order(exemplar: Volume, volume: Volume) -> None:
    expected = compare(exemplar, volume, seed=3, threads=1).to_dict()
    assert compare(exemplar, volume, seed=3, threads=3).to_dict() == expected
    assert compare(exemplar, volume, seed=4).to_dict() != expected
    fortran = volume.with_array(np.asfortranarray(volume.array))
    for name, value in compare(exemplar, fortran, seed=3).to_dict().items():
        # Sums of floats depend on their order.
        assert value == expected[name] or value == pytest.approx(expected[name]), name


@pytest.mark.parametrize("values", [(0, 1), (0, 255), (3, 7)])
def test_the_names_of_two_values_do_not_matter(
    exemplar: Volume, volume: Volume, values: tuple[int, int]
) -> None:
    threshold = poresynth.threshold(exemplar)
    e, v = exemplar.array > threshold, volume.array > threshold
    expected = compare(e, v).to_dict()
    found = compare(e, np.where(v, values[1], values[0]).astype(np.uint8)).to_dict()
    assert found == expected
    assert expected["kind"] == "binary"
    assert "histogram_distance" not in expected
    dark = compare(~e, ~v, solid="dark").to_dict()
    assert dark == {**expected, "solid": "dark"}


def test_labels_are_phases(rng: np.random.Generator) -> None:
    def layers(shape: tuple[int, int, int]) -> np.ndarray:
        field = ndimage.gaussian_filter(rng.standard_normal(shape), 2, mode="wrap")
        return np.digitize(field, np.quantile(field, [0.5, 0.8])).astype(np.uint8) + 4

    e, v = layers((32, 32, 32)), layers((36, 30, 40))
    found = compare(e, v)
    assert (found.kind, found.threshold) == ("label", 4.5)
    assert found.figures["porosity"].value == pytest.approx(0.5, abs=0.01)
    shares = [found.figures[f"phase_fraction_{label}"].value for label in (4, 5, 6)]
    assert shares == pytest.approx([np.mean(v == label) for label in (4, 5, 6)])
    assert "histogram" not in found.curves
    assert compare(e, v, solid="dark").figures["porosity"].value == pytest.approx(shares[2])


def test_the_first_channel_is_compared(exemplar: Volume, volume: Volume) -> None:
    expected = compare(exemplar, volume).to_dict()
    e, v = (
        Volume(np.stack([w.array, w.array[::-1]], axis=-1), w.voxel_size, w.unit)
        for w in (exemplar, volume)
    )
    assert compare(e, v).to_dict() == expected
    with pytest.raises(ParameterError, match=r"^volume.channels = 1: must be 2"):
        compare(e, volume)


def test_small_volumes_have_what_figures_they_can() -> None:
    for shape in ((2, 2, 2), (1, 3, 4), (3, 2, 9)):
        gray = np.arange(math.prod(shape), dtype=np.uint8).reshape(shape) * 5
        json.dumps(compare(gray, gray[:, ::-1]).to_dict(), allow_nan=False)


def test_progress_is_told(exemplar: Volume, volume: Volume) -> None:
    heard: list[tuple[str, float]] = []
    compare(exemplar, volume, progress=lambda stage, share: heard.append((stage, share)))
    shares = [share for _, share in heard]
    assert shares == sorted(shares)
    assert (shares[0], shares[-1]) == (0, 1)
    assert all(stage for stage, _ in heard)


def test_the_function_may_be_called_by_the_name_of_its_module(exemplar: Volume) -> None:
    assert isinstance(poresynth.compare(exemplar, exemplar, subvolumes=2), Comparison)


@pytest.mark.parametrize("which", ["exemplar", "volume"])
@pytest.mark.parametrize(
    "bad",
    [
        np.zeros((8, 8, 8), np.uint8),
        np.zeros((0, 8, 8)),
        np.full((8, 8, 8), np.nan),
        np.full((8, 8, 8), np.inf),
        np.eye(8),
        np.arange(8.0),
        np.stack([np.ones((8, 8, 8)), np.random.default_rng(0).random((8, 8, 8))], axis=-1),
    ],
    ids=["constant", "empty", "NaN", "infinite", "2D", "1D", "constant first channel"],
)
def test_bad_volumes_are_named(which: str, bad: np.ndarray, rng: np.random.Generator) -> None:
    good = rng.random((8, 8, 8, 2) if bad.ndim == 4 else (8, 8, 8))
    volumes = {"exemplar": good, "volume": good, which: bad}
    with pytest.raises(ParameterError, match=rf"({which}|array).* = .*: must "):
        compare(**volumes)


@pytest.mark.parametrize(
    ("options", "parameter"),
    [
        ({"threshold": 300}, "threshold"),
        ({"solid": "white"}, "solid"),
        ({"subvolumes": 1}, "subvolumes"),
        ({"subvolumes": 2.5}, "subvolumes"),
        ({"seed": -1}, "seed"),
    ],
)
def test_bad_parameters_are_named(
    exemplar: Volume, options: dict[str, object], parameter: str
) -> None:
    with pytest.raises(ParameterError, match=rf"^{parameter} = .*: must be "):
        compare(exemplar, exemplar, **options)


@pytest.mark.parametrize(
    ("value", "expected"),
    [(5, "pass"), (7, "pass"), (9, "near"), (9.1, "off"), (4, "pass"), (3, "near"), (2.9, "off")],
)
def test_the_range_is_stretched_about_the_ideal(value: float, expected: str) -> None:
    assert mark(value, 5, 4, 7) == expected


def test_a_figure_may_be_better_than_the_exemplar() -> None:
    assert mark(0, 5, 4, 7, better="smaller") == "pass"
    assert mark(10, 5, 4, 7, better="smaller") == "off"
    assert mark(10, 5, 4, 7, better="larger") == "pass"
    assert mark(0, 5, 4, 7, better="larger") == "off"


def test_a_tolerance_widens_a_narrow_range_only() -> None:
    assert mark(1, 0, 0, 0.1, tolerance=1) == "pass"
    assert mark(2, 0, 0, 0.1, tolerance=1) == "near"
    assert mark(3, 0, 0, 4, tolerance=1) == "pass"
    assert mark(1.4, 1, None, None, tolerance=0.5) == "pass"
    assert mark(NAN, 1, None, None, tolerance=0.5) == "info"


finite = st.floats(-1e3, 1e3)


@given(finite, finite, finite, finite, st.floats(0, 1e3))
def test_the_ideal_passes_and_marks_get_worse_away_from_it(
    ideal: float, low: float, high: float, value: float, tolerance: float
) -> None:
    low, high = sorted((low, high))
    assert mark(ideal, ideal, low, high, tolerance=tolerance) == "pass"
    grades = ["pass", "near", "off"]
    nearer = (value + ideal) / 2
    first, second = (mark(v, ideal, low, high, tolerance=tolerance) for v in (nearer, value))
    assert grades.index(first) <= grades.index(second)


def test_a_figure_without_a_range_is_information() -> None:
    assert Figure("anything", 3.0).mark == "info"


def test_specimens_of_one_rock_are_alike(data_dir: Path) -> None:
    rock = tifffile.imread(data_dir / "berea_sandstone_binary_200.tif")
    # Expected: measured once with SciPy, scikit-image, cc3d and NumPy alone.
    found = compare(rock[:100, :100, :100], rock[100:, 100:, 100:]).figures
    expected = {
        "porosity": (0.185004, 0.203317),
        "two_point_error_percent": (4.314629, 0),
        "components": (4, 8),
        "floating_parts": (2, 3),
        "largest_component_fraction": (0.9999791, None),
        "gradient_ratio": (0.9421497, 1),
        "seam": (1.07436, 1),
    }
    for key, (value, own) in expected.items():
        assert found[key].value == pytest.approx(value, rel=2e-6)
        assert own is None or found[key].exemplar == pytest.approx(own)
    assert all(f.mark in ("pass", "near", "info") for f in found.values())
