"""Design of experiments by Fisher information: what runs tell of each unknown, what a test adds.

`outlook` is known before a fit: which run tells of which unknown, and what none tells of. `bench`
and `advise` rank tests to come by what they would add.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import KINDS, ChannelKind
from swashplate.campaign.experiment import Channel, Experiment, InputSignal, Source
from swashplate.campaign.rig import COUNTS_PER_TURN
from swashplate.drive import Drive
from swashplate.errors import InputError
from swashplate.identification.drive_model import (
    CURRENTS,
    SIGNALS,
    DriveModel,
    stage_problem,
)
from swashplate.identification.identifiability import Identifiability, identifiability
from swashplate.identification.intervals import uncertainty
from swashplate.identification.problem import (
    TOLERANCE,
    LinearisedFit,
    Problem,
    linearised_fit,
    triangular_factor,
    whitening,
)
from swashplate.identification.setup import Forces, Free, Setup, Stage
from swashplate.identification.unknowns import Unknowns
from swashplate.maneuvers import Maneuver, multisine, ramp, sine, stairs, step
from swashplate.parameters.definitions import CATALOGUE, COLUMNS, find
from swashplate.parameters.parameter_set import HasParameters, ParameterSet, set_of
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.results import Result, short
from swashplate.tables import listed

Array = NDArray[np.float64]

# --- what the runs tell ---------------------------------------------------------------------------

OTHERS = "a tilted swash plate"
"""What parameters need that say nothing of it, and single runs' numbers."""


def need_of(name: str, forces: Forces | None = None) -> str:
    """What an unknown needs, in words."""
    if forces is not None and name in forces.names:
        _, side, number = name.split("_")
        return f"{getattr(forces, side)[int(number) - 1]:g} A beyond Z17"
    symbol = COLUMNS.get(name, name)
    return (CATALOGUE[symbol].needs if symbol in CATALOGUE else "") or OTHERS


Mark = Literal["most", "some", "none"]

ALONE = 0.9
"""Share of a single run from which an unknown is said to rest on it."""
MOST = 0.2
"""Share of a run's information from which it is one of those that tell most."""


@dataclass(frozen=True, eq=False)
class Outlook(Result):
    """What the runs can tell of a stage's unknowns, at the nominal values: known before a fit."""

    stage: Stage
    problem: Problem
    linearised: LinearisedFit

    @property
    def names(self) -> tuple[str, ...]:
        """The unknowns, those of single runs left out."""
        return tuple(each.name for each in self.problem.unknowns if each.run is None)

    @property
    def runs(self) -> tuple[str, ...]:
        """Names of the runs that the stage fits."""
        return tuple(each.name for each in self.problem.experiments)

    @property
    def _model(self) -> DriveModel:
        assert isinstance(self.problem.model, DriveModel)
        return self.problem.model

    def need(self, name: str) -> str:
        """What an unknown needs, in words."""
        return need_of(name, self._model.forces)

    @cached_property
    def identifiability(self) -> Identifiability:
        """Which unknowns the runs determine, and directions that change nothing."""
        taken = {target for each in self.problem.unknowns for target in each.targets}
        return identifiability(
            self.linearised.triangle,
            self.linearised.variables,
            tolerance=self.linearised.tolerance,
            fixed={k: v for k, v in self._model.parameters.numbers.items() if k not in taken},
        )

    @cached_property
    def shares(self) -> Array:
        """(runs, K) part of what is known of an unknown from each run, its channels together."""
        runs = self.runs
        squares = np.zeros((len(runs), self.linearised.variables.count))
        for run in self.linearised.runs:
            squares[runs.index(run.name)] += np.sum(run.jacobian**2, axis=0)
        total = squares.sum(axis=0)
        shares: Array = np.divide(squares, total, out=np.zeros_like(squares), where=total > 0.0)
        return shares

    def effect(self, name: str) -> float:
        """Length of the change of all weighted residuals for 1 % of an unknown; 1 is one noise."""
        return float(self.identifiability.sensitivity[self.linearised.variables.index(name)])

    def marks(self, name: str) -> tuple[Mark, ...]:
        """Whether each run tells most of an unknown, some, or none."""
        share = self.shares[:, self.linearised.variables.index(name)]
        return tuple("most" if s >= MOST else "some" if s > 0.0 else "none" for s in share)

    def sentences(self) -> tuple[str, ...]:
        """What no run tells of, why, and what rests on one run alone."""
        groups: dict[str, list[str]] = {}
        for name in self.identifiability.unexcited:
            if name in self.names:
                groups.setdefault(self._missing(name), []).append(name)
        said = [
            f"{listed(names)} need{'s' if len(names) == 1 else ''} {why}."
            for why, names in groups.items()
        ]
        runs = self.runs
        for name in self.names if len(runs) > 1 else ():
            share = self.shares[:, self.linearised.variables.index(name)]
            most = int(np.argmax(share))
            if share[most] >= ALONE:
                said.append(
                    f"{name}: {100.0 * share[most]:.0f} % of its information is from {runs[most]} "
                    "alone."
                )
        return tuple(said)

    def _missing(self, name: str) -> str:
        """What an unknown that no sample depends on needs."""
        need = self.need(name)
        if name.startswith("force_"):
            need = "currents of their size beyond Z17"
        side = next((each for each in ("plus", "minus") if f"_{each}" in name), None)
        need = need if side is None else f"{need} ({side})"
        forces = name.startswith("force_")
        instead = "ask for forces at smaller currents" if forces else "fix it"
        return f"{need}, which no sample shows: {instead}, or add a test that has it"


