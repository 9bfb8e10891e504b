"""Maneuvers by name: rest, step, ramp, stairs, sines, multisine, recordings, Kruse's tests."""

import inspect
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from swashplate.errors import InputError
from swashplate.maneuvers.pieces import (
    Array,
    Maneuver,
    Piece,
    finite,
    joined,
    kept,
    line,
    positive,
    row,
    scaled,
    settled,
    summed,
    tone,
    whole,
)

# --- shapes ---------------------------------------------------------------------------------------


def rest(duration: float) -> Maneuver:
    """Nothing, 0 V, for `duration` [s]; it raises InputError if that is negative."""
    duration = finite("duration", duration, 0.0)
    return Maneuver(f"rest {duration:g} s", duration, ((0.0, line),), 0.0)


def step(
    amplitude: float, *, start: float = 1.0, stop: float = 6.0, length: float = 10.0
) -> Maneuver:
    """Step of `amplitude` [V], on at `start` and off at `stop` [s].

    Raises
    ------
    InputError
        Unless 0 <= start < stop <= length.
    """
    amplitude, length = finite("amplitude", amplitude), finite("length", length)
    start, stop = finite("start", start), finite("stop", stop)
    if not 0.0 <= start < stop <= length:
        raise InputError(
            f"a step needs 0 <= start < stop <= length, not {start:g}, {stop:g}, {length:g} s."
        )
    pieces: list[Piece] = [(start, partial(line, level=amplitude)), (stop, line)]
    return settled(f"step {amplitude:g} V", amplitude, pieces, length, length)


def ramp(
    slope: float,
    *,
    limit: float = 10.0,
    start: float = 1.0,
    settle: float | None = 2.5,
    length: float = 13.0,
) -> Maneuver:
    """Ramp that stays at `limit` once there, cut short by the return if time runs out.

    Parameters
    ----------
    slope : float
        Negative for a ramp downwards. [V/s]
    limit : float
        Largest magnitude, positive. [V]
    """
    slope, limit = finite("slope", slope), positive("limit", limit)
    start, end, length = _window(start, settle, length)
    pieces = [(start, partial(line, rise=slope))]
    if abs(slope) * (end - start) > limit:
        top = partial(line, level=math.copysign(limit, slope))
        pieces.append((start + limit / abs(slope), top))
    return settled(f"ramp {slope:g} V/s", limit, pieces, end, length)


def stairs(
    levels: Sequence[float], dwell: float = 2.0, *, start: float = 1.0, settle: float | None = 2.5
) -> Maneuver:
    """Hold one voltage after another; a return follows unless the last is zero.

    Parameters
    ----------
    levels : sequence of float
        At least one. [V]
    dwell : float
        How long each is held, positive. [s]
    """
    volts, dwell = row("levels", levels).tolist(), positive("dwell", dwell)
    start, settle = finite("start", start, 0.0), finite("settle", settle or 0.0, 0.0)
    pieces = [(start + dwell * k, partial(line, level=level)) for k, level in enumerate(volts)]
    end = start + dwell * len(pieces)
    name = f"stairs {'/'.join(f'{level:g}' for level in volts)} V"
    amplitude = max(abs(level) for level in volts)
    return settled(name, amplitude, pieces, end, end + settle if volts[-1] != 0.0 else end)


# --- sines ----------------------------------------------------------------------------------------


# Points on the shortest period when the peak of a multisine is sought.
_POINTS_PER_PERIOD = 256


def sine(
    amplitude: float,
    frequency: float,
    *,
    start: float = 1.0,
    settle: float | None = 2.5,
    length: float = 30.0,
) -> Maneuver:
    """Sine that begins at `start` with phase zero; the return ends it wherever it is.

    Parameters
    ----------
    amplitude : float
        Peak. [V]
    frequency : float
        Positive. [Hz]
    """
    amplitude, frequency = finite("amplitude", amplitude), positive("frequency", frequency)
    start, end, length = _window(start, settle, length)
    name = f"sine {amplitude:g} V {frequency:g} Hz"
    curve = partial(tone, amplitude=amplitude, frequency=frequency)
    return settled(name, amplitude, [(start, curve)], end, length)


def chirp(
    amplitude: float,
    first: float,
    last: float,
    *,
    start: float = 1.0,
    settle: float | None = 2.5,
    length: float = 60.0,
) -> Maneuver:
    """Sine whose frequency goes from `first` to `last` at a constant rate, until the return.

    Parameters
    ----------
    amplitude : float
        Peak. [V]
    first, last : float
        Frequencies in either order, not negative. [Hz]
    """
    amplitude = finite("amplitude", amplitude)
    first, last = finite("first", first, 0.0), finite("last", last, 0.0)
    start, end, length = _window(start, settle, length)
    growth = (last - first) / (end - start)
    curve = partial(tone, amplitude=amplitude, frequency=first, growth=growth)
    name = f"chirp {amplitude:g} V {first:g} to {last:g} Hz"
    return settled(name, amplitude, [(start, curve)], end, length)


