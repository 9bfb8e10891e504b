"""C functions of one part of a model, printed from the graph of its equations.

Each purpose is one function: the constants that follow from parameters and step, one sample with
all that is known at it and the next state, the start, and what options follow from.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from inspect import getsource
from types import MappingProxyType
from typing import Any, get_type_hints

from swashplate.export.c_source.layout import Layout, path_of
from swashplate.machine import Equation, SignalSource, graph
from swashplate.machine.code_generation import (
    FEW,
    STEMS,
    C,
    CodeBlock,
    Trace,
    Value,
    as_double,
    c_function,
    c_literal,
    c_name,
    first_line,
    fresh_name,
    leaves,
    mentions,
    program_of,
    undecided,
    without_comments,
)
from swashplate.machine.fields import defaults_of
from swashplate.machine.graph import LEAVES, MATH_FUNCTIONS, Node, names_in, ordered
from swashplate.machine.language import Parsed
from swashplate.machine.marching import PartCode, TapOf
from swashplate.machine.model import arguments_of

LIBRARY = {*MATH_FUNCTIONS} - {"sqrt", "floor"}
"""Functions of which libraries differ in the last bit, or that take long."""
OWN = {"m", "p", "k", "h", "options", "given", "state", "next", "signals", "limits", "window"}
"""Names that the functions use themselves, as the equations do."""


class PartInC:
    """A part of a model as C, with options that are decided at run time.

    Attributes
    ----------
    constants : dict of Node to str
        What follows from parameters, givens, options and step alone, with its name.
    windows : dict of TapOf to str
        Names of what the part looks through, for each tap that has a window.
    names : dict of str to str
        Names of its functions by their purposes.
    """

    def __init__(self, layout: Layout, number: int) -> None:
        self.layout, self.number = layout, number
        model = layout.exported.model
        self.part_model, self.member = model.parts[number], layout.exported.members[number]
        kind = self.part_model.options
        self.options: dict[str, Node] = {}
        self._symbols: Any = None
        if kind is not None:
            hints = get_type_hints(kind)
            flags = [
                undecided(hints[name], f"{kind.__name__}.{name}", f"option {self.member}.{name}")
                for name in kind._fields
            ]
            self.options = {name: flag.node for name, flag in zip(kind._fields, flags, strict=True)}
            self._symbols = kind(*flags)
        self._trace(self.trace())
        self._trace(self.trace(outlined=formulas(self.part.trace)))
        used_names = {*OWN}
        self.windows = {
            tap: fresh_name(
                c_name(tap.input if tap.tap.width else f"{tap.input}_window"), used_names
            )
            for tap in self.part.taps
            if tap in layout.exported.windows
        }
        self.names = {
            word: layout.loops.fresh(f"{self.member}_{word}")
            for word in ("constants", "sample", "rest", "settled")
        }
        ends = [node for nodes in self.results.values() for _, node in nodes]
        ends += [] if self.part.margin is None else [self.part.margin]
        for node in ordered(ends):
            if node.op == "call":
                layout.loops.name_of(node.value.loop, set())
        self._labels = self.labels(self.part.trace, ends)
        self.constants = self._constants(ends)

    # -- the graph ---------------------------------------------------------------------------------

    def trace(self, outlined: Collection[Parsed] = ()) -> Trace:
        """What runs the part's equations on symbols."""
        return Trace(outlined, self.part_model.replacements)

    def _trace(self, trace: Trace) -> None:
        """Run the equations of a sample on symbols."""
        model = self.layout.exported.model
        self.part = PartCode(model, self.number, model.external, self._symbols, trace=trace)
        self.results = self._results()

    def traced(self, equation: Equation, trace: Trace) -> Value:
        """What an equation of the part returns."""
        values = dict(self.part.arguments)
        values["options"] = self._symbols
        arguments = {name: values[name] for name in arguments_of(equation) if name in values}
        return trace.call(equation, arguments)

    def _results(self) -> dict[str, list[tuple[str, Node]]]:
        """Paths and nodes of what a sample computes: signals, limits, the next state."""
        part, model = self.part, self.part_model
        limits = () if model.limits is None else self.traced(model.limits, part.trace)
        return {
            "signals": [*leaves(part.arguments.get("signals", ()))],
            "limits": [*leaves(limits)],
            "next": [*leaves(part.following)],
        }

    def labels(self, trace: Trace, ends: Iterable[Node]) -> dict[Node, str]:
        """What values are called, after the group of parameters and states that they follow."""
        groups = {}
        for numbers in (self.part.p, self.part.state):
            for path, node in leaves(numbers):
                group, dot, _ = path.rpartition(".")
                groups[node] = f"{group.replace('.', '_')}_" if dot else ""
        several = len({*groups.values()} - {""}) > 1
        follows: dict[Node, set[str]] = {}
        labels = {node: c_name(label.replace(".", "_")) for node, label in trace.labels.items()}
        for node in ordered(ends):
            follows[node] = {groups[node]} if node in groups else set()
            for operand in node.args:
                follows[node] |= follows[operand]
            if several and node in labels and len(follows[node]) == 1:
                (group,) = follows[node]
                labels[node] = group + labels[node].removeprefix(group)
        return labels

    def _constants(self, ends: Sequence[Node]) -> dict[Node, str]:
        """What follows from parameters and step, if it has a name or takes a library's function."""
        option_names = {node.value for node in self.options.values()}
        used_names = set[str]()
        constants = dict[Node, str]()
        pending = self.part.ahead(ends, option_names)[::-1]
        while pending:
            node = graph.plain_value(pending.pop())
            if node in constants or node.op in (*LEAVES, "call"):
                continue
            if not names_in([node]) - option_names:
                continue
            named = node in self._labels and node.kind == "float"
            if not named and not any(
                operand.op in (*LIBRARY, "call") for operand in ordered([node])
            ):
                continue
            if named or node.op in LIBRARY or node.op == "result":
                stem = self._labels.get(node) or STEMS.get(node.op, node.op)
                constants[node] = fresh_name(c_name(stem), used_names)
            else:
                pending += node.args[::-1]
        return constants

    def constant_note(self, node: Node) -> str:
        """What a constant is: the comment at its line in the equation, or the equation's own."""
        origin = self.part.trace.origins.get(node)
        if origin is None:
            return ""
        label = re.escape(self.part.trace.labels.get(node, ""))
        source = getsource(origin.function)
        behind = re.search(rf"^ +{label} = [^#\n]*# *(.+)$", source, re.MULTILINE)
        ahead = re.search(rf"^ +# *([A-Z].+\])\n +{label} = ", source, re.MULTILINE)
        comment = behind or ahead
        return first_line(origin) if not label or comment is None else comment[1]

    # -- places ------------------------------------------------------------------------------------

    def places(self) -> dict[Node, str]:
        """What numbers of the part are called in C."""
        names = dict[Node, str]()
        for word, numbers in (("p", self.part.p), ("given", self.part.given)):
            names |= {node: f"{word}->{path_of(path)}" for path, node in leaves(numbers)}
        names |= {node: f"state->{path_of(path)}" for path, node in leaves(self.part.state)}
        names |= {node: f"options->{c_name(name)}" for name, node in self.options.items()}
        names |= {node: f"k->{name}" for node, name in self.constants.items()}
        for part_index, part in enumerate(self.layout.exported.model.parts[: self.number]):
            for path in part.signal_names:
                source = SignalSource(part_index, path)
                names[graph.name(self.part.source(source))] = self.layout.place(source, "before")
        return names

    def pointers(self) -> dict[str, str]:
        """Declarations of what a function reads and writes, by the names that they make."""
        member, tags = self.member, self.layout.tags[self.number]
        declarations = {"p": f"const struct {tags['']} *p = &m->{member};"}
        for word, name in (("constants", "k"), ("options", "options"), ("given", "given")):
            if word in tags:
                declarations[name] = f"const struct {tags[word]} *{name} = &m->{member}_{word};"
        declarations["state"] = f"const struct {tags['state']} *state = &m->before.{member};"
        for word in ("signals", "limits"):
            if word in tags:
                declarations[word] = f"struct {tags[word]} *{word} = &m->{member}_{word};"
        declarations["h"] = "const double h = m->step; /* [s] */"
        return declarations

    def body(
        self,
        trace: Trace,
        results: Mapping[str, Sequence[tuple[str, Node]]],
        available: Mapping[Node, str],
        inputs: Mapping[Node, tuple[str, str]],
        last: Node | None = None,
        pointers: Mapping[str, str] = MappingProxyType({}),
        pasts: Mapping[Node, str] = MappingProxyType({}),
    ) -> list[str]:
        """Lines that compute results and put them in their places, as ``next->`` and the path.

        `inputs` are values that get their names ahead, each with its name and its text. The `last`
        of all is returned. `pointers` are further declarations, or others, by name. `pasts` are the
        places of what signals with a past were, by what they are.
        """
        used_names = {*self.layout.loops.used_names, *OWN, *self.windows.values()}
        names = {node: fresh_name(name, used_names) for node, (name, _) in inputs.items()}
        nodes = [node for results_of_word in results.values() for _, node in results_of_word]
        nodes += [last] if last is not None else []
        language = C(self.layout.loops, trace.origins, used_names, pasts)
        labels = self.labels(trace, nodes)
        block = CodeBlock(
            nodes, labels, used_names, available={**available, **names}, language=language
        )
        lines, texts = language.headed(block.lines), iter(block.texts)
        for word, results_of_word in results.items():
            lines += [""] if results_of_word and lines else []
            for path, node in results_of_word:
                double = as_double(node, (next(texts), 0))[0]
                lines.append(f"{word}->{path_of(path)} = {double};")
        if last is not None:
            lines.append(f"return {next(texts)};")
        text = without_comments("\n".join(lines))
        ahead = [
            f"const double {names[node]} = {text_of_input};"
            for node, (_, text_of_input) in inputs.items()
            if mentions(text, names[node])
        ]
        text = "\n".join([*ahead, text])
        declared = {**self.pointers(), **pointers}
        head = [line for name, line in declared.items() if mentions(text, name)] + ahead
        if head and lines:
            head.append("")
        return [*head, *lines]

    def inputs(self, start: bool = False) -> tuple[dict[Node, str], dict[Node, tuple[str, str]]]:
        """What an input is called: places of windows, and texts of values that get a name.

        At a `start` what is read through a line has its value before the record.
        """
        layout = self.layout
        model = layout.exported.model
        c_texts: dict[Node, str] = {}
        named: dict[Node, tuple[str, str]] = {}
        before_record = {tap.input: self._before_record(tap) for tap in self.part.taps}
        for tap in self.part.taps:
            for age, name in enumerate(self.part.tap_samples(tap)):
                c_texts[graph.name(name)] = (
                    before_record[tap.input] if start else self._sample_of(tap, age)
                )
            fraction = "0.0" if start or tap not in self.windows else f"{self.windows[tap]}->f"
            c_texts[graph.name(self.part.delay_fraction(tap))] = fraction
        for name in self.part_model.input_types:
            node = self.part.inputs[name]
            signal = self.part_model.tap(name).signal
            link = model.link_of(self.number, name)
            default = self.part_model.defaults.get(name)
            if not isinstance(node, Node) or node.op == "number":
                continue
            if name in before_record:
                text = before_record[name] if start else self._looked(node, c_texts)
            elif link is not None:
                if link.equation is None:
                    named[node] = c_name(name), layout.place(link.sources[0], "before")
                continue
            else:
                text = layout.value_of(signal)
            if default is not None:
                is_set = f"m->inputs.measured[{layout.exported.constants['INPUT_'][signal]}].given"
                text = f"{is_set} ? {text} : p->{path_of(default)}"
            named[node] = c_name(name), text
        return c_texts, named

    def _before_record(self, tap: TapOf) -> str:
        """What a signal was before the first sample."""
        exported = self.layout.exported
        if tap.tap.passed_on:
            return f"m->before.{exported.registers[tap.between]}"
        if tap.tap.longest:
            return f"m->past_before[{exported.ring_of(tap)}]"
        return f"m->before_record[{exported.line_of(tap)}]"

    def _sample_of(self, tap: TapOf, age: int) -> str:
        """A sample of what a tap looks at, the newest of age 0."""
        exported = self.layout.exported
        if tap.tap.passed_on:
            return f"m->before.{exported.registers[tap.between]}"
        if tap.tap.longest:
            return f"past_sample(m, {exported.ring_of(tap)}, m->whole[{tap.number}])"
        return f"{self.windows[tap]}->s[{age}]"

    @property
    def pasts(self) -> dict[Node, str]:
        """Tap and ring of each signal with a past, by what it is now."""
        return {
            graph.name(self.part.tap_samples(tap)[0]): (
                f"m, {tap.number}, {self.layout.exported.ring_of(tap)}"
            )
            for tap in self.part.taps
            if tap.tap.longest
        }

    def _looked(self, value: Node, c_texts: Mapping[Node, str]) -> str:
        """What a tap makes of its window, as one expression."""
        block = CodeBlock(
            [value], {}, set(), available=c_texts, language=C(self.layout.loops, {}, set())
        )
        assert not block.lines
        return block.texts[0]

    # -- functions ---------------------------------------------------------------------------------

    def sample(self) -> str:
        """One sample: signals, limits, the next state, and whether the equations hold."""
        c_texts, named = self.inputs()
        margin, windows = self.part.margin, [*self.windows.values()]
        holds = None if margin is None else graph.make(">", margin, graph.ZERO)
        available = {**self.places(), **c_texts}
        lines = self.body(self.part.trace, self.results, available, named, holds, pasts=self.pasts)
        text = without_comments("\n".join(lines))
        unused = [name for name in ("next", *windows) if not mentions(text, name)]
        tag = self.layout.tags[self.number]["state"]
        formals = [f"{self.layout.exported.type} *m", f"struct {tag} *next"]
        formals += [
            f"const struct {self.layout.exported.prefix}_window *{window}" for window in windows
        ]
        result_type = "void" if margin is None else "bool"
        head = f"static {result_type} {self.names['sample']}({', '.join(formals)})"
        part = self.part_model.name
        description = f"A sample of the {part}: what is known at it, and the state at the next."
        lines = [*(f"(void){name};" for name in unused), *lines]
        return c_function(description, head, lines if mentions(text, "m") else ["(void)m;", *lines])

    def start(self, settled: bool) -> str:
        """The state at the first sample."""
        equation = self.part_model.settled if settled else self.part_model.rest
        word = "settled" if settled else "rest"
        head = f"static void {self.names[word]}({self.layout.exported.type} *m)"
        tag = self.layout.tags[self.number]["state"]
        pointer = f"struct {tag} *next = &m->now.{self.member};"
        if equation is not None:
            c_texts, named = self.inputs(start=True)
            trace = self.trace()
            state = self.traced(equation, trace)
            results = {"next": [*leaves(state)]}
            available = {**self.places(), **c_texts}
            lines = self.body(trace, results, available, named, pointers={"next": pointer})
        else:
            defaults = defaults_of(self.part_model.state)
            lines = [pointer] if self.part_model.state._fields else []
            for path, _ in leaves(self.part.state):
                first = defaults.get(path, 0.0)
                lines.append(f"next->{path_of(path)} = {c_literal(first)};")
        how = "settled under its inputs" if settled else "at rest"
        return c_function(
            f"The state of the {self.part_model.name} {how}.", head, lines or ["(void)m;"]
        )

    def computed(self) -> str:
        """Constants of these parameters, options and this step."""
        head = f"static void {self.names['constants']}({self.layout.exported.type} *m)"
        available = self.places()
        results = []
        for node, name in self.constants.items():
            del available[node]
            results.append((name, node))
        tag = self.layout.tags[self.number]["constants"]
        pointer = f"struct {tag} *k = &m->{self.member}_constants;"
        lines = self.body(self.part.trace, {"k": results}, available, {}, pointers={"k": pointer})
        part = self.part_model.name
        description = f"What follows from the parameters of the {part}, its options and the step."
        return c_function(description, head, lines)

    def decided(self, name: str, equation: Equation) -> str:
        """A function that returns what an equation of parameters, options and step says."""
        trace = self.trace()
        decision = self.traced(equation, trace)
        assert isinstance(decision, Node)
        available = {
            node: text for node, text in self.places().items() if node not in self.constants
        }
        lines = self.body(trace, {}, available, {}, decision)
        result_type = "bool" if decision.kind == "bool" else "double"
        description = (equation.__doc__ or "").strip().partition("\n")[0]
        return c_function(
            description, f"static {result_type} {name}(const {self.layout.exported.type} *m)", lines
        )

    # -- numbers -----------------------------------------------------------------------------------

    def constant_values(
        self, params: Sequence[float], given: Sequence[float], options: Sequence[bool], step: float
    ) -> list[float]:
        """What the constants are for some numbers and options of the whole model."""
        exported = self.layout.exported
        known: dict[str, Any] = {"h": step}
        for numbers, kind, values in (
            (self.part.p, "parameters", params),
            (self.part.given, "given", given),
        ):
            paths = exported.model.places(kind)
            for path, node in leaves(numbers):
                known[node.value] = values[paths.index((self.number, path))]
        for name, node in self.options.items():
            known[node.value] = options[exported.options.index((self.number, name))]
        program = program_of([*self.constants])
        return program.values([known[name] for name in program.arguments])


def formulas(trace: Trace) -> set[Parsed]:
    """Equations of numbers only that a part uses more than once: they become functions of C."""
    repeated = set()
    for source, calls in trace.calls.items():
        arguments, results = max(calls, key=lambda call: len(ordered(call[1], call[0])))
        numbers = all(node.kind == "float" for node in (*arguments, *results))
        plain_arguments = len(arguments) == len(source.arguments)
        if (
            len(calls) > 1
            and numbers
            and plain_arguments
            and len(ordered(results, arguments)) > FEW
        ):
            repeated.add(source)
    return repeated
