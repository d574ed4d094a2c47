"""The structure of volumes against their exemplar's, in one number."""

from __future__ import annotations

import numpy as np
import pytest
from tests.references.structure_error import structure

from poresynth import exemplars, metrics
from poresynth.errors import ParameterError

EDGE = 24


def blobs(seed: int, edge: int = 48, sigma: float = 2.5) -> np.ndarray:
    from scipy import ndimage

    noise = np.random.default_rng(seed).standard_normal((edge,) * 3)
    smooth = ndimage.gaussian_filter(noise, sigma, mode="wrap")
    return smooth > np.quantile(smooth, 0.6)


def test_quantities_are_those_of_public_libraries() -> None:
    exemplar, volume = blobs(1), blobs(2)
    found = metrics.structure_error(exemplar, volume, window=EDGE)
    assert found.window == EDGE
    assert found.windows == (8, 8)
    sides = []
    for phase in (exemplar, volume):
        halves = (slice(EDGE), slice(EDGE, None))
        windows = [phase[z, y, x] for z in halves for y in halves for x in halves]
        sides.append([structure(window) for window in windows])
    for name in sides[0][0]:
        own, new = (np.array([window[name] for window in side]) for side in sides)
        difference = found.differences[name]
        assert difference.exemplar == pytest.approx(own.mean(), rel=1e-5), name
        assert difference.volume == pytest.approx(new.mean(), rel=1e-5), name
        scale = 100 / abs(own.mean())
        error = (new.mean() - own.mean()) * scale
        assert difference.error_percent == pytest.approx(error, abs=2e-3), name
        noise = scale * np.sqrt(own.var(ddof=1) / 8 + new.var(ddof=1) / 8)
        assert difference.noise_percent == pytest.approx(noise, rel=1e-3), name
    capped = [min(100, abs(d.error_percent)) for d in found.differences.values()]
    assert found.percent == pytest.approx(np.mean(capped))


def test_a_copy_has_no_error_and_another_material_a_large_one() -> None:
    exemplar = blobs(1)
    assert metrics.structure_error(exemplar, exemplar).percent == 0
    same = metrics.structure_error(exemplar, blobs(2)).percent
    other = metrics.structure_error(exemplar, exemplars.foam((48,) * 3, seed=1).array > 127)
    assert other.percent > 2 * same


def test_volumes_are_pooled() -> None:
    exemplar, first, second = blobs(1), blobs(2), blobs(3)
    one, other = (metrics.structure_error(exemplar, v) for v in (first, second))
    both = metrics.structure_error(exemplar, [first, second])
    assert both.windows == (8, 16)
    for name, difference in both.differences.items():
        means = [found.differences[name].volume for found in (one, other)]
        assert difference.volume == pytest.approx(np.mean(means))


def test_progress_reaches_the_end() -> None:
    shares: list[float] = []
    metrics.structure_error(blobs(1), blobs(2), progress=lambda _, share: shares.append(share))
    assert shares == sorted(shares)
    assert shares[-1] == 1


@pytest.mark.parametrize(
    ("volumes", "options", "message"),
    [
        ([], {}, "volumes = .*at least one"),
        (blobs(1)[:, :, :20], {"window": 24}, "window = 24: must be at most 20"),
        (blobs(1), {"window": 3}, "window = 3: must be at least 7"),
        (blobs(1)[0], {}, "volumes = .*must be"),
    ],
)
def test_bad_input_is_named(volumes: object, options: dict[str, int], message: str) -> None:
    with pytest.raises(ParameterError, match=f"^{message}"):
        metrics.structure_error(blobs(1), volumes, **options)  # type: ignore[arg-type]
