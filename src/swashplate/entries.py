"""Tables and entries of files.

A number in a file is a number: pydantic by itself would accept ``true`` and ``"36"`` as well, and
1 as a truth value.
"""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator
from pydantic_core import PydanticKnownError

from swashplate.__about__ import __version__
from swashplate.results import short

SCHEMA = 1
"""Of the files that this version writes, and the newest that it reads. It goes up if an entry gets
another meaning or goes away, so that an older version does not misread the file; not if one is
added, which an older version refuses by its name."""


def _check_number(value: Any) -> Any:
    """A value that may be a number: no truth value and no text."""
    if isinstance(value, bool | str | bytes):
        raise PydanticKnownError("float_type")
    return value


def _check_schema(value: Any) -> Any:
    """The number of a layout that this version knows."""
    if isinstance(value, bool) or not isinstance(value, int) or value < 1:
        raise ValueError(
            f"{value!r} is not the number of a layout, a whole number from 1 up: write {SCHEMA}, "
            "or leave it out"
        )
    if value > SCHEMA:
        raise ValueError(
            f"{value} is the layout of a newer swashplate, and {__version__} reads up to {SCHEMA}: "
            "update swashplate"
        )
    return value


Number = Annotated[float, BeforeValidator(_check_number)]
Finite = Annotated[Number, Field(allow_inf_nan=False)]
Positive = Annotated[Number, Field(gt=0.0, allow_inf_nan=False)]
NotNegative = Annotated[Number, Field(ge=0.0, allow_inf_nan=False)]
Sign = Annotated[Literal[1, -1], BeforeValidator(_check_number)]
Schema = Annotated[int, BeforeValidator(_check_schema)]
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


class Document(FileTable):
    """A whole file; without a number of its layout it is of the first."""

    model_config = ConfigDict(populate_by_name=False, serialize_by_alias=True)

    layout: Schema = Field(
        1,
        alias="schema",
        repr=False,
        description="Number of the file's layout; a newer one than the program knows is refused.",
    )


class FormerlyFormat(Document):
    """A file whose number of the layout was called ``format`` before all had one."""

    @model_validator(mode="before")
    @classmethod
    def _renamed(cls, content: Any) -> Any:
        if not isinstance(content, dict) or "format" not in content or "schema" in content:
            return content
        return {"schema" if key == "format" else key: entry for key, entry in content.items()}
