"""Where the solid of a volume is: the one rule that `measure` and `compare` share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from poresynth import preprocess
from poresynth.errors import ParameterError
from poresynth.volume import Volume

__all__ = ["Structure", "first_channel"]


@dataclass(frozen=True)
class Structure:
    """How a material is cut into solid and pore.

    Parameters
    ----------
    kind : {"gray", "binary", "label"}
        What its values mean: two values are binary, up to 16 integers labels, all else gray.
    threshold : float
        Value that parts solid from pore.
    solid : {"bright", "dark"}
        Which side is solid. Of labels, all but the lowest (bright) or the highest (dark) are.
    labels : tuple of int
        The labels, ascending; empty for other kinds.
    """

    kind: Literal["gray", "binary", "label"]
    threshold: float
    solid: Literal["bright", "dark"]
    labels: tuple[int, ...] = ()

    @classmethod
    def of(
        cls,
        volume: Volume,
        threshold: float | None = None,
        solid: Literal["bright", "dark"] = "bright",
        name: str = "volume",
    ) -> Structure:
        """Find out how a volume is cut.

        Parameters
        ----------
        volume : Volume
            Shape (z, y, x) or (z, y, x, channel), of which the first channel decides.
        threshold : float, optional
            Taken instead of Otsu's, or of the middle between the two values or labels.
        solid : {"bright", "dark"}, default "bright"
            Which side is solid.
        name : str, default "volume"
            What the caller names it, for the message.

        Returns
        -------
        Structure

        Raises
        ------
        ParameterError
            If the volume is empty, constant or not finite, or a parameter is outside its range.
        """
        if solid not in ("bright", "dark"):
            raise ParameterError("solid", solid, "must be 'bright' or 'dark'")
        array = first_channel(volume, name)
        labels = preprocess.label_values(array)
        if threshold is None and labels:
            low, high = labels[:2] if solid == "bright" else labels[-2:]
            value = (low + high) / 2
        else:
            value = preprocess.threshold(array, threshold)
        if labels:
            return cls("label", value, solid, labels)
        return cls("binary" if preprocess.is_two_valued(array) else "gray", value, solid)

    def cut(self, array: npt.NDArray[Any]) -> npt.NDArray[np.bool_]:
        """Return where the solid of this or another volume of the material is.

        Parameters
        ----------
        array : numpy.ndarray
            Shape (z, y, x). One of two values is cut midway, whatever they are.

        Returns
        -------
        numpy.ndarray of bool
            Shape (z, y, x).
        """
        if preprocess.is_two_valued(array):
            return preprocess.binarize(array, None, self.solid)
        bright: npt.NDArray[np.bool_] = array > self.threshold
        return bright if self.solid == "bright" else ~bright


def first_channel(volume: Volume, name: str) -> npt.NDArray[Any]:
    """Return the checked voxels of the channel that decides the structure.

    Parameters
    ----------
    volume : Volume
        Shape (z, y, x) or (z, y, x, channel).
    name : str
        What the caller names it, for the message.

    Returns
    -------
    numpy.ndarray
        Shape (z, y, x); a view.

    Raises
    ------
    ParameterError
        If the volume is empty, constant or not finite.
    """
    array = preprocess.validate_voxels(volume, name).array
    if array.ndim == 3:
        return array
    return preprocess.validate_voxels(array[..., 0], f"first channel of {name}").array
