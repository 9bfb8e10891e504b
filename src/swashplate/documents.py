"""TOML and JSON documents in: read, checked against a schema, refused in one sentence."""

from __future__ import annotations

import json
import re
import tomllib
from difflib import get_close_matches
from pathlib import Path
from reprlib import Repr
from stat import S_ISDIR, S_ISREG
from typing import TYPE_CHECKING, Any, TypeVar

from swashplate.errors import FileError, ParameterError

if TYPE_CHECKING:
    from pydantic import BaseModel
    from pydantic_core import ErrorDetails

    Model = TypeVar("Model", bound=BaseModel)


_LARGEST = 1 << 28
"""Bytes of a document; what holds more was written by no one. [byte]"""


def read_text(path: str | Path) -> str:
    """The text of a UTF-8 file, without the byte-order mark that some editors begin it with.

    Raises
    ------
    FileError
        If there is none, it cannot be read, or is no ordinary file of up to 268 MB.
    """
    try:
        stat = Path(path).stat()
        if not S_ISREG(stat.st_mode):
            what = "is a folder, not a file" if S_ISDIR(stat.st_mode) else "is no ordinary file"
            raise FileError(f"{path} {what}.")
        if stat.st_size > _LARGEST:
            raise FileError(f"{path} has {stat.st_size / 1e6:.0f} MB; no such document is so long.")
        return Path(path).read_text("utf-8-sig")
    except FileError:
        raise
    except FileNotFoundError:
        raise FileError(f"There is no file {path}.") from None
    except UnicodeDecodeError as error:
        raise FileError(
            f"{path} is not UTF-8 text: byte {error.start} is {error.object[error.start]:#04x}."
        ) from None
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise FileError(f"{path} cannot be read: {why}.") from None


_DOTTED = re.compile(r"(?:[\w-]+[ \t]*\.[ \t]*){100}")
"""A key of a hundred parts, whose tables within tables would take minutes."""


def parse_toml(text: str, origin: str) -> dict[str, Any]:
    """The tables of a TOML text; `origin` names it in errors.

    Raises
    ------
    FileError
        If it is not TOML, with line and column.
    """
    try:
        if _DOTTED.search(text):
            raise RecursionError
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise FileError(f"{origin} is not TOML: {error}.") from None
    except RecursionError:
        raise FileError(f"{origin} has tables or arrays in more levels than are read.") from None
    except ValueError:  # of Python, which limits the digits that it turns into a number
        raise FileError(f"{origin} has a number of thousands of digits.") from None


def toml_key(name: str) -> str:
    """A name as a key of TOML: bare, or in quotes."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else toml_string(name)


def toml_string(text: str) -> str:
    """A string of TOML, whose escapes are those of JSON."""
    return json.dumps(text, ensure_ascii=False)


def validated(content: Any, model: type[Model], origin: str) -> Model:
    """Content checked against a schema.

    Raises
    ------
    ParameterError
        For the first entry that is wrong; the sentence names it and says what would be right.
    """
    from pydantic import ValidationError

    try:
        return model.model_validate(content)
    except ValidationError as error:
        found = error.errors()
        raise ParameterError(f"{origin}: {_sentence(found[0], model, found)}.") from None


def read_json(path: str | Path, model: type[Model], *, strict: bool = True) -> Model:
    """A JSON file checked against a schema; strictly, a text is no number, not even `"12"`.

    Raises
    ------
    FileError
        If it cannot be read or is not JSON.
    ParameterError
        For the first entry that is wrong; the sentence names it and says what would be right.
    """
    from pydantic import ValidationError

    text = read_text(path)
    try:
        return model.model_validate_json(text, strict=strict)
    except ValidationError as error:
        found = error.errors()
        if found[0]["type"] == "json_invalid":
            reason = found[0]["msg"].removeprefix("Invalid JSON: ")
            raise FileError(f"{path} is not JSON: {reason}.") from None
        raise ParameterError(f"{path}: {_sentence(found[0], model, found)}.") from None


_SHORT = Repr()
_SHORT.maxstring = _SHORT.maxother = _SHORT.maxlong = 100


def _sentence(error: ErrorDetails, model: type[BaseModel], others: list[ErrorDetails]) -> str:
    where = [str(part) for part in error["loc"] if part not in _BRANCHES]
    path, kind = ".".join(where), error["type"]
    parent, key = ".".join(where[:-1]), where[-1] if where else ""
    table = f"[{parent}]" if parent else "the file"
    if kind == "missing":
        unknown = [
            str(each["loc"][-1])
            for each in others
            if each["type"] == "extra_forbidden" and each["loc"][:-1] == error["loc"][:-1]
        ]
        close = get_close_matches(key, unknown, 1)
        written = f"; it has '{close[0]}', which may be meant" if close else ""
        return f"{table} needs an entry '{key}'{written}"
    if kind == "extra_forbidden":
        known = _known_keys(model, where[:-1])
        close = get_close_matches(key, known, 1)
        hint = f"perhaps '{close[0]}' is meant" if close else f"it has {', '.join(known)}"
        return f"{table} has no entry '{key}': {hint}" if known else f"{table} has no entry '{key}'"
    message = error["msg"].removeprefix("Value error, ").rstrip(".")
    if kind == "value_error":
        return f"{path}: {message}" if path else message
    return f"{path} is {_SHORT.repr(error['input'])}, but {message[0].lower()}{message[1:]}"


_BRANCHES = ("str", "float", "list[float]", "constrained-list")
"""Parts of a location that name a branch of a union, not an entry."""


def _known_keys(model: type[BaseModel], where: list[str]) -> list[str]:
    """Keys of the table at a place, found in the JSON schema, which resolves nested models."""
    schema = model.model_json_schema(by_alias=True)
    definitions = schema.get("$defs", {})

    def resolved(node: dict[str, Any]) -> dict[str, Any]:
        options: list[dict[str, Any]] = [node, *node.get("anyOf", ())]
        for option in options:
            if "$ref" in option:
                found: dict[str, Any] = definitions[option["$ref"].rpartition("/")[2]]
                return found
            if "properties" in option or "items" in option or "additionalProperties" in option:
                return option
        return node

    node = schema
    for part in where:
        node = resolved(node)
        child = node.get("properties", {}).get(part) or (
            node.get("items") if part.isdecimal() else node.get("additionalProperties")
        )
        if not isinstance(child, dict):
            return []
        node = child
    return sorted(resolved(node).get("properties", {}))
