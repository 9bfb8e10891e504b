"""First guesses of an unknown machine's numbers, read off its logs.

What a drive does between command and speed is, at first sight, a dead zone, a jump at its edge, a
gain, a top speed and a greatest acceleration each way, one delay and one lag, and the creep at
rest. `guess_drive` finds these by least squares on mean speeds, the creep from what moves while the
command rests. All of it is where a fit begins (`starting_point`), not its result.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import inf, isfinite, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import CURRENTS, Campaign, ChannelKind, Experiment, spiked
from swashplate.drafting.amplifier import AmplifierGuess, guess_amplifier
from swashplate.drafting.mean_speeds import (
    WINDOW,
    MovingRun,
    moving_run,
    simulated_course,
    speed_errors,
)
from swashplate.drafting.plain_search import ONE_WAY, goes_with_command, searched_numbers
from swashplate.errors import InputError
from swashplate.results import short
from swashplate.tables import UNIT, Cell, Column, Table
from swashplate.units import display_unit

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

FEWEST = 40
"""Mean speeds that tell anything."""
REST, RESTS = 0.5, 4
"""Length of the intervals in which a creep is looked for [s], and the fewest of them that tell."""
STILL = 0.01
"""Command that counts as none, over the largest one, whatever the dead zone. [1]"""
LAGS_TO_REST = 5.0
"""Lags after which a motion has come to rest: it has 0.7 % of its speed then. [1]"""
FALSE_ALARM = 1e-3
"""Probability at which noise that is normal passes for a creep. [1]"""
CREEPS = 0.002
"""Creep over the greatest speed that is none: zero errors of tachometers are as large. [1]"""


class Guess(NamedTuple):
    """What logs show at first sight; both ways of a pair as magnitudes, plus first."""

    def __repr__(self) -> str:
        return short(self)

    axis: str
    unit: str
    """Of a speed, ``"rad/s"`` or ``"m/s"``."""
    dead_zone: tuple[float, float]
    """[V]"""
    gain: tuple[float, float]
    """Speed for a volt beyond the dead zone. [unit/V]"""
    jump: tuple[float, float]
    """Speed right beyond the dead zone, 0 if none was seen. [unit]"""
    top_speed: tuple[float, float]
    """Infinite if none was reached. [unit]"""
    acceleration: tuple[float, float]
    """Infinite if it limits nothing. [unit/s]"""
    lag: float
    """[s]"""
    delay: float
    """[s]"""
    creep: float | None
    """Speed at rest, with its sign; 0 if the logs show none, None where their rests are too
    short or too few to show one. [unit]"""
    command: tuple[float, float]
    """Largest command; 0 for a way that was not tried, whose numbers are the other's. [V]"""
    speed: float
    """Greatest mean speed. [unit]"""
    fit_percent: float
    """100 (1 - error's RMS over the mean speeds' standard deviation). [%]"""
    amplifier: AmplifierGuess | None = None
    """What the current of the amplifier shows, None if no run measures one."""


def _creep(runs: Sequence[MovingRun], numbers: Array, scale: float) -> float | None:
    """Mean speed at rest beyond that of `numbers` (13,); 0 if it may be none, None without rests.

    From intervals in which the command has lain in the dead zone for so long that a motion has come
    to rest. Each is taken as one observation: the scatter of them has the noise, and what is left
    of motions that end more slowly than the numbers say. The counts of an encoder may hide one at
    both ends of a rest, or show one too many.
    """
    from scipy.special import stdtrit

    dead_zones, accelerations, lag, delay = numbers[:2], numbers[6:8], numbers[10], numbers[12]
    largest = max(float(np.abs(run.command).max()) for run in runs)
    # a creep takes from the dead zone of one way what it gives to the other
    still = max(0.5 * float(dead_zones.min()), STILL * largest)
    settling = delay + LAGS_TO_REST * lag + scale / accelerations.min()
    speeds, rounding = list[Array](), 0.0
    for run in runs:
        simulated = simulated_course(run, numbers)
        for begin, end in _rests(run, still, settling):
            ends: Array = begin + REST * np.arange(int((end - begin) / REST) + 1.0)
            measured = np.interp(ends, run.sampled, run.travelled)
            speeds.append(np.diff(measured - simulated.at(ends)) / REST)
            rounding += run.resolution
    observed = np.concatenate([np.zeros(0), *speeds])
    if observed.size < RESTS:
        return None
    mean = float(observed.mean())
    error = float(observed.std(ddof=1)) / sqrt(observed.size)
    quantile = float(stdtrit(observed.size - 1, 1.0 - 0.5 * FALSE_ALARM))
    doubt = max(quantile * error + rounding / (REST * observed.size), CREEPS * scale)
    return mean if abs(mean) > doubt else 0.0


