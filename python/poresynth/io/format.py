"""What a file format is: the two types that every format of this folder speaks in."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from poresynth.errors import FileError, MissingExtraError, PoresynthError

__all__ = ["FLOATS", "NARROW", "WIDE", "Content", "Format", "FormatError"]

#: Data types, by what formats can hold. Label images are integers.
FLOATS = ("float32", "float64")
NARROW = ("uint8", "int8", "uint16", "int16", "uint32", "int32")
WIDE = (*NARROW, "uint64", "int64")


class FormatError(Exception):
    """Why a format cannot read or write a file; the caller adds the name of the file."""


@dataclass
class Content:
    """What a file holds.

    Parameters
    ----------
    array : numpy.ndarray
        Shape (z, y, x) or (z, y, x, channel).
    voxel_size : (float, float, float)
        Along (z, y, x), in ``unit``.
    unit : str
        In the package's spelling (`poresynth.io.units`); ``"voxel"`` if the file does not say.
    header : dict, optional
        The header of `poresynth.io.header`, if it lies inside the file.
    """

    array: npt.NDArray[Any]
    voxel_size: tuple[float, float, float] = (1.0, 1.0, 1.0)
    unit: str = "voxel"
    header: dict[str, Any] | None = None


@dataclass(frozen=True)
class Format:
    """A file format.

    Parameters
    ----------
    name : str
        As people call it.
    suffixes : tuple of str
        Endings of its file names, lower case; the first is the usual one.
    dtypes : tuple of str
        Data types that it can hold.
    read : callable
        ``read(path, **options) -> Content``. Raises `FormatError`, or whatever its library raises.
        Keyword-only parameters are the format's options.
    write : callable
        ``write(path, content, **options)``. Raises the same, and `ParameterError` for what the
        format cannot hold.
    matches : callable
        ``matches(path) -> bool``: whether the file's first bytes are this format's.
    folder : bool, default False
        Whether a volume is a folder.
    may_replace : callable, optional
        For a folder: whether an existing one is such a volume and may give way to a new one.
    companions : callable, optional
        ``companions(path)``: other files that belong to the volume, written before it.
    holds_bool : bool, default False
        Whether bool is a type of the format. If not, it is stored as uint8, 0 and 255.
    holds_header : bool, default False
        Whether the header goes inside the file.
    create : callable, optional
        ``create(path, content)``: write a file of zeros like the content, whose voxels are not
        looked at, and return an array of shape (z, y, x) whose parts can be set.
    sidecar : mapping, optional
        More fields for the sidecar, for a format that cannot be read without one.
    package, extra : str, optional
        The optional package that it needs, and the extra that brings it.
    """

    name: str
    suffixes: tuple[str, ...]
    dtypes: tuple[str, ...]
    read: Callable[..., Content]
    write: Callable[..., None]
    matches: Callable[[Path], bool]
    folder: bool = False
    may_replace: Callable[[Path], bool] | None = None
    companions: Callable[[Path], tuple[Path, ...]] = lambda path: ()
    holds_bool: bool = False
    holds_header: bool = False
    create: Callable[[Path, Content], Any] | None = None
    sidecar: Mapping[str, Any] = field(default_factory=dict)
    package: str | None = None
    extra: str | None = None

    @property
    def unavailable(self) -> str | None:
        """Why the format cannot be used here; None if it can."""
        if self.package is None or importlib.util.find_spec(self.package):
            return None
        return f"needs {self.package}: pip install 'poresynth[{self.extra}]'"

    def require(self) -> None:
        """Raise `MissingExtraError` if the format cannot be used here."""
        if self.unavailable and self.extra:
            raise MissingExtraError(self.name, self.extra)

    def load(self, path: Path, given: str | PathLike[str] | None = None, **options: Any) -> Content:
        """Read a file by this format; `FileError` in the caller's own words if it cannot."""
        given = path if given is None else given
        self.require()
        try:
            content = self.read(path, **options)
            content.array = _native(content.array)
        except (PoresynthError, MemoryError):
            raise
        except FormatError as error:
            raise FileError(f"{given}: {error}") from error
        except OSError as error:
            raise FileError.because(given, error) from error
        except Exception as error:  # Libraries raise what they like; the user gets one line.
            said = FileError.because(given, error)
            raise FileError(f"{said} (truncated, damaged, or not {self.name})") from error
        return content

    def holds(self, dtype: np.dtype[Any]) -> bool:
        """Whether voxels of this type come back as they were."""
        return dtype.name in self.dtypes


def _native(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return voxels in native byte order and a type that the package works on."""
    if array.ndim not in (3, 4):
        raise FormatError(f"an array of shape {array.shape} is no image and no volume")
    if array.size == 0:
        raise FormatError("the file holds no voxels")
    if array.dtype == np.float16:
        return array.astype(np.float32)
    if array.dtype.kind not in "buif" or array.dtype.itemsize > 8:
        raise FormatError(f"voxels of type {array.dtype.name} are not supported")
    # A mapped array stays mapped, as a plain ndarray.
    return np.asarray(array.astype(array.dtype.newbyteorder("="), copy=False))
