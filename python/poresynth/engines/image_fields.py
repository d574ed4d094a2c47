"""What is synthesised of images, and the way back to their values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from poresynth import _core
from poresynth.engines.images import Images, targets
from poresynth.engines.solid_parameters import SolidParameters
from poresynth.engines.values import channels_first
from poresynth.metrics.histograms import match_histogram

__all__ = ["ColourField", "DistanceField", "ImageField", "PhaseField", "agreed", "with_feature"]

Field = npt.NDArray[np.float32]

BLUR = 0.8
"""Blur of phases that are synthesised as such, pixels: borders of one pixel are all that a filter
sees of them otherwise."""

SMALL = 3
"""Edge of filters, pixels: larger ones leave more dead ends of bone and foam."""

LARGE = 5
"""Edge of filters for gray values: they say nothing of the shape beyond."""

WEAK = 0.05
"""Regularisation of response matching. What hardly a filter sees becomes a little rough, as
surfaces are: with 1 those of Ketton limestone are 12 % too smooth."""

STRONG = 2.0
"""Regularisation for gray values, whose shortest waves start as noise of the image's own strength:
with `WEAK` sections of a smooth image are woven of threads."""

SURFACE = 2.0
"""Pixels from the surface within which gray values follow from distance alone: a scan blurs."""


class ImageField(Protocol):
    """A field that stands for images, about 0 … 255, of shape (channel, z, y, x)."""

    @property
    def filter_edge(self) -> int:
        """Edge of the filters that suit it, pixels."""

    @property
    def regularisation(self) -> float:
        """ε of response matching, as a share of the filters' mean power."""

    @property
    def detail(self) -> bool:
        """Whether waves that the coarser level could not hold start as noise."""

    def of(self, array: npt.NDArray[Any], phase: npt.NDArray[np.uint8]) -> Field:
        """Return pixels or voxels as field values."""

    def scores(self, field: Field) -> Field:
        """Return what is cut into phases."""

    def gray(self, field: Field, seed: int, threads: int) -> Field:
        """Return gray values, as an order of the voxels of each phase; of gray images only."""


@dataclass(frozen=True, eq=False)
class PhaseField:
    """Phases as they are: of two one channel, of more one each."""

    images: Images
    filter_edge = SMALL
    regularisation = WEAK
    detail = False

    def of(self, array: npt.NDArray[Any], phase: npt.NDArray[np.uint8]) -> Field:
        """Return blurred indicators."""
        count = len(self.images.phases.labels)
        which = [1] if count == 2 else range(count)
        field = np.stack([np.where(phase == k, np.float32(255), np.float32(0)) for k in which])
        return _core.gaussian(field, BLUR, boundary="open")

    def scores(self, field: Field) -> Field:
        """Return the channels of the phases."""
        count = len(self.images.phases.labels)
        return field[: 1 if count == 2 else count]

    def gray(self, field: Field, seed: int, threads: int) -> Field:
        """Return the field: images of phases have no gray values."""
        return field


class ColourField:
    """Gray or colour values; colours along directions that do not correlate.

    Channels can then be matched one by one. Turning keeps distances: all channels have one scale,
    at which the widest spans 255.
    """

    def __init__(self, images: Images) -> None:
        pixels = channels_first(images.pooled.array).reshape(images.pooled.channels, -1)
        self._centre = pixels.mean(axis=1, dtype=float)
        self._scale = 255 / float(np.ptp(pixels.astype(float), axis=1).max())
        self._directions = np.eye(len(pixels))
        if len(pixels) > 1:
            directions = np.linalg.eigh(np.cov(pixels.astype(float)))[1].T[::-1]
            # The sign that eigenvectors are given is the library's own affair.
            signs = np.where(directions.sum(axis=1, keepdims=True) < 0, -1, 1)
            self._directions = directions * signs
        self._dark = images.phases.solid == "dark"
        gray = len(pixels) == 1
        self.filter_edge = LARGE if gray else SMALL
        self.regularisation = STRONG if gray else WEAK
        self.detail = gray

    def of(self, array: npt.NDArray[Any], phase: npt.NDArray[np.uint8]) -> Field:
        """Return turned and scaled values."""
        centred = channels_first(array) - self._centre[:, None, None, None]
        turned = np.tensordot(self._directions, centred, axes=1)
        return (127.5 + self._scale * turned).astype(np.float32)

    def scores(self, field: Field) -> Field:
        """Return the first channel, which decides the structure."""
        first = self.gray(field, 0, 0)[:1]
        return -first if self._dark else first

    def gray(self, field: Field, seed: int, threads: int) -> Field:
        """Return the values turned back."""
        channels = len(self._directions)
        turned = (field[:channels] - np.float32(127.5)) / np.float32(self._scale)
        back = self._directions.T.astype(np.float32)
        gray: Field = np.tensordot(back, turned, axes=1)
        gray += self._centre.astype(np.float32)[:, None, None, None]
        return gray


