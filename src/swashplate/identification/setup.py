"""What a fit is to find: of a drive, from TOML or packaged; of one's own model, from Python."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from importlib import import_module
from importlib.resources import files
from math import inf
from pathlib import Path
from traceback import extract_tb
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from swashplate.campaign import ChannelKind
from swashplate.campaign.experiment import Experiment
from swashplate.campaign.schema import LARGEST_PRESSURE, Weight, Window
from swashplate.documents import parse_toml, read_text, validated
from swashplate.entries import Finite, Flag, NotNegative, Positive
from swashplate.equations import Model as Equations
from swashplate.equations.fields import check_mapping, is_real
from swashplate.equations.model import parameter_paths
from swashplate.errors import (
    FileError,
    InputError,
    MissingFileError,
    ParameterError,
    SwashplateError,
    UnknownNameError,
    meant,
)
from swashplate.identification.model import OwnModel, simulated, states_started_by
from swashplate.identification.problem import Problem, noise_scales
from swashplate.identification.solving import solve
from swashplate.identification.unknowns import Prior, Unknown, Unknowns, zero_name
from swashplate.parameters.definitions import find
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.parameters.plausible import check_plausible
from swashplate.parameters.rules import SIDES
from swashplate.results import Result, short

Array = NDArray[np.float64]
_SETUPS = files("swashplate.identification").joinpath("setups")
Pair = tuple[Finite, Finite]
StandardUncertainty = Positive | Annotated[str, Field(pattern=r"^\d+(\.\d+)? ?%$")]
"""A standard uncertainty: in SI units, or as "5 %" of the value."""
COEFFICIENTS = ("Z19", "Z20", "Z21", "Z22")
"""Of the solenoids: what forces stand for."""


class Entry(BaseModel):
    """A table of the file; a key that it does not know is refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)

    def __repr__(self) -> str:
        return short(self)


def rising(pair: tuple[float, float]) -> tuple[float, float]:
    """A pair of bounds; refused, in a ValueError, unless the lower one stands first."""
    if pair[0] < pair[1]:
        return pair
    turned = "leaves nothing between its ends"
    if pair[0] > pair[1]:
        turned = f"must rise: write [{pair[1]:g}, {pair[0]:g}]"
    raise ValueError(f"[{pair[0]:g}, {pair[1]:g}] {turned}")


Bounds = Annotated[Pair, AfterValidator(rising)]


class Free(Entry):
    """How a parameter is free: both directions apart, unless tied."""

    relative: Bounds | None = Field(None, description="Bounds as factors on the nominal value.")
    bounds: Bounds | None = Field(None, description="Bounds in SI units.")
    log: Flag = Field(False, description="Move the logarithm: for positive numbers.")
    tied: Flag = Field(False, description="One value for both directions.")
    prior: Prior | None = Field(None, description="A normal distribution, of the logarithm if log.")

    @model_validator(mode="after")
    def _bounded(self) -> Free:
        if (self.relative is None) == (self.bounds is None):
            raise ValueError("give either relative bounds or bounds")
        return self


class Forces(Entry):
    """Forces at four effective currents each way, as magnitudes: unknowns instead of Z19 to Z22.

    ``"force_plus_1"`` is the force at the first of `plus`; the effective current is what is left
    of the current beyond the dead zone Z17.
    """

    plus: tuple[Positive, Positive, Positive, Positive] = Field(
        description="Effective currents of the positive direction, increasing [A]."
    )
    minus: tuple[Positive, Positive, Positive, Positive] = Field(
        description="Of the negative direction, as magnitudes [A]."
    )
    relative: Bounds = Field((0.5, 2.0), description="Bounds as factors on the nominal forces.")

    names: ClassVar = tuple(f"force_{side}_{k}" for side in SIDES for k in (1, 2, 3, 4))
    """Names of the eight forces, in the order of `currents`."""
    columns: ClassVar = tuple(f"{symbol}_{side}" for side in SIDES for symbol in COEFFICIENTS)
    """The parameters that they stand for."""

    @property
    def currents(self) -> dict[str, float]:
        """The effective current of each force by its name, those of `minus` below 0. [A]"""
        currents = [*self.plus, *(-size for size in self.minus)]
        return dict(zip(self.names, currents, strict=True))

    @property
    def _inverse(self) -> Array:
        return _coefficients_of_forces(self.plus, self.minus)

    def values(self, parameters: ParameterSet) -> dict[str, float]:
        """The forces of a parameter set, by name. [N]"""
        found = np.linalg.solve(self._inverse, [parameters.numbers[c] for c in self.columns])
        return dict(zip(self.names, found.tolist(), strict=True))

    def coefficients(
        self, values: Mapping[str, float], parameters: ParameterSet
    ) -> dict[str, float]:
        """Coefficients for some forces; those not named are as in the parameter set. [N/Aᵏ]"""
        forces = self.values(parameters)
        found = self._inverse @ np.array([values.get(name, forces[name]) for name in forces])
        return dict(zip(self.columns, found.tolist(), strict=True))

    def slopes(self, name: str) -> dict[str, float]:
        """Derivatives by one force of the coefficients of its direction. [1/Aᵏ]"""
        column = self._inverse[:, self.names.index(name)].tolist()
        return {each: slope for each, slope in zip(self.columns, column, strict=True) if slope}


