"""What an engine learns from."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from poresynth import console
from poresynth.engines import ENGINES
from poresynth.errors import ParameterError
from poresynth.workflow.files import crop, read

if TYPE_CHECKING:
    from poresynth.config import InputConfig, RunConfig
    from poresynth.volume import Volume

__all__ = ["read_exemplar", "read_exemplars"]

# Channels of a plain array (y, x, channel): more are the voxels of a volume.
_CHANNELS = 4


def read_exemplar(path: Path, source: InputConfig, *, image: bool = False) -> Volume:
    """Read an exemplar, cropped and reduced as the command line asks for it.

    A closed mesh is the voxels inside it. Where an image is wanted, a plain array (y, x, channel)
    is one.
    """
    from poresynth import preprocess
    from poresynth.meshes import READABLE

    is_mesh = path.suffix.lower() in READABLE
    volume = _read_mesh(path, source) if is_mesh else read(path, source)
    if image and volume.array.ndim == 3 and volume.shape[2] <= _CHANNELS < min(volume.shape[:2]):
        volume = volume.with_array(volume.array[None])
    if source.crop is not None:
        volume = crop(volume, source.crop)
    return preprocess.downsample(volume, source.downsample) if source.downsample > 1 else volume


def _read_mesh(path: Path, source: InputConfig) -> Volume:
    """Return the inside of a closed mesh in its box, in voxels of the size that is given."""
    from poresynth.shapes import read_domain

    if source.voxel_size is None:
        allowed = "is needed, z y x in the mesh's unit or that of --unit, to make voxels of a mesh"
        raise ParameterError("voxel_size", "(not given)", allowed)
    inside = read_domain(
        path,
        voxel_size=source.voxel_size,
        unit=source.unit or "voxel",
        # Of meshes only 3MF says its own.
        body_unit=None if path.suffix.lower() == ".3mf" else source.unit,
        margin=0,
        name="exemplar",
    )
    for said in inside.notes:
        console.note(f"{path}: {said}")
    return inside.mask


def read_exemplars(run: RunConfig) -> list[Volume]:
    """Read the exemplars of a run.

    Parameters
    ----------
    run : RunConfig
        The run.

    Returns
    -------
    list of Volume
        One volume, or the images of an engine that learns from images.

    Raises
    ------
    ParameterError
        If the engine takes something else, or the images differ in their channels.
    FileError
        If one cannot be read.
    """
    entry = ENGINES[run.engine]
    images, either = entry.learns_from == "images", entry.learns_from == "either"
    count = len(run.exemplar)
    if count > entry.most:
        one = "one volume or image" if either else "one volume"
        what = f"1 to {entry.most} images" if images else f"{one}; for images take --engine solid"
        allowed = f"are {count}, but the engine {run.engine} learns from {what}"
        raise ParameterError("exemplar", ", ".join(run.exemplar), allowed)
    volumes = []
    for path in run.exemplar:
        volume = read_exemplar(Path(path), run.input, image=images)
        if not either and images != (volume.shape[0] == 1):
            raise ParameterError("exemplar", path, _refusal(run.engine, images, volume))
        volumes.append(volume)
    channels = [volume.channels for volume in volumes]
    if len(set(channels)) > 1:
        allowed = f"must have the same number of channels, not {', '.join(map(str, channels))}"
        raise ParameterError("exemplar", ", ".join(run.exemplar), allowed)
    return volumes


def _refusal(engine: str, images: bool, volume: Volume) -> str:
    """Return why an engine does not take a volume, or an image."""
    if not images:
        return f"is an image, but the engine {engine} learns from a volume; take --engine solid"
    edges, middle = " × ".join(map(str, volume.shape)), volume.shape[0] // 2
    return (
        f"is a volume of {edges} voxels, but the engine {engine} learns from images; take --engine "
        f"volume, or a slice, such as --crop {middle}:{middle + 1} : :"
    )
