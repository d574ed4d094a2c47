"""The configuration of a run: from a file and the command line, and back from a result."""

from __future__ import annotations

import difflib
import inspect
import json
import shlex
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PlainSerializer,
    ValidationError,
)

from poresynth.errors import FileError, ParameterError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

__all__ = [
    "InputConfig",
    "PartConfig",
    "PruneConfig",
    "ReadConfig",
    "RunConfig",
    "check_parameters",
    "explain",
    "flags",
    "load",
    "merge",
    "parse_settings",
    "validate",
]

PositiveInt = Annotated[int, Field(gt=0)]
PositiveFloat = Annotated[float, Field(gt=0, allow_inf_nan=False)]


def _several(value: Any) -> Any:
    """Take one text as a list of one."""
    if isinstance(value, str):
        return (value,)
    if not isinstance(value, list | tuple) or not value:
        raise ValueError("must be a text or a list of texts")
    return value


def _one(values: tuple[str, ...]) -> Any:
    """Write a list of one as the text alone: so it stands in the files that there are."""
    return values[0] if len(values) == 1 else values


def _fraction(value: Any) -> Any:
    """Refuse a number that is no porosity; a text is looked at where its file is."""
    if isinstance(value, float) and not 0 < value < 1:
        raise ValueError("must be above 0 and below 1")
    return value


Texts = Annotated[
    tuple[str, ...], BeforeValidator(_several), PlainSerializer(_one, when_used="json")
]


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)

    def given(self) -> dict[str, Any]:
        """Return what differs from the defaults."""
        return self.model_dump(exclude_defaults=True)


class ReadConfig(_Model):
    """How a file is read.

    Parameters
    ----------
    voxel_size : (float, float, float), optional
        Edge lengths of a voxel along z y x; what the file says unless given.
    unit : str, optional
        Unit of the voxel size, such as µm; what the file says unless given.
    array_name : str, optional
        Which array of an NPZ file or a Zarr store, when it holds several.
    raw_shape : (int, int, int), optional
        Shape z y x of a headerless file without a sidecar.
    raw_dtype : str, optional
        Data type of a headerless file, such as uint16.
    raw_byte_order : {"little", "big"}, optional
        Byte order of a headerless file.
    raw_offset : int, optional
        Bytes before the first voxel of a headerless file.
    """

    voxel_size: tuple[PositiveFloat, PositiveFloat, PositiveFloat] | None = None
    unit: str | None = None
    array_name: str | None = None
    raw_shape: tuple[PositiveInt, PositiveInt, PositiveInt] | None = None
    raw_dtype: str | None = None
    raw_byte_order: Literal["little", "big"] | None = None
    raw_offset: Annotated[int, Field(ge=0)] | None = None

    def options(self) -> dict[str, Any]:
        """Return what was given, as the options of `poresynth.io.read`."""
        names = ReadConfig.model_fields
        given = {name: getattr(self, name) for name in names if getattr(self, name) is not None}
        return {name.removeprefix("raw_").removeprefix("array_"): v for name, v in given.items()}


class InputConfig(ReadConfig):
    """How an exemplar is read and prepared.

    A closed mesh needs a voxel size, in the mesh's unit unless a file of 3MF says another.

    Parameters
    ----------
    crop : (str, str, str), optional
        Part to keep, as start:stop along z y x in voxels of the file; ":" keeps all of an axis.
    downsample : int, default 1
        Factor by which the cropped volume is reduced: mean of gray, majority of labels.
    """

    crop: tuple[str, str, str] | None = None
    downsample: PositiveInt = 1


def flags(values: Mapping[str, Any]) -> list[str]:
    """Return the words of the command line that say these values; None is not said."""
    words: list[str] = []
    for name, value in values.items():
        if value is not None:
            several = value if isinstance(value, tuple) else (value,)
            words += [f"--{name.replace('_', '-')}", *map(str, several)]
    return words


