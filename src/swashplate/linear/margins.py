"""What a frequency response says of bandwidth and of a closed loop."""

from __future__ import annotations

from collections.abc import Callable
from math import inf, pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import DomainError, InputError

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Response = Callable[[Array], ComplexArray]

_POINTS = 4000
_DECADES = 9  # The search begins so many decades below the fastest frequency.
_TURN = 0.05  # Largest turn of the delay's phase from one point of the search to the next. [rad]
_MOST_POINTS = 2_000_000


class LoopMargins(NamedTuple):
    """Margins of a stable loop."""

    crossover: float
    """Frequency at which |L| = 1 that leaves the smallest delay margin, 0 where none. [Hz]"""
    phase_margin: float  # Phase of L above -180° there, infinite where there is no crossover. [rad]
    delay_margin: float  # Further delay that makes the loop swing. [s]
    gain_margin: float  # Factor on L that makes the loop swing. [1]


def bandwidth(response: Response, gain: float, fastest: float) -> float:
    """First frequency at which the response has fallen to gain/√2, infinite if none. [Hz]

    A response whose steady gain is zero is refused in a `DomainError`.
    """
    grid = _grid(fastest)
    _check_gain(response, gain, grid)
    level = abs(gain) / np.sqrt(2.0)

    def above(frequency: Array) -> Array:
        return np.asarray(np.abs(response(frequency)) - level)

    below = np.flatnonzero(above(grid) < 0.0)
    if below.size == 0 or below[0] == 0:
        return inf
    return _root(above, grid, int(below[0]) - 1)


def largest_gain(response: Response, delay: float, fastest: float, gain: float) -> float:
    """Proportional gain that makes the loop swing: 1/|G| where G crosses the negative axis.

    Of the stable G of frequencies, its delay [s], the highest frequency to look at [Hz], and G at 0
    Hz.
    """
    _check_gain(response, gain, _grid(fastest))
    sign = -1.0 if gain < 0.0 else 1.0
    level = 1e-6 * abs(gain)
    grid = _dense_grid(lambda f: np.asarray(response(f) / level), delay, fastest)
    return _gain_margin(lambda f: np.asarray(sign * response(f)), grid)


def loop_margins(loop: Response, delay: float, fastest: float, name: str) -> LoopMargins:
    """Margins of the loop 1 + L = 0.

    Parameters
    ----------
    loop : callable
        L of frequencies [Hz], of parts that are stable or integrate.
    delay, fastest : float
        The delay within L [s], and the highest frequency to look at [Hz].
    name : str
        Whose loop, for the sentence.

    Raises
    ------
    DomainError
        If the closed loop is unstable: by Nyquist's criterion, the argument of 1 + L does not come
        from where it must to zero.
    """
    grid = _dense_grid(loop, delay, fastest)
    values = loop(grid)
    if not np.isfinite(values).all():
        raise InputError(f"{name}: the controller's frequency response is not finite.")
    argument = np.unwrap(np.angle(1.0 + values))
    # a loop that integrates begins at -90° or, twice, at -180°; another one on the positive axis
    integrates = abs(values[0]) > 2.0 * abs(loop(10.0 * grid[:1])[0])
    begins_well = (-pi if integrates else -0.5 * pi) <= argument[0] <= 0.25 * pi
    if abs(argument[-1]) > 0.5 * pi or not begins_well:
        raise DomainError(
            f"{name}: the closed loop is unstable, so it has no margins; lower the controller's "
            "gain."
        )

    def excess(frequency: Array) -> Array:
        return np.asarray(np.log(np.maximum(np.abs(loop(frequency)), 1e-300)))

    margins = [(inf, 0.0, inf)]
    for k in np.flatnonzero(np.diff(np.signbit(excess(grid)))):
        frequency = _root(excess, grid, int(k))
        phase = (float(np.angle(loop(np.array([frequency]))[0])) + pi) % (2.0 * pi)
        margins.append((phase / (2.0 * pi * frequency), frequency, phase))
    delay_margin, crossover, phase = min(margins)
    return LoopMargins(crossover, phase, delay_margin, _gain_margin(loop, grid))


def _check_gain(response: Response, gain: float, grid: Array) -> None:
    if abs(gain) <= 1e-9 * float(np.abs(response(grid)).max()):
        raise DomainError(
            "The output does not follow a steady input (its gain is 0), so it has neither a "
            "bandwidth nor a largest gain; ask for another output."
        )


def _grid(fastest: float) -> Array:
    return np.asarray(np.geomspace(fastest * 10.0**-_DECADES, fastest, _POINTS))


def _dense_grid(loop: Response, delay: float, fastest: float) -> Array:
    """Frequencies close enough for a delay's turns as long as |L| counts."""
    coarse = _grid(fastest)
    counting = np.flatnonzero(np.abs(loop(coarse)) >= 0.5)
    if counting.size == 0:
        return coarse
    top = coarse[min(int(counting[-1]) + 1, coarse.size - 1)]
    points = 2.0 * pi * delay * top / _TURN
    if points > _MOST_POINTS:
        raise DomainError(
            f"The loop does not fall below 1 up to {top:g} Hz while its delay turns it on; it "
            "cannot be stable."
        )
    return np.union1d(coarse, np.linspace(top / (points + 2.0), top, int(points) + 2))


def _gain_margin(response: Response, grid: Array) -> float:
    """1/|G| where a response crosses the negative real axis farthest out, infinite if nowhere."""
    values = response(grid)

    def imaginary(frequency: Array) -> Array:
        return np.asarray(response(frequency).imag)

    turns = np.flatnonzero(np.diff(np.signbit(values.imag)))
    crossed = [int(k) for k in turns if (values[k : k + 2].real < 0.0).all()]
    found = [abs(response(np.array([_root(imaginary, grid, k)]))[0]) for k in crossed]
    if values[-1].real < 0.0 and abs(values[-1].imag) <= 1e-9 * abs(values[-1]):
        found.append(abs(values[-1]))  # half the rate of a sampled model
    return float(1.0 / max(found)) if found else inf


def _root(function: Callable[[Array], Array], grid: Array, k: int) -> float:
    from scipy.optimize import brentq

    return float(brentq(lambda f: float(function(np.array([f]))[0]), grid[k], grid[k + 1]))
