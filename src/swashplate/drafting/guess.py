"""First guesses of an unknown machine's numbers, read off its logs.

What a drive does between command and speed is, at first sight, a dead zone, a jump at its edge, a
gain, a top speed and a greatest acceleration each way, one delay and one lag, and the creep at
rest. `guess_drive` finds these by least squares on mean speeds, the creep from what moves while the
command rests. All of it is where a fit begins (`starting_point`), not its result: the constants
here are judgement, and a fit depends on them only by where its search begins.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import (
    CURRENTS,
    Campaign,
    Channel,
    ChannelKind,
    Experiment,
    reversed_commands,
    spiked,
)
from swashplate.drafting.amplifier import AmplifierGuess, guess_amplifier
from swashplate.drafting.mean_speeds import (
    ACCELERATION,
    DEAD_ZONE,
    DELAY,
    GAIN,
    GAP,
    JUMP,
    LAG,
    TOP_SPEED,
    WINDOW,
    MovingRun,
    moving_run,
    simulated_course,
    speed_errors,
)
from swashplate.drafting.plain_search import ONE_WAY, goes_with_command, searched_numbers
from swashplate.errors import InputError
from swashplate.results import short

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

FEWEST = 40
"""Fewest mean speeds that a guess is made from, of the shortest windows."""
FEWEST_SAMPLES = 8
"""Up to so many used samples a channel does not count as one that measures a motion."""
GREATEST = 0.99
"""Quantile of the mean speeds' magnitudes that is taken for the greatest speed. [1]"""
REST = 0.5
"""Length of the intervals in which a creep is looked for. [s]"""
RESTS = 4
"""Fewest of these intervals that a creep is read from."""
STILL = 0.01
"""Command that counts as none, over the largest one, whatever the dead zone. [1]"""
LAGS_TO_REST = 5.0
"""Lags after which a motion has come to rest: it has 0.7 % of its speed then. [1]"""
FALSE_ALARM = 1e-3
"""Probability at which noise that is normal passes for a creep. [1]"""
CREEPS = 0.002
"""Creep over the greatest speed that is none: zero errors of tachometers are as large. [1]"""
MOTIONS: tuple[ChannelKind, ...] = ("shaft_speed", "encoder_counts", "position")
"""Kinds of channel that measure a motion, the one to be preferred first."""


class Guess(NamedTuple):
    """Numbers of a drive, read off its logs; both ways of a pair as magnitudes, plus first."""

    def __repr__(self) -> str:
        return short(self)

    axis: str
    unit: str
    """Unit of a speed, ``"rad/s"`` or ``"m/s"``."""
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
    """Speed at rest, with its sign; 0 if the logs show none, None if their rests are too short or
    too few to show one. [unit]"""
    command: tuple[float, float]
    """Largest command; 0 for a way that was not tried, whose numbers are the other's. [V]"""
    speed: float
    """Greatest mean speed: the 0.99 quantile of their magnitudes. [unit]"""
    fit_percent: float
    """100 (1 - error's RMS over the mean speeds' standard deviation). [%]"""
    amplifier: AmplifierGuess | None = None
    """The amplifier's numbers, None if no run measures its current."""


def _creep(runs: Sequence[MovingRun], numbers: Array, speed: float) -> float | None:
    """Mean speed at rest beyond that of `numbers` (13,); 0 if it may be none, None without rests.

    From intervals in which the command has lain in the dead zone for so long that a motion at the
    greatest speed has come to rest. Each is taken as one observation: their scatter holds the
    noise, and the rest of motions that end more slowly than the numbers say. The counts of an
    encoder may hide one at both ends of a rest, or show one too many.
    """
    from scipy.special import stdtrit

    largest = max(float(np.abs(run.command).max()) for run in runs)
    # a creep takes from the dead zone of one way what it gives to the other
    largest_rest = max(0.5 * float(numbers[DEAD_ZONE].min()), STILL * largest)
    stopping = speed / numbers[ACCELERATION].min()
    settling = numbers[DELAY] + LAGS_TO_REST * numbers[LAG] + stopping
    speeds = list[Array]()
    rounding = 0.0
    for run in runs:
        simulated = simulated_course(run, numbers)
        for begin, end in _rests(run, largest_rest, settling):
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
    doubt = max(quantile * error + rounding / (REST * observed.size), CREEPS * speed)
    return mean if abs(mean) > doubt else 0.0


