"""First guesses of an unknown machine's numbers, read off its logs.

What a drive does between command and speed is, at first sight, a dead zone, a jump at its edge, a
gain, a top speed and a greatest acceleration each way, one delay and one lag. `guess_drive` finds
these by least squares on mean speeds and puts them into the drive "neutral"; `fit_configuration`
frees them, with bounds about them. Both are where a fit begins, not its result.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import product
from math import inf, isfinite, log, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.campaign import Campaign
from swashplate.campaign.experiment import Channel, Experiment
from swashplate.campaign.quality import spiked
from swashplate.campaign.samples import interpolate_counts
from swashplate.campaign.schema import ChannelKind
from swashplate.drive import Drive
from swashplate.equations.cache import kernel
from swashplate.equations.declaration import inlined
from swashplate.errors import InputError
from swashplate.parameters.parameter_set import ParameterSet, set_of
from swashplate.parameters.rules import SIDES
from swashplate.results import short
from swashplate.tables import UNIT, Cell, Column, Table
from swashplate.units import display_unit

Array = NDArray[np.float64]

STEP = 0.005
"""Step of the march. [s]"""
BEFORE = 10.0
"""Time before a run for which its motion at first has lasted, longer than any delay. [s]"""
WINDOW = 0.05
"""Time over which mean speeds are compared, or two samples where these are farther apart. [s]"""
SHORTEST = 0.005
"""Lag that a drive has at least. [s]"""
TOLD = 0.01
"""Lag that mean speeds tell from a delay: a fifth of their window, two steps of the march. [s]"""
FEW = 10.0
"""Counts in a window at the greatest speed below which an encoder's edges are joined by lines."""
QUIET = 0.05
"""Noise of mean speeds over the greatest one, to which windows of a noisy position are widened."""
FEWEST = 40
"""Mean speeds that tell anything."""
SEEN, NEXT_TO_NOTHING = 1.02, 1e-4
"""A limit is not seen in the logs where the squared error without it is less than this much larger,
nor by less than this share of all that moves. [1]"""
ONE_WAY = 0.05
"""A way that gets less than this share of the command of the other is not exercised. [1]"""
ANGLE = 0.2
"""Angle of the swash plate at the greatest speed that was seen, at most. [rad]"""
STOP_FIRST, ORIFICE_FIRST = 0.9, 0.8
"""Shares of what the largest command asks for at which a stop and an orifice that were not seen are
put first: there they act, so that a fit can tell whether they are there. A stop farther inside
bends the gain, and a search can end with both. [1]"""
STEEPEST = 30.0
"""Volts that a radian takes at least, so that at 10 V and at the upper bounds of all gains the
solenoids do not overpower the feedback spring. [V/rad]"""
JUMPS = (0.03, 0.12)
"""Jumps from which the search for one begins, over the greatest speed. [1]"""
EDGE = 0.01
"""Command over which a jump is complete, over the largest one: a sudden one would be felt by no
small change of a dead zone, as marches go in steps. [1]"""
NONE = 30.0
"""Logarithm of a limit, over the greatest speed, that is none. [1]"""
LAGS, DELAYS, DEAD_ZONES = (0.02, 0.06, 0.2, 0.6), (0.0, 0.04, 0.12, 0.3), (0.02, 0.1, 0.25)
"""Where the search begins; dead zones as shares of the largest command each way. [s], [s], [1]"""
LOWEST = np.array([0.0, 0.0, -5.0, -5.0, log(0.002), 0.0, -1.5, -1.5, -2.0, -2.0, 0.0, 0.0])
HIGHEST = np.array([0.95, 0.95, 7.0, 7.0, log(5.0), 1.0, 1.5, 1.5, 6.0, 6.0, 0.5, 0.5])
TYPICAL = np.array([0.05, 0.05, 0.2, 0.2, 0.3, 0.02, 0.1, 0.1, 0.5, 0.5, 0.02, 0.02])
"""Of what is searched for: dead zones over the largest command, logarithms of gains and of the lag,
the delay [s], logarithms of top speeds and accelerations over the greatest speed, and jumps over
it."""


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
    """Speed right beyond the dead zone, 0 where none was seen. [unit]"""
    top_speed: tuple[float, float]
    """Infinite where none was reached. [unit]"""
    acceleration: tuple[float, float]
    """Infinite where it limits nothing. [unit/s]"""
    lag: float
    """[s]"""
    delay: float
    """[s]"""
    command: tuple[float, float]
    """Largest command; 0 for a way that was not tried, whose numbers are the other's. [V]"""
    speed: float
    """Greatest mean speed. [unit]"""
    fit_percent: float
    """100 (1 - error's RMS over the mean speeds' standard deviation). [%]"""


