"""Damping of a load that swings freely, from a log of its angles: a fit of a crane's body."""

from __future__ import annotations

from math import degrees, pi, sqrt
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.campaign import Channel, Experiment, InputSignal, SignalOrigin
from swashplate.crane.axes import RATE
from swashplate.crane.crane import Crane
from swashplate.crane.machines import FARTHEST, body
from swashplate.crane.rope import GRAVITY, MOST_DAMPED
from swashplate.errors import InputError
from swashplate.identification import Estimate, Fit, ModelSetup, Search, fit
from swashplate.machine.fields import is_real

Array = NDArray[np.float64]

FEWEST = 5.0
"""Least number of swings in a log from which damping is identified."""
FEWEST_SAMPLES = 6
WIDEST = 1.0
"""Angle beyond which a log is probably in degrees. [rad]"""
EXPLAINED = 0.9
"""Least share of the log's variance that a swinging load must explain: what it leaves is then at
most a third of the swing."""
GAP = 10.0
"""Step between two stamps, over the usual step, across which a log is not interpolated."""
PERIOD_TOLERANCE = 0.1
"""Largest relative difference between the log's period and that of the rope: a hook above the load
makes the rope a few per cent longer or shorter."""
PADDED = 8
"""Points of the transform that finds the frequency, over those of the log."""
EARLY = 3.0
"""Swings from which is read where the load begins."""
DAMPING, ROPE, DRAG = "hanging.swing_damping", "home.rope", "hanging.drag"
"""Numbers of a crane's body that are found."""
FIRST_DRAG, MOST_DRAG = 0.01, 1.0
"""Drag that the search begins at, times the rope, and the largest. [1], [1/m]"""
NOISE = 0.01
"""Noise of both angles over the range of the larger one: it weighs them alike."""
CHANNELS = ("off_lead", "side_lead")
NOWHERE = SignalOrigin(Path("swing"), "angle")


class FreeSwing(NamedTuple):
    """Damping of a free swing with 95 % confidence intervals, and where it holds."""

    damping: Estimate
    """Damping ratio ζ of what resists in proportion to the speed. [1]"""
    drag: Estimate
    """k of what resists with the square of the speed, k v²; C_d A is 2 k m/ρ. [1/m]"""
    rope: Estimate
    """From the upper end to the load. [m]"""
    largest: float
    """Amplitude of the larger angle at the begin of the log. [rad]"""
    smallest: float
    """The same at its end. [rad]"""

    @property
    def period(self) -> float:
        """Of small swings. [s]"""
        return 2.0 * pi * sqrt(self.rope.value / GRAVITY)

    def sentences(self) -> tuple[str, ...]:
        """Say at which angles the damping holds."""
        return (
            f"It holds for swings of {degrees(self.largest):.3g} down to "
            f"{degrees(self.smallest):.3g} deg, which the log has, if no wind drove the load.",
        )


def swing_damping(
    time: ArrayLike,
    angle: ArrayLike,
    across: ArrayLike,
    *,
    rope: float | None = None,
    drag: float | None = None,
) -> FreeSwing:
    """Identify the damping of a free swing from a log of its angles.

    Parameters
    ----------
    time : (n,) array_like
        Rising. [s]
    angle, across : (n,) array_like
        Of the rope, signed, in a plane and in the one across it; offsets of the sensors are fitted.
        Without the second one a plane of swing that turns looks like damping. [rad]
    rope : float, optional
        Length of the rope, by which the log's period is checked. [m]
    drag : float, optional
        What resists with the square of the speed, if it is known, 0 if nothing does; by default it
        is found, which makes the interval of the damping wider. [1/m]

    Raises
    ------
    InputError
        For fewer than five swings, a gap of more than half a swing, angles that exceed 1 rad or
        never change their sign, and for a log that is not a free swing of one load: a swinging load
        explains less than 90 % of it, its damping ratio may be 0, its period is not that of the
        rope, or its drag is not the stated one.

    Notes
    -----
    It is `identification.fit` with the `body` of a crane at rest as the machine, whose load begins
    anywhere at any speed; damping ratio, drag, rope and zeros of the sensors are found with that.
    Intervals are those of any fit: residuals are coloured noise. A load that swings in two planes
    goes along an ellipse that turns by itself, which the body does, too. Of what the body lacks,
    such as two planes with two dampings, residuals are left, which widen the interval.

    Examples
    --------
    >>> import numpy as np
    >>> from swashplate.crane import swing_damping
    >>> time = np.arange(0.0, 60.0, 0.05)
    >>> angle, across = 1e-4 * np.random.default_rng(0).standard_normal((2, time.size))
    >>> angle += 0.05 * np.exp(-0.01 * time) * np.cos(1.0 * time)
    >>> round(swing_damping(time, angle, across, drag=0.0).damping.value, 3)
    0.01
    """
    elapsed, angles = _checked(time, angle, across)
    if drag is not None and not (is_real(drag) and 0.0 <= drag <= MOST_DRAG):
        raise InputError(f"drag is {drag!r}, but must be a number from 0 to {MOST_DRAG:g} 1/m.")
    main = int(np.argmax(np.ptp(angles, axis=1)))
    frequency = _frequency(elapsed, angles[main])
    found = _fitted(elapsed, angles, frequency)
    residuals = np.array([quality.residual for quality in found.qualities])
    explained = 1.0 - float(np.var(residuals, axis=1).sum() / np.var(angles, axis=1).sum())
    if explained < EXPLAINED:
        raise InputError(
            f"A swinging load explains {100.0 * max(explained, 0.0):.0f} % of the log, so it is "
            "not a free swing: cut the log to the part with the crane at rest."
        )
    if rope is not None:
        _check_period(2.0 * pi * sqrt(found[ROPE].value / GRAVITY), rope)
    if drag is not None:
        _check_drag(found[DRAG], drag)
        found = _fitted(elapsed, angles, frequency, drag)
    damping = found[DAMPING]
    if damping.lower is None or damping.upper is None or damping.lower <= 0.0:
        raise InputError(_undamped_sentence(damping, drag))
    swing = found.qualities[main].simulated
    period = 2.0 * pi / frequency
    first, last = elapsed <= period, elapsed >= elapsed[-1] - period
    return FreeSwing(
        damping=damping,
        drag=found[DRAG],
        rope=found[ROPE],
        largest=0.5 * float(np.ptp(swing[first])),
        smallest=0.5 * float(np.ptp(swing[last])),
    )


