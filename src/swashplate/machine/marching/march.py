"""Marches printed in LLVM's language: one model over its inputs, a sample after the other.

A march is the same text for one set of numbers and for many side by side (`Code.wide`): of an array
of numbers each has one for every lane, number k of lane l at k lanes + l. Arithmetic is strict and
in the order of the equations, so that all marches, and steppers, give the same bits.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from types import MappingProxyType

from swashplate.machine import graph
from swashplate.machine.code_generation.llvm import Code
from swashplate.machine.code_generation.values import leaves
from swashplate.machine.graph import Node
from swashplate.machine.marching.kernels import KERNEL_ARGUMENTS, KERNEL_KINDS
from swashplate.machine.marching.part_code import PartCode, SignalId, TapOf, signals_between
from swashplate.machine.marching.sample_code import CodeForm, SampleCode
from swashplate.machine.model import Model

TYPES = {"int": "i64", "float": "double"}
"""LLVM's types of numbers; all else is a pointer."""
ARGUMENTS = tuple(
    (TYPES.get(kind, "ptr"), name)
    for kind, name in zip(KERNEL_KINDS, KERNEL_ARGUMENTS.split(", "), strict=True)
)
"""Of a march of one set."""
NOTHING: Mapping[Node, str] = MappingProxyType({})
HALF, ZERO = "0x3FE0000000000000", "0x0000000000000000"


def numbers_known(
    sample_code: SampleCode, code: Code, read: Callable[[PartCode], Collection[str]]
) -> dict[Node, str]:
    """The step, parameters and givens, as far as a part reads them by their names."""
    known = {graph.name("h"): code.in_all_lanes("%h")}
    for part in sample_code.used:
        names = read(part)
        for numbers, kind, array in (
            (part.p, "parameters", "%params"),
            (part.given, "given", "%given"),
        ):
            places = sample_code.model.places(kind)
            for path, node in leaves(numbers):
                if node.value in names:
                    place = places.index((part.part, path)) * (code.wide or 1)
                    known[node] = code.load(array, place)
                    code.places[node] = array, place
    return known


def known_ahead(
    sample_code: SampleCode, code: Code, names: Collection[str] = ()
) -> dict[Node, str]:
    """What does not change over a march: numbers, fractions of delays, and what follows from them.

    `names` are those that are read beside what parts read.
    """
    known = numbers_known(sample_code, code, lambda part: sample_code.read(part) | {*names})
    for part in sample_code.used:
        for tap in part.taps:
            fraction = graph.name(part.delay_fraction(tap))
            known[fraction] = code.load("%delay_fraction", tap.number * (code.wide or 1))
        code.values(part.ahead(sample_code.ends[part.part], part.delay_fractions), known)
    return known