def multisine(
    amplitude: float,
    frequencies: Sequence[float] | tuple[float, float, int],
    *,
    seed: int = 0,
    start: float = 1.0,
    settle: float | None = 2.5,
    length: float = 60.0,
) -> Maneuver:
    """Sum of equally large sines of random phase; it begins with a jump to wherever they stand.

    Parameters
    ----------
    amplitude : float
        Largest magnitude, reached to 0.1 %. [V]
    frequencies : list, array or tuple
        A list or array holds the frequencies, used as they are. A tuple is a band, (low, high,
        count), whose evenly spaced frequencies are rounded to whole periods between `start` and
        the return: the signal is periodic there. Positive. [Hz]
    seed : int
        Not negative. The same seed gives the same phases.

    Raises
    ------
    InputError
        If an argument is out of its range, `start` and `settle` leave nothing of `length`, or what
        they leave is too short to tell the frequencies of a band apart.
    """
    amplitude, seed = finite("amplitude", amplitude), whole("seed", seed)
    start, end, length = _window(start, settle, length)
    band = isinstance(frequencies, tuple)
    lines = _band(frequencies, end - start) if band else row("frequencies", frequencies)
    low, high = positive("the lowest frequency", lines.min()), lines.max()
    phases = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, lines.size)
    tones = [
        partial(tone, amplitude=1.0, frequency=frequency, phase=phase)
        for frequency, phase in zip(lines.tolist(), phases.tolist(), strict=True)
    ]
    together = partial(summed, curves=tones)
    points = math.ceil(_POINTS_PER_PERIOD * high * (end - start)) + 1
    time, spacing = np.linspace(0.0, end - start, points, retstep=True)
    # between two points it rises above the peak found by half its curvature at most
    curvature = float(((2.0 * np.pi * lines) ** 2).sum())
    peak = float(np.abs(together(time)[0]).max()) + 0.5 * curvature * (0.5 * float(spacing)) ** 2
    name = f"multisine {amplitude:g} V {low:.3g} to {high:.3g} Hz seed {seed}"
    curve = partial(scaled, factor=amplitude / peak, curve=together)
    return settled(name, amplitude, [(start, curve)], end, length)


def _band(band: Sequence[float], period: float) -> Array:
    """Evenly spaced frequencies, each with a whole number of its periods in `period`."""
    if len(band) != 3 or not isinstance(band[2], int | np.integer) or band[2] < 1:
        raise InputError(
            f"a tuple of frequencies is (low, high, count), not {band}: "
            "give a list for the frequencies themselves."
        )
    low, high = positive("low", band[0]), positive("high", band[1])
    periods = np.unique(np.floor(np.linspace(low, high, band[2]) * period + 0.5))
    if periods[0] < 1.0 or periods.size < band[2]:
        raise InputError(
            f"{band[2]} frequencies from {low:g} to {high:g} Hz cannot be told apart in "
            f"{period:g} s: take fewer, a wider band or a longer time."
        )
    return np.asarray(periods / period)


def _window(start: float, settle: float | None, length: float) -> tuple[float, float, float]:
    """Start and end of the command between rest and return, and the whole length. [s]"""
    start, length = finite("start", start, 0.0), finite("length", length, 0.0)
    settle = finite("settle", settle or 0.0, 0.0)
    if start + settle >= length:
        raise InputError(
            f"start {start:g} s and settle {settle:g} s leave nothing of a length of {length:g} s."
        )
    return start, length - settle, length


# --- recordings -----------------------------------------------------------------------------------


def recorded(
    time: npt.ArrayLike,
    voltage: npt.ArrayLike,
    *,
    interpolation: Literal["previous", "linear"],
    length: float | None = None,
) -> Maneuver:
    """Voltage from a log; its first row is at 0 s whatever its time says, its last at the end.

    Parameters
    ----------
    time, voltage : array_like, shape (n,)
        At least two rows; time increases from each to the next. [s], [V]
    interpolation : {"previous", "linear"}
        Between two rows: hold the earlier one, or go straight to the later one.
    length : float, optional
        Where to end instead of at the last row: earlier, or later with its voltage held. A log
        seldom lasts a whole number of samples, which `Maneuver.sample` asks for. [s]

    Raises
    ------
    InputError
        If the rows are not such, or a number is not finite; it names the first row that is wrong.
    """
    if interpolation not in ("previous", "linear"):
        raise InputError(f"interpolation must be 'previous' or 'linear', not {interpolation!r}.")
    stamps, volts = row("time", time), row("voltage", voltage)
    if stamps.size != volts.size or stamps.size < 2:
        raise InputError(
            "time and voltage must have the same number of rows, at least two, "
            f"not {stamps.size} and {volts.size}."
        )
    times = stamps - stamps[0]
    late = np.flatnonzero(np.diff(times) <= 0.0) + 1
    if late.size:
        before, after = stamps[late[0] - 1 : late[0] + 1]
        raise InputError(
            f"time must increase, but row {late[0]} (first is 0) has {after} s after {before} s."
        )
    curve = partial(joined if interpolation == "linear" else kept, times=times, volts=volts)
    end = float(times[-1]) if length is None else positive("length", length)
    return Maneuver(f"recorded {times.size} rows", end, ((0.0, curve),), float(np.abs(volts).max()))