@cache
def _coefficients_of_forces(
    plus: tuple[float, float, float, float], minus: tuple[float, float, float, float]
) -> Array:
    """(8, 8) map from forces to coefficients, of F = Z19 i + Z20 i² + Z21 i³ + Z22 i⁴."""
    # not kept in the entry itself: entries are compared by all that they hold
    zero, orders = np.zeros((4, 4)), np.arange(1, 5)
    positive = np.power.outer(plus, orders)
    negative = np.power.outer(minus, orders) * (-1.0) ** (orders + 1)
    return np.linalg.inv(np.block([[positive, zero], [zero, negative]]))


class InputWeight(Window):
    """A weight that depends on the size of the command."""

    factors: tuple[tuple[NotNegative, NotNegative], ...] = Field(
        min_length=2,
        description="[|input|, factor on the squared error] pairs, a polyline: "
        "[[3, 1], [10, 0.5]].",
    )

    @model_validator(mode="after")
    def _increasing(self) -> InputWeight:
        levels = [level for level, _ in self.factors]
        if levels != sorted(set(levels)):
            raise ValueError("the inputs of factors must increase")
        return self


class Stage(Entry):
    """One fit: a part of the drive against its channels."""

    name: str
    part: Literal["card", "pump", "chain", "model"] = Field(
        description="What is simulated: the control card, pump and motor, the whole chain; 'model' "
        "is for models of one's own, given by --model."
    )
    current: Literal["simulated", "measured"] = Field(
        "simulated",
        description="What drives the pump alone: the fitted card's current, or what was measured: "
        "the input, where that is a current, or else the channel of the current, an ammeter around "
        "both leads with the command's sign.",
    )
    current_scale: Positive = Field(1.0, description="Factor on the measured current.")
    current_hysteresis: NotNegative = Field(
        0.0005,
        description="Hysteresis that the dither leaves of solenoids and spool, as a full width of "
        "the current, a standard uncertainty [A], which intervals take in; not if the drive has "
        "friction or hysteresis of its own.",
    )
    channels: tuple[ChannelKind, ...] = Field((), description="Kinds to fit; all if empty.")
    free: dict[str, Free] = Field(min_length=1)
    forces: Forces | None = None
    weights: dict[ChannelKind, tuple[Weight, ...]] = Field(
        {}, description="Windows that count more or less, besides those of the campaign."
    )
    weights_by_input: dict[ChannelKind, tuple[InputWeight, ...]] = Field(
        {}, description="Weights by the size of the command, besides those of the campaign."
    )
    start_pressure: Positive | None = Field(
        None,
        le=LARGEST_PRESSURE,
        description="Largest stroking pressure at the first sample, free in each run [Pa]; where "
        "none is given, it is free in runs with start = 'estimated' alone.",
    )

    @model_validator(mode="after")
    def _consistent(self) -> Stage:
        if self.current_scale != 1.0 and (self.part, self.current) != ("pump", "measured"):
            raise ValueError("current_scale needs part = 'pump' and current = 'measured'")
        if self.start_pressure is not None and self.part == "card":
            raise ValueError("a card alone has no start_pressure")
        return self

    def beyond(self, unknown: Unknown, side: int) -> str:
        """What to do about an unknown of the machine at its lower (-1) or upper (1) bound."""
        name = unknown.name
        if self.part == "model":
            return f"to let it go on, widen '{name}' in free of the model and fit again"
        if self.forces is not None and name in self.forces.names:
            where = "relative under [stages.forces]"
        else:
            limits = find(name)
            least = limits.lower if limits.least is None else limits.least
            if unknown.high >= limits.upper if side > 0 else unknown.low <= least:
                return f"the {'greatest' if side > 0 else 'least'} value that it may have"
            where = f"{name if name in self.free else _symbol(name)} under [stages.free]"
        return f"to let it go on, widen {where} of the stage '{self.name}' and fit again"


