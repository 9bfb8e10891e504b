"""The graph printed as C99: expressions, statements, functions, and the loops that they call.

The operations are those of the Python in their order, so that a strict compiler gives the same
bits.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from importlib.resources import files
from types import MappingProxyType
from typing import Any

from swashplate.machine import graph
from swashplate.machine.code_generation.functions import fresh_name
from swashplate.machine.code_generation.loops import PRECISION, STEPS, TINY, Inner
from swashplate.machine.code_generation.printing import ATOM, CodeBlock, Text, grouped
from swashplate.machine.code_generation.values import leaves
from swashplate.machine.graph import COMPARISONS, FALSE, TRUE, Node
from swashplate.machine.language import MATH, Parsed

WIDTH = 100
"""Longest line of C."""
TYPES = {"float": "double", "int": "long long", "bool": "bool"}
"""Types of values by their kinds."""
ZEROS = {"float": "0.0", "int": "0", "bool": "false"}
MATH_H = """
acos acosh asin asinh atan atan2 atanh cbrt ceil copysign cos cosh erf erfc exp exp2 expm1 fabs fdim
floor fma fmax fmin fmod frexp hypot ilogb ldexp lgamma llrint llround log log10 log1p log2 logb
lrint lround modf nan nearbyint nextafter nexttoward pow remainder remquo rint round scalbln scalbn
sin sinh sqrt tan tanh tgamma trunc
""".split()  # noqa: SIM905
"""Functions of C99's math.h, each with its twins for float and long double."""
FLOAT_H = """
DIG EPSILON MANT_DIG MAX MAX_10_EXP MAX_EXP MIN MIN_10_EXP MIN_EXP HAS_SUBNORM TRUE_MIN DECIMAL_DIG
NORM_MAX
""".split()  # noqa: SIM905
"""Macros of float.h, each for float, double and long double."""
CPP = """
alignas alignof and and_eq asm atomic_cancel atomic_commit atomic_noexcept bitand bitor catch
char8_t char16_t char32_t class co_await co_return co_yield compl concept const_cast consteval
constexpr constinit decltype delete dynamic_cast explicit export friend mutable namespace new
noexcept not not_eq nullptr operator or or_eq private protected public reflexpr reinterpret_cast
requires static_assert static_cast synchronized template this thread_local throw try typeid typename
typeof using virtual wchar_t xor xor_eq
""".split()  # noqa: SIM905
"""Words of C++ beside those of C: a header may be read as C++."""
WORDS = set(
    """
auto break case char const continue default do double else enum extern float for goto if inline int
long register restrict return short signed sizeof static struct switch typedef union unsigned void
volatile while bool true false NULL INFINITY NAN size_t offsetof main errno memcpy memset strcmp
memchr memcmp memmove strcat strchr strcoll strcpy strcspn strerror strlen strncat strncmp strncpy
strpbrk strrchr strspn strstr strtok strxfrm ptrdiff_t max_align_t float_t double_t math_errhandling
HUGE_VAL HUGE_VALF HUGE_VALL MATH_ERRNO MATH_ERREXCEPT FP_NAN FP_INFINITE FP_ZERO FP_SUBNORMAL
FP_NORMAL FP_FAST_FMA FP_FAST_FMAF FP_FAST_FMAL FP_ILOGB0 FP_ILOGBNAN FLT_RADIX FLT_ROUNDS
FLT_EVAL_METHOD DECIMAL_DIG fpclassify isnormal isgreater isgreaterequal isless islessequal
islessgreater isunordered
isfinite isnan isinf signbit lesser_of greater_of segment_of whole_power whole_number fabs fmod pow
ldexp frexp modf ceil round trunc rint cosh sinh tanh acosh asinh atanh cbrt log10 log2 log1p exp2
expm1 erf
erfc gamma lgamma tgamma fmin fmax fdim fma j0 j1 jn y0 y1 yn index time signal div abs linux unix
""".split()  # noqa: SIM905
)
WORDS |= {*MATH.values(), *CPP, *(f"{name}{kind}" for name in MATH_H for kind in ("", "f", "l"))}
WORDS |= {f"{kind}_{name}" for name in FLOAT_H for kind in ("FLT", "DBL", "LDBL")}
"""Names that C, its library or C++ keeps for itself."""
BREAKS = re.compile(r"[,;\"] | (?=[?:+/=*-] |&& |\|\| )|\{(?=\.)")
"""Where a long line of C may end."""
_LEVELS = (("if",), ("or",), ("and",), ("==", "!="), ("<", "<=", ">", ">="), ("+", "-"), ("*", "/"))
LEVELS = {op: level for level, ops in enumerate((*_LEVELS, ("not", "neg")), 1) for op in ops}
"""How tightly operations bind; names and calls as `ATOM`."""
UNARY = LEVELS["neg"]
FEW = 3
"""Statements of an equation from which on it gets a heading again, not a remark."""
_SECTION = re.compile(r"^/\*== (\w+) ==\*/\n", re.MULTILINE)
_HEADING = re.compile(r"^ */\*= (\d+) \*/$")


