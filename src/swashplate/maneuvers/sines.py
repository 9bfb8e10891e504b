"""Manoeuvres of sines: sine, chirp, multisine.

What `start`, `settle` and `length` [s] are, the package says.
"""

import math
from collections.abc import Sequence

import numpy as np

from swashplate.errors import InputError
from swashplate.maneuvers.checks import finite, not_negative, positive, row, whole, window
from swashplate.maneuvers.composition import settled
from swashplate.maneuvers.curves import Array, Scaled, Sum, Tone
from swashplate.maneuvers.pieces import Maneuver, Piece

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

    Raises
    ------
    InputError
        If `frequency` is not positive, or `start` and `settle` leave nothing of `length`.
    """
    amplitude, frequency = finite("amplitude", amplitude), positive("frequency", frequency)
    start, end, length = window(start, settle, length)
    name = f"sine {amplitude:g} V {frequency:g} Hz"
    return settled(name, amplitude, [Piece(start, Tone(amplitude, frequency))], end, length)


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

    Raises
    ------
    InputError
        If a frequency is negative, or `start` and `settle` leave nothing of `length`.
    """
    amplitude = finite("amplitude", amplitude)
    first, last = not_negative("first", first), not_negative("last", last)
    start, end, length = window(start, settle, length)
    curve = Tone(amplitude, first, growth=(last - first) / (end - start))
    name = f"chirp {amplitude:g} V {first:g} to {last:g} Hz"
    return settled(name, amplitude, [Piece(start, curve)], end, length)


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
    start, end, length = window(start, settle, length)
    band = isinstance(frequencies, tuple)
    lines = _band(frequencies, end - start) if band else row("frequencies", frequencies)
    low, high = positive("the lowest frequency", lines.min()), lines.max()
    phases = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, lines.size)
    pairs = zip(lines.tolist(), phases.tolist(), strict=True)
    together = Sum(tuple(Tone(1.0, line, phase=phase) for line, phase in pairs))
    points = math.ceil(_POINTS_PER_PERIOD * high * (end - start)) + 1
    time, spacing = np.linspace(0.0, end - start, points, retstep=True)
    # between two points it rises above the peak found by half its curvature at most
    curvature = float(((2.0 * np.pi * lines) ** 2).sum())
    peak = float(np.abs(together(time)).max()) + 0.5 * curvature * (0.5 * float(spacing)) ** 2
    name = f"multisine {amplitude:g} V {low:g} to {high:g} Hz seed {seed}"
    return settled(name, amplitude, [Piece(start, Scaled(amplitude / peak, together))], end, length)


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
