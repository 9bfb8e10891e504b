"""Structs of C for the named tuples of a model."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable
from typing import Any, get_type_hints

from swashplate.machine import Definition
from swashplate.machine.code_generation import (
    c_comment,
    c_name,
    comment_line,
    fresh_name,
    indented,
)
from swashplate.machine.fields import declared_by
from swashplate.machine.language import is_named_tuple

WIDTH = 100
"""Characters of a line."""


class Structs:
    """Structs in the order in which C needs them; those within others come first.

    Attributes
    ----------
    texts : dict
        Tag and text of each, by the class of named tuples that it stands for.
    """

    def __init__(self, prefix: str, used_names: Iterable[str]) -> None:
        self.prefix, self._used_names = prefix, {*used_names}
        self.texts: dict[Any, tuple[str, str]] = {}

    def of(self, cls: Any) -> str:
        """Tag of the struct of a class of named tuples."""
        if cls not in self.texts:
            tag = self.fresh(_snake(cls.__name__))
            notes = notes_of(cls)
            hints = get_type_hints(cls)
            fields = []
            for name in cls._fields:
                declared = f"{self._type(hints.get(name, float))} {c_name(name)};"
                fields.append((declared, notes[name]))
            doc = inspect.getdoc(cls) or ""
            description = "" if doc.startswith(f"{cls.__name__}(") else doc.splitlines()[0]
            self.texts[cls] = tag, struct(description, tag, fields)
        return self.texts[cls][0]

    def fresh(self, stem: str) -> str:
        """A tag that nothing else has."""
        return fresh_name(c_name(f"{self.prefix}_{stem}"), self._used_names)

    def _type(self, hint: Any) -> str:
        if is_named_tuple(hint):
            return f"struct {self.of(hint)}"
        return "double" if hint in (float, int) else "bool"


def struct(description: str, tag: str, fields: Iterable[tuple[str, str]]) -> str:
    """Text of a struct: declarations, and what is said of each.

    One without fields has a byte, as C99 wants it.
    """
    head = c_comment(description) if description else []
    lines = [line for declared, note in fields for line in with_comment(declared, note)]
    lines = lines or ["    char nothing;"]
    return "\n".join([*head, f"struct {tag} {{", *lines, "};"])


def noted(definition: Definition) -> str:
    """What a definition says, with its unit."""
    return f"{definition.name} [{definition.unit}]" if definition.unit else definition.name


def _snake(name: str) -> str:
    """Name of a class in lower case: ``CardOptions`` is ``card_options``."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()


def with_comment(code: str, note: str) -> list[str]:
    """A line within braces, with a comment behind it, or ahead if there is no room."""
    line = f"    {code}"
    if not note:
        return [line]
    with_note = f"{line} /* {comment_line(note)} */"
    if len(with_note) <= WIDTH:
        return [with_note]
    return [*indented(c_comment(note)), line]


def notes_of(cls: Any) -> dict[str, str]:
    """What is said about each field: its definition, or the comment after it."""
    try:
        text = inspect.getsource(cls)
    except (OSError, TypeError):
        text = ""
    notes = dict(re.findall(r"^    (\w+):.*?# (?!fmt|noqa|type:)(.*)$", text, re.MULTILINE))
    for definition in declared_by(cls):
        for path in definition.fields:
            if definition.unit and path in cls._fields:
                notes[path] = noted(definition)
    return {name: notes.get(name, "") for name in cls._fields}
