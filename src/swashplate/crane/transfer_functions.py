"""Motion transfer functions of ships: files of VERES, WAMIT and Capytaine, CSV, closed forms.

All are complex, per metre of wave amplitude and by e^{+iωt}, with the phase to the crest at the
ship's mean place: surge, sway, heave in m, roll, pitch, yaw in rad; axes as in `kinematics`: x
forward, y to port, z up. In waves much longer than the ship it follows the water: abeam sway is -i,
heave 1 and roll -ik; in a following sea surge is -i and pitch ik.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass, field
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swashplate.crane.rope import GRAVITY
from swashplate.documents import read_text
from swashplate.errors import FileError, InputError
from swashplate.results import Result

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

MOTIONS = ("surge", "sway", "heave", "roll", "pitch", "yaw")
MIRRORED = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
"""Signs of the motions where waves come from the other side."""
OPPOSITE = 0.2
"""Part of the water's surge or sway that must be seen to say that a ship goes the other way."""
LONG_WAVE = 0.3
"""Largest distance of heave from 1 in the longest wave of a file, which the wave's crest lifts."""


# --- closed form ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Hull:
    """A box-shaped hull in closed form: Jensen, Mansour and Olsen (Ocean Engineering 31, 2004).

    Heave and pitch are theirs; roll is the waves' slope through one resonance; sway and surge
    follow the water. Ask the ship for its roll period first: nothing else matters as much.

    Attributes
    ----------
    length, beam, draught : float
        [m]
    roll_period : float
        Natural period. [s]
    roll_damping : float
        Damping ratio.
    """

    length: float
    beam: float
    draught: float
    roll_period: float = 13.0
    roll_damping: float = 0.06

    def __post_init__(self) -> None:
        for name in ("length", "beam", "draught", "roll_period", "roll_damping"):
            value = getattr(self, name)
            if not (isfinite(value) and value > 0.0):
                raise InputError(f"The hull's {name} is {value:g}, but must be above 0.")

    def heave_and_pitch(
        self, omega: Array, met: Array, k: Array, cosine: Array
    ) -> tuple[Array, Array]:
        """Amplitudes for each metre of wave, heave [m] and pitch [rad].

        Parameters
        ----------
        omega, met : array
            Frequency of the waves, and that of encounter. [rad/s]
        k : array
            Wave number. [1/m]
        cosine : array
            Of the heading.
        """
        L, B, T = self.length, self.beam, self.draught
        alpha = met / omega
        along = np.maximum(np.abs(k * cosine), 1e-9)
        sigma = 0.5 * along * L
        A = 2.0 * np.sin(0.5 * k * B * alpha**2) * np.exp(-k * T * alpha**2)
        f = np.sqrt((1.0 - k * T) ** 2 + (A**2 / (k * B * alpha**3)) ** 2)
        force = np.exp(-along * T) * f
        resonance = np.sqrt((1.0 - 2.0 * k * T * alpha**2) ** 2 + (A**2 / (k * B * alpha**2)) ** 2)
        ratio = np.sinc(sigma / np.pi)
        # (sin σ/σ - cos σ)/σ loses its digits where σ is small
        small = sigma < 1e-3
        safe = np.where(small, 1.0, sigma)
        slope = np.where(small, sigma / 3.0, (np.sinc(safe / np.pi) - np.cos(safe)) / safe)
        return force * ratio / resonance, force * 6.0 / L * slope / resonance

    def response(self, omega: Array, heading: Array, speed: float = 0.0) -> Complex:
        """Complex amplitudes of six motions, (6, n); as `TransferFunctions.response`."""
        k = omega**2 / GRAVITY
        c, s = np.cos(heading), np.sin(heading)
        met = omega - k * speed * c
        heave, pitch = self.heave_and_pitch(omega, met, k, c)
        carried = np.exp(-0.5 * k * self.draught) * np.sinc(
            0.5 * k * np.abs(c) * self.length / np.pi
        )
        own = 2.0 * np.pi / self.roll_period
        roll = -1j * k * s * carried * own**2
        roll /= own**2 - met**2 + 2j * self.roll_damping * own * met
        rows = (-1j * c * carried, -1j * s * carried, heave, roll, 1j * np.sign(c) * pitch, 0.0 * k)
        return np.stack([np.asarray(each, dtype=np.complex128) for each in rows])


