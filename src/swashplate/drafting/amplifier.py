"""First guesses of an amplifier's numbers, read off the currents that logs have.

What a control card does between command and current is, each way, a dead zone, a jump at its edge
and a gain; and a filter, which on some cards has a limited rate. `guess_amplifier` reads the former
off settled currents and takes the latter from whichever packaged card, or plain filter, follows the
logs best.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import inf, pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import CURRENTS, Channel, Experiment
from swashplate.drive import Drive
from swashplate.errors import InputError
from swashplate.parameters import ParameterSet, preset_names
from swashplate.results import short
from swashplate.tables import UNIT, Cell, Column, Table

Array = NDArray[np.float64]
Pair = tuple[float, float]

SETTLED, SLOW = 0.3, 0.15
"""Time in which a command has changed by less than this share of the largest one, so that the
current follows it settled, but for a delay. [s], [1]"""
LATE = (0.0, 0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.08, 0.1)
"""Delays with which settled currents follow, the filter's lag included. [s]"""
FEWEST = 40
"""Settled samples of a direction that tell anything."""
ROWS, MOST = 4000, 2000
"""Samples of a run, and settled samples of a direction, that are enough."""
DEAD_ZONES = np.linspace(0.0, 0.6, 121)
"""Dead zones that are tried, over the largest command. [1]"""
NATURAL_FREQUENCIES = (10.0, 20.0, 40.0, 80.0, 160.0, 320.0)
"""Of plain filters that are tried. [rad/s]"""
DELAYS = np.arange(0.0, 0.1005, 0.001)
"""Delays that are tried. [s]"""
RATE = 512.0
"""Samples a second of the simulated currents. [Hz]"""
DYNAMIC = ("zeta", "omega", "C", "lim1", "lim2", "I_t1", "I_t2", "a")
"""Parameters of the current's dynamics."""
OF_SIZE = ("C", "lim1", "lim2", "I_t1", "I_t2")
"""Those of them that go with the size of the current."""


class AmplifierGuess(NamedTuple):
    """What currents show at first sight; both ways of a pair as magnitudes, plus first."""

    def __repr__(self) -> str:
        return short(self)

    dead_zone: Pair
    """[V]"""
    jump: Pair
    """Current right beyond the dead zone. [A]"""
    gain: Pair
    """[A/V]"""
    dynamics: Mapping[str, Pair]
    """Parameters of the current's dynamics, by symbol. [SI]"""
    card: str
    """The packaged card that they are of, empty for a plain filter."""
    delay: float
    """[s]"""
    command: Pair
    """Largest command with a current; 0 for a way that was not tried, whose numbers are the
    other's. [V]"""
    fit_percent: float
    """100 (1 - error's RMS over the currents' standard deviation). [%]"""

    def settled(self, side: int, volts: float) -> float:
        """Settled current of a way, 0 plus and 1 minus, at a command of that sign [V]. [A]"""
        beyond = volts - self.dead_zone[side]
        return self.jump[side] + self.gain[side] * beyond if beyond > 0.0 else 0.0


class _Currents(NamedTuple):
    """A current beside its command in one run."""

    experiment: Experiment
    channel: Channel
    time: Array
    command: Array
    current: Array
    """Magnitude of that of the driven solenoid."""
    sides: tuple[int, ...]
    """Ways that it shows, 0 plus and 1 minus."""


