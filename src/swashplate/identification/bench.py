"""What is known of a drive before the next test, and what a test would add to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import KINDS
from swashplate.campaign.experiment import Channel, Experiment, InputSignal, Source
from swashplate.drive import Drive
from swashplate.errors import InputError
from swashplate.identification.advice import Candidate
from swashplate.identification.linearised import triangular_factor
from swashplate.identification.measured_noise import interval, measured_sensors
from swashplate.identification.problem import Problem
from swashplate.identification.sensors import RATE, Sensor, default_sensors, measurable
from swashplate.identification.setup import Free, Setup, Stage
from swashplate.identification.staging import stage_problem
from swashplate.identification.variables import Variables
from swashplate.maneuvers import Maneuver, step
from swashplate.parameters.definitions import CATALOGUE, find
from swashplate.parameters.parameter_set import ParameterSet

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Bench:
    """A drive, what is to be found of it, and what is known so far: where candidates are tried."""

    parameters: ParameterSet
    stage: Stage
    """All unknowns at once."""
    variables: Variables
    """The machine's unknowns."""
    present: Array
    """(m, K) what the runs made so far tell, in noise's deviations; no rows for none."""
    sensors: tuple[Sensor, ...]
    """Those of the campaign, or of a fresh plan."""

    _tried: dict[tuple[str, Sensor], Array] = field(default_factory=dict, repr=False)

    def rows(self, maneuver: Maneuver, sensor: Sensor) -> Array:
        """(<= K, K) factor of what one sensor would tell in a test, its free zero spent."""
        key = (maneuver.name, sensor)
        if key not in self._tried:
            experiment = _imagined(maneuver, sensor)
            problem = stage_problem(_without_priors(self.stage), self.parameters, [experiment])
            self._tried[key] = _machine_rows(problem, problem.start)
        return self._tried[key]

    def candidate(
        self, maneuver: Maneuver, sensors: Sequence[Sensor], name: str | None = None
    ) -> Candidate:
        """A test with some sensors."""
        rows = np.vstack([self.rows(maneuver, each) for each in sensors])
        return Candidate(name or maneuver.name, rows, duration=maneuver.length)


def bench(
    parameters: ParameterSet,
    setup: Setup,
    experiments: Sequence[Experiment] = (),
    *,
    fitted: bool = False,
    free: Sequence[str] = (),
    sensors: Sequence[Sensor] = (),
) -> Bench:
    """What is known of a drive before the next test.

    Parameters
    ----------
    parameters : ParameterSet
        The drive, best a fitted one.
    setup : Setup
        What is free; its stages are taken together.
    experiments : sequence of Experiment
        Tests made so far; none for a fresh plan.
    fitted : bool
        Whether the drive is fitted to them: noise and its colour are then those of the residuals.
        Else noise is as the campaign states it, correlated over `MEMORY`.
    free : sequence of str
        Symbols or columns that are held in the set-up and count as unknown here.
    sensors : sequence of Sensor
        Of a fresh plan; beside experiments they replace those of the same kind.

    Raises
    ------
    InputError, ParameterError
        If set-up, runs and parameters do not fit each other.
    """
    stage = _together(setup, free, parameters)
    if not experiments:
        asked = {each.kind: each for each in sensors or default_sensors(Drive(parameters))}
        chosen = tuple(asked[kind] for kind in measurable(stage.part, list(asked)))
        if not chosen:
            raise InputError(
                f"A {stage.part} shows nothing to {', '.join(asked)}: name another sensor."
            )
        problem = stage_problem(stage, parameters, [_imagined(step(1.0), chosen[0])])
        variables, machine = _machine(problem)
        _, prior = problem.unknowns.prior_rows(problem.start)
        return Bench(parameters, stage, variables, prior[:, machine], chosen)
    problem = stage_problem(stage, parameters, experiments)
    variables, machine = _machine(problem)
    known = measured_sensors(problem, machine, fitted=fitted)
    own = {each.kind: each for each in sensors}
    named = {}
    for name, sensor in known.items():
        named[name] = own.pop(sensor.kind, sensor)
    # an independent sample every so often: the others are worth nothing
    scales = {
        name: sensor.noise * float(np.sqrt(max(sensor.memory / interval(problem, name), 1.0)))
        for name, sensor in named.items()
    }
    present = _machine_rows(replace(problem, scales=scales), problem.start)
    kept = {sensor.kind: sensor for sensor in named.values()}
    return Bench(parameters, stage, variables, present, (*kept.values(), *own.values()))


def _together(setup: Setup, free: Sequence[str], parameters: ParameterSet) -> Stage:
    """One stage of all unknowns, through the whole chain unless they belong to one part of it."""
    (stage,) = setup.joint().stages
    parts = {each.part for each in setup.stages}
    if len(parts) == 1:
        stage = stage.model_copy(update={"part": parts.pop()})
    more: dict[str, Free] = {}
    for name in free:
        symbol = find(name).symbol
        if {name, symbol} & set(stage.free) or (
            stage.forces is not None and symbol in ("Z19", "Z20", "Z21", "Z22")
        ):
            raise InputError(f"{name} is free in the set-up already.")
        columns = CATALOGUE[symbol].columns if name == symbol else (name,)
        if any(not np.isfinite(parameters.numbers[column]) for column in columns):
            raise InputError(f"{name} is off in the drive, so that no test can tell it.")
        positive = all(parameters.numbers[column] > 0.0 for column in columns)
        zero = any(parameters.numbers[column] == 0.0 for column in columns)
        more[name] = Free(bounds=(-1.0, 1.0)) if zero else Free(relative=(0.5, 2.0), log=positive)
    return stage.model_copy(update={"free": {**stage.free, **more}})


def _without_priors(stage: Stage) -> Stage:
    """What is known beforehand counts once, not once a test."""
    free = {name: each.model_copy(update={"prior": None}) for name, each in stage.free.items()}
    return stage.model_copy(update={"free": free})


def _imagined(maneuver: Maneuver, sensor: Sensor) -> Experiment:
    """A test that has not been made: only its stamps count, not its values."""
    time = maneuver.time(RATE)
    source = Source(Path("none"), sensor.kind)
    channel = Channel(
        sensor.kind,
        sensor.kind,
        KINDS[sensor.kind].units[0],
        time,
        np.zeros_like(time),
        np.ones_like(time),
        source,
        noise=sensor.deviation,
    )
    command = InputSignal("voltage", "V", time, maneuver.sample(RATE), "linear", source)
    name = maneuver.name
    return Experiment(name, "", name, "fit", "rest", None, command, {sensor.kind: channel})


def _machine(problem: Problem) -> tuple[Variables, list[int]]:
    """The unknowns that are no run's own, and their places."""
    places = [k for k, each in enumerate(problem.unknowns) if each.run is None]
    ours = [problem.unknowns[k] for k in places]
    variables = Variables.of(
        [each.name for each in ours],
        [each.start for each in ours],
        scales=[each.scale for each in ours],
        logarithmic=[each.log for each in ours],
    )
    return variables, places


def _machine_rows(problem: Problem, vector: Array) -> Array:
    """(<= K, K) factor of the derivatives by the machine's unknowns, those of single runs spent."""
    derivatives = problem.evaluate(vector).jacobian
    _, machine = _machine(problem)
    own = [k for k in range(derivatives.shape[1]) if k not in machine]
    factor = triangular_factor(np.column_stack([derivatives[:, own], derivatives[:, machine]]))
    return np.asarray(factor[len(own) :, len(own) :])
