"""Speed from positions by a Kalman smoother, without phase and with its uncertainty."""

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from swashplate.campaign.encoder import radians_per_count
from swashplate.campaign.kalman_march import NOISE_ROOT, ORDER, filter_positions, smooth_back
from swashplate.campaign.rounding import rounded_positions
from swashplate.campaign.stamps import Array, signal, stamps_of
from swashplate.errors import InputError
from swashplate.maneuvers.pieces import not_negative, positive

FASTEST = 3.0
"""Greatest bandwidth that is tried, in rad an interval: nearly that of the samples."""
FINE = 0.02
"""The estimate of the bandwidth ends when it is known to this share."""
VAGUE = 100.0
"""How far the motion may be, at the start, from rest, in greatest steps between two rows."""


class Smoothed(NamedTuple):
    """Motion estimated from the whole record, past and future of each row."""

    position: Array
    """[rad], or the unit given"""
    speed: Array
    """[rad/s]"""
    acceleration: Array
    """[rad/s²]"""
    speed_deviation: Array
    """Standard deviation of the speed's error. [rad/s]"""
    process_noise: float
    """Density of the noise on the jerk's derivative that was used. [rad²/s⁷]"""
    bandwidth: float
    """Frequency above which the smoother passes less than half of a motion, where a row's variance
    is the usual one. [Hz]"""


def smooth_counts(
    time: ArrayLike,
    counts: ArrayLike,
    *,
    counts_per_turn: float,
    gear_ratio: float = 1.0,
    sign: Literal[1, -1] = 1,
    noise: float = 0.0,
    process_noise: float | None = None,
) -> Smoothed:
    """Motion of a shaft from encoder counts.

    Parameters
    ----------
    time : array_like, shape (n,)
        Stamps, even or not. [s]
    counts : array_like, shape (n,)
        Position without roll-overs, not interpolated: the rounding is part of the model. [count]
    counts_per_turn, gear_ratio, sign :
        Scale of the encoder, as in `encoder.radians_per_count`.
    noise : float
        Standard deviation of whatever disturbs the position beside the rounding. [count]
    process_noise : float, optional
        As in `smooth_positions`. [rad²/s⁷]

    Returns
    -------
    Smoothed
        The position is that of the count's middle: count 0 stands for half a count.

    Raises
    ------
    InputError
        As `smooth_positions` and `encoder.radians_per_count`.
    """
    scale = radians_per_count(counts_per_turn, gear_ratio, sign)
    read = rounded_positions(counts)
    variance = read.variance + not_negative("noise", noise) ** 2
    return smooth_positions(
        time, scale * read.position, scale**2 * variance, process_noise=process_noise
    )


def smooth_positions(
    time: ArrayLike,
    position: ArrayLike,
    variance: ArrayLike,
    *,
    process_noise: float | None = None,
) -> Smoothed:
    """Motion whose jerk wanders, from positions measured with independent errors.

    Parameters
    ----------
    time : array_like, shape (n,)
        Stamps, even or not, eight or more. [s]
    position : array_like, shape (n,)
        Measured position. [rad], or any unit in its place
    variance : float or array_like, shape (n,)
        Variance of each measurement, positive; of a position rounded to q, q²/12 if the motion
        passes a step in every row (otherwise see `rounding.rounded_positions`). [rad²]
    process_noise : float, optional
        Density of the white noise on the jerk's derivative. Without it, the likeliest for this
        record. One number holds for all of a record: rest beside sharp steps is smoothed less than
        it could be, and the steps more. [rad²/s⁷]

    Returns
    -------
    Smoothed
        Arrays of shape (n,). The standard deviation supposes that model and variances hold.

    Raises
    ------
    InputError
        If the record is too short, the stamps do not increase, a number is not finite, a variance
        or the process noise is not positive, or the process noise is too far from the variances.

    Notes
    -----
    Rauch, Tung and Striebel's smoother behind a Kalman filter that starts from next to no
    knowledge. For variance r and interval T a steady smoother passes 1/(1 + (ω/ω₀)⁸) of a motion,
    ω₀⁸ = process_noise/(r·T): that is the `bandwidth`, and what the likelihood is searched for.
    """
    stamps, _ = stamps_of(time)
    if stamps.size < 2 * ORDER:
        raise InputError(f"A smoother needs {2 * ORDER} rows at least, not {stamps.size}.")
    positions = signal("position", position, stamps.size)
    spreads = _variances(variance, stamps.size)
    unit = float(np.median(np.diff(stamps)))
    usual = float(np.median(spreads))
    # the kernels see intervals of about 1 and variances of about 1
    size = float(np.sqrt(usual))
    origin = float(positions[0])
    record = (stamps - stamps[0]) / unit, (positions - origin) / size, spreads / usual
    vague = VAGUE * max(float(np.max(np.abs(np.diff(record[1])))), float(np.sqrt(record[2].max())))
    if process_noise is None:
        noise = _likeliest(record, vague)
    else:
        noise = positive("process_noise", process_noise) * unit**7 / usual
    states, roots = np.empty((stamps.size, ORDER)), np.empty((stamps.size, ORDER, ORDER))
    filter_positions(*record, noise, vague, NOISE_ROOT, states, roots)
    smooth_back(record[0], noise, NOISE_ROOT, states, roots)
    deviation = np.sqrt(np.sum(roots[:, :, 1] ** 2, axis=1))
    if not (np.isfinite(states).all() and np.isfinite(deviation).all()):
        raise InputError(
            f"process_noise {noise * usual / unit**7:.3g} is too far from the variances to compute "
            "with; leave it out to have it estimated."
        )
    return Smoothed(
        origin + size * states[:, 0],
        size / unit * states[:, 1],
        size / unit**2 * states[:, 2],
        size / unit * deviation,
        noise * usual / unit**7,
        noise**0.125 / (2.0 * np.pi * unit),
    )


def _variances(variance: ArrayLike, rows: int) -> Array:
    given = np.asarray(variance, dtype=float)
    spreads = signal("variance", np.full(rows, given) if given.ndim == 0 else given, rows)
    wrong = np.flatnonzero(spreads <= 0.0)
    if wrong.size:
        raise InputError(
            f"variance must be positive, but row {wrong[0]} (the first is 0) has "
            f"{spreads[wrong[0]]:g}."
        )
    return spreads


def _likeliest(record: tuple[Array, Array, Array], vague: float) -> float:
    """Process noise of the greatest likelihood, searched by the bandwidth in rad an interval."""
    from scipy.optimize import minimize_scalar

    nothing = np.empty((0, ORDER)), np.empty((0, ORDER, ORDER))

    def cost(bandwidth: float) -> float:
        return -filter_positions(
            *record, float(np.exp(8.0 * bandwidth)), vague, NOISE_ROOT, *nothing
        )

    slowest = 1.0 / float(record[0][-1])
    found = minimize_scalar(
        cost,
        bounds=(np.log(slowest), np.log(FASTEST)),
        method="bounded",
        options={"xatol": FINE},
    )
    return float(np.exp(8.0 * found.x))
