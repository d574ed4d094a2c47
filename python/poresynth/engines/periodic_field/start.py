"""Where a training starts: at the model of stochastic geometry that is nearest to the exemplar."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor, nn

from poresynth.engines.neural.noise import mix_seed
from poresynth.engines.neural.tiles import assemble
from poresynth.engines.periodic_field.distributions import quantiles
from poresynth.engines.periodic_field.jets import JetLoss
from poresynth.engines.periodic_field.latent import LatentField
from poresynth.engines.periodic_field.period import WAVELENGTHS, Period
from poresynth.engines.periodic_field.sampling import FieldTiles, Frame
from poresynth.engines.periodic_field.windows import Windows
from poresynth.engines.point_models import models
from poresynth.metrics.correlation import normalised, relative_error, two_point_correlation

__all__ = ["Start", "choose_start", "model_names", "spacings"]

SHARES = (0.35, 0.5, 0.6, 0.7, 0.85, 1.0, 1.2, 1.4)
"""Distances of the points that are tried, in wavelengths of the exemplar."""

STRETCHED = 1.2
"""How much longer wavelengths along one axis must be than along another for points to be tried at
distances that are less stretched, and not at all, too: wavelengths of small exemplars are not well
known."""

_EDGES = {2: (128, 256), 3: (48, 64)}
"""Edges of what is made of every model at first, and then of the best, pixels or voxels."""

_BEST, _SEEDS = 10, 3
"""How many models are made again, and how often: of one small volume the autocovariance is off by a
third of what it tells."""

_REACH = {2: 48, 3: 24}
"""Lags that models are judged by, pixels or voxels."""

_PLACES = 2048
"""Places by whose jets models are told apart."""

_DRAWN, _FACTORS = 1 << 16, 8
"""Points whose guidance is looked at, and factors that are told apart."""

_KNOTS = 1024
"""Equal shares of the values whose ranks are known."""


def model_names(axes: int) -> list[str]:
    """Return what the models are called, in words."""
    return [*(_called(name, sign) for sign in (1, -1) for name in models(axes)), "noise"]


def spacings(
    period: Period, given: Sequence[float], free: Sequence[bool]
) -> list[tuple[float, ...]]:
    """Return the distances of points that are tried, along each axis as phases.

    Parameters
    ----------
    period : Period
        What training starts from.
    given : sequence of float
        Distance along axes that are not free, as a phase.
    free : sequence of bool
        Along which axes the distance may be any: the period stands for wavelengths there.
    """
    # In pixels or voxels.
    waves = [length / WAVELENGTHS for length in period.length]
    own = [wave for wave, one in zip(waves, free, strict=True) if one]
    if not own:
        return [tuple(given)]
    bases = [waves]
    if max(own) > STRETCHED * min(own):
        mean = math.prod(own) ** (1 / len(own))
        bases += [[math.sqrt(mean * wave) for wave in waves], [mean] * len(waves)]
    return [
        tuple(
            2 * share * wave / length if one else phase
            for wave, length, phase, one in zip(base, period.length, given, free, strict=True)
        )
        for base in bases
        for share in SHARES
    ]


@dataclass(frozen=True)
class Start:
    """The model that was chosen.

    Attributes
    ----------
    name : str
        What it is, in words.
    weights : tuple of float
        Of the latent values.
    spacing : tuple of float
        Distance of the points along each axis, as a phase.
    scores : Tensor
        Sums of the latent values by these, ascending.
    fields : Tensor
        The field at these, shape (guidance, score, channel): as many voxels have it as in the
        exemplar, where its guidance factor is alike.
    guides : Tensor
        The guidance factors, ascending; one, of any value, without guidance.
    error : float
        How far the model is from the exemplar by the autocovariance and by the jets together, %.
    """

    name: str
    weights: tuple[float, ...]
    spacing: tuple[float, ...]
    scores: Tensor
    fields: Tensor
    guides: Tensor
    error: float

    def words(self) -> str:
        """Say what it is, and how near, in a few words."""
        return f"{self.name}, {self.error:.0f} % off"

    def __call__(self, latent: Tensor, guidance: Tensor | None = None) -> Tensor:
        """Return the field of latent values.

        Parameters
        ----------
        latent : Tensor
            Shape (batch, points, …, value).
        guidance : Tensor, optional
            Shape (batch, 1, points, …).

        Returns
        -------
        Tensor
            Shape (batch, channel, points, …).
        """
        scores = latent @ latent.new_tensor(self.weights)
        fields = [_ranked(scores, self.scores, own) for own in self.fields]
        total = fields[0]
        if guidance is not None and len(fields) > 1:
            place = _place(guidance[:, 0], self.guides)[..., None]
            shares = [(1 - (place - k).abs()).clamp(min=0) for k in range(len(fields))]
            total = torch.stack([s * own for s, own in zip(shares, fields, strict=True)]).sum(0)
        return total.movedim(-1, 1)


def choose_start(
    windows: Windows,
    reach: int,
    latent: Callable[[tuple[float, ...]], LatentField],
    period: Sequence[float],
    tried: Sequence[tuple[float, ...]],
    seed: int,
    progress: Callable[[float], object] | None = None,
    model: str | None = None,
) -> Start:
    """Choose the model, and the distance of its points, whose field is nearest to the exemplar.

    The ranks of a model's values are given the exemplar's values; nearest is then by the
    autocovariance, along the axes and over all directions, and by `JetLoss`.

    Parameters
    ----------
    windows : Windows
        Of the exemplar.
    reach : int
        Of the jets.
    latent : callable
        Returns the latent field whose points are so far apart, as a phase.
    period : sequence of float
        Of the encoding, pixels or voxels.
    tried : sequence of tuple of float
        Distances of the points along each axis, as phases.
    seed : int
        Of the models' fields.
    progress : callable, optional
        Called with the share that is done.
    model : str, optional
        One of `model_names`, of which only the distance is chosen.

    Returns
    -------
    Start

    Notes
    -----
    A network does not come to such a structure by itself: from a flat field the same losses make
    lumps of struts. Peak memory: 370 bytes for each voxel of 64³, measured.
    """
    exemplar = _Exemplar(windows, reach)
    axes = windows.field.ndim - 1
    found = []
    for done, spacing in enumerate(tried):
        if progress is not None:
            progress(done / (len(tried) + _BEST))
        field = latent(spacing)
        # Without distances it is the sum of the latent numbers, a Gaussian field nearly.
        known = models(axes) | {"noise": []}
        kinds = {name: _weights(near, field) for name, near in known.items()}
        sums = _made(list(kinds.values()), field, period, _EDGES[axes][0], seed)
        for (name, weights), scores in zip(kinds.items(), sums, strict=True):
            for sign in (1.0,) if name == "noise" else (1.0, -1.0):
                called = _called(name, sign)
                if model not in (None, called):
                    continue
                knots = quantiles(sign * scores.flatten(), _KNOTS)
                error = exemplar.error(_ranked(sign * scores, knots, exemplar.fields))
                found.append(
                    Start(
                        called,
                        tuple(sign * weight for weight in weights),
                        spacing,
                        knots,
                        exemplar.fields[None],
                        torch.zeros(1),
                        error,
                    )
                )
    found.sort(key=lambda start: start.error)
    final = []
    for done, start in enumerate(found[:_BEST]):
        if progress is not None:
            progress((len(tried) + done) / (len(tried) + _BEST))
        field = latent(start.spacing)
        scores = torch.stack(
            [
                _made([start.weights], field, period, _EDGES[axes][1], mix_seed(seed, k))[0]
                for k in range(_SEEDS)
            ]
        )
        knots = quantiles(scores.flatten(), _KNOTS)
        errors = [exemplar.error(_ranked(one, knots, exemplar.fields)) for one in scores]
        final.append(replace(start, scores=knots, error=float(np.mean(errors))))
    best = min(final, key=lambda start: start.error)
    guides, fields = exemplar.guided(windows, mix_seed(seed, _SEEDS))
    return best if guides is None else replace(best, fields=fields, guides=guides)


def _called(name: str, sign: float) -> str:
    return name if sign > 0 else f"all but {name}"


def _made(
    weights: Sequence[Sequence[float]],
    latent: LatentField,
    period: Sequence[float],
    edge: int,
    seed: int,
) -> Tensor:
    """Return sums of the latent values on a square or cube, shape (sum, edge, …)."""
    axes = latent.axes
    shape = (1, edge, edge) if axes == 2 else (edge, edge, edge)
    frame = Frame.open(period, latent.spacing, [False] * axes)
    # A tile takes some milliseconds, whatever its size.
    half = (1 if axes == 2 else edge // 2, edge // 2, edge // 2)
    tiles = FieldTiles(_Sums(axes, weights), latent, frame, seed=seed, edge=half)
    made = assemble(tiles, (0, 0, 0), shape)
    # Tiles go from −1 to 1 where networks go from 0 to 1.
    return (torch.from_numpy(made).reshape(-1, *shape[3 - axes :]) + 1) / 2


class _Exemplar:
    """What models are compared with.

    Attributes
    ----------
    fields : Tensor
        Its field from low to high, shape (_KNOTS, channel).
    """

    def __init__(self, windows: Windows, reach: int) -> None:
        field = windows.field.cpu()
        random = torch.Generator()
        random.manual_seed(1)
        self._jets = JetLoss(Windows(field), reach=reach, places=_PLACES, random=random, sums=0)
        flat = field.flatten(1)
        # Colours have no order; most of what varies is one sum of them.
        self._mean = flat.mean(1)
        self._lead = torch.linalg.eigh(torch.cov(flat).reshape(len(flat), len(flat)))[1][:, -1]
        if self._lead.sum() < 0:
            self._lead = -self._lead
        self.fields = self._in_order(field)
        # Fields are 0 to 1, and the surface of distances is at 0.5.
        self._level = 0.5
        if len(field) > 1 or not 0.01 < float((field > self._level).float().mean()) < 0.99:
            self._level = float(self._leading(field).mean())
        self._reach = min(_REACH[field.ndim - 1], min(field.shape[1:]) // 2)
        self._curves = self._curves_of(field)

    def error(self, field: Tensor) -> float:
        """Return how far a field of shape (points, …, channel) is, %."""
        field = field.movedim(-1, 0)
        random = torch.Generator()
        random.manual_seed(1)
        jets, windows = self._jets, Windows(field)
        found = [
            float(jets(windows.draw(offsets, jets.places, random), grid))
            for grid, offsets in enumerate(jets.offsets)
        ]
        return relative_error(self._curves_of(field), self._curves) + 100 * float(np.mean(found))

    def guided(self, windows: Windows, seed: int) -> tuple[Tensor | None, Tensor]:
        """Return guidance factors, ascending, and the fields from low to high near each."""
        channels, axes = len(windows.field), windows.field.ndim - 1
        if windows.channels == channels:
            return None, self.fields[None]
        random = torch.Generator()
        random.manual_seed(seed >> 1)
        drawn = windows.draw([torch.zeros(1, dtype=torch.int64)] * axes, _DRAWN, random)
        points = drawn.cpu().flatten(1)
        parts = points[points[:, channels].argsort()].chunk(_FACTORS)
        guides = torch.stack([part[:, channels].mean() for part in parts])
        return guides, torch.stack([self._in_order(part[:, :channels].T) for part in parts])

    def _in_order(self, field: Tensor) -> Tensor:
        """Return the field from low to high, means of equal shares, shape (_KNOTS, channel)."""
        if len(field) == 1:
            return quantiles(field.flatten(), _KNOTS)[:, None]
        order = self._leading(field).flatten().argsort()
        at = ((torch.arange(_KNOTS) + 0.5) / _KNOTS * len(order)).long()
        # Of colours in the same place of the order the mean: one alone is any of them.
        parts = field.flatten(1).T[order].tensor_split(min(_KNOTS, len(order)))
        means = torch.stack([part.mean(0) for part in parts])
        return means[at * len(means) // len(order)]

    def _leading(self, field: Tensor) -> Tensor:
        if len(field) == 1:
            return field[0]
        shape = [-1] + [1] * (field.ndim - 1)
        total: Tensor = ((field - self._mean.reshape(shape)) * self._lead.reshape(shape)).sum(0)
        return total

    def _curves_of(self, field: Tensor) -> npt.NDArray[np.float64]:
        """Return the autocovariance of the field's cut, over its variance, along all lines."""
        cut = (self._leading(field) > self._level).numpy()
        found = two_point_correlation(cut[None] if cut.ndim == 2 else cut, self._reach)
        curves = [found.radial, *[found.z, found.y, found.x][3 - cut.ndim :]]
        return np.concatenate([normalised(curve, found.radial[0]) for curve in curves])


