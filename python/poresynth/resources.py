"""What the machine has: memory."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from poresynth.errors import MemoryEstimateError

__all__ = ["available_memory", "check_memory", "format_bytes"]


def available_memory() -> int | None:
    """Return the bytes that a program can still take without swapping, or None if unknown."""
    if sys.platform == "linux":
        for line in Path("/proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                free = int(line.split()[1]) * 1024
                limit = _container_memory()
                return free if limit is None else min(free, limit)
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return None


def _container_memory(folder: Path = Path("/sys/fs/cgroup")) -> int | None:
    """Return what a container's limit leaves, None without a limit (control groups, version 2)."""
    try:
        limit, used = (
            (folder / name).read_text().strip() for name in ("memory.max", "memory.current")
        )
    except OSError:
        return None
    return None if limit == "max" else max(0, int(limit) - int(used))


def format_bytes(count: float) -> str:
    """Return a byte count as a person reads it: ``"1.5 GB"``."""
    for unit in ("B", "kB", "MB", "GB", "TB"):
        if count < 1000 or unit == "TB":
            break
        count /= 1000
    return f"{count:.3g} {unit}"


def check_memory(needed: int, what: str) -> None:
    """Refuse work that cannot fit.

    Parameters
    ----------
    needed : int
        Estimated peak, bytes.
    what : str
        What needs it, for the message.

    Raises
    ------
    MemoryEstimateError
        If more is needed than is available.
    """
    free = available_memory()
    if free is not None and needed > free:
        raise MemoryEstimateError(
            f"{what} needs about {format_bytes(needed)} of memory, "
            f"but only {format_bytes(free)} is available"
        )
