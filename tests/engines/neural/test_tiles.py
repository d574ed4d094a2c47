"""Windows from canonical tiles."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from poresynth.engines.neural.noise import lattice_noise
from poresynth.engines.neural.tiles import assemble, blocks
from poresynth.errors import MemoryEstimateError

Triple = tuple[int, int, int]


class Hash:
    """A field whose every value is known: the noise of its place."""

    edge = (5, 4, 3)
    channels = 2
    device = torch.device("cpu")

    def __init__(self) -> None:
        self.asked: list[Triple] = []

    def __call__(self, index: Triple) -> np.ndarray:
        self.asked.append(index)
        start = [i * e for i, e in zip(index, self.edge, strict=True)]
        return lattice_noise(1, start, self.edge, channels=2)


CORNER = st.tuples(*[st.integers(-30, 30)] * 3)
SHAPE = st.tuples(*[st.integers(1, 12)] * 3)


@given(CORNER, SHAPE, st.integers(1, 4))
def test_a_window_holds_the_field_and_asks_for_each_tile_once(
    start: Triple, shape: Triple, threads: int
) -> None:
    tiles = Hash()
    found = assemble(tiles, start, shape, threads=threads)
    assert np.array_equal(found, lattice_noise(1, start, shape, channels=2))
    needed = [
        {(a + i) // e for i in range(n)} for a, n, e in zip(start, shape, tiles.edge, strict=True)
    ]
    assert len(set(tiles.asked)) == len(tiles.asked) == np.prod([len(n) for n in needed])


@given(CORNER, SHAPE, st.integers(0, 2**32 - 1))
def test_tiles_where_nothing_matters_are_not_computed(
    start: Triple, shape: Triple, seed: int
) -> None:
    domain = np.random.default_rng(seed).random(shape) > 0.98
    tiles, all_tiles = Hash(), Hash()
    found = assemble(tiles, start, shape, domain=domain)
    whole = assemble(all_tiles, start, shape)
    assert np.array_equal(found[:, domain], whole[:, domain])
    at = np.argwhere(domain) + start
    assert set(tiles.asked) == {tuple(map(int, place // tiles.edge)) for place in at}


@given(SHAPE, st.integers(1, 7))
def test_blocks_cover_a_window_once(shape: Triple, edge: int) -> None:
    count = np.zeros(shape, int)
    for box in blocks(shape, edge):
        assert max(box.shape) <= edge
        assert count[box.slices].shape == box.shape
        count[box.slices] += 1
    assert (count == 1).all()


def test_progress_reaches_the_whole_and_an_exception_in_it_stops_the_work() -> None:
    shares: list[float] = []
    assemble(Hash(), (0, 0, 0), (10, 8, 6), progress=shares.append)
    assert shares == [i / 8 for i in range(1, 9)]

    def stop(share: float) -> None:
        raise InterruptedError

    tiles = Hash()
    with pytest.raises(InterruptedError):
        assemble(tiles, (0, 0, 0), (100, 80, 60), threads=1, progress=stop)
    assert len(tiles.asked) < 10


def test_an_error_in_a_tile_is_raised_and_the_threads_of_pytorch_are_given_back() -> None:
    class Broken(Hash):
        def __call__(self, index: Triple) -> np.ndarray:
            raise ArithmeticError("broken")

    before = torch.get_num_threads()
    with pytest.raises(ArithmeticError):
        assemble(Broken(), (0, 0, 0), (9, 9, 9))
    assert torch.get_num_threads() == before


def test_too_little_memory_for_a_tile_is_one_line() -> None:
    class Large(Hash):
        def __call__(self, index: Triple) -> np.ndarray:
            raise torch.OutOfMemoryError("CUDA out of memory. Tried to allocate 2 GiB")

    with pytest.raises(MemoryEstimateError, match=r"cpu .* a tile of 5 × 4 × 3 voxels; fewer"):
        assemble(Large(), (0, 0, 0), (9, 9, 9))
