"""Machines of a user's own: from a word of the command line to a model with its numbers."""

from __future__ import annotations

import sys
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass, field, replace
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, cast

from swashplate.cli.parsing import MachineWord, assignments_of, fitted_numbers
from swashplate.errors import InputError, UnknownNameError
from swashplate.tables import UNIT, Column, Table, share_cell
from swashplate.units import unit_text

if TYPE_CHECKING:
    from types import ModuleType

    from swashplate.drive import Drive, Simulation
    from swashplate.identification import ModelSetup
    from swashplate.machine import Machine, Model, Ports, Run

MACHINE, MODEL = "machine", "model"
"""Names that stand for a file's machine if none is named, in this order."""
ROUNDING = 1e-12
"""Part of a signal's size below which a value of it is rounding. [1]"""
EXAMPLE = "gain=0.03, hoist.pump.Z9=0.2 or lag=50ms"
INPUT_EXAMPLE = "supply=100 or supply=9.5MPa"


class NumberDefinition(NamedTuple):
    """What a number of a machine is."""

    name: str
    """In words."""
    unit: str


@dataclass(frozen=True)
class OwnMachine:
    """A machine of a user's own, and what its file says of how it is run."""

    machine: Machine
    title: str
    """For a heading."""
    begin: Mapping[str, float] = field(default_factory=dict)
    """States at the first sample that differ from those at rest, by path."""
    units: Mapping[str, str] = field(default_factory=dict)
    """Units of parameters that the file states beside their bounds, by path."""
    rate: float | None = None
    """Samples a second that the model is made for. [Hz]"""
    substeps: int | None = None
    """Steps a sample."""
    changes: tuple[str, ...] = ()
    """A line for each number that is not as its file has it."""
    stated: frozenset[str] = frozenset()
    """States that the command line sets, by path."""

    @property
    def model(self) -> Model:
        """Its equations; a black box, which has none, is refused."""
        return self.machine.model

    @property
    def ports(self) -> Ports:
        """What it takes, gives and is set by."""
        return self.machine.ports

    @property
    def needed(self) -> tuple[str, ...]:
        """Inputs without which it cannot run, in their order."""
        ports = self.ports
        return tuple(name for name in ports.external if name not in ports.input_parameters)

    def driven(self, given: Collection[str] = ()) -> str:
        """Its first input that is not given otherwise, which drives it if none is named."""
        inputs = self.needed or self.ports.external
        if not inputs:
            raise InputError(f"{self.title}: the equations of {self.machine.name} take no input.")
        return next((name for name in inputs if name not in given), inputs[0])

    def named(self, name: str, names: Sequence[str], what: str) -> str:
        """The full name of an input, an output or a signal; a wrong one is refused."""
        from swashplate.machine.model import full_name, near_names

        full = full_name(name, names)
        if full not in names:
            raise UnknownNameError(f"{self.machine.name} has no {what} {near_names(name, names)}.")
        return full

    def input_named(self, name: str) -> str:
        """The full name of an input."""
        return self.named(name, self.ports.external, "input")

    def unit(self, signal: str) -> str:
        """Unit of an input or a signal; empty if the model states none."""
        definition = self.ports.definitions.get(signal)
        return definition.unit if definition else ""

    def meaning(self, signal: str) -> str:
        """What an input or a signal is, in words; empty if the model does not say it."""
        definition = self.ports.definitions.get(signal)
        return definition.name if definition else ""

    def constants(self, option: str, assignments: Sequence[str]) -> dict[str, float]:
        """Constant inputs of assignments such as ``supply=100``; a number alone is the first."""
        written = [each if "=" in each else f"{self.driven()}={each}" for each in assignments]

        def definition(name: str) -> NumberDefinition:
            full = self.input_named(name)
            return NumberDefinition(self.meaning(full) or full, self.unit(full))

        values = assignments_of(option, written, INPUT_EXAMPLE, definition, (1,), units=True)
        return {self.input_named(name): value for name, value in values.items()}

    def check_needed(self, given: Sequence[str], option: str) -> None:
        """Refuse the lack of an input."""
        lacking = [name for name in self.needed if name not in given]
        if lacking:
            units = {name: unit_text(self.unit(name)) for name in lacking}
            listed = ", ".join(f"{name} [{unit}]" if unit else name for name, unit in units.items())
            raise InputError(
                f"{self.machine.name} needs {listed} as well: write {option} {lacking[0]}=NUMBER."
            )

    def steps_a_second(self, stated: float | None = None) -> float:
        """Steps of its equations, as many as `simulate` takes, unless others are stated. [Hz]"""
        from swashplate.machine.marching import SOURCE_RATE, check_rate, substeps_of

        if stated is not None:
            check_rate(stated)
            return stated
        rate = self.rate or SOURCE_RATE
        return rate * (substeps_of(self.ports, rate, self.substeps) or 1)

    def table(self) -> Table:
        """Its parameters with their units."""
        columns = (Column("parameter"), Column("meaning", wrap=True), Column("", ".6g"), UNIT)
        table = Table("", columns, si=True)
        definitions = parameter_definitions(self)
        for path, value in self.machine.numbers.items():
            definition = definitions[path]
            table.add(path, definition.name, value, unit=definition.unit)
        return without_empty(table)

    def signals_table(self) -> Table:
        """Its inputs, states and signals."""
        table = Table("", (Column("signal"), Column("is"), Column("meaning", wrap=True), UNIT))
        ports = self.ports
        for name in dict.fromkeys((*ports.external, *ports.every_signal, *ports.integrals)):
            what = "state" if name in ports.state_signals else "signal"
            if name in ports.external:
                what = "input"
            table.add(name, what, self.meaning(name), unit=self.unit(name))
        return without_empty(table)


