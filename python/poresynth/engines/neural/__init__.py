"""What the neural engines share: the training loop, its files, noise, and sampling by tiles.

Nothing outside the neural engines imports this package, so that PyTorch is only loaded by those
who use them.
"""

from __future__ import annotations

import importlib.util

from poresynth.errors import MissingExtraError

for _package in ("torch", "safetensors"):
    if importlib.util.find_spec(_package) is None:
        raise MissingExtraError("a neural engine", "neural")
