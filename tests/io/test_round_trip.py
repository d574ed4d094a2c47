"""Every format gives back what it was given."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import poresynth
from poresynth.errors import ParameterError
from poresynth.io import formats
from poresynth.io.format import Format
from poresynth.volume import Volume

# JPEG loses: it has its own test.
EXACT = [f.name for f in formats() if f.name != "JPEG"]
IMAGES = ("PNG", "BMP")

SIZES = st.one_of(
    st.just(1.0),
    st.floats(1e-3, 1e3),
    st.tuples(*[st.floats(1e-3, 1e3)] * 3),
)


@st.composite
def layouts(draw: st.DrawFn, array: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """The same voxels in another memory order or byte order, or as a strided view."""
    kind = draw(st.sampled_from(["C", "F", "strided", "reversed", "swapped"]))
    if kind == "F":
        return np.asfortranarray(array)
    if kind == "strided":
        wide = np.zeros([2 * n for n in array.shape], array.dtype)
        view = wide[tuple(slice(None, None, 2) for _ in array.shape)]
        view[...] = array
        return view
    if kind == "reversed":
        return np.ascontiguousarray(array[::-1, :, ::-1])[::-1, :, ::-1]
    if kind == "swapped":
        return array.astype(array.dtype.newbyteorder("S"))
    return array


@pytest.mark.parametrize("suffix", [0, 1])
@pytest.mark.parametrize("name", EXACT)
@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_what_was_written_is_read(
    name: str,
    suffix: int,
    format_named: Callable[[str], Format],
    voxels: Callable[..., np.ndarray[Any, Any]],
    provenance: dict[str, Any],
    data: st.DataObject,
) -> None:
    format_ = format_named(name)
    suffixes = format_.suffixes or ("",)
    if suffix >= len(suffixes):
        return
    dtype = data.draw(st.sampled_from(format_.dtypes))
    shape = data.draw(st.tuples(*[st.integers(1, 6)] * 3))
    channels = data.draw(st.sampled_from([(), (2,), (3,), (4,)]))
    if name in IMAGES:
        shape = (1, *shape[1:])
        channels = (3,) if channels and dtype == "uint8" else ()
    if name == "NIfTI" and channels:
        shape = (shape[0], shape[1] + 1, shape[2])  # It holds no line of several channels.
    array = voxels((*shape, *channels), dtype, data.draw(st.integers(0, 99)))
    size = data.draw(SIZES)
    unit = data.draw(st.sampled_from(["voxel", "µm", "mm", "nm", "furlong"]))
    metadata = data.draw(st.sampled_from([{}, {"poresynth": provenance}]))
    volume = Volume(data.draw(layouts(array)), size, unit, metadata)

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"new{suffixes[suffix]}"
        poresynth.write(path, volume)
        found = poresynth.read(path)

        assert found.dtype == array.dtype
        assert found.dtype.isnative
        np.testing.assert_array_equal(found.array, array)
        assert found.unit == unit
        assert found.voxel_size == volume.voxel_size
        assert found.metadata == metadata
        assert not list(Path(folder).glob(".*"))
        assert (Path(folder) / f"{path.name}.json").exists() or not metadata
        del found  # Windows removes no file that is mapped.


@pytest.mark.parametrize("name", EXACT)
def test_one_channel_is_none(
    name: str, tmp_path: Path, format_named: Callable[[str], Format]
) -> None:
    format_ = format_named(name)
    path = tmp_path / f"new{(format_.suffixes or ('',))[0]}"
    poresynth.write(path, np.arange(30, dtype=np.uint8).reshape(1, 5, 6, 1))
    assert poresynth.read(path).array.shape == (1, 5, 6)


@pytest.mark.parametrize("name", [f.name for f in formats()])
def test_a_format_refuses_what_it_cannot_hold(
    name: str, tmp_path: Path, format_named: Callable[[str], Format]
) -> None:
    format_ = format_named(name)
    path = tmp_path / f"new{(format_.suffixes or ('',))[0]}"
    with pytest.raises(ParameterError, match=r"complex128: .*convert it"):
        poresynth.write(path, np.ones((1, 2, 3), complex))
    if not format_.holds(np.dtype("int64")):
        with pytest.raises(ParameterError, match="int64 can go to NPY, NPZ, Zarr, RAW"):
            poresynth.write(path, np.ones((1, 2, 3), np.int64))
    with pytest.raises(ParameterError, match="must hold a voxel"):
        poresynth.write(path, np.ones((1, 0, 3), np.uint8))
    assert list(tmp_path.iterdir()) == []


def test_plain_arrays_are_written(tmp_path: Path) -> None:
    array = np.arange(24, dtype=np.uint8).reshape(2, 3, 4)
    poresynth.write(tmp_path / "new.npy", array)
    assert [p.name for p in tmp_path.iterdir()] == ["new.npy"]
    np.testing.assert_array_equal(poresynth.read(tmp_path / "new.npy"), array)


def test_the_caller_overrules_the_scale(tmp_path: Path) -> None:
    path = tmp_path / "new.tif"
    poresynth.write(path, Volume(np.zeros((2, 3, 4), np.uint8), 19.5, "µm"))
    volume = poresynth.read(path, voxel_size=(2, 1, 1), unit="um")
    assert volume.voxel_size == (2, 1, 1)
    assert volume.unit == "µm"
    assert poresynth.read(path, voxel_size=3).voxel_size == (3, 3, 3)
    with pytest.raises(ParameterError, match="voxel_size"):
        poresynth.read(path, voxel_size=-1)


@pytest.mark.parametrize("suffix", [".tif", ".npy", ".raw"])
def test_voxels_are_mapped_not_loaded(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"new{suffix}"
    array = np.arange(24, dtype=np.uint16).reshape(2, 3, 4)
    poresynth.write(path, array)
    found = poresynth.read(path).array
    base: Any = found
    while not isinstance(base, np.memmap):
        base = base.base
        assert base is not None
    assert not found.flags.writeable
    # The mapping outlives the file's replacement.
    poresynth.write(path, array + 1)
    np.testing.assert_array_equal(found, array)