def outlook(
    stage: Stage, nominal: ParameterSet | HasParameters, experiments: Sequence[Experiment]
) -> Outlook:
    """What runs can tell of a stage's unknowns, before any fit.

    Parameters
    ----------
    stage : Stage
        What is free and what is fitted.
    nominal : ParameterSet or Drive
        Nominal values; best those that `fitting.smooth` makes, as a fit takes them.
    experiments : sequence of Experiment
        The runs to fit.

    Raises
    ------
    InputError, ParameterError
        If runs and set-up do not fit each other, see `drive_model.stage_problem`.
    DomainError
        If the model does not hold at the nominal values.
    """
    parameters = set_of(nominal)
    problem = stage_problem(stage, parameters, experiments)
    return Outlook(stage, problem, linearised_fit(problem, problem.start))


# --- tests to come --------------------------------------------------------------------------------

RATE = 512.0
"""At which tests to come are simulated. [Hz]"""
TRANSDUCER = 0.005
"""Noise that is assumed of a sensor, over the largest value that the drive makes it read. [1]"""
MEMORY = 0.1
"""Time over which errors of a measurement are assumed to stay correlated. [s]"""


class Sensor(NamedTuple):
    """What is measured in a test, and how well."""

    kind: ChannelKind
    noise: float
    """Standard deviation. [SI unit of the kind]"""
    memory: float = MEMORY
    """Time for which one sample stands. [s]"""
    origin: str = "stated"
    """Where the noise is known from, for people."""

    @property
    def deviation(self) -> float:
        """Of a sample of the candidates, so that each counts as an independent one."""
        return self.noise * float(np.sqrt(max(self.memory * RATE, 1.0)))


def default_sensors(drive: Drive) -> tuple[Sensor, ...]:
    """Those of Kruse's tests: an ammeter around both leads and, where known, its encoder."""
    if drive.name not in COUNTS_PER_TURN:
        return assumed_sensors(drive, ("rectified_current", "shaft_speed"))
    rounding = 2.0 * np.pi / COUNTS_PER_TURN[drive.name] / np.sqrt(12.0)
    encoder = Sensor("encoder_counts", float(rounding), origin="rounding of Kruse's encoder")
    return (*assumed_sensors(drive, ("rectified_current",)), encoder)


