"""The formats, and reading and writing by them."""

from __future__ import annotations

import inspect
import os
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from poresynth.errors import FileError, ParameterError, PoresynthError
from poresynth.io import header, image, itk, npy, npz, raw, slices, tiff, vti, zarr_store
from poresynth.io.atomic import check_writable, output
from poresynth.io.format import Content, Format
from poresynth.io.units import spell
from poresynth.volume import Volume, as_volume

__all__ = ["check_output", "create", "formats", "read", "write"]

_FORMATS = (
    tiff.TIFF,
    slices.SLICES,
    npy.NPY,
    npz.NPZ,
    zarr_store.ZARR,
    raw.RAW,
    image.PNG,
    image.JPEG,
    image.BMP,
    itk.META,
    itk.NRRD,
    itk.NIFTI,
    vti.VTI,
)


def formats() -> tuple[Format, ...]:
    """Return the file formats; ``unavailable`` of each says why it cannot be used here, if so."""
    return _FORMATS


def read(
    path: str | os.PathLike[str],
    *,
    voxel_size: float | tuple[float, float, float] | None = None,
    unit: str | None = None,
    **options: Any,
) -> Volume:
    """Read a volume or an image.

    Parameters
    ----------
    path : path_like
        TIFF (``.tif``, ``.tiff``), NPY, NPZ, RAW (``.raw``, ``.bin``), PNG, JPEG, BMP; a folder of
        slices (TIFF, PNG or BMP, in natural order of their names) or a Zarr store (v2, v3,
        OME-Zarr); with the extra ``io`` also MetaImage (``.mha``, ``.mhd``), NRRD (``.nrrd``,
        ``.nhdr``) and NIfTI (``.nii``, ``.nii.gz``); with the extra ``view`` VTK image data
        (``.vti``).
    voxel_size : float or (float, float, float), optional
        Edge lengths of a voxel along (z, y, x); default: what the file says.
    unit : str, optional
        Unit of ``voxel_size``, such as ``"µm"``; default: what the file says, ``"voxel"`` if it
        says nothing.
    shape : tuple of int
        RAW only: (z, y, x) or (z, y, x, channel). Default: from the sidecar.
    dtype : dtype_like
        RAW only: data type of the voxels. Default: from the sidecar.
    byte_order : {"little", "big"}
        RAW only. Default: from the sidecar, else ``"little"``, which nearly all machines write.
    offset : int
        RAW only: bytes before the first voxel. Default: from the sidecar, else 0.
    name : str
        NPZ and Zarr: which array (or OME-Zarr image) to read, when there are several.
    slices : {"tif", "png", "bmp"}
        Folders only: which files are the slices, when a folder holds several kinds.

    Returns
    -------
    Volume
        Native byte order. TIFF (uncompressed), NPY and RAW are memory-mapped, read-only.
        ``metadata["poresynth"]`` is the provenance of a volume that `write` stored.

    Raises
    ------
    FileError
        If the file is missing, unreadable, damaged, of unknown suffix or not what its suffix says.
    MissingExtraError
        If the format needs an optional package.
    ParameterError
        If an option is unknown to the format, or outside what is allowed.

    Notes
    -----
    An image is a volume of one slice: (1, y, x[, channel]); arrays (y, x, channel) of NPY, NPZ, RAW
    and Zarr are read as they stand, as (z, y, x). A palette is expanded to its colours, or grays;
    in stacks, and in the TIFF files of ImageJ, OME and tifffile, where it is but a way to look at
    the values, it is left alone. A scale is taken from a TIFF only where ImageJ, OME or tifffile
    wrote one: the resolution tags alone are the printing resolution of most programs. MetaImage,
    NRRD and NIfTI say millimetres, and edges of exactly 1 there mean that the scale is unknown.
    Peak memory: none beyond the array where it is mapped, else the array (twice for NIfTI, VTI,
    bool stored as uint8 and other byte orders).
    """
    given, path = path, Path(path)
    format_ = _format_of(given, path)
    _check_options(format_, format_.read, options)
    content = format_.load(path, given, **options)
    volume = header.restore(content, content.header or header.read_sidecar(path))
    if voxel_size is not None:
        volume = Volume(volume.array, voxel_size, volume.unit, volume.metadata)  # type: ignore[arg-type]
    return volume if unit is None else replace(volume, unit=spell(unit))


