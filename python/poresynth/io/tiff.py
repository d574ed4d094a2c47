"""TIFF: ImageJ hyperstacks where they can hold the volume, OME-TIFF for the rest."""

from __future__ import annotations

import logging
import mmap
import os
import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt

from poresynth.errors import MissingExtraError, ParameterError
from poresynth.io import header
from poresynth.io.colours import TRANSPARENT, gray_if_it_can_be
from poresynth.io.format import FLOATS, NARROW, Content, Format, FormatError
from poresynth.io.units import NANOMETRES, convert, spell

if TYPE_CHECKING:
    import tifffile

__all__ = ["TIFF"]

# Data types of ImageJ; OME has the others.
_IMAGEJ = ("uint8", "uint16", "float32")

# Beyond it the offsets of a classic TIFF overflow; the rest of 4 GiB is left to its metadata.
_CLASSIC = 2**32 - 2**25

# Tag 262, PhotometricInterpretation: the values are numbers of colours.
_PALETTE = 3

# Programs that write a volume without naming its axes make its slices channels: more than these,
# without any other stack, are slices.
_CHANNELS = 4


def _read(path: Path) -> Content:
    import tifffile

    with _strict(), tifffile.TiffFile(path) as file:
        if len(file.series) != 1:
            shapes = ", ".join(str(s.shape) for s in file.series[:3])
            raise FormatError(
                f"holds {len(file.series)} images of different shape or type ({shapes}); "
                "save the one that is wanted by itself"
            )
        series = file.series[0]
        _check_complete(file)
        try:
            array = _voxels(path, file, series)
        except (ValueError, KeyError) as error:
            if "imagecodecs" in str(error):
                raise MissingExtraError(f"{path}: its compression", "io") from error
            raise
        array = _arrange(array, series.axes, file.pages[0])
        if _is_picture(file):
            array = _colours(array, file.pages[0])
        size, unit = _scale(file)
        return Content(array, size, unit, _header(file))


def _voxels(
    path: Path, file: tifffile.TiffFile, series: tifffile.TiffPageSeries
) -> npt.NDArray[Any]:
    """Return the array of a series, mapped if it is one uncompressed block of bytes."""
    if series.dataoffset is None:
        return series.asarray()
    dtype = np.dtype(series.dtype).newbyteorder(file.byteorder)
    return np.memmap(path, dtype, "r", series.dataoffset, series.shape)


def _arrange(array: npt.NDArray[Any], axes: str, page: Any) -> npt.NDArray[Any]:
    """Return an array of any TIFF axes as (z, y, x[, channel])."""
    extra = page.tags.get("ExtraSamples")
    if "S" in axes and extra is not None and any(int(e) in (1, 2) for e in np.ravel(extra.value)):
        raise FormatError(TRANSPARENT)
    # Axes of one entry say nothing; what else is not a channel is the stack.
    keep = [i for i, n in enumerate(array.shape) if n > 1 or axes[i] in "YX"]
    array, axes = array.reshape([array.shape[i] for i in keep]), "".join(axes[i] for i in keep)
    channel = [i for i, a in enumerate(axes) if a in "CS"]
    stack = [i for i, a in enumerate(axes) if a not in "CSYX"]
    if not stack and "C" in axes and array.shape[axes.index("C")] > _CHANNELS:
        stack = [axes.index("C")]
        channel.remove(stack[0])
    if len(channel) > 1 or len(stack) > 1:
        raise FormatError(f"has axes {axes} of shape {array.shape}; only z, y, x and one channel")
    array = array.transpose([*stack, axes.index("Y"), axes.index("X"), *channel])
    if page.photometric == 0:  # White is zero; here the bright end is the high one.
        array = ~array if array.dtype.kind in "bu" else array
    return array if stack else array[np.newaxis]


def _is_picture(file: tifffile.TiffFile) -> bool:
    """Whether a file is one image whose values are numbers of colours in a palette.

    In a stack, and in the files of ImageJ, OME and tifffile, a palette is a way to look at values.
    """
    page: Any = file.pages[0]
    of_the_field = file.is_imagej or file.is_ome or file.is_shaped
    return len(file.pages) == 1 and page.photometric == _PALETTE and not of_the_field


def _colours(array: npt.NDArray[Any], page: Any) -> npt.NDArray[Any]:
    """Return the colours, of 8 bits, that the values stand for."""
    return gray_if_it_can_be((page.colormap >> 8).astype(np.uint8).T[array])