class _Sums(nn.Module):
    """Sums of the latent values, in the place of a generator."""

    def __init__(self, axes: int, weights: Sequence[Sequence[float]]) -> None:
        super().__init__()
        self.axes, self.channels, self.device = axes, len(weights), torch.device("cpu")
        self._weights = torch.tensor(weights)

    def forward(self, phases: Sequence[Tensor], latent: Tensor, guidance: None = None) -> Tensor:
        return (latent @ self._weights.T).movedim(-1, 1)


def _weights(near: Sequence[float], latent: LatentField) -> list[float]:
    """Return the weights of all latent values: of the first points' distances, or of numbers."""
    count = latent.groups * latent.numbers
    if not near:
        return [0.0] * (latent.size - count) + [1.0] * count
    return [*near, *[0.0] * (latent.size - len(near))]


def _ranked(scores: Tensor, knots: Tensor, fields: Tensor) -> Tensor:
    """Return the fields of scores, shape (points, …) → (points, …, channel), by lines between."""
    fields = fields.to(scores)
    place = _place(scores, knots)[..., None]
    lower = place.long().clamp(max=len(fields) - 2)
    low, high = fields[lower[..., 0]], fields[lower[..., 0] + 1]
    return low + (place - lower) * (high - low)


def _place(values: Tensor, knots: Tensor) -> Tensor:
    """Return where values lie among ascending knots, 0 to their number less 1."""
    knots = knots.to(values)
    upper = torch.searchsorted(knots, values.contiguous()).clamp(1, len(knots) - 1)
    low, high = knots[upper - 1], knots[upper]
    return upper - 1 + ((values - low) / (high - low).clamp(min=1e-9)).clamp(0, 1)
