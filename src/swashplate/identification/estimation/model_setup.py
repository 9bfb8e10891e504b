"""A machine as it is fitted: what is to be found of it, and its numbers."""

from __future__ import annotations

import sys
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib import import_module
from math import inf
from pathlib import Path
from traceback import extract_tb
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import Experiment
from swashplate.documents import validated
from swashplate.errors import (
    FileError,
    InputError,
    MissingFileError,
    ParameterError,
    SwashplateError,
    UnknownNameError,
    meant,
)
from swashplate.identification.estimation.measured_machine import (
    MeasuredBlackBox,
    MeasuredEquations,
    MeasuredMachine,
    measured,
)
from swashplate.identification.estimation.model import simulated
from swashplate.identification.estimation.problem import Problem, noise_scales
from swashplate.identification.estimation.setup import (
    FitSetup,
    Free,
    StandardUncertainty,
    deviation,
)
from swashplate.identification.estimation.solving import solve
from swashplate.identification.estimation.unknowns import Unknown, Unknowns, zero_name
from swashplate.machine.fields import Definition, check_mapping, is_real
from swashplate.machine.model import full_name
from swashplate.machine.plausible import check_plausible
from swashplate.results import Result
from swashplate.tables import listed

Array = NDArray[np.float64]
Range = (
    tuple[float, float]
    | tuple[float, float, str]
    | tuple[float, float, float]
    | tuple[float, float, float, str]
)
"""Lower bound, nominal value unless it is the machine's number, upper bound, and the unit if it is
said."""
IN_FILE = ("machine", "model")
"""Names of a file's machine, the first before the second."""
BESIDE = (
    "free",
    "name",
    "channels",
    "noise",
    "fixed",
    "standard_uncertainty",
    "rate",
    "substeps",
    "inputs",
    "each_run",
    "begin",
    "given",
)
"""What a file may say besides."""
BY_ORDER = 10.0
"""Ratio of positive bounds from which a range is searched by the logarithm."""


