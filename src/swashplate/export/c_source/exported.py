"""A model that is written as C: its names, and what goes beyond its equations."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import ceil
from typing import NamedTuple

from swashplate.export.c_source.names import (
    ARGUMENTS,
    CONSTANTS,
    FILES,
    FUNCTIONS,
    MEMBERS,
    PART_MEMBERS,
    PUBLIC,
)
from swashplate.machine import Equation, Machine, Model
from swashplate.machine.code_generation import ascii_name, c_name, fresh_name
from swashplate.machine.fields import floats_of, value_at
from swashplate.machine.marching import TapOf, signals_between, taps_of

USUAL_RING = 1024
"""Samples of a ring of a model without numbers."""
BEYOND = 3
"""Samples of a ring beyond those by which it is looked back: the newest one, and the next older one
of an age between two."""


class ExportedLimit(NamedTuple):
    """A limit of a part."""

    part: int
    name: str
    """Of the part."""
    full: str
    """Of the whole model."""


@dataclass(frozen=True, eq=False)
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
    notes: Mapping[str, str] = field(default_factory=dict)
    """What an external signal is, if no named tuple of inputs says it."""
    reaches: tuple[int, ...] = ()
    """Samples of each ring in `rings`: how far back it is looked."""

    @property
    def file(self) -> str:
        """Name of header and source."""
        name = c_name(self.model.name)
        if self.prefix == name and name.lower() not in FILES.split():
            return name
        return f"swashplate_{name}"

    @property
    def type(self) -> str:
        """Name of the struct."""
        name = c_name(self.model.name)
        is_free = name != self.prefix and f"{self.prefix}_{name}" not in self.public
        return f"{self.prefix}_{name if is_free else 'model'}"

    # -- what the model says of inputs, options and steps ------------------------------------------

    @cached_property
    def bounds(self) -> dict[str, float]:
        """Largest magnitude of the inputs that have one: they can be clipped to it."""
        ranges = self.model.input_ranges
        return {
            name: ranges[name][1]
            for name in self.signals
            if name in ranges and -ranges[name][0] == ranges[name][1]
        }

    @cached_property
    def ranges(self) -> dict[str, tuple[float, float]]:
        """Least and largest value of the other inputs that have a range."""
        ranges = self.model.input_ranges
        return {name: ends for name, ends in ranges.items() if name not in self.bounds}

    @cached_property
    def follows(self) -> dict[tuple[int, str], Equation]:
        """By part and option: whether it is on, of ``p``; it cannot be set."""
        return {
            (part_index, name): equation
            for part_index, part in enumerate(self.model.parts)
            for name, equation in part.follows.items()
        }

    @cached_property
    def stable(self) -> dict[int, Equation]:
        """By part: margin above 0 if its equations bear the step, of ``p, h, options``."""
        stable = {part_index: part.stable for part_index, part in enumerate(self.model.parts)}
        return {part_index: equation for part_index, equation in stable.items() if equation}

    @cached_property
    def any_step(self) -> list[tuple[int, str]]:
        """Options, by part and name, without which the equations are for one step only."""
        parts = enumerate(self.model.parts)
        return [(part_index, part.any_step) for part_index, part in parts if part.any_step]

    # -- names -------------------------------------------------------------------------------------

    @cached_property
    def public(self) -> set[str]:
        """Names of the functions and structs of its interface."""
        return {f"{self.prefix}_{word}" for word in PUBLIC.split()}

    @cached_property
    def constants(self) -> dict[str, dict[str, str]]:
        """By kind, such as ``PARAMETER_``, and by name: constants that stand for its numbers.

        The kind of outputs is empty.
        """
        capitals = self.prefix.upper()
        used_names = {*self.public, *self._statuses}
        names_of_kind = {
            "PARAMETER_": [name for _, _, name in self.named("parameters")],
            "INPUT_": self.measured,
            "OPTION_": [*self.option_names],
            "LIMIT_": [limit.full for limit in self.limits],
            "": self.names,
        }
        return {
            kind: {
                name: fresh_name(f"{capitals}_{kind}{_flat(name)}", used_names)
                for name in dict.fromkeys(names)
            }
            for kind, names in names_of_kind.items()
        }

    @property
    def _statuses(self) -> set[str]:
        return {f"{self.prefix.upper()}_{word}" for word in CONSTANTS.split()}

    @cached_property
    def reserved(self) -> set[str]:
        """Names that no function, argument or variable may have."""
        constants = {name for names in self.constants.values() for name in names.values()}
        return {*FUNCTIONS.split(), *self.public, self.type, *self._statuses, *constants}

    @cached_property
    def arguments(self) -> dict[str, str]:
        """What the inputs of a step are called, by their signals."""
        used_names = {*ARGUMENTS.split(), *self.reserved}
        return {signal: fresh_name(c_name(signal), used_names) for signal in self.signals}

    @cached_property
    def members(self) -> list[str]:
        """Name of each part within the structs."""
        used_names = {*MEMBERS.split()}
        return [_fresh_member(part.path, PART_MEMBERS, used_names) for part in self.model.parts]

    @cached_property
    def integrals(self) -> dict[str, str]:
        """Name of each integral within the structs."""
        used_names = {*MEMBERS.split(), *self.members}
        return {
            name: _fresh_member(name, ("", "_rate"), used_names) for name in self.model.integrals
        }

    def named(self, kind: str) -> list[tuple[int, str, str]]:
        """Part, path and name of every number of its parameters or givens."""
        numbers_named = []
        for part, path in self.model.places(kind):
            full = f"{self.model.prefix(part)}{path}"
            numbers_named.append((part, path, _flat(self.parameters.get(full) or full)))
        return numbers_named

    @cached_property
    def options(self) -> list[tuple[int, str]]:
        """Part and name of every option."""
        return [
            (part_index, name)
            for part_index, part in enumerate(self.model.parts)
            if part.options is not None
            for name in part.options._fields
        ]

    @cached_property
    def settable(self) -> list[tuple[int, str]]:
        """Options that do not follow from parameters."""
        follows = {*self.model.switches, *self.follows}
        return [option for option in self.options if option not in follows]

    @property
    def option_names(self) -> tuple[str, ...]:
        """Names of the options that are set, in the whole model."""
        return tuple(self.model.parts[part].full(name) for part, name in self.settable)

    @cached_property
    def signals(self) -> tuple[str, ...]:
        """External signals that must be given."""
        return tuple(name for name in self.model.external if name not in self.measured)

    @cached_property
    def measured(self) -> tuple[str, ...]:
        """External signals that a parameter replaces if they are not given."""
        return tuple(self.model.input_parameters)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """All outputs."""
        all_outputs = self.outputs or (*self.model.every_signal, *self.model.integrals)
        # a packaged part may pass an input on, by its name
        return tuple(dict.fromkeys(name for name in all_outputs if name not in self.model.external))

    @cached_property
    def limits(self) -> list[ExportedLimit]:
        """Every limit of all parts."""
        scopes = [part.scope for part in self.model.parts]
        return [
            ExportedLimit(part, full.removeprefix(f"{scopes[part]}."), full)
            for full, (part, _) in self.model.limit_bits.items()
        ]

    @cached_property
    def flags(self) -> list[str]:
        """Places in the struct of all that is true or false."""
        options = [
            f"{self.members[part_index]}_options.{c_name(name)}"
            for part_index, name in self.options
        ]
        limits = [
            f"{self.members[limit.part]}_limits.{c_name(limit.name)}" for limit in self.limits
        ]
        set_inputs = [
            f"inputs.measured[{index}].given" for index in range(max(len(self.measured), 1))
        ]
        return [*options, *limits, *set_inputs, "now.started", "before.started", "stale", "settled"]

    @property
    def taps(self) -> tuple[TapOf, ...]:
        """What is read through a line."""
        return taps_of(self.model, self.model.external)

    @cached_property
    def windows(self) -> tuple[TapOf, ...]:
        """Taps that look at neighbouring samples in a delay line."""
        return tuple(tap for tap in self.taps if not (tap.tap.passed_on or tap.tap.longest))

    @cached_property
    def lines(self) -> tuple[str, ...]:
        """External signals that are kept in delay lines; those between parts come after them."""
        return tuple(dict.fromkeys(tap.tap.signal for tap in self.windows if tap.between < 0))

    @cached_property
    def _lines_between(self) -> tuple[int, ...]:
        """Signals between parts that are kept in delay lines, by `TapOf.between`."""
        return tuple(dict.fromkeys(tap.between for tap in self.windows if tap.between >= 0))

    @cached_property
    def line_count(self) -> int:
        """Delay lines of all signals."""
        return len(self.lines) + len(self._lines_between)

    def line_of(self, tap: TapOf) -> int:
        """Number of the line that a tap reads."""
        if tap.between < 0:
            return self.lines.index(tap.tap.signal)
        return len(self.lines) + self._lines_between.index(tap.between)

    @cached_property
    def histories(self) -> tuple[TapOf, ...]:
        """Taps that look back at an age that changes."""
        return tuple(tap for tap in self.taps if tap.tap.longest)

    @cached_property
    def rings(self) -> tuple[str | int, ...]:
        """Signals that these look at: external ones by name, others by `TapOf.between`."""
        return tuple(dict.fromkeys(_looked_at(tap) for tap in self.histories))

    @property
    def ring_sizes(self) -> tuple[int, ...]:
        """Samples of each ring."""
        return self.reaches or (USUAL_RING,) * len(self.rings)

    def reach(self, tap: TapOf) -> int:
        """Samples that a tap can look back in its ring, its delay included."""
        return self.ring_sizes[self.ring_of(tap)] - BEYOND + 1 - tap.tap.late

    def ring_of(self, tap: TapOf) -> int:
        """Number of the ring that a tap looks back in."""
        return self.rings.index(_looked_at(tap))

    @cached_property
    def registers(self) -> dict[int, str]:
        """Name within the structs of each signal that a sample passes on, by `TapOf.between`."""
        used_names = {*MEMBERS.split(), *self.members}
        used_names |= {
            f"{name}{ending}" for name in self.integrals.values() for ending in ("", "_rate")
        }
        names = signals_between(self.model)
        late = dict.fromkeys(tap.between for tap in self.taps if tap.tap.passed_on)
        return {
            between: _fresh_member(f"late {names[between]}", ("",), used_names) for between in late
        }

    @property
    def settles(self) -> bool:
        """Whether every part that remembers something has an equation for its steady state."""
        return all(
            part.settled is not None or not floats_of(part.state) for part in self.model.parts
        )

    @cached_property
    def widest(self) -> int:
        """Samples of the widest window."""
        return max([tap.tap.samples for tap in self.windows], default=3)


def rooms_of(machine: Machine, step: float) -> tuple[int, ...]:
    """Samples of each of an exported machine's rings: as far as its numbers look back at a step."""
    model = machine.model
    rooms = dict[str | int, int]()
    for tap in taps_of(model, model.external):
        if tap.tap.longest:
            p = machine.parts[tap.part].p
            delay = float(value_at(p, tap.tap.delay)) if tap.tap.delay else 0.0
            ages = delay / step + float(value_at(p, tap.tap.longest)) / step
            key = _looked_at(tap)
            rooms[key] = max(rooms.get(key, 0), ceil(ages) + tap.tap.late + BEYOND)
    return tuple(rooms.values())


def _looked_at(tap: TapOf) -> str | int:
    """The signal that a tap looks at: an external one by name, others by number."""
    return tap.tap.signal if tap.between < 0 else tap.between


def _flat(name: str) -> str:
    """A path as a name of its own."""
    return ascii_name(name.replace(".", "_"))


def _fresh_member(name: str, endings: Iterable[str], used_names: set[str]) -> str:
    """Name of members that differ in their endings, none of which is taken."""
    member = c_name(name.replace(" ", "_"))
    while any(f"{member}{ending}" in used_names for ending in endings):
        member += "_"
    used_names |= {f"{member}{ending}" for ending in endings}
    return member
