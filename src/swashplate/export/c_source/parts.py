"""C functions of one part of a model, printed from the graph of its equations.

Each purpose is one function: the constants that follow from parameters and step, one sample with
all that is known at it and the next state, the start, and what options follow from.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, get_type_hints

from swashplate.equations import graph
from swashplate.equations.code_generation.functions import FUNCTIONS, RESERVED, Function, fresh_name
from swashplate.equations.code_generation.printing import STEMS, CodeBlock, assigned
from swashplate.equations.code_generation.printing_c import (
    C,
    as_double,
    c_name,
    function,
    literal,
    mentions,
    without_comments,
)
from swashplate.equations.code_generation.scheduling import FEW
from swashplate.equations.code_generation.tracing import Trace
from swashplate.equations.code_generation.values import Tuple, Value, fixed, leaves, undecided
from swashplate.equations.graph import LEAVES, MATH_FUNCTIONS, Node, names_in, ordered
from swashplate.equations.language import Parsed
from swashplate.equations.marching.part_code import PartCode
from swashplate.equations.model import Equation, SignalSource, arguments_of

if TYPE_CHECKING:
    from swashplate.export.c_source.model import Writer

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
    windows : list of str
        Names of what the part looks through, for each of its taps.
    names : dict of str to str
        Names of its functions by their purposes.
    """

    def __init__(self, writer: Writer, number: int) -> None:
        self.w, self.number = writer, number
        model = writer.e.model
        self.own, self.member = model.parts[number], writer.e.members[number]
        kind = self.own.options
        self.options: dict[str, Node] = {}
        self._symbols: Any = None
        if kind is not None:
            hints = get_type_hints(kind)
            flags = [
                undecided(hints[name], f"{kind.__name__}.{name}", f"option {self.member}.{name}")
                for name in kind._fields
            ]
            self.options = {
                each: flag.value for each, flag in zip(kind._fields, flags, strict=True)
            }
            self._symbols = kind(*flags)
        self._trace(self.trace())
        self._trace(self.trace(outlined=formulas(self.part.trace)))
        own = {*OWN}
        self.windows = [
            fresh_name(c_name(tap.input if tap.tap.width else f"{tap.input}_window"), own)
            for tap in self.part.taps
        ]
        self.names = {
            word: writer.loops.fresh(f"{self.member}_{word}")
            for word in ("constants", "sample", "rest", "settled")
        }
        ends = [node for nodes in self.results.values() for _, node in nodes]
        ends += [] if self.part.margin is None else [self.part.margin]
        for node in ordered(ends):
            if node.op == "call":
                writer.loops.name_of(node.value.loop, set())
        self._labels = self.labels(self.part.trace, ends)
        self.constants = self._constants(ends)

    # -- the graph ---------------------------------------------------------------------------------

    def trace(self, outlined: Collection[Parsed] = ()) -> Trace:
        """What runs the part's equations on symbols."""
        return Trace(outlined, self.own.replacements)

    def _trace(self, trace: Trace) -> None:
        """Run the equations of a sample on symbols."""
        model = self.w.e.model
        self.part = PartCode(model, self.number, model.external, self._symbols, trace=trace)
        self.results = self._results()

    def traced(self, equation: Equation, trace: Trace) -> Value:
        """What an equation of the part returns."""
        known = dict(self.part.arguments)
        if (options := fixed(self._symbols)) is not None:
            known["options"] = options
        given = {name: known[name] for name in arguments_of(equation) if name in known}
        return trace.call(equation, given)

    def _results(self) -> dict[str, list[tuple[str, Node]]]:
        """Paths and nodes of what a sample computes: signals, limits, the next state."""
        part, own = self.part, self.own
        limits = Tuple(None, ()) if own.limits is None else self.traced(own.limits, part.trace)
        return {
            "signals": [*leaves(part.arguments.get("signals", Tuple(None, ())))],
            "limits": [*leaves(limits)],
            "next": [*leaves(part.following)],
        }

    def labels(self, trace: Trace, ends: Iterable[Node]) -> dict[Node, str]:
        """What values are called, after the group of parameters and states that they follow."""
        groups = {}
        for value in (self.part.p, self.part.state):
            for path, node in leaves(value):
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
        still = {node.value for node in self.options.values()}
        taken = set[str]()
        found = dict[Node, str]()
        pending = self.part.ahead(ends, still)[::-1]
        while pending:
            node = graph.plain_value(pending.pop())
            if node in found or node.op in (*LEAVES, "call"):
                continue
            if not names_in([node]) - still:
                continue
            named = node in self._labels and node.kind == "float"
            if not named and not any(each.op in (*LIBRARY, "call") for each in ordered([node])):
                continue
            if named or node.op in LIBRARY or node.op == "result":
                stem = self._labels.get(node) or STEMS.get(node.op, node.op)
                found[node] = fresh_name(c_name(stem), taken)
            else:
                pending += node.args[::-1]
        return found

    # -- places ------------------------------------------------------------------------------------

    def places(self) -> dict[Node, str]:
        """What numbers of the part are called in C."""
        known = dict[Node, str]()
        for word, value in (("p", self.part.p), ("given", self.part.given)):
            known |= {node: f"{word}->{path_of(path)}" for path, node in leaves(value)}
        known |= {node: f"state->{path_of(path)}" for path, node in leaves(self.part.state)}
        known |= {node: f"options->{c_name(name)}" for name, node in self.options.items()}
        known |= {node: f"k->{name}" for node, name in self.constants.items()}
        for i, part in enumerate(self.w.e.model.parts[: self.number]):
            for path in part.signal_names:
                source = SignalSource(i, path)
                known[graph.name(self.part.source(source))] = self.w.place(source, "before")
        return known

    def pointers(self) -> dict[str, str]:
        """Declarations of what a function reads and writes, by the names that they make."""
        member, tags = self.member, self.w.tags[self.number]
        found = {"p": f"const struct {tags['']} *p = &m->{member};"}
        for word, name in (("constants", "k"), ("options", "options"), ("given", "given")):
            if word in tags:
                found[name] = f"const struct {tags[word]} *{name} = &m->{member}_{word};"
        found["state"] = f"const struct {tags['state']} *state = &m->before.{member};"
        for word in ("signals", "limits"):
            if word in tags:
                found[word] = f"struct {tags[word]} *{word} = &m->{member}_{word};"
        found["h"] = "const double h = m->step; /* [s] */"
        return found

    def body(
        self,
        trace: Trace,
        results: Mapping[str, Sequence[tuple[str, Node]]],
        known: Mapping[Node, str],
        inputs: Mapping[Node, tuple[str, str]],
        last: Node | None = None,
        pointers: Mapping[str, str] = MappingProxyType({}),
    ) -> list[str]:
        """Lines that compute results and put them in their places, as ``next->`` and the path.

        `inputs` are values that get their names ahead, each with its name and its text. The `last`
        of all is returned. `pointers` are further declarations, or others, by name.
        """
        taken = {*self.w.loops.taken, *OWN, *self.windows}
        names = {node: fresh_name(name, taken) for node, (name, _) in inputs.items()}
        nodes = [node for each in results.values() for _, node in each]
        nodes += [last] if last is not None else []
        language = C(self.w.loops, trace.origins, taken)
        labels = self.labels(trace, nodes)
        block = CodeBlock(nodes, labels, taken, available={**known, **names}, language=language)
        lines, texts = language.headed(block.lines), iter(block.texts)
        for word, each in results.items():
            lines += [""] if each and lines else []
            for path, node in each:
                value = as_double(node, (next(texts), 0))[0]
                lines.append(f"{word}->{path_of(path)} = {value};")
        if last is not None:
            lines.append(f"return {next(texts)};")
        text = without_comments("\n".join(lines))
        ahead = [
            f"const double {names[node]} = {said};"
            for node, (_, said) in inputs.items()
            if mentions(text, names[node])
        ]
        text = "\n".join([*ahead, text])
        declared = {**self.pointers(), **pointers}
        head = [line for name, line in declared.items() if mentions(text, name)] + ahead
        return [*head, *([""] if head and lines else []), *lines]

    def inputs(self, start: bool = False) -> tuple[dict[Node, str], dict[Node, tuple[str, str]]]:
        """What an input is called: places of windows, and texts of values that get a name.

        At a `start` what is read through a line has its value before the record.
        """
        w, model = self.w, self.w.e.model
        places, named = dict[Node, str](), dict[Node, tuple[str, str]]()
        before = {each: f"m->before_record[{k}]" for k, each in enumerate(w.e.lines)}
        for tap, window in zip(self.part.taps, self.windows, strict=True):
            for j, name in enumerate(self.part.tap_samples(tap)):
                signal = tap.tap.signal
                places[graph.name(name)] = before[signal] if start else f"{window}->s[{j}]"
            places[graph.name(self.part.delay_fraction(tap))] = "0.0" if start else f"{window}->f"
        for name in self.own.input_types:
            node, signal = self.part.inputs[name], self.own.tap(name).signal
            link, default = model.link_of(self.number, name), self.own.defaults.get(name)
            if not isinstance(node, Node) or node.op == "number":
                continue
            if link is not None:
                if link.equation is None:
                    named[node] = c_name(name), w.place(link.sources[0], "before")
                continue
            text = w.value_of(signal)
            if name in self.own.taps:
                text = before[signal] if start else self._looked(node, places)
            if default is not None:
                given = f"m->inputs.measured[{w.P}_INPUT_{c_name(signal)}].given"
                text = f"{given} ? {text} : p->{path_of(default)}"
            named[node] = c_name(name), text
        return places, named

    def _looked(self, value: Node, places: Mapping[Node, str]) -> str:
        """What a tap makes of its window, as one expression."""
        block = CodeBlock([value], {}, set(), available=places, language=C(self.w.loops, {}, set()))
        assert not block.lines
        return block.texts[0]

    # -- functions ---------------------------------------------------------------------------------

    def sample(self) -> str:
        """One sample: signals, limits, the next state, and whether the equations hold."""
        places, named = self.inputs()
        margin, windows = self.part.margin, self.windows
        holds = None if margin is None else graph.make(">", margin, graph.ZERO)
        known = {**self.places(), **places}
        lines = self.body(self.part.trace, self.results, known, named, holds)
        text = without_comments("\n".join(lines))
        idle = [name for name in ("next", *windows) if not mentions(text, name)]
        tag = self.w.tags[self.number]["state"]
        formals = [f"{self.w.e.type} *m", f"struct {tag} *next"]
        formals += [f"const struct {self.w.e.prefix}_window *{each}" for each in windows]
        back = "void" if margin is None else "bool"
        head = f"static {back} {self.names['sample']}({', '.join(formals)})"
        says = f"A sample of the {self.own.name}: what is known at it, and the state at the next."
        lines = [*(f"(void){name};" for name in idle), *lines]
        return function(says, head, lines if "m->" in text else ["(void)m;", *lines])

    def start(self, settled: bool) -> str:
        """The state at the first sample."""
        equation = self.own.settled if settled else self.own.rest
        word = "settled" if settled else "rest"
        head = f"static void {self.names[word]}({self.w.e.type} *m)"
        tag = self.w.tags[self.number]["state"]
        pointer = f"struct {tag} *next = &m->now.{self.member};"
        if equation is not None:
            places, named = self.inputs(start=True)
            trace = self.trace()
            value = self.traced(equation, trace)
            results = {"next": [*leaves(value)]}
            known = {**self.places(), **places}
            lines = self.body(trace, results, known, named, pointers={"next": pointer})
        else:
            defaults = self.own.state._field_defaults
            lines = [pointer] if self.own.state._fields else []
            for path, _ in leaves(self.part.state):
                first = defaults.get(path.split(".")[0], 0.0)
                for each in path.split(".")[1:]:
                    first = getattr(first, each, 0.0)
                lines.append(f"next->{path_of(path)} = {literal(float(first))};")
        how = "settled under its inputs" if settled else "at rest"
        return function(f"The state of the {self.own.name} {how}.", head, lines or ["(void)m;"])

    def computed(self) -> str:
        """Constants of these parameters, options and this step."""
        head = f"static void {self.names['constants']}({self.w.e.type} *m)"
        known = self.places()
        results = []
        for node, name in self.constants.items():
            del known[node]
            results.append((name, node))
        tag = self.w.tags[self.number]["constants"]
        pointer = f"struct {tag} *k = &m->{self.member}_constants;"
        lines = self.body(self.part.trace, {"k": results}, known, {}, pointers={"k": pointer})
        says = f"What follows from the parameters of the {self.own.name}, its options and the step."
        return function(says, head, lines)

    def decided(self, name: str, equation: Equation) -> str:
        """A function that returns what an equation of parameters, options and step says."""
        trace = self.trace()
        value = self.traced(equation, trace)
        assert isinstance(value, Node)
        known = {k: v for k, v in self.places().items() if k not in self.constants}
        lines = self.body(trace, {}, known, {}, value)
        back = "bool" if value.kind == "bool" else "double"
        says = (equation.__doc__ or "").strip().partition("\n")[0]
        return function(says, f"static {back} {name}(const {self.w.e.type} *m)", lines)

    # -- numbers -----------------------------------------------------------------------------------

    def prepared(self) -> tuple[list[str], dict[str, Function]]:
        """Lines of Python that compute the constants, and the functions that these call.

        They read ``params``, ``given``, ``options`` and ``h``, and fill ``constants``.
        """
        taken = {*FUNCTIONS, *RESERVED, "params", "given", "options", "h", "constants", "prepare"}
        known = {}
        for array, value in (("params", self.part.p), ("given", self.part.given)):
            places = self.w.e.model.places("parameters" if array == "params" else "given")
            for path, node in leaves(value):
                known[node] = f"{array}[{places.index((self.number, path))}]"
        for name, node in self.options.items():
            known[node] = f"options[{self.w.e.options.index((self.number, name))}]"
        block = CodeBlock([*self.constants], self._labels, taken, available=known)
        first = self.w.first_constant(self.number)
        lines = [*block.lines]
        for k, text in enumerate(block.texts):
            lines += assigned(f"constants[{first + k}]", text)
        return lines, block.functions


def path_of(path: str) -> str:
    """A path of Python's as one of C's."""
    return ".".join(c_name(each) for each in path.split("."))


def formulas(trace: Trace) -> set[Parsed]:
    """Equations of numbers alone that a part uses more than once: they become functions of C."""
    found = set()
    for source, calls in trace.calls.items():
        given, back = max(calls, key=lambda each: len(ordered(each[1], each[0])))
        numbers = all(each.kind == "float" for each in (*given, *back))
        plain_arguments = len(given) == len(source.arguments)
        if len(calls) > 1 and numbers and plain_arguments and len(ordered(back, given)) > FEW:
            found.add(source)
    return found