CRANE_SHIP = Hull(203.8, 23.2, 9.75)
"""Main dimensions of a T-ACS crane ship; roll period and damping are assumed."""


# --- tables ---------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class TransferFunctions(Result):
    """Motion transfer functions on a grid, straight between its points.

    Raises
    ------
    InputError
        If the longest wave does not lift the ship by about its height, or carries it to another
        side than the water: another convention.
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
        heave = self.values[0, :, 0, 2]
        if np.abs(heave - 1.0).max() > LONG_WAVE and self.frequencies[0] < 0.4:
            raise InputError(
                f"{self.name}: in the longest wave heave is {complex(heave[0]):.2f} for each "
                "metre, but must be near 1 + 0i, as with the phase to the crest and z up: convert "
                "the file."
            )
        for motion, angle, wanted in ((0, 0.0, -1j), (1, 0.5 * np.pi, -1j), (4, 0.0, 1j)):
            at = np.abs(self.headings - angle) < 1e-6
            if self.frequencies[0] < 0.4 and at.any():
                found = complex(self.values[0, at, 0, motion][0])
                wrong = (found * np.conj(wanted)).real < 0.0
                if wrong and abs(found) > (OPPOSITE if motion < 3 else 0.0):
                    raise InputError(
                        f"{self.name}: in the longest wave of {np.degrees(angle):g} deg "
                        f"{MOTIONS[motion]} is {found:.3g} for each metre, but must go with the "
                        f"water, {wanted:g} times what it is: axes, headings or phases are counted "
                        "otherwise; convert the file."
                    )

    def response(self, omega: Array, heading: Array, speed: float = 0.0) -> Complex:
        """Complex amplitudes of the six motions for each metre of wave.

        Parameters
        ----------
        omega, heading : (n,) array
            Frequency [rad/s] and heading [rad] of each wave.
        speed : float
            [m/s]

        Returns
        -------
        (6, n) array
            Beyond the file's frequencies, those of its ends.

        Raises
        ------
        InputError
            For a speed that the table does not reach.
        """
        low, high = self.speeds[0], self.speeds[-1]
        if not low <= speed <= high:
            raise InputError(
                f"{self.name} has speeds from {low:g} to {high:g} m/s, but {speed:g} m/s is asked "
                "for."
            )
        folded = np.arccos(np.clip(np.cos(heading), -1.0, 1.0))
        side = np.where(np.sin(heading) < 0.0, -1.0, 1.0)
        made = np.zeros((6, omega.size), dtype=np.complex128)
        for v, weight_v in _weights(self.speeds, np.array([speed])):
            for m, weight_m in _weights(self.headings, folded):
                for f, weight_f in _weights(self.frequencies, omega):
                    made += (self.values[v, m, f].T) * (weight_v * weight_m * weight_f)
        return made * np.where(side < 0.0, MIRRORED[:, None], 1.0)


def _weights(grid: Array, at: Array) -> list[tuple[NDArray[np.int64], Array]]:
    """Indices and weights of the two neighbours of each value, held at the grid's ends."""
    if grid.size == 1:
        return [(np.zeros(at.size, dtype=np.int64), np.ones(at.size))]
    inside = np.clip(at, grid[0], grid[-1])
    below = np.clip(np.searchsorted(grid, inside, side="right") - 1, 0, grid.size - 2)
    share = (inside - grid[below]) / (grid[below + 1] - grid[below])
    return [(below, 1.0 - share), (below + 1, share)]


# --- files ----------------------------------------------------------------------------------------


