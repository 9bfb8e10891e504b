"""Seaways and the ship's motion in them: spectra, seeded components, synthesis by FFT."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import ceil, floor, log, pi, radians
from numbers import Real
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.crane.axes import check_names
from swashplate.crane.rope import GRAVITY
from swashplate.crane.sea.transfer_functions import CRANE_SHIP, MOTIONS, Hull, TransferFunctions
from swashplate.errors import InputError
from swashplate.logs import Series, TextOptions, read_series
from swashplate.results import Result

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

BAND = (0.2, 6.0)
"""Frequencies of the components, waves of 31 to 1.05 s. [rad/s]"""
COARSE = 8.0
"""Rate at which motion and two derivatives are summed up before they are joined smoothly. [Hz]"""
AT_ONCE = 256
"""Intervals of that rate that are joined at once: few enough for a fast cache."""
RECORDS = (4096.0, 131_072.0)
"""Shortest and longest record. In the shortest a load with a damping ratio of 0.5 % that swings at
0.6 rad/s has four components within its half-power width; the longest is a day and a half. [s]"""
DIRECTIONS = 8
"""Components of each frequency in a spread sea."""
LONGEST_HOLE = 1.0
"""Time without a sample that is a hole in a log of motions whose samples are closer. [s]"""
SPARSEST = 5.0
"""Median time between samples from which a ship's motion cannot be drawn through them. [s]"""
ALIKE = 1e-3
"""Part of the median time between samples below which two stamps are meant to be one."""
STEEPEST, FARTHEST = 1.0, 1000.0
"""Roll, pitch or yaw beyond which a measured motion is probably in degrees [rad]; distance from its
mean place that no ship comes to while a crane works [m]."""
OVERSHOOT = 1.0
"""Largest overshoot of a curve through samples, over their range; it is a few percent if a
motion is sampled well."""
RATES = (10.0, 1e5)
"""Samples a second that a measured motion is given at. [Hz]"""
LARGEST = 100_000_000
"""Numbers of a motion, 0.8 GB; nine hours at 512 Hz."""
LOWEST, HIGHEST = 1e-6, 30.0
"""Least and largest significant height of a sea: a micrometre stands for calm water, and the
largest height measured is 19 m. [m]"""
BREAKING = 1.0 / 7.0
"""Steepness at which a regular wave breaks in deep water (Stokes, Michell 1893). That of a sea, its
significant height over the length of a wave of its peak period, stays at half of it (DNV-RP-C205,
3.5.4: 1/15)."""
LEAST_ENERGY, OUTSIDE = 0.5, 0.02
"""Share of a spectrum's energy that must lie within the band; share outside from which it is
announced."""
MOST_LOST, LOST = 0.05, 0.01
"""Largest share of a sea's energy that may lie beyond a file's frequencies, where the motions of
its ends are taken; share from which that is announced."""
LEANING, FAR = 45.0, 500.0
"""Largest list and trim that are taken [deg]; distance within which the point lies that transfer
functions are given for [m]."""


