"""TOML and JSON documents in: read, checked against a schema, refused in one sentence."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Sequence
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
LARGEST_TOML = 8 * 2**20
"""Characters of a TOML text: a thousand runs take 200,000, and more would be parsed for minutes."""
DEEPEST = 40
"""Parts of a dotted key, and tables and lists within each other. The parser's time grows with the
cube of the former."""
LONGEST_KEY = 200
LONGEST_TEXT = 20_000
"""Characters of a key and of a text."""
_TOKEN = re.compile(
    r"""
      (?P<comment> \#[^\n]*+ )
    | (?P<part>
          \"{3} (?: [^"\\]++ | \\. | "(?!"") )* (?:"{3,5})?
        | '{3} (?: [^']++ | '(?!'') )* (?:'{3,5})?
        | " (?: [^"\\\n]++ | \\. )* "?
        | ' [^'\n]*+ '?
        | [\w-]++
      )
    | (?P<dot> \. )
    | (?P<blank> [ \t]++ )
    | (?P<other> . )
    """,
    re.VERBOSE | re.DOTALL,
)
"""Pieces of a TOML text, as far as a dotted key needs them; each character is looked at once."""
_UNPRINTABLE = re.compile(
    r"[\0-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff]"
)
"""Characters that steer a terminal or turn the direction of writing, or that neither XML nor UTF-8
can hold."""


def read_text(path: str | Path) -> str:
    """The text of a UTF-8 file, without the byte-order mark that some editors begin it with.

    A `FileError` if there is none, it cannot be read, or is not an ordinary file of up to 64 MB.
    """
    file = Path(path)
    try:
        status = file.stat()
        if S_ISDIR(status.st_mode):
            raise FileError(f"{path} is a folder, not a file.")
        if not S_ISREG(status.st_mode):
            raise FileError(f"{path} is not an ordinary file.")
        if status.st_size > LARGEST:
            raise FileError(
                f"{path} has more than {LARGEST // 2**20} MB: it is too large for such a file."
            )
        return file.read_text("utf-8-sig")
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

    Raises
    ------
    FileError
        If it is not TOML, with line and column, or has what nobody writes: keys or tables nested a
        hundred deep, integers beyond 64 bits, keys or texts of many pages, and characters that no
        terminal, page or XML file can show.
    """
    if len(text) > LARGEST_TOML:
        raise FileError(
            f"{origin} has more than {LARGEST_TOML // 2**20} MB: it is too large for such a file."
        )
    if _has_deep_key(text):
        raise FileError(f"{origin} has a key of more than {DEEPEST} parts.")
    try:
        content = tomllib.loads(text)
        _check_values(content, origin)
    except tomllib.TOMLDecodeError as error:
        raise FileError(f"{origin} is not TOML: {error}.") from None
    except RecursionError:
        raise FileError(f"{origin} nests its tables or lists too deeply.") from None
    except ValueError as error:
        if isinstance(error, FileError):
            raise
        raise FileError(f"{origin} has a number with too many digits.") from None
    return content


def _has_deep_key(text: str) -> bool:
    """Whether a key has more than `DEEPEST` parts, bare or in quotes, anywhere in a TOML text."""
    depth = 0
    after_dot = False
    for token in _TOKEN.finditer(text):
        kind = token.lastgroup
        if kind == "part":
            depth = depth + 1 if after_dot else 1
            after_dot = False
            if depth > DEEPEST:
                return True
        elif kind == "dot":
            after_dot = depth > 0
        elif kind != "blank":
            depth = 0
            after_dot = False
    return False


def _check_values(value: Any, origin: str, depth: int = 0) -> None:
    """Refuse texts that would steer a terminal, integers beyond 64 bits, and a deep nest of all."""
    if depth > DEEPEST:
        raise FileError(f"{origin} nests its tables or lists too deeply, beyond {DEEPEST}.")
    if isinstance(value, str):
        _check_text(value, LONGEST_TEXT, "text", origin)
    elif isinstance(value, dict):
        for key, entry in value.items():
            _check_text(key, LONGEST_KEY, "key", origin)
            _check_values(entry, origin, depth + 1)
    elif isinstance(value, list):
        for entry in value:
            _check_values(entry, origin, depth + 1)
    elif isinstance(value, int) and not -(2**63) <= value < 2**63:
        raise FileError(f"{origin} has an integer beyond 64 bits, a number with too many digits.")