def assumed_sensors(drive: Drive, kinds: Sequence[ChannelKind]) -> tuple[Sensor, ...]:
    """Sensors of which nothing is known: noise of 0.5 % of what full command makes them read.

    Raises
    ------
    InputError
        If a kind is none that the drive has.
    """
    full = [drive.simulate(step(sign * FULL_VOLTAGE).sample(RATE), RATE) for sign in (1.0, -1.0)]
    made = []
    for kind in kinds:
        if kind not in SIGNALS:
            raise InputError(f"There is no sensor '{kind}'; there are {', '.join(SIGNALS)}.")
        signal = "current" if kind in ("rectified_current", "signed_current") else SIGNALS[kind]
        largest = max(float(np.abs(getattr(run, signal)).max()) for run in full)
        made.append(
            Sensor(kind, TRANSDUCER * largest, origin=f"assumed, {100.0 * TRANSDUCER:g} % of range")
        )
    return tuple(made)


def measurable(part: str, kinds: Sequence[ChannelKind]) -> tuple[ChannelKind, ...]:
    """Kinds of sensor that tell of a part of the drive."""
    return tuple(
        kind for kind in kinds if part == "chain" or (kind in CURRENTS) == (part == "card")
    )


NOISELESS = 1e-9
"""Residuals, over their channel's noise, that are rounding."""
FARTHEST = 0.05
"""Residuals, over the range of what is measured, of a drive that nobody would call fitted."""


def measured_sensors(
    problem: Problem, machine: Sequence[int], *, fitted: bool
) -> dict[str, Sensor]:
    """The campaign's own sensors, by channel, with the noise that it states.

    If the drive at which the problem begins is `fitted`, its residuals are the noise; `machine` are
    the places of the unknowns that belong to no single run.

    Raises
    ------
    InputError
        If they are zero, or so large that the drive was not fitted to these tests.
    """
    fit, made = linearised_fit(problem, problem.start) if fitted else None, {}
    for name in problem.channels:
        measured = [each[name] for each in problem.experiments if name in each.channels]
        sensor = Sensor(measured[0].kind, problem.scales[name], origin="as in the campaign")
        if fit is not None:
            left = []
            for run in (run for run in fit.runs if run.channel == name):
                # with free zeros and other unknowns of single runs fitted
                own = np.delete(run.jacobian, list(machine), axis=1)
                shift = np.linalg.lstsq(own, -run.residual, rcond=None)[0]
                left.append(run._replace(residual=run.residual + own @ shift))
            square = np.concatenate([run.residual for run in left]) ** 2
            noise = sensor.noise * float(np.sqrt(np.mean(square)))
            share = noise / max(float(np.ptp(each.values)) for each in measured)
            if not NOISELESS * sensor.noise < noise or share > FARTHEST:
                raise InputError(
                    f"The drive misses '{name}' by {100.0 * share:.2g} % of its range, so that its "
                    "residuals are no noise; give a drive that was fitted to these tests, or none."
                )
            said = uncertainty(replace(fit, runs=tuple(left)))
            # not of all that the residuals hold, but of what meets the unknowns' derivatives
            worth = float(np.median(said.inflation[said.own.determined]))
            memory = worth * interval(problem, name)
            sensor = Sensor(sensor.kind, noise, memory, "residuals of the drive")
        made[name] = sensor
    return made


def interval(problem: Problem, channel: str) -> float:
    """Median interval between samples of a channel. [s]"""
    runs = [each[channel].time for each in problem.experiments if channel in each.channels]
    return float(np.median(np.concatenate([np.diff(time) for time in runs])))


@dataclass(frozen=True, eq=False)
class Bench(Result):
    """A drive, what is to be found of it, and what is known so far: where candidates are tried."""

    parameters: ParameterSet
    stage: Stage
    """All unknowns at once."""
    variables: Unknowns
    """The machine's unknowns."""
    present: Array
    """(m, K) what the runs made so far tell, in noise's deviations; no rows for none."""
    sensors: tuple[Sensor, ...]
    """Those of the campaign, or of a fresh plan."""

    def rows(self, maneuver: Maneuver, sensor: Sensor) -> Array:
        """(<= K, K) factor of what one sensor would tell in a test, its free zero spent."""
        # what is known beforehand counts once, not once a test
        free = {k: v.model_copy(update={"prior": None}) for k, v in self.stage.free.items()}
        stage = self.stage.model_copy(update={"free": free})
        return _machine_rows(stage_problem(stage, self.parameters, [_imagined(maneuver, sensor)]))

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
        Symbols or columns that are fixed in the set-up and count as unknown here.
    sensors : sequence of Sensor
        Of a fresh plan; beside experiments they replace those of the same kind.
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
    present = _machine_rows(replace(problem, scales=scales))
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
            raise InputError(f"{name} is free in the fit configuration already.")
        columns = CATALOGUE[symbol].columns if name == symbol else (name,)
        if any(not np.isfinite(parameters.numbers[column]) for column in columns):
            raise InputError(f"{name} is off in the drive, so no test can determine it.")
        positive = all(parameters.numbers[column] > 0.0 for column in columns)
        zero = any(parameters.numbers[column] == 0.0 for column in columns)
        more[name] = Free(bounds=(-1.0, 1.0)) if zero else Free(relative=(0.5, 2.0), log=positive)
    return stage.model_copy(update={"free": {**stage.free, **more}})


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


