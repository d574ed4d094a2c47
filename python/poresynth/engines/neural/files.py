"""One safetensors file with tensors and JSON: the format of models and checkpoints.

The JSON lies in the header of the file, under ``poresynth``; nothing in the file is ever executed.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor

from poresynth.errors import FileError
from poresynth.io import output

__all__ = ["below", "read_tensors", "write_tensors"]

FORMAT = 1
"""Version of the files; another one is refused."""


def write_tensors(path: Path, tensors: Mapping[str, Tensor], facts: Mapping[str, Any]) -> None:
    """Write tensors and JSON-compatible facts; the file appears whole or not at all.

    Peak memory: one copy of the tensors.

    Raises
    ------
    FileError
        If the file cannot be written; an earlier one is then left.
    """
    plain = {name: tensor.detach().contiguous() for name, tensor in tensors.items()}
    with output(path) as (temporary,):
        # Written here, for the library makes files that only their owner can read.
        temporary.write_bytes(save(plain, {"poresynth": json.dumps({"format": FORMAT, **facts})}))


def read_tensors(path: Path, what: str) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Read tensors and facts.

    Parameters
    ----------
    path : Path
    what : str
        What the file should be, for the message.

    Raises
    ------
    FileError
        If the file is missing, damaged, or something else.
    """
    try:
        path.open("rb").close()  # Here the system says what is wrong, there a library.
        with safe_open(path, "pt") as file:
            facts = json.loads((file.metadata() or {})["poresynth"])
            if facts["format"] != FORMAT:
                raise FileError(f"{path}: {what} of format {facts['format']}, not {FORMAT}")
            return {name: file.get_tensor(name) for name in file.keys()}, facts  # noqa: SIM118
    except FileError:
        raise
    except OSError as error:
        raise FileError.because(path, error) from error
    except (ValueError, KeyError, TypeError, SafetensorError) as error:
        raise FileError(f"{path}: not {what}, or damaged ({error})") from error


def below(prefix: str, tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Return the tensors whose names begin with a prefix, without it."""
    return {name.removeprefix(prefix): t for name, t in tensors.items() if name.startswith(prefix)}