@dataclass(frozen=True)
class Spectrum:
    """JONSWAP's spectrum of waves; Bretschneider's with a peak factor of 1.

    An `InputError` unless all are above 0 and plausible, the waves do not all break, and most of
    the energy lies at waves of 1.05 to 31 s.

    Examples
    --------
    >>> from swashplate.crane import Seaway, Spectrum
    >>> Seaway(Spectrum(height=2.0, period=8.0)).sea.height  # m
    2.0
    """

    height: float
    """Significant wave height, four standard deviations of the surface; 1e-6 to 30. [m]"""
    period: float
    """Of the peak. [s]"""
    peak_factor: float = 1.0
    """γ, 3.3 for young wind seas; at most 10, seas have 1 to 7."""

    def __post_init__(self) -> None:
        for name, least, most in (
            ("height", LOWEST, HIGHEST),
            ("period", 0.0, 1000.0),
            ("peak_factor", 0.0, 10.0),
        ):
            value = getattr(self, name)
            if not (0.0 < value <= most and value >= least):
                bounds = f"{least:g} to {most:g}" if least else f"above 0 and at most {most:g}"
                raise InputError(f"The {name} of a sea is {value:g}, but must be {bounds}.")
        steepness = 2.0 * np.pi * self.height / (GRAVITY * self.period**2)
        if steepness > BREAKING:
            highest_wave = BREAKING * GRAVITY * self.period**2 / (2.0 * np.pi)
            raise InputError(
                f"A sea of {self.height:g} m with a peak at {self.period:g} s is steeper than a "
                f"wave that breaks: at that period give at most {highest_wave:.2g} m, or a longer "
                "period."
            )
        lowest, highest = BAND
        if self.share(lowest, highest) < LEAST_ENERGY:
            low, high = 2.0 * np.pi / highest, 2.0 * np.pi / lowest
            raise InputError(
                f"A sea with a peak at {self.period:g} s has little energy between waves of "
                f"{low:.3g} and {high:.3g} s, which are simulated: use a period between."
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

    def share(self, low: float, high: float) -> float:
        """Share of the energy at frequencies between two [rad/s], 0 to 1."""
        peak = 2.0 * np.pi / self.period
        # beyond these there is less than a millionth
        omega = np.geomspace(0.2 * peak, 50.0 * peak, 4001)
        density = self.density(omega)
        slices = 0.5 * (density[1:] + density[:-1]) * np.diff(omega)
        below = np.concatenate([[0.0], np.cumsum(slices)])
        start, end = np.interp([low, high], omega, below).tolist()
        return float((end - start) / below[-1])


SEA_STATES: Mapping[str, Spectrum] = {
    "ss2": Spectrum(0.3, 6.3),
    "ss3": Spectrum(0.88, 7.5),
    "ss3-swell": Spectrum(0.88, 11.0),
    "ss4": Spectrum(1.88, 8.8),
    "ss5": Spectrum(3.25, 9.7),
    "ss6": Spectrum(5.0, 12.4),
}
"""Sea states, of the WMO's classes: mean significant height and most probable peak period in the
open North Pacific, Faltinsen (1990), Sea Loads on Ships and Offshore Structures, table 2.3, after
Lee et al. (1985). The peak period of ``"ss3-swell"`` is assumed, within the 5.3 to 16.1 s there."""


class Bins(NamedTuple):
    """Frequencies of a record, and the surface's variance at each, (n,)."""

    frequency: Array
    """[rad/s]"""
    variance: Array
    """[m²]"""

    def __repr__(self) -> str:
        return f"Bins({self.frequency.size} frequencies)"


class Components(NamedTuple):
    """Regular waves that add up to a seaway, each an array (n,)."""

    frequency: Array
    """[rad/s]"""
    encounter: Array
    """Frequency at which the ship meets them, on a bin of the record; below 0 if the ship overtakes
    them. [rad/s]"""
    amplitude: Complex
    """A, of a surface Re A e^{i encounter t} at the ship's mean place. [m]"""
    heading: Array
    """Direction in which they run, from the bow to port; 0 following, 90° abeam. [rad]"""

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

    Notes
    -----
    A regular wave stands on each bin of the record's Fourier transform from 0.2 to 6 rad/s. Its
    complex amplitude is Gaussian, so that its size is Rayleigh's and the surface a Gaussian process
    at each length of the record. The variances of all add up to Hs²/16, whatever of the spectrum
    lies outside the band. Under way the frequencies at which the ship meets the waves are rounded
    to the bins.

    Examples
    --------
    >>> from swashplate.crane import Seaway
    >>> Seaway("ss4", heading_deg=45.0, seed=3).motion(512).shape  # one second at 512 Hz
    (512, 6)
    """

    sea: str | Spectrum = "ss3"
    """A name of `SEA_STATES`, or a spectrum."""
    heading_deg: float = 90.0
    """Direction in which the waves run, from the bow to port: 0 following, 90 abeam from starboard,
    180 head sea, 270 abeam from port."""
    seed: int = 0
    """Of the components."""
    ship: Hull | TransferFunctions = field(default=CRANE_SHIP, repr=False)
    """The ship; by default a hull of a crane ship's size in closed form."""
    speed: float = 0.0
    """Of the ship, forward. [m/s]"""
    spread: bool = False
    """Directions spread by cos² around the heading, instead of long crests."""
    record: float = 4096.0
    """Time after which the seaway comes again, 4096 to 131 072, rounded up to a power of two of
    samples at 8 Hz, see `period`; other records are other seaways. [s]"""
    list_deg: float = 0.0
    """Constant list, positive with starboard down."""
    trim_deg: float = 0.0
    """Constant trim, positive with the bow down."""
    reference: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Point that the ship's transfer functions are given for, in the crane's axes: forward, port,
    up. [m]"""

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
        if not str(self.seed).isdigit():
            raise InputError(f"The seed of a seaway is {self.seed}, but must be 0, 1, 2, ...")
        shortest, longest = RECORDS
        if not shortest <= self.record <= longest:
            raise InputError(
                f"The record of a seaway is {self.record:g} s, but must be {shortest:g} to "
                f"{longest:g} s."
            )
        if not (abs(self.list_deg) <= LEANING and abs(self.trim_deg) <= LEANING):
            raise InputError(
                f"List and trim are {self.list_deg:g} and {self.trim_deg:g} deg, but must be "
                f"within {LEANING:g} deg."
            )
        point = np.asarray(self.reference, dtype=np.float64)
        if point.shape != (3,) or not (np.abs(point) <= FAR).all():
            raise InputError(
                f"The reference of a ship is {self.reference}, but must be a point forward, port "
                f"and up within {FAR:g} m of the origin of the crane's axes."
            )
        lost = self._lost
        if lost > MOST_LOST and isinstance(self.ship, TransferFunctions):
            low, high = self.ship.frequencies[[0, -1]]
            raise InputError(
                f"{self.ship.name} has waves of {low:.3g} to {high:.3g} rad/s, but "
                f"{100.0 * lost:.0f} % of the energy of the sea ({self.title}) lies beyond, more "
                f"than {100.0 * MOST_LOST:.0f} %: use a file that reaches further, or another sea."
            )

    @property
    def spectrum(self) -> Spectrum:
        """Its spectrum."""
        return SEA_STATES[self.sea] if isinstance(self.sea, str) else self.sea

    @property
    def title(self) -> str:
        """The name of its sea, or significant height and peak period."""
        if isinstance(self.sea, str):
            return self.sea
        return f"{self.sea.height:g} m, {self.sea.period:g} s"

    @property
    def _lost(self) -> float:
        """Share of the simulated energy beyond the frequencies of the ship's file."""
        if not isinstance(self.ship, TransferFunctions):
            return 0.0
        lowest, highest = BAND
        low, high = np.clip(self.ship.frequencies[[0, -1]], lowest, highest).tolist()
        return 1.0 - self.spectrum.share(low, high) / self.spectrum.share(lowest, highest)

    def sentences(self) -> tuple[str, ...]:
        """Say which parts of the sea are not simulated as given, if they are more than a little."""
        lowest, highest = BAND
        outside = 1.0 - self.spectrum.share(lowest, highest)
        lost = self._lost
        sentences = []
        if outside > OUTSIDE:
            shortest, longest = (2.0 * np.pi / omega for omega in BAND[::-1])
            sentences.append(
                f"{100.0 * outside:.0f} % of the energy of the sea ({self.title}) lies outside the "
                f"waves of {shortest:.3g} to {longest:.3g} s that are simulated: these are scaled "
                "up to keep the requested significant height."
            )
        if isinstance(self.ship, TransferFunctions) and self.ship.unchecked:
            sentences.append(self.ship.unchecked)
        if lost > LOST and isinstance(self.ship, TransferFunctions):
            low, high = self.ship.frequencies[[0, -1]]
            sentences.append(
                f"{self.ship.name} has waves of {low:.3g} to {high:.3g} rad/s: for the "
                f"{100.0 * lost:.1f} % of the energy of the sea ({self.title}) that lies beyond, "
                "the motions in the nearest of them are used."
            )
        return tuple(sentences)

    @property
    def period(self) -> float:
        """Time after which the seaway comes again, `record` rounded up. [s]"""
        return self._samples / COARSE

    @property
    def _samples(self) -> int:
        """Samples of the record at `COARSE`, a power of two."""
        return 1 << (ceil(self.record * COARSE) - 1).bit_length()

    @property
    def bins(self) -> Bins:
        """Frequencies of the record within the band, and what of the sea's energy each has.

        The variance of a linear response is the sum over them of its squared modulus times the
        surface's variance.
        """
        width = 2.0 * pi / self.period
        first = ceil(BAND[0] / width)
        last = floor(BAND[1] / width)
        frequency = width * np.arange(first, last + 1, dtype=np.float64)
        density = self.spectrum.density(frequency)
        variance = density * (self.spectrum.height**2 / 16.0 / density.sum())
        return Bins(frequency, variance)

    @cached_property
    def waves(self) -> Components:
        """Regular waves: one on each bin, or several directions of each if the sea is spread.

        They are drawn when they are first asked for, always the same for a seed.
        """
        rng = np.random.default_rng(self.seed)
        directions = DIRECTIONS if self.spread else 1
        omega, variance = (np.repeat(values, directions) for values in self.bins)
        real, imaginary = rng.standard_normal((2, omega.size))
        amplitude = np.sqrt(variance / directions) * (real + 1j * imaginary)
        heading = np.full(omega.size, radians(self.heading_deg))
        if self.spread:
            # one direction in each of equally probable sectors
            sector = np.arange(omega.size) % directions
            probability = (sector + rng.random(omega.size)) / directions
            grid = np.linspace(-0.5 * pi, 0.5 * pi, 1001)
            heading += np.interp(probability, 0.5 + (grid + 0.5 * np.sin(2.0 * grid)) / pi, grid)
        width = 2.0 * pi / self.period
        encounter = width * np.rint(self.encounter(omega, heading) / width)
        return Components(omega, encounter, amplitude, heading)

    def encounter(self, omega: Array, heading: Array) -> Array:
        """Frequencies at which the ship meets waves, by their frequency and heading. [rad/s]"""
        return np.asarray(omega - omega**2 / GRAVITY * self.speed * np.cos(heading))

    def response(self, omega: Array, heading: Array) -> Complex:
        """Complex amplitudes of six motions of the crane's origin for each metre of wave, (6, n).

        The ship's own, moved there from `reference`, in waves by their frequencies [rad/s] and
        headings [rad], (n,), at its speed.
        """
        response = self.ship.response(omega, heading, self.speed)
        if any(self.reference):
            to_origin = -np.array(self.reference)[:, None]
            response[:3] += np.cross(response[3:], to_origin, axis=0)
        return response

    @property
    def lean(self) -> Array:
        """(6,) constant part of the motion: list and trim."""
        return np.array([0.0, 0.0, 0.0, radians(self.list_deg), radians(self.trim_deg), 0.0])

    def motion(self, count: int, rate: float = 512.0) -> Array:
        """Motion of the crane's origin, (count, 6): surge, sway, heave [m], roll, pitch, yaw [rad].

        Samples a second are a multiple of 8. At the same time it is the same, however many samples
        are asked for; an `InputError` if the record is shorter. Value and two derivatives are
        summed up at 8 Hz by FFT; quintic polynomials join them.
        """
        inner = round(rate / COARSE)
        if inner < 1 or abs(inner * COARSE - rate) > 1e-9 * rate:
            raise InputError(f"The rate of a ship's motion must be a multiple of {COARSE:g} Hz.")
        intervals = max(-(-(count - 1) // inner), 1)
        if intervals > self._samples:
            enough = (1 << (intervals - 1).bit_length()) / COARSE
            raise InputError(
                f"The seaway repeats after {self.period:g} s, but {(count - 1) / rate:g} s are "
                f"requested: use a longer record, Seaway(..., record={enough:g})."
            )
        points = self._points(intervals + 1)
        points[:, :6] += self.lean
        motion = _joined(points, _basis(inner))
        return motion[:count]

    def _points(self, count: int) -> Array:
        """Value, slope and curvature of the six motions at `COARSE`, (count, 18), without lean."""
        waves = self.waves
        size = self._samples
        motions = (self.response(waves.frequency, waves.heading) * waves.amplitude).T
        w = waves.encounter[:, None]
        sums = np.hstack([motions, 1j * w * motions, -w * w * motions])
        # a wave met too fast for the rate is one of its aliases, which has the same samples
        index = np.rint(waves.encounter * self.period / (2.0 * pi)).astype(np.int64) % size
        mirrored = index > size // 2
        index[mirrored] = size - index[mirrored]
        sums[mirrored] = sums[mirrored].conj()
        lines = np.zeros((int(index.max()) + 1, sums.shape[1]), dtype=np.complex128)
        np.add.at(lines, index, sums)
        # an inverse real FFT counts lines twice, except those at 0 and at half of the rate
        lines[1 : size // 2] *= 0.5
        samples = np.fft.irfft(size * np.ascontiguousarray(lines.T), size)
        return np.ascontiguousarray(samples[:, np.arange(count) % size].T)


# --- measured motion ------------------------------------------------------------------------------


def ship_motion(
    path: str | Path,
    columns: Mapping[str, str] | None = None,
    *,
    time_column: str = "time",
    rate: float = 512.0,
    options: TextOptions | None = None,
) -> Array:
    """Motion of a ship from a log, (n, 6), as `simulate` takes it for a sea.

    Cubic splines through the samples, from the first time stamp on; z up, y to port. [m], [rad]

    Parameters
    ----------
    path : path
        A log of any format that `logs.open_log` reads; units stand in its header, as ``roll
        [deg]``.
    columns : mapping of str to str, optional
        Column of each motion, surge, sway, heave, roll, pitch, yaw; those that are left out are
        zero. By default all six by these names.
    time_column : str
        Column of the time stamps. [s], if its header gives no unit
    rate : float
        Of the motion returned, 10 Hz to 100 kHz; a crane takes 512 Hz.
    options : TextOptions, optional
        How a text file is written, if that cannot be recognised from it.

    Raises
    ------
    FileError
        If the file cannot be read; it names file, column and row.
    InputError
        For a motion or column that there is not, a rate out of range, fewer than four samples,
        samples more than 5 s apart, two stamps that are nearly alike, a spike, a rotation beyond 1
        rad or a distance beyond 1 km, and a motion of more than 100 million numbers.
    """
    if columns is None:
        columns = dict(zip(MOTIONS, MOTIONS, strict=True))
    unknown = [motion for motion in columns if motion not in MOTIONS]
    if unknown or not columns:
        raise InputError(
            f"A ship's motions are {', '.join(MOTIONS)}, not {', '.join(unknown) or 'none'}."
        )
    low, high = RATES
    if not (isinstance(rate, Real) and low <= rate <= high):
        raise InputError(
            f"The rate of a ship's motion is {rate!r} Hz, but must be {low:g} to {high:g} Hz; a "
            "crane takes 512 Hz."
        )
    motions: Array = np.zeros((0, 6))
    for motion, column in columns.items():
        unit = "m" if motion in MOTIONS[:3] else "rad"
        series = read_series(path, column, unit, time_column=time_column, options=options)
        _check_sampling(series.time, column, str(path))
        _check_sizes({motion: series.values}, str(path))
        if not len(motions):
            seconds = float(series.time[-1] - series.time[0])
            if 6.0 * seconds * rate > LARGEST:
                raise InputError(
                    f"{path} lasts {seconds:g} s: at {rate:g} Hz that is more than the {LARGEST} "
                    "numbers that can be read at once; cut the log, or use a lower rate."
                )
            motions = np.zeros((int(seconds * rate + 1e-6) + 1, 6))
        grid = series.time[0] + np.arange(len(motions)) / rate
        motions[:, MOTIONS.index(motion)] = _curve(series, grid, column, str(path))
    _check_sizes(dict(zip(MOTIONS, motions.T, strict=True)), str(path))
    return motions


def _check_sampling(time: Array, column: str, of: str) -> None:
    """Refuse stamps that no curve of a ship's motion can be drawn through."""
    if time.size < 4:
        raise InputError(f"{of} has {time.size} samples of {column}, but needs at least four.")
    steps = np.diff(time)
    median = float(np.median(steps))
    if median > SPARSEST:
        raise InputError(
            f"{of}: samples of {column} are {median:g} s apart, but a ship's motion needs one "
            f"every {SPARSEST:g} s or less; check the unit of the time."
        )
    hole = int(np.argmax(steps))
    narrow = int(np.argmin(steps))
    if steps[hole] > max(LONGEST_HOLE, 5.0 * median):
        raise InputError(
            f"{of} has no {column} from {time[hole]:g} to {time[hole + 1]:g} s: cut the log to a "
            "part without gaps."
        )
    if steps[narrow] < ALIKE * median:
        raise InputError(
            f"{of}: data rows {narrow + 1} and {narrow + 2} are only {steps[narrow]:.2g} s apart, "
            f"others {median:.2g} s: delete one of them, or correct its time stamp."
        )


def _curve(series: Series, grid: Array, column: str, of: str) -> Array:
    """Cubic spline through samples; refuses one that swings far beyond them."""
    from scipy.interpolate import CubicSpline

    time, values = series
    curve = np.asarray(CubicSpline(time, values)(grid))
    low = float(values.min())
    high = float(values.max())
    off = np.maximum(curve - high, low - curve)
    worst = int(np.argmax(off))
    if off[worst] > OVERSHOOT * (high - low) + 1e-9:  # of a motion that stands, its rounding
        row = int(np.argmin(np.abs(time - grid[worst])))
        raise InputError(
            f"{of}: a curve through the samples of {column} swings to {curve[worst]:.3g} at "
            f"{grid[worst]:g} s, far beyond them, {low:.3g} to {high:.3g}: check for a spike or a "
            f"wrong stamp near data row {row + 1}."
        )
    return curve


def _check_sizes(motions: Mapping[str, Array], of: str) -> None:
    """Refuse rotations beyond `STEEPEST`, and distances beyond `FARTHEST`."""
    for motion, values in motions.items():
        largest = max(float(values.max(initial=0.0)), -float(values.min(initial=0.0)))
        if motion in MOTIONS[3:] and largest > STEEPEST:
            raise InputError(
                f"{of}: {motion} reaches {largest:.3g} rad, which no ship does. If it is in "
                f"degrees, say so in the log's header, {motion} [deg], or convert it."
            )
        if largest > FARTHEST:
            raise InputError(
                f"{of}: {motion} reaches {largest:.3g} m, but must be measured from the ship's "
                f"mean position, within {FARTHEST:g} m: check its unit, or subtract the mean."
            )


def ship_motion_of(sea: Seaway | ArrayLike | None, count: int, rate: float) -> Array:
    """The ship's motion, (count, 6), one column at rest; refuses another shape or a shorter one."""
    if sea is None:
        return np.zeros((count, 1))
    if isinstance(sea, Seaway):
        return sea.motion(count, rate)
    try:
        motion = np.asarray(sea, dtype=np.float64)
    except (TypeError, ValueError):
        motion = np.zeros(0)
    if motion.ndim != 2 or motion.shape[1] != 6 or not np.isfinite(motion).all():
        raise InputError(
            "A sea is a Seaway, as Seaway('ss3'), or the ship's motion in rows of six finite "
            "numbers: surge, sway, heave [m], roll, pitch, yaw [rad]."
        )
    if len(motion) < count:
        raise InputError(
            f"The stick is {(count - 1) / rate:g} s long, but the ship's motion only "
            f"{(len(motion) - 1) / rate:g} s at {rate:g} Hz."
        )
    _check_sizes(dict(zip(MOTIONS, motion.T, strict=True)), "The sea's motion")
    return motion[:count]


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


def _joined(points: Array, basis: Array) -> Array:
    """(n, 6) motions between points on the coarse grid, rows of values, slopes and curvatures.

    Each motion is contiguous, as marches take it.
    """
    inner, intervals, motions = len(basis), len(points) - 1, 6
    joined = np.zeros((motions, intervals * inner + 1))
    product = np.empty((AT_ONCE, inner))
    for motion, row in enumerate(joined):
        between = row[:-1].reshape(intervals, inner)
        for first in range(0, intervals, AT_ONCE):
            part = between[first : first + AT_ONCE]
            for k in range(3):
                of_points = points[first : first + len(part) + 1, k * motions + motion, None]
                part += np.multiply(basis[:, k], of_points[:-1], out=product[: len(part)])
                part += np.multiply(basis[:, 3 + k], of_points[1:], out=product[: len(part)])
        row[-1] = points[-1, motion]
    return joined.T