def _machine(problem: Problem) -> tuple[Unknowns, list[int]]:
    """The unknowns that are no run's own, and their places."""
    places = [k for k, each in enumerate(problem.unknowns) if each.run is None]
    return Unknowns(tuple(problem.unknowns[k] for k in places)), places


def _machine_rows(problem: Problem) -> Array:
    """(<= K, K) factor of the derivatives by the machine's unknowns, those of single runs spent."""
    derivatives = problem.evaluate(problem.start).jacobian
    _, machine = _machine(problem)
    own = [k for k in range(derivatives.shape[1]) if k not in machine]
    factor = triangular_factor(np.column_stack([derivatives[:, own], derivatives[:, machine]]))
    return np.asarray(factor[len(own) :, len(own) :])


KNOWN = 1.0
"""Standard error of a solver's number, 100 %, up to which an unknown counts as determined."""

WORTH = 1e-3
"""Relative gain below which nothing is said of it."""


class Candidate(NamedTuple):
    """A test that could be made."""

    def __repr__(self) -> str:
        return short(self)

    name: str
    derivatives: Array
    """(m, K) of what it would measure by the solver's vector, over the noise's deviation; or their
    triangular factor."""
    duration: float | None = None
    """How long it takes, if that is to count. [s]"""

    @property
    def rows(self) -> Array:
        """(<= K, K) triangular factor."""
        return triangular_factor(self.derivatives)


class Gain(NamedTuple):
    """What a candidate would do for one unknown."""

    name: str
    before: float
    """Standard error of the solver's number now; inf if undetermined."""
    after: float
    """And with the candidate."""

    @property
    def ratio(self) -> float:
        """After over before: 1 is no gain, 0 determines what was not."""
        if self.before == self.after:
            return 1.0
        return 0.0 if self.before == inf else self.after / self.before


@dataclass(frozen=True)
class Advice(Result):
    """One candidate, judged."""

    candidate: str
    gains: tuple[Gain, ...]
    """For each free unknown."""
    newly_determined: tuple[str, ...]
    """Unknowns whose standard error it would be the first to bring below 100 %."""
    ranks: int
    """How many more combinations would be determined."""
    d_gain: float
    """Mean factor by which standard errors shrink along the directions determined already
    (D-criterion), 1 is none."""
    duration: float | None

    @property
    def rank(self) -> tuple[int, int, float]:
        """Least for the best: unknowns newly determined, combinations, D-gain."""
        return -len(self.newly_determined), -self.ranks, -self.d_gain

    @property
    def best(self) -> Gain | None:
        """The unknown that gains most, of those that are then known to better than 100 %."""
        known = [gain for gain in self.gains if gain.after <= KNOWN]
        return min(known, key=lambda gain: gain.ratio) if known else None


def advise(
    present: Array, candidates: Sequence[Candidate], variables: Unknowns
) -> tuple[Advice, ...]:
    """Rank candidate tests by what they would add.

    Parameters
    ----------
    present : (m, K) array
        What the tests made so far tell: derivatives of the weighted residuals over the deviation of
        an independent one; no rows if there are none.
    candidates : sequence of Candidate
        Tests to choose from.
    variables : Unknowns
        The unknowns; those at a bound count as known.

    Returns
    -------
    tuple of Advice
        Best first: most unknowns newly determined, most combinations, largest D-gain.

    Raises
    ------
    InputError
        If there is no candidate, a shape is wrong, or a number is not finite.
    """
    if not candidates:
        raise InputError("There is no candidate to choose from.")
    for name, rows in (("the present", present), *((c.name, c.derivatives) for c in candidates)):
        if rows.ndim != 2 or rows.shape[1] != variables.count or not np.isfinite(rows).all():
            raise InputError(
                f"{name}: derivatives by {variables.count} parameters are so many columns of "
                f"finite numbers, not {rows.shape}."
            )
    judged = [_judge(present, each, variables) for each in candidates]
    return tuple(sorted(judged, key=lambda each: each.rank))


