"""SIFID: how alike two images are to an Inception network (Shaham et al. 2019).

The network's weights are not part of the package. Any file with the first layers of Inception v3
will do, under the names that PyTorch's model zoo and the FID ports give them
(``Conv2d_1a_3x3.conv.weight`` …), as ``.safetensors`` or ``.pth``.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import torch
from safetensors.torch import load_file
from torch import Tensor, nn

from poresynth.errors import FileError, ParameterError
from poresynth.metrics.frechet import frechet_distance
from poresynth.volume import Volume

__all__ = ["InceptionStem", "load_stem", "sifid"]

Layer = Literal["first_pool", "second_pool"]


class _Convolution(nn.Module):
    def __init__(self, inputs: int, maps: int, edge: int, **options: Any) -> None:
        super().__init__()
        self.conv = nn.Conv2d(inputs, maps, edge, bias=False, **options)
        self.bn = nn.BatchNorm2d(maps, eps=0.001)

    def forward(self, images: Tensor) -> Tensor:
        out: Tensor = self.bn(self.conv(images)).relu()
        return out


class InceptionStem(nn.Module):
    """The first layers of Inception v3, up to the second pooling."""

    def __init__(self) -> None:
        super().__init__()
        self.Conv2d_1a_3x3 = _Convolution(3, 32, 3, stride=2)
        self.Conv2d_2a_3x3 = _Convolution(32, 32, 3)
        self.Conv2d_2b_3x3 = _Convolution(32, 64, 3, padding=1)
        self.Conv2d_3b_1x1 = _Convolution(64, 80, 1)
        self.Conv2d_4a_3x3 = _Convolution(80, 192, 3)

    def forward(self, images: Tensor, layer: Layer) -> Tensor:
        """Return features: 64 after the first pooling, or 192 before the second.

        Parameters
        ----------
        images : Tensor
            Shape (batch, 3, y, x), −1 to 1.
        layer : {"first_pool", "second_pool"}
        """
        out = self.Conv2d_2b_3x3(self.Conv2d_2a_3x3(self.Conv2d_1a_3x3(images)))
        out = nn.functional.max_pool2d(out, 3, stride=2)
        if layer == "second_pool":
            out = self.Conv2d_4a_3x3(self.Conv2d_3b_1x1(out))
        return torch.as_tensor(out)


def load_stem(path: str | Path) -> InceptionStem:
    """Read weights from a local file, ``.safetensors`` or a PyTorch file of tensors alone.

    Raises
    ------
    FileError
        If the file is missing, or does not hold these layers.
    """
    stem = InceptionStem()
    try:
        if Path(path).suffix == ".safetensors":
            tensors = load_file(path)
        else:
            tensors = torch.load(path, map_location="cpu", weights_only=True)
        wanted = stem.state_dict()
        # Counters of training batches are missing in old files, and say nothing.
        given = {name: tensors.get(name, wanted[name]) for name in wanted if "num_batches" in name}
        given |= {name: tensors[name] for name in wanted if "num_batches" not in name}
        stem.load_state_dict(given)
    except OSError as error:
        raise FileError.because(path, error) from error
    except Exception as error:  # The readers raise what they like.
        said = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise FileError(f"{path}: holds no weights of Inception v3 ({said})") from error
    return stem.requires_grad_(False).eval()


def sifid(
    exemplar: Volume | npt.ArrayLike,
    image: Volume | npt.ArrayLike,
    stem: InceptionStem,
    layer: Layer = "second_pool",
) -> float:
    """Return the single-image Fréchet Inception distance.

    Parameters
    ----------
    exemplar, image : Volume or array_like
        Shape (1, y, x[, channel]) or (y, x[, channel]), uint8; 1 or at least 3 channels, of which
        the first three count. At least 32 pixels along each edge.
    stem : InceptionStem
        From `load_stem`.
    layer : {"first_pool", "second_pool"}, default "second_pool"
        Where features are taken: before the second pooling, as the paper of Shaham et al. says, or
        after the first, as their program does.

    Returns
    -------
    float
        0 for the same image. Values depend on the layer and on the weights.

    Raises
    ------
    ParameterError
        If an image is something else.

    Notes
    -----
    Peak memory: about 500 bytes a pixel.
    """
    features = []
    for name, picture in (("exemplar", exemplar), ("image", image)):
        with torch.inference_mode():
            found = stem(_prepared(picture, name), layer)[0]
        features.append(found.flatten(1).T.double().numpy())
    return frechet_distance(*features)


def _prepared(picture: Volume | npt.ArrayLike, name: str) -> Tensor:
    array = np.asarray(picture)
    if array.ndim in (3, 4) and array.shape[0] == 1:
        array = array[0]
    array = array[..., None] if array.ndim == 2 else array
    if array.ndim != 3 or array.dtype != np.uint8 or min(array.shape[:2]) < 32:
        allowed = "must be (y, x[, channel]) of uint8, with edges of 32 or more"
        raise ParameterError(name, f"{array.shape} of {array.dtype}", allowed)
    if array.shape[2] == 1:
        array = np.repeat(array, 3, axis=2)
    if array.shape[2] < 3:
        raise ParameterError(name, f"{array.shape[2]} channels", "must have 1, or 3 or more")
    pixels = torch.from_numpy(array[..., :3].astype(np.float32))
    return (pixels / 127.5 - 1).movedim(-1, 0)[None]