def write(path: str | os.PathLike[str], volume: Volume | npt.ArrayLike, **options: Any) -> None:
    """Write a volume or an image; it appears whole or not at all.

    Parameters
    ----------
    path : path_like
        The suffix picks the format, as in `read`; a name without suffix becomes a folder of
        slices.
    volume : Volume or array_like
        Shape (z, y, x) or (z, y, x, channel). One channel is written as none.
    compression : {"none", "zlib"}
        TIFF only. Default ``"none"``: the file can be memory-mapped, and every program reads it.
    bigtiff : bool
        TIFF only. Default: only when the volume needs it (4 GB).
    version : {2, 3}
        Zarr only: 2 writes OME-Zarr 0.4 (the default: every reader knows it), 3 writes 0.5.
    slices : {"tif", "png", "bmp"}
        Folders only: format of the slices. Default ``"tif"``, which holds most data types.

    Raises
    ------
    FileError
        If the suffix is unknown, the folder is missing or not writable, there is no room, or
        another process is writing there.
    MissingExtraError
        If the format needs an optional package.
    ParameterError
        If the format cannot hold the data type or shape, or does not know an option.

    Notes
    -----
    The scale and ``metadata["poresynth"]`` are stored inside the file where the format has a
    place, and the provenance always in the sidecar ``<name>.json`` beside it, which also takes
    what the format cannot hold. Bool is stored as 0 and 255 where the format has no bool, and
    comes back as bool. Peak memory: one copy of what is not bool or not in C order.
    """
    given, path, volume = path, Path(path), as_volume(volume)
    format_ = _format_for(given, path)
    _check_options(format_, format_.write, options)
    check_output(given, volume)
    if volume.channels == 1 and volume.array.ndim == 4:
        volume = Volume(volume.array[..., 0], volume.voxel_size, volume.unit, volume.metadata)
    array = _stored(format_, volume.array)
    with _one_line(given), _placed(path, format_, volume) as (place, fields):
        content = Content(array, volume.voxel_size, spell(volume.unit), fields)
        format_.write(place, content, **options)


@contextmanager
def create(path: str | os.PathLike[str], like: Volume) -> Iterator[BlockWriter]:
    """Write a volume part by part, so that it never is in memory; it appears whole or not at all.

    Parameters
    ----------
    path : path_like
        The suffix picks the format: TIFF, which is then mapped and not compressed, or Zarr, where
        parts of 128³ voxels that begin at multiples of 128 are written at once.
    like : Volume
        Shape (z, y, x), data type, scale and metadata. Its voxels are not looked at: a value that
        NumPy broadcasts to the shape takes no memory.

    Yields
    ------
    BlockWriter
        ``writer[box] = part`` for boxes of slices; what is not set is 0. ``writer[box]`` is what
        was set. The file takes its name at the end of the block.

    Raises
    ------
    FileError, MissingExtraError, ParameterError
        As `write` does, and for formats that are written in one piece.
    """
    given, path = path, Path(path)
    format_ = _format_for(given, path)
    if format_.create is None:
        able = " and ".join(f.name for f in _FORMATS if f.create is not None)
        raise FileError(f"{given}: only {able} can be written part by part")
    check_output(given, like)
    if like.array.ndim != 3:
        raise ParameterError("volume.shape", like.array.shape, "must be (z, y, x) for parts")
    dtype = np.dtype(np.uint8) if like.dtype == bool and not format_.holds_bool else like.dtype
    blank = np.broadcast_to(np.zeros((), dtype.newbyteorder("=")), like.array.shape)
    with _placed(path, format_, like) as (place, fields):
        content = Content(blank, like.voxel_size, spell(like.unit), fields)
        with _one_line(given):
            array = format_.create(place, content)
        yield BlockWriter(given, format_, array, like.dtype)


class BlockWriter:
    """What `create` gives: takes parts of a volume by their place, and gives them back."""

    def __init__(
        self,
        given: str | os.PathLike[str],
        format_: Format,
        array: Any,
        dtype: np.dtype[Any],
    ) -> None:
        self._given, self._format, self._array, self._dtype = given, format_, array, dtype

    def __setitem__(self, box: tuple[slice, ...], part: npt.ArrayLike) -> None:
        """Set a part; `FileError` if there is no room for it."""
        with _one_line(self._given):
            self._array[box] = _stored(self._format, np.asarray(part, self._dtype))

    def __getitem__(self, box: tuple[slice, ...]) -> npt.NDArray[Any]:
        """Return a part as it was set."""
        with _one_line(self._given):
            part = np.array(self._array[box])
        return part != 0 if self._dtype.kind == "b" else part


@contextmanager
def _one_line(given: str | os.PathLike[str]) -> Iterator[None]:
    """Make one line of whatever a writer raises."""
    try:
        yield
    except (PoresynthError, MemoryError):
        raise
    except Exception as error:
        raise FileError.because(given, error) from error


