"""Maneuvers: the voltage that a joystick commands over time, for tests of a drive.

`step`, `ramp`, `sine`, `stairs`, `chirp`, `multisine` and `rest` make one; `+` puts one after
another, a factor scales it.

Most take three keywords, all in seconds: `start`, the rest before the command; `settle`, how long
the cubic return to (0 V, 0 V/s) lasts at the end, None or 0 for none; `length`, the whole. Every
function raises InputError, one sentence, for a number that is not finite or out of its range. What
goes beyond the ±10 V of a joystick is for the simulation to refuse.

No voltage exceeds the maneuver's `amplitude`, at any instant: that of a step, sine, chirp or
multisine, a ramp's `limit`, the largest of stairs; of maneuvers one after another it is the
largest. The return starts with the slope that the command ends with. Where the cubic would then
leave the amplitude, as after a fast sine, it starts with the steepest slope of that sign with which
it stays within, at the amplitude itself with none.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from swashplate.errors import InputError
from swashplate.results import Drawn

__all__ = ["Maneuver", "chirp", "multisine", "parse", "ramp", "rest", "sine", "source_tests"]
__all__ += ["stairs", "step"]

Array = npt.NDArray[np.float64]
Piece = tuple[float, Callable[[Array], Array]]
"""Start of a curve, from the beginning of the maneuver [s], which holds until the next starts, and
its voltage [V] over the time since then [s]."""

NEAR = 1e-9
"""An instant this little before a jump, or after the end, counts as being there. [s]

Decimal durations do not add up exactly (0.1 + 0.2 > 0.3), and a step must not miss the sample meant
for it.
"""
HALVINGS = 60  # Of the slope of a return until it is found, to the last bits.
LONGEST = 100_000_000
"""Samples that a maneuver may have, and sines that are computed to find the peak of a multisine;
more is a mistake and would not fit into memory."""
LARGEST = 1e12
"""No voltage, time or frequency of a maneuver is larger; sums of larger ones would overflow."""

# --- checks ---------------------------------------------------------------------------------------


def finite(name: str, value: float, least: float = -math.inf) -> float:
    """Return `value` as a float, or raise InputError if not finite or below `least`, which is 0."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise InputError(f"{name} must be a number, not {value!r}.") from None
    if not math.isfinite(number):
        raise InputError(f"{name} must be finite, not {number}.")
    if abs(number) > LARGEST:
        raise InputError(f"{name} must be at most {LARGEST:g}, not {number:g}; check it.")
    if number < least:
        raise InputError(f"{name} must not be negative, not {number:g}.")
    return number


def positive(name: str, value: float) -> float:
    """Return `value` as a float, or raise InputError if it is not finite and positive."""
    if (number := finite(name, value)) <= 0.0:
        raise InputError(f"{name} must be positive, not {number:g}.")
    return number


def whole(name: str, value: object) -> int:
    """Return `value` as an integer, or raise InputError if it is none or negative."""
    if not isinstance(value, int | np.integer) or value < 0:
        raise InputError(f"{name} must be a whole number of at least 0, not {value!r}.")
    return int(value)


def row(name: str, values: npt.ArrayLike) -> Array:
    """Copy `values` to a row; raise InputError unless it has one or more numbers, all finite."""
    try:
        numbers = np.array(values, dtype=float, ndmin=1)
    except (TypeError, ValueError):
        raise InputError(f"{name} must be numbers, not {values!r}.") from None
    if numbers.ndim != 1 or numbers.size == 0:
        raise InputError(f"{name} must be one row of numbers, not of shape {numbers.shape}.")
    wrong = np.flatnonzero(~np.isfinite(numbers))
    if wrong.size:
        where = f"row {wrong[0]} (the first is 0) is {numbers[wrong[0]]}"
        raise InputError(f"{name} must be finite, but {where}.")
    if (largest := float(np.abs(numbers).max())) > LARGEST:
        raise InputError(f"{name} must be at most {LARGEST:g}, not {largest:g}; check it.")
    return numbers


