"""From a file of a volume to a file of a part: what the command `mesh` does."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from poresynth import console
from poresynth.config import flags
from poresynth.errors import FileError, ParameterError
from poresynth.io.units import convert, spell
from poresynth.workflow.domains import read_mask
from poresynth.workflow.files import read, reserve, write_json

if TYPE_CHECKING:
    from poresynth.config import PartConfig, ReadConfig
    from poresynth.fabrication import FabricationReport, Part
    from poresynth.volume import Volume

__all__ = ["check", "mesh"]

INP = ".inp"
"""Suffix of hexahedra; all others are surfaces."""

# Bytes a voxel of a volume that becomes a part, without and with thickening, measured.
_BYTES, _BYTES_THICKENED = 30, 50


def mesh(
    path: Path,
    output: Path,
    config: PartConfig,
    source: ReadConfig | None,
    report: Path | None,
    *,
    json_file: Path | None,
    threads: int,
) -> None:
    """Make a part of a volume, write it, and say what was made.

    Parameters
    ----------
    path : Path
        The volume.
    output : Path
        The part.
    config : PartConfig
        What is made of it.
    source : ReadConfig, optional
        How the volume is read.
    report : Path, optional
        Folder for a report.
    json_file : Path, optional
        File for the figures.
    threads : int
        Number of threads; 0 takes all cores.

    Raises
    ------
    PoresynthError
        If anything is wrong; no output is then left.
    """
    from poresynth import io
    from poresynth.report import write_part_report
    from poresynth.report.parts import describe

    check(output, config)
    with io.claim(output), reserve(report=report, json_file=json_file):
        volume = read(path, source)
        part = _part(path, volume, config, threads)
        if output.suffix.lower() == INP:
            made = _write_hexahedra(output, part, config)
        else:
            made = _write_surface(output, part, config, threads)
        header, rows = _print(made)
        if json_file is not None:
            write_json(json_file, made.to_dict())
        if report is not None:
            shown = {"in the volume": part.before, "the part": part.inside}
            page = write_part_report(
                report,
                {name: volume.with_array(array) for name, array in shown.items()},
                header,
                rows,
                {**made.to_dict(), "configuration": config.given()},
                facts={"volume": f"{path}, {describe(volume)}", "part": str(output)},
                command=_command(path, output, config, source),
            )
            console.result(f"report: {page}")


def _command(path: Path, output: Path, config: PartConfig, source: ReadConfig | None) -> str:
    said = {**config.given(), **({} if source is None else source.given())}
    return shlex.join(["poresynth", "mesh", str(path), "-o", str(output), *flags(said)])


def check(output: Path, config: PartConfig) -> None:
    """Refuse what does not go together, or cannot be written, before any work is done.

    Parameters
    ----------
    output : Path
        The part.
    config : PartConfig
        What is made.

    Raises
    ------
    ParameterError
        If a setting is not for this kind of file or phase.
    FileError
        If the suffix is unknown or the file cannot be written.
    """
    from poresynth import io, meshes

    suffix = output.suffix.lower()
    for name in ("smooth", "decimate"):
        if suffix == INP and (value := getattr(config, name)):
            raise ParameterError(name, value, f"is for surfaces; {INP} holds the voxels themselves")
    if config.flow is not None and (config.phase != "pore" or suffix != ".stl"):
        allowed = "needs the phase pore and an output that ends in .stl"
        raise ParameterError("flow", config.flow, allowed)
    if suffix == INP:
        io.check_writable(output)
    elif suffix not in meshes.SUFFIXES:
        known = ", ".join((*meshes.SUFFIXES, INP))
        raise FileError(f"{output}: unknown suffix {output.suffix!r}; known are {known}")
    else:
        meshes.check_output(output)


def _part(path: Path, volume: Volume, config: PartConfig, threads: int) -> Part:
    from poresynth import fabrication
    from poresynth.resources import check_memory

    needed = _BYTES if config.min_thickness is None else _BYTES_THICKENED
    z, y, x = volume.shape
    check_memory(needed * z * y * x, f"a part of {path}")
    domain = read_mask(config.mask, config.mask_unit, volume)
    with console.progress("part") as progress:
        return fabrication.make_part(
            volume,
            threshold=config.threshold,
            solid=config.solid,
            phase=config.phase,
            domain=domain,
            shell=config.shell,
            min_thickness=config.min_thickness,
            keep=config.keep,
            threads=threads,
            progress=progress,
        )


def _unit(part: Part, config: PartConfig) -> str:
    """Return the unit of lengths in the file: that of printers, unless told otherwise."""
    if config.output_unit is not None:
        return spell(config.output_unit)
    if part.unit == "voxel":
        console.note("the size of a voxel is unknown: lengths in the file are in voxels")
    return part.unit if part.unit == "voxel" else "mm"


def _write_surface(output: Path, part: Part, config: PartConfig, threads: int) -> FabricationReport:
    from poresynth import fabrication, meshes

    with console.progress("surface") as progress:
        surface = fabrication.surface_of(
            part,
            smoothing=config.smooth,
            tolerance=config.decimate,
            threads=threads,
            progress=progress,
        )
    found = surface.mesh
    if config.flow is not None:
        found = fabrication.with_patches(found, config.flow, *part.corners)
    meshes.write(output, found.in_unit(_unit(part, config)))
    console.result(f"{output}: {surface.report.triangles} triangles")
    return fabrication.FabricationReport(part, surface)


def _write_hexahedra(output: Path, part: Part, config: PartConfig) -> FabricationReport:
    from poresynth import fabrication, io

    unit = _unit(part, config)
    size, origin = part.voxel_size, part.origin
    if unit != part.unit:
        size, origin = (convert(lengths, part.unit, unit) for lengths in (size, origin))
    with console.progress("hexahedra") as progress, io.output(output) as (temporary,):
        nodes, elements = fabrication.write_inp(
            temporary,
            part.inside,
            voxel_size=size,
            origin=origin,
            unit=unit,
            name=part.phase.upper(),
            progress=progress,
        )
    console.result(f"{output}: {elements} elements, {nodes} nodes")
    return fabrication.FabricationReport(part)


def _print(made: FabricationReport) -> tuple[Sequence[str], Sequence[Sequence[str]]]:
    """Print the figures and what to look at; return them for the report."""
    from poresynth.report.words import number

    def cell(value: Any) -> str:
        if value is None:
            return ""
        return ("no", "yes")[value] if isinstance(value, bool) else number(value)

    header = ("figure", "in the volume", "the part", "unit", "what it says")
    rows = [(f.name, cell(f.before), cell(f.after), f.unit, f.says) for f in made.figures()]
    console.figures("The part", rows, header)
    for said in made.warnings():
        console.note(said)
    return header, rows
