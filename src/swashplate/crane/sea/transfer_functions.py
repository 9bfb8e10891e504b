"""Motion transfer functions of ships: files of VERES, WAMIT and Capytaine, CSV, a closed form.

All are complex, per metre of wave amplitude and by e^{+iωt}, with the phase to the crest at the
ship's mean place: surge, sway, heave in m, roll, pitch, yaw in rad; axes as in `kinematics`: x
forward, y to port, z up. In waves much longer than the ship it follows the water: abeam sway is -i,
heave 1 and roll -ik; in a following sea surge is -i and pitch ik.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count
from math import inf, isfinite, pi, prod
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.crane.rope import GRAVITY
from swashplate.documents import read_text
from swashplate.errors import FileError, InputError
from swashplate.logs import open_as
from swashplate.results import Result

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

MOTIONS = ("surge", "sway", "heave", "roll", "pitch", "yaw")
MIRRORED = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
"""Signs of the motions in waves from the other side."""
LONGEST, ROLLS = 0.4, 0.2
"""A file whose lowest frequency is above the first has no long wave; above the second a ship may be
beyond its roll period, where it rolls against the slope. [rad/s]"""


class LongWave(NamedTuple):
    """A motion that goes with the water in the longest wave of a file."""

    motion: str
    """A name of `MOTIONS`."""
    heading_deg: float
    water: complex
    """Phase of the water's motion."""
    seen_above: float
    """Size of the motion above which its phase counts. [m/m], [rad/m]"""
    below: float
    """Frequency below which the wave is long. [rad/s]"""


LONG_WAVES = (
    LongWave("surge", 0.0, -1j, 0.2, LONGEST),
    LongWave("sway", 90.0, -1j, 0.2, LONGEST),
    LongWave("roll", 90.0, -1j, 0.0, ROLLS),
    LongWave("pitch", 0.0, 1j, 0.0, LONGEST),
)
HEAVES = 0.3
"""Largest distance of heave from 1 in the longest wave of a file, which the wave's crest lifts."""
PITCHES = 5.0
"""Largest pitch of any wave over its slope: it is strongly damped and stays below twice the slope,
and in degrees it is 57 times as large. Roll may be far larger at its resonance."""
STEEPEST = 2.0
"""Largest pitch in the longest following wave of a file, over the wave's slope."""
HULLS: Mapping[str, tuple[float, float]] = {
    "length": (1.0, 600.0),
    "beam": (0.3, 200.0),
    "draught": (0.05, 50.0),
    "roll_period": (0.5, 100.0),
    "roll_damping": (1e-4, 1.0),
}
"""Ranges that the numbers of every ship lie well within, from a dinghy on. [m], [s]"""
WIDEST, ASIDE = 90.0, 5.0
"""Largest angle between headings of a file; angle to its only one that is taken for it. [deg]"""


