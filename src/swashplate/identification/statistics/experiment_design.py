"""Design of experiments by Fisher information: what runs tell of each unknown, what a test adds.

`run_information` says before a fit which run tells of which unknown, and of which unknowns none
does. `prior_information` is what is known before the next test; `advise` ranks candidate tests by
what they would add.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import KINDS, Channel, ChannelKind, Experiment, InputSignal, SignalOrigin
from swashplate.drive import Drive
from swashplate.errors import InputError
from swashplate.identification.estimation.arrow import dense_factor, triangular_factor, whitening
from swashplate.identification.estimation.drive_model import CURRENTS, DriveModel
from swashplate.identification.estimation.fit_problem import problem_of
from swashplate.identification.estimation.problem import (
    TOLERANCE,
    LinearisedFit,
    Problem,
    factor_of,
    linearised_fit,
    noise_scales,
)
from swashplate.identification.estimation.setup import FitSetup
from swashplate.identification.estimation.unknowns import Unknowns
from swashplate.identification.noise import spectral_covariance
from swashplate.identification.statistics.determination import Identifiability, identifiability
from swashplate.identification.statistics.intervals import prior_sentences
from swashplate.maneuvers import Maneuver, multisine, ramp, sine, stairs, step
from swashplate.parameters import (
    CATALOGUE,
    COLUMNS,
    FULL_VOLTAGE,
    HasParameters,
    ParameterSet,
    set_of,
)
from swashplate.results import Result
from swashplate.rig import COUNTS_PER_TURN
from swashplate.tables import Column, Table, listed

Array = NDArray[np.float64]

# --- what the runs tell ---------------------------------------------------------------------------

LARGE_SHARE = 0.2
"""Share of the information on an unknown from which a run is one of the most informative. [1]"""
SINGLE_RUN_SHARE = 0.9
"""Share of it from which the unknown is said to rest on one run only. [1]"""


@dataclass(frozen=True, eq=False)
class RunInformation(Result):
    """What the runs can tell of the unknowns, at the nominal values: known before a fit."""

    problem: Problem
    linearised: LinearisedFit

    @property
    def names(self) -> tuple[str, ...]:
        """The unknowns, those of single runs left out."""
        return tuple(unknown.name for unknown in self.problem.unknowns if unknown.run is None)

    @property
    def _drive_model(self) -> DriveModel | None:
        """The model of a drive; None of a user-defined model."""
        model = self.problem.model
        return model if isinstance(model, DriveModel) else None

    @cached_property
    def identifiability(self) -> Identifiability:
        """Which unknowns the runs determine, and directions that change nothing."""
        fit = self.linearised
        estimated = {target for unknown in self.problem.unknowns for target in unknown.targets}
        drive_model = self._drive_model
        numbers = self.problem.fixed if drive_model is None else drive_model.parameters.numbers
        fixed = {name: value for name, value in numbers.items() if name not in estimated}
        return identifiability(fit.triangle, fit.variables, tolerance=fit.tolerance, fixed=fixed)

    @cached_property
    def shares(self) -> dict[str, dict[str, float]]:
        """Share of each run in the information on an unknown, by unknown and run."""
        total = np.maximum(sum(self._squares.values()), 1e-300)
        indices = {name: self.linearised.variables.index(name) for name in self.names}
        return {
            name: {run: float(of_run[k] / total[k]) for run, of_run in self._squares.items()}
            for name, k in indices.items()
        }

    @cached_property
    def _squares(self) -> dict[str, Array]:
        """(K,) squared lengths of the derivatives of each run's residuals, by run."""
        fit = self.linearised
        squares = {run.name: np.zeros(len(fit.variables)) for run in self.problem.experiments}
        for run, jacobian in fit.jacobians():
            squares[run.name][fit.variables.columns(run.name)] += np.sum(jacobian**2, axis=0)
        return squares

    @cached_property
    def effects(self) -> dict[str, float]:
        """Length of the change of all residuals for 1 % of each unknown; 1 is one noise.

        Of the runs alone, whatever is known beforehand.
        """
        fit = self.linearised
        of_runs = np.sqrt(sum(self._squares.values()))
        with_priors = np.maximum(np.linalg.norm(fit.triangle, axis=0), 1e-300)
        lengths = self.identifiability.sensitivity * of_runs / with_priors
        return {name: float(lengths[fit.variables.index(name)]) for name in self.names}

    @property
    def is_known_beforehand(self) -> bool:
        """Whether something is known of each number of the machine before the tests."""
        return all(unknown.prior for unknown in self.problem.unknowns if unknown.run is None)

    def required_excitation(self, name: str) -> str:
        """What a test must reach to inform of an unknown; by default a tilted swash plate."""
        if self._drive_model is None:
            return "a motion that depends on it"
        forces = self._drive_model.forces
        if forces is not None and name in forces.names:
            return f"{abs(forces.currents[name]):g} A beyond Z17"
        definition = CATALOGUE.get(COLUMNS.get(name, name))
        return (definition.needs if definition is not None else "") or "a tilted swash plate"

    def sentences(self) -> tuple[str, ...]:
        """What the runs determine, what no run informs of, and what one run only does."""
        # what no run exercises is said with its reason
        determined = replace(self.identifiability, unexcited=()).sentences()
        if self.is_known_beforehand:
            fit = self.linearised
            errors = np.sqrt(np.sum(fit.whitening**2, axis=1))
            determined = prior_sentences(self.problem.unknowns, fit.variables.vector, errors)
        return (*determined, *self._unexcited_sentences(), *self._single_run_sentences())

    def _unexcited_sentences(self) -> Iterator[str]:
        """One sentence for all unknowns that need the same excitation."""
        names_by_reason: dict[str, list[str]] = {}
        least = 1e-14 * max(self.effects.values(), default=0.0)
        for name, effect in self.effects.items():
            if effect <= least:
                names_by_reason.setdefault(self._unexcited_reason(name), []).append(name)
        for reason, names in names_by_reason.items():
            verb = "needs" if len(names) == 1 else "need"
            yield f"{listed(names)} {verb} {reason}"

    def _unexcited_reason(self, name: str) -> str:
        """What an unknown needs that no sample has, and the remedies."""
        unknown = self.problem.unknowns[self.problem.unknowns.index(name)]
        if unknown.kind == "force":
            excitation = "currents of their size beyond Z17"
            remedy = "ask for forces at smaller currents"
        else:
            excitation = self.required_excitation(name)
            remedy = "leave it as known" if self.is_known_beforehand else "fix it"
        direction = ""
        if "_plus" in name:
            direction = " (plus)"
        elif "_minus" in name:
            direction = " (minus)"
        return (
            f"{excitation}{direction}, which no sample shows: {remedy}, or add a test that has it."
        )

    def _single_run_sentences(self) -> Iterator[str]:
        if len(self.problem.experiments) < 2:
            return
        names_by_run: dict[str, list[str]] = {}
        for name, shares in self.shares.items():
            run = max(shares, key=lambda run_name: shares[run_name])
            if shares[run] >= SINGLE_RUN_SHARE:
                names_by_run.setdefault(run, []).append(name)
        for run, names in names_by_run.items():
            share = f"{100.0 * SINGLE_RUN_SHARE:.0f} %"
            yield f"{listed(names)}: {share} of the information or more is from {run} alone."

    def table(self, runs: Sequence[str] = ()) -> Table:
        """What runs tell of each unknown, one letter a run; in a file their shares."""
        run_names = runs or [run.name for run in self.problem.experiments]
        columns = (
            Column("parameter"),
            Column("needs", wrap=True, of="tpf" if self._drive_model else ""),
            Column("effect", ".3g"),
            Column("runs"),
            *(Column(run, ".6g", of="f") for run in run_names),
        )
        table = Table("What the runs tell", columns)
        for name, shares in self.shares.items():
            shares_of_runs = [shares.get(run) for run in run_names]
            table.add(
                name,
                self.required_excitation(name),
                self.effects[name],
                "".join(_letter(share) for share in shares_of_runs),
                *shares_of_runs,
            )
        return table


