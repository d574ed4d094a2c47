"""What the formats of images share: colours that are gray after all, and alpha channels."""

from __future__ import annotations

from typing import Any

import numpy.typing as npt

__all__ = ["TRANSPARENT", "gray_if_it_can_be"]

TRANSPARENT = (
    "has transparency (an alpha channel), which has no meaning here; remove it, in "
    "ImageJ by Image > Type > RGB Color, in Python by PIL.Image.open(…).convert('RGB')"
)
"""Why a file is refused."""


def gray_if_it_can_be(colours: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return the one channel of colours that are all gray, else the colours themselves.

    Parameters
    ----------
    colours : numpy.ndarray
        Shape (…, 3).

    Returns
    -------
    numpy.ndarray
        A view, shape (…) or (…, 3).
    """
    gray = (colours == colours[..., :1]).all()
    return colours[..., 0] if gray else colours
