"""What ``train`` and ``sample`` do: from an exemplar to a model, and from a model to volumes."""

from __future__ import annotations

import json
import os
import shlex
from collections.abc import Mapping
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from poresynth import config, console
from poresynth.engines import ENGINES, get_engine, load_model, saved_parameters
from poresynth.errors import FileError, ParameterError
from poresynth.workflow.comparing import judge
from poresynth.workflow.domains import field_of
from poresynth.workflow.files import read, reserve
from poresynth.workflow.inputs import read_exemplar
from poresynth.workflow.memory import state_memory
from poresynth.workflow.pruning import prune_new
from poresynth.workflow.refusals import NOT_BLOCKWISE, refuse

if TYPE_CHECKING:
    from poresynth.config import InputConfig

__all__ = ["sample", "train"]

CHECKPOINT, MODEL = "checkpoint.safetensors", "model.safetensors"


def train(
    exemplar: Path,
    output: Path,
    *,
    engine: str,
    parameters: Mapping[str, Any],
    source: InputConfig,
    resume: bool,
) -> None:
    """Train a network on an exemplar; the folder that it leaves is a model.

    Parameters
    ----------
    exemplar : Path
        The example.
    output : Path
        A folder, created.
    engine : str
        Name of a neural engine.
    parameters : mapping
        Parameters of the engine. Of a training that is resumed, those that are not given are the
        ones that it began with.
    source : InputConfig
        How the exemplar is read.
    resume : bool
        Go on with the training in the folder.

    Raises
    ------
    PoresynthError
        If anything is wrong with the run; the last checkpoint is left.
    """
    from poresynth import io

    able = [name for name, entry in ENGINES.items() if entry.trains]
    if engine not in able:
        raise ParameterError("engine", engine, f"must be one that is trained: {', '.join(able)}")
    # Of the processes of torchrun one speaks and writes.
    first = int(os.environ.get("RANK", "0")) == 0
    io.check_writable(output, folder=True)
    if resume:
        parameters = {**saved_parameters(output / CHECKPOINT, engine), **parameters}
    elif (output / CHECKPOINT).exists() and first:
        raise FileError(f"{output}: holds a training; --resume goes on with it")
    config.check_parameters(engine, parameters)
    volume = read_exemplar(exemplar, source)
    model: Any = get_engine(engine)(**parameters)
    command = _train_command(exemplar, output, engine, parameters, source)
    origin = {"exemplar": str(exemplar), "command": command}
    try:
        with console.progress("training") if first else nullcontext() as progress:
            model.fit(volume, folder=output, resume=resume, progress=progress, origin=origin)
    except KeyboardInterrupt:
        if first and (output / CHECKPOINT).exists():
            console.note(f"the training lies in {output}; --resume goes on with it")
        raise
    if first:
        _print_training(output, model)


def _train_command(
    exemplar: Path, output: Path, engine: str, parameters: Mapping[str, Any], source: InputConfig
) -> str:
    """Return the command line that repeats the training."""
    words = ["poresynth", "train", str(exemplar), "-o", str(output), "--engine", engine]
    words += config.flags(source.given())
    if parameters:
        # What JSON writes is TOML, too.
        given = {name: value for name, value in parameters.items() if value is not None}
        words += ["--set", *(f"{name}={json.dumps(value)}" for name, value in given.items())]
    return shlex.join(words)


def _print_training(output: Path, model: Any) -> None:
    from poresynth.report.words import number

    done = model.training_
    console.result(f"model: {output} ({done['iterations']} iterations; {done['ended']})")
    rows = [(name, number(value)) for name, value in done["figures"].items()]
    console.figures(f"The generator of iteration {done['kept']}", rows, ("figure", "value"))
    if model.tensorboard_missing_:
        console.note(model.tensorboard_missing_)