def _letter(share: float | None) -> str:
    """Letter of a run in a table: by its share, None for a run that is not fitted."""
    if share is None:
        return "-"
    if share >= LARGE_SHARE:
        return "#"
    return "+" if share else "."


def run_information(
    setup: FitSetup, nominal: ParameterSet | HasParameters, experiments: Sequence[Experiment]
) -> RunInformation:
    """What runs can tell of the unknowns of a fit setup, before any fit.

    At the nominal values, best those that `smooth` makes, as a fit takes them. Raises
    as `fit_problem.problem_of`, and a `DomainError` if the model does not hold there.
    """
    problem = problem_of(setup, set_of(nominal), experiments)
    return RunInformation(problem, linearised_fit(problem, problem.start))


# --- what is known so far -------------------------------------------------------------------------

RATE = 512.0
"""At which tests to come are simulated. [Hz]"""
TRANSDUCER, MEMORY = 0.005, 0.1
"""Noise that is assumed of a sensor, over the largest value that the drive makes it read [1], and
the time over which errors of a measurement are assumed to stay correlated [s]."""
NOISELESS, FARTHEST = 1e-9, 0.05
"""Residuals, over their channel's noise, that are rounding; and those, over the range of what is
measured, of a drive that nobody would call fitted."""


class Sensor(NamedTuple):
    """What is measured in a test, and how well."""

    kind: ChannelKind
    noise: float
    """Standard deviation. [SI unit of the kind]"""
    memory: float = MEMORY
    """Time for which one sample stands. [s]"""
    origin: str = "stated"

    def deviation(self, step: float) -> float:
        """Of a sample every `step` [s], so that each counts as an independent one."""
        return self.noise * float(np.sqrt(max(self.memory / step, 1.0)))


