"""Options that do not go together, refused before any work is done."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from poresynth.errors import ParameterError

__all__ = ["NOT_BLOCKWISE", "refuse"]

NOT_BLOCKWISE = "needs the whole volume: not with --blockwise"


def refuse(given: Mapping[str, Any], allowed: str) -> None:
    """Raise `ParameterError` for the first of these options that is given.

    Parameters
    ----------
    given : mapping
        Options by name; None is not given.
    allowed : str
        What is allowed, for the message.
    """
    for name, value in given.items():
        if value is not None:
            raise ParameterError(name, value, allowed)