# --- closed form ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Hull:
    """A box-shaped hull in closed form: Jensen, Mansour and Olsen (Ocean Engineering 31, 2004).

    Heave and pitch are theirs; roll is the waves' slope through one resonance; sway and surge
    follow the water. Ask the ship for its roll period first: nothing else matters as much. An
    `InputError` for numbers that no ship has.
    """

    length: float
    """1 to 600; ships reach 400. [m]"""
    beam: float
    """0.3 to 200. [m]"""
    draught: float
    """0.05 to 50. [m]"""
    roll_period: float = 13.0
    """Natural period, 0.5 to 100. [s]"""
    roll_damping: float = 0.06
    """Damping ratio, 0.0001 to 1."""

    def __post_init__(self) -> None:
        for name, (low, high) in HULLS.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise InputError(
                    f"The hull's {name} is {value:g}, but must be {low:g} to {high:g}."
                )

    def response(self, omega: Array, heading: Array, speed: float = 0.0) -> Complex:
        """Complex amplitudes of six motions, (6, n); as `TransferFunctions.response`."""
        L, B, T = self.length, self.beam, self.draught
        k = omega**2 / GRAVITY
        c = np.cos(heading)
        encounter = omega - k * speed * c
        alpha = encounter / omega
        along = np.maximum(np.abs(k * c), 1e-9)
        sigma = 0.5 * along * L
        A = 2.0 * np.sin(0.5 * k * B * alpha**2) * np.exp(-k * T * alpha**2)
        f = np.sqrt((1.0 - k * T) ** 2 + (A**2 / (k * B * alpha**3)) ** 2)
        resonance = np.sqrt((1.0 - 2.0 * k * T * alpha**2) ** 2 + (A**2 / (k * B * alpha**2)) ** 2)
        force = np.exp(-along * T) * f / resonance
        ratio = np.sinc(sigma / pi)
        # (sin σ/σ - cos σ)/σ loses its digits if σ is small
        slope = np.where(sigma < 1e-3, sigma / 3.0, (ratio - np.cos(sigma)) / sigma)
        pitch = force * 6.0 / L * slope
        carried = np.exp(-0.5 * k * T) * np.sinc(0.5 * k * np.abs(c) * L / pi)
        natural = 2.0 * pi / self.roll_period
        damped = 2j * self.roll_damping * natural * encounter
        roll_resonance = natural**2 / (natural**2 - encounter**2 + damped)
        surge = -1j * c * carried
        sway = -1j * np.sin(heading) * carried
        heave = force * ratio + 0j
        roll = k * sway * roll_resonance
        return np.stack([surge, sway, heave, roll, 1j * np.sign(c) * pitch, 0j * k])


CRANE_SHIP = Hull(203.8, 23.2, 9.75)
"""Main dimensions of a T-ACS crane ship; roll period and damping are assumed."""


