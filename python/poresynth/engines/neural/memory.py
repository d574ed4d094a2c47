"""Memory of a device that runs out."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import torch

from poresynth.errors import MemoryEstimateError

__all__ = ["explained_memory"]

# What the allocators of a CPU and of Apple's GPUs say.
_NO_MEMORY = ("DefaultCPUAllocator", "out of memory")


@contextmanager
def explained_memory(device: torch.device, remedy: Callable[[], str]) -> Iterator[None]:
    """Make one line of the error that PyTorch raises when a device has no memory left.

    Parameters
    ----------
    device : torch.device
    remedy : callable
        Returns for what there is too little, what helps, and what is left.

    Raises
    ------
    MemoryEstimateError
        In place of the error.
    """
    try:
        yield
    except RuntimeError as error:  # What PyTorch raises on a GPU is one of them, too.
        named = isinstance(error, torch.OutOfMemoryError)
        if not (named or any(sign in str(error) for sign in _NO_MEMORY)):
            raise
        message = f"{device} has too little memory for {remedy()}"
        raise MemoryEstimateError(message) from error
