"""Types of entries in files: a number is a number, and neither ``true`` nor ``"36"``.

Pydantic alone takes both for numbers, and 1 for true.
"""

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field
from pydantic_core import PydanticKnownError


def _check_number(value: Any) -> Any:
    """A value that may be a number: no truth value and no text."""
    if isinstance(value, bool | str | bytes):
        raise PydanticKnownError("float_type")
    return value


Number = Annotated[float, BeforeValidator(_check_number)]
Finite = Annotated[Number, Field(allow_inf_nan=False)]
Positive = Annotated[Number, Field(gt=0.0, allow_inf_nan=False)]
NotNegative = Annotated[Number, Field(ge=0.0, allow_inf_nan=False)]
Sign = Annotated[Literal[1, -1], BeforeValidator(_check_number)]
Version = Annotated[Literal[1], BeforeValidator(_check_number)]
"""Of the layout of a file."""
Flag = Annotated[bool, Field(strict=True)]
Name = Annotated[str, Field(max_length=100)]
"""A name that other programs use: of a file, a column or a unit of simulation."""
