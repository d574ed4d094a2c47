"""Every error that the package raises on purpose."""

from __future__ import annotations

from typing import Any

__all__ = [
    "FileError",
    "MemoryEstimateError",
    "MissingExtraError",
    "ParameterError",
    "PoresynthError",
]


class PoresynthError(Exception):
    """Base of all errors of the package: the message is one line that a person can act on."""


class ParameterError(PoresynthError, ValueError):
    """A parameter is outside what is allowed.

    Parameters
    ----------
    parameter : str
        Name of the parameter, as the caller wrote it.
    value : Any
        The value that was given.
    allowed : str
        What is allowed, as the end of the sentence: ``"must be positive"``.
    """

    def __init__(self, parameter: str, value: Any, allowed: str) -> None:
        super().__init__(f"{parameter} = {value}: {allowed}")
        self.parameter = parameter
        self.value = value
        self.allowed = allowed

    def __reduce__(self) -> tuple[type[ParameterError], tuple[str, Any, str]]:
        """Pickle by the three arguments, so that the error survives process pools."""
        return type(self), (self.parameter, self.value, self.allowed)


class FileError(PoresynthError, OSError):
    """A file cannot be read or written: wrong suffix, truncated, missing, no room, in use."""


class MissingExtraError(PoresynthError, ImportError):
    """An optional dependency is not installed; the message names the extra that brings it."""

    def __init__(self, what: str, extra: str) -> None:
        super().__init__(f"{what} needs an optional package: pip install 'poresynth[{extra}]'")
        self.what = what
        self.extra = extra

    def __reduce__(self) -> tuple[type[MissingExtraError], tuple[str, str]]:
        """Pickle by the two arguments, so that the error survives process pools."""
        return type(self), (self.what, self.extra)


class MemoryEstimateError(PoresynthError, MemoryError):
    """The work would not fit into memory; the message gives the estimate and what is free."""