@inlined
def _speed_at(command: float, numbers: Array, edge: float) -> float:
    """Speed that a drive without lag, delay and limits of acceleration has at a command."""
    speed = 0.0
    for way in range(2):
        sign = 1.0 - 2.0 * way
        beyond = max(sign * command - numbers[way], 0.0)
        faster = numbers[2 + way] * beyond + numbers[8 + way] * min(beyond / edge, 1.0)
        speed += sign * min(faster, numbers[4 + way])
    return speed


@kernel
def march_guess(
    stamps: Array, command: Array, held: bool, edge: float, numbers: Array, h: float,
    position: Array,
) -> None:  # fmt: skip
    """March the position of a drive without delay, in steps from the command's first stamp.

    `numbers` (11,) are dead zones, gains, top speeds, accelerations and jumps of plus and minus,
    and the lag [s]. A `held` command's steps may lie between its stamps (k,), a straight line's are
    among them. `position` (n,) is the output; its first sample gives the speed at first.
    """
    share, speed, last = 1.0 - np.exp(-h / max(numbers[10], 1e-4)), position[0], stamps.size - 1
    here, now, k = _speed_at(command[0], numbers, edge), stamps[0], 0
    position[0] = 0.0
    for n in range(1, position.size):
        # the mean of what drives the step, exactly: dead zones are crossed between two steps
        end, area = stamps[0] + n * h, 0.0
        while k < last and stamps[k + 1] <= end:
            following = _speed_at(command[k + 1], numbers, edge)
            area += (stamps[k + 1] - now) * (here if held else 0.5 * (here + following))
            here, now, k = following, stamps[k + 1], k + 1
        area += (end - now) * here
        now, before = end, speed
        speed += min(max(share * (area / h - speed), -h * numbers[7]), h * numbers[6])
        position[n] = position[n - 1] + 0.5 * h * (before + speed)


class _Run(NamedTuple):
    """A run: the march's grid (n,), its command (k,) and mean speeds (m,) of windows from edges."""

    time: Array
    stamps: Array
    """Those of the command, of a straight line the grid's as well. [s]"""
    command: Array
    """[V]"""
    held: bool
    """Whether the command is held between stamps, or a straight line."""
    start: float
    begins: Array
    width: float
    """[s]"""
    speeds: Array
    coarse: float
    """Mean speed of one count in a window; 0 of a channel that is no encoder. [unit]"""


def _errors(runs: Sequence[_Run], numbers: Array) -> Array:
    """Simulated less measured mean speeds of all runs.

    Numbers (12,) are those of `march_guess`, and the delay [s].
    """
    errors = list[Array]()
    for run in runs:
        edge = EDGE * float(np.abs(run.command).max()) or 1.0
        position = np.full(run.time.size, run.start)
        march_guess(run.stamps, run.command, run.held, edge, numbers[:11], STEP, position)
        # what comes out is delayed, so that the march meets its steps alike whatever the delay:
        # else errors had a minimum at every whole step
        time = numbers[11] + np.append(run.time[0] - BEFORE, run.time)
        position = np.append(-BEFORE * run.start, position)
        errors.append(_mean_speeds(time, position, run.begins, run.width) - run.speeds)
    return np.concatenate(errors)


def _mean_speeds(time: Array, position: Array, begins: Array, width: float) -> Array:
    """Change (m,) of the mean position from a window to the next, over its width [s].

    All samples of a noisy position count, which a difference of two of them would lose.
    """
    area = np.concatenate([[0.0], np.cumsum(0.5 * (position[1:] + position[:-1]) * np.diff(time))])
    first, middle, last = (np.interp(begins + k * width, time, area) for k in range(3))
    return np.asarray((last - 2.0 * middle + first) / width**2)