@dataclass(frozen=True, eq=False)
class ModelSetup(Result):
    """A machine and what is to be found of it.

    It is what a `ParameterSet` and a `FitSetup` together are of a drive. Of a `Machine` all numbers
    that are not free stay as they are, as do its options and givens; of a `Model`, which has no
    numbers, each is free or `fixed`.

    Of a name that is a path the last word is enough where it is unique. An entry of `free` is
    (low, high), which begins at the machine's number, (low, nominal, high), each with a unit behind
    it if you like, or an `Unknown`. A range of positive bounds, the upper one at least ten times
    the lower one, is searched by its logarithm. ``"start.PATH"`` of a state and ``"offset
    CHANNEL"``, the zero of a sensor, are free in each run by themselves.

    Examples
    --------
    >>> from swashplate import FullOrderDrive
    >>> from swashplate.identification import ModelSetup
    >>> machine = FullOrderDrive.preset("hoist").by_current
    >>> setup = ModelSetup(machine, {"load_inertia": (10.0, 1e4)}, rate=512.0)
    >>> setup.free["plant.machine.load_inertia"].start
    150.0
    """

    model: Any
    """A `Machine`, of equations or a `BlackBox`, or a `Model` without numbers."""
    free: Mapping[str, Any]
    """What is to be found, by the machine's names."""
    name: str = ""
    """For tables and files; the machine's by default."""
    channels: tuple[str, ...] = ()
    """Those that are fitted; all that the machine gives by default."""
    noise: Mapping[str, float] = field(default_factory=dict)
    """Standard deviation of a channel, if the campaign does not state it. [unit]"""
    fixed: Mapping[str, float] = field(default_factory=dict)
    """Values of names that are not free, in the place of the machine's."""
    standard_uncertainty: Mapping[str, StandardUncertainty] = field(default_factory=dict)
    """What values that are not free may be off by, one standard deviation, also as ``"5 %"``."""
    rate: float | None = None
    """Samples a second; by default the input's. Needed if its stamps are not even. [Hz]"""
    substeps: int | None = None
    """Steps of the equations a sample; by default one, or so many as the longest step demands."""
    inputs: Mapping[str, float] = field(default_factory=dict)
    """What an input stays at in runs without a channel of its name. [unit]"""
    each_run: tuple[str, ...] = ()
    """What is free in each run by itself, besides beginnings of states and zeros of sensors."""
    begin: Mapping[str, str] = field(default_factory=dict)
    """Channel that says where a number of the state begins, by its path: at the first sample that
    counts."""
    given: Any = None
    """What is given of the runs, if not the machine's: one for all, or a mapping by their names."""
    numbers: Mapping[str, float] = field(default_factory=dict)
    """Its numbers, nominal or fitted, those of single runs left out; see `nominal`."""
    scales: Mapping[str, float] = field(default_factory=dict)
    """What one unit of residual is, by channel: its noise. [unit]"""

    def __post_init__(self) -> None:
        for table in ("free", "noise", "fixed", "standard_uncertainty"):
            check_mapping(table, getattr(self, table))
        for table in ("channels", "each_run"):
            if isinstance(getattr(self, table), str):
                raise InputError(f"Give {table} as ('{getattr(self, table)}',).")
        machine = self.measured
        name = self.name or machine.name.lower()
        for table in ("free", "fixed", "standard_uncertainty"):
            by_path = {_full(key, machine): entry for key, entry in getattr(self, table).items()}
            object.__setattr__(self, table, by_path)
        self._check_free_and_fixed(name)
        _check_numbers(f"{name}: the noise", self.noise, 0.0)
        _check_numbers(f"{name}: the fixed value", self.fixed, -inf)
        ranges = [key for key, entry in self.free.items() if not isinstance(entry, Unknown)]
        _check_names(machine, "free", ranges)
        free = {key: _unknown(key, entry, machine) for key, entry in self.free.items()}
        targets = [target for unknown in free.values() for target in unknown.targets]
        _check_names(machine, "free", targets)
        _check_names(machine, "fixed", self.fixed)
        _check_ranges(name, machine, free, self.fixed)
        object.__setattr__(self, "each_run", tuple(_full(key, machine) for key in self.each_run))
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "free", free)
        not_free = [key for key in self.each_run if key not in free]
        if not_free:
            raise InputError(f"{not_free[0]} of {name} is in each_run, but is not free.")
        without_value = [key for key in self.standard_uncertainty if key not in self.held]
        if without_value:
            raise InputError(
                f"{without_value[0]} has a standard uncertainty but no value: name it in fixed, or "
                "give it a prior if it is free."
            )
        _ = self.setup  # refuses what is not an uncertainty

    @cached_property
    def measured(self) -> MeasuredEquations | MeasuredBlackBox:
        """The machine as experiments drive and measure it: what a `Problem` simulates."""
        return measured(
            self.model,
            rate=self.rate,
            substeps=self.substeps,
            inputs=self.inputs,
            begin=self.begin,
            given=self.given,
        )

    @cached_property
    def held(self) -> Mapping[str, float]:
        """Values of what is not free, the machine's own and those of `fixed`."""
        free = {target for unknown in self.free.values() for target in unknown.targets}
        own = {name: value for name, value in self.measured.numbers.items() if name not in free}
        return own | dict(self.fixed)

    def definition(self, name: str) -> Definition:
        """What one of its numbers is; empty where the machine does not say it."""
        definitions = self.measured.ports.parameter_definitions
        last = name.rpartition(".")[2]
        stated = definitions.get(name, Definition(last, ""))
        return stated if stated.name != last else Definition("", "")

    def _check_free_and_fixed(self, name: str) -> None:
        """Refuse a setup without anything free, or with a name in two tables."""
        if not self.free:
            raise InputError(f"Nothing of {name} is free: name the parameters to estimate.")
        both = [key for key in self.free if key in self.fixed]
        if both:
            raise InputError(f"{both[0]} of {name} is free and fixed: name it in one of them.")

    @classmethod
    def from_file(cls, path: str | Path) -> ModelSetup:
        """The fit setup that a Python file states by its names ``machine`` and ``free``.

        A file without a ``machine`` has a ``model``. Besides it may have ``name``, ``channels``,
        ``noise``, ``fixed``, ``standard_uncertainty``, ``rate``, ``substeps``, ``begin`` and
        ``given``. The file is executed, as a module that worker processes import as well.

        Raises
        ------
        FileError
            If there is no such file, or a module of that name is another one.
        InputError
            If it lacks one of the names.
        """
        module = loaded_module(path)
        word = next((each for each in IN_FILE if hasattr(module, each)), IN_FILE[0])
        for name in (word, "free"):
            if not hasattr(module, name):
                raise InputError(
                    f"{path} has no '{name}': it needs machine = Machine(model, ...) and free = "
                    "{'lag': (0.005, 0.5), ...}, lower and upper bound."
                )
        stated = {name: getattr(module, name) for name in BESIDE if hasattr(module, name)}
        try:
            return cls(getattr(module, word), **stated)
        except SwashplateError as error:
            raise type(error)(f"{path}: {error}") from None

    @property
    def setup(self) -> FitSetup:
        """What is free, in the form of a fit setup."""
        free = {
            unknown.name: Free(
                bounds=(unknown.low, unknown.high), log=unknown.log, prior=unknown.prior
            )
            for unknown in self.free.values()
        }
        content = {"title": self.name, "part": "model", "free": free}
        uncertain = {"standard_uncertainty": dict(self.standard_uncertainty)}
        return validated(content | uncertain, FitSetup, self.name)

    def nominal(self, experiments: Sequence[Experiment]) -> ModelSetup:
        """The fit setup with the numbers before a fit to some runs."""
        measured = dict.fromkeys(name for run in experiments for name in run.channels)
        strange = [name for name in self.noise if name not in measured]
        if strange:
            raise InputError(
                f"{self.name}: noise is stated for '{strange[0]}'{meant(strange[0], measured)}, "
                f"but the channels are {', '.join(measured) or 'none'}."
            )
        problem = self.problem(experiments)
        numbers = {**self.held, **problem.unknowns.targets(problem.start, "")}
        return replace(self, numbers=numbers, scales=problem.scales)

    def problem(self, experiments: Sequence[Experiment], *, threads: int = 1) -> Problem:
        """The problem that it states for some runs, one of which has a channel that is fitted."""
        channels = tuple(self.channels) or self._channels_given(experiments)
        runs = [run for run in experiments if any(name in run.channels for name in channels)]
        if not runs:
            measured = dict.fromkeys(name for run in experiments for name in run.channels)
            raise InputError(
                f"{self.name} is fitted to {', '.join(channels) or 'nothing'}, but the runs have "
                f"{', '.join(measured) or 'no channel'}."
            )
        for k, run in enumerate(runs):  # the noise of channels that the campaign does not state
            noises = {
                name: replace(channel, noise=channel.noise or self.noise.get(name))
                for name, channel in run.channels.items()
            }
            runs[k] = replace(run, channels=noises)
        of_any_run = {unknown.name for run in experiments for unknown in self.unknowns_of_run(run)}
        unknowns = [unknown for unknown in self.free.values() if unknown.name not in of_any_run]
        for run in runs:
            unknowns += self.unknowns_of_run(run)
        values, zeros = _without_zeros(self.held, channels)
        return Problem(
            self.measured,
            tuple(runs),
            Unknowns(tuple(unknowns)),
            channels,
            noise_scales(runs, channels),
            fixed=values,
            zeros=zeros,
            uncertain=tuple(
                {name: deviation(stated, self.held[name])}
                for name, stated in self.standard_uncertainty.items()
            ),
            threads=threads if self.measured.threads_help else 1,
        )

    def _channels_given(self, experiments: Sequence[Experiment]) -> tuple[str, ...]:
        """Names of the channels that the machine gives; one that it does not know is refused."""
        given = dict[str, None]()
        for experiment in experiments:
            names = [*self.measured.signals_of(experiment)]
            self._check_channels(experiment, names)
            given |= dict.fromkeys(names)
        return tuple(given)

    def _check_channels(self, experiment: Experiment, given: Collection[str]) -> None:
        """Refuse a channel that the machine neither gives nor takes: its name may be a slip."""
        machine = self.measured
        for name in experiment.channels:
            if name in given or machine.takes(name):
                continue
            unmeasured = [each for each in machine.signals if each not in experiment.channels]
            without_channel = ""
            if unmeasured:
                without_channel = f" Signals of the model without a channel: {listed(unmeasured)}."
            fitted = "".join(f'"{channel}", ' for channel in given).strip()
            raise UnknownNameError(
                f"{experiment.name}: the channel '{name}' is no signal of {self.name}"
                f"{meant(name, unmeasured)}.{without_channel} Call the channel like its signal; if "
                f"it is to be left out, state channels = ({fitted}) beside the model."
            )

    def unknowns_of_run(self, experiment: Experiment) -> tuple[Unknown, ...]:
        """The unknowns of a single run: where its state begins, and the zeros of its sensors."""
        run = experiment.name
        channels = {zero_name(name): name for name in experiment.channels}
        unknowns = list[Unknown]()
        for unknown in self.free.values():
            if unknown.run is not None:
                continue
            channel = channels.get(unknown.name)
            if channel:
                unknowns.append(replace(unknown, run=run, kind="zero", channel=channel))
            elif unknown.name in self.each_run or self.measured.starts(unknown.name):
                unknowns.append(replace(unknown, run=run, kind="start"))
        return tuple(unknowns)

    def predicted(self, experiment: Experiment) -> Mapping[str, Array]:
        """A run predicted from its input: for each channel (m,) samples at its stamps. [unit]

        What is free in each run by itself, a beginning of the state or the zero of a sensor, is
        estimated from this run; everything else is as it is.
        """
        of_run = self.unknowns_of_run(experiment)
        unknowns = tuple(unknown for unknown in of_run if unknown.name not in self.numbers)
        channels = tuple(name for name in self.scales if name in experiment.channels)
        if not unknowns:
            outputs = simulated(self.measured, self.numbers, experiment)
            return {name: outputs[name] for name in channels}
        values, zeros = _without_zeros(self.numbers, channels)
        problem = Problem(
            self.measured,
            (experiment,),
            Unknowns(unknowns),
            channels,
            self.scales,
            fixed=values,
            zeros=zeros,
        )
        return problem.outputs(solve(problem).vector, 0)