class Setup(Entry):
    """A fit in one stage or several, each starting from what the ones before found."""

    title: str = ""
    stages: tuple[Stage, ...] = Field(min_length=1)
    standard_uncertainty: dict[str, StandardUncertainty] = Field(
        {},
        description="Of parameters that stay fixed: a standard deviation of what their values may "
        "be off by, in SI units or as '5 %' of the value; the intervals of all estimates take it "
        "in. Both directions of a symbol are off together.",
    )
    card_filter: Literal["equation", "recursion"] = Field(
        "equation",
        description="The filter of a card whose set states a recursion for one rate, as the "
        "packaged ones do: the differential equation with the same poles, as real cards have it, "
        "or the recursion, to which published zeta and omega belong.",
    )

    @model_validator(mode="after")
    def _fixed(self) -> Setup:
        for name in self.standard_uncertainty:
            symbol = _symbol(name)
            for stage in self.stages:
                free = any(each in (name, symbol) or _symbol(each) == name for each in stage.free)
                if free or (stage.forces is not None and symbol in COEFFICIENTS):
                    raise ValueError(
                        f"{name} is free in the stage '{stage.name}': only what stays fixed has a "
                        "standard_uncertainty; what is known of a free parameter is its prior"
                    )
        return self

    def joint(self) -> Setup:
        """The same unknowns, all at once through the whole chain.

        A `ParameterError` says that two stages free the same parameter, or that one is driven by a
        scaled current, which no chain makes.
        """
        merged: dict[str, Any] = {"free": {}, "weights": {}, "weights_by_input": {}}
        for stage in self.stages:
            if stage.current_scale != 1.0:
                raise ParameterError(
                    f"The stage '{stage.name}' is driven by {stage.current_scale:g} times the "
                    "measured current, so no joint fit through the card can stand for it."
                )
            if twice := sorted(set(merged["free"]) & set(stage.free)):
                raise ParameterError(f"{twice[0]} is free in two stages; a joint fit needs one.")
            merged = {key: merged[key] | getattr(stage, key) for key in merged}
        forces = next((each.forces for each in self.stages if each.forces is not None), None)
        most = max((each.start_pressure or 0.0 for each in self.stages), default=0.0) or None
        stage = Stage(name="chain", part="chain", forces=forces, start_pressure=most, **merged)
        return self.model_copy(update={"stages": (stage,)})


def _symbol(name: str) -> str:
    return name.removesuffix("_plus").removesuffix("_minus")


def deviation(uncertainty: float | str, value: float) -> float:
    """A standard uncertainty as a number: in the value's unit, or ``"5 %"`` of its size."""
    if isinstance(uncertainty, str):
        return 0.01 * float(uncertainty.removesuffix("%")) * abs(value)
    return float(uncertainty)


def setup_names() -> tuple[str, ...]:
    """Names of the packaged set-ups."""
    names = (each.name for each in _SETUPS.iterdir())
    return tuple(sorted(n.removesuffix(".toml") for n in names if n.endswith(".toml")))


def load_setup(name: str | Path) -> Setup:
    """A packaged set-up by name, or one's own from a TOML file.

    Raises
    ------
    ParameterError
        If there is none of that name, or an entry is wrong.
    FileError
        If the file cannot be read.
    """
    file = str(name)
    if file.lower().endswith(".toml"):
        text = read_text(name)
    elif file in setup_names():
        file = f"{name}.toml"
        text = _SETUPS.joinpath(file).read_text("utf-8")
    else:
        raise ParameterError(
            f"There is no packaged fit configuration '{name}'{meant(file, setup_names())}; there "
            f"are {', '.join(setup_names())}, or give a .toml file."
        )
    return validated(parse_toml(text, file), Setup, file)