def guess_drive(tests: Campaign | Sequence[Experiment]) -> Guess:
    """First guess from the runs of one axis, by their commands and their speeds or positions.

    Of a campaign from those with the role ``"fit"``.

    Runs need a voltage as input and a channel of the kind shaft_speed, position or encoder_counts;
    what is ignored does not count.

    Raises
    ------
    InputError
        If no run has such a channel, the input is no voltage, the speed of a run or of all goes
        against the command, a channel has gross spikes, or too little moves.
    """
    experiments = tests.select(role="fit") if isinstance(tests, Campaign) else tuple(tests)
    runs, unit, spoilt = list[_Run](), "", spiked(experiments)
    reversed_runs = list[tuple[str, str]]()
    kinds: tuple[ChannelKind, ...] = ("shaft_speed", "encoder_counts", "position")
    for each in experiments:
        # the channel that tells how it moves: a speed before a position
        moving = (one for kind in kinds for one in each.of_kind(kind) if one.used.sum() > 8)
        channel = next(moving, None)
        if channel is None:
            continue
        if each.input.kind != "voltage":
            raise InputError(
                f"{each.input.source}: the input is of the kind '{each.input.kind}', but a guess "
                'needs a command in V: write kind = "voltage", unit = "V", and a scale that makes '
                "its full range ±10 V; an offset is added after scaling, in V."
            )
        sentence, gross = spoilt.get((each.name, channel.name), ("", False))
        if gross:
            raise InputError(f"{sentence}.")
        unit = f"{channel.unit}/s" if channel.is_position else channel.unit
        runs.append(_run(each, channel))
        if not _goes_with(runs[-1]):
            reversed_runs.append((each.name, channel.name))
    if 0 < len(reversed_runs) < len(runs):
        run, name = reversed_runs[0]
        raise InputError(
            f"In {run} '{name}' goes against the command, in other runs with it: reverse it with "
            'sign = -1 for this run, or leave the run out with role = "ignore".'
        )
    speeds = np.concatenate([np.zeros(0), *(run.speeds for run in runs)])
    if speeds.size < FEWEST:
        raise InputError(
            "No run measures a motion that a guess could be read off: it needs a channel of the "
            "kind shaft_speed, position or encoder_counts that is not ignored."
        )
    commands = np.concatenate([run.command for run in runs])
    size = np.maximum([commands.max(), -commands.min()], 0.0)
    size[size < ONE_WAY * size.max()] = 0.0
    scale = float(np.quantile(np.abs(speeds), 0.99))
    if not size.max() > 0.0 or scale == 0.0:
        raise InputError("The command or the speed never leaves rest: there is nothing to guess.")
    found = _searched(runs, speeds, size, scale)
    rms = float(np.sqrt(np.mean(_errors(runs, found) ** 2)))
    # numbers of a way that was not tried are the other's
    pairs = found[:10].reshape(5, 2)
    pairs[:, size == 0.0] = pairs[:, size > 0.0][:, :1]
    numbers = [(plus, minus) for plus, minus in [*pairs.tolist(), size.tolist()]]
    dead_zone, gain, top_speed, acceleration, jump, command = numbers
    return Guess(
        *(experiments[0].axis, unit, dead_zone, gain, jump, top_speed, acceleration),
        lag=float(found[10]),
        delay=round(float(found[11]), 6),
        command=command,
        speed=scale,
        fit_percent=100.0 * (1.0 - rms / float(np.std(speeds))),
    )


def _run(experiment: Experiment, channel: Channel) -> _Run:
    drive, used = experiment.input, channel.used
    time, values = channel.time[used], channel.values[used]
    interval = float(np.median(np.diff(time)))
    width, coarse = max(WINDOW, 2.0 * interval), 0.0
    if count := channel.resolution:
        rows = round(width / interval)
        coarse = count / width
        # a slow staircase shows a count in a window or none, whatever the speed between
        if np.abs(values[rows:] - values[:-rows]).max(initial=0.0) < FEW * count:
            values = interpolate_counts(time, values)
    travelled = values - values[0]
    if not channel.is_position:
        steps = 0.5 * (values[1:] + values[:-1]) * np.diff(time)
        travelled = np.concatenate([[0.0], np.cumsum(steps)])
    if channel.kind == "position":
        width = max(width, _quiet_width(time, values, interval))
    ends = max(time[0], drive.time[0]), min(time[-1], drive.time[-1])
    begins = np.arange(ends[0], ends[1] - 2.0 * width, width)
    # windows across ignored samples or a gap tell of no speed
    for gap in np.flatnonzero(np.diff(time) > 3.0 * interval):
        begins = begins[(begins >= time[gap + 1]) | (begins + 2.0 * width <= time[gap])]
    speeds = _mean_speeds(time, travelled, begins, width)
    grid = drive.time[0] + STEP * np.arange(np.ceil((drive.time[-1] - drive.time[0]) / STEP) + 1.0)
    held = drive.interpolation == "previous"
    # a straight line may cross a dead zone between two stamps
    stamps = np.append(drive.time, grid[-1]) if held else np.union1d(drive.time, grid)
    start = 0.0 if experiment.start == "rest" or not speeds.size else float(speeds[0])
    return _Run(grid, stamps, drive.at(stamps), held, start, begins, width, speeds, coarse)