class _Start(NamedTuple):
    """Where the fit of a plane begins."""

    zero: float
    """Of the sensor. [rad]"""
    angle: float
    """[rad]"""
    rate: float
    """[rad/s]"""


def _start(elapsed: Array, swing: Array, frequency: float) -> _Start:
    """Zero, angle and rate at the first sample, of a sine of a frequency through three swings."""
    early = elapsed <= EARLY * 2.0 * pi / frequency
    turn = frequency * elapsed[early]
    basis = np.stack([np.ones(turn.size), np.cos(turn), np.sin(turn)], axis=1)
    zero, cosine, sine = np.linalg.lstsq(basis, swing[early], rcond=None)[0]
    return _Start(float(zero), float(cosine), float(frequency * sine))


def _fitted(elapsed: Array, angles: Array, frequency: float, drag: float | None = None) -> Fit:
    """Fit a crane's body at rest to both angles (2, n), with the drag if it is not given."""
    rope = GRAVITY / frequency**2
    crane = Crane.preset("tg3637")
    machine = body(crane).replace({ROPE: rope, DAMPING: crane.swing_damping, DRAG: drag or 0.0})
    free: dict[str, tuple[float, float, float]] = {
        DAMPING: (0.0, crane.swing_damping, MOST_DAMPED),
        ROPE: (0.5 * rope, rope, 2.0 * rope),
    }
    if drag is None:
        free[DRAG] = (0.0, FIRST_DRAG / rope, MOST_DRAG)
    each_run = []
    channels = {}
    noise = NOISE * float(np.ptp(angles, axis=1).max())
    # the boom points forward, so that off-lead is ahead and side-lead not to port
    for name, axis, sign, swing in zip(CHANNELS, "xy", (1.0, -1.0), angles, strict=True):
        begin = _start(elapsed, swing, frequency)
        offset, speed = f"release.offset_{axis}", f"release.velocity_{axis}"
        widest, fastest = FARTHEST * rope, rope * frequency
        free[offset] = (-widest, sign * rope * begin.angle, widest)
        free[speed] = (-fastest, sign * rope * begin.rate, fastest)
        free[f"offset {name}"] = (-WIDEST, begin.zero, WIDEST)
        each_run += [offset, speed]
        channels[name] = Channel(
            name, "swing_angle", "rad", elapsed, swing, np.ones(swing.size), NOWHERE, noise
        )
    setup = ModelSetup(
        machine,
        free,
        name="swing",
        rate=RATE,
        inputs=dict.fromkeys(machine.ports.external, 0.0),
        each_run=tuple(each_run),
    )
    still = InputSignal("none", "1", elapsed, np.zeros(elapsed.size), "linear", NOWHERE)
    log = Experiment("swing", "load", "swing", "fit", "rest", None, still, channels)
    # it begins near, so that other starts find nothing else
    return fit(setup, [log], search=Search(0))


