"""Reading and writing volumes: one file a format, and output that is whole or absent."""

from __future__ import annotations

from poresynth.io.atomic import check_writable, claim, output
from poresynth.io.registry import check_output, formats, read, write

__all__ = ["check_output", "check_writable", "claim", "formats", "output", "read", "write"]
