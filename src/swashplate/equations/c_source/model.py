"""C99 of a whole model: its equations, a struct for its numbers, and functions around one sample.

The C does at every sample what a stepper does: it puts the newest inputs into their delay lines,
samples every part in the order of the flow, and then takes all states to the next sample.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import inf
from typing import Any, get_type_hints

from swashplate.equations import expressions as ex
from swashplate.equations.c_source.text import c_name, fields_of, function, literal
from swashplate.equations.c_source.unit import Unit
from swashplate.equations.code import Code
from swashplate.equations.fields import Definition, declared_by, floats_of, value_at
from swashplate.equations.language import is_named_tuple, plain
from swashplate.equations.marching.march import Sampler, output_of
from swashplate.equations.marching.part import HOLDS, TapOf, taps_of
from swashplate.equations.marching.run import Instance
from swashplate.equations.model import Equation, Link, Model, Window, arguments_of

OWN = """
number_at put_at is_finite all_finite in_range number_of placed seen constant_window before_all
good_inputs put_inputs taken one_sample rested_start settled_start checked computed switched
ranges value_table option_places parameter_names output_names input_names option_names name_of
one_of flag_at put_flag input_ranges flag_places finite_outputs
"""
PUBLIC = """
size value_count init reset settle step correct output limits set_input clear_input set get
set_option get_option set_step get_step update find find_output find_input find_option
parameter_name output_name sentence valid memory inputs measured value range
"""
"""Names that the interface takes, of its own and behind the prefix."""


@dataclass(frozen=True)
class Exported:
    """A model as C: what its names are, and what goes beyond its equations."""

    model: Model
    prefix: str
    """What all public names begin with: ``swp`` for ``swp_step``."""
    title: str = ""
    """First sentence of the header."""
    parameters: Mapping[str, str] = field(default_factory=dict)
    """Names of parameters by path; by default the paths, with ``_`` for dots."""
    outputs: tuple[str, ...] = ()
    """Signals that can be read; by default all."""
    bounds: Mapping[str, float] = field(default_factory=dict)
    """Largest magnitude of an input."""
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Least and largest value of a measured input."""
    stable: Mapping[int, Equation] = field(default_factory=dict)
    """By part: margin above 0 where its equations bear the step, of ``p, h, options``."""
    follows: Mapping[tuple[int, str], Equation] = field(default_factory=dict)
    """By part and option: whether it is on, of ``p``; it cannot be set."""
    internal: frozenset[str] = frozenset()
    """Options that belong to the equations, and are not for users."""
    longest: float = inf
    """Longest step. [s]"""
    free_step: str = ""
    """Option without which the equations are for one step alone; none if empty."""

    @property
    def file(self) -> str:
        """Name of header and source."""
        own = self.prefix == c_name(self.model.name)
        return self.prefix if own else f"swashplate_{self.model.name}"

    @property
    def type(self) -> str:
        """Name of the struct."""
        own = self.prefix == c_name(self.model.name)
        return f"{self.prefix}_{'model' if own else self.model.name}"

    # -- names -------------------------------------------------------------------------------------

    @cached_property
    def members(self) -> list[str]:
        """Name of each part within the structs."""
        return [c_name(part.name) for part in self.model.parts]

    def named(self, kind: str) -> list[tuple[int, str, str]]:
        """Part, path and name of every number of its parameters or givens."""
        found = []
        for part, path in self.model.places(kind):
            full = f"{self.model.prefix(part)}{path}"
            name = self.parameters.get(full) or full.replace(".", "_")
            found.append((part, path, c_name(name)))
        return found

    @cached_property
    def options(self) -> list[tuple[int, str]]:
        """Part and name of every option."""
        return [
            (i, name)
            for i, part in enumerate(self.model.parts)
            if part.options is not None
            for name in part.options._fields
        ]

    @cached_property
    def switches(self) -> dict[tuple[int, str], list[str]]:
        """By part and option: paths of the parameters that switch it on."""
        found: dict[tuple[int, str], list[str]] = {}
        for i, part in enumerate(self.model.parts):
            for each in declared_by(part.parameters):
                if each.switch:
                    found.setdefault((i, each.switch), []).extend(each.fields)
        return {key: paths for key, paths in found.items() if key in self.options}

    @cached_property
    def settable(self) -> list[tuple[int, str]]:
        """Options that do not follow from parameters."""
        follows = {*self.switches, *self.follows}
        return [o for o in self.options if o not in follows and o[1] not in self.internal]

    @cached_property
    def signals(self) -> tuple[str, ...]:
        """External signals that must be given."""
        return tuple(name for name in self.model.external if name not in self.measured)

    @cached_property
    def measured(self) -> tuple[str, ...]:
        """External signals for which a parameter stands where they are not given."""
        found: dict[str, None] = {}
        for i, part in enumerate(self.model.parts):
            for name in part.input_types:
                if self.model.link_of(i, name) is None and name in part.defaults:
                    found[part.tap(name).signal] = None
        return tuple(found)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """All outputs."""
        every = self.outputs or (*self.model.every_signal, *self.model.integrals)
        return tuple(dict.fromkeys(every))

    @cached_property
    def limits(self) -> list[tuple[int, str]]:
        """Part and name of every limit."""
        return [(part, name) for name, (part, _) in self.model.limit_bits.items()]

    @cached_property
    def flags(self) -> list[str]:
        """Places in the struct of all that is true or false."""
        options = [f"{self.members[i]}_options.{c_name(name)}" for i, name in self.options]
        limits = [f"{self.members[i]}_limits.{c_name(name)}" for i, name in self.limits]
        given = [f"inputs.measured[{k}].given" for k in range(max(len(self.measured), 1))]
        return [*options, *limits, *given, "now.begun", "before.begun", "stale", "settled"]

    @property
    def taps(self) -> tuple[TapOf, ...]:
        """What is read through a line."""
        return taps_of(self.model, self.model.external)

    @cached_property
    def lines(self) -> tuple[str, ...]:
        """External signals that are kept in delay lines."""
        return tuple(dict.fromkeys(each.tap.signal for each in self.taps))

    @property
    def settles(self) -> bool:
        """Whether every part that remembers something has an equation for its steady state."""
        return all(p.settled is not None or not floats_of(p.state) for p in self.model.parts)

    @cached_property
    def widest(self) -> int:
        """Samples of the widest window."""
        return max([each.tap.samples for each in self.taps], default=3)