class March:
    """The text of a march under way.

    `names` are those that are read beside what parts read; `known` is what does not change, if that
    was computed before; `first` is the first sample.

    Attributes
    ----------
    code : Code
        What is written.
    known : dict of Node to str
        What does not change over the march.
    """

    def __init__(
        self,
        sample_code: SampleCode,
        code: Code,
        names: Collection[str] = (),
        known: Mapping[Node, str] | None = None,
        first: str = "%first",
    ) -> None:
        self.sample_code, self.code, self._first = sample_code, code, first
        self._lanes, self._names = code.wide or 1, {*names}
        self.known = known_ahead(sample_code, code, names) if known is None else {**known}
        self._records = {
            signal: code.load("%records", index, "ptr")
            for index, signal in enumerate(sample_code.signals)
        }
        given = len(sample_code.signals)
        self._between = {
            tap.between: code.load("%records", given + tap.between, "ptr")
            for tap in sample_code.late
        }
        self._states = {
            node: code.variable(code.load("%states", place * self._lanes))
            for node, place, _ in self._carried()
        }
        self._passed = {
            tap: code.variable(self._at_first(tap)) for tap in sample_code.late if tap.tap.passed_on
        }
        """What one sample passes on to the next, of signals that come a sample late."""
        self._worst = code.variable(code.constant(float("inf")))
        self._total = code.variable(code.constant(0.0))

    def _carried(self, parts: Sequence[PartCode] | None = None) -> list[tuple[Node, int, Node]]:
        """Each number of the state that is carried: its name, its place, what it becomes."""
        places = self.sample_code.model.places("state")
        carried = []
        for part in self.sample_code.used if parts is None else parts:
            names, following = dict(leaves(part.state)), dict(leaves(part.following))
            carried += [
                (names[path], places.index((part.part, path)), following[path])
                for path in self.sample_code.carried[part.part]
            ]
        return carried

    def sample(
        self, n: str, parts: Sequence[PartCode] | None = None, sources: Mapping[Node, str] = NOTHING
    ) -> dict[Node, str]:
        """All that is known at sample n: inputs, states, signals; margins are taken in.

        Of some parts only if they are given, with the signals of other parts, `sources`.
        """
        code, sample_code = self.code, self.sample_code
        known = {**self.known, **sources}
        for part in sample_code.used if parts is None else parts:
            for node, _, _ in self._carried([part]):
                known[node] = code.load(self._states[node])
            known |= self._inputs(part, n, known)
            for source, node in sample_code.sources.items():
                if source.part == part.part:
                    (text,) = code.floats([node], known)
                    known[graph.name(part.source(source))] = text
            code.values(sample_code.ends[part.part], known)
            if part.margin is not None:
                self._take_in(known[graph.plain_value(part.margin)])
        for tap in sample_code.late:
            if tap.tap.late:
                self._keep(tap, n, known)
        return known

    def _inputs(self, part: PartCode, n: str, sources: Mapping[Node, str]) -> dict[Node, str]:
        """What a part reads of records at sample n; of `sources` it keeps what it reads later."""
        code, sample_code = self.code, self.sample_code
        known, read = dict[Node, str](), sample_code.read(part) | self._names
        for tap in part.between:
            if tap in sample_code.late and not tap.tap.late:
                self._keep(tap, n, sources)
        for tap in part.taps:
            for age, name in enumerate(part.tap_samples(tap)):
                if name in read and tap in self._passed:
                    known[graph.name(name)] = code.load(self._passed[tap])
                elif name in read:
                    places = [self._past(tap, lane, str(age), n) for lane in range(self._lanes)]
                    known[graph.name(name)] = code.joined(places)
                    if tap.tap.longest:
                        code.lines[graph.name(name)] = self._line(tap, n)
        for name in part.part_model.input_types:
            signal = part.part_model.tap(name).signal
            node = graph.name(f"x_{signal}")
            if signal in sample_code.signals and node.value in read and node not in sources:
                now = code.load(self._records[signal], n, "double")
                known[node] = code.in_all_lanes(now)
        return known

    def _keep(self, tap: TapOf, n: str, known: Mapping[Node, str]) -> None:
        """Keep a signal between parts, which a tap reads later, in its line."""
        part = self.sample_code.parts[tap.part]
        (text,) = self.code.floats([part.tapped(tap)], dict(known))
        if tap in self._passed:
            self.code.store(text, self._passed[tap])
        place = self.code.put(f"mul i64 {n}, {self._lanes}")
        self.code.store(text, self._between[tap.between], place)

    def _at_first(self, tap: TapOf) -> str:
        """What a tap reads at the first sample."""
        places = [self._past(tap, lane, "0", self._first) for lane in range(self._lanes)]
        return self.code.joined(places)

    def _line(self, tap: TapOf, n: str) -> Callable[[str, int], str]:
        """What reads a tap's signal at any age."""
        return lambda age, lane: self._past(tap, lane, age, n)

    def _past(self, tap: TapOf, lane: int, age: str, n: str) -> str:
        """What a signal was some samples before sample n, or before its record."""
        code, signals = self.code, self.sample_code.signals
        delay = code.load("%delay_samples", tap.number * self._lanes + lane, "i64")
        at = code.put(f"sub i64 {n}, {delay}")
        at = code.put(f"sub i64 {at}, {age}") if age != "0" else at
        inside = code.put(f"icmp sge i64 {at}, 0")
        place = code.put(f"select i1 {inside}, i64 {at}, i64 0")
        if tap.between < 0:
            record, number = self._records[tap.tap.signal], signals.index(tap.tap.signal)
        else:
            record, number = self._between[tap.between], len(signals) + tap.between
            if code.wide:
                place = code.put(f"mul i64 {place}, {self._lanes}")
                place = code.put(f"add i64 {place}, {lane}")
        value = code.load(record, place, "double")
        before = ZERO
        if not code.wide:
            before = code.load("%before", number, "double")
        elif tap.tap.before:  # of each lane its own
            path = tap.part, tap.tap.before
            parameter = self.sample_code.model.places("parameters").index(path)
            before = code.load("%params", parameter * self._lanes + lane, "double")
        return code.put(f"select i1 {inside}, double {value}, double {before}")

    def _take_in(self, margin: str) -> None:
        """The lowest margin so far, and a sum that is not a number once a margin was none."""
        code = self.code
        worst = code.load(self._worst)
        lower = code.put(f"fcmp olt {code.number} {margin}, {worst}")
        code.store(code.select(lower, margin, worst), self._worst)
        total = code.put(f"fadd {code.number} {code.load(self._total)}, {margin}")
        code.store(total, self._total)

    def observed(self, signal: SignalId, known: dict[Node, str]) -> str:
        """A number of a sample that is kept: limits as a sum of a bit each."""
        code, part = self.code, self.sample_code.parts[signal.part]
        if signal.kind != "limits":
            (text,) = code.floats([self.sample_code.observed(part, signal)], known)
            return text
        zero, total = code.constant(0.0), code.constant(0.0)
        for bit, (limit, test) in enumerate(
            zip(part.limits, code.values(part.limits, known), strict=True)
        ):
            is_set = code.select(code.as_test(limit, test), code.constant(float(1 << bit)), zero)
            total = code.put(f"fadd {code.number} {total}, {is_set}") if bit else is_set
        return total

    def step(self, known: dict[Node, str], parts: Sequence[PartCode] | None = None) -> None:
        """Take the states to the next sample."""
        carried = self._carried(parts)
        following = self.code.floats([node for _, _, node in carried], known)
        for (name, _, _), text in zip(carried, following, strict=True):
            self.code.store(text, self._states[name])

    def run(
        self,
        keep: Callable[[dict[Node, str], str, Sequence[PartCode]], None],
        *,
        together: bool = False,
    ) -> None:
        """March ``count`` samples of one set from ``first`` on; `keep` is given what is known.

        And the number of the sample in the march, and the parts of which it is known. Unless all
        are to be known `together`, the last part is a sample later than those that it follows, so
        that neither waits for the other.
        """
        code, sample_code = self.code, self.sample_code

        def advance(
            at: str, parts: Sequence[PartCode], sources: Mapping[Node, str] = NOTHING
        ) -> dict[Node, str]:
            known = self.sample(code.put(f"add i64 %first, {at}"), parts, sources)
            keep(known, at, parts)
            self.step(known, parts)
            return known

        *others, last = sample_code.used
        passed = [
            graph.name(sample_code.parts[source.part].source(source))
            for source in sample_code.sources
            if source.part != last.part
        ]
        closed = any(tap.tap.late for tap in sample_code.late)
        if passed and not together and not closed:
            variables = {node: code.variable(code.constant(0.0)) for node in passed}
            with code.loop("0", code.put("add i64 %count, 1")) as at:
                late = {node: code.load(variable) for node, variable in variables.items()}
                with code.only_if(code.put(f"icmp slt i64 {at}, %count")):
                    known = advance(at, others)
                    for node, variable in variables.items():
                        code.store(known[node], variable)
                with code.only_if(code.put(f"icmp sgt i64 {at}, 0")):
                    advance(code.put(f"sub i64 {at}, 1"), [last], late)
        else:
            with code.loop("0", "%count") as at:
                advance(at, sample_code.used)
        self._end_of_one()

    def _end_of_one(self) -> None:
        """Leave states and the worst margin of one set."""
        code = self.code
        worst = self.end()
        before = code.load("%worst_margin")
        lower = code.put(f"fcmp olt double {worst}, {before}")
        unordered = code.put(f"fcmp uno double {worst}, {worst}")
        takes = code.put(f"or i1 {lower}, {unordered}")
        code.store(code.select(takes, worst, before), "%worst_margin")

    def end(self) -> str:
        """Leave the states in their array; the worst margin, not a number if one was none."""
        code = self.code
        for node, place, _ in self._carried():
            code.store(code.load(self._states[node]), "%states", place * self._lanes)
        worst, total = code.load(self._worst), code.load(self._total)
        counts = code.put(f"fcmp ord {code.number} {total}, {total}")
        below = code.put(f"fcmp ole {code.number} {worst}, {code.constant(0.0)}")
        keeps = code.put(f"or {code.bit} {counts}, {below}")
        return code.select(keeps, worst, total)


