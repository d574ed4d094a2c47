"""Fixtures that all tests share."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

# A busy machine is no failure.
settings.register_profile("poresynth", deadline=None)
settings.load_profile("poresynth")


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