def _check_complete(file: tifffile.TiffFile) -> None:
    """Raise if voxels lie beyond the end of the file."""
    size, series = file.filehandle.size, file.series[0]
    if series.dataoffset is not None:
        end = series.dataoffset + series.nbytes
    else:
        end = max(int(np.add(p.dataoffsets, p.databytecounts).max()) for p in file.pages)
    if end > size:
        raise FormatError(f"truncated: it has {size} bytes of {end}")


def _scale(file: tifffile.TiffFile) -> tuple[tuple[float, float, float], str]:
    """Return voxel size and unit, where a program of the field wrote them."""
    if file.is_ome:
        return _ome_scale(_ome(file, "Pixels"))
    if file.is_imagej:
        fields: dict[str, Any] = file.imagej_metadata or {}
        # ImageJ leaves a spacing of 1 out; an image has none.
        spacing = fields.get("spacing", 1.0 if fields.get("images", 1) > 1 else None)
    elif file.is_shaped:
        fields = (file.shaped_metadata or ({},))[0]
        spacing = fields.get("spacing")
    else:
        return (1.0, 1.0, 1.0), "voxel"
    unit = spell(str(fields.get("unit", "voxel")))
    y, x = (_edge(file.pages[0], tag, unit) for tag in ("YResolution", "XResolution"))
    if unit == "voxel" and spacing is None:
        return (1.0, 1.0, 1.0), unit
    return (abs(float(spacing)) if spacing else x, y, x), unit


def _ome_scale(
    pixels: ElementTree.Element | None,
) -> tuple[tuple[float, float, float], str]:
    """Return voxel size and unit of OME-XML, where each axis may have a unit of its own."""
    if pixels is None or "PhysicalSizeX" not in pixels.attrib:
        return (1.0, 1.0, 1.0), "voxel"
    unit = spell(pixels.get("PhysicalSizeXUnit", "µm"))
    sizes = [float(pixels.attrib["PhysicalSizeX"])] * 3
    for i, axis in enumerate("ZY"):
        if f"PhysicalSize{axis}" in pixels.attrib:
            sizes[i] = float(pixels.attrib[f"PhysicalSize{axis}"])
            own = spell(pixels.get(f"PhysicalSize{axis}Unit", "µm"))
            if own in NANOMETRES and unit in NANOMETRES:
                sizes[i] = convert((sizes[i],) * 3, own, unit)[0]
    z, y, x = sizes
    return (z, y, x), unit


def _edge(page: Any, tag: str, unit: str) -> float:
    """Return the edge of a pixel from a resolution tag: a ratio of pixels to unit, cm or inch."""
    found = page.tags.get(tag)
    pixels, length = found.value if found is not None else (1, 1)
    if not (pixels and length):
        return 1.0
    edge = float(length / pixels)
    own = {2: "inch", 3: "cm"}.get(int(page.tags.valueof("ResolutionUnit", default=1)), unit)
    if own != unit and unit in NANOMETRES:
        edge = convert((edge, edge, edge), own, unit)[0]
    return edge


def _header(file: tifffile.TiffFile) -> dict[str, Any] | None:
    if file.is_ome:
        element = _ome(file, "Description")
        text = element.text if element is not None else None
    else:
        text = (file.imagej_metadata or {}).get("Info") if file.is_imagej else None
    return header.decode(text) if text else None


def _ome(file: tifffile.TiffFile, name: str) -> ElementTree.Element | None:
    """Return the first element of a name in the first image of the OME-XML."""
    root = ElementTree.fromstring(file.ome_metadata or "<OME/>")
    return root.find(f"{{*}}Image/{{*}}{name}")