def loaded_module(path: str | Path) -> ModuleType:
    """A Python file, executed as a module that worker processes import as well.

    A script that reads its arguments finds none.

    Raises
    ------
    FileError
        If there is no such file, or it cannot be executed, or a module of its name is another one.
    """
    file = Path(path).resolve()
    if not file.exists():
        raise MissingFileError(f"There is no file {path}: name a Python file with a model.")
    if not file.is_file() or file.suffix != ".py" or not file.stem.isidentifier():
        raise FileError(f"{path} is not a Python file with a model, such as valve.py.")
    if str(file.parent) not in sys.path:
        sys.path.insert(0, str(file.parent))
    arguments = sys.argv
    sys.argv = [str(path)]
    try:
        module = import_module(file.stem)
    except SystemExit as error:
        sys.modules.pop(file.stem, None)
        raise FileError(
            f"{path} ended Python with sys.exit({error.code!r}) when it was loaded: guard the "
            "part of the file that runs as a script by if __name__ == '__main__'."
        ) from None
    except Exception as error:  # the user's own code, which can raise anything
        sys.modules.pop(file.stem, None)
        trace = extract_tb(error.__traceback__)
        lines = [entry.lineno for entry in trace if entry.filename == str(file)]
        line = getattr(error, "lineno", None) or (lines[-1] if lines else None)
        where = f"{path}, line {line}" if line else f"{path}"
        raise FileError(f"{where}: {type(error).__name__}: {error}.") from None
    finally:
        sys.argv = arguments
    if module.__file__ is None or Path(module.__file__).resolve() != file:
        raise FileError(f"{path}: another module is called {file.stem}; rename the file.")
    return module


