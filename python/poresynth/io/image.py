"""PNG, JPEG and BMP: images, that is volumes of one slice."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from poresynth.errors import ParameterError
from poresynth.io import header
from poresynth.io.colours import TRANSPARENT, gray_if_it_can_be
from poresynth.io.format import Content, Format, FormatError

if TYPE_CHECKING:
    from PIL.Image import Image

__all__ = ["BMP", "JPEG", "PNG"]

# Pillow's modes that are voxels as they stand: bilevel, gray 8 bit, colour 8 bit, gray 16 bit.
_PLAIN = ("1", "L", "RGB", "I;16")


def _read(path: Path) -> Content:
    from PIL import Image

    with Image.open(path) as image:
        _check_depth(path, image)
        image.load()
        text = image.info.get("poresynth")
        array = _voxels(image)
    return Content(array[np.newaxis], header=header.decode(text) if text else None)


def _voxels(image: Image) -> npt.NDArray[Any]:
    """Return (y, x) or (y, x, channel)."""
    if image.mode in ("LA", "La", "PA", "RGBA", "RGBa") or "transparency" in image.info:
        raise FormatError(TRANSPARENT)
    if image.mode == "P":
        return gray_if_it_can_be(np.asarray(image.convert("RGB")))
    if image.mode == "I;16B":
        return np.asarray(image, dtype=np.uint16)
    if image.mode not in _PLAIN:
        raise FormatError(f"has colours of kind {image.mode}; save it as gray or RGB")
    return np.asarray(image)


def _check_depth(path: Path, image: Image) -> None:
    """Raise for 16-bit colour, of which Pillow would drop the lower half in silence."""
    if image.format != "PNG" or image.mode not in ("RGB", "RGBA", "LA"):
        return
    with path.open("rb") as file:
        if file.read(25)[24] == 16:
            raise FormatError("has 16-bit colour; save it as TIFF, or with 8 bits a channel")


def _write_png(path: Path, content: Content) -> None:
    from PIL.PngImagePlugin import PngInfo

    info = PngInfo()
    if content.header:
        info.add_itxt("poresynth", header.encode(content.header))
    _image("PNG", content).save(path, format="PNG", pnginfo=info)


def _write_jpeg(path: Path, content: Content) -> None:
    # The highest quality that its authors advise, and no coarser colour than gray.
    _image("JPEG", content).save(path, format="JPEG", quality=95, subsampling=0)


def _write_bmp(path: Path, content: Content) -> None:
    _image("BMP", content).save(path, format="BMP")


def _image(name: str, content: Content) -> Image:
    from PIL import Image

    array = content.array
    if array.shape[0] != 1:
        allowed = f"{name} holds an image, (1, y, x); a volume can go to a folder of slices"
        raise ParameterError("volume.shape", array.shape, allowed)
    if array.ndim == 4 and (array.shape[3] != 3 or array.dtype != np.uint8):
        allowed = f"{name} holds one channel, or three of uint8; TIFF holds any"
        raise ParameterError("volume.shape", f"{array.shape} {array.dtype.name}", allowed)
    return Image.fromarray(np.ascontiguousarray(array[0]))


def _starts_with(*starts: bytes) -> Any:
    def matches(path: Path) -> bool:
        with path.open("rb") as file:
            return file.read(8).startswith(starts)

    return matches


PNG = Format(
    name="PNG",
    suffixes=(".png",),
    dtypes=("bool", "uint8", "uint16"),
    read=_read,
    write=_write_png,
    matches=_starts_with(b"\x89PNG\r\n\x1a\n"),
    holds_bool=True,
    holds_header=True,
)
JPEG = Format(
    name="JPEG",
    suffixes=(".jpg", ".jpeg"),
    dtypes=("uint8",),
    read=_read,
    write=_write_jpeg,
    matches=_starts_with(b"\xff\xd8\xff"),
)
BMP = Format(
    name="BMP",
    suffixes=(".bmp",),
    dtypes=("bool", "uint8"),
    read=_read,
    write=_write_bmp,
    matches=_starts_with(b"BM"),
    holds_bool=True,
)