def _rests(run: MovingRun, still: float, settling: float) -> Iterable[tuple[float, float]]:
    """Begin and end [s] of stretches at rest that were measured without a gap, settled ones."""
    resting = np.abs(run.command) <= still
    # a command that is held stays up to the next stamp
    until = np.append(run.stamps[1:], run.stamps[-1]) if run.is_held else run.stamps
    changes = np.flatnonzero(np.diff(np.concatenate([[0], resting.astype(np.int8), [0]])))
    gaps = np.flatnonzero(np.diff(run.sampled) > 3.0 * float(np.median(np.diff(run.sampled))))
    pieces = np.split(run.sampled, gaps + 1)
    for first, last in changes.reshape(-1, 2):
        for piece in pieces:
            begin = max(float(run.stamps[first]) + settling, float(piece[0]))
            end = min(float(until[last - 1]), float(piece[-1]))
            if end - begin >= REST:
                yield begin, end


def guess_drive(tests: Campaign | Sequence[Experiment]) -> Guess:
    """First guess from the runs of one axis, by their commands and their speeds or positions.

    Of a campaign from those with the role ``"fit"``.

    Runs need a voltage as input and a channel of the kind shaft_speed, position or encoder_counts;
    what is ignored does not count.

    Raises
    ------
    InputError
        If no run has such a channel, the input is no voltage, the speed of a run or of all moves
        opposite to the command, a channel has gross spikes, or too little moves.
    """
    experiments = tests.select(role="fit") if isinstance(tests, Campaign) else tuple(tests)
    runs, unit, spoilt = list[MovingRun](), "", spiked(experiments)
    reversed_runs = list[tuple[str, str]]()
    kinds: tuple[ChannelKind, ...] = ("shaft_speed", "encoder_counts", "position")
    for experiment in experiments:
        # the channel that tells how it moves: a speed before a position
        moving = (
            candidate
            for kind in kinds
            for candidate in experiment.of_kind(kind)
            if candidate.used.sum() > 8
        )
        channel = next(moving, None)
        if channel is None:
            continue
        if experiment.input.kind != "voltage":
            raise InputError(
                f"{experiment.input.source}: the input is of the kind '{experiment.input.kind}', "
                'but a guess needs a command in V: write kind = "voltage", unit = "V", and a scale '
                "that makes its full range ±10 V; an offset is added after scaling, in V."
            )
        for used in (channel, *experiment.of_kind(*CURRENTS)):
            sentence, gross = spoilt.get((experiment.name, used.name), ("", False))
            if gross:
                raise InputError(f"{sentence}.")
        unit = f"{channel.unit}/s" if channel.is_position else channel.unit
        runs.append(moving_run(experiment, channel))
        if not goes_with_command(runs[-1]):
            reversed_runs.append((experiment.name, channel.name))
    if 0 < len(reversed_runs) < len(runs):
        run, name = reversed_runs[0]
        raise InputError(
            f"In {run} '{name}' moves opposite to the command, in other runs with it: reverse it "
            "with "
            'sign = -1 for this run, or leave the run out with role = "ignore".'
        )
    speeds = np.concatenate([np.zeros(0), *(run.speeds for run in runs)])
    weights = np.concatenate([np.zeros(0), *(run.windows.weights for run in runs)])
    worth = float(np.sum(weights**2))
    moving = (channel for run in experiments for channel in run.of_kind(*kinds))
    if worth < FEWEST and any(channel.used.any() for channel in moving):
        raise InputError(
            f"The runs are too short to guess from: they give {worth:.0f} mean speeds of "
            f"{WINDOW:g} s, and at least {FEWEST} are needed."
        )
    if not speeds.size:
        raise InputError(
            "No run measures a motion to guess from: it needs a channel of the kind shaft_speed, "
            "position or encoder_counts that is not ignored."
        )
    commands = np.concatenate([run.command for run in runs])
    size = np.maximum([commands.max(), -commands.min()], 0.0)
    size[size < ONE_WAY * size.max()] = 0.0
    scale = float(np.quantile(np.abs(speeds), 0.99))
    if not size.max() > 0.0 or scale == 0.0:
        raise InputError("The command or the speed never leaves rest: there is nothing to guess.")
    searched = searched_numbers(runs, weights * speeds, size, scale, 0.0)
    creep = _creep(runs, searched, scale)
    if creep:
        # without it one dead zone was too wide, the other too narrow, and the gains made up for it
        searched = searched_numbers(runs, weights * speeds, size, scale, creep)
    mean = np.average(speeds, weights=weights**2)
    unexplained = np.sum(speed_errors(runs, searched) ** 2) / np.sum(
        weights**2 * (speeds - mean) ** 2
    )
    # numbers of a way that was not tried are the other's
    pairs = searched[:10].reshape(5, 2)
    pairs[:, size == 0.0] = pairs[:, size > 0.0][:, :1]
    numbers = [(plus, minus) for plus, minus in [*pairs.tolist(), size.tolist()]]
    dead_zone, gain, top_speed, acceleration, jump, command = numbers
    return Guess(
        *(experiments[0].axis, unit, dead_zone, gain, jump, top_speed, acceleration),
        lag=float(searched[10]),
        delay=round(float(searched[12]), 6),
        creep=creep,
        command=command,
        speed=scale,
        fit_percent=100.0 * (1.0 - sqrt(unexplained)),
        amplifier=guess_amplifier(experiments),
    )