def _check_text(text: str, longest: int, what: str, origin: str) -> None:
    if character := _UNPRINTABLE.search(text):
        raise FileError(
            f"{origin} has the character U+{ord(character[0]):04X}, which cannot be shown, in the "
            f"{what} {text[:60]!r}; leave it out."
        )
    if len(text) > longest:
        raise FileError(
            f"{origin} has a {what} of {len(text)} characters that begins with {text[:40]!r}; the "
            f"limit is {longest}."
        )


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
        raise ParameterError(f"{origin}: {_sentence(error.errors(), model)}.") from None


def read_json(path: str | Path, model: type[Model], *, strict: bool = True) -> Model:
    """A JSON file checked against a schema; strictly, a text is not a number, not even `"12"`.

    A `FileError` if it cannot be read or is not JSON, else an error as of `validated`.
    """
    from pydantic import ValidationError

    text = read_text(path)
    try:
        return model.model_validate_json(text, strict=strict)
    except (RecursionError, OverflowError):
        raise FileError(f"{path} nests too deeply or has a number that is out of range.") from None
    except ValidationError as error:
        errors = error.errors()
        if errors[0]["type"] == "json_invalid":
            reason = errors[0]["msg"].removeprefix("Invalid JSON: ")
            raise FileError(f"{path} is not JSON: {reason}.") from None
        raise ParameterError(f"{path}: {_sentence(errors, model)}.") from None


_SHORT = Repr()
_SHORT.maxstring = _SHORT.maxother = _SHORT.maxlong = 100


def _sentence(errors: Sequence[ErrorDetails], model: type[BaseModel]) -> str:
    """The first error in words; one of a misspelt entry before those that follow from it.

    That of the layout's number goes before all: the others may follow from it.
    """
    of_layout = [error for error in errors if error["loc"][-1:] == ("schema",)]
    misspelt = (error for error in errors if _near(error, model))
    error = of_layout[0] if of_layout else next(misspelt, errors[0])
    location = map(str, error["loc"])
    where = [part for part in location if _names_entry(part)]
    # of a list the entries count from 1, as in other sentences
    named = [f" {int(part) + 1}" if part.isdecimal() else f".{part}" for part in where]
    path = "".join(named).removeprefix(".")
    kind = error["type"]
    parent = "".join(named[:-1]).removeprefix(".")
    key = where[-1] if where else ""
    table = f"[{parent}]" if parent else "the file"
    if kind == "missing":
        return f"{table} needs an entry '{key}'"
    if kind == "extra_forbidden":
        valid_keys = _known_keys(model, where[:-1])
        close = _near(error, model)
        hint = f"perhaps '{close[0]}' is meant" if close else f"it has {', '.join(valid_keys)}"
        return (
            f"{table} has no entry '{key}': {hint}"
            if valid_keys
            else f"{table} has no entry '{key}'"
        )
    message = error["msg"].removeprefix("Value error, ").rstrip(".")
    if kind == "value_error":
        return f"{path}: {message}" if path else message
    if should := _SHAPES.get(kind):
        keys = ", ".join(_known_keys(model, where)) if should == "a table" else ""
        message = f"should be {should}" + (f" with entries such as {keys}" if keys else "")
    return f"{path} is {_SHORT.repr(error['input'])}, but {message[0].lower()}{message[1:]}"


def _near(error: ErrorDetails, model: type[BaseModel]) -> list[str]:
    """The entry that is meant by one that there is not, if one is near."""
    if error["type"] != "extra_forbidden":
        return []
    *where, key = [part for part in map(str, error["loc"]) if _names_entry(part)]
    return get_close_matches(key, _known_keys(model, where), 1)


def _names_entry(part: str) -> bool:
    return part not in _BRANCHES and "[" not in part


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
"""Parts of a location that name a branch of a union, not an entry; so does one with a bracket."""


def _known_keys(model: type[BaseModel], where: list[str]) -> list[str]:
    """Keys of the table at a place, found in the JSON schema, which resolves nested models."""
    schema = model.model_json_schema(by_alias=True)
    definitions = schema.get("$defs", {})

    def resolved(node: dict[str, Any]) -> dict[str, Any]:
        options: list[dict[str, Any]] = [node, *node.get("anyOf", ())]
        for option in options:
            if "$ref" in option:
                definition: dict[str, Any] = definitions[option["$ref"].rpartition("/")[2]]
                return definition
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
