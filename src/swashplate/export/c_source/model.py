"""C99 of a whole model: its equations, a struct for its numbers, and functions around one sample.

The C does at every sample what a stepper does: it puts the newest inputs into their delay lines,
samples every part in the order of the flow, and then takes all states to the next sample.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import get_type_hints

import numpy as np
from numpy.typing import NDArray

from swashplate.export.c_source.exported import Exported
from swashplate.export.c_source.layout import Layout, path_of
from swashplate.export.c_source.parts import PartInC
from swashplate.export.c_source.structs import noted, notes_of, struct
from swashplate.machine import Definition, Link, Machine, SignalSource, graph
from swashplate.machine.code_generation import (
    GENERATING,
    C,
    CodeBlock,
    Trace,
    c_function,
    c_literal,
    c_name,
    first_line,
    fresh_name,
    node_of,
)
from swashplate.machine.fields import declared_by, value_at
from swashplate.machine.graph import names_in
from swashplate.machine.language import parsed
from swashplate.machine.marching import (
    MOST_PASSES,
    SETTLED,
    CodeForm,
    SampleCode,
    TapOf,
    output_of,
)
from swashplate.machine.model import arguments_of

Array = NDArray[np.float64]

# --- source ---------------------------------------------------------------------------------------


class Writer:
    """C functions of a model, around one sample, and its structs.

    Attributes
    ----------
    layout : Layout
        Where the C keeps the model's numbers.
    parts : list of PartInC
        The parts of the model.
    core : list of str
        The functions, in the order in which C needs them.
    """

    def __init__(self, exported: Exported) -> None:
        self.exported, self.model = exported, exported.model
        self.layout = layout = Layout(exported)
        self.P = layout.P
        self.structs, self.loops = layout.structs, layout.loops
        self.tags = layout.tags
        self.links: dict[str, str] = {}
        self._link_names: dict[str, str] = {}
        self.parts = [PartInC(layout, index) for index in range(len(self.model.parts))]
        self.constants: list[str] = []
        """Structs of constants."""
        for part_in_c, tags in zip(self.parts, self.tags, strict=True):
            if part_in_c.constants:
                tags["constants"] = self.structs.fresh(f"{part_in_c.member}_constants")
                self.constants.append(self._constants(part_in_c, tags["constants"]))
        self.core = self._functions()

    def _constants(self, part: PartInC, tag: str) -> str:
        """Struct of what follows from a part's parameters, options and the step."""
        fields = []
        for node, name in part.constants.items():
            fields.append((f"double {name};", part.constant_note(node)))
        part_name = part.part_model.name
        description = (
            f"What follows from the parameters of the {part_name}, its options and the step."
        )
        return struct(description, tag, fields)

    # -- the sample --------------------------------------------------------------------------------

    def _functions(self) -> list[str]:
        """The functions around one sample."""
        functions = [self._updates(), self._sampled(), *self._starts(False)]
        functions += self._starts(True) if self.exported.settles else []
        ends = [self._finite_states(), self._finite_outputs(), self._sample()]
        return [*self.loops.texts, *self.links.values(), *functions, *ends]

    def _link(self, link: Link) -> str:
        """A signal that is made of those of several parts, at the last sample."""
        if link.equation is None:
            return self.layout.place(link.sources[0], "before")
        name = c_name(link.name)
        if name not in self.links:
            trace = Trace(replacements=self.model.replacements)
            sources = [graph.name(self.layout.place(source, "before")) for source in link.sources]
            arguments = dict(zip(arguments_of(link.equation), sources, strict=True))
            signal = node_of(trace.call(link.equation, arguments))
            assert signal is not None
            used_names = {*self.loops.used_names, "m"}
            labels = {node: c_name(label) for node, label in trace.labels.items()}
            language = C(self.loops, trace.origins, used_names)
            block = CodeBlock([signal], labels, used_names, language=language)
            function_name = self.loops.fresh(name)
            lines = [*language.headed(block.lines), f"return {block.texts[0]};"]
            description = first_line(trace.callee(link.equation).source)
            head = f"static double {function_name}(const {self.exported.type} *m)"
            self.links[name] = c_function(description, head, lines)
            self._link_names[name] = function_name
        return f"{self._link_names[name]}(m)"

    def _linked(self, tap: TapOf) -> str:
        """The signal between parts that a tap reads, at the last sample."""
        link = self.model.link_of(tap.part, tap.input)
        assert link is not None
        return self._link(link)

    def _sampled(self) -> str:
        """A sample of each part."""
        return "\n\n".join(part.sample() for part in self.parts)

    def _windows(
        self, part: PartInC, used_names: set[str], *, constant: bool
    ) -> tuple[list[str], list[str]]:
        """Declarations of what a part sees through its taps, and their names."""
        lines, names = [], []
        for tap in part.windows:
            line = self.exported.line_of(tap)
            seen = f"read_window(m, {tap.number}, {line}, {tap.tap.samples})"
            text = f"constant_window(m->before_record[{line}])" if constant else seen
            name = fresh_name(f"{part.member}_{c_name(tap.input)}", used_names)
            lines.append(f"const struct {self.exported.prefix}_window {name} = {text};")
            names.append(f"&{name}")
        return lines, names

    def _sample(self) -> str:
        """One sample of the whole model."""
        body: list[str] = []
        used_names = {*self.loops.used_names}
        margins = any(part.part.margin is not None for part in self.parts)
        for part in self.parts:
            body += [self._kept(tap) for tap in part.part.between if not tap.tap.late]
            lines, windows = self._windows(part, used_names, constant=False)
            arguments = ["m", f"&m->now.{part.member}", *windows]
            call = f"{part.names['sample']}({', '.join(arguments)})"
            holds = part.part.margin is not None
            body += [*lines, f"good = {call} && good;" if holds else f"{call};"]
        body += dict.fromkeys(self._kept(tap) for tap in self.late)
        for name, signal in self.model.integrals.items():
            rate = self.output(signal)
            integral = self.exported.integrals[name]
            body.append(f"m->now.{integral}_rate = {rate};")
            rates = f"(m->before.{integral}_rate + m->now.{integral}_rate)"
            grown = f"m->before.{integral} + 0.5 * m->step * {rates}"
            body.append(f"m->now.{integral} = m->before.started ? {grown} : 0.0;")
        body.append("m->now.started = true;")
        tests = ["all_finite(&m->now)", "finite_outputs(m)"]
        if margins:
            tests.insert(0, "good")
            body.insert(0, "bool good = true;")
        body.append(f"return {' && '.join(tests)} ? {self.P}_OK : {self.P}_DOMAIN;")
        description = "One sample: everything at this instant, then all states to the next."
        head = f"static int one_sample({self.exported.type} *m)"
        return c_function(description, head, body)

    @property
    def late(self) -> list[TapOf]:
        """Taps on signals between parts that come later, in the order of the parts."""
        return [tap for part in self.parts for tap in part.part.between if tap.tap.late]

    def _kept(self, tap: TapOf) -> str:
        """A statement that keeps what a tap reads later of a signal between parts, at a sample."""
        return self._put(tap, self._linked(tap), "m->line[{}][m->newest] = {};", "put_past")

    def _put(self, tap: TapOf, value: str, in_line: str, in_ring: str) -> str:
        """A statement that puts a value where a tap reads it."""
        exported = self.exported
        if tap.tap.passed_on:
            return f"m->now.{exported.registers[tap.between]} = {value};"
        if tap.tap.longest:
            return f"{in_ring}(m, {exported.ring_of(tap)}, {value});"
        return in_line.format(exported.line_of(tap), value)

    def _held(self, tap: TapOf, value: str) -> list[str]:
        """Statements after which a signal between parts has always had a value."""
        lines = [self._put(tap, value, "fill_line(m, {}, {});", "fill_past")]
        if tap.tap.passed_on:
            register = self.exported.registers[tap.between]
            lines.append(f"m->before.{register} = m->now.{register};")
        return lines

    def _before(self, tap: TapOf) -> str:
        """What a signal between parts was before the first sample, at rest."""
        return self.layout.parameter(tap.part, tap.tap.before) if tap.tap.before else "0.0"

    def _starts(self, settled: bool) -> list[str]:
        """States at the first sample, at rest or settled: of each part, and of all."""
        texts = [part.start(settled) for part in self.parts]
        body = self._passed(settled, texts)
        description = "settled under what it was given" if settled else "at rest"
        name = "settled_start" if settled else "rested_start"
        returned = "void"
        if settled and self.late:
            returned, body = "bool", self._until_settled(body)
        elif not settled:
            stated = [tap for part in self.parts for tap in part.part.between]
            stated = [tap for tap in stated if tap.tap.before or tap.tap.passed_on]
            ahead = [line for tap in stated for line in self._held(tap, self._before(tap))]
            body = [*dict.fromkeys(ahead), *body]
        head = f"static {returned} {name}({self.exported.type} *m)"
        return [*texts, c_function(f"States before the first sample, {description}.", head, body)]

    def _until_settled(self, body: Sequence[str]) -> list[str]:
        """Statements of passes over the parts until what comes late no longer changes."""
        late = {tap.between: tap for tap in self.late}
        values, found = (
            ", ".join(map(text, late.values())) for text in (self._before, self._linked)
        )
        place, count = {between: index for index, between in enumerate(late)}, len(late)
        held = [
            line
            for tap in self.late
            for line in self._held(tap, f"late_values[{place[tap.between]}]")
        ]
        change = "fabs(found_values[i] - late_values[i])"
        return [
            f"double late_values[{count}] = {{{values}}};",
            f"double largest_values[{count}] = {{0.0}};",
            f"for (int passes = 0; passes < {MOST_PASSES}; passes++) {{",
            *(f"    {line}" for line in [*dict.fromkeys(held), *body]),
            f"    const double found_values[{count}] = {{{found}}};",
            "    bool is_settled = true;",
            f"    for (int i = 0; i < {count}; i++) {{",
            "        largest_values[i] = greater_of(largest_values[i], fabs(found_values[i]));",
            f"        is_settled = is_settled && {change} <= {SETTLED!r} * largest_values[i];",
            "        late_values[i] = found_values[i];",
            "    }",
            "    if (is_settled) {",
            "        return true;",
            "    }",
            "}",
            "return false; /* the parts act back on each other and do not settle */",
        ]

    def _passed(self, settled: bool, texts: Sequence[str]) -> list[str]:
        """Statements that give each part its state at the start, in the order of the flow."""
        word = "settled" if settled else "rest"
        body: list[str] = []
        used_names = {*self.loops.used_names}
        for index, part in enumerate(self.parts):
            if settled:
                body += self._filled(part)
            body.append(f"{part.names[word]}(m);")
            later = "\n".join(texts[index + 1 :])
            if settled:
                filled = [line for each in self.parts[index + 1 :] for line in self._filled(each)]
                later = "\n".join([later, *filled, *map(self._linked, self.late)])
            later = "\n".join([later, *self._links_in(later)])
            if f"m->{part.member}_signals" in later or f"m->before.{part.member}." in later:
                lines, windows = self._windows(part, used_names, constant=True)
                following = fresh_name(f"{part.member}_next", used_names)
                arguments = ", ".join(["m", f"&{following}", *windows])
                body += [
                    f"m->before.{part.member} = m->now.{part.member};",
                    *lines,
                    f"struct {self.tags[index]['state']} {following}; /* not needed */",
                    f"{part.names['sample']}({arguments});",
                ]
        return body

    def _links_in(self, text: str) -> Iterator[str]:
        """Texts of the signals of several parts that a text calls."""
        for name, function_name in self._link_names.items():
            if f"{function_name}(m)" in text:
                yield self.links[name]

    def _filled(self, part: PartInC) -> list[str]:
        """Statements that fill the lines of signals between parts with what they are."""
        taps = [tap for tap in part.part.between if not tap.tap.late]
        return [line for tap in taps for line in self._held(tap, self._linked(tap))]

    def _updates(self) -> str:
        """What follows from parameters and step: options, constants, places of the taps."""
        texts: list[str] = []
        options: list[str] = []
        checks: list[str] = []
        for (part_index, name), equation in self.exported.follows.items():
            member = self.exported.members[part_index]
            function_name = self.loops.fresh(f"{member}_{name}")
            texts.append(self.parts[part_index].decided(function_name, equation))
            options.append(f"m->{member}_options.{c_name(name)} = {function_name}(m);")
        for part_index, equation in self.exported.stable.items():
            function_name = self.loops.fresh(f"{self.exported.members[part_index]}_stable")
            texts.append(self.parts[part_index].decided(function_name, equation))
            checks += [
                f"if (!({function_name}(m) > 0.0)) {{",
                f"    return {self.P}_UNSTABLE;",
                "}",
            ]
        misplaced = [self._misplaced(tap) for tap in self.exported.taps if not tap.tap.passed_on]
        if misplaced:
            test = f"if ({' || '.join(misplaced)}) {{"
            checks += [test, f"    return {self.P}_BAD_DELAY;", "}"]
        description = "Options, stability and delays of these parameters and this step."
        body = [*options, *checks]
        body = [*(body or ["(void)m;"]), f"return {self.P}_OK;"]
        texts.append(
            c_function(description, f"static int check_parameters({self.exported.type} *m)", body)
        )
        parts_with_constants = [part for part in self.parts if part.constants]
        texts += [part.computed() for part in parts_with_constants]
        description, head = (
            "Constants of these parameters and this step.",
            "static void compute_constants",
        )
        calls = [f"{part.names['constants']}(m);" for part in parts_with_constants] or ["(void)m;"]
        texts.append(c_function(description, f"{head}({self.exported.type} *m)", calls))
        return "\n\n".join(texts)

    def _misplaced(self, tapped: TapOf) -> str:
        """A test whether a tap reads beyond its line; it sets where it reads."""
        part, _, number, tap, _ = tapped
        delay = self.layout.parameter(part, tap.delay) if tap.delay else "0.0"
        ahead = c_literal(float(tap.ahead))
        if tap.longest:
            longest = self.layout.parameter(part, tap.longest)
            ring = self.exported.ring_of(tapped)
            return f"!place_past(m, {number}, {ring}, {delay}, {ahead}, {tap.late}, {longest})"
        if tap.late:
            return f"!place_late(m, {number}, {delay}, {ahead}, {tap.samples}, {tap.late})"
        return f"!place_tap(m, {number}, {delay}, {ahead}, {tap.samples})"

    def _finite_states(self) -> str:
        """Whether all states are finite: without a branch for each."""
        members = self.exported.members
        states = [
            f"s->{members[part_index]}.{path_of(path)}"
            for part_index, path in self.model.places("state")
        ]
        description = "Whether all states are finite: what is not leaves no zero behind."
        head = f"static bool all_finite(const struct {self.exported.prefix}_memory *s)"
        return c_function(description, head, _finite(states, "s"))

    def _finite_outputs(self) -> str:
        description = "Whether all outputs of the sample are finite."
        head = f"static bool finite_outputs(const {self.exported.type} *m)"
        return c_function(description, head, _finite([*map(self.output, self.exported.names)], "m"))

    # -- what is said of numbers -------------------------------------------------------------------

    def output_note(self, name: str) -> str:
        """What an output is."""
        if name in self.model.integrals:
            return f"integral of {self.model.integrals[name]}, 0 at the first sample"
        stored, _ = output_of(self.model, name)
        if stored.kind == "link":
            link = self.model.links[stored.path]
            return "" if link.equation is None else first_line(parsed(link.equation))
        part = self.model.parts[stored.part]
        kind = part.signals if stored.kind == "signals" else part.state
        return notes_of(kind).get(stored.path, "")

    def input_note(self, name: str) -> str:
        """What an external signal is."""
        if name in self.exported.notes:
            return self.exported.notes[name]
        if name in self.model.input_definitions:
            return noted(self.model.input_definitions[name])
        for part in self.model.parts:
            for input_name in part.input_types:
                if part.tap(input_name).signal == name and part.inputs is not None:
                    return notes_of(part.inputs).get(input_name, "")
        return ""

    def option_note(self, part: int, name: str) -> str:
        """What an option is."""
        return notes_of(self.model.parts[part].options).get(name, "")

    def limit_note(self, part: int, name: str) -> str:
        """What a limit is."""
        limits = self.model.parts[part].limits
        assert limits is not None
        return notes_of(get_type_hints(limits)["return"]).get(name, "")

    # -- numbers -----------------------------------------------------------------------------------

    def output(self, name: str) -> str:
        """Where an output is read."""
        if name in self.model.integrals:
            return f"m->now.{self.exported.integrals[name]}"
        stored, _ = output_of(self.model, name)
        if stored.kind == "link":
            return self._link(self.model.links[stored.path])
        return self.layout.place(SignalSource(stored.part, stored.path), "before")

    def ranges(self) -> Iterator[tuple[str, str, Definition]]:
        """Name, place and definition of each parameter."""
        definitions: dict[tuple[int, str], Definition] = {}
        for part_index, part in enumerate(self.model.parts):
            for definition in declared_by(part.parameters):
                definitions |= {(part_index, path): definition for path in definition.fields}
        for part_index, path, name in self.exported.named("parameters"):
            member_path = f"{self.exported.members[part_index]}.{path_of(path)}"
            yield name, member_path, definitions.get((part_index, path), Definition(name, ""))

    def values(self) -> list[tuple[str, str]]:
        """Name and place of every parameter, given and option, as an initialisation takes them."""
        named_members = [(name, member_path) for name, member_path, _ in self.ranges()]
        for part_index, path, name in self.exported.named("given"):
            named_members.append(
                (name, f"{self.exported.members[part_index]}_given.{path_of(path)}")
            )
        for part_index, name in self.exported.options:
            named_members.append(
                (name, f"{self.exported.members[part_index]}_options.{c_name(name)}")
            )
        return named_members

    def constant_names(self) -> list[str]:
        """Names of the constants, which an initialisation takes after the values."""
        return [f"{part.member} {name}" for part in self.parts for name in part.constants.values()]

    def first_constant(self, number: int) -> int:
        """Index of the first constant of a part."""
        return sum(len(part.constants) for part in self.parts[:number])


