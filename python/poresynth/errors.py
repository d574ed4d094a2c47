"""Every error that the package raises on purpose."""

from __future__ import annotations

import errno
from os import PathLike
from typing import Any

__all__ = [
    "FileError",
    "MemoryEstimateError",
    "MissingExtraError",
    "ParameterError",
    "PoresynthError",
    "TrainingError",
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

    @classmethod
    def because(cls, path: str | PathLike[str], error: BaseException) -> FileError:
        """Return the error for ``path`` that says in one line why the system refused.

        Parameters
        ----------
        path : path_like
            The file or folder, as the caller wrote it.
        error : BaseException
            What the system or a library raised.
        """
        number = error.errno if isinstance(error, OSError) else None
        lines = [line.strip() for line in str(error).splitlines() if line.strip()]
        said = lines[-1] if lines else type(error).__name__
        # ndarray.tofile reports a full disk without an error number.
        if number is None and isinstance(error, OSError) and "requested and" in said:
            number = errno.ENOSPC
        reason = _SYSTEM_REASONS.get(number) if number is not None else None
        if reason is None:
            reason = getattr(error, "strerror", None) or said
        return cls(f"{path}: {reason}")


_SYSTEM_REASONS = {
    errno.ENOENT: "no such file or folder",
    errno.EACCES: "permission denied",
    errno.EPERM: "permission denied",
    errno.EROFS: "permission denied: the disk is read-only",
    errno.EISDIR: "is a folder, not a file",
    errno.ENOTDIR: "a part of the path is a file, not a folder",
    errno.ENOSPC: "no room left on the disk",
    errno.EDQUOT: "no room left in the disk quota",
    errno.EFBIG: "larger than the system allows a file to be",
    errno.ENAMETOOLONG: "the name is too long",
}


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


class TrainingError(PoresynthError, RuntimeError):
    """A network cannot be trained further; the message says why, and what is left of it."""