def default_sensors(drive: Drive) -> tuple[Sensor, ...]:
    """Those of Kruse's tests: an ammeter around both leads and, if known, its encoder.

    Of the others noise is assumed, 0.5 % of what full command makes them read.
    """
    full = [drive.simulate(step(sign * FULL_VOLTAGE).sample(RATE), RATE) for sign in (1.0, -1.0)]
    current, speed = (
        TRANSDUCER * max(float(np.abs(getattr(run, name)).max()) for run in full)
        for name in ("current", "shaft_speed")
    )
    assumed = f"assumed, {100.0 * TRANSDUCER:g} % of range"
    turned = Sensor("shaft_speed", speed, origin=assumed)
    if drive.name in COUNTS_PER_TURN:
        rounding = 2.0 * np.pi / COUNTS_PER_TURN[drive.name] / np.sqrt(12.0)
        turned = Sensor("encoder_counts", float(rounding), origin="rounding of Kruse's encoder")
    return Sensor("rectified_current", current, origin=assumed), turned


@dataclass(frozen=True, eq=False)
class PriorInformation(Result):
    """A drive, what is to be found of it, and what is known before the next test."""

    parameters: ParameterSet
    setup: FitSetup
    """What is free."""
    variables: Unknowns
    """The machine's unknowns."""
    present: Array
    """(m, K) what the runs made so far tell, in noise's deviations; no rows for none."""
    sensors: tuple[Sensor, ...]
    """Those of the campaign, or of a fresh plan."""

    def candidate(self, maneuver: Maneuver, sensors: Sequence[Sensor] = ()) -> CandidateTest:
        """A test with some sensors, by default those of the campaign; free zeros are spent."""
        rows = []
        for sensor in sensors or self.sensors:
            problem = problem_of(self.setup, self.parameters, [_imagined(maneuver, sensor)])
            # what is known beforehand counts once, not once a test
            data_alone = replace(
                problem,
                unknowns=problem.unknowns.with_worths(None),
                scales=noise_scales(problem.experiments, problem.channels),
            )
            rows.append(machine_rows(data_alone))
        return CandidateTest(maneuver.name, triangular_factor(np.vstack(rows)), maneuver.length)


