"""One sample of a whole model: the code of its parts, and what of it is needed."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

from swashplate.errors import InputError
from swashplate.machine import graph
from swashplate.machine.code_generation.functions import generating
from swashplate.machine.code_generation.program import Program, program_of
from swashplate.machine.code_generation.values import leaves
from swashplate.machine.fields import floats_of
from swashplate.machine.graph import Node, names_in
from swashplate.machine.keeping import cached_on_disk, key_of
from swashplate.machine.marching.part_code import PartCode, SignalId, TapOf
from swashplate.machine.model import Model, SignalSource, full_name


class CodeForm(NamedTuple):
    """For what a model's code is made, besides the model and what is kept of it."""

    signals: tuple[str, ...]
    """External signals that are given as records; for others default parameters count."""
    options: tuple[Any, ...]
    """Of each part."""
    decisions: tuple[bool, ...] = ()
    """What parameters and givens decide alone, see `decisions_of`; none if the code decides it."""


class Decisions(NamedTuple):
    """What parameters and givens of a model decide alone."""

    arguments: tuple[SignalId, ...]
    """What the program takes."""
    program: Program
    """Of the tests of all parts, one after the other."""


@generating
def decisions_of(model: Model, signals: tuple[str, ...], options: tuple[Any, ...]) -> Decisions:
    """What parameters and givens decide alone in a model.

    A march need not ask for it at every sample, so that only one of both ways becomes code.
    """

    def made() -> Decisions:
        parts = parts_of(model, signals, options)
        program = program_of([test for part in parts for test in part.tests])
        ids = {name: number for part in parts for name, number in part.numbers.items()}
        return Decisions(tuple(ids[name] for name in program.arguments), program)

    return cached_on_disk(f"{model.name}_decisions", (key_of(model), signals, options), made)


@generating
def parts_of(
    model: Model, signals: tuple[str, ...], options: tuple[Any, ...]
) -> tuple[PartCode, ...]:
    """Code of all parts of a model."""
    used_names = set[str]()
    return tuple(
        PartCode(model, index, signals, options_of_part, used_names)
        for index, options_of_part in enumerate(options)
    )


def _decided(parts: Sequence[PartCode], decisions: Sequence[bool]) -> list[PartCode]:
    """The parts where it is known what parameters and givens decide alone."""
    left = iter(decisions)
    return [part.decided([next(left) for _ in part.tests]) for part in parts]


