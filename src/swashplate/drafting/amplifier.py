"""First guesses of an amplifier's numbers, read off the currents that logs have.

What a control card does between command and current is, each way, a dead zone, a jump at its edge
and a gain; and a filter, which on some cards has a limited rate. `guess_amplifier` reads the former
off settled currents, and tries forms of the latter: plain filters, lags with a limited rate
each way, and those of the packaged cards. All numbers of the best are fitted to the currents.

The constants are judgement: they are the grids of a coarse search, from whose best points a fit
begins. Only a guess depends on them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import inf, isfinite, pi, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import CURRENTS, Channel, Experiment
from swashplate.drive import Drive
from swashplate.errors import InputError, SwashplateError
from swashplate.identification import FitSetup, solve
from swashplate.identification.estimation import Free, joined, problem_of, smooth
from swashplate.parameters import SIDES, ParameterSet, preset_names
from swashplate.results import short
from swashplate.tables import UNIT, Cell, Column, Table

Array = NDArray[np.float64]
PlusMinus = tuple[float, float]
"""A parameter's numbers for commands above and below 0."""

SETTLED = 0.3
"""Time over which a command must have been slow, so that the current has settled. [s]"""
SLOW = 0.15
"""Change of a slow command in that time, over the largest one, at most. [1]"""
SETTLED_DELAYS = (0.0, 0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.08, 0.1)
"""Delays with which settled currents follow, the filter's lag included. [s]"""
FEWEST = 40
"""Fewest settled samples of a direction that a line is drawn through."""
ENOUGH_OF_RUN = 4000
"""Samples of a run that are enough: of more, some are left out."""
ENOUGH_SETTLED = 2000
"""Settled samples of a direction that are enough."""
DEAD_ZONES = np.linspace(0.0, 0.6, 121)
"""Dead zones that are tried, over the largest command. [1]"""
NATURAL_FREQUENCIES = (10.0, 20.0, 40.0, 80.0, 160.0, 320.0)
"""Natural frequencies of the plain filters that are tried. [rad/s]"""
DELAYS = np.arange(0.0, 0.1005, 0.001)
"""Delays that are tried. [s]"""
RATE = 512.0
"""Samples a second of the simulated currents. [Hz]"""
DYNAMIC = ("zeta", "omega", "C", "lim1", "lim2", "I_t1", "I_t2", "a")
"""Parameters of the current's dynamics."""
SCALED = ("C", "lim1", "lim2", "I_t1", "I_t2")
"""Those of them that are proportional to the size of the current."""
WEAK_SOLENOIDS = 1e-3
"""Z19 of the simulations: at no current do solenoids this weak overpower the feedback spring."""
LAGS = (0.005, 0.015, 0.05)
"""Lags of the filters with a limited rate that are tried. [s]"""
OVERDAMPED = 2.0
"""Damping of these: they are lags of first order, but for a much shorter one."""
RATE_WINDOW = 0.04
"""Time over which rates of a current are taken. [s]"""
FASTEST = 0.9
"""Quantile of a current's rates above half of the largest one, near which a limit would lie. [1]"""
SIMPLER = 1.05
"""A filter without limits is taken unless its error is so many times as large. [1]"""
EVALUATIONS, TOLERANCE = 40, 1e-4
"""Of the fit of a form."""
STATIC_FACTOR, DYNAMIC_FACTOR = 2.0, 10.0
"""By which it may change a number of the settled current, and one of the dynamics. [1]"""
LONGEST_DELAY = 0.1
"""Up to which it may always go. [s]"""
SCALED_AT = 10.0
"""Command beyond the dead zone at which sizes of currents are compared: a card's full range. [V]"""


