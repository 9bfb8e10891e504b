"""A user-defined model as it is fitted: what is to be found of it, and its numbers."""

from __future__ import annotations

import sys
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib import import_module
from math import inf
from pathlib import Path
from traceback import extract_tb
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import Channel, Experiment
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
from swashplate.identification.estimation.model import UserModel, simulated, states_started_by
from swashplate.identification.estimation.problem import Problem, noise_scales
from swashplate.identification.estimation.setup import (
    FitSetup,
    Free,
    StandardUncertainty,
    deviation,
)
from swashplate.identification.estimation.solving import solve
from swashplate.identification.estimation.unknowns import Unknown, Unknowns, zero_name
from swashplate.machine import Model as Equations
from swashplate.machine.fields import check_mapping, is_real
from swashplate.machine.model import parameter_paths
from swashplate.machine.plausible import check_plausible
from swashplate.results import Result
from swashplate.tables import listed

Array = NDArray[np.float64]
Range = tuple[float, float, float] | tuple[float, float, float, str]
"""Lower bound, nominal value, upper bound, and the unit if it is said."""
BY_ORDER = 10.0
"""Ratio of positive bounds from which a range is searched by the logarithm."""


@dataclass(frozen=True, eq=False)
class ModelSetup(Result):
    """A user-defined model and what is to be found of it.

    It is what a `ParameterSet` and a `FitSetup` together are of a drive.

    An entry of `free` is (low, nominal, high), (low, nominal, high, unit) or an `Unknown`. A range
    of positive bounds, the upper one at least ten times the lower one, is searched by its
    logarithm. ``"start.PATH"`` of a state and ``"offset CHANNEL"``, the zero of a sensor, are free
    in each run by themselves.
    """

    model: Any
    """A model of equations, a `UserModel` of them with more said, or an object with `simulate`."""
    free: Mapping[str, Any]
    """What is to be found, by the model's names."""
    name: str = ""
    """For tables and files; the model's by default."""
    channels: tuple[str, ...] = ()
    """Those that are fitted; all that the model gives by default."""
    noise: Mapping[str, float] = field(default_factory=dict)
    """Standard deviation of a channel, if the campaign does not state it. [unit]"""
    fixed: Mapping[str, float] = field(default_factory=dict)
    """Values of names that are not free."""
    standard_uncertainty: Mapping[str, StandardUncertainty] = field(default_factory=dict)
    """What values of `fixed` may be off by, one standard deviation, also as ``"5 %"``."""
    numbers: Mapping[str, float] = field(default_factory=dict)
    """The model's numbers, nominal or fitted, those of single runs left out; see `nominal`."""
    scales: Mapping[str, float] = field(default_factory=dict)
    """What one unit of residual is, by channel: its noise. [unit]"""

    def __post_init__(self) -> None:
        for table in ("free", "noise", "fixed", "standard_uncertainty"):
            check_mapping(table, getattr(self, table))
        if isinstance(self.channels, str):
            raise InputError(f"Give the channels as ('{self.channels}',).")
        model = UserModel(self.model) if isinstance(self.model, Equations) else self.model
        if not callable(getattr(model, "simulate", None)):
            raise InputError(
                f"A {type(model).__name__} is not a model: give a Model of equations, or an object "
                "with simulate(values, experiment)."
            )
        equations = model.model if isinstance(model, UserModel) else model
        kind = getattr(equations, "name", None) or type(equations).__name__
        name = self.name or str(kind).lower()
        self._check_free_and_fixed(name)
        _check_numbers(f"{name}: the noise", self.noise, 0.0)
        _check_numbers(f"{name}: the fixed value", self.fixed, -inf)
        free = {key: _unknown(key, entry) for key, entry in self.free.items()}
        if isinstance(model, UserModel):
            targets = [target for unknown in free.values() for target in unknown.targets]
            _check_names(model, "free", targets)
            _check_names(model, "fixed", self.fixed)
        if isinstance(equations, Equations):
            _check_ranges(name, equations, free, self.fixed)
        object.__setattr__(self, "model", model)
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "free", free)
        _ = self.setup  # refuses what is not an uncertainty

    def _check_free_and_fixed(self, name: str) -> None:
        """Refuse a setup without anything free, or with a name in two tables."""
        if not self.free:
            raise InputError(f"Nothing of {name} is free: name the parameters to estimate.")
        without_value = [key for key in self.standard_uncertainty if key not in self.fixed]
        if without_value:
            raise InputError(
                f"{without_value[0]} has a standard uncertainty but no value: name it in fixed, or "
                "give it a prior if it is free."
            )
        both = [key for key in self.free if key in self.fixed]
        if both:
            raise InputError(f"{both[0]} of {name} is free and fixed: name it in one of them.")

    @classmethod
    def from_file(cls, path: str | Path) -> ModelSetup:
        """The fit setup that a Python file states by its names ``model`` and ``free``.

        Besides those it may have ``name``, ``channels``, ``noise``, ``fixed`` and
        ``standard_uncertainty``. The file is executed, as a module that worker processes import as
        well.

        Raises
        ------
        FileError
            If there is no such file, or a module of that name is another one.
        InputError
            If it lacks one of the names.
        """
        module = loaded_module(path)
        for name in ("model", "free"):
            if not hasattr(module, name):
                raise InputError(
                    f"{path} has no '{name}': it needs model = Model(...) and free = "
                    "{'lag': (0.005, 0.06, 0.5), ...}, lower bound, nominal value and upper bound."
                )
        names = ("model", "free", "name", "channels", "noise", "fixed", "standard_uncertainty")
        try:
            return cls(**{key: getattr(module, key) for key in names if hasattr(module, key)})
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
        numbers = {**self.fixed, **problem.unknowns.targets(problem.start, "")}
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
        values, zeros = _without_zeros(self.fixed, channels)
        return Problem(
            self.model,
            tuple(runs),
            Unknowns(tuple(unknowns)),
            channels,
            noise_scales(runs, channels),
            fixed=values,
            zeros=zeros,
            uncertain=tuple(
                {name: deviation(stated, self.fixed[name])}
                for name, stated in self.standard_uncertainty.items()
            ),
            threads=threads if isinstance(self.model, UserModel) else 1,
        )

    def _channels_given(self, experiments: Sequence[Experiment]) -> tuple[str, ...]:
        """Names of the channels that the model gives; one that it does not know is refused."""
        values = {unknown.name: unknown.start for unknown in self.free.values()} | dict(self.fixed)
        given = dict[str, None]()
        for experiment in experiments:
            if isinstance(self.model, UserModel):
                names = [*self.model.signals_of(experiment)]
                taken = {*self.model.model.external, *self.model.begin.values()}
                signals = self.model.signals
            else:
                read = _ReadChannels(experiment.channels)
                names = [*simulated(self.model, values, replace(experiment, channels=read))]
                taken = read.names
                signals = [*names, *sorted(taken)]
            self._check_channels(experiment, names, taken, signals)
            given |= dict.fromkeys(names)
        return tuple(given)

    def _check_channels(
        self,
        experiment: Experiment,
        given: Collection[str],
        taken: Collection[str],
        signals: Sequence[str],
    ) -> None:
        """Refuse a channel that the model neither gives nor takes: its name may be a slip."""
        for name in experiment.channels:
            if name in given or name in taken:
                continue
            unmeasured = [signal for signal in signals if signal not in experiment.channels]
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
        equations = self.model.model if isinstance(self.model, UserModel) else None
        unknowns = list[Unknown]()
        for unknown in self.free.values():
            if unknown.run is not None:
                continue
            channel = channels.get(unknown.name)
            if channel:
                unknowns.append(replace(unknown, run=run, kind="zero", channel=channel))
            elif equations is not None and states_started_by(equations, unknown.name):
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
            outputs = simulated(self.model, self.numbers, experiment)
            return {name: outputs[name] for name in channels}
        values, zeros = _without_zeros(self.numbers, channels)
        problem = Problem(
            self.model,
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


class _ReadChannels(Mapping[str, Channel]):
    """Channels of an experiment that remember which of them a model asked for."""

    def __init__(self, channels: Mapping[str, Channel]) -> None:
        self._channels = channels
        self.names = set[str]()
        """Names that were asked for, whether there is such a channel or not."""

    def __getitem__(self, name: str) -> Channel:
        self.names.add(name)
        return self._channels[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._channels)

    def __len__(self) -> int:
        return len(self._channels)


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


def _check_ranges(
    name: str, equations: Equations, free: Mapping[str, Unknown], fixed: Mapping[str, float]
) -> None:
    """Refuse bounds and values that the model's parameters cannot have."""
    for key, definition in equations.ranges.items():
        if key in free:
            for bound in (free[key].low, free[key].high):
                if not definition.holds(bound):
                    raise ParameterError(f"{name}, a bound: {definition.broken(key, bound)}.")
                check_plausible(f"{name}, a bound: {key}", definition, bound)
            check_plausible(f"{name}: {key}", definition, free[key].start)
        if key in fixed:
            check_plausible(f"{name}, fixed: {key}", definition, fixed[key])


def _check_names(model: UserModel, table: str, names: Iterable[str]) -> None:
    """Refuse a name that is neither a parameter, a start of a state nor the zero of a signal."""
    paths, zeros = parameter_paths(model.model), [*map(zero_name, model.signals)]
    for name in names:
        if name not in (*paths, *zeros) and not states_started_by(model.model, name):
            raise UnknownNameError(
                f"{model.model.name} has no parameter '{name}', which {table} names"
                f"{meant(name, paths)}; it has {', '.join(paths)}."
            )


def _unknown(name: str, entry: Range | Unknown) -> Unknown:
    if isinstance(entry, Unknown):
        if name not in (entry.name, *entry.sets):
            raise InputError(
                f"'{name}' is free as the parameter '{entry.name}': give both one name."
            )
        return entry
    try:
        low, start, high = (float(number) for number in entry[:3])
        (unit,) = entry[3:] or ("",)
    except (TypeError, ValueError):
        raise InputError(
            f"{name} is free as {entry!r}: give lower bound, nominal value and upper bound, and "
            "the unit if you like, or an Unknown."
        ) from None
    return Unknown(name, start, low, high, str(unit), low > 0.0 and high >= BY_ORDER * low)