# --- from a file ----------------------------------------------------------------------------------


def machine_in(word: MachineWord) -> OwnMachine | Drive:
    """The machine, or the drive, that a word names."""
    from swashplate.drive import Drive
    from swashplate.identification import ModelSetup
    from swashplate.identification.estimation import loaded_module, measured
    from swashplate.machine import Machine, Model

    # a script may print: that is no part of what the command says
    with redirect_stdout(sys.stderr):
        module = loaded_module(word.file)
    name = word.name or (MACHINE if hasattr(module, MACHINE) else MODEL)
    if not hasattr(module, name):
        raise UnknownNameError(_lacks(word, module))
    found = getattr(module, name)
    title = str(word.file) if name in (MACHINE, MODEL) else f"{word.file}:{name}"
    if word.fitted:
        title = f"{word.fitted} ({word.file})"
    if isinstance(found, Drive):
        return found
    if not isinstance(found, Machine | Model):
        raise InputError(
            f"{word.file}: {name} has the type {type(found).__name__}, which is nothing to run: "
            "give a Machine, or a Model of equations."
        )
    setup = ModelSetup.from_file(word.file) if hasattr(module, "free") else None
    if setup is not None and not (found is setup.model or found is setup.measured.equations):
        setup = None
    if word.fitted and setup is None:
        raise InputError(f"{word.file} has no 'free', so that {word.fitted} is no fit of it.")
    if isinstance(found, Machine):
        own = _of_machine(found, word, setup, title)
    else:
        own = _of_model(found, word, setup, title)
    if setup is None and name in (MACHINE, MODEL):
        rate, substeps = (getattr(module, each, None) for each in ("rate", "substeps"))
        measured(found, rate=rate, substeps=substeps)  # refuses what is none
        own = replace(own, rate=rate, substeps=substeps)
    return own


def _lacks(word: MachineWord, module: ModuleType) -> str:
    """That a file has no machine of a name, and which it has."""
    from swashplate.drive import Drive
    from swashplate.machine import Machine

    has = [key for key, value in vars(module).items() if isinstance(value, Drive | Machine)]
    listed = f"; there are {', '.join(has)}" if has else ""
    if word.name:
        return f"{word.file} has no '{word.name}'{listed}."
    if has:
        return f"{word.file} has no 'machine'{listed}: write {word.file}:{has[0]}."
    return f"{word.file} has no machine: it needs machine = Machine(model, ...)."


def _of_machine(
    found: Machine, word: MachineWord, setup: ModelSetup | None, title: str
) -> OwnMachine:
    """A machine as it stands in its file, or with the numbers of a fit to it."""
    if setup is None:
        return OwnMachine(found, title)
    numbers = dict(setup.fixed)
    if word.fitted:
        of_machine = [name for name in found.numbers if not setup.measured.starts(name)]
        numbers |= fitted_numbers(word, setup, of_machine)
    changes = {name: value for name, value in numbers.items() if name in found.numbers}
    return _as_fitted(found.replace(changes), setup, _nominal(setup) | numbers, title)