def _currents(experiments: Sequence[Experiment]) -> Iterator[_Currents]:
    """Currents of runs that are driven by a voltage, as magnitudes."""
    sides = {"current_plus": (0,), "current_minus": (1,)}
    for run in experiments:
        if run.input.kind != "voltage":
            continue
        for channel in run.of_kind(*CURRENTS):
            every = slice(None, None, max(np.count_nonzero(channel.used) // ROWS, 1))
            time, current = channel.time[channel.used][every], channel.values[channel.used][every]
            if time.size < FEWEST:
                continue
            command = run.input.at(time)
            if channel.kind == "signed_current":
                # not by the command's sign: the current turns later
                current = np.abs(current)
            yield _Currents(run, channel, time, command, current, sides.get(channel.kind, (0, 1)))


def guess_amplifier(experiments: Sequence[Experiment]) -> AmplifierGuess | None:
    """First guess of an amplifier from the runs of one axis, None if they measure no current.

    Runs need a voltage as input and a channel of a current; what is ignored does not count.
    """
    measured = list(_currents(experiments))
    lines = [_static(measured, side) for side in range(2)]
    if lines[0] is None and lines[1] is None:
        return None
    plus, minus = (line or opposite for line, opposite in (lines, lines[::-1]))
    assert plus is not None
    assert minus is not None
    static: dict[str, Pair] = {
        "V_dz": (plus.dead_zone, minus.dead_zone),
        "J": (plus.jump, minus.jump),
        "G1": (plus.gain, minus.gain),
    }
    card, dynamics, delay, error = min(
        (_followed(measured, static, *dynamic) for dynamic in _dynamics(static)),
        key=lambda trial: trial[3],
    )
    spread = np.concatenate([currents.current for currents in measured])
    return AmplifierGuess(
        dead_zone=static["V_dz"],
        jump=static["J"],
        gain=static["G1"],
        dynamics=dynamics,
        card=card,
        delay=delay,
        command=(lines[0].command if lines[0] else 0.0, lines[1].command if lines[1] else 0.0),
        fit_percent=100.0 * (1.0 - error / float(np.std(spread))),
    )


class _Line(NamedTuple):
    """Settled current of one way over the command, and what it leaves."""

    dead_zone: float
    jump: float
    gain: float
    command: float
    """Largest one. [V]"""
    left: float
    """Mean square. [A²]"""


def _static(measured: Sequence[_Currents], side: int) -> _Line | None:
    """Dead zone, jump and gain of a way at the delay of the least error; None if it tells none."""
    lines = (_line(*_settled(measured, side, late)) for late in LATE)
    return min(filter(None, lines), key=lambda line: line.left, default=None)


def _settled(measured: Sequence[_Currents], side: int, late: float) -> tuple[Array, Array]:
    """Commands of a sign, so much earlier [V], and currents that have settled [A].

    All of them if the command is nowhere slow, as under a joystick.
    """
    sign, slow, every = 1.0 - 2.0 * side, list[Array](), list[Array]()
    largest = max((float(np.abs(currents.command).max()) for currents in measured), default=0.0)
    for currents in measured:
        if side not in currents.sides:
            continue
        drive = currents.experiment.input
        grid = np.linspace(-SETTLED - late, 0.0, 9)[:, None] + currents.time
        before = drive.at(grid.ravel()).reshape(grid.shape)
        command = sign * drive.at(currents.time - late)
        one_way = command > 0.0
        readings = np.stack([command, currents.current])
        slow.append(readings[:, one_way & (np.ptp(before, axis=0) <= SLOW * largest)])
        every.append(readings[:, one_way])
    volts, amperes = np.concatenate([np.zeros((2, 0)), *slow], axis=1)
    if volts.size < FEWEST or np.ptp(volts) < 0.1 * largest:
        volts, amperes = np.concatenate([np.zeros((2, 0)), *every], axis=1)
    step = max(volts.size // MOST, 1)
    return volts[::step], amperes[::step]


def _line(volts: Array, amperes: Array) -> _Line | None:
    """Dead zone, jump and gain of least squares; None if no current rises with the command."""
    best: _Line | None = None
    if volts.size < FEWEST:
        return None
    most = float(volts.max())
    for zone in (DEAD_ZONES * most).tolist():
        beyond = volts > zone
        if np.count_nonzero(beyond) < FEWEST // 2:
            break
        over = volts[beyond] - zone
        terms = np.stack([np.ones(over.size), over], axis=1)
        jump, gain = np.linalg.lstsq(terms, amperes[beyond], rcond=None)[0].tolist()
        if jump < 0.0:
            jump, gain = 0.0, float(over @ amperes[beyond] / (over @ over))
        residual = amperes - np.where(beyond, jump + gain * (volts - zone), 0.0)
        line = _Line(zone, jump, gain, most, float(np.mean(residual**2)))
        if gain > 0.0 and (best is None or line.left < best.left):
            best = line
    return best


def _dynamics(static: Mapping[str, Pair]) -> Iterator[tuple[str, dict[str, Pair]]]:
    """Dynamics to try: of each packaged card, for currents of this size, and of plain filters."""
    plain = Drive.preset("neutral").at_every_rate().parameters
    off = {symbol: _pair(plain, symbol) for symbol in DYNAMIC}
    for omega in NATURAL_FREQUENCIES:
        yield "", {**off, "zeta": (1.0, 1.0), "omega": (omega, omega)}
    seen = {plain.card}
    for name in preset_names():
        packaged = Drive.preset(name).at_every_rate().parameters
        if packaged.card in seen:
            continue
        seen.add(packaged.card)
        sizes = [
            (jump + 10.0 * gain) / (j + 10.0 * g)
            for jump, gain, j, g in zip(
                *(static["J"], static["G1"], _pair(packaged, "J"), _pair(packaged, "G1")),
                strict=True,
            )
        ]
        factors = {symbol: sizes if symbol in OF_SIZE else [1.0, 1.0] for symbol in DYNAMIC}
        numbers = {
            symbol: (_pair(packaged, symbol)[0] * plus, _pair(packaged, symbol)[1] * minus)
            for symbol, (plus, minus) in factors.items()
        }
        yield packaged.card, numbers


def _pair(parameters: ParameterSet, symbol: str) -> Pair:
    plus, minus = parameters[symbol].values
    return plus, minus


def _followed(
    measured: Sequence[_Currents],
    static: Mapping[str, Pair],
    card: str,
    dynamics: dict[str, Pair],
) -> tuple[str, dict[str, Pair], float, float]:
    """Card and dynamics, with the delay [s] of the least error and that error's RMS [A]."""
    # whatever the current, the solenoids do not overpower the feedback spring
    neutral = Drive.preset("neutral").at_every_rate().parameters
    drive = Drive(neutral.with_numbers({"Z19": 1e-3, **static, **dynamics}))
    squares, size = np.zeros(DELAYS.size), 0
    try:
        for measured_current in measured:
            command = measured_current.experiment.input
            run = drive.simulate(
                command.values,
                RATE,
                time=command.time,
                interpolation="previous" if command.is_held else "linear",
                start=measured_current.experiment.begins,
            )
            solenoids = (run.current_positive, run.current_negative)
            simulated = np.sum([solenoids[side] for side in measured_current.sides], axis=0)
            if measured_current.channel.kind == "signed_current":
                simulated = np.abs(run.current)
            for k, delay in enumerate(DELAYS):
                residual = (
                    np.interp(measured_current.time - delay, run.time, simulated)
                    - measured_current.current
                )
                squares[k] += float(residual @ residual)
            size += measured_current.time.size
    except InputError:  # a command beyond what a card takes, or a filter too fast for the step
        return card, dynamics, 0.0, inf
    best = int(np.argmin(squares))
    return card, dynamics, float(DELAYS[best]), float(np.sqrt(squares[best] / size))


def amplifier_table(guess: AmplifierGuess) -> Table:
    """What was guessed of the amplifier, each way."""
    columns = (Column(side, ".4g") for side in ("plus", "minus"))
    table = Table("Its amplifier, from the current", (Column(""), *columns, UNIT))
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
