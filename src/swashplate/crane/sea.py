"""Seaways and the ship's motion in them: spectra, seeded components, exact fast synthesis."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import log, radians
from numbers import Real
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.crane.axes import check_names
from swashplate.crane.rope import GRAVITY
from swashplate.crane.transfer_functions import CRANE_SHIP, MOTIONS, Hull, TransferFunctions
from swashplate.equations import kernel
from swashplate.errors import InputError
from swashplate.logs import Series, TextOptions, read_series
from swashplate.results import Result

Array = NDArray[np.float64]

BAND = (0.25, 2.5)
"""Frequencies of the components, 25 s to 2.5 s. [rad/s]"""
LONGEST_HOLE = 1.0
"""Time without a sample in a log of motions that is a hole, where samples are closer. [s]"""
COARSE = 8.0
"""Rate at which motion and two derivatives are summed up before they are joined smoothly. [Hz]"""
SPARSEST = 5.0
"""Median time between samples from which a ship's motion cannot be drawn through them. [s]"""
ALIKE = 1e-3
"""Part of the median time between samples below which two stamps are meant to be one."""
STEEPEST, FARTHEST = 1.0, 1000.0
"""Roll, pitch or yaw beyond which a measured motion is probably in degrees [rad]; distance from its
mean place that no ship comes to while a crane works [m]."""
OVERSHOOT = 1.0
"""How far a curve through samples may swing beyond them, over their range; where a motion is
sampled well it is a few percent."""
RATES = (10.0, 1e5)
"""Samples a second that a measured motion is given at. [Hz]"""
LARGEST = 100_000_000
"""Numbers of a motion, 0.8 GB; nine hours at 512 Hz."""
HIGHEST = 30.0
"""Largest significant height of a sea; the largest one measured is 19 m. [m]"""
LEAST_ENERGY, MOST_LOST = 0.5, 0.05
"""Part of a spectrum's energy that must lie within the band; largest part of a sea's that may lie
beyond a file's frequencies, where the motions of its ends are taken."""


@dataclass(frozen=True)
class Spectrum:
    """JONSWAP's spectrum of waves; Bretschneider's with a peak factor of 1.

    An `InputError` unless all are above 0 and plausible, and most of the energy lies at waves of
    2.5 to 25 s.
    """

    height: float
    """Significant wave height, four standard deviations of the surface; at most 30. [m]"""
    period: float
    """Of the peak. [s]"""
    peak_factor: float = 1.0
    """γ, 3.3 for young wind seas; at most 10, seas have 1 to 7."""

    def __post_init__(self) -> None:
        for name, most in (("height", HIGHEST), ("period", 1000.0), ("peak_factor", 10.0)):
            value = getattr(self, name)
            if not 0.0 < value <= most:
                raise InputError(
                    f"The {name} of a sea is {value:g}, but must be above 0 and at most {most:g}."
                )
        omega = np.linspace(*BAND, 2001)
        held = float(np.trapezoid(self.density(omega), omega))
        if held < LEAST_ENERGY * self.height**2 / 16.0:
            low, high = (2.0 * np.pi / each for each in BAND[::-1])
            raise InputError(
                f"A sea with a peak at {self.period:g} s has little energy between waves of "
                f"{low:.3g} and {high:.3g} s, which are simulated: take a period between."
            )

    def density(self, omega: ArrayLike) -> Array:
        """Density of the surface's variance at frequencies [rad/s], one-sided. [m² s]"""
        w = np.asarray(omega, dtype=np.float64)
        peak = 2.0 * np.pi / self.period
        ratio = peak / w
        base = 5.0 / 16.0 * self.height**2 * ratio**4 / w * np.exp(-1.25 * ratio**4)
        sigma = np.where(w <= peak, 0.07, 0.09)
        share = np.exp(-((w / peak - 1.0) ** 2) / (2.0 * sigma**2))
        scale = 1.0 - 0.287 * log(self.peak_factor)
        return np.asarray(base * scale * self.peak_factor**share)


SEA_STATES: Mapping[str, Spectrum] = {
    "ss2": Spectrum(0.3, 6.3),
    "ss3": Spectrum(0.88, 7.5),
    "ss3-swell": Spectrum(0.88, 11.0),
    "ss4": Spectrum(1.88, 8.8),
}
"""Sea states; heights within the classes of the WMO."""


class Components(NamedTuple):
    """Regular waves that add up to a seaway, each an array."""

    frequency: Array
    """[rad/s]"""
    amplitude: Array
    """[m]"""
    phase: Array
    """At the ship's mean place. [rad]"""
    heading: Array
    """Where they run, from the bow to port; 0 following, 90° abeam. [rad]"""

    def __repr__(self) -> str:
        return f"Components({self.frequency.size} waves)"