@lru_cache(maxsize=16)
def writer_of(exported: Exported) -> Writer:
    """Writer of a model's C, kept for the last models: text, numbers and names all ask for it."""
    with GENERATING:
        return Writer(exported)


def numbers(exported: Exported, instance: Machine, step: float) -> Array:
    """All numbers that the C ``init`` takes, as Python computes them."""
    options = [
        option is not None
        for model, part in zip(instance.model.parts, instance.parts, strict=True)
        if model.options is not None
        for option in part.options
    ]
    writer = writer_of(exported)
    params, given = instance.params.tolist(), instance.given.tolist()
    with GENERATING:
        constants = [
            value
            for part in writer.parts
            for value in part.constant_values(params, given, options, step)
        ]
    return np.array([step, *params, *given, *options, *constants])


def _finite(members: Sequence[str], owner: str) -> list[str]:
    """Statements that return whether all numbers are finite, without a branch for each."""
    lines = [f"none += {member} - {member};" for member in members] or [f"(void){owner};"]
    return ["double none = 0.0;", *lines, "return none == 0.0;"]


# --- feedthrough ----------------------------------------------------------------------------------


def feedthrough(exported: Exported, instance: Machine, step: float) -> dict[str, frozenset[str]]:
    """External signals that each output follows at the same sample, with these options and delays.

    One that is read through a tap counts if the window reaches its newest sample.
    """
    model, at_once = exported.model, newest(exported, instance, step)
    observed = [output_of(model, name)[0] for name in exported.names]
    sample_code = SampleCode(model, CodeForm(model.external, instance.options), observed)
    signals = {f"x_{name}": name for name in model.external}
    for part in sample_code.used:
        signals |= {
            part.tap_samples(tap)[0]: tap.tap.signal
            for tap in part.taps
            if tap.between < 0 and tap.tap.signal in at_once
        }
    sources = {
        sample_code.parts[source.part].source(source): node
        for source, node in sample_code.sources.items()
    }
    sources |= {
        part.tap_samples(tap)[0]: part.tapped(tap)
        for part in sample_code.used
        for tap in part.between
        if _is_newest(tap, instance, step)
    }
    inputs_of = {}
    for name, stored in zip(exported.names, observed, strict=True):
        read = set[str]()
        pending = [sample_code.observed(sample_code.parts[stored.part], stored)]
        while pending:
            names = names_in([pending.pop()])
            pending += [sources[source] for source in (names & sources.keys()) - read]
            read |= names
        inputs_of[name] = frozenset(
            signals[newest_sample] for newest_sample in read & signals.keys()
        )
    return inputs_of


def newest(exported: Exported, instance: Machine, step: float) -> dict[str, tuple[float, float]]:
    """Signals that are read at their newest sample: delay [s], and steps that would be enough."""
    outside = [tap for tap in exported.taps if tap.between < 0]
    steps = dict[str, float]()
    for tapped in outside:
        signal, enough = tapped.tap.signal, 1.0 + tapped.tap.ahead
        steps[signal] = max(enough, steps.get(signal, 0.0))
    return {
        tapped.tap.signal: (_delay(tapped, instance), steps[tapped.tap.signal])
        for tapped in outside
        if _is_newest(tapped, instance, step)
    }


def _delay(tapped: TapOf, instance: Machine) -> float:
    """Delay of a tap. [s]"""
    name = tapped.tap.delay
    return float(value_at(instance.parts[tapped.part].p, name)) if name else 0.0


def _is_newest(tapped: TapOf, instance: Machine, step: float) -> bool:
    """Whether a tap reads the newest sample of its signal."""
    if tapped.tap.late:
        return False
    return _delay(tapped, instance) < (1.0 + tapped.tap.ahead) * step * (1.0 - 1e-12)
