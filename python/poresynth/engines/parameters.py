"""What the parameters of all engines share."""

from __future__ import annotations

from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from poresynth.errors import ParameterError

__all__ = ["checked", "named"]

Model = TypeVar("Model", bound=BaseModel)


def named(given: dict[str, Any]) -> dict[str, Any]:
    """Leave out parameters that were not given: None stands for the preset's own value."""
    return {name: value for name, value in given.items() if value is not None}


def checked(model: type[Model], values: dict[str, Any]) -> Model:
    """Check parameters against their model.

    Raises
    ------
    ParameterError
        If a parameter is unknown or outside its range.
    """
    try:
        return model(**values)
    except ValidationError as error:
        first = error.errors()[0]
        name = ".".join(str(part) for part in first["loc"])
        message = first["msg"].removeprefix("Value error, ").partition(" after validation")[0]
        for theirs, ours in (
            ("Input should be", "must be"),
            ("a valid tuple", "a list"),
            ("Tuple should", "must"),
            ("Extra inputs are not permitted", "is not a parameter of this engine"),
        ):
            message = message.replace(theirs, ours)
        raise ParameterError(name, first.get("input"), message) from None