class DistanceField:
    """Clipped signed distances in the plane of each image.

    They carry shape beyond a filter's or a window's edge. Gray values are the means at each
    distance, plus a Gaussian random field with the covariance and the histogram of what the means
    leave of the images.
    """

    filter_edge = SMALL
    regularisation = WEAK
    detail = False

    def __init__(self, images: Images, parameters: SolidParameters) -> None:
        self._images, self._parameters = images, parameters
        self._clip = parameters.clip

    def of(self, array: npt.NDArray[Any], phase: npt.NDArray[np.uint8]) -> Field:
        """Return distances; an image is one voxel thick, so that they lie in its plane."""
        return self._images.phases.distance_field(phase, self._clip)

    def scores(self, field: Field) -> Field:
        """Return the distances."""
        count = len(self._images.phases.labels)
        return field[: 1 if count == 2 else count]

    def gray(self, field: Field, seed: int, threads: int) -> Field:
        """Return gray values, from the distances and a random field."""
        images = self._images
        values = [channels_first(image.array).astype(np.float32) for image in images.images]
        places = [
            self._place(self.of(image.array, images.phase(i))[0])
            for i, image in enumerate(images.images)
        ]
        means, spreads = [], []
        for channel in range(len(values[0])):
            own = np.concatenate([value[channel].ravel() for value in values])
            mean, spread = self._by_place(np.concatenate([p.ravel() for p in places]), own)
            means.append(mean)
            spreads.append(spread)
        left = [
            np.stack(
                [
                    (own - _at(place, mean)) / _at(place, spread)
                    for own, mean, spread in zip(value, means, spreads, strict=True)
                ]
            )
            for place, value in zip(places, values, strict=True)
        ]
        aims = [
            (axis, own[:, 0], symmetric, weight)
            for axis, own, symmetric, weight in targets(images, self._parameters, left)
        ]
        gray = _core.random_field(aims, field.shape[1:], seed=seed, threads=threads)
        place = self._place(field[0])
        for own, mean, spread in zip(gray, means, spreads, strict=True):
            own *= _at(place, spread)
            own += _at(place, mean)
        return gray

    def _by_place(self, place: Field, values: Field) -> tuple[Field, Field]:
        """Return mean and standard deviation of values at each distance."""
        nearest = np.rint(place).astype(np.intp)
        length = 4 * self._clip + 1
        counts = np.bincount(nearest, minlength=length)
        mean = _filled(np.bincount(nearest, values, length), counts)
        square = (values - _at(place, mean)).astype(float) ** 2
        # What the means leave at the surface is where in a pixel it lies, which the field knows.
        surface = np.abs(np.arange(length) - 2 * self._clip) < 2 * SURFACE
        far = np.where(surface, 0, counts)
        spread = np.sqrt(
            _filled(np.bincount(nearest, square, length), far if far.any() else counts)
        )
        return mean, np.maximum(spread, np.float32(1e-6 * np.ptp(values)))

    def _place(self, distance: Field) -> npt.NDArray[np.float32]:
        """Return distances in bins of half a voxel, from 0: finer ones would hold few pixels."""
        place: Field = (distance - np.float32(127.5)) * np.float32(self._clip / 63.75)
        place += np.float32(2 * self._clip)
        return place


def _at(place: Field, curve: Field) -> Field:
    values: Field = np.interp(place, np.arange(len(curve)), curve).astype(np.float32)
    return values


def _filled(sums: npt.NDArray[Any], counts: npt.NDArray[np.intp]) -> Field:
    """Return means, with empty bins filled between their neighbours."""
    bins = np.arange(len(counts))
    full = counts > 0
    filled: Field = np.interp(bins, bins[full], sums[full] / counts[full]).astype(np.float32)
    return filled


def agreed(fields: list[Field]) -> list[Field]:
    """Give each channel of all images the distribution that it has on all of them together.

    A voxel lies in planes across all axes and has one value, so that its distribution is one.
    Images that ask for several would pull at each voxel without an end: with three slices of bone
    the D2 of sections was 17.5 instead of 10.2 %, and the gradient 22 instead of 7 % too high; with
    the gray values of three slices of cement paste it was 10 % too high, and is 2 % too low.

    Parameters
    ----------
    fields : list of numpy.ndarray
        Of each image the field, shape (channel, 1, y, x).

    Returns
    -------
    list of numpy.ndarray
        The same, each value replaced by that of its rank; equal ones stay equal.
    """
    if len(fields) == 1:
        return fields
    pooled = [
        np.concatenate([f[c].reshape(1, 1, -1) for f in fields], 2) for c in range(len(fields[0]))
    ]
    return [
        np.stack([match_histogram(own, every) for own, every in zip(field, pooled, strict=True)])
        for field in fields
    ]


def with_feature(field: Field, mask: npt.NDArray[np.bool_], parameters: SolidParameters) -> Field:
    """Append the signed distance to a mask as a channel (prieto_2011 §2.1.1)."""
    distance = _core.signed_distance(mask, parameters.clip, boundary="open")
    scaled = 127.5 + (127.5 / parameters.clip) * distance
    return np.concatenate([field, np.float32(parameters.feature_weight) * scaled[None]])