def steady_speed(guess: Guess, side: int) -> float:
    """Speed that settles under the largest command one way.

    Parameters
    ----------
    guess : Guess
        Of one axis.
    side : {0, 1}
        0 for plus, 1 for minus.

    Returns
    -------
    float
        Magnitude, in the guess's unit.
    """
    volts = guess.command[side] or max(guess.command)
    beyond = max(volts - guess.dead_zone[side], 0.0)
    along = (1.0 - 2.0 * side) * (guess.creep or 0.0)
    speed = guess.gain[side] * beyond + guess.jump[side] + along
    return min(speed, guess.top_speed[side]) or guess.speed


def guess_table(guess: Guess) -> Table:
    """What was guessed, each way."""
    columns = (Column(side, ".4g", none="not seen") for side in ("plus", "minus"))
    table = Table(f"Axis {guess.axis}, first guess", (Column(""), *columns, UNIT))
    rows = (
        ("dead zone", guess.dead_zone, "V", ".3g"),
        ("gain beyond it", guess.gain, f"{guess.unit}/V", ""),
        ("jump at its edge", tuple(jump or inf for jump in guess.jump), guess.unit, ""),
        ("top speed", guess.top_speed, guess.unit, ""),
        ("acceleration", guess.acceleration, f"{guess.unit}^2", ""),
    )
    for name, values, unit, spec in rows:
        cells = list[Cell | float | None]()
        for column, (value, tried) in enumerate(zip(values, guess.command, strict=True)):
            if not tried:
                cells.append(Cell(None, "not tried"))
            elif isfinite(value):
                cells.append(value)
            elif name == "top speed":
                factor = display_unit(unit, steady_speed(guess, column)).factor
                speed = f"{factor * steady_speed(guess, column):.3g}"
                cells.append(Cell(None, f"at least {speed}, not seen"))
            else:
                cells.append(None)
        table.add(name, *cells, unit=unit, spec=spec)
    table.add("delay", 1e3 * guess.delay, "", unit="ms", spec=".3g")
    table.add("lag", 1e3 * guess.lag, "", unit="ms", spec=".3g")
    creep: Cell | float = guess.creep or Cell(None, "not seen")
    if guess.creep is None:
        creep = Cell(None, "no long rest")
    table.add("creep at rest", creep, "", unit=guess.unit, spec=".3g")
    return table