# --- maneuvers ------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Maneuver(Drawn):
    """A voltage command of finite length; call it with times to have the voltage.

    Attributes
    ----------
    name : str
        For people, such as "step 9 V"; `dataclasses.replace(m, name=...)` gives another.
    length : float
        Duration. [s]
    pieces : tuple of (float, callable)
        Starts [s], the first at 0, and curves in their order. At a jump the later piece holds.
    amplitude : float
        What the maneuver states and its voltage never exceeds, inf if it states none. [V]
    highest : float
        Frequency of its fastest sine, 0 if it has none. [Hz]
    """

    drawn_by: ClassVar[str] = "plot_maneuver"

    name: str
    length: float
    pieces: tuple[Piece, ...]
    amplitude: float = math.inf
    highest: float = 0.0

    def __call__(self, time: npt.ArrayLike) -> Array:
        """Voltage [V] at `time` [s] of any shape, zero outside [0, length]."""
        stamps = np.asarray(time, dtype=float)
        voltage = np.where(np.isnan(stamps), np.nan, 0.0)
        inside = (stamps >= 0.0) & (stamps <= self.length + NEAR)
        stamps = np.minimum(stamps, self.length)
        starts = [start for start, _ in self.pieces]
        reached = np.searchsorted(starts, stamps + NEAR, side="right") - 1
        holding = np.where(inside, reached, -1)
        for index, (start, curve) in enumerate(self.pieces):
            here = holding == index
            voltage[here] = curve(np.maximum(stamps[here] - start, 0.0))
        # the curves stay within the amplitude, rounding errors apart; a number for a number
        return np.clip(voltage, 0.0 - self.amplitude, self.amplitude)[()]

    def time(self, rate: float = 512.0) -> Array:
        """Instants n/rate of the samples.

        Parameters
        ----------
        rate : float
            Samples a second. [Hz]

        Returns
        -------
        (rate·length + 1,) array
            From 0 to the length. [s]

        Raises
        ------
        InputError
            If `rate` is not positive or the length is not a whole number of samples.

        Examples
        --------
        >>> from swashplate import maneuvers
        >>> maneuvers.step(9.0, length=8.0).time(512.0)[-1].item()
        8.0
        """
        samples = positive("rate", rate) * self.length
        if samples > LONGEST:
            raise InputError(
                f"{self.name} lasts {self.length:g} s, at {rate:g} Hz {samples:.3g} samples, more "
                f"than the {LONGEST:.0e} that are simulated at once."
            )
        if abs(samples - round(samples)) > 1e-6:
            raise InputError(
                f"{self.name} lasts {self.length} s, at {rate:g} Hz {samples:.10g} samples instead "
                "of a whole number: change its length or the rate."
            )
        return np.arange(round(samples) + 1) / rate

    def sample(self, rate: float = 512.0) -> Array:
        """Voltage at the instants of `time`.

        Parameters
        ----------
        rate : float
            Samples a second. [Hz]

        Returns
        -------
        (rate·length + 1,) array
            Voltage. [V]

        Raises
        ------
        InputError
            As `time`, and if a sine is not below half the rate.

        Examples
        --------
        >>> from swashplate import maneuvers
        >>> maneuvers.step(9.0).sample(512.0).shape
        (5121,)
        """
        time = self.time(rate)
        if self.highest >= 0.5 * rate:
            raise InputError(
                f"{self.name} reaches {self.highest:g} Hz, but samples at {rate:g} Hz show only "
                f"frequencies below {0.5 * rate:g} Hz: lower its frequency or raise the rate."
            )
        time[-1] = self.length  # its stamp may lie a rounding error before or after the end
        return self(time)

    def __add__(self, after: Maneuver) -> Maneuver:
        if not isinstance(after, Maneuver):
            return NotImplemented
        shifted = ((self.length + start, curve) for start, curve in after.pieces)
        name = f"{self.name} + {after.name}"
        length = self.length + after.length
        amplitude = max(self.amplitude, after.amplitude)
        highest = max(self.highest, after.highest)
        return Maneuver(name, length, (*self.pieces, *shifted), amplitude, highest)

    def __mul__(self, factor: float) -> Maneuver:
        factor = finite("factor", factor)
        pieces = ((start, partial(_scaled, factor=factor, curve=c)) for start, c in self.pieces)
        amplitude = abs(factor) * self.amplitude if factor else 0.0
        name = f"{factor:g} * ({self.name})"
        return replace(self, name=name, pieces=tuple(pieces), amplitude=amplitude)

    __rmul__ = __mul__

    def __neg__(self) -> Maneuver:
        return replace(-1.0 * self, name=f"-({self.name})")