# --- tables ---------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class TransferFunctions(Result):
    """Motion transfer functions on a grid, straight between its points.

    Raises
    ------
    InputError
        If the longest wave, below 0.4 rad/s, does not lift the ship by about its height, carries it
        to another side than the water, pitches it by far more than the wave's slope or, below 0.2
        rad/s, rolls it against that: another convention. Also if any wave pitches it by far more
        than its slope.
    """

    name: str
    speeds: Array
    """(v,) rising. [m/s]"""
    headings: Array
    """(m,) rising from 0 to π: 0 following, π head sea; the other side by symmetry. [rad]"""
    frequencies: Array
    """(f,) of the waves, rising. [rad/s]"""
    values: Complex = field(repr=False)
    """(v, m, f, 6)"""

    def __post_init__(self) -> None:
        if self.frequencies[0] >= LONGEST:
            self._check_rotations()
            return
        longest = self.values[0, :, 0]
        heave = longest[:, 2]
        if np.abs(heave - 1.0).max() > HEAVES:
            raise InputError(
                f"{self.name}: in the longest wave heave is {complex(heave[0]):.2f} for each "
                f"metre, but must be near 1 + 0i, as with the phase to the crest and z up: "
                "convert the file."
            )
        for wave in LONG_WAVES:
            self._check_long_wave(wave)
        slope = self.frequencies[0] ** 2 / GRAVITY
        pitch = float(np.abs(longest[self.headings < 1e-4, 4]).max(initial=0.0))
        if pitch > STEEPEST * slope:
            raise InputError(
                f"{self.name}: in the longest wave, of {self.frequencies[0]:g} rad/s, pitch is "
                f"{pitch:.3g} for each metre, but the wave's slope is {slope:.3g} rad: rotations "
                "must be in rad for each metre of wave, frequencies in rad/s."
            )
        self._check_rotations()

    def _check_rotations(self) -> None:
        """Refuse rotations that are probably in degrees for each metre of wave."""
        slope = self.frequencies**2 / GRAVITY
        share = np.abs(self.values[..., MOTIONS.index("pitch")]) / slope
        if share.max() > PITCHES:
            speed, heading, row = np.unravel_index(int(np.argmax(share)), share.shape)
            pitch = float(np.abs(self.values[speed, heading, row, MOTIONS.index("pitch")]))
            raise InputError(
                f"{self.name}: pitch is {pitch:.3g} for each metre of waves of "
                f"{self.frequencies[row]:g} rad/s, but their slope is {slope[row]:.3g} rad: "
                "rotations must be in rad for each metre of wave, not in degrees."
            )

    @property
    def unchecked(self) -> str:
        """Say that axes and phases went unchecked, without a long wave; empty if there is one."""
        if self.frequencies[0] < LONGEST:
            return ""
        return (
            f"{self.name} begins at {self.frequencies[0]:g} rad/s; without a wave below "
            f"{LONGEST:g} rad/s its axes and phases could not be checked."
        )

    def _check_long_wave(self, wave: LongWave) -> None:
        """Refuse a motion that does not go with the water."""
        if not self.frequencies[0] < wave.below:
            return
        at_heading = np.abs(np.degrees(self.headings) - wave.heading_deg) < 1e-4
        amplitudes = self.values[0, at_heading, 0, MOTIONS.index(wave.motion)]
        for amplitude in amplitudes.tolist():
            against = (amplitude * np.conj(wave.water)).real < 0.0
            if against and abs(amplitude) > wave.seen_above:
                raise InputError(
                    f"{self.name}: in the longest wave of {wave.heading_deg:g} deg {wave.motion} "
                    f"is {amplitude:.3g} for each metre, but must go with the water, "
                    f"{wave.water:g} times what it is: axes, headings or phases follow another "
                    "convention; convert the file."
                )

    def response(self, omega: Array, heading: Array, speed: float = 0.0) -> Complex:
        """Complex amplitudes of the six motions for each metre of wave, (6, n).

        Of waves by their frequencies [rad/s] and headings [rad], (n,), at a speed [m/s]. Beyond the
        file's frequencies those of its ends are taken; an `InputError` for a speed that the table
        does not reach, or another heading than its only one.
        """
        low, high = self.speeds[0], self.speeds[-1]
        if not low <= speed <= high:
            raise InputError(
                f"{self.name} has speeds from {low:g} to {high:g} m/s, but {speed:g} m/s is "
                "requested."
            )
        response = np.zeros((6, omega.size), dtype=np.complex128)
        folded = np.arccos(np.clip(np.cos(heading), -1.0, 1.0))
        aside = np.degrees(np.abs(folded - self.headings[0]).max(initial=0.0))
        if self.headings.size == 1 and aside > ASIDE:
            raise InputError(
                f"{self.name} has waves of {np.degrees(self.headings[0]):g} deg only, but others "
                "are requested."
            )
        for v, weight_v in _weights(self.speeds, np.array([speed])):
            for m, weight_m in _weights(self.headings, folded):
                for f, weight_f in _weights(self.frequencies, omega):
                    response += self.values[v, m, f].T * (weight_v * weight_m * weight_f)
        return response * np.where(np.sin(heading) < 0.0, MIRRORED[:, None], 1.0)


def _weights(grid: Array, at: Array) -> Iterator[tuple[NDArray[np.int64], Array]]:
    """Indices and weights of the two neighbours of each value, held at the grid's ends."""
    position = np.interp(at, grid, np.arange(grid.size))
    below = np.minimum(position.astype(np.int64), max(grid.size - 2, 0))
    yield below, 1.0 - (position - below)
    yield np.minimum(below + 1, grid.size - 1), position - below


# --- files ----------------------------------------------------------------------------------------


AMPLITUDE = np.dtype(
    [
        ("speed", float),
        ("heading", float),
        ("frequency", float),
        ("motion", np.int64),
        ("value", complex),
    ]
)
"""Of one motion in one wave: speed [m/s], heading from x to y [deg], frequency [rad/s], number of
the motion from 1 on, as in `MOTIONS`, [m/m] or [rad/m] by e^{+iωt}."""
Amplitude = tuple[float, float, float, int, complex]
Amplitudes = NDArray[np.void]
"""(n,) of `AMPLITUDE`."""