def prior_information(
    parameters: ParameterSet,
    setup: FitSetup,
    experiments: Sequence[Experiment] = (),
    *,
    fitted: bool = False,
    sensors: Sequence[Sensor] = (),
) -> PriorInformation:
    """What is known of a drive before the next test.

    If the drive is `fitted` to the tests made so far, noise and its colour are those of
    the residuals; else noise is as the campaign states it, correlated over `MEMORY`. Without
    tests, a fresh plan, the `sensors` count, by default `default_sensors`.

    An `InputError` says that no sensor tells of the setup's part of the drive, or that a drive that
    is said to be fitted leaves residuals that are zero, or too large to be noise.
    """
    if not experiments:
        return _without_tests(parameters, setup, sensors or default_sensors(Drive(parameters)))
    problem = problem_of(setup, parameters, experiments)
    fit = linearised_fit(problem, problem.start) if fitted else None
    noises = noise_scales(problem.experiments, problem.channels)
    scales = {}
    by_kind = dict[str, Sensor]()
    for name in problem.channels:
        channels = [run[name] for run in problem.experiments if name in run.channels]
        intervals = np.concatenate([np.diff(channel.time) for channel in channels])
        interval = float(np.median(intervals))
        sensor = Sensor(channels[0].kind, noises[name], origin="as in the campaign")
        if fit is not None:
            sensor = sensor_of_residuals(fit, channels, sensor, interval)
        # one sample in each `memory` is independent: the others are worth nothing
        scales[name] = sensor.deviation(interval)
        by_kind[sensor.kind] = sensor
    return PriorInformation(
        parameters=parameters,
        setup=setup,
        variables=machine_unknowns(problem),
        present=machine_rows(replace(problem, scales=scales)),
        sensors=tuple(by_kind.values()),
    )


def _without_tests(
    parameters: ParameterSet, setup: FitSetup, sensors: Sequence[Sensor]
) -> PriorInformation:
    """What only priors tell, and those of some sensors that the setup's part of a drive moves."""
    part = setup.part
    useful = [
        sensor
        for sensor in sensors
        if part == "chain" or (sensor.kind in CURRENTS) == (part == "card")
    ]
    if not useful:
        kinds = ", ".join(sensor.kind for sensor in sensors)
        raise InputError(f"A {part} shows nothing to {kinds}: name another sensor.")
    problem = problem_of(setup, parameters, [_imagined(step(1.0), useful[0])])
    _, prior = problem.unknowns.prior_rows(problem.start)
    return PriorInformation(
        parameters=parameters,
        setup=setup,
        variables=machine_unknowns(problem),
        present=prior[:, _machine(problem)],
        sensors=tuple(useful),
    )


def sensor_of_residuals(
    fit: LinearisedFit, channels: Sequence[Channel], stated: Sensor, step: float
) -> Sensor:
    """A channel's sensor with the noise that the residuals of a fitted drive show."""
    name = channels[0].name
    largest = max(float(np.ptp(channel.values)) for channel in channels)
    runs = []
    derivatives = []
    for run, jacobian in fit.jacobians():
        if run.channel != name:
            continue
        # with free zeros and other unknowns of single runs fitted
        run_jacobian = jacobian[:, : fit.variables.of_run(run.name).size]
        shift = np.linalg.lstsq(run_jacobian, -run.residual, rcond=None)[0]
        runs.append(run._replace(residual=run.residual + run_jacobian @ shift))
        derivatives.append(jacobian)
    square = np.concatenate([run.residual for run in runs]) ** 2
    noise = stated.noise * float(np.sqrt(np.mean(square)))
    if not NOISELESS * stated.noise < noise or noise > FARTHEST * largest:
        raise InputError(
            f"The drive misses '{name}' by {100.0 * noise / largest:.2g} % of its range, so its "
            "residuals are not noise; give a drive that was fitted to these tests, or none."
        )
    factor = factor_of(zip(runs, derivatives, strict=True), fit.variables)
    noisy = replace(fit, runs=tuple(runs), derivatives=derivatives, factor=factor)
    # not of all that the residuals hold, but of what meets the unknowns' derivatives; of the noise
    # alone, since each run has been fitted by itself
    coloured = spectral_covariance(noisy)
    white = noisy.squares / noisy.spare_samples * np.sum(noisy.whitening**2, axis=1)
    determined = coloured.determined & (white > 0.0)
    ratios = np.diag(coloured.matrix)[determined] / white[determined]
    samples = max(float(np.median(ratios)), 1.0)
    return Sensor(stated.kind, noise, samples * step, "residuals of the drive")