class SampleCode:
    """One sample of a whole model: the code of its parts, and what of it is needed.

    `outputs` are numbers that are kept at every sample; parts that none of them needs are left out.

    Attributes
    ----------
    parts, used : sequence of PartCode
        All parts, and those that are needed.
    ends, carried : list
        Of each part the results that are needed, and the paths of the states.
    sources : dict of SignalSource to Node
        Signals that other parts or links need.
    late : list of TapOf
        Taps on signals between parts that are read.
    """

    def __init__(self, model: Model, form: CodeForm, outputs: Sequence[SignalId]) -> None:
        self.model, self.signals = model, form.signals
        self.parts: Sequence[PartCode] = parts_of(model, form.signals, form.options)
        if form.decisions:
            self.parts = _decided(self.parts, form.decisions)
        self.ends: list[list[Node]] = [[] for _ in self.parts]
        self.carried: list[list[str]] = [[] for _ in self.parts]
        self.sources: dict[SignalSource, Node] = {}
        self.late: list[TapOf] = []
        for output in outputs:
            part = self.parts[output.part]
            if output.kind == "link":
                self._need(model.links[output.path].sources)
            elif output.kind == "limits":
                self.ends[output.part] += part.limits
            else:
                self.ends[output.part].append(part.node(output))
        settled = [0 for _ in self.parts]
        while settled != [len(ends) for ends in self.ends]:  # signals that come late: again
            for part in reversed(self.parts):
                if len(self.ends[part.part]) != settled[part.part]:
                    self._settle(part)
                    settled[part.part] = len(self.ends[part.part])
        self.used = [part for part in self.parts if self.ends[part.part]]

    def _settle(self, part: PartCode) -> None:
        """Find out what a part's results follow from: its states, and signals of other parts."""
        ends, carried = self.ends[part.part], {*self.carried[part.part]}
        ends += [] if part.margin is None or part.margin in ends else [part.margin]
        state, following = dict(leaves(part.state)), dict(leaves(part.following))
        while True:
            read = names_in(ends)
            new = {path for path, node in state.items() if node.value in read} - carried
            if not new:
                break
            carried |= new
            ends += [following[path] for path in state if path in new]
        self.carried[part.part] = [path for path in state if path in carried]
        for tap in part.between:
            if not read.isdisjoint(part.tap_samples(tap)) and tap not in self.late:
                self.late.append(tap)
        late = {tap.input for tap in self.late if tap.part == part.part}
        for name in part.part_model.input_types:
            link = self.model.link_of(part.part, name)
            if link is None:
                continue
            if name in late or any(part.source(source) in read for source in link.sources):
                self._need(link.sources)

    def _need(self, sources: Sequence[SignalSource]) -> None:
        for source in sources:
            if source not in self.sources:
                node = self.parts[source.part].signal(source.signal)
                self.sources[source] = node
                self.ends[source.part].append(node)

    @property
    def carried_ids(self) -> list[SignalId]:
        """States that are carried, part by part."""
        return [
            SignalId(part.part, "state", path)
            for part in self.used
            for path in self.carried[part.part]
        ]

    @property
    def stands_for(self) -> dict[Node, Node]:
        """What the names of signals between parts stand for."""
        return {
            graph.name(self.parts[source.part].source(source)): node
            for source, node in self.sources.items()
        }

    def outside(self) -> dict[str, SignalId]:
        """What is known ahead of a sample, by name: numbers, the state, delays and records."""
        ids = {"h": SignalId(0, "h")}
        for part in self.used:
            part_index = part.part
            ids |= part.numbers
            ids |= {
                node.value: SignalId(part_index, "state", path) for path, node in leaves(part.state)
            }
            ids |= part.outside
            for tap in part.taps:
                ids[part.delay_fraction(tap)] = SignalId(part_index, "fraction", str(tap.number))
        return ids

    def read(self, part: PartCode) -> set[str]:
        """Names from outside that a part needs."""
        return names_in(self.ends[part.part])

    def observed(self, part: PartCode, stored: SignalId) -> Node:
        """A number that is kept, of what is known at its part's end."""
        if stored.kind != "link":
            return part.node(stored)
        link = self.model.links[stored.path]
        sources = [graph.name(part.source(source)) for source in link.sources]
        assert link.equation is not None
        return part.link(link.equation, link.name, sources)


def output_of(model: Model, output: str) -> tuple[SignalId, bool]:
    """Where a signal comes from, and whether it is that signal's integral."""
    signals = _signals_of(model)
    name = full_name(output, [*model.integrals, *signals])
    integral = name in model.integrals
    signal = model.integrals.get(name, name)
    if signal not in signals:
        raise InputError(
            f"{model.name} has no signal '{output}'; it has "
            f"{', '.join([*model.every_signal, *model.integrals])}."
        )
    return signals[signal], integral


@lru_cache(maxsize=256)
def _signals_of(model: Model) -> dict[str, SignalId]:
    """Signals, and numbers of the states, by full names: of two parts that have one the last's."""
    signals = dict[str, SignalId]()
    for index, part in enumerate(model.parts):
        kinds = {"signals": part.signals, "state": part.state}
        own = [
            (part.full(name), SignalId(index, kind, name))
            for kind, type_ in kinds.items()
            if type_ is not None
            for name in floats_of(type_)
        ]
        signals |= dict(reversed(own))
    links = {name: SignalId(link.after, "link", name) for name, link in model.links.items()}
    return signals | links
