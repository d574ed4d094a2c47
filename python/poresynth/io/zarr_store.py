"""Zarr stores (v2, v3): plain arrays and OME-Zarr images, whose metadata give the scale."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np

from poresynth.errors import ParameterError
from poresynth.io import header
from poresynth.io.format import FLOATS, WIDE, Content, Format, FormatError
from poresynth.io.units import OME_NAMES, spell

__all__ = ["ZARR"]

# Edge of a chunk in voxels: 2 MiB of uint8, so that a store has few files and a slice is cheap.
_CHUNK = 128

_METADATA = ("zarr.json", ".zarray", ".zgroup")


def _read(path: Path, *, name: str | None = None) -> Content:
    import zarr

    node: Any = zarr.open(str(path), mode="r")
    if name is not None:
        if not hasattr(node, "keys") or name not in node:
            raise ParameterError("name", name, f"must be {_names(node)}")
        node = node[name]
    if not hasattr(node, "keys"):
        return _plain(node)
    images = [node] if _multiscales(node) else [g for _, g in node.groups() if _multiscales(g)]
    if len(images) == 1:
        return _ome(images[0])
    arrays = [a for _, a in node.arrays()]
    if images or len(arrays) != 1:
        raise ParameterError("name", name, f"must be {_names(node)}")
    return _plain(arrays[0])


def _names(node: Any) -> str:
    if not hasattr(node, "keys"):
        return "left out: the store is one array"
    return f"one of {', '.join(sorted(node.keys()))}"


def _plain(array: Any) -> Content:
    voxels = np.asarray(array[...])
    return Content(voxels[np.newaxis] if voxels.ndim == 2 else voxels)


def _multiscales(group: Any) -> Any:
    """Return the metadata of an OME-Zarr image: 0.5 keeps it under "ome", 0.4 does not."""
    attributes = dict(group.attrs)
    return attributes.get("ome", attributes).get("multiscales")


def _ome(group: Any) -> Content:
    """Read the full resolution of an OME-Zarr image."""
    image = _multiscales(group)[0]
    dataset = image["datasets"][0]
    voxels = np.asarray(group[dataset["path"]][...])
    axes = image.get("axes", [*"tczyx"][-voxels.ndim :])
    axes = [a if isinstance(a, dict) else {"name": a} for a in axes]
    names = [a["name"] for a in axes]
    scale = np.ones(voxels.ndim)
    for transformation in [
        *dataset.get("coordinateTransformations", []),
        *image.get("coordinateTransformations", []),
    ]:
        if transformation["type"] == "scale":
            scale = scale * transformation["scale"]
    by_name = dict(zip(names, zip(scale, axes, strict=True), strict=True))
    size = [float(by_name[n][0]) if n in by_name else float(by_name["x"][0]) for n in "zyx"]
    unit = spell(by_name["x"][1].get("unit", "voxel"))

    others = [i for i, n in enumerate(names) if n not in "czyx" and voxels.shape[i] > 1]
    if others:
        raise FormatError(f"has axes {names} of shape {voxels.shape}; only z, y, x and channels")
    order = [names.index(n) for n in ("z", "y", "x", "c") if n in names]
    single = tuple(i for i in range(voxels.ndim) if i not in order)
    voxels = voxels.transpose([*single, *order])[(0,) * len(single)]
    if "c" in names and voxels.shape[-1] == 1:
        voxels = voxels[..., 0]
    if "z" not in names:
        voxels = voxels[np.newaxis]
    text = dict(group.attrs).get("poresynth")
    content = Content(voxels, (size[0], size[1], size[2]), unit)
    content.header = header.decode(text) if isinstance(text, str) else None
    return content


def _write(path: Path, content: Content, *, version: int = 2) -> None:
    array = content.array if content.array.ndim == 3 else np.moveaxis(content.array, 3, 0)
    voxels = _create(path, content, version)
    # One chunk at a time: of several at once that fail, zarr forgets all but the first.
    starts = [range(0, n, chunk) for n, chunk in zip(array.shape, voxels.chunks, strict=True)]
    for corner in itertools.product(*starts):
        box = tuple(slice(c, c + n) for c, n in zip(corner, voxels.chunks, strict=True))
        voxels[box] = array[box]


def _create(path: Path, content: Content, version: int = 2) -> Any:
    """Make a store without voxels; return its array, channels first."""
    import numcodecs
    import zarr

    if version not in (2, 3):
        raise ParameterError("version", version, "must be 2 or 3")
    modern = int(zarr.__version__.split(".")[0]) >= 3
    if version == 3 and not modern:
        raise ParameterError("version", version, f"needs zarr 3, this is {zarr.__version__}")
    array = content.array if content.array.ndim == 3 else np.moveaxis(content.array, 3, 0)
    names = ["z", "y", "x"] if array.ndim == 3 else ["c", "z", "y", "x"]
    chunks = (1,) * (array.ndim - 3) + tuple(min(_CHUNK, n) for n in array.shape[-3:])
    # Version 3's own default; that of version 2, Blosc, reads a truncated chunk as noise.
    zstandard = numcodecs.Zstd(level=3)
    if modern:
        style: dict[str, Any] = {
            2: {"chunk_key_encoding": {"name": "v2", "separator": "/"}, "compressors": zstandard},
            3: {"dimension_names": names},
        }[version]
        group: Any = zarr.open_group(str(path), mode="w", zarr_format=version)  # type: ignore[arg-type]
        voxels = group.create_array(
            "0", shape=array.shape, dtype=array.dtype, chunks=chunks, **style
        )
    else:
        group = zarr.open_group(str(path), mode="w")
        voxels = group.create_dataset(
            "0",
            shape=array.shape,
            dtype=array.dtype,
            chunks=chunks,
            dimension_separator="/",
            compressor=zstandard,
        )
    group.attrs.update(_attributes(content, names, version))
    return voxels


def _attributes(content: Content, names: list[str], version: int) -> dict[str, Any]:
    """Return the OME-NGFF metadata, and the header beside them."""
    axes: list[dict[str, str]] = []
    for name in names:
        axis = {"name": name, "type": "channel" if name == "c" else "space"}
        if name != "c" and content.unit in OME_NAMES:
            axis["unit"] = OME_NAMES[content.unit]
        axes.append(axis)
    scale = [1.0] * (len(names) - 3) + list(content.voxel_size)
    dataset = {"path": "0", "coordinateTransformations": [{"type": "scale", "scale": scale}]}
    image: dict[str, Any] = {"axes": axes, "datasets": [dataset]}
    ngff: dict[str, Any]
    if version == 2:
        ngff = {"multiscales": [{"version": "0.4", **image}]}
    else:
        ngff = {"ome": {"version": "0.5", "multiscales": [image]}}
    return {**ngff, "poresynth": header.encode(content.header)} if content.header else ngff


def _matches(path: Path) -> bool:
    return path.is_dir() and any((path / name).is_file() for name in _METADATA)


ZARR = Format(
    name="Zarr",
    suffixes=(".zarr",),
    dtypes=("bool", *WIDE, *FLOATS),
    read=_read,
    write=_write,
    matches=_matches,
    folder=True,
    may_replace=_matches,
    holds_bool=True,
    holds_header=True,
    create=_create,
)