STEP_ARGUMENTS = (*ARGUMENTS, *(("ptr", name) for name in ("inputs", "constants", "position")))
"""Of a march of one sample, which is given them as words: ``count`` the length of the records,
``inputs`` the newest sample, ``constants`` what does not change, ``position`` where in the records
the sample goes, and how many samples delays look back."""
PREPARE_ARGUMENTS = (
    ("double", "h"),
    *(("ptr", name) for name in ("delay_fraction", "params", "given", "constants")),
)
"""Of what computes that."""


def step_texts(model: Model, form: CodeForm, stored: Sequence[SignalId]) -> tuple[str, str, int]:
    """Texts of what computes constants, and of a step; and how many constants there are.

    A step puts the newest inputs into the records, behind the last ones, and marches one sample.
    From the end of the records it goes on at their beginning, with the last samples before it.
    """
    sample_code = SampleCode(model, form, stored)
    constants = [
        node
        for part in sample_code.used
        for node in part.ahead(sample_code.ends[part.part], part.delay_fractions)
    ]
    prepare = Code(PREPARE_ARGUMENTS)
    known = known_ahead(sample_code, prepare)
    for place, text in enumerate(prepare.values(constants, known)):
        prepare.store(text, "%constants", place)
    code = Code([("ptr", "words")])
    for place, (kind, name) in enumerate(STEP_ARGUMENTS):
        code.named(kind, name, code.load("%words", place, "i64"))
    kept = len(form.signals) + len(signals_between(model))
    records = [code.load("%records", place, "ptr") for place in range(kept)]
    at = code.variable(code.load("%position", 0, "i64"), "i64")
    with code.only_if(code.put(f"icmp eq i64 {code.load(at, 0, 'i64')}, %count")):
        longest = code.load("%position", 1, "i64")
        since = code.put(f"sub i64 %count, {longest}")
        for record in records:
            with code.loop("0", longest) as age:
                later = code.load(record, code.put(f"add i64 {since}, {age}"))
                code.store(later, record, age)
        code.store(longest, at, 0, "i64")
    first = code.load(at, 0, "i64")
    code.store(code.put(f"add i64 {first}, 1"), "%position", 0, "i64")
    for place, _ in enumerate(form.signals):
        code.store(code.load("%inputs", place), records[place], first)
    known = numbers_known(sample_code, code, sample_code.read)
    for part in sample_code.used:
        for tap in part.taps:
            fraction = graph.name(part.delay_fraction(tap))
            known[fraction] = code.load("%delay_fraction", tap.number)
    known |= {node: code.load("%constants", place) for place, node in enumerate(constants)}
    march = March(sample_code, code, known=known, first=first)
    known = march.sample(first)
    for place, signal in enumerate(stored):
        code.store(march.observed(signal, known), "%flat", place)
    march.step(known)
    code.store(march.end(), "%worst_margin")
    return prepare.text, code.text, len(constants)