def _imagined(maneuver: Maneuver, sensor: Sensor) -> Experiment:
    """A test that has not been made: only its stamps count, not its values."""
    time = maneuver.time(RATE)
    source = SignalOrigin(Path("none"), sensor.kind)
    channel = Channel(
        name=sensor.kind,
        kind=sensor.kind,
        unit=KINDS[sensor.kind].units[0],
        time=time,
        values=np.zeros_like(time),
        weight=np.ones_like(time),
        source=source,
        noise=sensor.deviation(1.0 / RATE),
    )
    return Experiment(
        name=maneuver.name,
        axis="",
        run=maneuver.name,
        role="fit",
        start="rest",
        start_pressure=None,
        input=InputSignal("voltage", "V", time, maneuver.sample(RATE), "linear", source),
        channels={sensor.kind: channel},
    )


def _machine(problem: Problem) -> list[int]:
    """Numbers of the unknowns that do not belong to a single run."""
    return [k for k, unknown in enumerate(problem.unknowns) if unknown.run is None]


def machine_unknowns(problem: Problem) -> Unknowns:
    """The unknowns that do not belong to a single run."""
    return Unknowns(tuple(problem.unknowns[k] for k in _machine(problem)))


def machine_rows(problem: Problem) -> Array:
    """(<= K, K) factor of the derivatives by the machine's unknowns, those of single runs spent."""
    derivatives = problem.evaluate(problem.start).jacobian
    machine = _machine(problem)
    of_runs = [k for k in range(derivatives.shape[1]) if k not in machine]
    size = len(of_runs)
    return triangular_factor(derivatives[:, [*of_runs, *machine]])[size:, size:]


# --- tests to come --------------------------------------------------------------------------------

KNOWN, WORTH = 1.0, 1e-3
"""Standard error of a solver's number, 100 %, up to which an unknown counts as determined; relative
gain below which nothing is said of it."""
Commands = tuple[float, float]
"""Largest command each way, positive and negative, as magnitudes. [V]"""
FULL: Commands = (FULL_VOLTAGE, FULL_VOLTAGE)
"""Of a machine of which nothing is known."""
NO_COMMAND = 0.05
"""Share of the largest command up to which one the other way is none. [1]"""
NAMED = 4
"""Unknowns that a row of advice names."""


@dataclass(frozen=True, eq=False)
class CandidateTest(Result):
    """A test that could be made."""

    name: str
    derivatives: Array
    """(m, K) of what it would measure by the solver's vector, over the noise's deviation; or their
    triangular factor."""
    duration: float | None = None
    """How long it takes, if that is to count. [s]"""


@dataclass(frozen=True, eq=False)
class Advice(Result):
    """One candidate, judged."""

    candidate: str
    duration: float | None
    names: tuple[str, ...]
    """Free unknowns."""
    before: Array
    """(k,) standard errors of the solver's numbers now; inf if undetermined."""
    after: Array
    """(k,) and with the candidate."""
    ranks: int
    """How many more combinations would be determined."""
    d_gain: float
    """Mean factor by which standard errors shrink along the directions determined already
    (D-criterion), 1 is none."""

    @property
    def newly_determined(self) -> tuple[str, ...]:
        """Unknowns whose standard error it would be the first to bring below 100 %."""
        new = (self.after <= KNOWN) & (self.before > KNOWN)
        return tuple(name for name, first in zip(self.names, new, strict=True) if first)