def read_ship(path: str | Path, length: float | None = None) -> TransferFunctions:
    """Motion transfer functions of a file by its ending: ``.re1``, ``.4``, ``.nc`` or ``.csv``.

    Parameters
    ----------
    path : path
        Of VERES, WAMIT, Capytaine, or a table as of `read_csv`.
    length : float, optional
        WAMIT's ULEN, without which a ``.4`` cannot be read. [m]

    Raises
    ------
    FileError, InputError
        For another ending, a length that is missing or that no other file takes, and as the
        reader of each format.
    """
    kind = Path(path).suffix.lower()
    if (kind == ".4") != (length is not None):
        raise InputError(
            f"{path}: a .4 of WAMIT, and no other file, needs the length ULEN of its run."
        )
    if length is not None:
        return read_wamit(path, length)
    readers = {".re1": read_veres, ".nc": read_capytaine, ".csv": read_csv}
    if kind not in readers:
        raise InputError(
            f"{path}: transfer functions are read from .re1 of VERES, .4 of WAMIT, .nc of "
            "Capytaine, and .csv."
        )
    return readers[kind](path)


def read_veres(path: str | Path) -> TransferFunctions:
    """Motion transfer functions of a VERES file, ``.re1``.

    Raises
    ------
    FileError
        If it is no such file, or ends too early; the sentence says where.
    """
    words = [line.split() for line in read_text(path).splitlines()]
    if len(words) < 11 or "VERES" not in " ".join(words[0]):
        raise FileError(
            f"{path} is no VERES file of motion transfer functions: its first line differs."
        )
    row = 9

    def numbers(count: int, what: str) -> list[float]:
        nonlocal row
        line = words[row] if row < len(words) else []
        try:
            found = [float(each) for each in line[:count]]
        except ValueError:
            found = []
        row += 1
        if len(found) < count or not all(map(isfinite, found)):
            raise FileError(
                f"{path}, line {row}: {what} is missing, {count} numbers; the file is cut or "
                "changed."
            )
        return found

    sizes = [
        int(each) for each in numbers(4, "the number of speeds, headings, frequencies, motions")
    ]
    if min(sizes) < 1 or sizes[3] != 6:
        raise FileError(
            f"{path}, line {row}: needs one or more of each, and six motions, not {sizes}."
        )
    speeds, headings, omega = (np.zeros(each) for each in sizes[:3])
    values = np.zeros((*sizes[:3], 6), dtype=np.complex128)
    for v in range(sizes[0]):
        speeds[v] = numbers(5, "a speed")[0]
        for m in range(sizes[1]):
            headings[m] = np.radians(numbers(1, "a heading")[0])
            for f in range(sizes[2]):
                omega[f] = numbers(1, "a frequency")[0]
                for _ in range(6):
                    motion, real, imaginary = numbers(3, "a motion with its two parts")
                    if not 1 <= int(motion) <= 6:
                        raise FileError(
                            f"{path}, line {row}: there is no motion {motion:g}; 1 to 6."
                        )
                    values[v, m, f, int(motion) - 1] = complex(real, imaginary)
    return _ordered(str(path), speeds, headings, omega, values)