class AmplifierGuess(NamedTuple):
    """Numbers of an amplifier, read off currents; both ways of a pair as magnitudes, plus first."""

    def __repr__(self) -> str:
        return short(self)

    dead_zone: PlusMinus
    """[V]"""
    jump: PlusMinus
    """Current right beyond the dead zone. [A]"""
    gain: PlusMinus
    """[A/V]"""
    dynamics: Mapping[str, PlusMinus]
    """Parameters of the current's dynamics, by symbol. [SI]"""
    card: str
    """The packaged card that they are of, empty for a plain filter."""
    delay: float
    """[s]"""
    command: PlusMinus
    """Largest command with a current; 0 for a way that was not tried, whose numbers are the
    other's. [V]"""
    fit_percent: float
    """100 (1 - error's RMS over the currents' standard deviation). [%]"""

    def settled(self, side: int, volts: float) -> float:
        """Settled current of a way, 0 plus and 1 minus, at a command of that sign [V]. [A]"""
        beyond = volts - self.dead_zone[side]
        return self.jump[side] + self.gain[side] * beyond if beyond > 0.0 else 0.0


class _Currents(NamedTuple):
    """A current and its command in one run."""

    experiment: Experiment
    channel: Channel
    time: Array
    command: Array
    current: Array
    """Magnitude of that of the driven solenoid."""
    sides: tuple[int, ...]
    """Ways that it shows, 0 plus and 1 minus."""


SIDES_OF: Mapping[str, tuple[int, ...]] = {"current_plus": (0,), "current_minus": (1,)}
"""Ways that the current of one solenoid shows; other kinds show both."""


