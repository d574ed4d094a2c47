"""Fixtures that all tests share."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

# A busy machine is no failure.
settings.register_profile("poresynth", deadline=None)
settings.load_profile("poresynth")


def pytest_configure() -> None:
    """Hear the signals that a shell's background jobs and nohup ignore: programs inherit that."""
    for name, handler in (("SIGINT", signal.default_int_handler), ("SIGHUP", signal.SIG_DFL)):
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, handler)


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Folder of real exemplars, which the repository does not carry."""
    name = os.environ.get("PORESYNTH_DATA")
    if not name:
        pytest.skip("PORESYNTH_DATA does not name the folder of real exemplars")
    return Path(name)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20110917)