RANGES: Mapping[str, tuple[float, float]] = {
    "speed": (-50.0, 50.0),
    # from -180 to 180 or from 0 to 360, and once around beyond that
    "heading": (-720.0, 720.0),
    # from waves of an hour to those that a model of 1 : 1000 meets
    "frequency": (1e-3, 100.0),
    "period": (0.06, 6300.0),
    "motion": (1, len(MOTIONS)),
    # rotations of a .4 are for each metre of ULEN
    "part": (-1e4, 1e4),
    "count": (1, 100_000),
}
"""Plausible numbers of a file; in m/s, deg, rad/s, s, m/m or rad/m."""
LENGTHS = (0.01, 10_000.0)
"""Plausible lengths ULEN of WAMIT. [m]"""
WHOLE = ("motion", "count")
"""Those that are whole numbers."""
KINDS = {
    "heading_deg": "heading",
    "omega": "frequency",
    "real part": "part",
    "imaginary part": "part",
    "speeds": "count",
    "headings": "count",
    "frequencies": "count",
    "motions": "count",
    **{f"{motion}_{part}": "part" for motion in MOTIONS for part in ("re", "im")},
}
"""Which range belongs to a number that a file calls otherwise."""


def read_ship(path: str | Path, length: float | None = None) -> TransferFunctions:
    """Motion transfer functions of a file by its ending: ``.re1``, ``.4``, ``.nc`` or ``.csv``.

    Parameters
    ----------
    path : path
        ``.re1`` of VERES; ``.4`` of WAMIT, displacements; ``.nc`` of Capytaine, in netCDF 4: the
        array ``RAO`` that ``capytaine.post_pro.rao`` gives, stored by ``separate_complex_values``;
        or ``.csv``, a table in this module's convention with columns ``heading_deg``, ``omega``
        [rad/s], ``surge_re``, ``surge_im`` and so on [m/m], [rad/m], and optionally ``speed``
        [m/s]. Waves from beyond 180 deg are taken as those from the other side, by symmetry.
    length : float, optional
        WAMIT's ULEN, by which rotations of a ``.4`` are made dimensionless, 0.01 to 10 000. [m]

    Raises
    ------
    FileError
        If a line does not belong to such a file, a number is not plausible (`RANGES`), or a motion
        is missing; the sentence names the line. A ``.nc`` is read in a process of its own, which a
        damaged file cannot hang.
    InputError
        For another ending, a length that is missing or that no other file takes, and another
        convention of axes, headings or phases.
    """
    kind = Path(path).suffix.lower()
    if (kind == ".4") != (length is not None):
        raise InputError(
            f"{path}: a .4 of WAMIT, and no other file, needs the length ULEN of its run."
        )
    low, high = LENGTHS
    if length is not None and not low <= length <= high:
        raise InputError(
            f"{path}: WAMIT's length ULEN is {length:g} m, but must be {low:g} to {high:g} m."
        )
    readers = {".re1": _veres, ".4": _wamit, ".nc": _capytaine, ".csv": _csv}
    if kind not in readers:
        raise InputError(
            f"{path}: transfer functions are read from .re1 of VERES, .4 of WAMIT, .nc of "
            "Capytaine, and .csv."
        )
    return _gathered(path, readers[kind](path), length or 1.0)


def _from_rows(rows: Iterable[Amplitude]) -> Amplitudes:
    """Amplitudes of rows, as one array."""
    return np.fromiter(rows, AMPLITUDE)


def _expected(name: str) -> str:
    """Describe the numbers that a column of a file may have."""
    kind = KINDS.get(name, name)
    if kind not in RANGES:
        return "a number"
    low, high = RANGES[kind]
    return f"a {'whole ' if kind in WHOLE else ''}number from {low:g} to {high:g}"


