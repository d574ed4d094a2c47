"""TIFF against tifffile: what ImageJ, OME-TIFF and plain writers make of a volume."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
from PIL import Image

import poresynth
from poresynth.errors import FileError, MissingExtraError, ParameterError
from poresynth.io import tiff
from poresynth.volume import Volume

VOXELS = np.arange(5 * 6 * 7, dtype=np.uint8).reshape(5, 6, 7)


def read(path: Path) -> Volume:
    return poresynth.read(path)


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
def test_imagej_sees_a_calibrated_stack(dtype: str, tmp_path: Path) -> None:
    array = VOXELS.astype(dtype)
    poresynth.write(tmp_path / "a.tif", Volume(array, (39, 19.5, 10), "µm"))
    with tifffile.TiffFile(tmp_path / "a.tif") as file:
        assert file.is_imagej
        assert not file.is_bigtiff
        fields = file.imagej_metadata
        assert (fields["slices"], fields["spacing"], fields["unit"]) == (5, 39, "um")
        tags = file.pages[0].tags
        for tag, size in (("XResolution", 10), ("YResolution", 19.5)):
            pixels, units = tags[tag].value
            assert units / pixels == pytest.approx(size)
        assert tags["ResolutionUnit"].value == 1
        np.testing.assert_array_equal(file.asarray(), array)


@pytest.mark.parametrize("dtype", ["int8", "int16", "uint32", "int32", "float64"])
@pytest.mark.parametrize("name", ["a.tif", "a.ome.tif"])
def test_other_types_go_to_ome(name: str, dtype: str, tmp_path: Path) -> None:
    array = VOXELS.astype(dtype)
    poresynth.write(tmp_path / name, Volume(array, (39, 19.5, 10), "µm"))
    with tifffile.TiffFile(tmp_path / name) as file:
        assert file.is_ome
        text = file.ome_metadata
        for axis, size in (("X", "10"), ("Y", "19.5"), ("Z", "39")):
            assert f'PhysicalSize{axis}="{size}' in text
            assert f'PhysicalSize{axis}Unit="µm"' in text
        np.testing.assert_array_equal(file.asarray(), array)


def test_the_suffix_asks_for_ome(tmp_path: Path) -> None:
    poresynth.write(tmp_path / "a.OME.tiff", VOXELS)
    with tifffile.TiffFile(tmp_path / "a.OME.tiff") as file:
        assert file.is_ome


@pytest.mark.parametrize("channels", [2, 3, 4])
@pytest.mark.parametrize("dtype", ["uint8", "uint16", "int16"])
def test_channels_are_channels_to_others(channels: int, dtype: str, tmp_path: Path) -> None:
    array = np.arange(5 * 6 * 7 * channels).astype(dtype).reshape(5, 6, 7, channels)
    poresynth.write(tmp_path / "a.tif", array)
    with tifffile.TiffFile(tmp_path / "a.tif") as file:
        rgb = channels == 3 and dtype == "uint8"
        assert file.series[0].axes == ("ZYXS" if rgb else "ZCYX")
        expected = array if rgb else np.moveaxis(array, 3, 1)
        np.testing.assert_array_equal(file.asarray(), expected)


def test_compression_and_bigtiff_are_options(tmp_path: Path) -> None:
    array = np.zeros((20, 30, 40), np.uint8)
    for options in ({"compression": "zlib"}, {"bigtiff": True}):
        poresynth.write(tmp_path / "a.tif", array, **options)
        with tifffile.TiffFile(tmp_path / "a.tif") as file:
            assert file.is_bigtiff == ("bigtiff" in options)
            assert (file.filehandle.size < array.size) == ("compression" in options)
        np.testing.assert_array_equal(read(tmp_path / "a.tif"), array)
    with pytest.raises(ParameterError, match="compression = lzw: must be 'none' or 'zlib'"):
        poresynth.write(tmp_path / "b.tif", array, compression="lzw")


def test_large_volumes_become_bigtiff(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tiff, "_CLASSIC", VOXELS.nbytes - 1)
    poresynth.write(tmp_path / "a.tif", Volume(VOXELS, 2, "µm"))
    with tifffile.TiffFile(tmp_path / "a.tif") as file:
        assert file.is_bigtiff
        assert file.is_ome
    assert read(tmp_path / "a.tif").voxel_size == (2, 2, 2)


WRITERS: dict[str, dict[str, Any]] = {
    "plain": {},
    "big-endian": {"byteorder": ">"},
    "bigtiff": {"bigtiff": True},
    "zlib": {"compression": "zlib"},
    "predictor": {"compression": "zlib", "predictor": True},
    "strips": {"rowsperstrip": 2},
    "tiles": {"tile": (16, 16)},
    "page by page": {"metadata": None, "contiguous": False},
    "ome": {"ome": True, "metadata": {"axes": "ZYX"}},
    "imagej": {"imagej": True, "metadata": {"axes": "ZYX"}},
}


@pytest.mark.parametrize("writer", WRITERS)
@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
def test_other_writers(writer: str, dtype: str, tmp_path: Path) -> None:
    array = np.arange(3 * 20 * 30).astype(dtype).reshape(3, 20, 30)
    if writer == "predictor" and dtype == "float32":
        pytest.importorskip("imagecodecs", reason="tifffile needs imagecodecs for it")
    path, options = tmp_path / "a.tif", {**WRITERS[writer], "photometric": "minisblack"}
    if options.pop("contiguous", True):
        tifffile.imwrite(path, array, **options)
    else:
        with tifffile.TiffWriter(path) as file:
            for page in array:
                file.write(page, contiguous=False, **options)
    found = read(path)
    np.testing.assert_array_equal(found.array, array)
    assert found.dtype == array.dtype
    assert (found.voxel_size, found.unit) == ((1, 1, 1), "voxel")


def test_axes_of_others(tmp_path: Path) -> None:
    path = tmp_path / "a.tif"
    random = np.random.default_rng(0)
    tzc = random.integers(0, 255, (1, 4, 2, 8, 9)).astype(np.uint16)
    tifffile.imwrite(path, tzc, imagej=True, metadata={"axes": "TZCYX"})
    np.testing.assert_array_equal(read(path).array, np.moveaxis(tzc[0], 1, 3))
    tifffile.imwrite(path, tzc[0], ome=True, metadata={"axes": "ZCYX"})
    np.testing.assert_array_equal(read(path).array, np.moveaxis(tzc[0], 1, 3))
    frames = tzc[0, :, 0]  # A stack that was saved as a movie.
    tifffile.imwrite(path, frames, imagej=True, metadata={"axes": "TYX"})
    np.testing.assert_array_equal(read(path).array, frames)
    tifffile.imwrite(path, frames[0])
    assert read(path).array.shape == (1, 8, 9)
    planar = random.integers(0, 255, (3, 8, 9)).astype(np.uint8)
    tifffile.imwrite(path, planar, photometric="rgb", planarconfig="separate")
    np.testing.assert_array_equal(read(path).array[0], np.moveaxis(planar, 0, 2))
    # What tifffile makes of a volume whose axes nobody named: many channels are a stack.
    volume = random.integers(0, 255, (5, 8, 9)).astype(np.uint8)
    for options in ({"imagej": True}, {"ome": True}):
        tifffile.imwrite(path, volume, photometric="minisblack", **options)
        np.testing.assert_array_equal(read(path).array, volume)
        tifffile.imwrite(path, volume[:3], photometric="minisblack", **options)
        np.testing.assert_array_equal(read(path).array[0], np.moveaxis(volume[:3], 0, 2))
    movie = np.zeros((2, 4, 8, 9), np.uint8)
    tifffile.imwrite(path, movie, imagej=True, metadata={"axes": "TZYX"})
    with pytest.raises(FileError, match=r"axes .* of shape .*; only z, y, x and one channel"):
        read(path)


def test_bilevel_pages(tmp_path: Path) -> None:
    pytest.importorskip("imagecodecs", reason="tifffile needs imagecodecs for single bits")
    solid = np.random.default_rng(0).random((6, 16)) > 0.5
    Image.fromarray(solid).save(tmp_path / "a.tif")
    found = read(tmp_path / "a.tif")
    assert found.dtype == bool
    np.testing.assert_array_equal(found.array[0], solid)


def test_white_is_high_whatever_the_file_says(tmp_path: Path) -> None:
    array = np.arange(48, dtype=np.uint16).reshape(6, 8)
    tifffile.imwrite(tmp_path / "a.tif", array, photometric="miniswhite")
    np.testing.assert_array_equal(read(tmp_path / "a.tif").array[0], 65535 - array)


def test_scales_of_others(tmp_path: Path) -> None:
    path = tmp_path / "a.tif"

    def check(size: tuple[float, float, float], unit: str, **options: Any) -> None:
        tifffile.imwrite(path, VOXELS, photometric="minisblack", **options)
        found = read(path)
        assert found.voxel_size == pytest.approx(size)
        assert found.unit == unit

    imagej = {"axes": "ZYX", "unit": "\\u00B5m"}
    options: dict[str, Any] = {"imagej": True, "resolution": (0.5, 0.25)}
    check((3, 4, 2), "µm", metadata={**imagej, "spacing": 3}, **options)
    # ImageJ leaves a spacing of one unit out.
    check((1, 4, 2), "µm", metadata=imagej, **options)
    ome = {"axes": "ZYX", "PhysicalSizeX": 0.5}
    check((0.5, 0.5, 0.5), "mm", ome=True, metadata={**ome, "PhysicalSizeXUnit": "mm"})
    check((0.5, 0.5, 0.5), "µm", ome=True, metadata=ome)
    mixed = {"PhysicalSizeZ": 0.003, "PhysicalSizeZUnit": "mm", "PhysicalSizeY": 2.0}
    check((3, 2, 0.5), "µm", ome=True, metadata={**ome, **mixed})
    # tifffile's own metadata; the resolution is per centimetre here.
    options = {"resolution": (10000 / 39, 10000 / 39), "resolutionunit": "CENTIMETER"}
    check((39, 39, 39), "µm", metadata={"spacing": 39.0, "unit": "um"}, **options)
    # The printing resolution of a plain file is no scale.
    check((1, 1, 1), "voxel", metadata=None, resolution=(300, 300), resolutionunit="INCH")


def test_an_image_has_no_spacing(tmp_path: Path) -> None:
    path = tmp_path / "a.tif"
    tifffile.imwrite(path, VOXELS[0], imagej=True, resolution=(0.5, 0.5), metadata={"unit": "um"})
    assert read(path).voxel_size == (2, 2, 2)


def test_alpha_is_refused(tmp_path: Path) -> None:
    rgba = np.zeros((8, 9, 4), np.uint8)
    for kind in ("unassalpha", "assocalpha"):
        tifffile.imwrite(tmp_path / "a.tif", rgba, photometric="rgb", extrasamples=[kind])
        with pytest.raises(FileError, match=r"transparency .* remove it"):
            read(tmp_path / "a.tif")
    tifffile.imwrite(tmp_path / "a.tif", rgba, photometric="rgb", extrasamples=["unspecified"])
    assert read(tmp_path / "a.tif").array.shape == (1, 8, 9, 4)


def test_pages_of_different_shape_are_refused(tmp_path: Path) -> None:
    with tifffile.TiffWriter(tmp_path / "a.tif") as file:
        file.write(np.zeros((8, 9), np.uint8), metadata=None)
        file.write(np.zeros((8, 10), np.uint8), metadata=None)
    with pytest.raises(FileError, match=r"2 images of different shape or type \(\(8, 9\)"):
        read(tmp_path / "a.tif")


def test_a_codec_that_is_missing_names_the_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*arguments: Any, **options: Any) -> None:
        raise ValueError("<COMPRESSION.LZW: 5> requires the 'imagecodecs' package")

    tifffile.imwrite(tmp_path / "a.tif", VOXELS, compression="zlib")
    monkeypatch.setattr(tifffile.TiffPageSeries, "asarray", fail)
    with pytest.raises(MissingExtraError, match=r"compression needs .*poresynth\[io\]"):
        read(tmp_path / "a.tif")


@pytest.mark.parametrize("writer", WRITERS)
def test_truncated_files_are_refused_wherever_they_end(writer: str, tmp_path: Path) -> None:
    array = np.random.default_rng(1).integers(0, 255, (4, 20, 30)).astype(np.uint8)
    path, options = tmp_path / "a.tif", {**WRITERS[writer], "photometric": "minisblack"}
    if options.pop("contiguous", True):
        tifffile.imwrite(path, array, **options)
    else:
        with tifffile.TiffWriter(path) as file:
            for page in array:
                file.write(page, contiguous=False, **options)
    whole, messages = path.read_bytes(), []
    for end in range(1, len(whole), max(1, len(whole) // 60)):
        path.write_bytes(whole[:end])
        try:
            found = read(path)
        except FileError as error:
            messages.append(str(error))
        else:  # Only tags that nobody needs are missing.
            np.testing.assert_array_equal(found.array, array)
    assert len(messages) >= 40
    assert all(m.startswith(f"{path}: ") and "\n" not in m for m in messages)


def test_damaged_tags_do_not_pass_in_silence(tmp_path: Path) -> None:
    path = tmp_path / "a.tif"
    with tifffile.TiffWriter(path) as file:
        for page in VOXELS:
            file.write(page, contiguous=False, metadata=None)
    with tifffile.TiffFile(path) as file:
        second = file.pages[1].offset
    data = bytearray(path.read_bytes())
    data[second : second + 2] = b"\xff\xff"
    path.write_bytes(data)
    with pytest.raises(FileError, match="truncated, damaged, or not TIFF"):
        read(path)


def test_reading_leaves_no_log_handler(tmp_path: Path) -> None:
    import logging

    before = list(logging.getLogger("tifffile").handlers)
    tifffile.imwrite(tmp_path / "a.tif", VOXELS)
    read(tmp_path / "a.tif")
    shutil.copy(tmp_path / "a.tif", tmp_path / "b.tif")
    (tmp_path / "b.tif").write_bytes((tmp_path / "b.tif").read_bytes()[:50])
    with pytest.raises(FileError):
        read(tmp_path / "b.tif")
    assert logging.getLogger("tifffile").handlers == before


def with_palette(path: Path, values: np.ndarray, colours: list[int]) -> None:
    image = Image.fromarray(values).convert("P")
    image.putpalette(colours)
    image.save(path)


def test_the_palette_of_an_image_is_expanded(tmp_path: Path) -> None:
    phases = np.random.default_rng(0).integers(0, 3, (6, 8)).astype(np.uint8)
    with_palette(tmp_path / "colour.tif", phases, [255, 0, 0, 0, 254, 0, 0, 0, 253])
    found = read(tmp_path / "colour.tif").array
    np.testing.assert_array_equal(found[0], np.diag([255, 254, 253]).astype(np.uint8)[phases])
    assert found.dtype == np.uint8
    with_palette(tmp_path / "gray.tif", phases, [0, 0, 0, 127, 127, 127, 254, 254, 254])
    np.testing.assert_array_equal(read(tmp_path / "gray.tif").array[0], phases * 127)


@pytest.mark.parametrize("options", [{"imagej": True}, {"ome": True}, {}])
def test_a_palette_over_measured_values_is_left_alone(
    options: dict[str, Any], tmp_path: Path
) -> None:
    colours = np.random.default_rng(1).integers(0, 65535, (3, 256)).astype(np.uint16)
    more = {} if "imagej" in options else {"photometric": "palette"}
    tifffile.imwrite(tmp_path / "a.tif", VOXELS[0], colormap=colours, **options, **more)
    np.testing.assert_array_equal(read(tmp_path / "a.tif").array[0], VOXELS[0])


def test_the_palettes_of_a_stack_are_left_alone(tmp_path: Path) -> None:
    pages = [Image.fromarray(page).convert("P") for page in VOXELS]
    for page in pages:
        page.putpalette([255, 0, 0, 0, 255, 0])
    pages[0].save(tmp_path / "a.tif", save_all=True, append_images=pages[1:])
    np.testing.assert_array_equal(read(tmp_path / "a.tif").array, VOXELS)


@pytest.mark.parametrize("mode", ["RGBA", "LA", "PA"])
def test_alpha_of_pillow_is_refused_as_in_png(mode: str, tmp_path: Path) -> None:
    Image.fromarray(VOXELS[0]).convert("RGBA").convert(mode).save(tmp_path / "a.tif")
    with pytest.raises(FileError, match=r"a\.tif: has transparency .*convert\('RGB'\)"):
        read(tmp_path / "a.tif")
