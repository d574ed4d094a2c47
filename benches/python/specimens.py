"""Materials that quality is measured on: an exemplar of each, and another piece of it."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import poresynth
from poresynth import exemplars
from poresynth.volume import Volume

EDGE = 100  # voxels of each exemplar: the size of the ScaffoldGAN paper's
CORNER = (EDGE,) * 3


@dataclass(frozen=True)
class Scan:
    """A public micro-CT scan; its exemplar is the first corner of `EDGE` voxels.

    Parameters
    ----------
    title : str
        What it is called.
    file : str
        Its name in the folder of the environment variable PORESYNTH_DATA.
    content : str
        What the file holds.
    source, licence : str
        Where it comes from.
    factor : int
        It is reduced so many times along each axis first.
    voxel_size : float or None
        In µm, of the file; None where the source does not state it.
    """

    title: str
    file: str
    content: str
    source: str
    licence: str
    factor: int = 1
    voxel_size: float | None = None

    def read(self, folder: Path) -> Volume:
        """Return the whole scan."""
        if self.voxel_size is None:
            volume = poresynth.read(folder / self.file)
        else:
            volume = poresynth.read(folder / self.file, voxel_size=self.voxel_size, unit="µm")
        return poresynth.downsample(volume, self.factor) if self.factor > 1 else volume


SCANS = (
    Scan(
        "trabecular bone",
        "trabecular_bone_gray_100.tif",
        "human trabecular bone, LHDL 3155_D_4; blocks of 2³ voxels of 200³ averaged",
        "ciclope-microFE/ciclope, test_data/LHDL/3155_D_4_bc/cropped; scan: LHDL",
        "MIT",
        voxel_size=39.0,
    ),
    Scan(
        "fine bone",
        "trabecular_bone_gray_200.tif",
        "the same 200³ voxels at full resolution",
        "as above",
        "MIT",
        voxel_size=19.5,
    ),
    Scan(
        "Berea sandstone",
        "berea_sandstone_binary_200.tif",
        "a corner of 200³ voxels of 400³; solid is 255",
        "LukasMosser/PorousMediaGan, data/berea; scan: Imperial College London",
        "MIT",
    ),
    Scan(
        "Ketton limestone ÷ 2",
        "ketton_limestone_binary_256.tif",
        "256³ voxels, of which blocks of 2³ become one; solid is 255",
        "LukasMosser/PorousMediaGan, data/ketton; scan: Imperial College London",
        "MIT",
        factor=2,
    ),
    Scan(
        "cement paste",
        "cement_gray_128.tif",
        "cement paste with air voids, 128³ voxels",
        "qim-center/qim3d, examples",
        "MIT",
    ),
)

# Drawn with one seed for the exemplar, with the next for the second specimen.
PROCEDURAL: dict[str, Callable[[tuple[int, int, int], int], Volume]] = {
    "spinodal": lambda shape, seed: exemplars.spinodal(shape, porosity=0.5, seed=seed),
    "open-cell foam": lambda shape, seed: exemplars.foam(shape, seed=seed),
}
TITLES = (*PROCEDURAL, *(scan.title for scan in SCANS))


@dataclass(frozen=True, eq=False)
class Material:
    """An exemplar, and what an independent piece of the same material looks like.

    Parameters
    ----------
    title : str
        What it is called.
    exemplar : Volume
        What is given to the engine.
    second : list of Volume
        Pieces that share no voxel with the exemplar; empty if there is nothing else of the scan.
    """

    title: str
    exemplar: Volume
    second: list[Volume]


def materials(words: Sequence[str]) -> Iterator[Material]:
    """Yield the materials with one of the words in their title, as far as they are here."""
    for title, draw in PROCEDURAL.items():
        if chosen(title, words):
            yield Material(title, draw(CORNER, 1), [draw(CORNER, 2)])
    for title, whole in scans(words):
        yield Material(title, poresynth.crop(whole, (0, 0, 0), CORNER), _elsewhere(whole))


def scans(words: Sequence[str]) -> Iterator[tuple[str, Volume]]:
    """Yield titles and whole scans, as `materials` picks them."""
    folder = os.environ.get("PORESYNTH_DATA")
    for scan in SCANS:
        if not chosen(scan.title, words):
            continue
        if folder is None or not Path(folder, scan.file).exists():
            print(f"{scan.title}: skipped, {scan.file} is not in PORESYNTH_DATA")
            continue
        yield scan.title, scan.read(Path(folder))


def sources() -> str:
    """The table of the scans for the README."""
    lines = [
        "| exemplar | file | what it holds | its voxels | source | licence |",
        "|---|---|---|---|---|---|",
    ]
    for scan in SCANS:
        size = f"{scan.voxel_size:g} µm" if scan.voxel_size else "not stated"
        cells = (scan.title, f"`{scan.file}`", scan.content, size, scan.source, scan.licence)
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def chosen(title: str, words: Sequence[str]) -> bool:
    """Whether a title has one of the words in it."""
    return any(word.casefold() in title.casefold() for word in words)


def _elsewhere(whole: Volume) -> list[Volume]:
    """Cut pieces that share nothing with the first corner: the opposite one where there is room.

    Else the slabs beyond the corner along each axis, which are thin, but not part of the exemplar.
    """
    shape = whole.shape
    if min(shape) >= 2 * EDGE:
        return [poresynth.crop(whole, [n - EDGE for n in shape], CORNER)]
    slabs = []
    for axis, n in enumerate(shape):
        if n > EDGE:
            start, edges = [0, 0, 0], list(shape)
            start[axis], edges[axis] = EDGE, n - EDGE
            slabs.append(poresynth.crop(whole, start, edges))
    return slabs
