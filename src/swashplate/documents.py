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

from swashplate.errors import FileError, MissingFileError, ParameterError

if TYPE_CHECKING:
    from pydantic import BaseModel
    from pydantic_core import ErrorDetails

    Model = TypeVar("Model", bound=BaseModel)


LARGEST = 64 * 2**20
"""Bytes of a text that is read whole."""
DEEPEST = 40
_DEEP = re.compile(rf"(?<![\w-])(?:[\w-]+\s*\.\s*){{{DEEPEST}}}")


def read_text(path: str | Path) -> str:
    """The text of a UTF-8 file, without the byte-order mark that some editors begin it with.

    A `FileError` if there is none, it cannot be read, or is no ordinary file of up to 64 MB.
    """
    place = Path(path)
    try:
        found = place.stat()
        if S_ISDIR(found.st_mode):
            raise FileError(f"{path} is a folder, not a file.")
        if not S_ISREG(found.st_mode):
            raise FileError(f"{path} is no ordinary file.")
        if found.st_size > LARGEST:
            raise FileError(f"{path} has more than {LARGEST // 2**20} MB: it is not such a text.")
        return place.read_text("utf-8-sig")
    except FileError:
        raise
    except FileNotFoundError:
        raise MissingFileError(f"There is no file {path}.") from None
    except UnicodeDecodeError as error:
        raise FileError(
            f"{path} is not UTF-8 text: byte {error.start} is {error.object[error.start]:#04x}."
        ) from None
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise FileError(f"{path} cannot be read: {why}.") from None


def parse_toml(text: str, origin: str) -> dict[str, Any]:
    """The tables of a TOML text; `origin` names it in errors.

    A `FileError` if it is not TOML, with line and column, or has what nobody writes: keys or tables
    nested a hundred deep, numbers of thousands of digits, control characters in a text.
    """
    try:
        if _DEEP.search(text):
            raise FileError(f"{origin} has a key of more than {DEEPEST} parts.")
        found = tomllib.loads(text)
        _check_texts(found, origin)
    except tomllib.TOMLDecodeError as error:
        raise FileError(f"{origin} is not TOML: {error}.") from None
    except RecursionError:
        raise FileError(f"{origin} nests its tables or lists too deeply.") from None
    except ValueError as error:
        if isinstance(error, FileError):
            raise
        raise FileError(f"{origin} has a number with too many digits.") from None
    return found


def _check_texts(found: Any, origin: str) -> None:
    """Refuse characters that would steer a terminal or break a page."""
    if isinstance(found, str):
        for each in found:
            if not each.isprintable() and each not in "\n\r\t" and ord(each) < 0xA0:
                raise FileError(
                    f"{origin} has the control character {ord(each):#04x} in the text {found!r:.60}"
                )
    elif isinstance(found, dict | list):
        for each in (*found, *found.values()) if isinstance(found, dict) else found:
            _check_texts(each, origin)


def toml_key(name: str) -> str:
    """A name as a key of TOML: bare, or in quotes."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else toml_string(name)


def toml_string(text: str) -> str:
    """A string of TOML, whose escapes are those of JSON."""
    return json.dumps(text, ensure_ascii=False)


def validated(content: Any, model: type[Model], origin: str) -> Model:
    """Content checked against a schema.

    A `ParameterError` names the first entry that is wrong and says what would be right.
    """
    from pydantic import ValidationError

    try:
        return model.model_validate(content)
    except ValidationError as error:
        found = error.errors()
        raise ParameterError(f"{origin}: {_sentence(found[0], model, found)}.") from None


def read_json(path: str | Path, model: type[Model], *, strict: bool = True) -> Model:
    """A JSON file checked against a schema; strictly, a text is no number, not even `"12"`.

    A `FileError` if it cannot be read or is not JSON, else an error as of `validated`.
    """
    from pydantic import ValidationError

    text = read_text(path)
    try:
        return model.model_validate_json(text, strict=strict)
    except (RecursionError, OverflowError):
        raise FileError(f"{path} nests too deeply or has a number beyond any use.") from None
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
    # of a list the entries count from 1, as in other sentences
    named = [f" {int(part) + 1}" if part.isdecimal() else f".{part}" for part in where]
    path, kind = "".join(named).removeprefix("."), error["type"]
    parent, key = "".join(named[:-1]).removeprefix("."), where[-1] if where else ""
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
    if should := _SHAPES.get(kind):
        keys = ", ".join(_known_keys(model, where)) if should == "a table" else ""
        message = f"should be {should}" + (f" with entries such as {keys}" if keys else "")
    return f"{path} is {_SHORT.repr(error['input'])}, but {message[0].lower()}{message[1:]}"


_SHAPES = {
    "dataclass_type": "a table",
    "model_type": "a table",
    "model_attributes_type": "a table",
    "dict_type": "a table",
    "list_type": "a list",
    "tuple_type": "a list",
    "string_type": "text in quotes",
}
"""What an entry should be, by pydantic's kind of error."""

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