def _currents(experiments: Sequence[Experiment]) -> Iterator[_Currents]:
    """Currents of runs that are driven by a voltage, as magnitudes."""
    for run in experiments:
        if run.input.kind != "voltage":
            continue
        for channel in run.of_kind(*CURRENTS):
            stride = max(np.count_nonzero(channel.used) // ENOUGH_OF_RUN, 1)
            time = channel.time[channel.used][::stride]
            current = channel.values[channel.used][::stride]
            if time.size < FEWEST:
                continue
            command = run.input.at(time)
            if channel.kind == "signed_current":
                # not by the command's sign: the current turns later
                current = np.abs(current)
            sides = SIDES_OF.get(channel.kind, (0, 1))
            yield _Currents(run, channel, time, command, current, sides)


def guess_amplifier(experiments: Sequence[Experiment]) -> AmplifierGuess | None:
    """First guess of an amplifier from the runs of one axis, None if they measure no current.

    Runs need a voltage as input and a channel of a current; what is ignored does not count.
    """
    measured = list(_currents(experiments))
    seen_plus, seen_minus = _static_line(measured, 0), _static_line(measured, 1)
    # a way without a current has the other's numbers
    plus, minus = seen_plus or seen_minus, seen_minus or seen_plus
    if plus is None or minus is None:
        return None
    static: dict[str, PlusMinus] = {
        "V_dz": (plus.dead_zone, minus.dead_zone),
        "J": (plus.jump, minus.jump),
        "G1": (plus.gain, minus.gain),
    }
    tried = seen_plus is not None, seen_minus is not None
    trials = [_try_dynamics(measured, static, dynamics) for dynamics in _forms(measured, static)]
    trial = min(trials, key=lambda trial: trial.error * (1.0 if trial.is_plain else SIMPLER))
    best = _fitted_form(measured, static, trial, tried)
    currents = np.concatenate([reading.current for reading in measured])
    return AmplifierGuess(
        dead_zone=best.numbers["V_dz"],
        jump=best.numbers["J"],
        gain=best.numbers["G1"],
        dynamics={symbol: best.numbers[symbol] for symbol in DYNAMIC},
        card=best.card,
        delay=best.delay,
        command=(
            seen_plus.command if seen_plus else 0.0,
            seen_minus.command if seen_minus else 0.0,
        ),
        fit_percent=100.0 * (1.0 - best.error / float(np.std(currents))),
    )


class _SteadyLine(NamedTuple):
    """Settled current of one way over the command, a dead zone and a straight line beyond it."""

    dead_zone: float
    """[V]"""
    jump: float
    """[A]"""
    gain: float
    """[A/V]"""
    command: float
    """Largest one. [V]"""
    squared_error: float
    """Mean over the samples. [A²]"""


def _static_line(measured: Sequence[_Currents], side: int) -> _SteadyLine | None:
    """Line of a way at the delay of the least error; None if no line fits its currents."""
    best: _SteadyLine | None = None
    for delay in SETTLED_DELAYS:
        line = _line(*_settled(measured, side, delay))
        if line is not None and (best is None or line.squared_error < best.squared_error):
            best = line
    return best


def _settled(measured: Sequence[_Currents], side: int, delay: float) -> tuple[Array, Array]:
    """Commands of a way, earlier by a delay [s], as magnitudes [V], and settled currents [A].

    All currents if the command is nowhere slow, as under a joystick.
    """
    sign = 1.0 - 2.0 * side
    slow, every = list[Array](), list[Array]()
    largest = max((float(np.abs(currents.command).max()) for currents in measured), default=0.0)
    for currents in measured:
        if side not in currents.sides:
            continue
        drive = currents.experiment.input
        grid = np.linspace(-SETTLED - delay, 0.0, 9)[:, None] + currents.time
        recent_commands = drive.at(grid.ravel()).reshape(grid.shape)
        command = sign * drive.at(currents.time - delay)
        one_way = command > 0.0
        readings = np.stack([command, currents.current])
        slow.append(readings[:, one_way & (np.ptp(recent_commands, axis=0) <= SLOW * largest)])
        every.append(readings[:, one_way])
    volts, amperes = np.concatenate([np.zeros((2, 0)), *slow], axis=1)
    if volts.size < FEWEST or np.ptp(volts) < 0.1 * largest:
        volts, amperes = np.concatenate([np.zeros((2, 0)), *every], axis=1)
    stride = max(volts.size // ENOUGH_SETTLED, 1)
    return volts[::stride], amperes[::stride]


def _line(volts: Array, amperes: Array) -> _SteadyLine | None:
    """Dead zone, jump and gain of least squares; None if no current rises with the command."""
    if volts.size < FEWEST:
        return None
    best: _SteadyLine | None = None
    largest = float(volts.max())
    for dead_zone in (DEAD_ZONES * largest).tolist():
        beyond = volts > dead_zone
        if np.count_nonzero(beyond) < FEWEST // 2:
            break
        over = volts[beyond] - dead_zone
        terms = np.stack([np.ones(over.size), over], axis=1)
        jump, gain = np.linalg.lstsq(terms, amperes[beyond], rcond=None)[0].tolist()
        if jump < 0.0:
            jump = 0.0
            gain = float(over @ amperes[beyond] / (over @ over))
        residual = amperes - np.where(beyond, jump + gain * (volts - dead_zone), 0.0)
        line = _SteadyLine(
            dead_zone=dead_zone,
            jump=jump,
            gain=gain,
            command=largest,
            squared_error=float(np.mean(residual**2)),
        )
        if gain > 0.0 and (best is None or line.squared_error < best.squared_error):
            best = line
    return best


class _Dynamics(NamedTuple):
    """Dynamics of a current that are tried."""

    card: str
    """The packaged card that they are of, empty for a plain filter."""
    numbers: dict[str, PlusMinus]
    """Parameters by symbol. [SI]"""


class _DynamicsTrial(NamedTuple):
    """Error of simulated against measured currents, at the delay of the least error."""

    dynamics: _Dynamics
    delay: float
    """[s]"""
    error: float
    """RMS. [A]"""

    @property
    def is_plain(self) -> bool:
        """Whether it is a filter without a limited rate."""
        return not isfinite(self.dynamics.numbers["lim1"][0])


def _forms(measured: Sequence[_Currents], static: Mapping[str, PlusMinus]) -> Iterator[_Dynamics]:
    """Dynamics to try: plain filters, lags with a limited rate each way, each packaged card.

    The last for currents of the size that settled ones have.
    """
    plain = Drive.preset("neutral").at_every_rate().parameters
    unlimited = {symbol: _plus_minus(plain, symbol) for symbol in DYNAMIC}
    for omega in NATURAL_FREQUENCIES:
        yield _Dynamics("", {**unlimited, "zeta": (1.0, 1.0), "omega": (omega, omega)})
    rates = _largest_rates(measured, static)
    if rates is not None:
        for lag in LAGS:
            yield _Dynamics("", {**unlimited, **_limited(lag, rates, static)})
    cards = {plain.card}
    for name in preset_names():
        packaged = Drive.preset(name).at_every_rate().parameters
        if packaged.card not in cards:
            cards.add(packaged.card)
            yield _Dynamics(packaged.card, _scaled_dynamics(packaged, static))


def _limited(
    lag: float, rates: tuple[float, float], static: Mapping[str, PlusMinus]
) -> dict[str, PlusMinus]:
    """Dynamics of a current that jumps at once, and has a limited rate beyond its jump."""
    omega = (OVERDAMPED + sqrt(OVERDAMPED**2 - 1.0)) / lag
    rising, falling = rates
    return {
        "zeta": (OVERDAMPED, OVERDAMPED),
        "omega": (omega, omega),
        "lim1": (rising, rising),
        "lim2": (falling, falling),
        "I_t1": static["J"],
        "I_t2": static["J"],
        "a": (1.0 / lag, 1.0 / lag),
    }


def _largest_rates(
    measured: Sequence[_Currents], static: Mapping[str, PlusMinus]
) -> tuple[float, float] | None:
    """Rates of rising and falling beyond the jump that a limit would hold; None without. [A/s]"""
    changes = list[Array]()
    for reading in measured:
        jump = min(static["J"][side] for side in reading.sides)
        interval = float(np.median(np.diff(reading.time)))
        rows = max(round(RATE_WINDOW / interval), 1)
        first, last = reading.current[:-rows], reading.current[rows:]
        beyond = np.minimum(first, last) > jump
        passed = reading.time[rows:] - reading.time[:-rows]
        changes.append(((last - first) / passed)[beyond])
    rates = np.concatenate([np.zeros(0), *changes])
    largest = [float((sign * rates).max(initial=0.0)) for sign in (1.0, -1.0)]
    if not min(largest) > 0.0:
        return None
    rising, falling = (
        float(np.quantile(sizes[sizes > 0.5 * most], FASTEST))
        for sizes, most in zip((rates, -rates), largest, strict=True)
    )
    return rising, falling


def _scaled_dynamics(
    packaged: ParameterSet, static: Mapping[str, PlusMinus]
) -> dict[str, PlusMinus]:
    """Dynamics of a packaged card for currents of the size that settled ones have."""
    factors = list[float]()
    for side in range(2):
        measured = static["J"][side] + SCALED_AT * static["G1"][side]
        of_card = _plus_minus(packaged, "J")[side] + SCALED_AT * _plus_minus(packaged, "G1")[side]
        factors.append(measured / of_card)
    numbers = dict[str, PlusMinus]()
    for symbol in DYNAMIC:
        plus, minus = _plus_minus(packaged, symbol)
        if symbol in SCALED:
            plus *= factors[0]
            minus *= factors[1]
        numbers[symbol] = plus, minus
    return numbers


def _plus_minus(parameters: ParameterSet, symbol: str) -> PlusMinus:
    """Numbers of plus and minus."""
    plus, minus = parameters[symbol].values
    return plus, minus


def _try_dynamics(
    measured: Sequence[_Currents],
    static: Mapping[str, PlusMinus],
    dynamics: _Dynamics,
    delays: Array = DELAYS,
) -> _DynamicsTrial:
    """Simulate the currents with some dynamics; of some delays [s] the best, and its error.

    The error is infinite if the card refuses a command.
    """
    neutral = Drive.preset("neutral").at_every_rate().parameters
    drive = Drive(neutral.with_numbers({"Z19": WEAK_SOLENOIDS, **static, **dynamics.numbers}))
    squares = np.zeros(delays.size)
    size = 0
    try:
        for reading in measured:
            time, simulated = _simulated_current(drive, reading)
            for k, delay in enumerate(delays):
                residual = np.interp(reading.time - delay, time, simulated) - reading.current
                squares[k] += float(residual @ residual)
            size += reading.time.size
    except InputError:  # a command beyond what a card takes, or a filter too fast for the step
        return _DynamicsTrial(dynamics, 0.0, inf)
    best = int(np.argmin(squares))
    return _DynamicsTrial(dynamics, float(delays[best]), float(np.sqrt(squares[best] / size)))


class _FittedForm(NamedTuple):
    """A form whose numbers were fitted to the currents."""

    card: str
    numbers: dict[str, PlusMinus]
    """Static ones and those of the dynamics, by symbol. [SI]"""
    delay: float
    """[s]"""
    error: float
    """RMS. [A]"""


def _fitted_form(
    measured: Sequence[_Currents],
    static: Mapping[str, PlusMinus],
    trial: _DynamicsTrial,
    tried: tuple[bool, bool],
) -> _FittedForm:
    """All numbers of a form by least squares from a trial of it; the trial if that fails.

    Numbers of a way that was not tried are the other's.
    """
    numbers: dict[str, PlusMinus] = {**static, **trial.dynamics.numbers}
    as_tried = _FittedForm(trial.dynamics.card, numbers, trial.delay, trial.error)
    if not isfinite(trial.error):
        return as_tried
    base = Drive.preset("neutral").at_every_rate().parameters
    start = base.with_numbers({"Z19": WEAK_SOLENOIDS, **numbers, "tau": trial.delay})
    free = {"tau": Free(bounds=(0.0, max(2.0 * trial.delay, LONGEST_DELAY)))}
    for symbol, pair in numbers.items():
        factor = STATIC_FACTOR if symbol in static else DYNAMIC_FACTOR
        for side, number, is_tried in zip(SIDES, pair, tried, strict=True):
            if is_tried and number > 0.0 and isfinite(number):
                free[f"{symbol}_{side}"] = Free(relative=(1.0 / factor, factor), log=True)
    runs = {id(reading.experiment): reading.experiment for reading in measured}
    unsettled = [run for run in runs.values() if not run.input.settled]
    jumping = {id(run): joined([run], "jumps")[0] for run in unsettled}
    try:
        problem = problem_of(
            FitSetup(part="card", free=free),
            smooth(start),
            [jumping.get(key, run) for key, run in runs.items()],
        )
        solution = solve(problem, tolerance=TOLERANCE, max_evaluations=EVALUATIONS)
    except SwashplateError:
        return as_tried
    values = problem.unknowns.values(solution.vector)
    for symbol, (plus, minus) in numbers.items():
        plus, minus = values.get(f"{symbol}_plus", plus), values.get(f"{symbol}_minus", minus)
        if not all(tried):
            plus, minus = (plus, plus) if tried[0] else (minus, minus)
        numbers[symbol] = plus, minus
    delay = round(values["tau"], 5)
    dynamics = _Dynamics(trial.dynamics.card, {symbol: numbers[symbol] for symbol in DYNAMIC})
    static_found = {symbol: numbers[symbol] for symbol in static}
    end = _try_dynamics(measured, static_found, dynamics, np.array([delay]))
    return _FittedForm(trial.dynamics.card, numbers, delay, end.error)


def _simulated_current(drive: Drive, reading: _Currents) -> tuple[Array, Array]:
    """Instants [s], and the simulated magnitude of the current that was measured [A]."""
    command = reading.experiment.input
    run = drive.simulate(
        command.values,
        RATE,
        time=command.time,
        interpolation="previous" if command.is_held else "linear",
        start=reading.experiment.begins,
    )
    if reading.channel.kind == "signed_current":
        return run.time, np.abs(run.current)
    solenoids = (run.current_positive, run.current_negative)
    return run.time, np.sum([solenoids[side] for side in reading.sides], axis=0)


def amplifier_table(guess: AmplifierGuess) -> Table:
    """Table of an amplifier's guess, a column for each way."""
    columns = (Column(""), Column("plus", ".4g"), Column("minus", ".4g"), UNIT)
    table = Table("Its amplifier, from the current", columns)
    omega = guess.dynamics["omega"]
    rows = (
        ("dead zone", guess.dead_zone, "V", ".3g"),
        ("jump at its edge", guess.jump, "A", ""),
        ("gain beyond it", guess.gain, "A/V", ""),
        ("natural frequency", (omega[0] / (2.0 * pi), omega[1] / (2.0 * pi)), "Hz", ".3g"),
    )
    for name, values, unit, spec in rows:
        cells = (
            Cell(None, "not tried") if not tried else value
            for value, tried in zip(values, guess.command, strict=True)
        )
        table.add(name, *cells, unit=unit, spec=spec)
    table.add("delay", 1e3 * guess.delay, "", unit="ms", spec=".3g")
    return table