# --- source ---------------------------------------------------------------------------------------


class Writer:
    """Header and source of a model."""

    def __init__(self, exported: Exported) -> None:
        self.e, self.model = exported, exported.model
        own = {*OWN.split(), *(f"{exported.prefix}_{each}" for each in PUBLIC.split())}
        own |= {exported.type}
        self.unit = Unit(f"{exported.prefix}_", exported.widest, own)
        self.P = exported.prefix.upper()
        for part in self.model.parts:
            for equation in (part.step, part.sample, part.constants):
                named = get_type_hints(plain(equation)).get("p") if equation is not None else None
                if named is not None:
                    self.unit.wider |= dict(_wider(named, part.parameters))
        for part in self.model.parts:  # structs of the header come before those of the functions
            for kind in (part.parameters, part.options, part.given, part.state, part.signals):
                if kind is not None:
                    self.unit.struct(kind)
            for equation in (part.constants, part.limits):
                if equation is not None:
                    self.unit.struct(get_type_hints(plain(equation))["return"])
        if exported.taps:
            self.unit.struct(Window)
        self.public = len(self.unit.structs)
        self.core = self.functions()

    # -- the sample --------------------------------------------------------------------------------

    def functions(self) -> list[str]:
        """The functions around one sample."""
        made = [self.updates(), *self.finite(), self.starts(False)]
        made += [self.starts(True)] if self.e.settles else []
        return [*made, self.sample()]

    def argument(self, i: int, name: str, inputs: Mapping[str, str], state: str) -> str:
        """What an equation of a part takes under a name."""
        member, part = self.e.members[i], self.model.parts[i]
        if name in inputs:
            return inputs[name]
        return {
            "state": f"&m->{state}.{member}",
            "signals": f"&m->{member}_signals",
            "inputs": f"&{member}_inputs",
            "p": f"&m->{member}",
            "k": f"&m->{member}_constants",
            "h": "m->step",
            "options": f"&m->{member}_options",
            "given": f"&m->{member}_given" if part.given else "",
        }[name]

    def call(
        self, i: int, equation: Equation, inputs: Mapping[str, str], state: str = "now"
    ) -> str:
        """A call of one of a part's equations."""
        name = self.unit.add(equation)
        given = (self.argument(i, each, inputs, state) for each in arguments_of(equation))
        return f"{name}({', '.join(given)})"

    def link(self, link: Link, state: str) -> str:
        """A signal between parts."""
        found = []
        for source in link.sources:
            part, member = self.model.parts[source.part], self.e.members[source.part]
            inside = part.signals is not None and source.signal in floats_of(part.signals)
            where = f"m->{member}_signals" if inside else f"m->{state}.{member}"
            found.append(f"{where}.{path_of(source.signal)}")
        if link.equation is None:
            return found[0]
        return f"{self.unit.add(link.equation)}({', '.join(found)})"

    def inputs(self, i: int, window: str) -> tuple[list[str], dict[str, str]]:
        """Lines that make a part's inputs, and what stands for each of them.

        `window` is how a tap is read: at its place, or all of one value before the record.
        """
        part, member = self.model.parts[i], self.e.members[i]
        state = "now" if window == "before" else "before"
        lines, found = [], dict[str, str]()
        for name in part.input_types:
            link, tap = self.model.link_of(i, name), part.tap(name)
            local = f"{member}_{c_name(name)}"
            default = part.defaults.get(name)
            if link is not None:
                lines.append(f"const double {local} = {self.link(link, state)};")
            elif name in part.taps:
                number = next(t.number for t in self.e.taps if (t.part, t.input) == (i, name))
                line, struct = self.e.lines.index(tap.signal), self.unit.struct(Window)
                made = f"seen(m, {number}, {line}, {tap.samples})"
                if window == "before":
                    made = f"constant_window(m->before_record[{line}])"
                lines.append(f"const struct {struct} {local} = {made};")
                if tap.width:
                    found[name] = f"&{local}"
                    continue
                value = f"{self.unit.add(HOLDS[tap.hold])}(&{local})"
                local = f"{local}_held"
            else:
                value = self.value_of(tap.signal)
            if link is None:
                if default is not None:
                    given = f"m->inputs.measured[{self.P}_INPUT_{c_name(tap.signal)}].given"
                    value = f"{given} ? {value} : m->{member}.{path_of(default)}"
                lines.append(f"const double {local} = {value};")
            found[name] = local
        if part.inputs is not None:
            struct = self.unit.struct(part.inputs)
            kinds = dict(fields_of(part.inputs))
            values = [found[n][1:] if kinds[n] is Window else found[n] for n in part.input_types]
            made = f"(struct {struct}){{{', '.join(values)}}}"
            lines.append(f"const struct {struct} {member}_inputs = {made};")
        return lines, found

    def value_of(self, signal: str) -> str:
        """Where the newest value of an external signal stands."""
        own = c_name(signal)
        if signal in self.e.measured:
            return f"m->inputs.measured[{self.P}_INPUT_{own}].value"
        return f"m->inputs.{own}"

    def used(self, lines: list[str], tail: list[str]) -> list[str]:
        """Lines without the locals that nothing reads."""
        kept: list[str] = []
        for line in reversed(lines):
            name = line.partition(" = ")[0].rpartition(" ")[2]
            if any(name in other for other in (*kept, *tail)):
                kept.insert(0, line)
        return kept

    def sample(self) -> str:
        """One sample of the whole model."""
        body: list[str] = []
        late: list[str] = []
        for i, part in enumerate(self.model.parts):
            member = self.e.members[i]
            lines, inputs = self.inputs(i, "line")
            tail = []
            for word, equation in (("signals", part.sample), ("limits", part.limits)):
                if equation is not None:
                    made = self.call(i, equation, inputs, "before")
                    tail.append(f"m->{member}_{word} = {made};")
            if part.domain is not None:
                margin = self.call(i, part.domain, inputs, "before")
                tail.append(f"good = {margin} > 0.0 && good;")
            step = f"m->now.{member} = {self.call(i, part.step, inputs, 'before')};"
            body += [*self.used(lines, [*tail, step]), *tail]
            late.append(step)
        body += late
        for name, signal in self.model.integrals.items():
            value, own = self.output(signal), c_name(name)
            body.append(f"m->now.{own}_rate = {value};")
            grown = f"m->before.{own} + 0.5 * m->step * (m->before.{own}_rate + m->now.{own}_rate)"
            body.append(f"m->now.{own} = m->before.begun ? {grown} : 0.0;")
        body.append("m->now.begun = true;")
        good = "good && all_finite(&m->now) && finite_outputs(m)"
        body.append(f"return {good} ? {self.P}_OK : {self.P}_DOMAIN;")
        says = "One sample: everything at this instant, then all states to the next."
        head = f"static int one_sample({self.e.type} *m)"
        return function(says, head, ["bool good = true;", *body])

    def starts(self, settled: bool) -> str:
        """States at the first sample, at rest or settled."""
        body: list[str] = []
        for i, part in enumerate(self.model.parts):
            member = self.e.members[i]
            lines, inputs = self.inputs(i, "before")
            equation = part.settled if settled else part.rest
            if equation is not None:
                tail = [f"m->now.{member} = {self.call(i, equation, inputs)};"]
            else:
                defaults = part.state._field_defaults
                tail = []
                for path in floats_of(part.state):
                    value = defaults.get(path.split(".")[0], 0.0)
                    for each in path.split(".")[1:]:
                        value = getattr(value, each, 0.0)
                    tail.append(f"m->now.{member}.{path_of(path)} = {literal(float(value))};")
            if part.sample is not None and i + 1 < len(self.model.parts):
                tail.append(f"m->{member}_signals = {self.call(i, part.sample, inputs)};")
            body += [*self.used(lines, tail), *tail]
        what = "settled under what it was given" if settled else "at rest"
        name = "settled_start" if settled else "rested_start"
        head = f"static void {name}({self.e.type} *m)"
        return function(f"States before the first sample, {what}.", head, body)

    def updates(self) -> str:
        """What follows from parameters and step: options, constants, places of the taps."""
        options, constants, places = [], [], []
        for (i, name), equation in self.e.follows.items():
            member = self.e.members[i]
            options.append(f"m->{member}_options.{c_name(name)} = {self.call(i, equation, {})};")
        for i, part in enumerate(self.model.parts):
            if part.constants is not None:
                made = self.call(i, part.constants, {})
                constants.append(f"m->{self.e.members[i]}_constants = {made};")
        checks = [
            f"if (!({self.call(i, equation, {})} > 0.0)) {{\n    return {self.P}_UNSTABLE;\n}}"
            for i, equation in self.e.stable.items()
        ]
        for i, _, number, tap in self.e.taps:
            delay = f"m->{self.e.members[i]}.{path_of(tap.delay)}" if tap.delay else "0.0"
            places.append(
                f"placed(m, {number}, {delay}, {literal(float(tap.ahead))}, {tap.samples})"
            )
        if places:
            test = "\n    || ".join(f"!{each}" for each in places)
            places = [f"if ({test}) {{\n    return {self.P}_BAD_DELAY;\n}}"]
        lines = [line for each in (*options, *checks, *places) for line in each.split("\n")]
        says = "Options, stability and delays of these parameters and this step."
        body = [*(lines or ["(void)m;"]), f"return {self.P}_OK;"]
        checked = function(says, f"static int checked({self.e.type} *m)", body)
        says, head = "Constants of these parameters and this step.", "static void computed"
        computed = function(says, f"{head}({self.e.type} *m)", constants or ["(void)m;"])
        return f"{checked}\n\n{computed}"

    def finite(self) -> tuple[str, str]:
        """Whether all states, and all outputs, are finite: without a branch for each."""
        members = self.e.members
        states = [f"s->{members[i]}.{path_of(path)}" for i, path in self.model.places("state")]
        says = "Whether all states are finite: what is not leaves no zero behind."
        head = f"static bool all_finite(const struct {self.e.prefix}_memory *s)"
        of_states = function(says, head, _finite(states, "s"))
        says = "Whether all outputs of the sample are finite."
        head = f"static bool finite_outputs(const {self.e.type} *m)"
        return of_states, function(says, head, _finite([*map(self.output, self.e.names)], "m"))

    # -- numbers -----------------------------------------------------------------------------------

    def members_of(self, part: Model) -> Iterator[tuple[str, str]]:
        """Tag and ending of each member of the struct that belongs to a part."""
        yield self.unit.struct(part.parameters), ""
        kinds = [("options", part.options), ("given", part.given), ("signals", part.signals)]
        for word in ("constants", "limits"):
            equation = getattr(part, word)
            if equation is not None:
                kinds.append((word, get_type_hints(plain(equation))["return"]))
        for word, kind in kinds:
            if kind is not None:
                yield self.unit.struct(kind), f"_{word}"

    def output(self, name: str, state: str = "before") -> str:
        """Where an output is read."""
        if name in self.model.integrals:
            return f"m->now.{c_name(name)}"
        stored, _ = output_of(self.model, name)
        if stored.kind == "link":
            return self.link(self.model.links[stored.path], state)
        where = f"m->{state}." if stored.kind == "state" else "m->"
        tail = "_signals" if stored.kind == "signals" else ""
        return f"{where}{self.e.members[stored.part]}{tail}.{path_of(stored.path)}"

    def ranges(self) -> Iterator[tuple[str, str, Definition]]:
        """Name, place and definition of each parameter."""
        definitions: dict[tuple[int, str], Definition] = {}
        for i, part in enumerate(self.model.parts):
            for each in declared_by(part.parameters):
                definitions |= {(i, path): each for path in each.fields}
        for i, path, name in self.e.named("parameters"):
            place = f"{self.e.members[i]}.{path_of(path)}"
            yield name, place, definitions.get((i, path), Definition(name, ""))

    def values(self) -> list[tuple[str, str]]:
        """Name and place of every number that an initialisation takes, the step apart."""
        found = [(name, place) for name, place, _ in self.ranges()]
        for i, path, name in self.e.named("given"):
            found.append((name, f"{self.e.members[i]}_given.{path_of(path)}"))
        for i, name in self.e.options:
            found.append((name, f"{self.e.members[i]}_options.{c_name(name)}"))
        for i, part in enumerate(self.model.parts):
            if part.constants is not None:
                kind = get_type_hints(plain(part.constants))["return"]
                place = f"{self.e.members[i]}_constants"
                found += [(path, f"{place}.{path_of(path)}") for path in floats_of(kind)]
        return found


