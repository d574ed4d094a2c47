"""Sections of volumes beside images: figures, marks, JSON."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import tifffile
from scipy import ndimage

import poresynth
from poresynth import metrics
from poresynth.comparison import SectionComparison, VolumeComparison, compare, compare_sections
from poresynth.errors import ParameterError
from poresynth.exemplars import spinodal
from poresynth.metrics.slice_statistics import SLICE_FIGURES
from poresynth.volume import Volume

PLANES = ("z", "y", "x", "diagonal")
STRUCTURE = ("thickness", "spacing", "perimeter", "components", "holes", "tips")
WHOLE = {
    "slice_score_percent",
    "porosity",
    "porosity_error_percent",
    "two_point_error_percent",
    "components",
    "floating_parts",
    "largest_component_fraction",
    "largest_pore_fraction",
}


@pytest.fixture(scope="module")
def volume() -> Volume:
    return spinodal((36, 40, 44), wavelength=8, seed=1, voxel_size=2.0, unit="µm")


@pytest.fixture(scope="module")
def image() -> Volume:
    specimen = spinodal((48, 48, 48), wavelength=8, seed=2, voxel_size=2.0, unit="µm")
    return specimen.with_array(specimen.array[20:21])


@pytest.fixture(scope="module")
def comparison(image: Volume, volume: Volume) -> SectionComparison:
    return compare_sections(image, volume)


def names(plane: str, *moments: str) -> set[str]:
    always = {"porosity", "two_point_error_percent", *STRUCTURE}
    gray = set() if plane == "diagonal" else {"gradient", *moments}
    return {f"{name}_{plane}" for name in always | gray}


def test_figures_are_those_of_the_metrics(
    image: Volume, volume: Volume, comparison: SectionComparison
) -> None:
    threshold = poresynth.threshold(image)
    assert comparison.threshold == threshold
    assert (comparison.planes, comparison.window) == ((PLANES,), 24)
    planes = (names(p, "mean", "standard_deviation") for p in PLANES)
    assert set(comparison.figures) == WHOLE.union(*planes)
    e, v = image.array > threshold, volume.array > threshold
    figures = comparison.figures
    assert figures["slice_score_percent"].value == metrics.slice_score(e, v).percent
    assert figures["porosity"].value == pytest.approx(metrics.porosity(v))
    assert figures["porosity_error_percent"].value == pytest.approx(
        100 * abs(metrics.porosity(v) / metrics.porosity(e) - 1)
    )
    assert figures["components"].value == metrics.components(v)
    own = metrics.slice_statistics(e, window=24)
    gray = (image.array.astype(float), volume.array.astype(float))
    for i, plane in enumerate(PLANES):
        if plane == "diagonal":
            stack = metrics.diagonal_sections(v)
        else:
            stack = metrics.sections(v, plane).array
            others = [axis for axis in range(3) if axis != i]
            gradients = [
                np.mean([np.abs(np.diff(a, axis=axis)).mean() for axis in axes])
                for a, axes in zip(gray, ((1, 2), others), strict=True)
            ]
            found = figures[f"gradient_{plane}"]
            assert found.exemplar == pytest.approx(gradients[0])
            assert found.value == pytest.approx(gradients[1], rel=0.02)  # of 32 slices
            for name, of in (("mean", np.mean), ("standard_deviation", np.std)):
                found = figures[f"{name}_{plane}"]
                assert (found.exemplar, found.value) == pytest.approx([of(a) for a in gray])
        new = metrics.slice_statistics(stack, window=24)
        for name in STRUCTURE:
            found = figures[f"{name}_{plane}"]
            assert (found.exemplar, found.value) == (getattr(own, name), getattr(new, name))
            assert found.error_percent == own.errors(new)[name]
        assert figures[f"porosity_{plane}"].value == pytest.approx(metrics.porosity(stack))


def test_d2_is_of_the_mean_correlation_of_slices(
    image: Volume, volume: Volume, comparison: SectionComparison
) -> None:
    threshold = poresynth.threshold(image)
    own = metrics.two_point_correlation(image.array > threshold, 18).radial
    stack = metrics.sections(volume.array > threshold, "z").array
    # Half of the smallest edge: slices across y are 36 voxels high.
    chosen = stack[np.linspace(0, 35, 32).astype(int)]
    new = np.mean([metrics.two_point_correlation(s[None], 18).radial for s in chosen], axis=0)
    expected = 100 * np.linalg.norm((new - own)[1:]) / np.linalg.norm(own[1:])
    figures = comparison.figures
    assert figures["two_point_error_percent_z"].value == pytest.approx(expected)
    three = [figures[f"two_point_error_percent_{axis}"].value for axis in "zyx"]
    assert figures["two_point_error_percent"].value == pytest.approx(np.mean(three))
    curve = comparison.curves["two_point_z"]
    assert curve.r == list(range(19))
    assert curve.volume == pytest.approx(new)
    assert curve.exemplar == pytest.approx(own)


def test_the_range_is_that_of_quarters(image: Volume, comparison: SectionComparison) -> None:
    gray = image.array[0].astype(float)
    solid = gray > comparison.threshold
    cuts = [(slice(y, y + 24), slice(x, x + 24)) for y in (0, 24) for x in (0, 24)]
    pores = [1 - solid[cut].mean() for cut in cuts]
    thickness = [metrics.slice_statistics(solid[cut][None]).thickness for cut in cuts]
    means = [gray[cut].mean() for cut in cuts]
    expected = {"porosity_y": pores, "thickness_x": thickness, "mean_z": means}
    for name, values in expected.items():
        figure = comparison.figures[name]
        assert (figure.low, figure.high) == pytest.approx((min(values), max(values))), name


def test_another_slice_of_the_material_passes_and_faults_are_seen(
    image: Volume, volume: Volume
) -> None:
    gray = volume.array.astype(float)
    speckled = gray.copy()
    speckled[np.random.default_rng(0).random(gray.shape) < 0.01] = 0
    squeezed = ndimage.zoom(gray, (1, 0.5, 1), order=1)
    faults = {
        "gradient_z": ndimage.gaussian_filter(gray, 1),
        "porosity_x": gray + 80,
        "mean_y": gray + 80,
        "standard_deviation_y": 0.7 * (gray - gray.mean()) + gray.mean(),
        "holes_z": speckled,
        "spacing_x": squeezed,
        "two_point_error_percent_z": gray + 80,
    }
    fair = compare_sections(image, volume).figures
    for name, faulty in faults.items():
        found = compare_sections(image, faulty.clip(0, 255).astype(np.uint8)).figures
        assert fair[name].mark == "pass", (name, fair[name])
        assert found[name].mark in ("near", "off"), (name, found[name])


def test_diagonals_are_judged_by_what_resampling_leaves_alone(
    comparison: SectionComparison,
) -> None:
    told = {n for n, f in comparison.figures.items() if f.mark == "info"}
    whole = {"components", "floating_parts", "largest_component_fraction", "largest_pore_fraction"}
    assert told == whole | {f"{name}_diagonal" for name in ("components", "holes", "tips")}


def test_a_repeated_image_has_no_error_across_its_axis(image: Volume) -> None:
    extruded = np.repeat(image.array, 40, axis=0)
    for axis, array in (("z", extruded), ("x", np.moveaxis(extruded, 0, 2))):
        found = compare_sections({axis: image}, array)
        assert found.planes == ((axis,),)
        for name, figure in found.figures.items():
            if name.endswith(f"_{axis}") or name.startswith(("porosity", "two_point", "slice")):
                assert figure.value == pytest.approx(figure.exemplar, abs=1e-6), name
                assert figure.mark == "pass", name
                assert abs(figure.error_percent or 0) < 1e-6


def test_images_of_several_axes(image: Volume, volume: Volume) -> None:
    # Across x the image is of another material: finer.
    finer = spinodal((48, 48, 48), wavelength=4, seed=3, voxel_size=2.0, unit="µm")
    other = finer.with_array(finer.array[7:8])
    found = compare_sections({"x": other, "z": image, "y": image}, volume)
    assert found.planes == (("z", "y"), ("x",))
    assert found.window == 24
    assert found.figures["thickness_x"].error_percent > 40
    assert abs(found.figures["thickness_z"].error_percent) < 20
    grays = [f"histogram_{axis}" for axis in "zx"]
    curves = [f"two_point_{axis}" for axis in "zyx"]
    assert set(found.curves) == {*grays, *curves}
    pool = np.concatenate([image.array.ravel(), other.array.ravel()])
    assert found.threshold == poresynth.threshold(pool.reshape(1, 32, -1))
    own = [(i.array <= found.threshold).mean() for i in (image, image, other)]
    assert found.figures["porosity"].exemplar == pytest.approx(np.mean(own))


def test_channels_have_figures_and_histograms_of_their_own(image: Volume, volume: Volume) -> None:
    def colours(gray: Volume) -> Volume:
        other = 255 - gray.array // 2
        return gray.with_array(np.stack([gray.array, other, np.full_like(other, 9)], axis=-1))

    found = compare_sections(colours(image), colours(volume))
    alone = compare_sections(image, volume)
    for name in STRUCTURE:
        assert found.figures[f"{name}_y"] == alone.figures[f"{name}_y"]
    moments = [
        f"{moment}_{colour}"
        for colour in ("red", "green", "blue")
        for moment in ("mean", "standard_deviation")
    ]
    assert names("z", *moments) < set(found.figures)
    assert found.figures["mean_red_z"].value == alone.figures["mean_z"].value
    assert found.figures["mean_green_x"].exemplar == (255 - image.array // 2).mean()
    assert found.figures["mean_green_x"].error_percent == pytest.approx(
        100 * ((255 - volume.array // 2).mean() / (255 - image.array // 2).mean() - 1)
    )
    assert found.figures["standard_deviation_blue_z"].mark == "pass"
    assert [n for n in found.curves if n.startswith("histogram")] == [
        "histogram_red_z",
        "histogram_green_z",
        "histogram_blue_z",
    ]
    assert found.curves["histogram_red_z"] == alone.curves["histogram_z"]
    assert np.sum(found.curves["histogram_blue_z"].volume) == 1
    two = Volume(np.stack([image.array, image.array // 2], axis=-1))
    both = compare_sections(two, np.stack([volume.array, volume.array // 2], axis=-1))
    assert "mean_channel_1_z" in both.figures


@pytest.mark.parametrize("values", [(0, 1), (0, 255), (3, 7)])
def test_the_names_of_two_values_do_not_matter(
    image: Volume, volume: Volume, values: tuple[int, int]
) -> None:
    threshold = poresynth.threshold(image)
    e, v = image.array > threshold, volume.array > threshold
    expected = compare_sections(e, v)
    assert expected.kind == "binary"
    assert set(expected.figures) == WHOLE.union(*map(names, PLANES))
    assert not any(name.startswith("histogram") for name in expected.curves)
    named = np.where(v, values[1], values[0]).astype(np.uint8)
    assert compare_sections(e, named).to_dict() == expected.to_dict()
    dark = compare_sections(~e, ~v, solid="dark").to_dict()
    assert dark == {**expected.to_dict(), "solid": "dark"}


def test_labels_are_phases(volume: Volume, image: Volume) -> None:
    levels = np.quantile(volume.array, [0.5, 0.8])
    e, v = (np.digitize(w.array, levels).astype(np.uint8) * 10 for w in (image, volume))
    found = compare_sections(e, v)
    assert (found.kind, found.threshold) == ("label", 5)
    for label in (0, 10, 20):
        figure = found.figures[f"phase_fraction_{label}"]
        assert figure.value == pytest.approx((v == label).mean())
        assert figure.exemplar == pytest.approx((e == label).mean())
    assert "mean_z" not in found.figures


def test_json_is_flat_and_comes_back(comparison: SectionComparison) -> None:
    document = comparison.to_dict()
    assert json.loads(json.dumps(document, allow_nan=False)) == document
    for name, figure in comparison.figures.items():
        assert document[name] == figure.value
        assert document[f"{name}_mark"] == figure.mark
    for plane in PLANES:
        for name in ("porosity", "thickness", "tips"):
            error = comparison.figures[f"{name}_{plane}"].error_percent
            assert document[f"{name}_error_percent_{plane}"] == abs(error)
        assert document[f"thickness_{plane}_in_unit"] == 2 * document[f"thickness_{plane}"]
    assert document["planes"] == [list(PLANES)]
    assert document["window"] == 24
    assert document["mean_error_percent_y"] == pytest.approx(
        100 * abs(document["mean_y"] / document["mean_y_exemplar"] - 1)
    )


def test_a_count_that_the_image_has_none_of_may_be_off_by_one(volume: Volume) -> None:
    stripes = np.zeros((1, 40, 40), bool)
    stripes[..., np.arange(40) % 10 < 5] = True
    extruded = np.repeat(stripes, 40, axis=0)
    extruded[:20, 3, 2] = False
    found = compare_sections({"z": stripes}, extruded)
    holes = found.figures["holes_z"]
    # A hole in every second slice of 1600 pixels.
    assert holes.value == pytest.approx(10_000 / 3200, rel=0.1)
    assert (holes.exemplar, holes.mark) == (0, "pass")
    assert holes.error_percent == pytest.approx(50, rel=0.1)


def test_compare_knows_an_image_by_its_one_slice(image: Volume, volume: Volume) -> None:
    expected = compare_sections(image, volume).to_dict()
    found = compare(image, volume)
    assert isinstance(found, SectionComparison)
    assert found.to_dict() == expected
    assert poresynth.compare(dict.fromkeys("zyx", image), volume).to_dict() == expected
    assert compare(image, volume, threshold=90).threshold == 90
    # Two images are of one dimension, as two volumes are.
    for one, other in ((image, image), (volume, volume), (volume, image)):
        assert isinstance(compare(one, other, subvolumes=2), VolumeComparison)


def test_threads_memory_order_and_progress(image: Volume, volume: Volume) -> None:
    heard: list[float] = []
    expected = compare_sections(
        image, volume, threads=1, progress=lambda stage, share: heard.append(share)
    ).to_dict()
    assert (heard, heard[0], heard[-1]) == (sorted(heard), 0, 1)
    assert compare_sections(image, volume, threads=3).to_dict() == expected
    fortran = volume.with_array(np.asfortranarray(volume.array))
    for name, value in compare_sections(image, fortran).to_dict().items():
        # Sums of floats depend on their order.
        assert value == expected[name] or value == pytest.approx(expected[name]), name


def test_the_record_of_copying_is_told(image: Volume, volume: Volume) -> None:
    record = {"poresynth": {"copying": {"copy_fraction": 0.25, "mean_copied_block": 8.0}}}
    found = compare_sections(image, Volume(volume.array, 2.0, "µm", record)).to_dict()
    assert (found["copy_fraction"], found["mean_copied_block"]) == (0.25, 8.0)


def test_images_larger_and_smaller_than_the_volume(volume: Volume) -> None:
    large = spinodal((8, 200, 130), wavelength=10, seed=4).array[:1]
    for image in (large, large[:, :21, :30], large[:, :3, :3], large[:, :2, :40]):
        found = compare_sections(image, volume)
        json.dumps(found.to_dict(), allow_nan=False)
        assert found.window == max(1, min(36, min(image.shape[1:]) // 2))
    thin = compare_sections({"z": large}, volume.array[:2])
    assert thin.window == 40
    for shape in ((2, 2, 2), (2, 1, 9), (3, 2, 1)):
        tiny = np.arange(np.prod(shape)).reshape(shape).astype(np.uint8) * 7
        json.dumps(compare_sections(large, tiny).to_dict(), allow_nan=False)


def test_slices_of_a_real_scan_are_alike(data_dir: Path) -> None:
    scan = tifffile.imread(data_dir / "cement_gray_128.tif")
    found = compare(scan[64:65], scan)
    figures = found.figures
    assert figures["slice_score_percent"].value < 25
    judged = [f.mark for f in figures.values() if f.mark != "info"]
    assert judged.count("off") <= 2
    assert set(SLICE_FIGURES) - {"solid_fraction"} == set(STRUCTURE)


GOOD = np.random.default_rng(0).random((8, 8, 8))


@pytest.mark.parametrize(
    ("images", "volume", "message"),
    [
        ({}, GOOD, r"images = "),
        ({"z": GOOD}, GOOD, r"images\.z = .*must be one slice"),
        ({"a": GOOD[:1]}, GOOD, r"images = a: must be"),
        ({"y": np.ones((1, 8, 8))}, GOOD, r"images\.y = .*must not be constant"),
        ({"y": np.full((1, 8, 8), np.nan)}, GOOD, r"images\.y = .*must be finite"),
        (GOOD[:1], np.ones((8, 8, 8)), r"volume = .*must not be constant"),
        (GOOD[:1], np.stack([GOOD] * 3, axis=-1), r"volume\.channels = 3: must be 1, as of images"),
        (GOOD[:1], GOOD[0], r"array\.ndim = 2: must be"),
    ],
)
def test_bad_input_is_named(images: object, volume: np.ndarray, message: str) -> None:
    with pytest.raises(ParameterError, match=f"^{message}"):
        compare_sections(images, volume)


@pytest.mark.parametrize(
    ("options", "parameter"),
    [
        ({"threshold": 300}, "threshold"),
        ({"solid": "white"}, "solid"),
        ({"threads": -1}, "threads"),
    ],
)
def test_bad_parameters_are_named(
    image: Volume, volume: Volume, options: dict[str, object], parameter: str
) -> None:
    with pytest.raises(ParameterError, match=rf"^{parameter} = .*: must be "):
        compare_sections(image, volume, **options)