def _check_drag(found: Estimate, drag: float) -> None:
    """Refuse a stated drag that the log contradicts."""
    low, high = found.interval
    if (low is not None and drag < low) or (high is not None and drag > high):
        raise InputError(
            f"The log shows a drag of {found.value:.3g} 1/m, from {low or 0.0:.3g} to "
            f"{high or MOST_DRAG:.3g}, not the {drag:g} 1/m that are stated: let it be found, or "
            "cut the log to the angles that matter."
        )


def _undamped_sentence(damping: Estimate, drag: float | None) -> str:
    """What is wrong with a log that does not show its damping."""
    between = "unknown"
    if damping.lower is not None and damping.upper is not None:
        between = f"within {damping.lower:.2g} and {damping.upper:.2g}"
    remedy = "" if drag is not None else ", state the drag if it is known"
    return (
        f"The log does not show a damping ratio above 0: it would be {damping.value:.2g}, "
        f"{between}. Use a longer log of a load that swings freely, in one plane and without "
        f"wind{remedy}."
    )


def _check_period(period: float, rope: float) -> None:
    """Refuse a log whose period is not that of its rope."""
    if not rope > 0.0:
        raise InputError(f"The rope is {rope:g} m long, but must be longer than 0 m.")
    expected = 2.0 * pi * sqrt(rope / GRAVITY)
    if abs(period / expected - 1.0) > PERIOD_TOLERANCE:
        raise InputError(
            f"The log swings once in {period:.3g} s, but a load on {rope:g} m of rope once in "
            f"{expected:.3g} s: check the column and the unit of the time."
        )


class _Checked(NamedTuple):
    """A log that may be a free swing."""

    elapsed: Array
    """(n,) time since its first sample. [s]"""
    angles: Array
    """(2, n) [rad]"""


def _checked(time: ArrayLike, angle: ArrayLike, across: ArrayLike) -> _Checked:
    """The log, if it can be a free swing; else an `InputError`."""
    rows = [np.asarray(values, dtype=np.float64) for values in (time, angle, across)]
    shapes = {row.shape for row in rows}
    if len(shapes) > 1 or rows[0].ndim != 1 or rows[0].size < FEWEST_SAMPLES:
        raise InputError(
            "Time and both angles of a swing must be rows of equal length, of at least "
            f"{FEWEST_SAMPLES}, not of shapes {', '.join(str(row.shape) for row in rows)}."
        )
    stamps, angles = rows[0], np.array(rows[1:])
    if not (np.isfinite(rows).all() and (np.diff(stamps) > 0.0).all()):
        raise InputError("Time and angles of a swing must be finite, and the time must rise.")
    largest = float(np.abs(angles).max())
    if largest > WIDEST:
        raise InputError(
            f"The swing reaches {largest:.3g} rad, more than the {WIDEST:g} rad that are taken: "
            "if it is in degrees, say so in the log's header, off_lead [deg], or convert it."
        )
    swing = angles[int(np.argmax(np.ptp(angles, axis=1)))]
    if swing.min() >= 0.0 or swing.max() <= 0.0:
        raise InputError(
            "The swing never changes its sign: use signed angles in two planes, or subtract a "
            "constant."
        )
    return _Checked(stamps - stamps[0], angles)


def _frequency(time: Array, swing: Array) -> float:
    """Frequency of the swing, the largest line of its spectrum. [rad/s]

    An `InputError` for fewer than five swings, and for a gap of more than half a swing.
    """
    grid = np.linspace(0.0, time[-1], time.size)
    even = np.interp(grid, time, swing) - swing.mean()
    steps = np.diff(time)
    following = np.clip(np.searchsorted(time, grid, side="right"), 1, steps.size)
    # a straight line across a gap would be a swing of its own
    even[steps[following - 1] > GAP * np.median(steps)] = 0.0
    power = np.abs(np.fft.rfft(even * np.hanning(grid.size), PADDED * grid.size))
    largest = int(np.argmax(power[1:])) + 1
    frequency = 2.0 * pi * largest / (PADDED * grid.size * float(grid[1]))
    swings = frequency * time[-1] / (2.0 * pi)
    # of a pure offset or a drift the largest line is the lowest one
    if swings < FEWEST:
        raise InputError(
            f"The log has {swings:.1f} swings, but {FEWEST:g} are needed: use a longer one, "
            "beginning when the crane is at rest."
        )
    widest = int(np.argmax(steps))
    if steps[widest] > pi / frequency:
        raise InputError(
            f"The log has a gap of {steps[widest]:.3g} s, {time[widest]:.4g} s after its begin, "
            f"but swings once in {2.0 * pi / frequency:.3g} s: use the part before the gap, or "
            "the one after it."
        )
    return frequency