def path_of(path: str) -> str:
    """A path of Python's as one of C's."""
    return ".".join(c_name(each) for each in path.split("."))


def _finite(places: Sequence[str], owner: str) -> list[str]:
    """Statements that return whether all numbers are finite, without a branch for each."""
    lines = [f"none += {place} - {place};" for place in places] or [f"(void){owner};"]
    return ["double none = 0.0;", *lines, "return none == 0.0;"]


def _wider(named: Any, kind: Any) -> Iterator[tuple[Any, Any]]:
    """Classes that equations name, and those with more fields that a part has in their place."""
    if named is not kind:
        yield named, kind
        fields = dict(fields_of(kind))
        for name, hint in fields_of(named):
            if is_named_tuple(hint):
                yield from _wider(hint, fields[name])


# --- feedthrough ----------------------------------------------------------------------------------


def feedthrough(exported: Exported, instance: Instance, step: float) -> dict[str, frozenset[str]]:
    """External signals that each output follows at the same sample, with these options and delays.

    One that is read through a tap counts if the window reaches its newest sample.
    """
    model, at_once = exported.model, newest(exported, instance, step)
    places = [output_of(model, name)[0] for name in exported.names]
    sampler = Sampler(model, model.external, instance.options, places)
    code = Code(sampler.used[0].code.taken)
    for part in sampler.used:
        code.items += sampler.items(part)
    signals = {f"x_{name}": name for name in model.external}
    for part in sampler.used:
        signals |= {part.tap_samples(each)[0]: each.tap.signal
                    for each in part.taps if each.tap.signal in at_once}  # fmt: skip
    found = {}
    for name, place in zip(exported.names, places, strict=True):
        own, node = sampler.observed(sampler.parts[place.part], place)
        read = code.reads([ex.name(each) for each in own.reads([node])])
        found[name] = frozenset(signals[each] for each in read & signals.keys())
    return found


def newest(exported: Exported, instance: Instance, step: float) -> dict[str, tuple[float, float]]:
    """Signals that are read at their newest sample: delay [s], and steps that would be enough."""
    steps = dict[str, float]()
    for _, _, _, tap in exported.taps:
        steps[tap.signal] = max(1.0 + tap.ahead, steps.get(tap.signal, 0.0))
    found = {}
    for i, _, _, tap in exported.taps:
        delay = float(value_at(instance.parts[i].p, tap.delay)) if tap.delay else 0.0
        if delay < (1.0 + tap.ahead) * step * (1.0 - 1e-12):
            found[tap.signal] = delay, steps[tap.signal]
    return found