FreeParameters = Setup | str | Path | Mapping[str, Any]
"""What a fit is to estimate: a fit configuration, its packaged name or file, or a mapping."""


def free_entries(free: Mapping[str, Any]) -> dict[str, Free]:
    """What a mapping frees of a drive, by symbol or column.

    Each value is a pair of factors on the nominal value, ``{"Z8": (0.5, 2)}``, a `Free`, or a
    mapping as in the TOML file, ``{"Z8": {"bounds": [1e5, 9e5]}}``. A `ParameterError` names what
    is wrong.
    """
    entries: dict[str, Free] = {}
    for name, entry in free.items():
        find(name)
        if isinstance(entry, Free):
            entries[name] = entry
        elif isinstance(entry, Mapping):
            entries[name] = validated(dict(entry), Free, f"free, {name}")
        elif isinstance(entry, Sequence) and len(entry) == 2 and all(map(is_real, entry)):
            entries[name] = validated({"relative": tuple(entry)}, Free, f"free, {name}")
        else:
            raise ParameterError(
                f"{name} is free as {entry!r}: give two factors on its nominal value, (0.5, 2), or "
                "its bounds in SI, {'bounds': (LOW, HIGH)}."
            )
    return entries


def setup_text(setup: Setup) -> str:
    """A fit configuration as TOML that `load_setup` reads as an equal one."""
    from tomlkit import dumps, inline_table

    content = setup.model_dump(mode="json", by_alias=True, exclude_defaults=True)
    for stage in content["stages"]:
        for name, entry in stage["free"].items():
            stage["free"][name] = inline_table()
            stage["free"][name].update(entry)
    return dumps(content)


# --- models of one's own --------------------------------------------------------------------------


Range = tuple[float, float, float] | tuple[float, float, float, str]
"""Lower bound, nominal value, upper bound, and the unit if it is said."""
BY_ORDER = 10.0
"""Ratio of positive bounds from which a range is searched by the logarithm."""