def _stored(format_: Format, array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return voxels as the format holds them."""
    if array.dtype == bool and not format_.holds_bool:
        array = np.where(array, np.uint8(255), np.uint8(0))
    return array.astype(array.dtype.newbyteorder("="), copy=False)


@contextmanager
def _placed(path: Path, format_: Format, volume: Volume) -> Iterator[tuple[Path, dict[str, Any]]]:
    """Give a temporary path for a volume, and its header; write the sidecar beside it."""
    fields = header.make(volume)
    companions, sidecar = format_.companions(path), header.sidecar_path(path)
    needs_sidecar = (
        fields["poresynth"]
        or format_.sidecar
        or (not format_.holds_header and _exceeds(format_, volume))
    )
    with output(*companions, path, sidecar, may_replace=format_.may_replace) as temporary:
        if needs_sidecar:
            text = header.encode({**fields, **format_.sidecar})
            temporary[-1].write_text(text + "\n", encoding="utf-8")
        yield temporary[-2], fields
    if not needs_sidecar and header.read_sidecar(path):
        sidecar.unlink()  # It described the volume that was there before.


def check_output(path: str | os.PathLike[str], volume: Volume | None = None) -> None:
    """Raise unless `write` can write to a path, so that long work can fail before it begins.

    Parameters
    ----------
    path : path_like
        The output to be.
    volume : Volume, optional
        A volume like the one that will be written: its data type is checked as well.

    Raises
    ------
    FileError, MissingExtraError, ParameterError
        As `write` does.
    """
    path = Path(path)
    format_ = _format_for(path, path)
    format_.require()
    if volume is not None:
        if volume.array.size == 0:
            raise ParameterError("volume.shape", volume.array.shape, "must hold a voxel")
        if not format_.holds(volume.dtype):
            others = [f.name for f in _FORMATS if f.holds(volume.dtype)]
            allowed = f"{format_.name} holds {', '.join(format_.dtypes)}; " + (
                f"{volume.dtype.name} can go to {', '.join(others)}" if others else "convert it"
            )
            raise ParameterError("volume.dtype", volume.dtype.name, allowed)
    for companion in format_.companions(path):
        check_writable(companion)
        if companion.exists() and not path.exists():
            raise FileError(f"{path}: would replace {companion.name}, which is not part of it")
    check_writable(path, folder=format_.folder)


def _format_of(given: str | os.PathLike[str], path: Path) -> Format:
    """Return the format of an existing file or folder, or raise what is wrong with it."""
    try:
        status = path.stat()
        if stat.S_ISDIR(status.st_mode):
            return zarr_store.ZARR if zarr_store.ZARR.matches(path) else slices.SLICES
        if not stat.S_ISREG(status.st_mode):
            raise FileError(f"{given}: is not a regular file")
        if status.st_size == 0:
            raise FileError(f"{given}: the file is empty")
        format_ = _by_suffix(path)
        if format_ is None:
            raise FileError(_unknown_suffix(given, path))
        if format_.matches(path):
            return format_
        looks = [f.name for f in _FORMATS if f is not raw.RAW and f.matches(path)]
    except FileError:
        raise
    except OSError as error:
        raise FileError.because(given, error) from error
    hint = f": its content is {looks[0]}" if looks else ""
    raise FileError(f"{given}: not {format_.name}, in spite of its suffix{hint}")


def _format_for(given: str | os.PathLike[str], path: Path) -> Format:
    """Return the format that the name of an output asks for."""
    format_ = _by_suffix(path)
    if format_ is None and (not path.suffix or path.is_dir()):
        format_ = slices.SLICES
    if format_ is None:
        raise FileError(_unknown_suffix(given, path))
    return format_


def _by_suffix(path: Path) -> Format | None:
    name = path.name.lower()
    return next((f for f in _FORMATS if name.endswith(f.suffixes) and f.suffixes), None)


def _unknown_suffix(given: str | os.PathLike[str], path: Path) -> str:
    known = ", ".join(suffix for f in _FORMATS for suffix in f.suffixes)
    return f"{given}: unknown suffix {path.suffix!r}; known are {known}"


def _check_options(format_: Format, function: Callable[..., Any], options: dict[str, Any]) -> None:
    parameters = inspect.signature(function).parameters.values()
    known = [p.name for p in parameters if p.kind is p.KEYWORD_ONLY]
    for name, value in options.items():
        if name not in known:
            has = f"it has {', '.join(known)}" if known else "it has none"
            raise ParameterError(name, value, f"is not an option of {format_.name}; {has}")


def _exceeds(format_: Format, volume: Volume) -> bool:
    """Whether a volume has a scale or a bool that the file alone would lose."""
    return (
        volume.unit != "voxel"
        or volume.voxel_size != (1.0, 1.0, 1.0)
        or (volume.dtype == bool and not format_.holds_bool)
    )
