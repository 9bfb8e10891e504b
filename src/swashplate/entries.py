"""Tables and entries of files.

A number in a file is a number: pydantic by itself would accept ``true`` and ``"36"`` as well, and
1 as a truth value.
"""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field
from pydantic_core import PydanticKnownError

from swashplate.results import short


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


class FileTable(BaseModel):
    """A table of a file; a key that it does not know is refused."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, populate_by_name=True, ser_json_inf_nan="strings"
    )

    def __repr__(self) -> str:
        return short(self)