# --- source ---------------------------------------------------------------------------------------


class _Axis(NamedTuple):
    settle: float  # [s]
    ramps: Sequence[float]  # [V/s]
    steps: Sequence[float]  # [V]
    sines: Sequence[tuple[float, float, float]]  # amplitude [V], frequency [Hz], length [s]


_AXES = {
    "hoist": _Axis(
        settle=2.5,
        ramps=(1, -1),
        steps=(4, -4, 6.5, -6.5, 9, -9),
        sines=((4, 0.1, 30), (6.5, 0.1, 30), (9, 0.1, 30), (6.5, 0.3, 20), (9, 0.3, 20)),
    ),
    "slew": _Axis(
        settle=4.5,
        ramps=(1,),
        steps=(2,),
        sines=((4, 0.05, 40), (4, 0.1, 30), (6, 0.05, 40)),
    ),
    "luff": _Axis(
        settle=2.5,
        ramps=(1,),
        steps=(4, 6.5, 9),
        sines=((4, 0.1, 30), (6.5, 0.1, 30), (9, 0.05, 40)),
    ),
}


def source_tests(axis: str) -> dict[str, Maneuver]:
    """Runs of Kruse's test campaign on the axis "hoist", "slew" or "luff".

    Returns
    -------
    dict of str to Maneuver
        By their names, such as "ramp +1 V/s", "step -4 V" and "sine 6.5 V 0.1 Hz".

    Raises
    ------
    InputError
        If there is no such axis.
    """
    if axis not in _AXES:
        raise InputError(f"no tests of axis {axis!r}: Kruse (2001) has {', '.join(_AXES)}.")
    settle, ramps, steps, sines = _AXES[axis]
    runs = [replace(ramp(slope, settle=settle), name=f"ramp {slope:+g} V/s") for slope in ramps]
    runs += [replace(step(volts), name=f"step {volts:+g} V") for volts in steps]
    runs += [sine(volts, hertz, settle=settle, length=length) for volts, hertz, length in sines]
    return {run.name: run for run in runs}


# --- parsing --------------------------------------------------------------------------------------


_COMMANDS: dict[str, Callable[..., Maneuver]] = {
    make.__name__: make for make in (rest, step, ramp, sine, stairs, chirp, multisine)
}


def parse(text: str) -> Maneuver:
    """Make a maneuver from a command line's "sine:6.5,0.1,length=40" or "stairs:2/4/0,dwell=3".

    Parameters
    ----------
    text : str
        Name of a function that makes a maneuver, colon, its arguments by position or keyword, in
        V, s and Hz. A list is written 2/4/0, the band of a multisine low:high:count.

    Raises
    ------
    InputError
        If name, arguments or a number are wrong; it lists what is right.
    """
    name, _, arguments = text.partition(":")
    if name not in _COMMANDS:
        raise InputError(f"{name!r} is no maneuver: choose one of {', '.join(_COMMANDS)}.")
    items = [item.rpartition("=") for item in arguments.split(",")] if arguments else []
    positional = [_value(value) for _, equals, value in items if not equals]
    keywords = {key.strip(): _value(value) for key, equals, value in items if equals}
    if len(positional) + len(keywords) < len(items):
        raise InputError(f"{text!r} gives a keyword twice: give it once.")
    signature = inspect.signature(_COMMANDS[name])
    try:
        signature.bind(*positional, **keywords)
    except TypeError as error:
        known = ", ".join(signature.parameters)
        hint = ": separate levels by /, as in stairs:2/4/0" if name == "stairs" else ""
        raise InputError(f"{text!r}: {error}; {name} takes {known}{hint}.") from None
    return _COMMANDS[name](*positional, **keywords)


def _value(text: str) -> int | float | list[int | float] | tuple[int | float, ...]:
    if "/" in text:
        return [_number(part) for part in text.split("/")]
    if ":" in text:
        return tuple(_number(part) for part in text.split(":"))
    return _number(text)


def _number(text: str) -> int | float:
    try:
        return int(text) if text.strip().isdecimal() else float(text)
    except ValueError:
        raise InputError(
            f"{text!r} is not a number: write one as 6.5, a list as 2/4/0, a band as 0.1:2:8."
        ) from None