def _without_zeros(
    values: Mapping[str, float], channels: Sequence[str]
) -> tuple[dict[str, float], dict[str, float]]:
    """Values by the model's names, and the zeros of channels among them by the channel."""
    names = {zero_name(channel): channel for channel in channels}
    zeros = {channel: values[name] for name, channel in names.items() if name in values}
    return {name: value for name, value in values.items() if name not in names}, zeros


def _check_numbers(table: str, numbers: Mapping[str, float], least: float) -> None:
    """Refuse what is not a finite number above `least`."""
    for key, number in numbers.items():
        if not is_real(number) or not least < number < inf:
            must = "finite" if least < 0.0 else "above 0"
            raise InputError(f"{table} of '{key}' is {number!r}, but must be {must}.")


def _full(name: str, machine: MeasuredMachine) -> str:
    """The path of a parameter whose last word is given, if it is the only such one."""
    known = [*machine.ports.parameter_definitions, *map(zero_name, machine.signals)]
    return name if name in known or machine.starts(name) else full_name(name, known)


def _check_ranges(
    name: str, machine: MeasuredMachine, free: Mapping[str, Unknown], fixed: Mapping[str, float]
) -> None:
    """Refuse bounds and values that the machine's parameters cannot have."""
    for key, definition in machine.ports.ranges.items():
        if key in free:
            for bound in (free[key].low, free[key].high):
                if not definition.holds(bound):
                    raise ParameterError(f"{name}, a bound: {definition.broken(key, bound)}.")
                check_plausible(f"{name}, a bound: {key}", definition, bound)
            check_plausible(f"{name}: {key}", definition, free[key].start)
        if key in fixed:
            check_plausible(f"{name}, fixed: {key}", definition, fixed[key])


