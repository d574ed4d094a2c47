"""The command line."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import App, CycloptsError, Group, Parameter
from pydantic import ValidationError

from poresynth import config, console
from poresynth.config import InputConfig, PartConfig, PruneConfig, ReadConfig, RunConfig
from poresynth.errors import ParameterError, PoresynthError
from poresynth.workflow import (
    comparing,
    domains,
    files,
    inputs,
    measuring,
    models,
    parts,
    pruning,
    synthesis,
)

__all__ = ["main"]

# What a shell reports of a program that was stopped by Ctrl-C.
INTERRUPTED = 130
ERROR = 2
# Half of the example must hold the largest blocks whose novelty is measured, 32³.
DEMO_EXEMPLAR = (72, 72, 72)
DEMO_SHAPE = (112, 112, 112)


def _version() -> str:
    import poresynth

    return str(poresynth.__version__)


app = App(
    name="poresynth",
    help="New volumes of a porous material from one example of it, with the numbers that prove it.",
    version=_version,
    default_parameter=Parameter(negative=()),
    help_format="markdown",
    suppress_keyboard_interrupt=False,
)

Output = Annotated[Path, Parameter(name=["--output", "-o"])]
Solid = Literal["bright", "dark"]
Threads = Annotated[int, Parameter(name="--threads")]
Reading = Annotated[ReadConfig | None, Parameter(name="*", group=Group("Reading VOLUME"))]
Pruning = Annotated[PruneConfig | None, Parameter(name="*", group=Group("Pruning"))]
Input = Annotated[InputConfig | None, Parameter(name="*", group=Group("Reading EXEMPLAR"))]


@app.command
def synthesize(
    *exemplar: Path,
    output: Output,
    shape: tuple[int, int, int] | None = None,
    engine: str | None = None,
    axes: Annotated[list[Literal["z", "y", "x"]] | None, Parameter(consume_multiple=(1, 3))] = None,
    preset: str | None = None,
    seed: int | None = None,
    periodic: Annotated[bool | None, Parameter(negative="--open")] = None,
    porosity: str | None = None,
    scale: str | None = None,
    orientation: Path | None = None,
    orientation_axis: Literal["z", "y", "x"] | None = None,
    threshold: float | None = None,
    solid: Solid | None = None,
    mask: Path | None = None,
    mask_unit: str | None = None,
    part: Path | None = None,
    shell: float | None = None,
    min_thickness: float | None = None,
    known: Path | None = None,
    known_mask: Path | None = None,
    blockwise: Annotated[bool | None, Parameter(negative="")] = None,
    prune: Annotated[bool | None, Parameter(negative="")] = None,
    configuration: Annotated[Path | None, Parameter(name="--config")] = None,
    settings: Annotated[
        list[str] | None, Parameter(name="--set", consume_multiple=True, negative=())
    ] = None,
    threads: Threads = 0,
    report: Path | None = None,
    source: Input = None,
) -> None:
    """Make a new volume that looks like an exemplar: a volume, or one to three images.

    Beside the volume lies a .json file with all that made it; given back as `--config`, it repeats
    the run.

        poresynth synthesize bone.tif -o new.tif --shape 200 200 200 --report out

        poresynth synthesize bone.tif -o tile.tif --shape 128 128 128 --periodic

        poresynth synthesize rock.png -o rock.tif --engine solid --shape 128 128 128

        poresynth synthesize top.png side.png -o wood.tif --engine solid --axes z x --shape 96 96 96

        poresynth synthesize foam.tif -o new.tif --mask body.stl --porosity z=0.6:0.8 --prune
            --part part.stl --shell 0.5

        poresynth synthesize -o again.tif --config new.tif.json

    Parameters
    ----------
    exemplar
        The example, in any format that `poresynth` reads: one volume, or a closed mesh with a
        `--voxel-size`, for the engine volume; one image, or up to three of planes in different
        directions, for the engine solid.
    output
        The new volume; its suffix picks the format.
    shape
        Shape z y x of the new volume, in voxels.
    engine
        What makes it: volume, from a volume; solid, from images; by a network that is trained
        first scaffoldgan, from a volume, and ipfn, from a volume or an image. [default: volume]
    axes
        Which planes of the new volume look like the image: those across z, y, x; an axis left out
        is free. For several images the axis of each, in their order. [default: all, of one image]
    preset
        Parameters of the engine that go together, by name.
    seed
        Another seed gives another volume. [default: 0]
    periodic
        The new volume tiles without a seam. [default: open]
    porosity
        Wanted porosity: a number from 0 to 1; AXIS=FROM:TO, such as z=0.6:0.9, from face to face;
        or a volume of the wanted shape, or coarser, that holds it. [default: the exemplar's own]
    scale
        Factor by which the structure is larger than the example's, 1/8 to 8: a number;
        AXIS=FROM:TO; or a volume that holds it.
    orientation
        An array (z, y, x, 3), or coarser, of vectors z y x: along them the example's
        `--orientation-axis` runs, stretched by their length.
    orientation_axis
        The example's axis that follows the vectors. [default: z]
    threshold
        Gray value that separates solid from pore. [default: Otsu's]
    solid
        Which side of the threshold is solid. [default: bright]
    mask
        Where the result matters: a volume, not 0 there, or a closed body, STL, PLY, OBJ or 3MF;
        the volume, or the body's box, is then the shape, and no `--shape` is needed.
    mask_unit
        Unit of lengths in the body's file, where it does not say.
    part
        File for a printable part of the new volume inside the mask, as `poresynth mesh` makes it:
        .stl, .3mf, .ply, .obj, .vtp or .inp. Its report is in the folder part of `--report`.
    shell
        Thickness of a solid layer under the surface of the mask, for `--part`.
    min_thickness
        Struts and walls that are thinner are thickened, for `--part`.
    known
        A volume of the wanted shape whose voxels are kept exactly where `--known-mask` says.
    known_mask
        Where `--known` is known: not 0.
    blockwise
        Make and write it brick by brick, in about 1 GB of memory however large it is: .tif or
        .zarr, no report.
    prune
        Remove or connect loose ends and floating parts, until there are as many by volume as in
        the exemplar; `--set prune.target=zero`, or another option of `poresynth prune`, says
        otherwise.
    configuration
        A .toml file, or the .json file beside an earlier result. The command line wins over it.
    settings
        KEY=VALUE …: a parameter of the engine, or with a dot any key of the configuration.
    threads
        Number of threads; 0 takes all cores. The result does not depend on it.
    report
        Folder for a page with figures and pictures, and its JSON.
    source
        How the exemplar is read.
    """
    given = {
        "exemplar": [str(path) for path in exemplar] or None,
        "shape": shape,
        "engine": engine,
        "seed": seed,
        "boundary": None if periodic is None else "periodic" if periodic else "open",
        "porosity": _number(porosity),
        "scale": _number(scale),
        "orientation": _text(orientation),
        "orientation_axis": orientation_axis,
        "mask": _text(mask),
        "mask_unit": mask_unit,
        "part": _part(part, shell, min_thickness),
        "known": _text(known),
        "known_mask": _text(known_mask),
        "blockwise": blockwise,
        "prune": {} if prune else None,
        "parameters": _given(
            {"axes": axes, "preset": preset, "threshold": threshold, "solid": solid}
        ),
        "input": {} if source is None else source.model_dump(exclude_unset=True),
    }
    saved = {} if configuration is None else config.load(configuration)
    if exemplar:
        saved.pop("exemplar_sha256", None)
    run = config.merge(saved, config.parse_settings(settings or ()), _given(given))
    run |= _given({"shape": domains.shape_of_mask(run)})
    made = config.validate(run)
    settled = (made.part or PartConfig()).of_run(made)
    if part is not None:
        parts.check(part, settled)
    synthesis.synthesize(made, output, threads, report)
    if part is not None:
        # In a folder of its own, for it has a report.html, too.
        about = None if report is None else report / "part"
        parts.mesh(output, part, settled, None, about, json_file=None, threads=threads)


@app.command
def train(
    exemplar: Path,
    /,
    *,
    output: Output,
    engine: str = "scaffoldgan",
    preset: str | None = None,
    seed: int | None = None,
    threshold: float | None = None,
    solid: Solid | None = None,
    resume: bool = False,
    settings: Annotated[
        list[str] | None, Parameter(name="--set", consume_multiple=True, negative=())
    ] = None,
    source: Input = None,
) -> None:
    """Train a network on an exemplar, for volumes of any size in seconds afterwards.

    The folder that it leaves is a model for `poresynth sample`, also while the training goes on; in
    it are a log, pictures of mid-slices and files for TensorBoard. Ctrl-C leaves a checkpoint.

        poresynth train bone.tif -o bone-model --preset tiny

        poresynth train bone.tif -o bone-model --resume --set iterations=2000

        torchrun --nproc-per-node 4 -m poresynth train bone.tif -o bone-model --preset paper

    Parameters
    ----------
    exemplar
        The example: a volume in any format that `poresynth` reads, or a closed mesh (STL, PLY, OBJ,
        3MF) with a `--voxel-size`; for ipfn also an image.
    output
        Folder of the model.
    engine
        The network: scaffoldgan, or ipfn, an implicit field of any resolution.
    preset
        Parameters that go together: tiny, minutes on a CPU; small, for one GPU; paper.
        [default: small of scaffoldgan, tiny of ipfn]
    seed
        Of weights, crops and noise. [default: 0]
    threshold
        Gray value that separates solid from pore. [default: Otsu's]
    solid
        Which side of the threshold is solid. [default: bright]
    resume
        Go on with the training in the folder, with its parameters.
    settings
        KEY=VALUE …: parameters of the engine.
    source
        How the exemplar is read.
    """
    given = {"preset": preset, "training_seed": seed, "threshold": threshold, "solid": solid}
    settled = config.parse_settings(settings or ()).get("parameters", {})
    models.train(
        exemplar,
        output,
        engine=engine,
        parameters={**settled, **_given(given)},
        source=source or InputConfig(),
        resume=resume,
    )


@app.command
def sample(
    model: Path,
    /,
    *,
    output: Output,
    shape: tuple[int, int, int],
    seed: int = 0,
    periodic: Annotated[bool, Parameter(negative="--open")] = False,
    porosity: str | None = None,
    cut_at: Literal["porosity", "exemplar", "none"] = "porosity",
    prune: Annotated[bool, Parameter(negative="")] = False,
    blockwise: bool = False,
    device: str = "auto",
    threads: Threads = 0,
    report: Path | None = None,
    settings: Annotated[
        list[str] | None, Parameter(name="--set", consume_multiple=True, negative=())
    ] = None,
) -> None:
    """Make a new volume by a trained model.

        poresynth sample bone-model -o new.tif --shape 200 200 200 --report out

        poresynth sample bone-model -o large.zarr --shape 1024 1024 1024 --blockwise

        poresynth sample foam-model -o graded.tif --shape 96 96 256 --set guidance=0.1,0.9

        poresynth sample foam-model -o field.tif --shape 192 192 192 --set resolution=2
            --cut-at none

    Parameters
    ----------
    model
        The folder that `poresynth train` made, or the model.safetensors in it.
    output
        The new volume; its suffix picks the format.
    shape
        Shape z y x of the new volume, in voxels.
    seed
        Another seed gives another volume.
    periodic
        The new volume tiles without a seam.
    porosity
        Wanted porosity: a number, AXIS=FROM:TO, or a volume, as for `poresynth synthesize`.
        [default: the exemplar's own]
    cut_at
        porosity: as the exemplar has it, exactly; exemplar: at the exemplar's threshold, with the
        porosity that the network came to. Both are reported. none: the field of ipfn itself; of
        distances, `poresynth mesh --threshold 0` lays a smooth surface at any resolution.
    prune
        Remove or connect loose ends and floating parts, until there are as many by volume as in
        the exemplar.
    blockwise
        Make and write it block by block, in bounded memory: .tif or .zarr, no report.
    device
        Where it is made, as PyTorch names it. [default: a GPU if there is one]
    threads
        Number of threads; 0 takes all cores. The result does not depend on it.
    report
        Folder for a page with figures and pictures, and its JSON.
    settings
        KEY=VALUE …: what else the engine is asked for. Of ipfn: guidance (a number, two, or the
        file of a map), noise_scale, latent, mirrored, resolution, start, whole.
    """
    models.sample(
        model,
        output,
        shape=shape,
        seed=seed,
        boundary="periodic" if periodic else "open",
        porosity=_number(porosity),
        cut_at=cut_at,
        prune=prune,
        blockwise=blockwise,
        device=device,
        threads=threads,
        report=report,
        options=config.parse_settings(settings or ()).get("parameters", {}),
    )


@app.command
def compare(
    exemplar: Path,
    volume: Path,
    /,
    *,
    threshold: float | None = None,
    solid: Solid = "bright",
    seed: int = 0,
    threads: Threads = 0,
    json_file: Annotated[Path | None, Parameter(name="--json")] = None,
    report: Path | None = None,
    sifid: Path | None = None,
    source: Input = None,
) -> None:
    """Measure how alike a volume and an exemplar are, and how much is copied.

        poresynth compare bone.tif new.tif --report out

        poresynth compare bone.tif other_scan.tif --json figures.json

    Parameters
    ----------
    exemplar
        The example: a volume, or an image, that sections of the volume are compared with.
    volume
        A volume from any source, with voxels of the same size.
    threshold
        Gray value that separates solid from pore in both. [default: Otsu's of the exemplar]
    solid
        Which side of the threshold is solid.
    seed
        Chooses the parts of the exemplar that give its own range.
    threads
        Number of threads; 0 takes all cores. The figures do not depend on it.
    json_file
        File for the figures.
    report
        Folder for a page with figures and pictures, and its JSON.
    sifid
        Local file of weights of Inception v3 (.safetensors, .pth): of two images the single-image
        Fréchet Inception distance, too.
    source
        How the exemplar is read.
    """
    from poresynth.report import write_report

    with files.reserve(report=report, json_file=json_file):
        original = inputs.read_exemplar(exemplar, source or InputConfig())
        new = files.read(volume)
        distance = {} if sifid is None else {"sifid": comparing.sifid(original, new, sifid)}
        comparison = comparing.compare(
            original, new, threshold=threshold, solid=solid, seed=seed, threads=threads
        )
        if json_file is not None:
            files.write_json(json_file, {**comparison.to_dict(), **distance})
        if report is not None:
            origin = new.metadata.get("poresynth", {})
            page = write_report(
                report,
                original,
                new,
                comparison,
                configuration=origin.get("configuration"),
                command=origin.get("command"),
            )
            console.result(f"report: {page}")


@app.command
def measure(
    volume: Path,
    /,
    *,
    threshold: float | None = None,
    solid: Solid = "bright",
    transport: Annotated[bool, Parameter(negative="")] = False,
    json_file: Annotated[Path | None, Parameter(name="--json")] = None,
    threads: Threads = 0,
    source: Reading = None,
) -> None:
    """Measure a volume: morphometry, topology, correlation, and transport if wanted.

        poresynth measure bone.tif --json bone.json

    Parameters
    ----------
    volume
        The volume.
    threshold
        Gray value that separates solid from pore. [default: Otsu's]
    solid
        Which side of the threshold is solid.
    transport
        Solve diffusion and flow through the pore, too: minutes.
    json_file
        File for the figures, and for the curves.
    threads
        Number of threads; 0 takes all cores.
    source
        How the volume is read.
    """
    with files.reserve(json_file=json_file):
        found = measuring.measure(
            volume, source, threshold=threshold, solid=solid, transport=transport, threads=threads
        )
        if json_file is not None:
            files.write_json(json_file, found)


@app.command
def prune(
    volume: Path,
    /,
    *,
    output: Output,
    exemplar: Path | None = None,
    threshold: float | None = None,
    solid: Solid = "bright",
    periodic: Annotated[bool, Parameter(negative="")] = False,
    how: Pruning = None,
    threads: Threads = 0,
    report: Path | None = None,
    source: Reading = None,
) -> None:
    """Remove or connect what hangs loose: branches, floating parts, closed pores.

        poresynth prune new.tif -o pruned.tif --exemplar bone.tif --report out

        poresynth prune foam.tif -o pruned.tif --parts remove --pores close --open-axes z

    Parameters
    ----------
    volume
        The volume.
    output
        The pruned volume; its suffix picks the format.
    exemplar
        What the volume was made of: branches are copied from it, and as many loose ends as it has
        may remain.
    threshold
        Gray value that separates solid from pore. [default: Otsu's, of the exemplar if given]
    solid
        Which side of the threshold is solid.
    periodic
        The volume tiles, and shall still.
    how
        What is done.
    threads
        Number of threads; 0 takes all cores.
    report
        Folder for a page with figures and pictures before and after, and its JSON with every edit.
    source
        How the volume is read.
    """
    pruning.prune_file(
        volume,
        output,
        how or PruneConfig(),
        source,
        exemplar=exemplar,
        threshold=threshold,
        solid=solid,
        boundary="periodic" if periodic else "open",
        threads=threads,
        report=report,
    )


@app.command
def crop(
    volume: Path, z: str, y: str, x: str, /, *, output: Output, source: Reading = None
) -> None:
    """Cut a part out of a volume; a part one voxel thick is an image.

        poresynth crop scan.tif 100:300 100:300 : -o part.tif

        poresynth crop scan.tif : 100:101 : -o side.png

    Parameters
    ----------
    volume
        The volume.
    z
        Part to keep along the first axis, as start:stop; ":" keeps all.
    y
        The same along the second axis.
    x
        The same along the third axis.
    output
        The part; its suffix picks the format. PNG, JPEG and BMP hold images.
    source
        How the volume is read.
    """
    with files.reserve(output):
        files.write(output, files.crop(files.read(volume, source), (z, y, x)))


@app.command
def downsample(
    volume: Path,
    factor: int,
    /,
    *,
    output: Output,
    labels: Annotated[bool | None, Parameter(negative="--gray")] = None,
    source: Reading = None,
) -> None:
    """Reduce a volume by an integer factor.

        poresynth downsample scan.tif 2 -o half.tif

    Parameters
    ----------
    volume
        The volume.
    factor
        Edge of the blocks of voxels that become one voxel.
    output
        The smaller volume; its suffix picks the format.
    labels
        Take the commonest value of a block; with `--gray` its mean.
        [default: labels if the volume has two values]
    source
        How the volume is read.
    """
    from poresynth import preprocess

    with files.reserve(output):
        files.write(
            output, preprocess.downsample(files.read(volume, source), factor, labels=labels)
        )


@app.command
def threshold(
    volume: Path,
    /,
    *,
    output: Output,
    value: float | None = None,
    solid: Solid = "bright",
    source: Reading = None,
) -> None:
    """Separate solid from pore: the result is 255 where solid, 0 elsewhere.

        poresynth threshold scan.tif -o solid.tif

    Parameters
    ----------
    volume
        The volume.
    output
        The binary volume; its suffix picks the format.
    value
        Gray value that separates solid from pore. [default: Otsu's]
    solid
        Which side of the threshold is solid.
    source
        How the volume is read.
    """
    from poresynth import preprocess

    with files.reserve(output):
        gray = files.read(volume, source)
        cut = preprocess.threshold(gray, value)
        binary = preprocess.binarize(gray, cut, solid)
        files.write(output, gray.with_array(binary))
        console.result(f"threshold: {cut:g}")
        console.result(f"porosity: {1 - binary.mean():.4f}")


@app.command
def mesh(
    volume: Path,
    /,
    *,
    output: Output,
    part: Annotated[PartConfig | None, Parameter(name="*", group=Group("The part"))] = None,
    report: Path | None = None,
    json_file: Annotated[Path | None, Parameter(name="--json")] = None,
    threads: Threads = 0,
    source: Reading = None,
) -> None:
    """Make a part of a volume, to be printed or computed with.

        poresynth mesh bone.tif -o bone.stl --min-thickness 200 --report out

        poresynth mesh foam.tif -o hare.3mf --mask hare.stl --mask-unit mm --shell 0.8

        poresynth mesh rock.tif -o pore.stl --phase pore --flow z --output-unit m

        poresynth mesh bone.tif -o bone.inp

    Parameters
    ----------
    volume
        The volume.
    output
        The part: its surface (.stl, .3mf, .ply, .obj, .vtp), or its voxels as hexahedra for Abaqus
        and CalculiX (.inp).
    part
        What is made of it; lengths in the unit of the volume.
    report
        Folder for a page with figures and pictures, and its JSON.
    json_file
        File for the figures.
    threads
        Number of threads; 0 takes all cores. The part does not depend on it.
    source
        How the volume is read.
    """
    parts.mesh(
        volume, output, part or PartConfig(), source, report, json_file=json_file, threads=threads
    )


@app.command
def demo(*, output: Output = Path("demo"), threads: Threads = 0) -> None:
    """Make an example, a new volume of it, and the report that compares the two.

    It takes about a minute on two cores and downloads nothing.

        poresynth demo

    Parameters
    ----------
    output
        Folder for the example, the new volume and the report.
    threads
        Number of threads; 0 takes all cores.
    """
    from poresynth import exemplars, io

    exemplar = output / "exemplar.tif"
    with files.reserve(report=output):
        io.write(exemplar, exemplars.spinodal(DEMO_EXEMPLAR, porosity=0.7, seed=1))
    run = RunConfig(exemplar=(str(exemplar),), shape=DEMO_SHAPE, seed=1)
    synthesis.synthesize(run, output / "new.tif", threads, output)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    arguments : sequence of str, optional
        What follows the program's name; what the shell gave by default.

    Returns
    -------
    int
        0, 2 after an error, 130 after Ctrl-C.
    """
    try:
        app(
            list(sys.argv[1:] if arguments is None else arguments),
            exit_on_error=False,
            print_error=False,
            result_action="return_none",
        )
    except KeyboardInterrupt:
        console.note("interrupted")
        return INTERRUPTED
    except CycloptsError as error:
        if isinstance(error.__cause__, ValidationError):
            console.error(str(config.explain(error.__cause__)))
        else:
            console.error(str(error))
        return ERROR
    except PoresynthError as error:
        console.error(str(error))
        return ERROR
    except MemoryError as error:
        console.error(f"out of memory: {error}" if str(error) else "out of memory")
        return ERROR
    except BrokenPipeError:  # The reader of our output has gone: nothing is left to say.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return ERROR
    return 0


def _given(values: Mapping[str, Any]) -> dict[str, Any]:
    """Leave out what the command line did not say."""
    return {name: value for name, value in values.items() if value is not None}


def _part(
    part: Path | None, shell: float | None, min_thickness: float | None
) -> dict[str, Any] | None:
    """Return the settings of a part, if one is wanted."""
    wanted = _given({"shell": shell, "min_thickness": min_thickness})
    if part is None and wanted:
        name, value = next(iter(wanted.items()))
        raise ParameterError(name, value, "needs --part, the file of the part it is for")
    return wanted or None


def _number(text: str | None) -> float | str | None:
    """Return a number where the text is one."""
    try:
        return text if text is None else float(text)
    except ValueError:
        return text


def _text(path: Path | None) -> str | None:
    return None if path is None else str(path)