def sampled(command: npt.ArrayLike | Maneuver, rate: float) -> npt.ArrayLike:
    """Samples of a maneuver at a rate [Hz], anything else as it is.

    Raises
    ------
    InputError
        For words: a maneuver's are read by `parse`.
    """
    if isinstance(command, str):
        raise InputError(
            f"The voltage is the text '{command}': give samples, or a maneuver such as "
            f"maneuvers.parse('{command}')."
        )
    return command.sample(rate) if isinstance(command, Maneuver) else command


# --- curves ---------------------------------------------------------------------------------------


def _line(time: Array, level: float = 0.0, rise: float = 0.0) -> Array:
    """Straight line from `level` [V] on, which rises by `rise` [V/s]."""
    return level + rise * time


def _tones(
    time: Array,
    amplitude: float,
    frequencies: Sequence[float],
    phases: Sequence[float],
    growth: float = 0.0,
    *,
    slope: bool = False,
) -> Array:
    """Sum of sines of one `amplitude` [V], or its slope [V/s].

    Their `frequencies` [Hz] grow by `growth` [Hz/s]; `phases` [rad].
    """
    # one after another: many sines of a long time together would not fit into memory
    waves = (
        (2.0 * np.pi * (frequency + 0.5 * growth * time) * time + phase, frequency + growth * time)
        for frequency, phase in zip(frequencies, phases, strict=True)
    )
    if slope:
        slopes = [amplitude * (2.0 * np.pi * now) * np.cos(angle) for angle, now in waves]
        return np.asarray(np.sum(slopes, axis=0))
    return amplitude * sum((np.sin(angle) for angle, _ in waves), np.zeros_like(time))


def _scaled(time: Array, factor: float, curve: Callable[[Array], Array]) -> Array:
    return factor * curve(time)


def _cubic_return(time: Array, level: float, rise: float, duration: float) -> Array:
    """Cubic from voltage `level` [V] and slope `rise` [V/s] to (0, 0) at `duration` [s]."""
    done = time / duration
    # written with the time left as a factor, it ends at exactly zero
    return (1.0 - done) ** 2 * (level * (1.0 + 2.0 * done) + rise * time)


def _settled(
    name: str, amplitude: float, pieces: Sequence[Piece], end: float, length: float, slope: float
) -> Maneuver:
    """Rest, the pieces until `end` [s], and the return if there is time left until `length` [s].

    It starts with the `slope` [V/s] at the end where the cubic then stays within the amplitude,
    else with the steepest slope of that sign with which it does, 0 at the amplitude itself.
    """
    amplitude = abs(amplitude)
    command = Maneuver(name, end, ((0.0, _line), *pieces), amplitude)
    if not end < length:
        return command
    level = float(command(end))
    duration = length - end
    bound = max(amplitude, abs(level))

    def stays(part: float) -> bool:
        change = part * slope * duration
        turn = 3.0 * (2.0 * level + change)
        # time of its one extremum other than the end, as a part of the duration
        at = change / turn if turn else 0.0
        return not 0.0 < at < 1.0 or (1.0 - at) ** 2 * abs(level + change / 3.0) <= bound

    low, high = 0.0, 1.0 if abs(level) < bound else 0.0
    if stays(1.0):
        low = high = 1.0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if stays(middle) else (low, middle)
    back = partial(_cubic_return, level=level, rise=low * slope, duration=duration)
    return replace(command, length=length, pieces=(*command.pieces, (end, back)))