def read_wamit(path: str | Path, length: float) -> TransferFunctions:
    """Motion transfer functions of a WAMIT file of displacements, ``.4``.

    Each line is period [s], heading [deg], motion 1 to 6, modulus, phase [deg], real and imaginary
    part, by e^{+iωt} with the phase to the crest at the origin. WAMIT's z points up and its heading
    is where waves run, from x to y: with x to the bow this module's own. Rotations are for ξ L/A.

    Parameters
    ----------
    path : path
        The file; lines of headings beyond 180 deg, which follow by symmetry, are left out.
    length : float
        ULEN of the run, by which rotations are made dimensionless. [m]

    Raises
    ------
    FileError
        If a line does not hold such numbers, or a motion is missing.
    """
    if not (isfinite(length) and length > 0.0):
        raise InputError(f"WAMIT's length ULEN is {length:g} m, but must be above 0.")
    found: dict[tuple[float, float, int], complex] = {}
    for row, line in enumerate(read_text(path).splitlines(), 1):
        words = line.split()
        try:
            period, heading, motion, size, _, real, imaginary = map(float, words)
        except ValueError:
            if row == 1 and not _is_number(words[:1]):
                continue  # a line of headings of columns
            raise FileError(
                f"{path}, line {row}: needs period, heading, motion, modulus, phase, real and "
                "imaginary part, seven numbers; the file is cut or another one."
            ) from None
        value = complex(real, imaginary)
        if not abs(abs(value) - size) <= 1e-3 * size + 1e-5 or motion not in range(1, 7):
            raise FileError(
                f"{path}, line {row}: the parts {real:g} and {imaginary:g} of motion {motion:g} "
                f"have not the modulus {size:g}, or it is none of 1 to 6: these are no motions of "
                "one ship as WAMIT writes them."
            )
        if not period > 0.0:
            raise FileError(
                f"{path}, line {row}: the period is {period:g} s; leave out the limits of zero and "
                "infinite frequency."
            )
        heading %= 360.0
        if heading <= 180.0:
            found[period, heading, int(motion)] = value / (length if motion > 3 else 1.0)
    if not found:
        raise FileError(f"{path} has no motions in waves from 0 to 180 deg.")
    periods, headings = (np.array(sorted({key[i] for key in found})) for i in range(2))
    values = np.empty((1, headings.size, periods.size, 6), dtype=np.complex128)
    for m, heading in enumerate(headings.tolist()):
        for f, period in enumerate(periods.tolist()):
            for motion in range(1, 7):
                if (period, heading, motion) not in found:
                    raise FileError(
                        f"{path}: there is no {MOTIONS[motion - 1]} for {period:g} s and "
                        f"{heading:g} deg; the file is cut."
                    )
                values[0, m, f, motion - 1] = found[period, heading, motion]
    return _ordered(str(path), np.zeros(1), np.radians(headings), 2.0 * np.pi / periods, values)


def _is_number(words: list[str]) -> bool:
    try:
        return bool(words) and isfinite(float(words[0]))
    except ValueError:
        return False


def read_capytaine(path: str | Path) -> TransferFunctions:
    """Motion transfer functions of a netCDF file of Capytaine.

    The file holds the array ``RAO`` (or ``rao``) that ``capytaine.post_pro.rao`` gives, stored by
    ``separate_complex_values``, netCDF 4 or 3. Capytaine counts by e^{-iωt}; here it becomes
    e^{+iωt}. Its headings are where waves run, from x to y.

    Raises
    ------
    FileError
        If the file cannot be read, or lacks that array, a dimension of it or a motion.
    """
    arrays, dimensions = _netcdf(path)
    name = next((each for each in ("RAO", "rao") if each in arrays), None)
    if name is None:
        raise FileError(f"{path} has no array RAO; it has {', '.join(sorted(arrays)) or 'none'}.")
    found = dimensions[name]
    motion = next((each for each in found if each.endswith("_dof")), "radiating_dof")
    order = ["complex", "wave_direction", "omega", motion]
    lacks = [each for each in order if each not in found or each not in arrays]
    if lacks or len(found) != 4:
        raise FileError(
            f"{path}: {name} has the dimensions {', '.join(found)}, but needs {', '.join(order)} "
            "with their coordinates."
        )
    parts, names = arrays["complex"].tolist(), [each.lower() for each in arrays[motion].tolist()]
    missing = [each for each in MOTIONS if each not in names]
    if missing or sorted(parts) != ["im", "re"]:
        raise FileError(
            f"{path}: {name} has the motions {', '.join(names)} and the parts {', '.join(parts)}, "
            f"but needs {', '.join(MOTIONS)}, re and im."
        )
    table = np.transpose(arrays[name], [found.index(each) for each in order])
    made = table[parts.index("re")] - 1j * table[parts.index("im")]
    turned = np.mod(np.asarray(arrays["wave_direction"], dtype=np.float64), 2.0 * np.pi)
    near = turned <= np.pi + 1e-9
    values = made[near][None, :, :, [names.index(each) for each in MOTIONS]]
    if not np.isfinite(values).all():
        raise FileError(f"{path}: {name} is not finite everywhere.")
    omega = np.asarray(arrays["omega"], dtype=np.float64)
    return _ordered(str(path), np.zeros(1), turned[near], omega, values)