@dataclass(frozen=True)
class Seaway(Result):
    """A seeded seaway and the ship in it.

    Raises
    ------
    InputError
        For values without sense, and a file of transfer functions beyond whose frequencies more
        than 5 % of the sea's energy lies.
    """

    sea: str | Spectrum = "ss3"
    """A name of `SEA_STATES`, or a spectrum."""
    heading_deg: float = 90.0
    """Where the waves run, from the bow to port: 0 following, 90 abeam from starboard, 180 head
    sea, 270 abeam from port."""
    seed: int = 0
    """Of the components."""
    ship: Hull | TransferFunctions = field(default=CRANE_SHIP, repr=False)
    """What moves in the waves; by default a hull of a crane ship's size in closed form."""
    speed: float = 0.0
    """Of the ship, forward. [m/s]"""
    spread: bool = False
    """Directions spread by cos² around the heading, instead of long crests."""
    components: int = 200
    """Number of regular waves."""

    def __post_init__(self) -> None:
        if not isinstance(self.sea, str | Spectrum):
            kind = type(self.sea).__name__
            raise InputError(f"A sea is a name, as 'ss3', or a Spectrum, not of type {kind}.")
        if isinstance(self.sea, str):
            check_names("There is no sea", [self.sea], SEA_STATES)
        if not (abs(self.heading_deg) <= 720.0 and abs(self.speed) <= 50.0):
            raise InputError(
                f"A seaway has a heading within 720 deg and a ship's speed within 50 m/s, not "
                f"{self.heading_deg:g} deg and {self.speed:g} m/s."
            )
        if not 2 <= self.components <= 100_000:
            raise InputError(f"A seaway has 2 to 100000 components, not {self.components:g}.")
        if not str(self.seed).isdigit():
            raise InputError(f"The seed of a seaway is {self.seed}, but must be 0, 1, 2, ...")
        if isinstance(self.ship, TransferFunctions):
            omega = np.linspace(*BAND, 2001)
            density, (low, high) = self.spectrum.density(omega), self.ship.frequencies[[0, -1]]
            lost = float(density[(omega < low) | (omega > high)].sum() / density.sum())
            if lost > MOST_LOST:
                raise InputError(
                    f"{self.ship.name} has waves of {low:.3g} to {high:.3g} rad/s, but "
                    f"{100.0 * lost:.0f} % of the energy of {self.sea} lies beyond, more than "
                    f"{100.0 * MOST_LOST:.0f} %: take a file that reaches further, or another sea."
                )

    @property
    def spectrum(self) -> Spectrum:
        """Its spectrum."""
        return SEA_STATES[self.sea] if isinstance(self.sea, str) else self.sea

    @cached_property
    def waves(self) -> Components:
        """Regular waves: one anywhere in each of equal bands, so that nothing repeats."""
        rng, n = np.random.default_rng(self.seed), self.components
        edges, width = np.linspace(*BAND, n, endpoint=False, retstep=True)
        omega = edges + rng.random(n) * width
        amplitude = np.sqrt(2.0 * self.spectrum.density(omega) * width)
        phase, heading = 2.0 * np.pi * rng.random(n), np.full(n, radians(self.heading_deg))
        if self.spread:
            grid = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 1001)
            below = 0.5 + (grid + 0.5 * np.sin(2.0 * grid)) / np.pi
            heading += np.interp(rng.random(n), below, grid)
        return Components(omega, amplitude, phase, heading)

    def motion(self, count: int, rate: float = 512.0) -> Array:
        """Motion of the ship, (count, 6): surge, sway, heave [m], roll, pitch, yaw [rad].

        Samples a second are a multiple of 8. Value and two derivatives are summed up at 8 Hz, from
        phasors that are turned, not computed; quintic polynomials join them.
        """
        inner = round(rate / COARSE)
        if inner < 1 or abs(inner * COARSE - rate) > 1e-9 * rate:
            raise InputError(f"A ship's motion has a multiple of {COARSE:g} samples a second.")
        omega, amplitude, phase, heading = self.waves
        met = omega - omega**2 / GRAVITY * self.speed * np.cos(heading)  # as the ship meets them
        response = self.ship.response(omega, heading, self.speed)
        motions = (response * (amplitude * np.exp(1j * phase))).T
        intervals = max(-(-(count - 1) // inner), 1)
        # value, slope and curvature of each motion, by e^{iωt}
        w = met[:, None]
        sums = np.hstack([motions, 1j * w * motions, -w * w * motions])
        made = np.empty((intervals * inner + 1, 6))
        _synthesised(met, sums.real.copy(), sums.imag.copy(), _basis(inner), made)
        return made[:count]


# --- measured motion ------------------------------------------------------------------------------


def ship_motion(
    path: str | Path,
    columns: Mapping[str, str] | None = None,
    *,
    time_column: str = "time",
    rate: float = 512.0,
    options: TextOptions | None = None,
) -> Array:
    """Motion of a ship from a log, (n, 6), as `Crane.simulate` takes it for a sea.

    Cubic splines through the samples, from the first time stamp on; z up, y to port. [m], [rad]

    Parameters
    ----------
    path : path
        A log of any format that `logs.open_log` reads; units stand in its header, as ``roll
        [deg]``.
    columns : mapping of str to str, optional
        Column of each motion, surge, sway, heave, roll, pitch, yaw; those that are left out are
        zero. By default all six by these names.
    rate : float
        Of the motion returned, 10 Hz to 100 kHz; a crane takes 512 Hz.
    options : TextOptions, optional
        How a text file is written, where that cannot be recognised from it.

    Raises
    ------
    FileError
        If the file cannot be read; it names file, column and row.
    InputError
        For a motion or column that there is not, a rate out of range, fewer than four samples,
        samples more than 5 s apart, two stamps that are nearly alike, a spike, a rotation beyond 1
        rad or a distance beyond 1 km, and a motion of more than 100 million numbers.
    """
    wanted = dict(zip(MOTIONS, MOTIONS, strict=True)) if columns is None else dict(columns)
    strange = [each for each in wanted if each not in MOTIONS]
    if strange or not wanted:
        raise InputError(
            f"A ship's motions are {', '.join(MOTIONS)}, not {', '.join(strange) or 'none'}."
        )
    low, high = RATES
    if not (isinstance(rate, Real) and low <= rate <= high):
        raise InputError(
            f"The rate of a ship's motion is {rate!r} Hz, but must be {low:g} to {high:g} Hz; a "
            "crane takes 512 Hz."
        )
    made: Array = np.zeros((0, 6))
    for motion, column in wanted.items():
        unit = "m" if motion in MOTIONS[:3] else "rad"
        series = read_series(path, column, unit, time_column=time_column, options=options)
        _check_sampling(series.time, column, str(path))
        _check_sizes({motion: series.values}, str(path))
        if not len(made):
            seconds = float(series.time[-1] - series.time[0])
            if 6.0 * seconds * rate > LARGEST:
                raise InputError(
                    f"{path} lasts {seconds:g} s: at {rate:g} Hz that are more than the "
                    f"{LARGEST} numbers that are taken at once; cut the log, or take a lower rate."
                )
            made = np.zeros((int(seconds * rate + 1e-6) + 1, 6))
        grid = series.time[0] + np.arange(len(made)) / rate
        made[:, MOTIONS.index(motion)] = _curve(series, grid, column, str(path))
    _check_sizes(dict(zip(MOTIONS, made.T, strict=True)), str(path))
    return made


def _check_sampling(time: Array, column: str, of: str) -> None:
    """Refuse stamps that no curve of a ship's motion can be drawn through."""
    if time.size < 4:
        raise InputError(f"{of} has {time.size} samples of {column}, but needs four.")
    apart = np.diff(time)
    median = float(np.median(apart))
    if median > SPARSEST:
        raise InputError(
            f"{of}: samples of {column} are {median:g} s apart, but a ship's motion needs one "
            f"every {SPARSEST:g} s at least; look at the unit of the time."
        )
    hole, narrow = int(np.argmax(apart)), int(np.argmin(apart))
    if apart[hole] > max(LONGEST_HOLE, 5.0 * median):
        raise InputError(
            f"{of} has no {column} from {time[hole]:g} to {time[hole + 1]:g} s: cut the log to a "
            "part without holes."
        )
    if apart[narrow] < ALIKE * median:
        raise InputError(
            f"{of}: data rows {narrow + 1} and {narrow + 2} are only {apart[narrow]:.2g} s apart, "
            f"others {median:.2g} s: take one of them out, or mend its stamp."
        )


def _curve(series: Series, grid: Array, column: str, of: str) -> Array:
    """Cubic spline through samples; refuses one that swings far beyond them."""
    from scipy.interpolate import CubicSpline

    time, values = series
    curve = np.asarray(CubicSpline(time, values)(grid))
    low, high = float(values.min()), float(values.max())
    off = np.maximum(curve - high, low - curve)
    worst = int(np.argmax(off))
    if off[worst] > OVERSHOOT * (high - low) + 1e-9:  # of a motion that stands, its rounding
        row = int(np.argmin(np.abs(time - grid[worst])))
        raise InputError(
            f"{of}: a curve through the samples of {column} swings to {curve[worst]:.3g} at "
            f"{grid[worst]:g} s, far beyond them, {low:.3g} to {high:.3g}: look for a spike or a "
            f"wrong stamp near data row {row + 1}."
        )
    return curve


def _check_sizes(motions: Mapping[str, Array], of: str) -> None:
    """Refuse rotations beyond `STEEPEST`, and distances beyond `FARTHEST`."""
    for motion, values in motions.items():
        largest = float(np.abs(values).max(initial=0.0))
        if motion in MOTIONS[3:] and largest > STEEPEST:
            raise InputError(
                f"{of}: {motion} reaches {largest:.3g} rad, which no ship does. If it is in "
                f"degrees, say so in the log's header, {motion} [deg], or convert it."
            )
        if largest > FARTHEST:
            raise InputError(
                f"{of}: {motion} reaches {largest:.3g} m, but is counted from the ship's mean "
                f"place, within {FARTHEST:g} m: look at its unit, or take the mean off."
            )


def motion_of(sea: Seaway | ArrayLike | None, count: int, rate: float) -> Array:
    """The ship's motion, (count, 6), one column at rest; refuses another shape or a shorter one."""
    if sea is None:
        return np.zeros((count, 1))
    if isinstance(sea, Seaway):
        return sea.motion(count, rate)
    try:
        made = np.ascontiguousarray(sea, dtype=np.float64)
    except (TypeError, ValueError):
        made = np.zeros(0)
    if made.ndim != 2 or made.shape[1] != 6 or not np.isfinite(made).all():
        raise InputError(
            "A sea is a Seaway, as Seaway('ss3'), or the ship's motion in rows of six finite "
            "numbers: surge, sway, heave [m], roll, pitch, yaw [rad]."
        )
    if len(made) < count:
        raise InputError(
            f"The stick is {(count - 1) / rate:g} s long, but the ship's motion only "
            f"{(len(made) - 1) / rate:g} s at {rate:g} Hz."
        )
    _check_sizes(dict(zip(MOTIONS, made.T, strict=True)), "The sea's motion")
    return made[:count]


def _basis(inner: int) -> Array:
    """Quintic polynomials, (inner, 6): of value, slope and curvature at start and end."""
    t = np.arange(inner) / inner
    h = 1.0 / COARSE
    rise = t**3 * (10.0 - 15.0 * t + 6.0 * t * t)
    return np.stack(
        [
            1.0 - rise,
            h * (t - t**3 * (6.0 - 8.0 * t + 3.0 * t * t)),
            h * h * 0.5 * t * t * (1.0 - t) ** 3,
            rise,
            h * t**3 * (-4.0 + 7.0 * t - 3.0 * t * t),
            h * h * 0.5 * t**3 * (1.0 - t) ** 2,
        ],
        axis=1,
    )


@kernel
def _synthesised(met: Array, real: Array, imag: Array, basis: Array, out: Array) -> None:
    """Add up components on the coarse grid, turned from point to point; join the points.

    Amplitudes of value, slope and curvature are a row for each component: the inner loop runs along
    rows, which the processor takes several numbers at a time.
    """
    size, columns = real.shape
    inner, motions = basis.shape[0], columns // 3
    c, s = np.ones(size), np.zeros(size)
    turn_c, turn_s = np.cos(met / COARSE), np.sin(met / COARSE)
    points = np.zeros((2, columns))
    for n in range((out.shape[0] - 1) // inner + 1):
        now, before = points[n % 2], points[(n + 1) % 2]
        now[:] = 0.0
        for j in range(size):
            a, b = c[j], s[j]
            for k in range(columns):
                now[k] += a * real[j, k] - b * imag[j, k]
            c[j], s[j] = a * turn_c[j] - b * turn_s[j], a * turn_s[j] + b * turn_c[j]
        for i in range(inner if n else 0):
            row = (n - 1) * inner + i
            for q in range(motions):
                value = 0.0
                for k in range(3):
                    value += basis[i, k] * before[k * motions + q]
                    value += basis[i, 3 + k] * now[k * motions + q]
                out[row, q] = value
        out[out.shape[0] - 1] = now[:motions]
