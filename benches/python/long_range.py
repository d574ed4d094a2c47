"""How much of an exemplar's two-point correlation only a volume of its own size and place can have.

    python benches/python/long_range.py [--exemplars WORD …]

The ends of the pairs at a long distance lie in other parts of the exemplar than the mean voxel:
more often near its centre. Where these parts are denser, the correlation holds their excess, which
no volume with the same structure everywhere has. Taken away, it leaves the correlation of such a
volume; the error of that, as `metrics.two_point_error` counts it, is what a perfect synthesis
would score.
"""

from __future__ import annotations

import argparse

import numpy as np
import numpy.typing as npt
from scipy import fft
from specimens import materials

import poresynth
from poresynth import metrics

R_MAX = 50  # of metrics.two_point_error


def correlations(
    solid: npt.NDArray[np.bool_],
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return the radial two-point correlation, and the same were the ends of a pair independent."""
    shape = [fft.next_fast_len(n + R_MAX, real=True) for n in solid.shape]
    phase, inside = (fft.rfftn(array.astype(float), shape) for array in (solid, solid | True))
    both, first, second, pairs = (
        fft.irfftn(a * b.conj(), shape)
        for a, b in ((phase, phase), (phase, inside), (inside, phase), (inside, inside))
    )
    lags = np.meshgrid(*(fft.fftfreq(n, 1 / n) for n in shape), indexing="ij", sparse=True)
    distance = np.rint(np.sqrt(sum(lag**2 for lag in lags))).astype(int)
    near = distance <= R_MAX

    def radial(values: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        return np.bincount(distance[near], values[near])

    independent = first * second / np.maximum(pairs, 1)
    return radial(both) / radial(pairs), radial(independent) / radial(pairs)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--exemplars", nargs="*", default=[""], metavar="WORD", help="parts of titles"
    )
    for material in materials(parser.parse_args().exemplars):
        solid = poresynth.binarize(material.exemplar)
        own, independent = correlations(solid)
        np.testing.assert_allclose(
            own, metrics.two_point_correlation(solid, R_MAX).radial, rtol=1e-4
        )
        excess = (independent - solid.mean() ** 2)[1:]
        error = 100 * np.linalg.norm(excess) / np.linalg.norm(own[1:])
        print(f"{material.title}: D2 {error:.2f} % without the exemplar's own gradients")


if __name__ == "__main__":
    main()