class PruneConfig(_Model):
    """How a volume is pruned; see `poresynth.pruning.prune`.

    Parameters
    ----------
    theta : float, default 0.11
        Loose branches shorter than this share of their cell's perimeter go; longer ones grow.
    target : {"zero", "exemplar"}, default "exemplar" with an exemplar, else "zero"
        How many loose ends remain: none, or as many as the exemplar has, and its Euler number.
    parts : {"join", "remove", "keep"}, default "join"
        What becomes of floating parts of the solid.
    pores : {"keep", "close"}, default "keep"
        Whether pores that do not reach the border are filled.
    open_axes : tuple of {"z", "y", "x"}, default ()
        Axes along which the pore must lead from face to face.
    porosity_tolerance : float, default 0.001
        Most by which the porosity may change.
    """

    theta: Annotated[float, Field(ge=0, allow_inf_nan=False)] = 0.11
    target: Literal["zero", "exemplar"] | None = None
    parts: Literal["join", "remove", "keep"] = "join"
    pores: Literal["keep", "close"] = "keep"
    open_axes: tuple[Literal["z", "y", "x"], ...] = ()
    porosity_tolerance: Annotated[float, Field(ge=0, le=1)] = 1e-3

    def arguments(self, *, exemplar: bool) -> dict[str, Any]:
        """Return the arguments of `poresynth.pruning.prune`."""
        given = self.model_dump()
        given["target"] = self.target or ("exemplar" if exemplar else "zero")
        return given


class PartConfig(_Model):
    """All that decides what part is made of a volume; lengths in the unit of the volume.

    Parameters
    ----------
    phase : {"solid", "pore"}, default "solid"
        What the part is: the material, or the space between.
    threshold : float, optional
        Gray value that separates solid from pore. Otsu's unless given.
    solid : {"bright", "dark"}, default "bright"
        Which side of the threshold is solid.
    mask : str, optional
        What lies outside is cut off: a volume of the same shape, or a closed mesh.
    mask_unit : str, optional
        Unit of a mesh whose file does not say it, such as mm.
    shell : float, optional
        Thickness of a solid layer under the surface of the mask, or of the whole block.
    min_thickness : float, optional
        Struts and walls that are thinner are thickened.
    keep : {"largest", "all"}, default "largest"
        The largest part alone, since what nothing holds falls off, or all.
    smooth : int, default 0
        Iterations of Taubin's smoothing of the surface.
    decimate : float, optional
        Merge triangles where the surface moves by no more than this.
    flow : {"z", "y", "x"}, optional
        Name the faces for OpenFOAM: an ASCII STL with walls, inlet, outlet and sides, for a flow
        along this axis.
    output_unit : str, optional
        Unit of lengths in the file; mm unless given.
    """

    phase: Literal["solid", "pore"] = "solid"
    threshold: float | None = None
    solid: Literal["bright", "dark"] = "bright"
    mask: str | None = None
    mask_unit: str | None = None
    shell: PositiveFloat | None = None
    min_thickness: PositiveFloat | None = None
    keep: Literal["largest", "all"] = "largest"
    smooth: Annotated[int, Field(ge=0)] = 0
    decimate: PositiveFloat | None = None
    flow: Literal["z", "y", "x"] | None = None
    output_unit: str | None = None

    def of_run(self, run: RunConfig) -> PartConfig:
        """Return what a volume of this run needs: the run's own mask and threshold."""
        own = {"mask": run.mask, "mask_unit": run.mask_unit}
        named = {name: run.parameters.get(name) for name in ("threshold", "solid")}
        inherited = {k: v for k, v in {**own, **named}.items() if v is not None}
        return self.model_copy(
            update={k: v for k, v in inherited.items() if k not in self.model_fields_set}
        )