def advise(
    present: Array, candidates: Sequence[CandidateTest], variables: Unknowns
) -> tuple[Advice, ...]:
    """Rank candidate tests by what they would add.

    Best first: most unknowns newly determined, most combinations, largest D-gain.

    Parameters
    ----------
    present : (m, K) array
        What the tests made so far tell: derivatives of the weighted residuals over the deviation of
        an independent one; no rows if there are none.
    candidates : sequence of CandidateTest
        Tests to choose from; an `InputError` if there is none or its shape is wrong.
    variables : Unknowns
        The unknowns; those at a bound count as known.
    """
    if not candidates:
        raise InputError("There is no candidate to choose from.")
    for name, rows in (("the present", present), *((c.name, c.derivatives) for c in candidates)):
        if rows.ndim != 2 or rows.shape[1] != len(variables) or not np.isfinite(rows).all():
            raise InputError(
                f"{name}: derivatives by {len(variables)} parameters must be as many columns of "
                f"finite numbers, not {rows.shape}."
            )
    free = variables.free
    names = tuple(variables.names[k] for k in np.flatnonzero(free))
    known_now = whitening(dense_factor(present), free, TOLERANCE)
    now = known_now.matrix
    errors_now = np.where(known_now.determined, np.linalg.norm(now, axis=1), inf)
    ranked = []
    for candidate in candidates:
        both = dense_factor(np.vstack([present, candidate.derivatives]))
        known_then = whitening(both, free, TOLERANCE)
        then = known_then.matrix
        errors_then = np.where(known_then.determined, np.linalg.norm(then, axis=1), inf)
        errors_then = np.minimum(errors_then, errors_now)
        # errors then along the directions known now, in which they are 1 and independent now
        along = (present @ now).T @ (present @ then)
        shrinking = -np.linalg.slogdet(along @ along.T)[1]
        d_gain = float(np.exp(0.5 * shrinking / max(now.shape[1], 1)))
        ranked.append(
            Advice(
                candidate=candidate.name,
                duration=candidate.duration,
                names=names,
                before=errors_now[free],
                after=errors_then[free],
                ranks=then.shape[1] - now.shape[1],
                d_gain=d_gain,
            )
        )
    ranked.sort(key=lambda advice: (-len(advice.newly_determined), -advice.ranks, -advice.d_gain))
    return tuple(ranked)


def sequential_plan(
    present: Array, candidates: Sequence[CandidateTest], variables: Unknowns, count: int
) -> tuple[Advice, ...]:
    """A plan of tests: the best one, then the best in addition to it, and so on, each at most once.

    As many as `count`, fewer if none of the others tells anything new; otherwise as `advise`.
    """
    remaining = {candidate.name: candidate for candidate in candidates}
    plan = list[Advice]()
    while remaining and len(plan) < count:
        best = advise(present, list(remaining.values()), variables)[0]
        if not best.newly_determined and not best.ranks and best.d_gain < 1.0 + WORTH:
            break
        plan.append(best)
        derivatives = remaining.pop(best.candidate).derivatives
        present = triangular_factor(np.vstack([present, derivatives]))
    return tuple(plan)


def default_maneuvers(largest: tuple[float, float] = FULL) -> tuple[Maneuver, ...]:
    """Small and large, slow and fast, both ways: what to choose from if nothing is named.

    `largest` are the largest commands of the machine, plus and minus, as magnitudes [V]; none goes
    beyond, and one that goes both ways not beyond the smaller one.
    """
    both = dict(zip((1.0, -1.0), largest, strict=True))
    smaller = min(largest)

    def levels(most: float, *usual: float) -> list[float]:
        """Usual levels of a machine that goes to 9 V, shrunk if it does not."""
        shrunk = min(most / usual[-1], 1.0)
        return [float(f"{shrunk * volts:.3g}") for volts in usual]

    climbs = []
    for sign, most in both.items():
        up = levels(most, 2.0, 4.0, 6.0, 8.0, 10.0)
        volts = [sign * level + 0.0 for level in (*up, *up[-2::-1], 0.0)]
        name = f"stairs to {sign * up[-1]:g} V and back"
        climbs.append(replace(stairs(volts, 2.0), name=name))
    small, middle, high = levels(smaller, 2.0, 5.0, 9.0)
    many = {
        volts: multisine(volts, (0.05, 2.0, 8), length=60.0) for volts in levels(smaller, 4.0, 9.0)
    }
    of_steps = {sign: levels(most, 2.0, 5.0, 9.0) for sign, most in both.items()}
    return (
        *(step(sign * of_steps[sign][k]) for k in range(3) for sign in both),
        *(ramp(sign, limit=levels(most, 10.0)[0]) for sign, most in both.items()),
        *climbs,
        stairs([middle, -middle, middle, -middle, 0.0], 2.0),
        stairs([high, -high, 0.0], 3.0),
        *(sine(volts, 0.1, length=30.0) for volts in (small, middle, high)),
        sine(high, 0.3, length=20.0),
        *(replace(m, name=f"multisine {v:g} V 0.05 to 2 Hz") for v, m in many.items()),
    )


