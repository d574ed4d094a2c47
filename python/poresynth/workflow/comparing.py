"""What a volume is beside its exemplars: figures, and the report of them."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from poresynth import console
from poresynth.errors import ParameterError

if TYPE_CHECKING:
    from poresynth.comparison import Comparison
    from poresynth.engines.base import SynthesizedVolume
    from poresynth.volume import Volume

__all__ = ["compare", "judge", "sifid"]


def judge(
    exemplars: Sequence[Volume],
    volume: SynthesizedVolume,
    threads: int,
    report: Path | None,
    *,
    beside_images: bool,
) -> None:
    """Say how new a volume is; beside images, or with a report, how like its exemplars too."""
    if volume.shape[0] == 1:
        console.note("it is an image: comparisons and reports are of volumes")
        return
    if report is None and not beside_images:
        _print_copying(exemplars[0], volume, threads)
    else:
        _compare_with_exemplars(exemplars, volume, threads, report)


def compare(
    exemplar: Any,
    volume: Volume,
    *,
    threshold: float | None,
    solid: Literal["bright", "dark"],
    seed: int = 0,
    threads: int = 0,
) -> Comparison:
    """Compare a volume with its exemplar, or with the image of each of its axes, and say how alike.

    The parameters are those of `poresynth.compare`.
    """
    import poresynth
    from poresynth.report.words import number

    with console.progress("comparison") as progress:
        comparison = poresynth.compare(
            exemplar,
            volume,
            threshold=threshold,
            solid=solid,
            seed=seed,
            threads=threads,
            progress=progress,
        )
    rows = []
    for figure in comparison.figures.values():
        unit = f" {figure.unit}" if figure.unit else ""
        spread = [number(n) for n in (figure.low, figure.high) if n is not None]
        rows.append(
            (
                figure.name,
                number(figure.value) + unit,
                number(figure.exemplar),
                " to ".join(spread),
                figure.mark,
            )
        )
    header = ("figure", "new volume", "exemplar", "its range", "mark")
    console.figures("The new volume beside its exemplar", rows, header)
    return comparison


def sifid(exemplar: Volume, image: Volume, weights: Path) -> float:
    """Return, and say, the single-image Fréchet Inception distance with weights from a local file.

    Raises
    ------
    ParameterError
        If one of the two is a volume.
    FileError
        If the file does not hold the weights.
    MissingExtraError
        If PyTorch is not installed.
    """
    for name, picture in (("exemplar", exemplar), ("volume", image)):
        if picture.shape[0] != 1:
            raise ParameterError(name, picture.shape, "must be an image for --sifid")
    inception: Any = importlib.import_module("poresynth.engines.neural.sifid")
    distance = float(inception.sifid(exemplar, image, inception.load_stem(weights)))
    console.result(f"SIFID: {distance:.4g}")
    return distance


def _print_copying(exemplar: Volume, volume: SynthesizedVolume, threads: int) -> None:
    """Print how much is verbatim: no result goes without it."""
    from poresynth.metrics import novelty
    from poresynth.metrics.copying import EDGES
    from poresynth.metrics.structure import first_channel
    from poresynth.report.words import number

    copying = volume.metadata["poresynth"].get("copying", {})
    rows = [(name, number(value)) for name, value in copying.items()]
    arrays = first_channel(exemplar, "exemplar"), first_channel(volume, "volume")
    for edge in EDGES:
        found = novelty(*arrays, edge, threads=threads)
        rows.append((f"novelty_{edge}", number(found.plain)))
        rows.append((f"novelty_{edge}_mirrors", number(found.mirrored)))
    title = "How new it is (novelty 0: a copy, 1: as different as two halves of the exemplar)"
    console.figures(title, rows, ("figure", "new volume"))


def _compare_with_exemplars(
    exemplars: Sequence[Volume], volume: SynthesizedVolume, threads: int, report: Path | None
) -> None:
    from poresynth.report import write_report

    origin = volume.metadata["poresynth"]
    learned = origin["exemplar"]
    cut = learned[0] if isinstance(learned, list) else learned
    reference = _reference(exemplars, origin["parameters"].get("axes"))
    comparison = compare(
        reference, volume, threshold=cut["threshold"], solid=cut["solid"], threads=threads
    )
    if report is not None:
        page = write_report(
            report,
            reference,
            volume,
            comparison,
            energy=volume.energy,
            configuration=origin["configuration"],
            command=origin["command"],
        )
        console.result(f"report: {page}")


def _reference(exemplars: Sequence[Volume], axes: Sequence[str] | None) -> Any:
    """Return what a volume is compared with: its exemplar, or the image of each axis."""
    axes = axes or "zyx"
    if len(exemplars) > 1:
        return dict(zip(axes, exemplars, strict=False))
    return exemplars[0] if len(axes) == 3 else dict.fromkeys(axes, exemplars[0])
