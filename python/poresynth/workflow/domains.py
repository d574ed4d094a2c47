"""Where the result of a run matters, and what is wanted from place to place."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from poresynth import console
from poresynth.errors import ParameterError
from poresynth.workflow.files import read
from poresynth.workflow.inputs import read_exemplars

if TYPE_CHECKING:
    from poresynth.engines.base import Synthesizer
    from poresynth.shapes import Domain
    from poresynth.volume import Volume

__all__ = ["check_room", "field_of", "read_mask", "shape_of_mask"]


def read_mask(mask: str | None, unit: str | None, volume: Volume) -> Domain | None:
    """Read a domain in voxels of a volume, and say what was repaired.

    Parameters
    ----------
    mask : str, optional
        Path of a volume or a closed mesh; nothing is read without.
    unit : str, optional
        Unit of a mesh that does not say its own.
    volume : Volume
        Whose voxel size and unit count.
    """
    from poresynth.shapes import read_domain

    if mask is None:
        return None
    domain = read_domain(mask, voxel_size=volume.voxel_size, unit=volume.unit, body_unit=unit)
    for said in domain.notes:
        console.note(f"{mask}: {said}")
    return domain


def shape_of_mask(document: Mapping[str, Any]) -> tuple[int, int, int] | None:
    """Return the shape of a mask, in voxels of the exemplar, for a run that says none."""
    from poresynth.config import validate
    from poresynth.shapes import read_domain

    mask = document.get("mask")
    if mask is None or document.get("shape") is not None:
        return None
    run = validate({**document, "shape": (1, 1, 1)})
    exemplar = read_exemplars(run)[0]
    # Repairs are said when the run reads the body.
    return read_domain(
        str(mask),
        voxel_size=exemplar.voxel_size,
        unit=exemplar.unit,
        body_unit=run.mask_unit,
    ).mask.shape


def check_room(domain: Domain, exemplar: Volume, engine: Synthesizer) -> None:
    """Refuse a body that is smaller than what it is filled with."""
    from poresynth import shapes
    from poresynth.engines.grading import feature_size

    threshold = getattr(engine, "threshold_", None)
    if threshold is not None:
        structure = exemplar.array if exemplar.array.ndim == 3 else exemplar.array[..., 0]
        # Half of a solid and a pore intercept together: the mean size of one of them.
        feature = feature_size(structure > threshold) / 2 * min(exemplar.voxel_size)
        shapes.check_room(domain.mask, feature)


def field_of(name: str, wanted: float | str | None, shape: tuple[int, int, int]) -> Any:
    """Return a number, or a map of a volume: from a file, or linear from face to face."""
    import numpy as np

    if not isinstance(wanted, str):
        return wanted
    found = re.fullmatch(r"([zyx])=([^:=]+):([^:=]+)", wanted)
    if found is None:
        return read(Path(wanted)).array
    try:
        first, last = (float(text) for text in found.groups()[1:])
    except ValueError:
        allowed = "must be a number, a map's path, or AXIS=FROM:TO such as z=0.6:0.9"
        raise ParameterError(name, wanted, allowed) from None
    along = "zyx".index(found[1])
    edges = [shape[axis] if axis == along else 1 for axis in range(3)]
    # Linear from face to face; the outermost voxels' centres lie half a voxel inside.
    places = (np.arange(shape[along]) + 0.5) / shape[along]
    return np.broadcast_to((first + (last - first) * places).reshape(edges), shape)