def sample(
    model: Path,
    output: Path,
    *,
    shape: tuple[int, int, int],
    seed: int,
    boundary: Literal["open", "periodic"],
    porosity: float | str | None,
    cut_at: Literal["porosity", "exemplar", "none"],
    prune: bool,
    blockwise: bool,
    device: str,
    threads: int,
    report: Path | None,
    options: Mapping[str, Any],
) -> None:
    """Make a volume by a trained model, write it with all that made it, and say how new it is.

    Parameters
    ----------
    model : Path
        The folder of a training, or its ``.safetensors`` file.
    output : Path
        The new volume.
    shape, seed, boundary, cut_at, threads
        As of `poresynth.engines.neural.engine.NeuralEngine.sample`. Cut at "none", it is the field
        of `poresynth.engines.periodic_field.PeriodicField.sample_field`.
    porosity : float or str, optional
        A number, or a map as `poresynth.workflow.domains.field_of` takes it.
    prune : bool
        Prune the volume until it has the exemplar's loose ends and Euler number.
    blockwise : bool
        Make and write it block by block, in bounded memory; then nothing is compared.
    device : str
        Where it is made.
    report : Path, optional
        Folder for a report.
    options : mapping
        What the engine's `sample` has beyond these. A text is the file of a map.

    Raises
    ------
    PoresynthError
        If anything is wrong with the run; no output is then left.
    """
    from poresynth import io
    from poresynth.config import PruneConfig

    whole = {"report": report, "prune": prune or None}
    if blockwise:
        refuse(whole, NOT_BLOCKWISE)
    if cut_at == "none":
        cut = {**whole, "porosity": porosity, "blockwise": blockwise or None}
        refuse(cut, "is for volumes that are cut: not with --cut-at none")
    wanted: dict[str, Any] = {
        "seed": seed,
        "boundary": boundary,
        "porosity": field_of("porosity", porosity, shape),
        "cut_at": cut_at,
        "threads": threads,
    }
    command = _command(
        model, output, shape, seed, boundary, porosity, cut_at, prune, blockwise, options
    )
    origin = {
        "configuration": {"model": str(model), "shape": list(shape), "seed": seed},
        "command": command,
    }
    with reserve(output, report=report):
        engine = load_model(model, device=device)
        wanted |= _sampling_options(engine, options)
        needed = engine.estimate_memory(shape, threads=threads, blockwise=blockwise)
        state_memory(needed, shape)
        with console.progress("sampling") as progress:
            if blockwise:
                found = engine.sample_to(output, shape, progress=progress, origin=origin, **wanted)
                console.result(f"new volume: {output}")
                console.result(f"porosity: {found['porosity']:.4f}")
                _print_raw(found["raw_porosity"])
                return
            if cut_at == "none":
                volume = _field(engine, shape, progress=progress, **wanted)
            else:
                volume = engine.sample(shape, progress=progress, **wanted)
        if prune:
            volume = prune_new(
                volume,
                PruneConfig(),
                exemplar=engine.exemplar_,
                boundary=boundary,
                threads=threads,
                report=report,
            )
        volume.metadata["poresynth"].update(origin)
        io.write(output, volume)
        console.result(f"new volume: {output}")
        if cut_at == "none":
            return
        _print_raw(volume.metadata["poresynth"]["raw_porosity"])
        judge([engine.exemplar_], volume, threads, report, beside_images=False)


def _print_raw(porosity: float) -> None:
    console.result(f"porosity at the exemplar's threshold: {porosity:.4f}")


def _field(engine: Any, shape: tuple[int, int, int], **wanted: Any) -> Any:
    """Return the field that a volume is cut from."""
    if not hasattr(engine, "sample_field"):
        allowed = f"is for models of ipfn, which have a field; this is one of {engine.engine}"
        raise ParameterError("cut_at", "none", allowed)
    del wanted["cut_at"], wanted["porosity"]
    return engine.sample_field(shape, **wanted)


def _sampling_options(engine: Any, options: Mapping[str, Any]) -> dict[str, Any]:
    """Return options as the engine takes them: lists as tuples, names of files as maps."""
    found: dict[str, Any] = {}
    for name, value in options.items():
        if name not in engine.sampling_options:
            known = ", ".join(sorted(engine.sampling_options))
            allowed = f"is no option of sampling by {engine.engine}; known are {known}"
            raise ParameterError(name, value, allowed)
        found[name] = tuple(value) if isinstance(value, list) else value
        if name == "guidance" and isinstance(value, str):
            array = read(Path(value)).array
            found[name] = array[0] if array.shape[0] == 1 else array
    return found


def _command(
    model: Path,
    output: Path,
    shape: tuple[int, int, int],
    seed: int,
    boundary: str,
    porosity: float | str | None,
    cut_at: str,
    prune: bool,
    blockwise: bool,
    options: Mapping[str, Any],
) -> str:
    """Return the command line that repeats the run."""
    words = ["poresynth", "sample", str(model), "-o", str(output), "--shape", *map(str, shape)]
    words += ["--seed", str(seed), "--cut-at", cut_at]
    words += ["--periodic"] if boundary == "periodic" else []
    words += ["--porosity", str(porosity)] if porosity is not None else []
    words += ["--prune"] if prune else []
    words += ["--blockwise"] if blockwise else []
    if options:
        # What JSON writes is TOML, too.
        words += ["--set", *(f"{name}={json.dumps(value)}" for name, value in options.items())]
    return shlex.join(words)