@contextmanager
def _strict() -> Iterator[None]:
    """Turn what tifffile only logs, such as a chain of pages that breaks off, into an error."""
    thread = threading.get_ident()

    class Raise(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            message = record.getMessage()
            # Its warnings of odd tags are left alone; these say that pages are missing or were
            # filled with zeros.
            lost = re.search("series|asarray|offset|corrupt", message)
            if (lost or record.levelno >= logging.ERROR) and record.thread == thread:
                raise ValueError(re.sub(r"^<.*?> ", "", message))

    logger, handler = logging.getLogger("tifffile"), Raise(logging.WARNING)
    logger.addHandler(handler)
    try:
        yield
    finally:
        logger.removeHandler(handler)


def _write(
    path: Path, content: Content, *, compression: str = "none", bigtiff: bool | None = None
) -> None:
    import tifffile

    if compression not in ("none", "zlib"):
        raise ParameterError("compression", compression, "must be 'none' or 'zlib'")
    array, options = _options(path, content, bigtiff)
    tifffile.imwrite(
        path,
        np.ascontiguousarray(array),
        compression=None if compression == "none" else compression,
        **options,
    )


def _create(path: Path, content: Content) -> _Mapped:
    """Write a file of zeros and map it."""
    import tifffile

    array, options = _options(path, content, None)
    offset = tifffile.memmap(path, shape=array.shape, dtype=array.dtype, **options).offset
    if hasattr(os, "posix_fallocate"):
        # A hole in a mapped file that finds no room when it is filled would kill the program.
        with path.open("r+b") as file:
            os.posix_fallocate(file.fileno(), 0, path.stat().st_size)
    return _Mapped(path, content.array.shape, array.dtype, offset)


class _Mapped:
    """The voxels of a file, which are written part by part and do not stay in memory."""

    def __init__(
        self, path: Path, shape: tuple[int, ...], dtype: np.dtype[Any], offset: int
    ) -> None:
        with path.open("r+b") as file:
            self._map = mmap.mmap(file.fileno(), 0)
        self._voxels = np.ndarray(shape, dtype, self._map, offset)

    def __setitem__(self, box: tuple[slice, ...], part: npt.NDArray[Any]) -> None:
        own = self._voxels[box]
        for plane, values in zip(own, np.broadcast_to(part, own.shape), strict=True):
            plane[...] = values
            self._give_back()

    def __getitem__(self, box: tuple[slice, ...]) -> npt.NDArray[Any]:
        part = np.array(self._voxels[box])
        self._give_back()
        return part

    def _give_back(self) -> None:
        """Let the system have the pages, whole planes of them; it writes them when it likes."""
        if hasattr(mmap, "MADV_DONTNEED"):
            self._map.madvise(mmap.MADV_DONTNEED)


def _options(
    path: Path, content: Content, bigtiff: bool | None
) -> tuple[npt.NDArray[Any], dict[str, Any]]:
    """Return the array in the order of the file, and the options of tifffile."""
    array = content.array
    big = array.nbytes > _CLASSIC if bigtiff is None else bigtiff
    rgb = array.ndim == 4 and array.shape[3] == 3 and array.dtype == np.uint8
    if array.ndim == 4 and not rgb:
        array = np.moveaxis(array, 3, 1)
    axes = "ZYX" if array.ndim == 3 else "ZYXS" if rgb else "ZCYX"
    ome = path.name.lower().endswith((".ome.tif", ".ome.tiff"))
    ome = ome or big or array.dtype.name not in _IMAGEJ
    metadata = _ome_metadata(content) if ome else _imagej_metadata(content)
    if not (ome or rgb):  # Else tifffile takes an x axis of one voxel for the samples.
        array, axes = array[..., np.newaxis], axes + "S"
    _, y, x = content.voxel_size
    return array, {
        "ome": ome,
        "imagej": not ome,
        "bigtiff": big,
        "photometric": "rgb" if rgb else "minisblack",
        "resolution": (1 / x, 1 / y),
        "resolutionunit": "NONE",
        "metadata": {"axes": axes, **metadata},
    }


def _imagej_metadata(content: Content) -> dict[str, Any]:
    return {
        "spacing": content.voxel_size[0],
        "unit": {"voxel": "pixel", "µm": "um"}.get(content.unit, content.unit),
        "Info": header.encode(content.header) if content.header else "",
    }


def _ome_metadata(content: Content) -> dict[str, Any]:
    metadata: dict[str, Any] = {}
    if content.header:
        metadata["Description"] = header.encode(content.header)
    if content.unit in NANOMETRES:  # OME knows these, and no unit of any other name.
        unit = "in" if content.unit == "inch" else content.unit
        for axis, size in zip("ZYX", content.voxel_size, strict=True):
            metadata |= {f"PhysicalSize{axis}": size, f"PhysicalSize{axis}Unit": unit}
    return metadata


def _matches(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(4) in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")


TIFF = Format(
    name="TIFF",
    suffixes=(".tif", ".tiff"),
    dtypes=("bool", *NARROW, *FLOATS),
    read=_read,
    write=_write,
    matches=_matches,
    holds_header=True,
    create=_create,
)