def commands_each_way(ranges: Iterable[tuple[float, float]]) -> Commands:
    """Largest command each way of commands from low to high, 0 for a way that none goes.

    Never beyond what a card takes.
    """
    plus = minus = 0.0
    for low, high in ranges:
        plus, minus = max(plus, float(high)), max(minus, -float(low))
    # noise about 0 V is not a command
    noise = NO_COMMAND * max(plus, minus)
    return (
        min(plus, FULL_VOLTAGE) if plus > noise else 0.0,
        min(minus, FULL_VOLTAGE) if minus > noise else 0.0,
    )


def ranges_of_input(runs: Iterable[Experiment]) -> list[tuple[float, float]]:
    """Of the voltage of each run the stick's stated range, or what it commands. [V]"""
    return [
        run.input.limits or (float(run.input.values.min()), float(run.input.values.max()))
        for run in runs
        if run.input.kind == "voltage"
    ]


def largest_of_machine(ranges: Iterable[tuple[float, float]]) -> Commands:
    """Largest commands of a machine whose commands go from low to high in volts.

    Of a way that none goes the other's; ±10 V of a machine of which nothing is known.
    """
    # to more than two digits it is noise of the log
    plus, minus = (float(f"{volts:.2g}") for volts in commands_each_way(ranges))
    return (plus or minus, minus or plus) if plus or minus else FULL


def advice_table(title: str, judged: Sequence[Advice]) -> Table:
    """Tests in the order given, what each would tell, and in a file all errors with it."""
    new = any(advice.newly_determined for advice in judged)
    table = Table(
        title,
        (
            Column("test", wrap=not new),
            Column("s", "g"),
            Column("first to determine", wrap=True, of="tpf" if new else ""),
            Column("gains most"),
            Column("better", "s"),
            *(Column(f"error of {name}", ".6g", of="f") for name in judged[0].names),
        ),
    )
    for advice in judged:
        first, more = advice.newly_determined[:NAMED], len(advice.newly_determined) - NAMED
        # the unknown whose error shrinks most, of those that are then known
        pairs = zip(advice.names, advice.before.tolist(), advice.after.tolist(), strict=True)
        determined = [pair for pair in pairs if pair[2] <= KNOWN]
        gained = ""
        if determined:
            name, now, then = min(determined, key=lambda pair: pair[2] / pair[1])
            error_before = f"{_error(now)} " if now <= KNOWN else ""
            gained = f"{name} {error_before}to {_error(then)}"
        table.add(
            advice.candidate,
            advice.duration,
            ", ".join(first) + (f" + {more}" if more > 0 else ""),
            gained,
            f"{advice.d_gain:.2f}x" if advice.d_gain > 1.0 + WORTH else "",
            *(error if error < inf else None for error in advice.after.tolist()),
        )
    return table


def best_tests_table(judged: Sequence[Advice]) -> Table:
    """What is known of each unknown, and which test would tell most of it."""
    columns = (Column("parameter"), Column("error now", "s"), Column("then", "s"))
    made = Table("For each parameter", (*columns, Column("best test", wrap=True)))
    for k, name in enumerate(judged[0].names):
        errors = np.array([advice.after[k] for advice in judged])
        best, now = judged[int(np.argmin(errors))], judged[0].before[k]
        then, test = (now, "no further information")
        if best.after[k] < (1.0 - WORTH) * now:
            then, test = best.after[k], best.candidate
        made.add(name, _error(now), _error(then), test)
    return made


def _error(error: float) -> str:
    return f"{100.0 * error:.2g} %" if error <= KNOWN else "-"