# --- texts ----------------------------------------------------------------------------------------


def sections(package: str | None, name: str) -> dict[str, str]:
    """Sections of a file of C in a package, by name."""
    assert package is not None
    parts = _SECTION.split((files(package) / name).read_text("utf-8"))[1:]
    return dict(zip(parts[::2], parts[1::2], strict=True))


HELPERS = sections(__package__, "helpers.c.in")
"""Functions that stand for what C has not, or has otherwise."""
ROOT = HELPERS.pop("root")


def helpers_in(text: str) -> list[str]:
    """Functions that a text calls, of those that stand for what C has not."""
    return [helper for name, helper in HELPERS.items() if f"{name}(" in text]


def filled(text: str, replacements: Mapping[str, Any]) -> str:
    """A text with words in the place of their names, ``@name@``."""
    for name, word in replacements.items():
        text = text.replace(f"@{name}@", str(word))
    return text


def ascii_name(name: str) -> str:
    """A name of Python's in the letters of C."""
    return "".join(
        character if character.isascii() else f"u{ord(character):04x}" for character in name
    )


def c_name(name: str) -> str:
    """A name of Python's as one of C's and C++'s; two names stay two."""
    letters = ascii_name(name).replace(".", "_")
    return f"{letters}_" if letters.rstrip("_") in WORDS else letters