def _check_names(machine: MeasuredMachine, table: str, names: Iterable[str]) -> None:
    """Refuse a name that is neither a parameter, a start of a state nor the zero of a signal."""
    paths, zeros = machine.ports.parameter_definitions, [*map(zero_name, machine.signals)]
    for name in names:
        if name not in (*paths, *zeros) and not machine.starts(name):
            raise UnknownNameError(
                f"{machine.ports.name} has no parameter '{name}', which {table} names"
                f"{meant(name, paths)}; it has {', '.join(paths)}."
            )


def _unknown(name: str, entry: Range | Unknown, machine: MeasuredMachine) -> Unknown:
    """What is to be found, of a range from the machine's number on unless one is said."""
    if isinstance(entry, Unknown):
        if name not in (entry.name, *entry.sets):
            raise InputError(
                f"'{name}' is free as the parameter '{entry.name}': give both one name."
            )
        return entry
    definition = machine.ports.parameter_definitions.get(name)
    unit = definition.unit if definition else ""
    try:
        *bounds, last = entry
        if isinstance(last, str):
            unit = last
        else:
            bounds.append(last)
        if len(bounds) == 2 and name in machine.numbers:
            bounds.insert(1, machine.numbers[name])
        low, start, high = (float(number) for number in bounds)
    except (TypeError, ValueError):
        raise InputError(
            f"{name} is free as {entry!r}: give lower bound, nominal value and upper bound, of "
            "which a number of a Machine needs no nominal value, and the unit if you like; or an "
            "Unknown."
        ) from None
    return Unknown(name, start, low, high, unit, low > 0.0 and high >= BY_ORDER * low)