def _judge(present: Array, candidate: Candidate, variables: Unknowns) -> Advice:
    free = variables.free
    now, known_now = whitening(present, free, TOLERANCE)
    then, known_then = whitening(np.vstack([present, candidate.rows]), free, TOLERANCE)
    before = np.where(known_now, np.sqrt(np.sum(now**2, axis=1)), inf)
    after = np.where(known_then, np.sqrt(np.sum(then**2, axis=1)), inf)
    names = variables.names
    # errors afterwards along the directions known now, in which they are 1 and independent now
    along = (present @ now).T @ (present @ then)
    shrinking = -np.linalg.slogdet(along @ along.T)[1]
    return Advice(
        candidate.name,
        tuple(
            Gain(names[k], float(before[k]), float(min(after[k], before[k])))
            for k in np.flatnonzero(free)
        ),
        tuple(names[k] for k in np.flatnonzero(free & (after <= KNOWN) & (before > KNOWN))),
        then.shape[1] - now.shape[1],
        float(np.exp(0.5 * shrinking / max(now.shape[1], 1))),
        candidate.duration,
    )


def default_maneuvers() -> tuple[Maneuver, ...]:
    """Small and large, slow and fast, both ways: what to choose from where nothing is named."""
    both = (1.0, -1.0)
    up_and_down = (2.0, 4.0, 6.0, 8.0, 10.0, 8.0, 6.0, 4.0, 2.0, 0.0)
    return (
        *(step(sign * volts) for volts in (2.0, 5.0, 9.0) for sign in both),
        *(ramp(sign) for sign in both),
        *(
            replace(
                stairs([sign * volts + 0.0 for volts in up_and_down], 2.0),
                name=f"stairs to {10.0 * sign:g} V and back",
            )
            for sign in both
        ),
        stairs([5.0, -5.0, 5.0, -5.0, 0.0], 2.0),
        stairs([9.0, -9.0, 0.0], 3.0),
        *(sine(volts, 0.1, length=30.0) for volts in (2.0, 5.0, 9.0)),
        sine(9.0, 0.3, length=20.0),
        *(
            replace(
                multisine(volts, (0.05, 2.0, 8), length=60.0),
                name=f"multisine {volts:g} V 0.05 to 2 Hz",
            )
            for volts in (4.0, 9.0)
        ),
    )


def in_turn(
    present: Array,
    candidates: Sequence[Candidate],
    variables: Unknowns,
    count: int,
) -> tuple[Advice, ...]:
    """A plan of tests: the best one, then the best beside it, and so on, each at most once.

    As many as `count`, fewer if none of the others tells anything new; otherwise as `advise`.
    """
    left, chosen = list(candidates), list[Advice]()
    while left and len(chosen) < count:
        best = advise(present, left, variables)[0]
        if not best.newly_determined and not best.ranks and best.d_gain < 1.0 + WORTH:
            break
        taken = next(each for each in left if each.name == best.candidate)
        left.remove(taken)
        chosen.append(best)
        present = triangular_factor(np.vstack([present, taken.rows]))
    return tuple(chosen)


def best_for_each(judged: Sequence[Advice]) -> dict[str, tuple[str, Gain]]:
    """For each unknown the candidate after which its standard error is least, and the gain.

    Unknowns that none would tell more of are left out.
    """
    best: dict[str, tuple[str, Gain]] = {}
    for advice in judged:
        for gain in advice.gains:
            if gain.ratio < 1.0 - WORTH and (
                gain.name not in best or gain.after < best[gain.name][1].after
            ):
                best[gain.name] = (advice.candidate, gain)
    return best