def _rests(run: MovingRun, largest_rest: float, settling: float) -> Iterable[tuple[float, float]]:
    """Begin and end of each stretch that has settled to rest, measured without a gap. [s]"""
    resting = np.abs(run.command) <= largest_rest
    # a command that is held stays up to the next stamp
    until = np.append(run.stamps[1:], run.stamps[-1]) if run.is_held else run.stamps
    changes = np.flatnonzero(np.diff(np.concatenate([[0], resting.astype(np.int8), [0]])))
    intervals = np.diff(run.sampled)
    gaps = np.flatnonzero(intervals > GAP * float(np.median(intervals)))
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
        If no run has such a channel, the input is not a voltage, the speed of a run or of all moves
        opposite to the command, the command is reversed, a channel has gross spikes, or too little
        moves.
    """
    experiments = tests.select(role="fit") if isinstance(tests, Campaign) else tuple(tests)
    runs, unit = _moving_runs(experiments)
    _check_length(runs, experiments)
    speeds = np.concatenate([run.speeds for run in runs])
    weights = np.concatenate([run.windows.weights for run in runs])
    command = _largest_commands(runs)
    speed = float(np.quantile(np.abs(speeds), GREATEST))
    if not command.max() > 0.0 or speed == 0.0:
        raise InputError("The command or the speed never leaves rest: there is nothing to guess.")
    numbers = searched_numbers(runs, weights * speeds, command, speed, creep=0.0)
    creep = _creep(runs, numbers, speed)
    if creep:
        # without it one dead zone was too wide, the other too narrow, and the gains made up for it
        numbers = searched_numbers(runs, weights * speeds, command, speed, creep)
    mean = np.average(speeds, weights=weights**2)
    spread = np.sum(weights**2 * (speeds - mean) ** 2)
    unexplained = np.sum(speed_errors(runs, numbers) ** 2) / spread
    tried = command > 0.0
    return Guess(
        axis=experiments[0].axis,
        unit=unit,
        dead_zone=_both_ways(numbers[DEAD_ZONE], tried),
        gain=_both_ways(numbers[GAIN], tried),
        jump=_both_ways(numbers[JUMP], tried),
        top_speed=_both_ways(numbers[TOP_SPEED], tried),
        acceleration=_both_ways(numbers[ACCELERATION], tried),
        lag=float(numbers[LAG]),
        delay=round(float(numbers[DELAY]), 6),
        creep=creep,
        command=(float(command[0]), float(command[1])),
        speed=speed,
        fit_percent=100.0 * (1.0 - sqrt(unexplained)),
        amplifier=guess_amplifier(experiments),
    )


def _moving_runs(experiments: Sequence[Experiment]) -> tuple[list[MovingRun], str]:
    """Runs that measure a motion, and the unit of their speeds."""
    spikes = spiked(experiments)
    runs, unit = list[MovingRun](), ""
    reversed_runs = list[tuple[str, str]]()
    for experiment in experiments:
        channel = _motion_channel(experiment)
        if channel is None:
            continue
        if experiment.input.kind != "voltage":
            raise InputError(
                f"{experiment.input.source}: the input is of the kind '{experiment.input.kind}', "
                'but a guess needs a command in V: write kind = "voltage", unit = "V", and a scale '
                "that makes its full range ±10 V; an offset is added after scaling, in V."
            )
        for used in (channel, *experiment.of_kind(*CURRENTS)):
            sentence, is_gross = spikes.get((experiment.name, used.name), ("", False))
            if is_gross:
                raise InputError(f"{sentence}.")
        unit = f"{channel.unit}/s" if channel.is_position else channel.unit
        run = moving_run(experiment, channel)
        runs.append(run)
        if not goes_with_command(run):
            reversed_runs.append((experiment.name, channel.name))
    for _, sentence in reversed_commands(experiments):
        raise InputError(f"{sentence}.")
    if 0 < len(reversed_runs) < len(runs):
        run_name, channel_name = reversed_runs[0]
        raise InputError(
            f"In {run_name} '{channel_name}' moves opposite to the command, in other runs with it: "
            'reverse it with sign = -1 for this run, or leave the run out with role = "ignore".'
        )
    return runs, unit


def _motion_channel(experiment: Experiment) -> Channel | None:
    """The channel that tells how a run moves, a speed before a position; None without one."""
    for kind in MOTIONS:
        for channel in experiment.of_kind(kind):
            if channel.used.sum() > FEWEST_SAMPLES:
                return channel
    return None


def _check_length(runs: Sequence[MovingRun], experiments: Sequence[Experiment]) -> None:
    """Refuse runs that give no mean speeds, or too few."""
    weights = np.concatenate([np.zeros(0), *(run.windows.weights for run in runs)])
    count = float(np.sum(weights**2))
    motions = (channel for run in experiments for channel in run.of_kind(*MOTIONS))
    if count < FEWEST and any(channel.used.any() for channel in motions):
        raise InputError(
            f"The runs are too short to guess from: they give {count:.0f} mean speeds of "
            f"{WINDOW:g} s, and at least {FEWEST} are needed."
        )
    if not weights.size:
        raise InputError(
            "No run measures a motion to guess from: it needs a channel of the kind shaft_speed, "
            "position or encoder_counts that is not ignored."
        )


def _largest_commands(runs: Sequence[MovingRun]) -> Array:
    """Largest command each way (2,), 0 for a way that is hardly exercised. [V]"""
    commands = np.concatenate([run.command for run in runs])
    largest = np.maximum([commands.max(), -commands.min()], 0.0)
    largest[largest < ONE_WAY * largest.max()] = 0.0
    return largest


def _both_ways(pair: Array, tried: Mask) -> tuple[float, float]:
    """Numbers of plus and minus; those of a way that was not tried are the other's."""
    plus, minus = pair.tolist()
    if not tried[0]:
        plus = minus
    elif not tried[1]:
        minus = plus
    return plus, minus


def steady_speed(guess: Guess, side: int) -> float:
    """Settled speed under the largest command one way.

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
