"""Images as exemplars: how they are given, and what they show together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from poresynth.engines.phases import Phases
from poresynth.engines.solid_parameters import Axis, SolidParameters
from poresynth.errors import ParameterError
from poresynth.preprocess import validate_voxels
from poresynth.volume import Volume, as_volume

__all__ = ["AXES", "Images", "as_images", "targets"]

AXES: tuple[Axis, ...] = ("z", "y", "x")

ALIKE = 1.7
"""How many times as dense interfaces may be along one axis as along another in images of one
structure: 1.0 to 1.2 in slices of rock, 1.4 in slices of bone and of a Gaussian field stretched 1.5
times, 2.0 of one stretched twice. One distribution for all images made only the last worse."""


def as_images(exemplar: Volume | npt.ArrayLike | Sequence[Volume | npt.ArrayLike]) -> list[Volume]:
    """Return one to three images as volumes of shape (1, y, x[, channel]).

    Raises
    ------
    ParameterError
        If there are none or more than three, one is a volume, or they differ in channels or dtype.
    """
    if isinstance(exemplar, (list, tuple)) and np.ndim(exemplar[0]) > 1:
        given = list(exemplar)
    else:
        given = [exemplar]
    if not 1 <= len(given) <= 3:
        raise ParameterError("exemplar", f"{len(given)} images", "must be one to three images")
    images = []
    for image in given:
        if not isinstance(image, Volume):
            array = np.asanyarray(image)
            # (y, x), and (y, x, channel) of as many channels as images have.
            flat = array.ndim == 2 or (
                array.ndim == 3 and array.shape[0] > 1 and array.shape[2] < 5
            )
            image = array[None] if flat else array
        volume = as_volume(image)
        if volume.shape[0] != 1:
            raise ParameterError(
                "exemplar",
                volume.array.shape,
                "must be an image, (1, y, x); the engine 'volume' takes volumes",
            )
        validate_voxels(volume, "exemplar")
        images.append(volume)
    first = images[0]
    for image in images[1:]:
        if (image.channels, image.dtype) != (first.channels, first.dtype):
            raise ParameterError(
                "exemplar",
                f"{image.channels} channels of {image.dtype}",
                f"must be as the first image: {first.channels} channels of {first.dtype}",
            )
    return images


@dataclass(frozen=True, eq=False)
class Images:
    """One to three images of a material.

    Attributes
    ----------
    images : list of Volume
        Each of shape (1, y, x[, channel]).
    axes : list of (str, int)
        The axes across which planes are constrained, each with the position of its image.
    pooled : Volume
        The pixels of all of them, shape (1, 2, pixels[, channel]), each twice.
    phases : Phases
        Of the pooled pixels.
    """

    images: list[Volume]
    axes: list[tuple[Axis, int]]
    pooled: Volume
    phases: Phases

    @classmethod
    def of(cls, images: list[Volume], parameters: SolidParameters) -> Images:
        """Collect images, after `as_images`."""
        axes = parameters.axes
        if len(images) == 1:
            pairs = [(axis, 0) for axis in axes or AXES]
        else:
            names = axes or AXES[: len(images)]
            if len(names) != len(images):
                allowed = f"must name one axis for each of {len(images)} images"
                raise ParameterError("axes", axes, allowed)
            pairs = [(axis, i) for i, axis in enumerate(names)]
        channels = images[0].array.shape[3:]
        pixels = np.concatenate([image.array.reshape(-1, *channels) for image in images])
        # Twice over, for a volume has two edges; shares and histograms stay.
        pooled = Volume(np.stack([pixels] * 2)[None], images[0].voxel_size, images[0].unit)
        phases = Phases.of(pooled, parameters.kind, parameters.threshold, parameters.solid)
        return cls(images, pairs, pooled, phases)

    def phase(self, i: int) -> npt.NDArray[np.uint8]:
        """Return the phases of an image, shape (1, y, x)."""
        return self.phases.phase_of(self.images[i].array)

    @cached_property
    def alike(self) -> bool:
        """Whether one structure that is much the same along all axes may be behind the images."""
        if len(self.images) == 1 or self.images[0].channels > 1 or len(self.phases.labels) > 2:
            return False
        along: dict[Axis, list[float]] = {axis: [] for axis in AXES}
        for across, solid in self.solids().items():
            rows, columns = (axis for axis in AXES if axis != across)
            along[rows].append(float((solid[:, 1:] != solid[:, :-1]).mean()))
            along[columns].append(float((solid[..., 1:] != solid[..., :-1]).mean()))
        means = [np.mean(found) for found in along.values() if found]
        return bool(max(means) <= ALIKE * min(means))

    def solids(self) -> dict[Axis, npt.NDArray[np.bool_]]:
        """Return the solid of the image across each axis, shape (1, y, x)."""
        own = [self.phase(i) > 0 for i in range(len(self.images))]
        return {axis: own[i] for axis, i in self.axes}


def targets(
    images: Images, parameters: SolidParameters, fields: Sequence[npt.NDArray[np.float32]]
) -> list[tuple[int, npt.NDArray[np.float32], bool, float]]:
    """Return (axis, field of its image, symmetric, weight) of each axis that is constrained."""
    symmetric = len(images.images) == 1 if parameters.symmetric is None else parameters.symmetric
    weights = parameters.weights or (1.0,) * len(images.axes)
    return [
        (AXES.index(axis), fields[i], symmetric, weight)
        for (axis, i), weight in zip(images.axes, weights, strict=True)
    ]
