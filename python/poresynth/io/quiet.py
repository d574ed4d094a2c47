"""Silence for libraries that print what they also report."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["quiet"]

# The stream belongs to the process: two threads must not save each other's silence as the stream.
_lock = threading.Lock()


@contextmanager
def quiet() -> Iterator[None]:
    """Discard what compiled libraries write to the standard error stream meanwhile."""
    with _lock:
        kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 2)
        try:
            yield
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            os.close(nowhere)