def march_text(
    model: Model,
    form: CodeForm,
    targets: Mapping[SignalId, int],
    further: Mapping[SignalId, int] = MappingProxyType({}),
) -> str:
    """Text of the march of one set.

    Parameters
    ----------
    model, form
        What is marched, and of what form.
    targets : mapping of SignalId to int
        What is kept, and its row of the block.
    further : mapping of SignalId to int
        What is kept, too, if the second number of ``worst_margin`` is not zero.
    """
    sample_code = SampleCode(model, form, [*targets, *further])
    code = Code(ARGUMENTS)
    march = March(sample_code, code)

    def keep(rows: Mapping[SignalId, int], known: dict[Node, str], at: str) -> None:
        for signal, row in rows.items():
            place = code.put(f"mul i64 %count, {row}")
            place = code.put(f"add i64 {place}, {at}")
            code.store(march.observed(signal, known), "%flat", place)

    def keep_sample(known: dict[Node, str], at: str, parts: Sequence[PartCode]) -> None:
        numbers = {part.part for part in parts}
        of_parts = [
            {signal: row for signal, row in rows.items() if signal.part in numbers}
            for rows in (targets, further)
        ]
        keep(of_parts[0], known, at)
        if of_parts[1]:
            everything = code.load("%worst_margin", 1)
            with code.only_if(code.put(f"fcmp une double {everything}, 0.0")):
                keep(of_parts[1], dict(known), at)

    march.run(keep_sample)
    return code.text
