"""Files and folders that appear whole or not at all, and that one process writes at a time."""

from __future__ import annotations

import errno
import os
import shutil
import signal
import socket
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import FrameType

from poresynth.errors import FileError, PoresynthError

__all__ = ["check_writable", "claim", "output"]

# Below this much free space, a failed write of a library that hides the system's reason is
# reported as a full disk.
_FULL = 1 << 20

# Outputs that this process has claimed: path → (process, thread) that did. The process is named
# because a forked child inherits the table, but not the claims.
_claimed: dict[Path, tuple[int, int]] = {}
_claimed_guard = threading.Lock()


def check_writable(path: str | os.PathLike[str], *, folder: bool = False) -> None:
    """Raise unless a file (or folder) can be written at a path, so that long work can fail first.

    Parameters
    ----------
    path : path_like
        The output to be.
    folder : bool, default False
        Whether the output will be a folder.

    Raises
    ------
    FileError
        If the parent folder is missing or not writable, or something else is in the way.
    """
    given, path = path, _real(path)
    try:
        if not path.parent.exists():
            raise FileError(f"{given}: the folder {path.parent} does not exist")
        if not path.parent.is_dir():
            raise FileError(f"{given}: {path.parent} is a file, not a folder")
        # Asking the system for a file is the one test that holds on every kind of disk.
        with tempfile.TemporaryFile(dir=path.parent):
            pass
        if not path.exists():
            return
    except FileError:
        raise
    except PermissionError as error:
        raise FileError(f"{given}: permission denied to write into {path.parent}") from error
    except OSError as error:
        raise FileError.because(given, error) from error
    if path.is_dir() and not folder:
        raise FileError(f"{given}: is a folder, not a file")
    if folder and not path.is_dir():
        raise FileError(f"{given}: is a file, not a folder")
    if not (path.is_dir() or path.is_file()):
        raise FileError(f"{given}: is not a regular file")
    try:
        if path.is_file():
            path.open("r+b").close()
    except OSError as error:
        raise FileError(f"{given}: exists and is read-only") from error


@contextmanager
def claim(path: str | os.PathLike[str]) -> Iterator[None]:
    """Hold an output for this process: a second run that wants it fails at once.

    The lock is the file ``.<name>.lock`` beside the output; it holds the process and the host.
    The lock of a process that died is taken over. Nested claims by one thread are one claim.

    Parameters
    ----------
    path : path_like
        The output: a file or folder that need not exist yet.

    Raises
    ------
    FileError
        If another process or thread is writing there, or the folder is not writable.
    """
    given, path = path, _real(path)
    claimant = os.getpid(), threading.get_ident()
    with _claimed_guard:
        holder = _claimed.get(path)
        if holder == claimant:
            lock = None
        elif holder is not None and holder[0] == os.getpid():
            raise FileError(f"{given}: is being written by another thread of this process")
        else:
            lock = _lock(given, path)
            _claimed[path] = claimant
    try:
        yield
    finally:
        if lock is not None:
            lock.unlink(missing_ok=True)
            with _claimed_guard:
                _claimed.pop(path, None)


@contextmanager
def output(
    *paths: str | os.PathLike[str], may_replace: Callable[[Path], bool] | None = None
) -> Iterator[tuple[Path, ...]]:
    """Give temporary paths to write to; on success what is there takes the place of ``paths``.

    The temporary paths lie beside the outputs. After the block they are flushed to the disk and
    renamed, in the given order. If the block raises, also by Ctrl-C or SIGTERM, they are removed
    and whatever the outputs held before is untouched.

    Parameters
    ----------
    *paths : path_like
        The outputs. Each may become a file or a folder; one that the block does not write is
        left as it was.
    may_replace : callable, optional
        Called with an existing folder that is not empty, before a new one takes its place; the
        default refuses.

    Yields
    ------
    tuple of Path
        Where to write, one for each of ``paths``; the names end like those of the outputs.

    Raises
    ------
    FileError
        If the system refuses (no room, no permission), another process is writing there, or a
        folder is in the way.
    """
    real = [_real(path) for path in paths]
    temporary = tuple(path.with_name(f".partial-{path.name}") for path in real)
    with ExitStack() as stack:
        for path in paths:
            check_writable(path, folder=_real(path).is_dir())
            stack.enter_context(claim(path))
        stack.enter_context(_interruptible())
        try:
            # What a killed run left; the claim says that nobody is writing it now.
            _remove(temporary)
            yield temporary
            for given, path, new in zip(paths, real, temporary, strict=True):
                if new.exists():
                    _check_replaceable(given, path, new, may_replace)
                    _flush(new)
            for path, new in zip(real, temporary, strict=True):
                if new.exists():
                    _put(new, path)
        except FileError:
            raise
        except OSError as error:
            raise FileError.because(_culprit(paths, real, error), error) from error
        except Exception as error:
            if not isinstance(error, PoresynthError) and _is_full(real[0].parent):
                full = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
                raise FileError.because(paths[0], full) from error
            raise
        finally:
            _remove(temporary)


def _real(path: str | os.PathLike[str]) -> Path:
    """Absolute path without links: a link to a file is written through, not replaced."""
    return Path(os.path.realpath(path))