def _goes_with(run: _Run) -> bool:
    """Whether a motion goes with its command at any of the delays from which the search begins."""
    middle = run.begins + run.width
    commands = (np.interp(middle - late, run.stamps, run.command) for late in DELAYS)
    return any(float(command @ run.speeds) >= 0.0 for command in commands)


def _quiet_width(time: Array, position: Array, interval: float) -> float:
    """Windows in which white noise of a position leaves 5 % of its greatest speed. [s]"""
    # 20 = 1 + 9 + 9 + 1, of the squares of a third difference
    noise = float(np.median(np.abs(np.diff(position, 3)))) / (0.6745 * sqrt(20.0))
    rough = max(round(0.5 / interval), 1)
    moved = np.abs(position[rough:] - position[:-rough]) / (time[rough:] - time[:-rough])
    fastest = float(moved.max(initial=0.0))
    # of means over w/h samples the difference over w has the deviation noise √(2 h)/w^1.5
    return (noise * sqrt(2.0 * interval) / (QUIET * fastest)) ** (2.0 / 3.0) if fastest else 0.0


def _searched(runs: Sequence[_Run], speeds: Array, size: Array, scale: float) -> Array:
    """Numbers (12,) of least squares: a grid first, on which gains are linear, then all at once."""
    from scipy.optimize import least_squares

    tried, steepness = size > 0.0, scale / size.max()

    def numbers_of(vector: Array) -> Array:
        """From what is searched for, with or without limits and jumps."""
        whole = np.concatenate([vector, [NONE] * (10 - vector.size), [0.0] * (12 - vector.size)])
        limits = np.exp(whole[6:10]) * scale
        limits[limits > np.exp(0.5 * NONE) * scale] = inf
        gain, last = np.exp(whole[2:4]) * steepness, [np.exp(whole[4]), whole[5]]
        return np.concatenate([whole[:2] * size, gain, limits, whole[10:12] * scale, last])

    def descended(start: Array, evaluations: int) -> tuple[float, Array]:
        low, high, typical = (each[: start.size] for each in (LOWEST, HIGHEST, TYPICAL))
        solution = least_squares(
            lambda vector: _errors(runs, numbers_of(vector)) / scale,
            np.clip(start, low + 1e-6, high - 1e-6),
            bounds=(low, high),
            x_scale=typical,
            **{"loss": "soft_l1", "f_scale": 0.05, "diff_step": 1e-3, "max_nfev": evaluations},
        )
        return float(solution.cost), solution.x

    def best(starts: Iterable[Array]) -> tuple[float, Array]:
        """Of many starts a few steps each, and only the best of them to their ends."""
        begun = sorted((descended(each, 12) for each in starts), key=lambda each: each[0])
        return min((descended(each, 60) for _, each in begun[:3]), key=lambda each: each[0])

    candidates: list[tuple[float, Array, Array]] = []
    for lag, delay, share in product(LAGS, DELAYS, DEAD_ZONES):
        numbers = np.array([*(share * size), 0.0, 0.0, *[inf] * 4, 0.0, 0.0, lag, delay])
        at_rest, unit = _errors(runs, numbers), np.eye(12)
        ways = [_errors(runs, numbers + unit[2 + way]) for way in np.flatnonzero(tried)]
        gain, left = np.zeros(2), np.transpose([each - at_rest for each in ways])
        gain[tried] = np.linalg.lstsq(left, speeds, rcond=None)[0]
        cost = float(np.sum((left @ gain[tried] - speeds) ** 2))
        steep = np.log(np.maximum(gain, 1e-3 * steepness) / steepness)
        dead = np.where(tried, share, 0.1)
        candidates.append((cost, np.array([*dead, *steep, log(lag), delay]), gain))
    candidates.sort(key=lambda each: each[0])
    if (candidates[0][2][tried] <= 0.0).any():
        raise InputError(
            "The speed goes against the command: reverse it with sign = -1 in its channel."
        )
    _, plain = best(start for _, start, _ in candidates[:3])
    # a slow rise may be a lag or a limited acceleration, and less speed than a straight line has a
    # larger dead zone or a top speed: from each of them the search ends at another minimum
    limits = [0.0, 0.0, *[log(0.7) - plain[4]] * 2]
    moves = [
        *product((0.0,), (0.0, 0.7), (0.0, -1.5, -3.0)),
        *product((0.2,), (0.0, 0.7), (-1.5,)),
    ]
    cost, whole = best(
        np.concatenate([plain + np.repeat([wider, steeper, quicker, 0.0], [2, 2, 1, 1]), limits])
        for wider, steeper, quicker in moves
    )
    # the same line behind a larger dead zone
    back = tried * size.max() / np.maximum(size, size.max() * ONE_WAY) / np.exp(whole[2:4])
    smaller, jumping = best(
        np.concatenate([whole[:2] + jump * back, whole[2:], jump * tried]) for jump in JUMPS
    )
    whole = np.append(whole, [0.0, 0.0])
    coarse = max(run.coarse for run in runs)
    if SEEN * smaller < cost and numbers_of(jumping)[8:10].max() > coarse:
        cost, whole = smaller, jumping
    # a limit or a jump that makes no difference was not met
    for index in range(6, 12):
        without = np.where(np.arange(12) == index, NONE if index < 10 else 0.0, whole)
        rough = _errors(runs, numbers_of(without)) / (0.05 * scale)
        loss = 0.05**2 * float(np.sum(np.sqrt(1.0 + rough**2) - 1.0))
        if loss < SEEN * cost + NEXT_TO_NOTHING * float(np.sum((speeds / scale) ** 2)):
            whole = without
    return numbers_of(whole)


