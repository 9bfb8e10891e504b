"""All that was translated: structs, constants and functions, in the order in which C needs them."""

from __future__ import annotations

import inspect
import re
import types
import typing
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from swashplate.equations.c_source.function import Function
from swashplate.equations.c_source.text import (
    BOOL,
    DOUBLE,
    FLAG,
    HELPERS,
    INT,
    SCALARS,
    Kind,
    c_name,
    comment,
    comment_line,
    fields_of,
    literal,
    snake,
    wrapped,
)
from swashplate.equations.fields import Definition
from swashplate.equations.language import Parsed, is_named_tuple, parsed, plain
from swashplate.errors import EquationError


class UnknownKindError(EquationError):
    """A type that has no counterpart in C."""


@dataclass
class Unit:
    """Structs, constants and functions, in the order in which C needs them."""

    prefix: str = ""
    """What stands before the tags of structs."""
    longest: int = 3
    """Elements of a tuple whose length the types leave open: samples of a `Window`."""
    reserved: set[str] = field(default_factory=set)
    """Names that functions and structs may not have."""
    structs: dict[Any, tuple[str, str]] = field(default_factory=dict)
    constants: dict[str, tuple[Any, str]] = field(default_factory=dict)
    functions: dict[Any, str] = field(default_factory=dict)
    """Names in C, by function and what it is made for."""
    texts: list[str] = field(default_factory=list)
    under_way: dict[Any, str] = field(default_factory=dict)
    wider: dict[Any, Any] = field(default_factory=dict)
    """Class of named tuples that stands for another wherever equations name that one: parameters
    with those of an equation of one's own among them."""

    def add(self, function: Any) -> str:
        """Translate an equation and all that it calls; its name in C."""
        return self.made(parsed(function), (), {}, {})

    def made(
        self, source: Parsed, key: tuple[Any, ...], kinds: dict[str, Kind], calls: dict[str, Any]
    ) -> str:
        """A function for certain kinds of arguments, or for other functions among them."""
        whole_key = (source.function, *key)
        if whole_key in self.functions:
            return self.functions[whole_key]
        if whole_key in self.under_way:
            source.refuse(None, "a call of itself", "write a loop over a literal range")
        stem = "_of_".join([source.name, *(plain(each).__name__ for each in calls.values())])
        known = {*self.functions.values(), *self.under_way.values(), *self.reserved}
        name = self.under_way[whole_key] = self.free(c_name(stem), source.function, known)
        try:
            text = Function(self, source, name, kinds, calls).text()
        except UnknownKindError as error:
            where = f"{source.file}, line {source.node.lineno}: {source.name}"
            raise EquationError(f"{where} cannot be written in C: {error}") from None
        del self.under_way[whole_key]
        self.functions[whole_key] = name
        self.texts.append(text)
        return name

    def free(self, name: str, owner: Any, taken: Iterable[str]) -> str:
        """A name that nothing else has: with its module's, then with a number."""
        used, module = set(taken), owner.__module__.rpartition(".")[2].strip("_") or "own"
        start = self.prefix if self.prefix and name.startswith(self.prefix) else ""
        moved = f"{start}{module}_{name.removeprefix(start)}"
        names = (name, moved, *(f"{name}_{k}" for k in range(2, 1000)))
        return next(each for each in names if each not in used)

    def struct(self, cls: Any) -> str:
        """A class of named tuples; its tag."""
        if cls not in self.structs:
            tag = c_name(f"{self.prefix}{snake(cls.__name__)}")
            taken = {known for known, _ in self.structs.values()}
            tag = self.free(tag, cls, taken | self.reserved)
            fields = [
                (self.declaration(self.kind(hint, f"{cls.__name__}.{name}"), c_name(name)), note)
                for (name, hint), note in zip(fields_of(cls), _notes(cls), strict=True)
            ]
            doc = inspect.getdoc(cls) or ""
            doc = "" if doc.startswith(f"{cls.__name__}(") else doc.splitlines()[0]
            lines = [*(comment(doc) if doc else []), f"struct {tag} {{"]
            for text, note in fields:
                lines.append(f"    {text};" + (f" /* {comment_line(note)} */" if note else ""))
            lines += [] if fields else ["    char nothing;"]
            self.structs[cls] = (tag, "\n".join([*lines, "};"]))
        return self.structs[cls][0]

    def tuple(self, kind: Kind) -> str:
        """A tuple's struct; its tag."""
        doubles = all(item in (DOUBLE, INT) for item in kind.items)
        letters = "".join(item.word[0] for item in kind.items)
        tag = f"{self.prefix}{'double' if doubles else letters}_{len(kind.items)}"
        if tag not in self.structs:
            inner = [f"double v[{len(kind.items)}]"]
            if not doubles:
                inner = [self.declaration(item, f"v{i}") for i, item in enumerate(kind.items)]
            lines = [f"struct {tag} {{", *(f"    {each};" for each in inner), "};"]
            self.structs[tag] = (tag, "\n".join(lines))
        return tag

    def helpers(self) -> list[str]:
        """Functions that the translated ones call."""
        text = "\n".join(self.texts)
        return [each for name, each in HELPERS.items() if f"{name}(" in text]

    def kind(self, hint: Any, where: str) -> Kind:
        """Kind of what has a type."""
        origin, args = typing.get_origin(hint), typing.get_args(hint)
        if origin is typing.Annotated:
            return self.kind(args[0], where)
        known = {float: DOUBLE, int: INT, bool: BOOL, type(None): FLAG}
        if hint in known:
            return known[hint]
        if origin in (typing.Union, types.UnionType) and set(args) == {bool, type(None)}:
            return FLAG
        if is_named_tuple(hint):
            return Kind("struct", self.wider.get(hint, hint))
        if origin is tuple:
            args = (args[0],) * self.longest if args[-1] is Ellipsis else args
            return Kind("tuple", None, tuple(self.kind(each, where) for each in args))
        raise UnknownKindError(
            f"{where} is of type {getattr(hint, '__name__', hint)}; there are float, int, bool, "
            "bool | None for an option, tuples and named tuples of them."
        )

    def declared(self, kind: Kind) -> str:
        """A kind as C writes it."""
        if kind in SCALARS:
            return SCALARS[kind]
        return f"struct {self.struct(kind.cls) if kind.word == 'struct' else self.tuple(kind)}"

    def declaration(self, kind: Kind, name: str, *, formal: bool = False) -> str:
        """A name with its kind; what has parts is given to functions by its address."""
        if formal and kind.whole:
            return f"const {self.declared(kind)} *{name}"
        return f"{self.declared(kind)} {name}"

    def constant(self, name: str, value: Any) -> str:
        """A number from outside an equation; its name in C."""
        name = {"pi": "PI", "e": "EULER", "tau": "TAU"}.get(name, name)
        name = c_name(
            name if (name.isupper() and len(name) > 3) or name == "PI" else f"{name}_VALUE"
        )
        name = name.upper()
        known = [n for n, (v, _) in self.constants.items() if n.startswith(name) and v == value]
        if known:
            return known[0]
        name = next(n for n in (name, *(f"{name}_{k}" for k in range(2, 1000)))
                    if n not in self.constants)  # fmt: skip
        if isinstance(value, tuple):
            kind = Kind("tuple", None, (DOUBLE,) * len(value))
            inner = ", ".join(literal(float(each)) for each in value)
            text = f"static const {self.declared(kind)} {name} = {{{{{inner}}}}};"
        else:
            word = "bool" if isinstance(value, bool) else "double"
            word = "long long" if type(value) is int else word
            text = f"static const {word} {name} = {literal(value)};"
        self.constants[name] = (value, "\n".join(wrapped(text)))
        return name


def _notes(cls: Any) -> list[str]:
    """What is said about each field: its definition, or the comment behind it."""
    hints = typing.get_type_hints(cls, include_extras=True)
    try:
        text = inspect.getsource(cls)
    except (OSError, TypeError):
        text = ""
    said = dict(re.findall(r"^    (\w+):.*?# (?!fmt|noqa|type:)(.*)$", text, re.MULTILINE))
    notes = []
    for name in cls._fields:
        definition = next(iter(getattr(hints.get(name), "__metadata__", ())), None)
        if isinstance(definition, Definition) and definition.unit:
            notes.append(f"{definition.name} [{definition.unit}]")
        else:
            notes.append(said.get(name, ""))
    return notes
