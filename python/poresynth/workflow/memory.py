"""What a volume takes of the memory, said before it is made."""

from __future__ import annotations

from collections.abc import Sequence

from poresynth import console
from poresynth.resources import available_memory, check_memory, format_bytes

__all__ = ["state_memory"]


def state_memory(needed: int, shape: Sequence[int]) -> None:
    """Say what a volume of this shape takes of the memory, and refuse what cannot fit.

    Parameters
    ----------
    needed : int
        Bytes.
    shape : sequence of int
        The volume's.

    Raises
    ------
    MemoryEstimateError
        If it cannot fit.
    """
    check_memory(needed, f"shape {' '.join(map(str, shape))}")
    free = available_memory()
    console.note(
        f"needs about {format_bytes(needed)} of memory"
        + ("" if free is None else f"; {format_bytes(free)} is available")
    )
