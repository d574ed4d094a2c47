"""New volumes of a porous material from one example of it."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from poresynth.comparison import compare
    from poresynth.engines.volume_texture import VolumeTexture
    from poresynth.errors import PoresynthError
    from poresynth.io import read, write
    from poresynth.preprocess import binarize, crop, downsample, threshold
    from poresynth.report import write_report
    from poresynth.volume import Volume

# Public names are imported when first used: a command line that only prints its help, or a
# program that only reads a file, does not wait for SciPy or Matplotlib.
_HOME = {
    "PoresynthError": "poresynth.errors",
    "Volume": "poresynth.volume",
    "VolumeTexture": "poresynth.engines.volume_texture",
    "__version__": "poresynth._core",
    "binarize": "poresynth.preprocess",
    "compare": "poresynth.comparison",
    "crop": "poresynth.preprocess",
    "downsample": "poresynth.preprocess",
    "read": "poresynth.io",
    "threshold": "poresynth.preprocess",
    "write": "poresynth.io",
    "write_report": "poresynth.report",
}

__all__ = [
    "PoresynthError",
    "Volume",
    "VolumeTexture",
    "__version__",
    "binarize",
    "compare",
    "crop",
    "downsample",
    "read",
    "threshold",
    "write",
    "write_report",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'poresynth' has no attribute {name!r}")
    value = getattr(importlib.import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOME})