def _window(start: float, settle: float | None, length: float) -> tuple[float, float, float]:
    """Start and end of the command between rest and return, and the whole length. [s]"""
    start = finite("start", start, 0.0)
    length = finite("length", length, 0.0)
    settle = finite("settle", settle or 0.0, 0.0)
    if start + settle >= length:
        raise InputError(
            f"start {start:g} s and settle {settle:g} s leave nothing of a length of {length:g} s."
        )
    return start, length - settle, length


# --- shapes ---------------------------------------------------------------------------------------


def rest(duration: float) -> Maneuver:
    """Nothing, 0 V.

    Parameters
    ----------
    duration : float
        How long, not negative. [s]

    Returns
    -------
    Maneuver
        To put before, between or after others with ``+``.

    Raises
    ------
    InputError
        If the duration is negative or not finite.

    Examples
    --------
    >>> from swashplate import maneuvers
    >>> (maneuvers.rest(2.0) + maneuvers.step(9.0)).length
    12.0
    """
    duration = finite("duration", duration, 0.0)
    return Maneuver(f"rest {duration:g} s", duration, ((0.0, _line),), 0.0)


def step(
    amplitude: float, *, start: float = 1.0, stop: float = 6.0, length: float = 10.0
) -> Maneuver:
    """Step of a voltage, on and off again.

    Parameters
    ----------
    amplitude : float
        Voltage between `start` and `stop`, of either sign. [V]
    start, stop, length : float
        When it comes on, when it goes off, and duration of the maneuver. [s]

    Returns
    -------
    Maneuver
        Called with times it gives the voltage.

    Raises
    ------
    InputError
        Unless 0 <= start < stop <= length and all are finite.

    Examples
    --------
    >>> from swashplate import maneuvers
    >>> command = maneuvers.step(9.0)
    >>> command([0.5, 1.0, 6.0]).tolist()
    [0.0, 9.0, 0.0]
    >>> command.sample(512.0).shape
    (5121,)
    """
    amplitude = finite("amplitude", amplitude)
    length = finite("length", length)
    start, stop = finite("start", start), finite("stop", stop)
    if not 0.0 <= start < stop <= length:
        raise InputError(
            f"a step needs 0 <= start < stop <= length, not {start:g}, {stop:g}, {length:g} s."
        )
    pieces: list[Piece] = [(start, partial(_line, level=amplitude)), (stop, _line)]
    return _settled(f"step {amplitude:g} V", amplitude, pieces, length, length, 0.0)


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
    start : float
        When it begins. [s]
    settle : float or None
        Time left at the end for the cubic return to rest; None or 0 leaves none. [s]
    length : float
        Duration of the maneuver, `settle` included. [s]

    Returns
    -------
    Maneuver
        Called with times it gives the voltage.

    Raises
    ------
    InputError
        If a number is not finite or out of its range, or `start` and `settle` leave nothing of
        `length`.

    Examples
    --------
    >>> from swashplate import maneuvers
    >>> maneuvers.ramp(2.0)([2.0, 6.0, 10.0]).tolist()
    [2.0, 10.0, 10.0]
    """
    slope = finite("slope", slope)
    limit = positive("limit", limit)
    start, end, length = _window(start, settle, length)
    pieces = [(start, partial(_line, rise=slope))]
    last = slope
    if abs(slope) * (end - start) > limit:
        top = partial(_line, level=math.copysign(limit, slope))
        pieces.append((start + limit / abs(slope), top))
        last = 0.0
    return _settled(f"ramp {slope:g} V/s", limit, pieces, end, length, last)


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
    start : float
        When the first level begins. [s]
    settle : float or None
        Time after the last level for the cubic return to rest, if that level is not zero; None or 0
        leaves none. [s]

    Returns
    -------
    Maneuver
        Called with times it gives the voltage.

    Raises
    ------
    InputError
        If there is no level, or a number is not finite or out of its range.

    Examples
    --------
    >>> from swashplate import maneuvers
    >>> maneuvers.stairs([3.0, 6.0, -3.0])([1.5, 3.5, 5.5]).tolist()
    [3.0, 6.0, -3.0]
    """
    volts = row("levels", levels).tolist()
    dwell = positive("dwell", dwell)
    start = finite("start", start, 0.0)
    settle = finite("settle", settle or 0.0, 0.0)
    pieces = [(start + dwell * k, partial(_line, level=level)) for k, level in enumerate(volts)]
    end = start + dwell * len(pieces)
    name = f"stairs {'/'.join(f'{level:g}' for level in volts)} V"
    amplitude = max(abs(level) for level in volts)
    return _settled(name, amplitude, pieces, end, end + settle if volts[-1] != 0.0 else end, 0.0)


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
    start : float
        When it begins. [s]
    settle : float or None
        Time left at the end for the cubic return to rest; None or 0 leaves none. [s]
    length : float
        Duration of the maneuver, `settle` included. [s]

    Returns
    -------
    Maneuver
        Called with times it gives the voltage.

    Raises
    ------
    InputError
        If a number is not finite or out of its range, or `start` and `settle` leave nothing of
        `length`.

    Examples
    --------
    >>> from swashplate import maneuvers
    >>> command = maneuvers.sine(9.0, 0.5)
    >>> command([1.0, 1.5, 2.0]).round(6).tolist()
    [0.0, 9.0, 0.0]
    """
    amplitude = finite("amplitude", amplitude)
    frequency = positive("frequency", frequency)
    name = f"sine {amplitude:g} V {frequency:g} Hz"
    return _oscillation(name, amplitude, _window(start, settle, length), [frequency])


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
    start : float
        When it begins. [s]
    settle : float or None
        Time left at the end for the cubic return to rest; None or 0 leaves none. [s]
    length : float
        Duration of the maneuver, `settle` included. [s]

    Returns
    -------
    Maneuver
        Called with times it gives the voltage.

    Raises
    ------
    InputError
        If a number is not finite or out of its range, or `start` and `settle` leave nothing of
        `length`.

    Examples
    --------
    >>> from swashplate import maneuvers
    >>> maneuvers.chirp(5.0, 0.1, 2.0).sample(512.0).shape
    (30721,)
    """
    amplitude = finite("amplitude", amplitude)
    first, last = finite("first", first, 0.0), finite("last", last, 0.0)
    start, end, length = window = _window(start, settle, length)
    name = f"chirp {amplitude:g} V {first:g} to {last:g} Hz"
    return _oscillation(name, amplitude, window, [first], growth=(last - first) / (end - start))


