"""NPY and NPZ, against NumPy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import poresynth
from poresynth.errors import FileError, ParameterError
from poresynth.volume import Volume

VOXELS = np.arange(24, dtype=np.int16).reshape(2, 3, 4)


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("dtype", ["<i2", ">i2", "<f8", "?", "<u8"])
def test_numpy_writes_we_read(dtype: str, order: str, tmp_path: Path) -> None:
    array = np.asarray(VOXELS.astype(dtype), order=order)
    np.save(tmp_path / "a.npy", array)
    np.savez(tmp_path / "a.npz", anything=array)
    for suffix in (".npy", ".npz"):
        found = poresynth.read(tmp_path / f"a{suffix}").array
        np.testing.assert_array_equal(found, array)
        assert found.dtype == np.dtype(dtype).newbyteorder("=")


def test_we_write_numpy_reads(tmp_path: Path) -> None:
    for array in (VOXELS, np.asfortranarray(VOXELS), VOXELS[:, ::-1]):
        poresynth.write(tmp_path / "a.npy", Volume(array, 2, "mm"))
        np.testing.assert_array_equal(np.load(tmp_path / "a.npy"), array)
        poresynth.write(tmp_path / "a.npz", Volume(array, 2, "mm"))
        with np.load(tmp_path / "a.npz") as file:
            np.testing.assert_array_equal(file["array"], array)
            assert file["voxel_size"].tolist() == [2, 2, 2]
            assert str(file["unit"]) == "mm"


@pytest.mark.parametrize("suffix", [".npy", ".npz"])
def test_images_and_what_is_neither(suffix: str, tmp_path: Path) -> None:
    save = np.save if suffix == ".npy" else np.savez
    path = tmp_path / f"a{suffix}"
    save(path, VOXELS[0])
    assert poresynth.read(path).array.shape == (1, 3, 4)
    save(path, VOXELS.astype(np.float16))
    assert poresynth.read(path).dtype == np.float32
    save(path, VOXELS.astype(np.complex64))
    with pytest.raises(FileError, match="voxels of type complex64 are not supported"):
        poresynth.read(path)
    save(path, np.empty((3, 0, 4)))
    with pytest.raises(FileError, match="the file holds no voxels"):
        poresynth.read(path)
    save(path, np.array([[[{"a": 1}]]], dtype=object), allow_pickle=True)
    with pytest.raises(FileError, match=r"damaged, or not NP"):
        poresynth.read(path)


def test_shapes_that_are_no_volume(tmp_path: Path) -> None:
    for shape in ((4,), (2, 2, 2, 2, 2), ()):
        np.save(tmp_path / "a.npy", np.ones(shape))
        with pytest.raises(FileError, match="is no image and no volume"):
            poresynth.read(tmp_path / "a.npy")


def test_which_array_of_several(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", one=VOXELS, two=VOXELS + 1, edges=np.arange(3))
    with pytest.raises(ParameterError, match=r"name = None: .*one.*two"):
        poresynth.read(tmp_path / "a.npz")
    for wrong in ("three", "edges"):
        with pytest.raises(ParameterError, match=rf"name = {wrong}: .*one.*two"):
            poresynth.read(tmp_path / "a.npz", name=wrong)
    np.testing.assert_array_equal(poresynth.read(tmp_path / "a.npz", name="two"), VOXELS + 1)
    np.savez(tmp_path / "b.npz", volume=VOXELS, edges=np.arange(3), porosity=0.5)
    np.testing.assert_array_equal(poresynth.read(tmp_path / "b.npz"), VOXELS)