@dataclass(frozen=True, eq=False)
class ModelSetup(Result):
    """A model of one's own and what is to be found of it, as set and `Setup` of a drive.

    An entry of `free` is (low, nominal, high), (low, nominal, high, unit) or an `Unknown`. A range
    of positive bounds, the upper one at least ten times the lower one, is searched by its
    logarithm. ``"start.PATH"`` of a state and ``"offset CHANNEL"``, the zero of a sensor, are free
    in each run by themselves.
    """

    model: Any
    """A model of equations, an `OwnModel` of them with more said, or an object with `simulate`."""
    free: Mapping[str, Any]
    """What is to be found, by the model's names."""
    name: str = ""
    """For tables and files; the model's by default."""
    channels: tuple[str, ...] = ()
    """Those that are fitted; all that the model gives by default."""
    noise: Mapping[str, float] = field(default_factory=dict)
    """Standard deviation of a channel, where the campaign does not state it. [unit]"""
    fixed: Mapping[str, float] = field(default_factory=dict)
    """Values of names that are not free."""
    standard_uncertainty: Mapping[str, StandardUncertainty] = field(default_factory=dict)
    """What values of `fixed` may be off by, one standard deviation, also as ``"5 %"``."""
    numbers: Mapping[str, float] = field(default_factory=dict)
    """The model's numbers, nominal or fitted, those of single runs left out; see `nominal`."""
    scales: Mapping[str, float] = field(default_factory=dict)
    """What one unit of residual is, by channel: its noise. [unit]"""

    def __post_init__(self) -> None:
        for what in ("free", "noise", "fixed", "standard_uncertainty"):
            check_mapping(what, getattr(self, what))
        if isinstance(self.channels, str):
            raise InputError(f"Give the channels as ('{self.channels}',).")
        own = OwnModel(self.model) if isinstance(self.model, Equations) else self.model
        if not callable(getattr(own, "simulate", None)):
            raise InputError(
                f"A {type(own).__name__} is no model: give a Model of equations, or an object with "
                "simulate(values, experiment)."
            )
        equations = own.model if isinstance(own, OwnModel) else own
        kind = getattr(equations, "name", None) or type(equations).__name__
        name = self.name or str(kind).lower()
        if not self.free:
            raise InputError(f"Nothing of {name} is free: name what is to be found.")
        if unknown := [each for each in self.standard_uncertainty if each not in self.fixed]:
            raise InputError(
                f"{unknown[0]} has a standard uncertainty but no value: name it in fixed, or give "
                "it a prior if it is free."
            )
        if both := [each for each in self.free if each in self.fixed]:
            raise InputError(f"{both[0]} of {name} is free and fixed: name it in one of them.")
        numbers = (("noise", self.noise, 0.0), ("fixed value", self.fixed, -inf))
        for what, given, least in numbers:
            for key, number in given.items():
                if not is_real(number) or not least < number < inf:
                    must = "finite" if least < 0.0 else "above 0"
                    raise InputError(
                        f"{name}: the {what} of '{key}' is {number!r}, but must be {must}."
                    )
        free = {key: _unknown(key, each) for key, each in self.free.items()}
        if isinstance(own, OwnModel):
            targets = [name for unknown in free.values() for name in unknown.targets]
            _check_names(own, "free", targets)
            _check_names(own, "fixed", self.fixed)
        ranges = equations.ranges if isinstance(equations, Equations) else {}
        for key, definition in ranges.items():
            if key in free:
                for bound in (free[key].low, free[key].high):
                    if not definition.holds(bound):
                        raise ParameterError(f"{name}, a bound: {definition.broken(key, bound)}.")
                    check_plausible(f"{name}, a bound: {key}", definition, bound)
                check_plausible(f"{name}: {key}", definition, free[key].start)
            if key in self.fixed:
                check_plausible(f"{name}, fixed: {key}", definition, self.fixed[key])
        for key, made in {"model": own, "name": name, "free": free}.items():
            object.__setattr__(self, key, made)
        _ = self.setup  # refuses what is no uncertainty

    @classmethod
    def from_file(cls, path: str | Path) -> ModelSetup:
        """The set-up that a Python file states by its names ``model`` and ``free``.

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
        file = Path(path).resolve()
        if not file.exists():
            raise MissingFileError(f"There is no file {path}: name a Python file with a model.")
        if not file.is_file() or file.suffix != ".py" or not file.stem.isidentifier():
            raise FileError(f"{path} is no Python file with a model, such as valve.py.")
        if str(file.parent) not in sys.path:
            sys.path.insert(0, str(file.parent))
        try:
            module = import_module(file.stem)
        except SystemExit as error:
            sys.modules.pop(file.stem, None)
            raise FileError(
                f"{path} ended Python with sys.exit({error.code!r}) as it was loaded: guard what "
                "the file does as a script by if __name__ == '__main__'."
            ) from None
        except Exception as error:  # the user's own code, which can raise anything
            sys.modules.pop(file.stem, None)
            own = [e.lineno for e in extract_tb(error.__traceback__) if e.filename == str(file)]
            line = getattr(error, "lineno", None) or (own[-1] if own else None)
            where = f"{path}, line {line}" if line else f"{path}"
            raise FileError(f"{where}: {type(error).__name__}: {error}.") from None
        if module.__file__ is None or Path(module.__file__).resolve() != file:
            raise FileError(f"{path}: another module is called {file.stem}; rename the file.")
        for name in ("model", "free"):
            if not hasattr(module, name):
                raise InputError(
                    f"{path} has no '{name}': it needs model = Model(...) and free = "
                    "{'lag': (0.005, 0.06, 0.5), ...}, lower bound, nominal value and upper bound."
                )
        known = ("model", "free", "name", "channels", "noise", "fixed", "standard_uncertainty")
        try:
            return cls(**{key: getattr(module, key) for key in known if hasattr(module, key)})
        except SwashplateError as error:
            raise type(error)(f"{path}: {error}") from None

    @property
    def setup(self) -> Setup:
        """The set-up as that of a fit in stages, of which it has one."""
        free = {
            each.name: Free(bounds=(each.low, each.high), log=each.log, prior=each.prior)
            for each in self.free.values()
        }
        stage = Stage(name=self.name, part="model", free=free)
        content = {"title": self.name, "stages": (stage,)}
        uncertain = {"standard_uncertainty": dict(self.standard_uncertainty)}
        return validated(content | uncertain, Setup, self.name)

    def nominal(self, experiments: Sequence[Experiment]) -> ModelSetup:
        """The set-up with the numbers before a fit to some runs."""
        had = dict.fromkeys(name for each in experiments for name in each.channels)
        if strange := [each for each in self.noise if each not in had]:
            raise InputError(
                f"{self.name}: noise is stated for '{strange[0]}', but the channels are "
                f"{', '.join(had) or 'none'}."
            )
        problem = self.problem(experiments)
        numbers = {**self.fixed, **problem.unknowns.targets(problem.start, "")}
        return replace(self, numbers=numbers, scales=problem.scales)

    def problem(self, experiments: Sequence[Experiment], *, threads: int = 1) -> Problem:
        """The problem that it states for some runs, one of which has a channel that is fitted."""
        channels = tuple(self.channels) or self._given(experiments)
        runs = [each for each in experiments if any(name in each.channels for name in channels)]
        if not runs:
            had = dict.fromkeys(name for each in experiments for name in each.channels)
            raise InputError(
                f"{self.name} is fitted to {', '.join(channels) or 'nothing'}, but the runs have "
                f"{', '.join(had) or 'no channel'}."
            )
        for k, run in enumerate(runs):  # the noise of channels that the campaign does not state
            noises = {
                name: replace(channel, noise=channel.noise or self.noise.get(name))
                for name, channel in run.channels.items()
            }
            runs[k] = replace(run, channels=noises)
        of_runs = {each.name for run in experiments for each in self.own(run)}
        machine = [each for each in self.free.values() if each.name not in of_runs]
        values, zeros = _without_zeros(self.fixed, channels)
        return Problem(
            self.model,
            tuple(runs),
            Unknowns((*machine, *(unknown for each in runs for unknown in self.own(each)))),
            channels,
            noise_scales(runs, channels),
            fixed=values,
            zeros=zeros,
            uncertain=tuple(
                {name: deviation(each, self.fixed[name])}
                for name, each in self.standard_uncertainty.items()
            ),
            threads=threads if isinstance(self.model, OwnModel) else 1,
        )

    def _given(self, experiments: Sequence[Experiment]) -> tuple[str, ...]:
        """Names of the channels that the model gives."""
        values = {each.name: each.start for each in self.free.values()} | dict(self.fixed)
        own = self.model.signals_of if isinstance(self.model, OwnModel) else None
        given = [own(each) if own else simulated(self.model, values, each) for each in experiments]
        return tuple(dict.fromkeys(name for each in given for name in each))

    def own(self, experiment: Experiment) -> tuple[Unknown, ...]:
        """The unknowns of a single run: where its state begins, and the zeros of its sensors."""
        channels, run = {zero_name(name): name for name in experiment.channels}, experiment.name
        equations = self.model.model if isinstance(self.model, OwnModel) else None
        found = list[Unknown]()
        for unknown in self.free.values():
            if unknown.run is not None:
                continue
            if channel := channels.get(unknown.name):
                found.append(replace(unknown, run=run, kind="zero", channel=channel))
            elif equations is not None and states_started_by(equations, unknown.name):
                found.append(replace(unknown, run=run, kind="start"))
        return tuple(found)

    def predicted(self, experiment: Experiment) -> Mapping[str, Array]:
        """A run predicted from its input: for each channel (m,) samples at its stamps. [unit]

        What is free in each run by itself, a beginning of the state or the zero of a sensor, is
        estimated from this run; everything else is as it is.
        """
        own = tuple(each for each in self.own(experiment) if each.name not in self.numbers)
        channels = tuple(name for name in self.scales if name in experiment.channels)
        if not own:
            found = simulated(self.model, self.numbers, experiment)
            return {name: found[name] for name in channels}
        values, zeros = _without_zeros(self.numbers, channels)
        problem = Problem(
            self.model,
            (experiment,),
            Unknowns(own),
            channels,
            self.scales,
            fixed=values,
            zeros=zeros,
        )
        return problem.outputs(solve(problem).vector, 0)


def _without_zeros(
    values: Mapping[str, float], channels: Sequence[str]
) -> tuple[dict[str, float], dict[str, float]]:
    """Values by the model's names, and the zeros of channels among them by the channel."""
    names = {zero_name(channel): channel for channel in channels}
    zeros = {channel: values[name] for name, channel in names.items() if name in values}
    return {name: value for name, value in values.items() if name not in names}, zeros


def _check_names(model: OwnModel, table: str, names: Iterable[str]) -> None:
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
