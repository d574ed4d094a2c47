"""What a training leaves to read: a JSONL file, pictures of mid-slices, TensorBoard's files.

``log.jsonl`` has one object a line, written whenever the generator is compared with the exemplar:
``iteration`` and ``seconds``; ``losses``, by name, means over the iterations since the line before;
``figures`` and ``score`` of the comparison; and ``best``, the iteration of the generator that is
kept. A resumed training goes on in the same file, after the lines of its checkpoint.
"""

from __future__ import annotations

import importlib.util
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from poresynth import io
from poresynth.errors import FileError
from poresynth.volume import Volume

__all__ = ["Log", "mid_slices", "tensorboard_missing"]

# Voxels between the slices of a picture.
_GAP = 4


def tensorboard_missing() -> str | None:
    """Return why no TensorBoard files are written, None if they are."""
    if importlib.util.find_spec("tensorboard"):
        return None
    return "no TensorBoard files are written: pip install 'poresynth[neural]' brings tensorboard"


class Log:
    """The log of one training.

    Parameters
    ----------
    folder : Path or None
        Where to write; None keeps the records only.
    iteration : int, default 0
        Where a resumed training goes on: later lines of the file are dropped.

    Attributes
    ----------
    records : list of dict
        All lines, of earlier runs too.
    """

    def __init__(self, folder: Path | None, iteration: int = 0) -> None:
        self.records: list[dict[str, Any]] = []
        self._folder = folder
        self._board: Any = None
        if folder is None:
            return
        folder.mkdir(parents=True, exist_ok=True)
        self._path = folder / "log.jsonl"
        if iteration and self._path.exists():
            lines = self._path.read_text(encoding="utf-8").splitlines()
            self.records = [r for r in map(json.loads, lines) if r["iteration"] <= iteration]
        with io.output(self._path) as (temporary,):
            temporary.write_text("".join(map(_line, self.records)), encoding="utf-8")
        if tensorboard_missing() is None:
            from torch.utils.tensorboard import SummaryWriter

            self._board = SummaryWriter(str(folder / "tensorboard"), purge_step=iteration + 1)

    def write(self, record: Mapping[str, Any]) -> None:
        """Add a record; ``losses`` and ``figures`` become curves."""
        self.records.append(dict(record))
        if self._folder is None:
            return
        try:
            with self._path.open("a", encoding="utf-8") as file:
                file.write(_line(record))
        except OSError as error:
            raise FileError.because(self._path, error) from error
        if self._board is not None:
            for group in ("losses", "figures"):
                for name, value in record.get(group, {}).items():
                    self._board.add_scalar(f"{group}/{name}", value, record["iteration"])

    def picture(self, iteration: int, gray: npt.NDArray[np.uint8]) -> None:
        """Keep a picture, shape (y, x)."""
        if self._folder is None:
            return
        folder = self._folder / "slices"
        try:
            folder.mkdir(exist_ok=True)
        except OSError as error:
            raise FileError.because(folder, error) from error
        io.write(folder / f"{iteration:06d}.png", Volume(gray[np.newaxis]))
        if self._board is not None:
            self._board.add_image("slices", gray, iteration, dataformats="HW")

    def close(self) -> None:
        """Finish TensorBoard's files."""
        if self._board is not None:
            self._board.close()


def mid_slices(volume: npt.NDArray[Any], exemplar: npt.NDArray[Any]) -> npt.NDArray[np.uint8]:
    """Return the mid-slices across z, y and x of a volume, above those of its exemplar.

    Parameters
    ----------
    volume, exemplar : numpy.ndarray
        Shapes (z, y, x), of the same unit; both are shown with the exemplar's range of grays.

    Returns
    -------
    numpy.ndarray of uint8
        Shape (y, x).
    """
    low, high = float(exemplar.min()), float(exemplar.max())
    rows = []
    for array in (volume, exemplar):
        share = (array.astype(np.float32) - low) / ((high - low) or 1.0)
        gray = np.rint(255 * np.clip(share, 0, 1)).astype(np.uint8)
        axes = range(3) if gray.shape[0] > 1 else [0]  # An image has one slice.
        middle = [gray.take(gray.shape[axis] // 2, axis) for axis in axes]
        rows.append(_beside(middle, 1))
    return _beside(rows, 0)


def _beside(pictures: list[npt.NDArray[np.uint8]], axis: int) -> npt.NDArray[np.uint8]:
    edge = max(picture.shape[1 - axis] for picture in pictures)
    padded = []
    for picture in pictures:
        margin = [(0, 0), (0, 0)]
        margin[axis] = (0, _GAP)
        margin[1 - axis] = (0, edge - picture.shape[1 - axis])
        padded.append(np.pad(picture, margin, constant_values=255))
    return np.concatenate(padded, axis)


def _line(record: Mapping[str, Any]) -> str:
    return json.dumps(record) + "\n"
