from __future__ import annotations

import errno
import pickle

import pytest

from poresynth.errors import (
    FileError,
    MemoryEstimateError,
    MissingExtraError,
    ParameterError,
    PoresynthError,
)


@pytest.mark.parametrize(
    "error",
    [
        ParameterError("shape", (0, 1), "must be positive"),
        FileError("a.tif: is empty"),
        MissingExtraError("NRRD", "io"),
        MemoryEstimateError("needs 9 GB"),
    ],
)
def test_errors_survive_process_pools(error: PoresynthError) -> None:
    copy = pickle.loads(pickle.dumps(error))
    assert type(copy) is type(error)
    assert str(copy) == str(error)
    assert vars(copy) == vars(error)


def test_errors_are_what_python_expects() -> None:
    assert issubclass(ParameterError, ValueError)
    assert issubclass(FileError, OSError)
    assert issubclass(MissingExtraError, ImportError)
    assert issubclass(MemoryEstimateError, MemoryError)


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), "no room left on the disk"),
        (OSError("80000 requested and 4096 written"), "no room left on the disk"),
        (OSError(errno.EFBIG, "File too large"), "larger than the system allows a file to be"),
        (PermissionError(errno.EACCES, "Permission denied"), "permission denied"),
        (FileNotFoundError(errno.ENOENT, "No such file"), "no such file or folder"),
        (OSError(errno.EIO, "Input/output error"), "Input/output error"),
        (OSError("cannot identify image file"), "cannot identify image file"),
        (ValueError("long story\n  the cause\n"), "the cause"),
        (KeyError(), "KeyError"),
    ],
)
def test_reasons_are_one_plain_line(error: Exception, said: str) -> None:
    assert str(FileError.because("a.tif", error)) == f"a.tif: {said}"