def _of_model(found: Model, word: MachineWord, setup: ModelSetup | None, title: str) -> OwnMachine:
    """A model with the numbers of its file, or of a fit to it."""
    from swashplate.machine import Machine
    from swashplate.machine.fields import defaults_of, tuple_from
    from swashplate.machine.model import parameter_paths

    numbers = {**setup.held, **_nominal(setup)} if setup is not None else {}
    paths = parameter_paths(found)
    if word.fitted and setup is not None:
        numbers |= fitted_numbers(word, setup, [name for name in numbers if name in paths])
    of_model = {name: value for name, value in numbers.items() if name in paths}
    lacking = [name for name in paths if name not in {**defaults_of(found.parameters), **of_model}]
    if lacking:
        raise InputError(
            f"{word.file} states no value of {', '.join(lacking)}: name it in free or fixed, or "
            f"write machine = Machine({found.name}, ...) there."
        )
    given = None if setup is None else setup.given
    if isinstance(given, Mapping):
        raise InputError(
            f"{word.file}: what is given of {found.name} depends on the run: write machine = "
            "Machine(model, ..., given=...) there."
        )
    machine = Machine(found, tuple_from(found.parameters, of_model), given=given)
    if setup is None:
        return OwnMachine(machine, title)
    return _as_fitted(machine, setup, numbers, title)


def _nominal(setup: ModelSetup) -> dict[str, float]:
    """Nominal values of what is free, by the machine's names."""
    numbers = dict[str, float]()
    for unknown in setup.free.values():
        numbers |= dict.fromkeys(unknown.targets, unknown.start)
    return numbers


def _as_fitted(
    machine: Machine, setup: ModelSetup, numbers: Mapping[str, float], title: str
) -> OwnMachine:
    """A machine, and what a setup says of how it is run; `numbers` say where a run begins."""
    begin, units = dict[str, float](), dict[str, str]()
    for name, value in numbers.items():
        begin |= dict.fromkeys(setup.measured.states_of(name), value)
    for unknown in setup.free.values():
        units |= dict.fromkeys(unknown.targets, unknown.unit)
    return OwnMachine(
        machine=machine,
        title=title,
        begin=begin,
        units=units,
        rate=setup.rate,
        substeps=setup.substeps,
    )


def fitted_setup(model: Path, fitted: str | None) -> ModelSetup:
    """What is to be found of a model, from the numbers of a fit on if its folder is named."""
    from swashplate.identification import ModelSetup

    setup = ModelSetup.from_file(model)
    if fitted is None:
        return setup
    word = MachineWord(model, fitted=fitted)
    numbers = fitted_numbers(word, setup, [])
    free = {}
    for name, unknown in setup.free.items():
        value = next((numbers[target] for target in unknown.targets if target in numbers), None)
        free[name] = unknown if value is None else replace(unknown, start=value)
    return replace(setup, free=free)


# --- changes --------------------------------------------------------------------------------------


def parameter_definitions(own: OwnMachine) -> dict[str, NumberDefinition]:
    """Meaning and unit of each parameter, by path."""
    definitions = dict[str, NumberDefinition]()
    for path, definition in own.ports.parameter_definitions.items():
        is_stated = definition.name != path.rpartition(".")[2]
        definitions[path] = NumberDefinition(definition.name if is_stated else "", definition.unit)
    for path, unit in own.units.items():
        if path in definitions and unit:
            definitions[path] = definitions[path]._replace(unit=unit)
    return definitions