def _culprit(
    paths: tuple[str | os.PathLike[str], ...], real: list[Path], error: OSError
) -> str | os.PathLike[str]:
    """Return the output that an error is about, as the caller wrote it."""
    name = str(error.filename or "")
    for given, path in zip(paths, real, strict=True):
        if name.endswith(path.name):
            return given
    return paths[0]


def _is_full(folder: Path) -> bool:
    try:
        return shutil.disk_usage(folder).free < _FULL
    except OSError:
        return False


def _remove(paths: tuple[Path, ...]) -> None:
    for path in paths:
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)


def _check_replaceable(
    given: str | os.PathLike[str],
    path: Path,
    new: Path,
    may_replace: Callable[[Path], bool] | None,
) -> None:
    if not path.exists():
        return
    if path.is_dir() != new.is_dir():
        kind, other = ("folder", "file") if path.is_dir() else ("file", "folder")
        raise FileError(f"{given}: is a {kind}, not a {other}")
    if path.is_dir() and any(path.iterdir()) and not (may_replace and may_replace(path)):
        raise FileError(f"{given}: the folder exists and holds other files; name a new one")


def _flush(path: Path) -> None:
    """Flush a file, or all of a folder, to the disk."""
    if path.is_dir():
        for entry in path.iterdir():
            _flush(entry)
        if os.name != "posix":  # Elsewhere a folder cannot be opened.
            return
    descriptor = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _put(new: Path, path: Path) -> None:
    """Rename ``new`` to ``path`` and flush the parent folder."""
    if new.is_dir() and path.is_dir():
        old = path.with_name(f".replaced-{path.name}")
        _remove((old,))
        path.rename(old)
        try:
            new.rename(path)
        except BaseException:
            old.rename(path)
            raise
        shutil.rmtree(old, ignore_errors=True)
    else:
        new.replace(path)
    if os.name == "posix":
        descriptor = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


@contextmanager
def _interruptible() -> Iterator[None]:
    """Let SIGTERM and SIGHUP raise, as Ctrl-C does, so that the clean-up runs."""
    numbers = []
    if threading.current_thread() is threading.main_thread():
        candidates = (getattr(signal, name, None) for name in ("SIGTERM", "SIGHUP"))
        numbers = [n for n in candidates if n and signal.getsignal(n) is signal.SIG_DFL]

    def stop(number: int, frame: FrameType | None) -> None:
        raise SystemExit(128 + number)

    for number in numbers:
        signal.signal(number, stop)
    try:
        yield
    finally:
        for number in numbers:
            signal.signal(number, signal.SIG_DFL)


def _lock(given: str | os.PathLike[str], path: Path) -> Path:
    """Create the lock file of an output, or raise with the name of its holder."""
    lock = path.with_name(f".{path.name}.lock")
    # A dead process's lock is removed under a lock of its own: of two runs that find it, the
    # slower one must not remove the new lock of the faster one.
    removal = path.with_name(f".{path.name}.lock.stale")
    try:
        while not _create(lock):
            if (holder := _holder(lock)) is None:
                continue
            if _is_alive(*holder):
                raise FileError(_busy(given, lock, *holder))
            if not _create(removal):
                raise FileError(f"{given}: another process is taking over the lock {removal}")
            try:
                if (holder := _holder(lock)) is not None and not _is_alive(*holder):
                    lock.unlink(missing_ok=True)
            finally:
                removal.unlink(missing_ok=True)
    except PermissionError as error:
        raise FileError(f"{given}: permission denied to write into {path.parent}") from error
    except FileError:
        raise
    except FileNotFoundError as error:
        raise FileError(f"{given}: the folder {path.parent} does not exist") from error
    except OSError as error:
        raise FileError.because(given, error) from error
    return lock


def _create(lock: Path) -> bool:
    """Create a lock file that names this process; False if there is one."""
    try:
        descriptor = os.open(lock, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o644)
    except FileExistsError:
        return False
    try:
        with os.fdopen(descriptor, "w", encoding="utf-8") as file:
            file.write(f"{os.getpid()} {socket.gethostname()}\n")
    except BaseException:
        lock.unlink(missing_ok=True)  # A lock without a name would never be taken over.
        raise
    return True


def _holder(lock: Path) -> tuple[int, str] | None:
    """Return the process and host in a lock file; None if it is gone."""
    try:
        process, _, host = lock.read_text(encoding="utf-8").strip().partition(" ")
        return int(process), host
    except FileNotFoundError:
        return None
    except ValueError:
        return 0, ""  # Created a moment ago and not written yet.


def _is_alive(process: int, host: str) -> bool:
    if host != socket.gethostname() or os.name != "posix":
        return True  # Nothing can be known of it from here.
    if process == os.getpid():
        return False  # An earlier process of the same number: this one's locks are remembered.
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True


def _busy(given: str | os.PathLike[str], lock: Path, process: int, host: str) -> str:
    if host == socket.gethostname():
        return f"{given}: is being written by process {process}"
    who = f"process {process} on {host}" if process else "another process"
    return f"{given}: is being written by {who} (if it is gone, remove {lock})"