def guessed_set(guess: Guess, source: str) -> ParameterSet:
    """The drive "neutral" with the numbers of a guess.

    The source says in the parameter file where they are from.

    Notes
    -----
    The greatest speed that was seen is given a swash angle of 0.2 rad at most, which sets Z10; no
    measurement of a speed could tell it. With sin φ = Z5 Z19 I/√Z4 and tan α = sin φ/Z3 the gain is
    Z10 Z5 Z19 G1/(√Z4 Z3), and the jump likewise one of J; the lag is 1/(Z1 Z3 Z5 Z8 √(Z9/2)); the
    acceleration beyond which the orifice opens no further is Z10 Z1 Z8 √(Z9/2) Z16.

    A limit that the guess did not see may still be there: a lag that is too short can stand for it.
    It is put a little below what the largest command asks for, where a fit can tell, and the set
    says that no test reached it.
    """
    base = Drive.preset("neutral").parameters
    n = base.numbers
    per_angle = max(guess.speed / ANGLE, STEEPEST * max(guess.gain))
    per_ampere = per_angle * n["Z5"] * n["Z19_plus"] / (sqrt(n["Z4"]) * n["Z3"])
    flow = n["Z1"] * sqrt(0.5 * n["Z9"])
    speed_of_flow = 1.0 / (max(guess.lag, SHORTEST) * flow * n["Z3"] * n["Z5"])
    per_opening = per_angle * flow * speed_of_flow
    stops, openings, unreached = list[float](), list[float](), dict[str, float]()
    for way, side in enumerate(SIDES):
        fastest = _steady(guess, way)
        top, pull = guess.top_speed[way], guess.acceleration[way]
        if not isfinite(top):
            unreached[f"Z13_{side}"] = fastest / per_angle
            top = STOP_FIRST * fastest
        if not isfinite(pull):
            # how fast it accelerated is not known: a lag that is too short may stand for the limit
            unreached[f"Z16_{side}"] = 0.0
            pull = ORIFICE_FIRST * fastest / max(guess.lag, SHORTEST)
        stops.append(top / per_angle)
        openings.append(pull / per_opening)
    changed: dict[str, float | tuple[float, float]] = {
        "V_dz": guess.dead_zone,
        "J": (guess.jump[0] / per_ampere, guess.jump[1] / per_ampere),
        "G1": (guess.gain[0] / per_ampere, guess.gain[1] / per_ampere),
        "tau": guess.delay,
        "Z8": speed_of_flow,
        "Z10": per_angle,
        "Z13": (stops[0], stops[1]),
        "Z16": (openings[0], openings[1]),
    }
    made = base.replace(changed)
    said = {
        symbol: replace(each, source=source, status="approximate")
        if symbol in changed
        else replace(each, source="assumed: no speed determines it")
        for symbol, each in made.parameters.items()
    }
    title = f"{guess.axis}: guessed from {source}"
    return replace(made, name=guess.axis, title=title, parameters=said, unreached=unreached)


