"""C as text: names, numbers, kinds of values, lines and comments."""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib.resources import files
from typing import Any, NamedTuple, get_type_hints

from swashplate.equations.language import MATH

WIDTH = 100
"""Longest line of C."""
_OF_COMMENTS = re.compile(r"\*(?=/)|/(?=\*)|\?(?=\?)")
"""First characters of what ends or begins a comment, or begins a trigraph."""
_SECTION = re.compile(r"^/\*== (\w+) ==\*/\n", re.MULTILINE)


def sections(name: str) -> dict[str, str]:
    """Sections of a file of C beside this one, by name."""
    parts = _SECTION.split((files(__package__) / name).read_text("utf-8"))[1:]
    return dict(zip(parts[::2], parts[1::2], strict=True))


HELPERS = sections("helpers.c.in")
"""Functions that stand for what C has not, or has otherwise."""
WORDS = set(
    """
auto break case char const continue default do double else enum extern float for goto if inline int
long register restrict return short signed sizeof static struct switch typedef union unsigned void
volatile while bool true false NULL INFINITY NAN size_t offsetof main errno memcpy memset strcmp
isfinite isnan isinf signbit lesser_of greater_of whole_power whole_number fabs fmod pow ldexp frexp
modf ceil round trunc rint cosh sinh tanh acosh asinh atanh cbrt log10 log2 log1p exp2 expm1 erf
erfc gamma lgamma tgamma fmin fmax fdim fma j0 j1 jn y0 y1 yn index time signal div abs linux unix
""".split()  # noqa: SIM905
) | set(MATH.values())
"""Names that C or its library keeps for itself."""
BREAKS = re.compile(r"[,;\"] | (?=[?:+/=*-] |&& |\|\| )|\{(?=\.)")
"""Where a long line of C may end."""
LEVELS = {"?": 1, "||": 2, "&&": 3, "==": 7, "!=": 7, "<": 8, "<=": 8, ">": 8, ">=": 8}
LEVELS |= {"+": 10, "-": 10, "*": 11, "/": 11, "unary": 12, "atom": 13}


@dataclass(frozen=True)
class Kind:
    """What a value is: double, int, bool, flag (an option), struct or tuple."""

    word: str
    cls: Any = None
    items: tuple[Kind, ...] = ()

    @property
    def whole(self) -> bool:
        """Whether it has parts, and is passed by its address."""
        return self.word in ("struct", "tuple")


DOUBLE, INT, BOOL, FLAG = Kind("double"), Kind("int"), Kind("bool"), Kind("flag")
SCALARS = {DOUBLE: "double", INT: "long long", BOOL: "bool", FLAG: "bool"}


class Text(NamedTuple):
    """An expression in C."""

    text: str
    level: int
    kind: Kind
    pointer: bool = False
    """Whether it is the address of what it stands for."""
    place: bool = True
    """Whether it has an address, if it has parts."""


def c_name(name: str) -> str:
    """A name of Python's as one of C's."""
    plain_name = "".join(c if c.isascii() else f"u{ord(c):04x}" for c in name)
    return f"{plain_name}_" if plain_name in WORDS else plain_name


def snake(name: str) -> str:
    """Name of a class in lower case: ``CardOptions`` is ``card_options``."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()


def literal(value: float) -> str:
    """A number as C writes it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value)
    if math.isinf(value):
        return "INFINITY" if value > 0.0 else "-INFINITY"
    return "NAN" if math.isnan(value) else repr(float(value))


def wrapped(line: str) -> list[str]:
    """A line of C on as many lines as it takes."""
    indent = " " * (len(line) - len(line.lstrip()))
    lines, rest = list[str](), line
    while len(rest) > WIDTH:
        ends = [m.end() for m in BREAKS.finditer(rest, len(indent) + 8, WIDTH + 1)]
        if not ends:
            break
        at = max([m for m in ends if rest[m - 2] in ",;"] or ends)
        at = at if at > WIDTH // 2 else max(ends)
        lines.append(rest[:at].rstrip())
        rest = f"{indent}    {rest[at:]}"
    return [*lines, rest]


def comment_line(text: str) -> str:
    """A text as one line within a comment, which nothing in it can begin or end.

    C removes a backslash at the end of a line, and C99 replaces trigraphs such as ``??/``, before
    it looks for comments: two harmless lines could be joined to the end of one.
    """
    line = "".join(c if c.isprintable() else " " for c in text)
    line = line.replace("\\", "|")
    return _OF_COMMENTS.sub(lambda pair: f"{pair[0]} ", line)


def comment(text: str) -> list[str]:
    """A docstring as a comment."""
    lines = [comment_line(line) for line in inspect.cleandoc(text).splitlines()] or [""]
    if len(lines) == 1 and len(lines[0]) < WIDTH - 6:
        return [f"/* {lines[0]} */"]
    return [f"/* {lines[0]}", *(f" * {line}".rstrip() for line in lines[1:]), " */"]


def fields_of(cls: Any) -> list[tuple[str, Any]]:
    """Fields of a class of named tuples with their types."""
    hints = get_type_hints(cls)
    return [(name, hints.get(name, float)) for name in cls._fields]


def indented(lines: Iterable[str]) -> list[str]:
    """Lines of C moved in, long ones on several."""
    return [each for line in lines for each in (wrapped(f"    {line}") if line else [""])]


def function(says: str, head: str, body: Iterable[str]) -> str:
    """Text of a function of C."""
    return "\n".join([f"/* {comment_line(says)} */", head, "{", *indented(body), "}"])


def filled(text: str, words: Mapping[str, Any]) -> str:
    """A text with words in the place of their names, ``@name@``."""
    for name, word in words.items():
        text = text.replace(f"@{name}@", str(word))
    return text