def changed(own: OwnMachine, values: Sequence[str] = (), factors: Sequence[str] = ()) -> OwnMachine:
    """A machine with values set and then scaled; ``start.PATH`` is a state at the first sample."""
    from swashplate.identification.estimation import states_started_by
    from swashplate.machine.model import full_name, near_names

    if not values and not factors:
        return own
    numbers = dict(own.machine.numbers)
    parameters = parameter_definitions(own)
    starts = dict(_starts(own))
    names = [*parameters, *starts]

    def full(name: str) -> str:
        known = full_name(name, names)
        if known.startswith("start.") and known not in names:
            paths = [start.removeprefix("start.") for start in starts]
            known = "start." + full_name(name.removeprefix("start."), paths)
        if known not in names:
            has_not = f"{own.machine.name} has no parameter"
            raise UnknownNameError(f"{has_not} {near_names(name, names)}.")
        return known

    def definition(name: str) -> NumberDefinition:
        found = {**parameters, **starts}[full(name)]
        return found._replace(name=found.name or name)

    to_set = assignments_of("--set", values, EXAMPLE, definition, (1,), units=True)
    to_scale = assignments_of("--scale", factors, "gain=1.5", definition, (1,))
    begin, stated = dict(own.begin), set(own.stated)
    lines = list[str]()
    for name, value in {full(each): number for each, number in to_set.items()}.items():
        if isnan(value):
            raise InputError(f"--set {name}=nan is no number; write it as {EXAMPLE}.")
        if name in starts:
            paths = states_started_by(own.model, name)
            begin |= dict.fromkeys(paths, value)
            stated |= set(paths)
            lines.append(f"{name}: {value:g} {unit_text(starts[name].unit)}".rstrip())
        else:
            numbers[name] = value
    for name, factor in {full(each): number for each, number in to_scale.items()}.items():
        if name in starts:
            raise InputError(f"--scale {name}: the start of a state is set, by --set {name}=VALUE.")
        numbers[name] *= factor
    before = own.machine.numbers
    changes = {name: number for name, number in numbers.items() if number != before[name]}
    for name, number in changes.items():
        unit = unit_text(parameters[name].unit)
        lines.append(f"{name}: {before[name]:g} -> {number:g} {unit}".rstrip())
    return replace(
        own,
        machine=own.machine.replace(changes),
        begin=begin,
        changes=tuple(lines),
        stated=frozenset(stated),
    )


def _starts(own: OwnMachine) -> Iterator[tuple[str, NumberDefinition]]:
    """What can be set of the state at the first sample, by name."""
    for name, signal in own.ports.starts.items():
        words = own.meaning(signal) or signal.rpartition(".")[2]
        yield name, NumberDefinition(words, own.unit(signal))


# --- runs -----------------------------------------------------------------------------------------


def run_tables(own: OwnMachine | None, run: Run) -> list[Table]:
    """Lowest, highest and last value of each signal, and the share of time of each limit.

    A run that has tables of its own, as that of a drive, shows these.
    """
    if own is None:
        return [*cast("Simulation", run).tables()]
    columns = (
        Column("signal"),
        Column("meaning", wrap=True),
        *(Column(name, ".4g") for name in ("lowest", "highest", "last")),
        UNIT,
    )
    signals = Table("", columns)
    outputs = own.ports.outputs
    for name in dict.fromkeys((*run.records, *outputs) if outputs else run.names[1:]):
        values = run[name]
        ends = [float(values.min()), float(values.max()), float(values[-1])]
        rounding = ROUNDING * max(map(abs, ends))
        shown = [0.0 if abs(value) <= rounding else value for value in ends]
        signals.add(name, own.meaning(name), *shown, unit=own.unit(name))
    tables = [signals, limits_table(own, run)]
    return [without_empty(table) for table in tables if table.rows]


def without_empty(table: Table) -> Table:
    """A table without the columns in which nothing is said."""
    kept = [
        k
        for k, column in enumerate(table.columns)
        if column.spec or any(row.cells[k] for row in table.rows)
    ]
    rows = [row._replace(cells=tuple(row.cells[k] for k in kept)) for row in table.rows]
    return replace(table, columns=[table.columns[k] for k in kept], rows=rows)


def limits_table(own: OwnMachine, run: Run | None = None) -> Table:
    """Limits that the model declares and ranges of its signals; with a run the time of each."""
    of_run = (Column("share of time", ".1%"),) if run is not None else ()
    table = Table("", (Column("limit"), Column("meaning", wrap=True), *of_run))
    for name, meaning in own.ports.limit_meanings.items():
        share = [share_cell(float(run.active(name).mean()))] if run is not None else []
        table.add(name, meaning, *share)
    for name, definition in own.ports.definitions.items():
        # an input beyond its range is refused, so that none is ever there
        if definition.range == "any finite number" or name in own.ports.external:
            continue
        share = []
        if run is not None:
            if name not in run.names:
                continue
            share = [share_cell(float((~definition.holds(run[name])).mean()))]
        unit = f" {unit_text(definition.unit)}" if unit_text(definition.unit) else ""
        table.add(f"range of {name}", f"{definition.name}: {definition.range}{unit}", *share)
    return table