def _netcdf(path: str | Path) -> tuple[dict[str, Any], dict[str, tuple[str, ...]]]:
    """Arrays of a netCDF file, words as str, and their dimensions, by name."""
    arrays: dict[str, Any] = {}
    dimensions: dict[str, tuple[str, ...]] = {}
    try:
        if Path(path).read_bytes()[:3] == b"CDF":
            from scipy.io import netcdf_file

            with netcdf_file(path, mmap=False) as old:
                for name, each in old.variables.items():
                    data, dimensions[name] = each[...], tuple(each.dimensions)
                    if data.dtype.kind == "S":
                        words = [b"".join(row.tolist()).decode().strip("\0 ") for row in data]
                        data, dimensions[name] = np.array(words), dimensions[name][:1]
                    arrays[name] = np.array(data)
            return arrays, dimensions
        from h5py import Dataset, File

        with File(path, "r") as new:
            for name, each in new.items():
                if isinstance(each, Dataset):
                    data = each[...]
                    if data.dtype.kind in "OS":
                        data = np.array([word.decode() for word in data.ravel().tolist()])
                    arrays[name] = data
                    axes = (
                        scale[0].name.rpartition("/")[2] if scale else "" for scale in each.dims
                    )
                    dimensions[name] = (name,) if each.is_scale else tuple(axes)
    except (OSError, ValueError, TypeError, AttributeError, UnicodeDecodeError) as error:
        raise FileError(f"{path} is no netCDF file that can be read: {error}.") from None
    return arrays, dimensions


def read_csv(path: str | Path) -> TransferFunctions:
    """Motion transfer functions of a CSV table in this module's convention.

    Columns are ``heading_deg``, ``omega`` [rad/s], and for each motion ``surge_re``, ``surge_im``
    and so on [m/m], [rad/m]; a row for each heading and frequency. A column ``speed`` [m/s] may be
    there.

    Raises
    ------
    FileError
        If a column or row is missing, or a cell is no number.
    """
    rows = list(csv.DictReader(read_text(path).splitlines()))
    wanted = ["heading_deg", "omega", *(f"{m}_{part}" for m in MOTIONS for part in ("re", "im"))]
    found: list[list[float]] = []
    for n, each in enumerate(rows, 2):
        numbers = []
        for name in ("speed", *wanted):
            cell = each.get(name, "0" if name == "speed" else None)
            try:
                numbers.append(float(cell or ""))
            except ValueError:
                raise FileError(
                    f"{path}, line {n}: {name} is {cell!r}, but must be a number."
                ) from None
        found.append(numbers)
    if not found:
        raise FileError(f"{path} has no rows; it needs the columns {', '.join(wanted)}.")
    table = np.array(found)
    (speeds, v), (headings, m), (omega, f) = (
        np.unique(table[:, column], return_inverse=True) for column in range(3)
    )
    values = np.full((speeds.size, headings.size, omega.size, 6), np.nan, dtype=np.complex128)
    values[v, m, f] = table[:, 3::2] + 1j * table[:, 4::2]
    gap = np.argwhere(np.isnan(values[..., 0]))
    if gap.size:
        _, i, j = gap[0]
        raise FileError(f"{path}: there is no row for {headings[i]:g} deg and {omega[j]:g} rad/s.")
    return _ordered(str(path), speeds, np.radians(headings), omega, values)


def _ordered(
    name: str, speeds: Array, headings: Array, omega: Array, values: Complex
) -> TransferFunctions:
    """A table with rising headings from 0 to 180 degrees and rising frequencies."""
    by_speed, by_heading, by_omega = np.argsort(speeds), np.argsort(headings), np.argsort(omega)
    headings, omega = headings[by_heading], omega[by_omega]
    rising = (np.diff(omega) > 0.0).all() and (np.diff(headings) > 0.0).all()
    if not (rising and omega[0] > 0.0 and headings[0] >= 0.0 and headings[-1] <= np.pi + 1e-9):
        raise FileError(
            f"{name}: headings must differ from each other within 0 to 180 deg, and frequencies be "
            "above 0, each given once."
        )
    if headings.size > 1 and (headings[0] > 1e-9 or headings[-1] < np.pi - 1e-9):
        raise FileError(f"{name}: headings must reach from 0 to 180 deg.")
    values = values[by_speed][:, by_heading][:, :, by_omega]
    return TransferFunctions(name, speeds[by_speed], headings, omega, values)
