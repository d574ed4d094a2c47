"""Reading and writing volumes: one file a format, and output that is whole or absent."""

from __future__ import annotations

from poresynth.io.atomic import check_writable, claim, output
from poresynth.io.registry import check_output, create, formats, read, write

__all__ = [
    "check_output",
    "check_writable",
    "claim",
    "create",
    "formats",
    "output",
    "read",
    "write",
]
