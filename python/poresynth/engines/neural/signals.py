"""Ctrl-C in the middle of an iteration."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

__all__ = ["deferred_signals"]


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