POINTS_PER_PERIOD = 256  # Of the shortest period, when the peak of a multisine is sought.


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
    start : float
        When it begins. [s]
    settle : float or None
        Time left at the end for the cubic return to rest; None or 0 leaves none. [s]
    length : float
        Duration of the maneuver, `settle` included. [s]

    Returns
    -------
    Maneuver
        Called with times it gives the voltage.

    Raises
    ------
    InputError
        If an argument is out of its range, `start` and `settle` leave nothing of `length`, or what
        they leave is too short to tell the frequencies of a band apart.

    Examples
    --------
    >>> from swashplate import maneuvers
    >>> command = maneuvers.multisine(5.0, (0.1, 2.0, 12), seed=1)
    >>> bool(abs(command.sample(512.0)).max() <= 5.0)
    True
    """
    amplitude = finite("amplitude", amplitude)
    seed = whole("seed", seed)
    start, end, length = window = _window(start, settle, length)
    band = isinstance(frequencies, tuple)
    lines = _band(frequencies, end - start) if band else row("frequencies", frequencies)
    low, high = positive("the lowest frequency", lines.min()), lines.max()
    phases = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, lines.size).tolist()
    points = math.ceil(POINTS_PER_PERIOD * high * (end - start)) + 1
    if points * lines.size > LONGEST:
        raise InputError(
            f"{lines.size} frequencies up to {high:g} Hz in {end - start:g} s are too many: use "
            "fewer, lower ones or a shorter time."
        )
    time, spacing = np.linspace(0.0, end - start, points, retstep=True)
    # between two points it rises above the peak found by half its curvature at most
    curvature = float(((2.0 * np.pi * lines) ** 2).sum())
    largest = float(np.abs(_tones(time, 1.0, lines.tolist(), phases)).max())
    peak = largest + 0.5 * curvature * (0.5 * float(spacing)) ** 2
    name = f"multisine {amplitude:g} V {low:.3g} to {high:.3g} Hz seed {seed}"
    return _oscillation(name, amplitude, window, lines.tolist(), phases, peak=peak)


def _oscillation(
    name: str,
    amplitude: float,
    window: tuple[float, float, float],
    frequencies: Sequence[float],
    phases: Sequence[float] = (0.0,),
    growth: float = 0.0,
    peak: float = 1.0,
) -> Maneuver:
    """Sines within a window, whose largest sum at unit size is `peak`, and the return."""
    start, end, length = window
    curve = partial(
        _tones,
        amplitude=amplitude / peak,
        frequencies=frequencies,
        phases=phases,
        growth=growth,
    )
    last = float(curve(np.array(end - start), slope=True))
    highest = max(max(frequencies), frequencies[0] + growth * (end - start))
    maneuver = _settled(name, amplitude, [(start, curve)], end, length, last)
    return replace(maneuver, highest=highest)


def _band(band: Sequence[float], period: float) -> Array:
    """Evenly spaced frequencies, each with a whole number of its periods in `period`."""
    if len(band) != 3 or not isinstance(band[2], int | np.integer) or band[2] < 1:
        raise InputError(
            f"a tuple of frequencies is (low, high, count), not {band}: "
            "give a list for the frequencies themselves."
        )
    low, high = positive("low", band[0]), positive("high", band[1])
    count = int(band[2])
    apart = count <= abs(high - low) * period + 2.0  # else there are too many even to try
    periods = np.unique(np.floor(np.linspace(low, high, count if apart else 1) * period + 0.5))
    if periods[0] < 1.0 or periods.size < count:
        raise InputError(
            f"{band[2]} frequencies from {low:g} to {high:g} Hz cannot be distinguished in "
            f"{period:g} s: use fewer, a wider band or a longer time."
        )
    return np.asarray(periods / period)


# --- words ----------------------------------------------------------------------------------------

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
        raise InputError(f"{name!r} is not a maneuver: choose one of {', '.join(_COMMANDS)}.")
    items = [item.rpartition("=") for item in arguments.split(",")] if arguments else []
    positional = [_value(value) for _, equals, value in items if not equals]
    keywords = {key.strip(): _value(value) for key, equals, value in items if equals}
    if len(positional) + len(keywords) < len(items):
        raise InputError(f"{text!r} gives a keyword twice: give it once.")
    signature = inspect.signature(_COMMANDS[name])
    try:
        signature.bind(*positional, **keywords)
    except TypeError as error:
        parameters = ", ".join(signature.parameters)
        hint = ": separate levels by /, as in stairs:2/4/0" if name == "stairs" else ""
        raise InputError(f"{text!r}: {error}; {name} takes {parameters}{hint}.") from None
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


SOURCE_TESTS = {
    "hoist": "ramp:1 ramp:-1 step:4 step:-4 step:6.5 step:-6.5 step:9 step:-9 sine:4,0.1 "
    "sine:6.5,0.1 sine:9,0.1 sine:6.5,0.3,length=20 sine:9,0.3,length=20",
    "slew": "ramp:1,settle=4.5 step:2 sine:4,0.05,settle=4.5,length=40 sine:4,0.1,settle=4.5 "
    "sine:6,0.05,settle=4.5,length=40",
    "luff": "ramp:1 step:4 step:6.5 step:9 sine:4,0.1 sine:6.5,0.1 sine:9,0.05,length=40",
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
    if axis not in SOURCE_TESTS:
        raise InputError(f"no tests of axis {axis!r}: Kruse (2001) has {', '.join(SOURCE_TESTS)}.")
    runs = []
    for notation in SOURCE_TESTS[axis].split():
        run = parse(notation)
        if not (notation.startswith("sine") or "-" in notation):
            run = replace(run, name=run.name.replace(" ", " +", 1))
        runs.append(run)
    return {run.name: run for run in runs}