def c_literal(value: float) -> str:
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
        ends = [match.end() for match in BREAKS.finditer(rest, len(indent) + 8, WIDTH + 1)]
        if not ends:
            break
        late = [at for at in ends if at > WIDTH // 2] or ends[-1:]
        at = min(late, key=lambda at: (_depth(rest[:at]), _rank(rest, at), -at))
        lines.append(rest[:at].rstrip())
        rest = f"{indent}    {rest[at:]}"
    return [*lines, rest]


def _rank(line: str, at: int) -> int:
    """How well a line ends at a place: before a choice best, before a factor or a value worst."""
    marks = (("?", ":"), ("&&", "||"), ("+", "-"), ("*", "/", "="))
    ranks = [rank for rank, mark in enumerate(marks) if line[at:].startswith(mark)]
    return ranks[0] if ranks else 1


def _depth(text: str) -> int:
    """Brackets that are open at the end of a text."""
    return text.count("(") + text.count("{") - text.count(")") - text.count("}")


_OF_COMMENTS = re.compile(r"\*(?=/)|/(?=\*)|\?(?=\?)")
"""First characters of what ends or begins a comment, or begins a trigraph."""


def comment_line(text: str) -> str:
    """A text as one line of a comment, changed so that no part of it can begin or end a comment.

    Before C looks for comments, it joins lines that end in a backslash, and C99 replaces trigraphs
    such as ``??/``, which is a backslash. Two harmless lines could thus become the end of a
    comment.
    """
    line = "".join(c if c.isprintable() else " " for c in text)
    line = line.replace("\\", "|")
    return _OF_COMMENTS.sub(lambda pair: f"{pair[0]} ", line)


def c_comment(text: str, pad: str = "", width: int = WIDTH) -> list[str]:
    """A text of one line as a comment of C, wrapped to a width."""
    line = f"{pad}/* {comment_line(text)} */"
    lines = list[str]()
    # a break leaves at least some words on a line, and room for the end of the comment
    earliest = len(pad) + 20
    latest = width - 3
    while len(line) > width and " " in line[earliest:latest]:
        break_at = line.rindex(" ", earliest, latest)
        lines.append(line[:break_at])
        line = f"{pad} * {line[break_at + 1 :]}"
    return [*lines, line]


def indented(lines: Iterable[str]) -> list[str]:
    """Lines of C indented by four spaces, long ones wrapped."""
    parts: list[str] = []
    for line in lines:
        parts += wrapped(f"    {line}") if line else [""]
    return parts


def c_function(description: str, head: str, body: Iterable[str]) -> str:
    """Text of a function of C."""
    heading = c_comment(description) if description else []
    return "\n".join([*heading, *wrapped(head), "{", *indented(body), "}"])


def first_line(source: Parsed) -> str:
    """First line of what an equation says about itself."""
    return (source.function.__doc__ or "").strip().partition("\n")[0].strip()


# --- the language ---------------------------------------------------------------------------------


class C:
    """C99, long lines not yet on several.

    Parameters
    ----------
    functions : Loops
        Where functions go that the lines call.
    origins : mapping of Node to Parsed
        The equation that a value comes from: comments say where one begins.
    used_names : set of str
        Names of the block that is printed.
    pasts : mapping of Node to str, optional
        First arguments of ``past_value`` for each signal whose past is kept; that of others has
        always been what it is.
    """

    def __init__(
        self,
        functions: Loops,
        origins: Mapping[Node, Parsed],
        used_names: set[str],
        pasts: Mapping[Node, str] = MappingProxyType({}),
    ) -> None:
        self._functions, self._origins, self._used_names = functions, origins, used_names
        self._pasts = pasts
        self._sources: dict[Parsed, int] = {}

    # -- expressions -------------------------------------------------------------------------------

    def number(self, value: Any) -> Text:
        """A literal number."""
        text = c_literal(value)
        return text, UNARY if text[0] == "-" else ATOM

    def operation(self, node: Node, operands: Sequence[Text]) -> Text:
        """An operator with its operands, or a call; whole numbers among doubles are cast."""
        op, level = node.op, LEVELS.get(node.op, ATOM)
        if op == "if":
            return self._choice(node, operands)
        if op == "past":
            signal, age = node.args
            if signal not in self._pasts:
                return operands[0]
            return f"past_value({self._pasts[signal]}, {as_double(age, operands[1])[0]})", ATOM
        if op == "element":
            (place, _), *elements = (
                as_double(*pair) for pair in zip(node.args, operands, strict=True)
            )
            listed = ", ".join(text for text, _ in elements)
            return f"((const double[]){{{listed}}})[(int)({place})]", ATOM
        if op == "segment":
            (x, _), *knots = (as_double(*pair) for pair in zip(node.args, operands, strict=True))
            listed = ", ".join(text for text, _ in knots)
            return f"segment_of({x}, (const double[]){{{listed}}}, {len(knots)})", ATOM
        if op == "not":
            return f"!{grouped(operands[0], level)}", level
        if op == "neg":
            text = grouped(operands[0], level)
            return f"-({text})" if text.startswith("-") else f"-{text}", level
        if op == "abs" and node.args[0].kind == "bool":
            return operands[0]
        doubles = [as_double(*pair) for pair in zip(node.args, operands, strict=True)]
        if op == "**":
            (base,) = doubles
            if node.value == 2 and base[1] == ATOM and node.kind == "float":
                return f"{base[0]} * {base[0]}", LEVELS["*"]
            return _as_whole_number(node, f"whole_power({base[0]}, {node.value})")
        if level == ATOM:
            name = {"min": "lesser_of", "max": "greater_of", "abs": "fabs"}.get(op, op)
            return _as_whole_number(node, f"{name}({', '.join(text for text, _ in doubles)})")
        compared = op in COMPARISONS
        all_whole = all(operand.kind == "int" for operand in node.args) and op != "/"
        left, right = operands if all_whole else doubles
        least = LEVELS["+"] if compared else level
        return f"{grouped(left, least)} {op} {grouped(right, max(least, level + 1))}", level

    def _choice(self, node: Node, texts: Sequence[Text]) -> Text:
        _, if_true, if_false = node.args
        test, text_if_true, text_if_false = texts
        opposite = f"!{grouped(test, UNARY)}", UNARY
        if if_false is FALSE:
            return _joined(test, "&&", text_if_true)
        if if_true is TRUE:
            return _joined(test, "||", text_if_false)
        if if_true is FALSE:
            return _joined(opposite, "&&", text_if_false)
        if if_false is TRUE:
            return _joined(opposite, "||", text_if_true)
        if node.kind == "float":
            text_if_true, text_if_false = (
                as_double(if_true, text_if_true),
                as_double(if_false, text_if_false),
            )
        condition = grouped(test, LEVELS["=="])
        first = grouped(text_if_true, LEVELS["or"])
        return f"{condition} ? {first} : {text_if_false[0]}", LEVELS["if"]

    # -- statements --------------------------------------------------------------------------------

    def assigned(self, name: str, node: Node, text: str, pad: str, *, new: bool) -> list[str]:
        """An assignment; a new name is a constant."""
        if node.op == "number" and node.kind == "int":
            text = f"{text}.0"
        start = f"const {TYPES[node.kind]} {name}" if new else name
        return [f"{pad}{start} = {text};"]

    def called(
        self,
        call: Node,
        targets: Sequence[str],
        arguments: Sequence[str],
        declared: set[str],
        pad: str,
    ) -> list[str]:
        """A call of what does the loop: it returns a root, and moves a state where it stands."""
        name = self._functions.name_of(call.value.loop, self._used_names)
        kind = call.value.loop.kind
        # ahead of the equation's other arguments: a bracket, nothing, or a count and a state
        leading = {"root": 2, "once": 0}.get(kind, 1 + len(targets))
        texts = [
            as_double(node, (text, 0))[0] if index < leading else text
            for index, (node, text) in enumerate(zip(call.args, arguments, strict=True))
        ]
        if len(targets) == 1 and kind != "repeated":
            (target,) = targets
            start = target if target in declared else f"const double {target}"
            return [f"{pad}{start} = {name}({', '.join(texts)});"]
        lines: list[str] = []
        addresses: list[str] = []
        for index, target in enumerate(targets):
            variable = target or fresh_name("unused", self._used_names)
            addresses.append(f"&{variable}")
            start = variable if target in declared else f"double {variable}"
            if kind == "repeated":
                lines.append(f"{pad}{start} = {texts[1 + index]};")
            elif target not in declared:
                lines.append(f"{pad}{start};")
        count = texts[:1] if leading else []
        call_arguments = [*count, *texts[leading:], *addresses]
        return [*lines, f"{pad}{name}({', '.join(call_arguments)});"]

    def branch(self, test: str, then: list[str], otherwise: list[str], pad: str) -> list[str]:
        """`if` and `else`, or `else if` if there is nothing but that."""
        if not then:
            return [f"{pad}if (!({test})) {{", *otherwise, f"{pad}}}"]
        lines = [f"{pad}if ({test}) {{", *then]
        if not otherwise:
            return [*lines, f"{pad}}}"]
        inner = f"{pad}    "
        nested = otherwise[1:] if _HEADING.match(otherwise[0]) else otherwise
        at_level = [line for line in nested if line[len(inner)] not in " }"]
        if at_level == nested[:1] and at_level[0].startswith(f"{inner}if ("):
            first, *rest = [line[4:] for line in nested]
            return [*lines, f"{pad}}} else {first.lstrip()}", *rest]
        return [*lines, f"{pad}}} else {{", *otherwise, f"{pad}}}"]

    def declared(self, names: Mapping[str, Node], pad: str, *, always: bool) -> list[str]:
        """Declarations by type; zero if only one side gives a value."""
        lines = []
        for kind, word in TYPES.items():
            names_of_kind = [name for name, node in names.items() if node.kind == kind]
            zero = "" if always else f" = {ZEROS[kind]}"
            if names_of_kind:
                listed = ", ".join(f"{name}{zero}" for name in names_of_kind)
                lines.append(f"{pad}{word} {listed};")
        return lines

    def heading(self, node: Node, pad: str) -> list[str]:
        """A mark with the number of the equation, which `headed` makes a comment of."""
        source = self._origins.get(node)
        if source is None:
            return []
        return [f"{pad}/*= {self._sources.setdefault(source, len(self._sources))} */"]

    def headed(self, lines: Iterable[str], around: Parsed | None = None) -> list[str]:
        """Lines with a comment where the equation changes that they come from.

        The first one of each equation has the first line of its docstring. None is needed for the
        equation `around` until another has begun.
        """
        introduced = set[Parsed]() if around is None else {around}
        headed = list[str]()
        for source, run in self._runs(lines, around):
            if source is None or not run:
                headed += run
                continue
            pad = run[0][: len(run[0]) - len(run[0].lstrip())]
            summary = first_line(source)
            new = source not in introduced
            introduced.add(source)
            short_run = len(run) < FEW and run[0].endswith(";") and not new
            remark = f"{run[0]} /* {comment_line(source.name)} */"
            if short_run and len(remark) <= WIDTH - 4:
                headed += [remark, *run[1:]]
                continue
            if headed and not headed[-1].endswith("{") and headed[-1]:
                headed.append("")
            text = f"{source.name}: {summary}" if new and summary else source.name
            headed += [*c_comment(text, pad, WIDTH - 4), *run]
        return headed

    def _runs(
        self, lines: Iterable[str], around: Parsed | None
    ) -> list[tuple[Parsed | None, list[str]]]:
        """Lines that come from one equation after the other; ends of branches stay with them."""
        sources = [*self._sources]
        runs: list[tuple[Parsed | None, list[str]]] = [(None, [])]
        last = around
        for line in lines:
            mark = _HEADING.match(line)
            if mark is None:
                runs[-1][1].append(line)
            elif sources[int(mark[1])] is not last:
                last = sources[int(mark[1])]
                runs.append((last, []))
        return runs


def as_double(node: Node, text: Text) -> Text:
    """A value as a double if it is a whole number."""
    if node.kind != "int":
        return text
    if re.fullmatch(r"-?\d+", text[0]):
        return f"{text[0]}.0", text[1]
    return f"(double){grouped(text, UNARY)}", UNARY


def _as_whole_number(node: Node, text: str) -> Text:
    """What a function of doubles returns, as a whole number if it is one."""
    return (f"whole_number({text})" if node.kind == "int" else text), ATOM


def _joined(first: Text, op: str, second: Text) -> Text:
    """Two tests; others among them stand in brackets, as compilers and readers like it."""
    level = LEVELS["and" if op == "&&" else "or"]
    texts = [
        test[0] if test[1] == level else grouped(test, LEVELS["=="]) for test in (first, second)
    ]
    return f" {op} ".join(texts), level


# --- functions ------------------------------------------------------------------------------------


def returned(results: Sequence[tuple[str, Node]]) -> tuple[str, list[str]]:
    """Type of what a function returns, and formals of its results if there are several."""
    kinds = ["bool" if node.kind == "bool" else "double" for _, node in results]
    if len(results) == 1:
        return kinds[0], []
    return "void", [f"{kind} *{name}" for kind, (name, _) in zip(kinds, results, strict=True)]


class Loops:
    """C functions of equations that are done again and again, and of what does them.

    Attributes
    ----------
    texts : list of str
        The functions, each after those that it calls.
    used_names : set of str
        Names of functions, and others that they may not have.
    """

    def __init__(self, used_names: Iterable[str] = ()) -> None:
        self.texts: list[str] = []
        self.used_names = {*WORDS, *used_names}
        self._names: dict[tuple[Any, ...], str] = {}

    def fresh(self, stem: str, used_names: Iterable[str] = ()) -> str:
        """A name for a function."""
        name = fresh_name(c_name(stem), {*self.used_names, *used_names})
        self.used_names.add(name)
        return name

    def name_of(self, loop: Any, used_names: set[str]) -> str:
        """Name of the function that does a loop."""
        inner: Inner = loop.inner
        results = [node for _, node in leaves(inner.result)]
        formals = (*inner.leading.items(), *inner.formals.items())
        key = loop.kind, inner.name, formals, *self._values_of(results, used_names)
        if key not in self._names:
            name = self.fresh(inner.source.name, used_names)
            self.texts.append(self.function(name, inner))
            if loop.kind == "once":
                self._names[key] = name
                used_names.add(name)
                return name
            outer = self.fresh(
                f"{'root_of' if loop.kind == 'root' else 'repeated'}_{name}", used_names
            )
            write = self._root if loop.kind == "root" else self._repeated
            self.texts.append(write(outer, name, inner))
            self._names[key] = outer
            used_names |= {name, outer}
        return self._names[key]

    def _values_of(self, results: Sequence[Node], used_names: set[str]) -> list[Node]:
        """What is computed, without the rules of its derivatives: calls by their names."""
        values = dict[Node, Node]()
        for node in graph.ordered(results):
            operands = [values[operand] for operand in node.args]
            value = self.name_of(node.value.loop, used_names) if node.op == "call" else node.value
            values[node] = (
                operands[0]
                if node.op == "ruled"
                else graph.make(node.op, *operands, value=value, kind=node.kind)
            )
        return [values[result] for result in results]

    def function(self, name: str, inner: Inner) -> str:
        """An equation as a function of scalars; several results go to where pointers say."""
        results = [
            (f"next_{path}" if path else "next", node) for path, node in leaves(inner.result)
        ]
        results = [(c_name(path.replace(".", "_")), node) for path, node in results]
        formals = {**inner.leading, **inner.formals}
        return scalar_function(
            self, name, inner.source, inner.origins, inner.labels, formals, results
        )

    def _root(self, name: str, residual: str, inner: Inner) -> str:
        reserved = {"low", "high", "x_1", "x_2", "x_3", "f_1", "f_2", "f_3", "t", "x", "f", "best"}
        used_names = {*WORDS, *reserved, "smallest", "reach", "xi", "phi", "steps", residual}
        others = [
            (kind, fresh_name(c_name(formal), used_names)) for formal, kind in inner.formals.items()
        ]
        words = {
            "name": name,
            "residual": residual,
            "formals": "".join(f", {TYPES[kind]} {formal}" for kind, formal in others),
            "given": "".join(f", {formal}" for _, formal in others),
            "steps": STEPS,
            "precision": c_literal(PRECISION),
            "tiny": c_literal(TINY),
        }
        lines = filled(ROOT, words).rstrip("\n").split("\n")
        return "\n".join(part for line in lines for part in wrapped(line))

    def _repeated(self, name: str, step: str, inner: Inner) -> str:
        *state, number = inner.leading
        used_names = {*WORDS, "count", step}
        others = [
            (kind, fresh_name(c_name(formal), used_names)) for formal, kind in inner.formals.items()
        ]
        state_names = [fresh_name(c_name(formal), used_names) for formal in state]
        number = fresh_name(c_name(number), used_names)
        formals = ["double count", *(f"{TYPES[kind]} {formal}" for kind, formal in others)]
        formals += [f"double *{formal}" for formal in state_names]
        arguments = [*(f"*{formal}" for formal in state_names), f"(double){number}"]
        arguments += [formal for _, formal in others]
        if len(state_names) == 1:
            line = f"    *{state_names[0]} = {step}({', '.join(arguments)});"
        else:
            line = f"    {step}({', '.join([*arguments, *state_names])});"
        head = f"static void {name}({', '.join(formals)})"
        loop = f"for (long long {number} = 0; {number} < whole_number(count); {number}++) {{"
        return c_function(f"{inner.source.name}, repeated.", head, [loop, line, "}"])


def scalar_function(
    functions: Loops,
    name: str,
    source: Parsed,
    origins: Mapping[Node, Parsed],
    labels: Mapping[Node, str],
    formals: Mapping[str, str],
    results: Sequence[tuple[str, Node]],
) -> str:
    """An equation as a C function of scalars.

    `formals` are its arguments with their kinds. A single result is returned; several go to where
    the last arguments point, named as in `results`.
    """
    result_type, pointers = returned(results)
    used_names = {*functions.used_names, name, *(path for path, _ in results)}
    words = {formal: re.sub(r"[.\[\]]+", "_", formal).strip("_") for formal in formals}
    names = {formal: fresh_name(c_name(word), used_names) for formal, word in words.items()}
    available = {graph.name(formal, kind): names[formal] for formal, kind in formals.items()}
    language = C(functions, origins, used_names)
    c_labels = {
        node: "result" if label == source.name else c_name(label) for node, label in labels.items()
    }
    nodes = [node for _, node in results]
    block = CodeBlock(nodes, c_labels, used_names, available=available, language=language)
    lines = language.headed(block.lines, source)
    used = without_comments("\n".join([*block.lines, *block.texts]))
    unused = [f"(void){formal};" for formal in names.values() if not mentions(used, formal)]
    unused += [""] if unused and lines else []
    values = [as_double(node, (text, 0))[0] for node, text in zip(nodes, block.texts, strict=True)]
    if len(results) == 1:
        lines.append(f"return {values[0]};")
    else:
        lines += [f"*{path} = {text};" for (path, _), text in zip(results, values, strict=True)]
    declared = [f"{TYPES[kind]} {names[formal]}" for formal, kind in formals.items()]
    head = f"static {result_type} {name}({', '.join([*declared, *pointers]) or 'void'})"
    return c_function(first_line(source), head, [*unused, *lines])


def mentions(text: str, name: str) -> bool:
    """Whether a name stands in a text of C, not as a member of something else."""
    return re.search(rf"(?<!->)(?<!\.)\b{re.escape(name)}\b", text) is not None


def without_comments(text: str) -> str:
    """A text of C without its comments."""
    return re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
