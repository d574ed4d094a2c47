"""Ctrl-C in the middle of an iteration, and memory that runs out."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

import torch

from poresynth.errors import MemoryEstimateError

__all__ = ["deferred_signals", "explained_memory"]


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


# What the allocators of a CPU and of Apple's GPUs say.
_NO_MEMORY = ("DefaultCPUAllocator", "out of memory")


@contextmanager
def deferred_signals() -> Iterator[Callable[[], BaseException | None]]:
    """Let an iteration finish on the first Ctrl-C or SIGTERM; a second Ctrl-C breaks it off.

    Gives a function that returns what is to be raised, None while nothing was heard.
    """
    heard: list[BaseException] = []

    def note(number: int, frame: FrameType | None) -> None:
        if heard and number == signal.SIGINT:
            raise KeyboardInterrupt
        heard.append(KeyboardInterrupt() if number == signal.SIGINT else SystemExit(128 + number))

    before = {}
    if threading.current_thread() is threading.main_thread():
        usual = (signal.SIG_DFL, signal.default_int_handler)
        for number in (signal.SIGINT, signal.SIGTERM):
            if signal.getsignal(number) in usual:
                before[number] = signal.signal(number, note)
    try:
        yield lambda: heard[0] if heard else None
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
