"""The parameters of training that every neural engine has."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator

__all__ = ["FREE_TO_CHANGE", "TrainingParameters"]

FREE_TO_CHANGE = frozenset({"iterations", "patience", "device", "compile"})
"""Parameters that may differ when a training is resumed: they do not change what was done."""


class TrainingParameters(BaseModel):
    """How a network is trained; engines add their own to these.

    Parameters
    ----------
    iterations : int
        Iterations at most.
    batch : int
        Crops of one iteration, over all devices and accumulation steps.
    accumulate : int
        Parts that a batch is computed in, one after the other, for less memory. Batch statistics
        are those of a part.
    learning_rate : float
    schedule : {"constant", "cosine"}
        The learning rate over the iterations; ``"cosine"`` falls to 0 at the last.
    ema : float
        Decay of the exponential moving average of the generator's weights; 0 takes the weights as
        they are.
    precision : {"float32", "bfloat16", "float16"}
        Of the matrix products and convolutions; weights stay float32.
    channels_last : bool
        Memory order with the channels innermost, which half precision on a GPU wants.
    compile : bool
        Let PyTorch compile the networks.
    device : str
        "auto" takes a GPU if there is one; else a name of PyTorch, such as "cuda:1" or "cpu".
    evaluate_every : int
        Iterations between comparisons with the exemplar, each of which leaves a checkpoint.
    patience : int
        Stop after so many comparisons without a better one; 0 never.
    training_seed : int
        Of the weights, the crops and the noise of training.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    iterations: int = Field(ge=1)
    batch: int = Field(ge=1)
    accumulate: int = Field(1, ge=1)
    learning_rate: float = Field(gt=0, le=1)
    schedule: Literal["constant", "cosine"] = "constant"
    ema: float = Field(0.0, ge=0, lt=1)
    precision: Literal["float32", "bfloat16", "float16"] = "float32"
    channels_last: bool = False
    compile: bool = False
    device: str = "auto"
    evaluate_every: int = Field(ge=1)
    patience: int = Field(0, ge=0)
    training_seed: int = Field(0, ge=0, lt=2**63)

    @field_validator("accumulate")
    @classmethod
    def _whole_parts(cls, accumulate: int, info: ValidationInfo) -> int:
        if info.data.get("batch", 0) % accumulate:
            raise ValueError(f"must divide the batch, {info.data['batch']}")
        return accumulate