def _is_plausible(name: str, value: float) -> bool:
    """Whether a number of a file is in the range that `_expected` describes."""
    kind = KINDS.get(name, name)
    low, high = RANGES.get(kind, (-inf, inf))
    return isfinite(value) and low <= value <= high and (kind not in WHOLE or value.is_integer())


def _numbers(
    path: str | Path, line: int, texts: Sequence[str | None], required: str
) -> list[float]:
    """Plausible numbers of a line, by their names, which are joined by commas."""
    names = required.split(", ")
    numbers = list[float]()
    for name, word in zip(names, [*texts, *([None] * len(names))], strict=False):
        try:
            # Python reads 1_000 as a number, no other program does
            number = inf if "_" in (word or "") else float(word or "")
        except ValueError:
            number = inf
        if not _is_plausible(name, number):
            raise FileError(
                f"{path}, line {line}: {name} is {'missing' if word is None else repr(word)}, but "
                f"must be {_expected(name)}; needed are {required}: the file is truncated or of "
                "another kind."
            )
        numbers.append(number)
    return numbers


def _veres(path: str | Path) -> Amplitudes:
    return _from_rows(_veres_rows(path))


def _veres_rows(path: str | Path) -> Iterator[Amplitude]:
    lines = read_text(path).splitlines()
    if len(lines) < 11 or "VERES" not in lines[0]:
        raise FileError(
            f"{path} is not a VERES file of motion transfer functions: its first line differs."
        )
    rows = count(10)

    def following(required: str) -> list[float]:
        row = next(rows)
        row_cells = lines[row - 1].split() if row <= len(lines) else []
        return _numbers(path, row, row_cells, required)

    speeds, headings, frequencies, _ = map(int, following("speeds, headings, frequencies, motions"))
    for _ in range(speeds):
        (speed,) = following("speed")
        for _ in range(headings):
            (heading,) = following("heading")
            for _ in range(frequencies):
                (omega,) = following("frequency")
                for _ in MOTIONS:
                    motion, *parts = following("motion, real part, imaginary part")
                    yield speed, heading, omega, int(motion), complex(*parts)


def _wamit(path: str | Path) -> Amplitudes:
    return _from_rows(_wamit_rows(path))


def _wamit_rows(path: str | Path) -> Iterator[Amplitude]:
    required = "period, heading, motion, modulus, phase, real part, imaginary part"
    for row, line in enumerate(read_text(path).splitlines(), 1):
        row_cells = line.split()
        if row == 1 and row_cells and not row_cells[0][-1].isdigit():
            continue  # names of columns
        period, heading, motion, _, _, real, imaginary = _numbers(path, row, row_cells, required)
        yield 0.0, heading, 2.0 * pi / period, int(motion), complex(real, imaginary)


def _csv(path: str | Path) -> Amplitudes:
    return _from_rows(_csv_rows(path))


def _csv_rows(path: str | Path) -> Iterator[Amplitude]:
    parts = ", ".join(f"{motion}_{part}" for motion in MOTIONS for part in ("re", "im"))
    required = f"speed, heading_deg, omega, {parts}"
    table = csv.DictReader(read_text(path).splitlines())
    try:
        for cells in table:
            row_cells = [{"speed": "0", **cells}.get(name) for name in required.split(", ")]
            speed, heading, omega, *values = _numbers(path, table.line_num, row_cells, required)
            pairs = zip(values[::2], values[1::2], strict=True)
            for motion, (real, imaginary) in enumerate(pairs, 1):
                yield speed, heading, omega, motion, complex(real, imaginary)
    except csv.Error as error:
        raise FileError(
            f"{path}, line {table.line_num}: {error}: check for a quotation mark that is not "
            "closed."
        ) from None