class RunConfig(_Model):
    """All that decides the result of one synthesis.

    The number of threads is not here: it does not change the result.

    Parameters
    ----------
    exemplar : tuple of str
        Paths of the exemplars, one for each that the engine learns from. A file may say one path
        without a list.
    shape : (int, int, int)
        Shape (z, y, x) of the new volume, in voxels.
    engine : str, default "volume"
        Name of the engine.
    seed : int, default 0
        Seed of the run.
    boundary : {"open", "periodic"}, default "open"
        A periodic volume tiles without a seam.
    porosity : float or str, optional
        Wanted porosity, 0 to 1; the exemplar's own unless given. "z=0.6:0.9" goes from 0.6 at the
        first face across z to 0.9 at the last; any other text is the path of a map.
    scale : float or str, optional
        Factor by which the structure is larger than the exemplar's, 1/8 to 8; like the porosity a
        number, "z=1:2", or the path of a map.
    orientation : str, optional
        Path of vectors (z, y, x), an array of shape (z, y, x, 3) or coarser, along which the
        exemplar's ``orientation_axis`` runs, stretched by their length.
    orientation_axis : {"z", "y", "x"}, default "z"
        The exemplar's axis that follows the vectors.
    mask, known, known_mask : str, optional
        Paths of the domain that matters (a volume, or a closed mesh), of the known voxels and of
        where they are known.
    mask_unit : str, optional
        Unit of a mesh whose file does not say it, such as mm.
    blockwise : bool, default False
        Make and write the volume brick by brick, in bounded memory: other voxels than in one piece.
    prune : PruneConfig, optional
        How the new volume is pruned; not at all unless given.
    part : PartConfig, optional
        How a printable part is made of the new volume, inside the same mask, if one is wanted.
    parameters : dict
        Parameters of the engine; its own defaults for what is not named.
    input : InputConfig
        How the exemplar is read.
    exemplar_sha256 : tuple of str, optional
        Hash of each exemplar's voxels, as read; a run with another exemplar is refused.
    version : str, optional
        Version of poresynth that saved the configuration.
    """

    exemplar: Texts
    shape: tuple[PositiveInt, PositiveInt, PositiveInt]
    engine: str = "volume"
    seed: Annotated[int, Field(ge=0)] = 0
    boundary: Literal["open", "periodic"] = "open"
    porosity: Annotated[float | str | None, AfterValidator(_fraction)] = None
    scale: PositiveFloat | str | None = None
    orientation: str | None = None
    orientation_axis: Literal["z", "y", "x"] = "z"
    mask: str | None = None
    mask_unit: str | None = None
    known: str | None = None
    known_mask: str | None = None
    blockwise: bool = False
    prune: PruneConfig | None = None
    part: PartConfig | None = None
    parameters: dict[str, Any] = Field(default_factory=dict)
    input: InputConfig = Field(default_factory=InputConfig)
    exemplar_sha256: Texts | None = None
    version: str | None = None

    def saved(self, exemplar_sha256: tuple[str, ...]) -> dict[str, Any]:
        """Return the configuration as JSON-compatible data that repeats the run exactly."""
        from poresynth import __version__

        run = self.model_copy(
            update={"exemplar_sha256": exemplar_sha256, "version": str(__version__)}
        )
        return {
            **run.model_dump(mode="json", exclude_none=True, exclude_defaults=True),
            "engine": self.engine,
            "seed": self.seed,
        }

    def command(self, output: str | Path) -> str:
        """Return the command line that repeats the run, whatever files the run was made of."""
        words = ["poresynth", "synthesize", *self.exemplar, "-o", str(output)]
        words += ["--engine", self.engine, "--shape", *map(str, self.shape)]
        words += ["--seed", str(self.seed)]
        if self.boundary == "periodic":
            words.append("--periodic")
        paths = {
            "mask": self.mask,
            "mask-unit": self.mask_unit,
            "known": self.known,
            "known-mask": self.known_mask,
        }
        fields = {
            "porosity": self.porosity,
            "scale": self.scale,
            "orientation": self.orientation,
            "orientation-axis": None if self.orientation is None else self.orientation_axis,
        }
        words += flags({**fields, **paths, **self.input.given()})
        words += ["--blockwise"] if self.blockwise else []
        words += ["--prune"] if self.prune is not None else []
        settings = dict(self.parameters)
        for table, values in (("prune", self.prune), ("part", self.part)):
            changed = {} if values is None else values.given()
            settings |= {f"{table}.{name}": value for name, value in changed.items()}
        if settings:
            # What JSON writes is TOML, too.
            words += ["--set", *(f"{k}={json.dumps(v)}" for k, v in settings.items())]
        return shlex.join(words)