def _steady(guess: Guess, way: int) -> float:
    """Speed that settles under the largest command one way, as a magnitude. [unit]"""
    volts = guess.command[way] or max(guess.command)
    beyond = max(volts - guess.dead_zone[way], 0.0)
    speed = guess.gain[way] * beyond + guess.jump[way]
    return min(speed, guess.top_speed[way]) or guess.speed


CONFIGURATION = """\
# Read off the logs of the axis '{0}' by `swashplate guess`: what they show is
# free, within bounds about the first guess. A limit that the guess did not see is
# free as well, within wide ones: a fit tells it from a lag.
title = "{0}, guessed"

[[stages]]
name = "drive"
part = "chain"
channels = ["shaft_speed", "position", "encoder_counts"]

[stages.free]
"""


def fit_configuration(guess: Guess, start: ParameterSet | Drive) -> str:
    """Text of a fit configuration that frees what was guessed, with bounds about it."""
    lines = list[str]()
    for side, way in (("plus", 0), ("minus", 1)):
        if not guess.command[way]:
            lines.append(f"# no run goes {side}: its numbers are those of the other way, fixed")
            continue
        numbers = set_of(start).numbers
        gain, jump = numbers[f"G1_{side}"], numbers[f"J_{side}"]
        # so that more command never means less current, whatever the gain within its bounds; a gain
        # that grows needs no such care, and a stop must not stand for it
        down, up = 0.2 * gain / guess.command[way], 0.6 * gain / guess.command[way]
        lines += [
            f"V_dz_{side} = {{ bounds = [0.0, {0.95 * guess.command[way]:.4g}] }}",
            *([f"J_{side} = {{ bounds = [0.0, {4.0 * jump:.4g}] }}    # jump"] if jump else []),
            f"G1_{side} = {{ relative = [0.5, 2.0], log = true }}",
            f"G2_{side} = {{ bounds = [{-down:.4g}, {up:.4g}] }}    # how the gain bends",
        ]
        reach = (0.7, 1.4) if isfinite(guess.top_speed[way]) else (0.7, 3.0)
        lines.append(_limit_line(f"Z13_{side}", reach, "top speed"))
        reach = (0.3, 3.0) if isfinite(guess.acceleration[way]) else (0.1, 10.0)
        lines.append(_limit_line(f"Z16_{side}", reach, "acceleration"))
    longest = max(2.0 * guess.delay, guess.delay + 0.1)
    lines += [
        "Z8 = { relative = [0.2, 5.0], log = true }    # lag"
        if guess.lag > TOLD
        # the acceleration is that of Z8 times Z16: without a lag nothing tells them apart
        else "# the lag is too short to be seen: Z8 stays fixed",
        f"tau = {{ bounds = [0.0, {longest:.4g}] }}    # delay",
    ]
    return CONFIGURATION.format(guess.axis) + "\n".join(lines) + "\n"


def _limit_line(column: str, reach: tuple[float, float], words: str) -> str:
    low, high = reach
    return f"{column} = {{ relative = [{low}, {high}], log = true }}    # {words}"


def guess_table(found: Guess) -> Table:
    """What was guessed, each way."""
    columns = (Column(each, ".4g", none="not seen") for each in ("plus", "minus"))
    made = Table(f"Axis {found.axis}, at first sight", (Column(""), *columns, UNIT))
    rows = (
        ("dead zone", found.dead_zone, "V", ".3g"),
        ("gain beyond it", found.gain, f"{found.unit}/V", ""),
        ("jump at its edge", tuple(each or inf for each in found.jump), found.unit, ""),
        ("top speed", found.top_speed, found.unit, ""),
        ("acceleration", found.acceleration, f"{found.unit}^2", ""),
    )
    for name, values, unit, spec in rows:
        cells = list[Cell | float | None]()
        for way, (value, tried) in enumerate(zip(values, found.command, strict=True)):
            if not tried:
                cells.append(Cell(None, "not tried"))
            elif isfinite(value):
                cells.append(value)
            elif name == "top speed":
                factor = display_unit(unit, _steady(found, way)).factor
                speed = f"{factor * _steady(found, way):.3g}"
                cells.append(Cell(None, f"at least {speed}, not seen"))
            else:
                cells.append(None)
        made.add(name, *cells, unit=unit, spec=spec)
    made.add("delay", 1e3 * found.delay, "", unit="ms", spec=".3g")
    made.add("lag", 1e3 * found.lag, "", unit="ms", spec=".3g")
    return made