def _capytaine(path: str | Path) -> Amplitudes:
    """Capytaine counts by e^{-iωt}."""
    names = ("wave_direction", "omega", "motion", "re", "im")
    columns = open_as("Capytaine", path).read(names)
    rows = np.zeros(columns["omega"].size, AMPLITUDE)
    rows["heading"] = np.degrees(columns["wave_direction"])
    rows["frequency"] = columns["omega"]
    rows["motion"] = columns["motion"]
    rows["value"].real = columns["re"]
    rows["value"].imag = -columns["im"]
    for name, values in (
        ("heading", rows["heading"]),
        ("omega", rows["frequency"]),
        ("real part", columns["re"]),
        ("imaginary part", columns["im"]),
    ):
        low, high = RANGES[KINDS.get(name, name)]
        wrong = np.flatnonzero(~((low <= values) & (values <= high)))
        if wrong.size:
            row = rows[wrong[0]]
            raise FileError(
                f"{path}: {name} is {values[wrong[0]]:g} of the {MOTIONS[row['motion'] - 1]} in "
                f"waves of {row['frequency']:g} rad/s and {row['heading']:g} deg, but must be "
                f"{_expected(name)}."
            )
    return rows


def _gathered(path: str | Path, rows: Amplitudes, length: float) -> TransferFunctions:
    """A table, each grid rising, headings from 0 to 180 degrees; rotations by a length [m]."""
    if not rows.size:
        raise FileError(f"{path} has no motions in waves.")
    angle = np.round(rows["heading"], 9) % 360.0
    speeds, v = np.unique(rows["speed"], return_inverse=True)
    headings, m = np.unique(np.minimum(angle, 360.0 - angle), return_inverse=True)
    omega, f = np.unique(rows["frequency"], return_inverse=True)
    motion = rows["motion"] - 1
    amplitude = rows["value"]
    at = np.stack([v, m, f, motion])
    shape = (speeds.size, headings.size, omega.size, len(MOTIONS))
    # a table of all of them could be far larger than the file
    present = np.unique(np.ravel_multi_index(tuple(at), shape))
    if present.size < prod(shape):
        off = np.flatnonzero(present != np.arange(present.size))
        first = off[0] if off.size else present.size
        _, i, j, missing = np.unravel_index(first, shape)
        raise FileError(
            f"{path}: there is no {MOTIONS[missing]} for {omega[j]:g} rad/s and {headings[i]:g} "
            f"deg; the file is truncated, or its waves are not on a grid: it has {present.size} of "
            f"the {prod(shape)} amplitudes of {headings.size} headings and {omega.size} "
            "frequencies."
        )
    values = np.full(shape, np.nan, dtype=np.complex128)
    # waves from the other side count, by symmetry, if this side lacks them
    other_side = angle > 180.0
    values[*at[:, other_side]] = MIRRORED[motion[other_side]] * amplitude[other_side]
    at_this_side = at[:, ~other_side]
    this_side = amplitude[~other_side]
    values[*at_this_side] = this_side
    difference = np.abs(values[*at_this_side] - this_side)
    twice = difference > 1e-3 * np.maximum(np.abs(this_side), 1e-3)
    if twice.any():
        _, i, j, which = at_this_side[:, twice][:, 0]
        raise FileError(
            f"{path}: motion {which + 1} in waves of {omega[j]:g} rad/s and {headings[i]:g} deg "
            "occurs twice, with different values."
        )
    values[..., 3:] /= length
    if headings.size > 1 and (headings[0] > 1e-6 or headings[-1] < 180.0 - 1e-6):
        raise FileError(f"{path}: headings must reach from 0 to 180 deg.")
    if headings.size > 1 and np.diff(headings).max() > WIDEST:
        raise FileError(
            f"{path}: its headings are up to {np.diff(headings).max():g} deg apart, but must be "
            f"within {WIDEST:g} deg, because motions are interpolated linearly between them."
        )
    return TransferFunctions(str(path), speeds, np.radians(headings), omega, values)