def load(path: str | Path) -> dict[str, Any]:
    """Read a configuration as a nested dict, unchecked.

    Parameters
    ----------
    path : path-like
        A TOML file, or the JSON file that lies beside a result: the run that made the result.

    Returns
    -------
    dict

    Raises
    ------
    FileError
        If the file cannot be read or is not a configuration.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
        document: Any = json.loads(text) if path.suffix == ".json" else tomllib.loads(text)
    except OSError as error:
        raise FileError.because(path, error) from error
    except ValueError as error:
        raise FileError(f"{path}: not a configuration: {error}") from error
    if path.suffix == ".json":
        for key in ("poresynth", "configuration"):
            document = document.get(key) if isinstance(document, dict) else None
    if not isinstance(document, dict):
        raise FileError(
            f"{path}: holds no configuration; it must be a .toml file or the .json file that "
            "poresynth synthesize wrote beside a result"
        )
    return document


def parse_settings(settings: Iterable[str]) -> dict[str, Any]:
    """Turn ``key=value`` overrides into a nested dict.

    Parameters
    ----------
    settings : iterable of str
        A plain key is a parameter of the engine (``levels=2``), a dotted one a path in the
        configuration (``input.downsample=2``). Values are written as in TOML; a list needs no
        brackets (``windows=8,4``), and what is not TOML is taken as text, so that
        ``field=intensity`` needs no quotes.

    Returns
    -------
    dict

    Raises
    ------
    ParameterError
        If an entry is not of the form ``key=value``.
    """
    document: dict[str, Any] = {}
    for setting in settings:
        key, equals, text = setting.partition("=")
        names = key.strip().split(".")
        if not equals or not all(names):
            raise ParameterError("--set", setting, "must be key=value, such as levels=2")
        value = _value(text)
        *tables, name = names if len(names) > 1 else ("parameters", *names)
        document = merge(document, _nested(tables, {name: value}))
    return document


def _value(text: str) -> Any:
    """Read a value as TOML, as a TOML list without brackets, or as text."""
    for spelling in (text, f"[{text}]") if "," in text else (text,):
        try:
            return tomllib.loads(f"value = {spelling}")["value"]
        except tomllib.TOMLDecodeError:
            continue
    return text.strip()


def merge(base: Mapping[str, Any], *overrides: Mapping[str, Any]) -> dict[str, Any]:
    """Merge nested dicts; the later one wins, table by table.

    Parameters
    ----------
    base : mapping
        What holds where nothing else is said.
    *overrides : mapping
        What replaces it. Left unchanged, as ``base`` is.

    Returns
    -------
    dict
    """
    merged = dict(base)
    for override in overrides:
        for key, value in override.items():
            below = merged.get(key)
            if isinstance(below, Mapping) and isinstance(value, Mapping):
                value = merge(below, value)
            merged[key] = value
    return merged


def validate(document: Mapping[str, Any]) -> RunConfig:
    """Check a nested dict and freeze it.

    Parameters
    ----------
    document : mapping
        Keys of `RunConfig`.

    Returns
    -------
    RunConfig

    Raises
    ------
    ParameterError
        If a key is missing, unknown (near ones are named), or its value is not allowed; if
        ``parameters`` names something that the engine does not have.
    """
    try:
        config = RunConfig.model_validate(document)
    except ValidationError as error:
        raise explain(error) from None
    check_parameters(config.engine, config.parameters)
    return config


def check_parameters(engine: str, parameters: Mapping[str, Any]) -> None:
    """Raise `ParameterError` if an engine does not have one of these parameters, or is unknown."""
    from poresynth.engines import get_engine

    signature = inspect.signature(get_engine(engine)).parameters
    for name, value in parameters.items():
        if name not in signature:
            raise _unknown(name, value, signature, f"no parameter of the engine {engine}")


def _nested(tables: Iterable[str], leaf: dict[str, Any]) -> dict[str, Any]:
    for table in reversed(list(tables)):
        leaf = {table: leaf}
    return leaf


def explain(error: ValidationError) -> ParameterError:
    """Return what is wrong first, as an error of one line."""
    first = error.errors()[0]
    # Positions inside a tuple say nothing that its value does not.
    path = [str(part) for part in first["loc"] if isinstance(part, str)]
    key = ".".join(path)
    if first["type"] == "extra_forbidden":
        model = InputConfig if path[:-1] == ["input"] else RunConfig
        prefix = "".join(f"{part}." for part in path[:-1])
        known = [f"{prefix}{name}" for name in model.model_fields]
        return _unknown(key, first["input"], known, "no key of the configuration")
    if first["type"] == "missing":
        return ParameterError(key, "(not given)", "is needed")
    message = first["msg"].removeprefix("Value error, ")
    return ParameterError(key, first["input"], message[0].lower() + message[1:])


def _unknown(key: str, value: Any, known: Iterable[str], what: str) -> ParameterError:
    names = sorted(known)
    near = difflib.get_close_matches(key, names, n=3)
    hint = f"did you mean {' or '.join(near)}?" if near else f"known are {', '.join(names)}"
    return ParameterError(key, value, f"is {what}; {hint}")
