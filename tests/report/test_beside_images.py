"""A report of a volume beside images."""

from __future__ import annotations

import io
import json
import re
from base64 import b64decode
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from poresynth.comparison import SectionComparison, compare
from poresynth.engines.base import EnergyRecord
from poresynth.errors import ParameterError
from poresynth.exemplars import spinodal
from poresynth.report import render3d, write_report
from poresynth.report.words import explain
from poresynth.volume import Volume

ENERGY = [EnergyRecord(0, 8, i, 9.0 / (i + 1), 5.0, 1.0, 1.0) for i in range(4)]


@pytest.fixture(autouse=True, scope="module")
def without_pyvista() -> object:
    """Start no other process: `test_render3d.py` does."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(render3d, "find_spec", lambda name: None)
        yield


def gray(edge: int, seed: int) -> np.ndarray:
    return spinodal((edge, edge, edge), porosity=0.6, wavelength=8, seed=seed).array


@pytest.fixture(scope="module")
def volume() -> Volume:
    origin = {"engine": "solid", "seed": 7, "mode_reason": "responses: slices 8 % against 9 %"}
    return Volume(gray(36, 1)[:, :, :30], 2.0, "µm", {"poresynth": origin})


@pytest.fixture(scope="module")
def image() -> Volume:
    return Volume(gray(40, 2)[20:21], 2.0, "µm")


@pytest.fixture(scope="module")
def comparison(image: Volume, volume: Volume) -> SectionComparison:
    found = compare(image, volume)
    assert isinstance(found, SectionComparison)
    return found


@pytest.fixture(scope="module")
def text(
    tmp_path_factory: pytest.TempPathFactory,
    image: Volume,
    volume: Volume,
    comparison: SectionComparison,
) -> str:
    folder = tmp_path_factory.mktemp("report")
    page = write_report(folder, image, volume, comparison, energy=ENERGY)
    return page.read_text(encoding="utf-8")


def pictures(text: str) -> dict[str, np.ndarray]:
    found = re.findall(r'<img alt="([^"]+)" src="data:image/png;base64,([^"]+)">', text)
    return {name: np.asarray(Image.open(io.BytesIO(b64decode(data)))) for name, data in found}


def test_the_page_says_what_was_compared(text: str) -> None:
    for words in (
        "A new volume beside its image<",
        "40 × 40 pixels of 2 µm, across z, y, x",
        "36 × 36 × 30 voxels of 2 µm",
        "responses: slices 8 % against 9 %",
        "parts of the image, 20² pixels each",
    ):
        assert words in text


def test_every_figure_is_on_the_page_and_explained(
    text: str, comparison: SectionComparison
) -> None:
    rows = re.findall(r"<tr>.*?</tr>", text)
    for name, figure in comparison.figures.items():
        stem = re.sub("_(z|y|x|diagonal)$", "", name)
        assert explain(stem)[1], f"{stem} is not explained"
        mine = [row for row in rows if f"<code>{stem}</code>" in row]
        assert any(figure.description.split(";")[0] in row.replace("&#x27;", "'") for row in mine)
    marks = [figure.mark for figure in comparison.figures.values()]
    assert f"{marks.count('pass')} ✓ pass" in text


def test_slices_stand_beside_the_image(text: str, image: Volume, volume: Volume) -> None:
    shown = pictures(text)
    assert shown["image"].shape == (40, 40)
    for plane, shape, edge in (("z", (36, 30), 36), ("y", (36, 30), 36), ("x", (36, 36), 30)):
        for share in (0.25, 0.5, 0.75):
            name = f"across {plane}, {int(share * (edge - 1)) + 1} of {edge}"
            assert shown[name].shape == shape
    assert text.count('alt="image"') == 4
    assert [name for name in shown if name.startswith("diagonal")] == [
        "diagonal, 3 of 9",
        "diagonal, 5 of 9",
        "diagonal, 7 of 9",
    ]
    dark = volume.array[17] < 60
    assert shown["across z, 18 of 36"][dark].max() < shown["across z, 18 of 36"][~dark].max()
    assert (shown["new volume"][..., 3] > 0).mean() > 0.3


def test_curves_of_every_plane(text: str) -> None:
    assert text.count('alt="Two-point correlation"') == 4
    assert text.count('alt="Gray values"') == 1
    assert text.count('alt="Energy"') == 1
    assert "in slices across y." in text
    assert "in slices diagonal." in text


def test_the_page_needs_nothing_from_elsewhere(text: str) -> None:
    without_pictures = re.sub(r"data:image/png;base64,[A-Za-z0-9+/=]*", "", text)
    for word in ("<script", "http:", "https:", "url(", "<link", "@import"):
        assert word not in without_pictures


def test_images_of_some_axes_in_colour(tmp_path: Path, volume: Volume) -> None:
    def coloured(array: np.ndarray) -> np.ndarray:
        return np.stack([array, 255 - array, array // 2], axis=-1)

    one, other = (Volume(coloured(gray(32, seed)[:1])) for seed in (3, 4))
    images, whole = {"z": one, "x": other}, Volume(coloured(volume.array))
    text = write_report(tmp_path, images, whole, compare(images, whole)).read_text(encoding="utf-8")
    assert "A new volume beside its images<" in text
    assert "32 × 32 pixels, across z; 32 × 32 pixels, across x" in text
    assert text.count('alt="image"') == 2
    shown = pictures(text)
    assert shown["image"].shape == (32, 32, 3)
    # Planes without an image are shown, too.
    assert shown["across y, 18 of 36"].shape == (36, 30, 3)
    assert shown["diagonal, 5 of 9"].shape == (36, 30, 3)
    for colour in ("red", "green", "blue"):
        assert text.count(f'alt="Values of {colour}"') == 2
    assert "Mean green" in text
    numbers = json.loads((tmp_path / "report.json").read_text())
    assert numbers["planes"] == [["z"], ["x"]]
    assert set(numbers["curves"]) >= {"two_point_x", "histogram_blue_x"}


def test_binary_images_are_black_and_white(tmp_path: Path) -> None:
    image, volume = gray(32, 2)[:1] > 128, (gray(32, 1) > 128) * np.uint8(7)
    text = write_report(tmp_path, image, volume, compare(image, volume)).read_text()
    shown = pictures(text)
    for name in ("image", "across x, 16 of 32", "diagonal, 5 of 9"):
        assert set(np.unique(shown[name]).tolist()) == {0, 255}
    assert 'alt="Gray values"' not in text


def test_a_comparison_must_fit_its_exemplar(
    tmp_path: Path, image: Volume, volume: Volume, comparison: SectionComparison
) -> None:
    with pytest.raises(ParameterError, match=r"^images\.z = .*must be one slice"):
        write_report(tmp_path, volume, volume, comparison)
    with pytest.raises(ParameterError, match=r"^comparison = dict: must be what"):
        write_report(tmp_path, image, volume, comparison.to_dict())
