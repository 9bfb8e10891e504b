"""A virtual test rig: a drive with known parameters, seen through the instruments of a campaign.

`run` simulates tests and reads them with `Instruments`; `write` makes of them what a campaign
leaves: logs, campaign.toml and, apart, the truth. Everything that is written says that it is
virtual. Refinements that a fit is to find, or to miss, are parameters of the simulated drive.

>>> from swashplate import rig
>>> rig.write(rig.run("hoist", seed=1), "virtual-hoist")

The instruments are those of Kruse's campaign (a 12-bit command, one true-RMS ammeter around both
leads, a 100 Hz dither that beats in 512 Hz samples, an encoder); the sizes of errors are assumed.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from hashlib import blake2b
from importlib.metadata import version
from math import isfinite, pi
from pathlib import Path
from platform import python_version
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from swashplate.__about__ import __version__
from swashplate.campaign import CHANNEL_KINDS, KINDS, SIGNALS, ChannelKind
from swashplate.drive import Drive, Simulation
from swashplate.entries import SCHEMA
from swashplate.errors import FileError, InputError, ParameterError
from swashplate.machine.marching import SOURCE_RATE
from swashplate.maneuvers import Maneuver, positive, source_tests, whole
from swashplate.results import Result
from swashplate.tables import write_text, write_whole

if TYPE_CHECKING:
    from tomlkit.items import InlineTable

Array = NDArray[np.float64]
Generator = np.random.Generator
Severity = Literal["clean", "realistic", "harsh"]

FULL_SCALE = 10.0
"""Range of the command's converters, either way. [V]"""
FULL_CURRENT = 1.2
"""Current at which the card's pulses would be as long as their period: 24 V on 20 Ω. [A]"""
COUNTS_PER_TURN = {"hoist": 400.0 * 120.0 / 19.0, "luff": 635.0 * 4.0, "slew": 81_000.0 * 7.0}
"""Counts in a turn of the output: 2526.3, 2540 and 567,000 in Kruse's tables."""
HELD_BACK = {
    "hoist": ("step +6.5 V", "step -6.5 V", "sine 6.5 V 0.1 Hz"),
    "slew": ("sine 4 V 0.1 Hz",),
    "luff": ("step +6.5 V", "sine 6.5 V 0.1 Hz"),
}
"""Kruse's tests kept for validation: those of middle size, within what the others excite."""
COLUMNS: Mapping[str, str] = {"rectified_current": "current", "encoder_counts": "counts"}
"""Columns that are not called as the kind of their channel."""
DRIVE_FILE = "drive.toml"
"""Next to truth.toml the parameters of the drive that was simulated; next to campaign.toml those of
the drive that a fit starts from."""


@dataclass(frozen=True)
class Instruments:
    """Errors of the instruments between the signals and the log, each one number; 0 is none.

    `dataclasses.replace` switches one error on or off.

    Raises
    ------
    InputError
        If a number is negative (offset, gain and zero error may be) or not finite, or a share
        above 1.
    """

    command_bits: int = 0
    """Bits of the converter that puts the command out over ±10 V: what the drive gets has its
    steps. [1]"""
    voltage_bits: int = 0
    """Bits of the converter that reads it back. As fine as the other, it reads the same steps but
    for noise; without the other, slow commands cross thresholds up to half a step off. [1]"""
    voltage_noise: float = 0.0
    """White noise before the converter that reads. [V]"""
    voltage_offset: float = 0.0
    """Zero error of the readback. [V]"""

    current_noise: float = 0.0
    """White noise of the ammeter's output, after the rectifier. [A]"""
    current_resolution: float = 0.0
    """Step of the converter that reads the ammeter. [A]"""
    current_gain_error: float = 0.0
    """Share by which the ammeter reads too much. [1]"""
    current_zero: float = 0.0
    """Reading without a current. [A]"""
    dither: float = 0.0
    """Half the height of the current's ripple at half of the full current of 1.2 A. [A]"""
    dither_frequency: float = 100.0
    """Frequency of the card's pulse width modulation. [Hz]"""

    encoder_step: int = 0
    """Counts by which the counter moves at once; 0 is a position without steps. [1]"""
    counter_bits: int = 0
    """Bits of a signed counter that rolls over; 0 is one that is wide enough. [1]"""
    backlash: float = 0.0
    """Play between the shaft and the encoder, or another instrument of its position. [rad]"""
    transducer_noise: float = 0.0
    """White noise of every other channel, as a share of its largest value in the run. [1]"""

    jitter: float = 0.0
    """Standard deviation of the instants sampled about the grid, which the stamps have. [s]"""
    stamp_resolution: float = 0.0
    """Step to which the stamps are rounded. [s]"""
    lost_rows: float = 0.0
    """Share of rows that are missing. [1]"""
    longest_loss: int = 1
    """Most rows that are lost at once. [1]"""
    empty_cells: float = 0.0
    """Share of cells without a number, apart from the stamps. [1]"""
    longest_gap: int = 1
    """Most cells of a column that are empty one after another. [1]"""

    def __post_init__(self) -> None:
        special = dict.fromkeys(("voltage_offset", "current_gain_error", "current_zero"), "finite")
        special |= dict.fromkeys(("dither_frequency", "longest_loss", "longest_gap"), "positive")
        special |= dict.fromkeys(("lost_rows", "empty_cells"), "a share, at most 1")
        for name, value in asdict(self).items():
            what = special.get(name, "0 or more") if isfinite(value) else "finite"
            right = {"finite": isfinite(value), "positive": value > 0.0, "0 or more": value >= 0.0}
            if not right.get(what, 0.0 <= value <= 1.0):
                raise InputError(f"{name} must be {what}, not {value:g}.")


# fmt: off
SEVERITIES: Mapping[Severity, Instruments] = MappingProxyType({
    "clean": Instruments(),
    "realistic": Instruments(
        command_bits=12, voltage_bits=12, voltage_noise=0.0008,
        current_noise=0.002, current_resolution=0.0005, dither=0.015,
        encoder_step=1, transducer_noise=0.002,
        jitter=2e-6, stamp_resolution=1e-6, lost_rows=0.0005),
    "harsh": Instruments(
        voltage_bits=12, voltage_noise=0.01, voltage_offset=0.02,
        current_noise=0.005, current_resolution=0.0005,
        current_gain_error=0.01, current_zero=0.004, dither=0.03,
        encoder_step=1, counter_bits=16, transducer_noise=0.01,
        jitter=200e-6, stamp_resolution=1e-6, lost_rows=0.01, longest_loss=20,
        empty_cells=0.002, longest_gap=10),
})
# fmt: on
"""Instruments by how bad they are.

clean: the model's own numbers at k/512 s, in which a fit finds the parameters to any digit.
realistic: noise of mean zero and nothing systematic, so that a fit of the right model is unbiased
and its confidence intervals can be compared with the truth; jitter as of a clock in hardware never
lets a sample next to a step pass the card's dead zone. harsh: zero and gain errors, jitter that
moves steps by a part of a sample, gaps and a counter that rolls over.
"""


@dataclass(frozen=True, eq=False)
class VirtualRun(Result):
    """One simulated test."""

    name: str
    """Name of the maneuver."""
    stem: str
    """Name of its file without the ending: axis and maneuver."""
    role: Literal["fit", "validate"]
    columns: Mapping[str, Array]
    """Logged samples (n,), SI: ``"time"`` [s], ``"voltage"`` [V] and the channels; NaN is an empty
    cell, rows that were lost are missing in all."""
    truth: Simulation
    """The simulation, without the instruments' errors."""


@dataclass(frozen=True, eq=False)
class VirtualTests:
    """A simulated campaign: its logs and its truth."""

    axis: str
    nominal: Drive
    """The drive that a fit starts from."""
    preset: str | None
    """Name of the packaged drive that `nominal` is, if it is one."""
    drive: Drive
    """The drive that was simulated."""
    instruments: Instruments
    severity: str
    """``"clean"``, ``"realistic"``, ``"harsh"`` or ``"custom"``."""
    seed: int
    channels: tuple[ChannelKind, ...]
    counts_per_turn: float
    runs: Mapping[str, VirtualRun]
    """By the names of the maneuvers, in their order."""

    def __repr__(self) -> str:
        return (
            f"VirtualTests({self.axis!r}, {len(self.runs)} runs, {self.severity}, seed {self.seed})"
        )


def run(
    drive: str | Drive,
    maneuvers: Mapping[str, Maneuver] | Sequence[Maneuver] | None = None,
    *,
    seed: int = 1,
    severity: Severity = "realistic",
    instruments: Instruments | None = None,
    truth: Drive | None = None,
    perturb: float = 0.0,
    axis: str | None = None,
    channels: Sequence[ChannelKind] = ("rectified_current", "encoder_counts"),
    counts_per_turn: float | None = None,
    validate: Collection[str] | None = None,
) -> VirtualTests:
    """Simulate the tests of a campaign and log them.

    Parameters
    ----------
    drive : str or Drive
        Name of a packaged drive, or a drive: the one that a fit starts from.
    maneuvers : mapping or sequence of Maneuver, optional
        By default Kruse's tests of the axis.
    seed : int
        Not negative. The same seed gives the same logs, each of them whatever other runs there are.
    severity : {"clean", "realistic", "harsh"}
        How bad the instruments are, see `SEVERITIES`.
    instruments : Instruments, optional
        Used instead of those of `severity`.
    truth : Drive, optional
        What is simulated instead of `drive`, with refinements for example.
    perturb : float
        Multiply every value of what is simulated by a random factor, whose logarithm is
        at most this, 0.5 at most, and has half of it as standard deviation. Zeros, infinite limits
        and parameters without effect stay. [1]
    axis : {"hoist", "slew", "luff"}, optional
        Whose tests and encoder they are; by default the one that the drive is called after.
    channels : sequence of str
        Kinds of channel to log, as in a campaign file. Those other than current and counts are the
        simulated signals with white noise.
    counts_per_turn : float, optional
        Of the encoder, for one turn of the shaft; by default the axis's.
    validate : collection of str, optional
        Names of the runs that are kept for validation; by default, of Kruse's tests, those of
        middle size (`HELD_BACK`), and none of others.

    Returns
    -------
    VirtualTests
        Logs and truth in memory; `write` makes files of them.

    Raises
    ------
    InputError
        For an unknown name, a number out of range, two maneuvers of one name, or a maneuver that
        cannot be simulated at 512 Hz; or if no draw of `perturb` keeps the rules of a parameter
        set.

    Examples
    --------
    >>> from swashplate import maneuvers, rig
    >>> rig.run("hoist", {"step": maneuvers.step(9.0)}, seed=1)
    VirtualTests('hoist', 1 runs, realistic, seed 1)
    """
    preset = drive if isinstance(drive, str) else None
    nominal = Drive.preset(drive) if isinstance(drive, str) else drive
    seed = whole("seed", seed)
    axis = axis or nominal.name
    kinds = tuple(channels)
    # a real card's filter and decay know nothing of a log's samples (docs/decisions/0008)
    simulated = (truth or nominal).at_every_rate()
    if perturb:
        simulated = _perturbed(simulated, perturb, seed)
    simulated = Drive(replace(simulated.parameters, card_switch="split"))
    stated = source_tests(axis) if maneuvers is None else maneuvers
    if isinstance(stated, Mapping):
        tests = dict(stated)
    else:
        tests = {maneuver.name: maneuver for maneuver in stated}
    held_back: Collection[str] = validate or ()
    if validate is None and maneuvers is None:
        held_back = HELD_BACK[axis]
    # as files' names: hoist_step_+4_V, hoist_ramp_+1_V-s
    stems = [re.sub(r"[^\w.+-]+", "_", f"{axis} {name}".replace("/", "-")) for name in tests]
    turn = COUNTS_PER_TURN.get(axis, 1.0)
    if counts_per_turn is not None:
        turn = positive("counts_per_turn", counts_per_turn)
    if severity not in SEVERITIES:
        raise InputError(f"severity is {severity!r}; it is one of {', '.join(SEVERITIES)}.")
    if len(tests) < len(stated):
        raise InputError("Two maneuvers have the same name; give them in a mapping by name.")
    if not tests:
        raise InputError("A campaign needs at least one maneuver.")
    _check_kinds(kinds)
    if "encoder_counts" in kinds and counts_per_turn is None and axis not in COUNTS_PER_TURN:
        raise InputError(
            f"The encoder of '{axis}' is not known: give counts_per_turn, or as axis one of "
            f"{', '.join(COUNTS_PER_TURN)}."
        )
    _check_tests(tests, stems, held_back)
    instruments_used = instruments or SEVERITIES[severity]
    runs = dict[str, VirtualRun]()
    for stem, (name, maneuver) in zip(stems, tests.items(), strict=True):
        command = maneuver.sample(SOURCE_RATE)
        largest = float(np.abs(command).max())
        if largest > FULL_SCALE:
            raise InputError(f"The command reaches {largest:g} V, but the card takes ±10 V.")
        simulation = simulated.simulate(_quantised(command, instruments_used.command_bits))
        runs[name] = VirtualRun(
            name=name,
            stem=stem,
            role="validate" if name in held_back else "fit",
            columns=_logged(simulation, kinds, instruments_used, turn, seed, name),
            truth=simulation,
        )
    return VirtualTests(
        axis=axis,
        nominal=nominal,
        preset=preset,
        drive=simulated,
        instruments=instruments_used,
        severity=severity if instruments_used == SEVERITIES[severity] else "custom",
        seed=seed,
        channels=kinds,
        counts_per_turn=turn,
        runs=runs,
    )


def _check_kinds(kinds: Sequence[ChannelKind]) -> None:
    """Refuse kinds of channel that the rig does not have, none at all, and a repeated one."""
    possible = [kind for kind in CHANNEL_KINDS if kind != "other"]
    for kind in kinds:
        if kind not in possible:
            raise InputError(f"There is no channel {kind!r}; there are {', '.join(possible)}.")
    if not kinds or len(set(kinds)) < len(kinds):
        raise InputError("channels must be one or more kinds, each once.")


def _check_tests(
    tests: Mapping[str, Maneuver], stems: Sequence[str], held_back: Collection[str]
) -> None:
    """Refuse a run to validate that is not among the tests, and files of the same name."""
    for name in held_back:
        if name not in tests:
            raise InputError(f"There is no run {name!r} to validate; there are {', '.join(tests)}.")
    if len({stem.lower() for stem in stems}) < len(tests):
        raise InputError("Two maneuvers would have the same file; give them other names.")


def _perturbed(drive: Drive, spread: float, seed: int) -> Drive:
    """A drive with each value times a random factor, within a spread of the logarithm."""
    if not 0.0 < spread <= 0.5:
        raise InputError(f"perturb must be above 0 and at most 0.5, not {spread:g}.")
    numbers = drive.parameters.numbers
    columns = [
        column
        for parameter in drive.parameters.values()
        if parameter.status != "inactive"
        for column in parameter.definition.columns
        if numbers[column] != 0.0 and isfinite(numbers[column])
    ]
    generator = _stream(seed, "parameters")
    for _ in range(100):
        logarithms = 0.5 * spread * generator.standard_normal(len(columns))
        while (far := np.abs(logarithms) > spread).any():
            logarithms[far] = 0.5 * spread * generator.standard_normal(int(far.sum()))
        try:
            drawn = drive.scale(**dict(zip(columns, np.exp(logarithms).tolist(), strict=True)))
        except ParameterError:
            continue
        title = f"{drive.parameters.title}; values within ±{100 * spread:g} % by seed {seed}"
        return drawn.renamed(drive.name, title)
    raise InputError(
        f"No draw of 100 within ±{100 * spread:g} % keeps the rules of {drive.name}'s parameters; "
        "use a smaller spread."
    )


# --- readings -------------------------------------------------------------------------------------


def _stream(seed: int, *names: str) -> Generator:
    """Random numbers that depend on the seed and on names, on nothing else.

    So a run is the same whatever runs before it, and an instrument that is switched off takes no
    numbers from the others.
    """
    digests = (blake2b(name.encode(), digest_size=8).digest() for name in names)
    words = [int.from_bytes(digest, "little") for digest in digests]
    return np.random.default_rng(np.random.SeedSequence([seed, *words]))


def _logged(
    truth: Simulation,
    kinds: tuple[ChannelKind, ...],
    instruments: Instruments,
    counts_per_turn: float,
    seed: int,
    name: str,
) -> dict[str, Array]:
    """Columns of a run's log; each instrument has its own random generator."""
    size = truth.time.size
    sampled_at = _sampling_instants(truth.time, instruments, _stream(seed, name, "time"))
    readings = _Readings(truth, sampled_at, instruments, counts_per_turn)
    columns = {"voltage": readings.voltage(_stream(seed, name, "voltage"))}
    for kind in kinds:
        columns[COLUMNS.get(kind, kind)] = readings.channel(kind, _stream(seed, name, kind))
    if instruments.empty_cells:
        for column, values in columns.items():
            generator = _stream(seed, name, "empty", column)
            gaps = _lost_samples(size, instruments.empty_cells, instruments.longest_gap, generator)
            columns[column] = np.where(gaps, np.nan, values)
    generator = _stream(seed, name, "rows")
    is_logged = ~_lost_samples(size, instruments.lost_rows, instruments.longest_loss, generator)
    if not is_logged.any():
        raise InputError(f"{name}: lost_rows leaves no row; use a smaller share.")
    columns = {"time": _rounded_to_steps(sampled_at, instruments.stamp_resolution), **columns}
    return {column: values[is_logged] for column, values in columns.items()}


def _sampling_instants(time: Array, instruments: Instruments, generator: Generator) -> Array:
    """Jittered instants (n,) of the samples, in order whatever the jitter. [s]"""
    jitter = instruments.jitter * generator.standard_normal(time.size)
    step = time[1] - time[0] if time.size > 1 else 0.0
    bound = 0.4 * step
    jittered = time + np.clip(jitter, -bound, bound)
    return np.asarray(np.clip(jittered, time[0], time[-1]))


@dataclass(frozen=True, eq=False)
class _Readings:
    """Readings of the instruments at the instants at which they are sampled."""

    truth: Simulation
    sampled_at: Array
    """[s]"""
    instruments: Instruments
    counts_per_turn: float

    def voltage(self, generator: Generator) -> Array:
        """The command, with zero error, noise and the steps of its converter. [V]"""
        noise = generator.standard_normal(self.sampled_at.size)
        values = self._sampled("voltage")
        values = values + self.instruments.voltage_offset + self.instruments.voltage_noise * noise
        return _quantised(values, self.instruments.voltage_bits)

    def channel(self, kind: ChannelKind, generator: Generator) -> Array:
        """Reading of the instrument of a kind of channel, in the unit of its log."""
        if kind == "rectified_current":
            currents = self._sampled("current_positive"), self._sampled("current_negative")
            return _ammeter(self.sampled_at, currents, self.instruments, generator)
        values = self._sampled(SIGNALS[kind])
        if kind == "encoder_counts":
            return _counter(
                values * (self.counts_per_turn / (2.0 * pi)), self.instruments, generator
            )
        noise = generator.standard_normal(self.sampled_at.size)
        return np.asarray(values + self.instruments.transducer_noise * np.abs(values).max() * noise)

    def _sampled(self, signal: str) -> Array:
        """A signal at the sampling instants, on straight lines between the simulation's own."""
        values: Array = getattr(self.truth, signal)
        if signal == "shaft_position" and self.instruments.backlash:
            values = _play(values, self.instruments.backlash)
        if not self.instruments.jitter:
            return values
        return np.interp(self.sampled_at, self.truth.time, values)


def _lost_samples(size: int, share: float, longest: int, generator: Generator) -> NDArray[np.bool_]:
    """Which samples are lost: runs of 1 to `longest`, together about a share of all."""
    mask = np.zeros(size, dtype=np.bool_)
    begins = np.flatnonzero(generator.random(size) < share / (0.5 * (1 + longest)))
    lengths = generator.integers(1, longest, size=begins.size, endpoint=True)
    for begin, length in zip(begins.tolist(), lengths.tolist(), strict=True):
        mask[begin : begin + length] = True
    return mask


def _rounded_to_steps(values: Array, step: float) -> Array:
    """Values rounded to whole steps, as the nearest decimals if the step is one; 0 is none."""
    if not step:
        return values
    per_unit = 1.0 / step
    if abs(per_unit - round(per_unit)) < 1e-6 * per_unit:
        # division by a whole number gives the float that the decimal number is read as
        return np.asarray(np.rint(values * round(per_unit)) / round(per_unit) + 0.0)
    return np.asarray(np.rint(values / step) * step + 0.0)


def _quantised(voltage: Array, bits: int) -> Array:
    """Voltage as a converter of b bits over ±10 V gives it, unchanged if `bits` is 0. [V]

    Whole multiples of 20/2ᵇ V, from -10 V to one multiple below 10 V.
    """
    if not bits:
        return voltage
    full_scale_code = 2.0 ** (bits - 1)
    codes = np.rint(voltage / FULL_SCALE * full_scale_code)
    codes = np.clip(codes, -full_scale_code, full_scale_code - 1.0)
    # 0.0 turns -0.0 into 0.0, which reads better in a log
    return np.asarray(codes * (FULL_SCALE / full_scale_code) + 0.0)


def _ammeter(
    instants: Array, currents: tuple[Array, Array], instruments: Instruments, generator: Generator
) -> Array:
    """Readings (m,) of the ammeter around both leads, at instants (m,) [s]. [A]

    `currents` are the magnitudes (m,) of the mean currents I₊ and I₋ of both coils. The reading is
    (1 + gain error) (|I₊ + ripple| + |I₋ + ripple|) + zero error + noise.

    The ripple is that of dither. In each period T, a pulse of the length D T, D = I / I_full, lets
    the current of an inductive coil rise along a straight line; then it falls along another. The
    ripple is a triangle of mean zero whose height is proportional to D (1 − D). Its spectrum has
    all multiples of the dither's frequency; sampled at 512 Hz, the fifth of 100 Hz shows at 12 Hz.
    """
    phase = np.mod(instruments.dither_frequency * instants + float(generator.random()), 1.0)
    reading = np.zeros(instants.size)
    for mean_current in currents:
        # duty and phase are in periods; both lines run from -1 to 1 or back
        duty = np.clip(mean_current / FULL_CURRENT, 0.0, 1.0)
        rising = 2.0 * phase / np.maximum(duty, 1e-9) - 1.0
        falling = 1.0 - 2.0 * (phase - duty) / np.maximum(1.0 - duty, 1e-9)
        height = 4.0 * instruments.dither * duty * (1.0 - duty)
        ripple = height * np.where(phase < duty, rising, falling)
        reading += np.abs(mean_current + ripple)
    noise = instruments.current_noise * generator.standard_normal(instants.size)
    reading = (1.0 + instruments.current_gain_error) * reading + instruments.current_zero + noise
    return _rounded_to_steps(reading, instruments.current_resolution)


def _counter(counts: Array, instruments: Instruments, generator: Generator) -> Array:
    """The encoder's counter, 0 at the first sample, from positions (n,). [count]

    It shows how many edges were passed. The shaft's first position between two edges is
    random, so that on average the steps are not an error. A counter of b bits counts from −2ᵇ⁻¹ to
    2ᵇ⁻¹ − 1 and wraps.
    """
    first = float(generator.random())
    if instruments.encoder_step:
        step = float(instruments.encoder_step)
        counts = step * (np.floor(counts / step + first) - np.floor(counts[:1] / step + first))
    if instruments.counter_bits:
        half = 2.0 ** (instruments.counter_bits - 1)
        counts = np.mod(counts + half, 2.0 * half) - half
    return np.asarray(counts)


def _play(position: Array, width: float) -> Array:
    """Position (n,) downstream of a gear with backlash of a width: the play operator. [rad]

    yₙ = max(xₙ − b/2, min(xₙ + b/2, yₙ₋₁)), in the middle of the gap at first.
    """
    last_output = float(position[0])
    output = np.empty_like(position)
    for n, x in enumerate(position):
        last_output = max(x - 0.5 * width, min(x + 0.5 * width, last_output))
        output[n] = last_output
    return output


# --- files ----------------------------------------------------------------------------------------


def write(tests: VirtualTests, folder: str | Path, *, overwrite: bool = False) -> Path:
    """Files that a campaign leaves, and the truth next to them.

    Parameters
    ----------
    tests : VirtualTests
        What `run` simulated.
    folder : path
        New or empty: logs as CSV, named after axis and maneuver, and campaign.toml. In its folder
        ``truth`` lie truth.toml and the parameters that were simulated.
    overwrite : bool
        Allow a folder that holds something, and replace files of the same names.

    Returns
    -------
    path
        Of campaign.toml, written last: where it is, everything is.

    Raises
    ------
    FileError
        If the folder is not empty or something cannot be written.

    Examples
    --------
    >>> from swashplate import maneuvers, rig
    >>> tests = rig.run("hoist", {"step": maneuvers.step(9.0)})
    >>> file = rig.write(tests, "tests")
    >>> file.name
    'campaign.toml'
    """
    root = Path(folder)
    try:
        if root.exists() and not root.is_dir():
            raise FileError(f"{root} is a file; name a folder.")
        if root.is_dir() and not overwrite and any(root.iterdir()):
            raise FileError(f"{root} is not empty; name a new folder, or allow overwriting.")
        (root / "truth").mkdir(parents=True, exist_ok=True)
    except FileError:
        raise
    except OSError as error:
        raise FileError(f"{root} cannot be written: {error.strerror or error}.") from None
    refinements = f"refinements {', '.join(tests.drive.parameters.refinements) or 'none'}"
    note = f"# virtual: simulated by swashplate {__version__}, no measurement; axis {tests.axis}, "
    ends = f"instruments {tests.severity}, {refinements}, seed {tests.seed}\n"
    for run in tests.runs.values():
        log = partial(_write_log, run.columns, f"{note}{run.name}, {ends}")
        write_whole(root / f"{run.stem}.csv", log)
    if tests.preset is None:
        tests.nominal.to_toml(root / DRIVE_FILE)
    tests.drive.to_toml(root / "truth" / DRIVE_FILE)
    campaign, truth = _contents(tests)
    header = (
        f"# Virtual tests, simulated by swashplate {__version__}: nothing here was measured.\n# "
        f"Instruments: {tests.severity}; {refinements}; seed {tests.seed}.\n# The simulated values "
        "are in truth/truth.toml: open it only after the fit.\n"
    )
    write_text(f"# True parameters of the virtual tests.\n{truth}", root / "truth" / "truth.toml")
    write_text(header + campaign, root / "campaign.toml")
    return root / "campaign.toml"


def _write_log(columns: Mapping[str, Array], note: str, path: Path) -> None:
    """A CSV: an empty cell for NaN, whole numbers for an encoder that counts them."""
    import polars as pl

    table, counts = pl.DataFrame(dict(columns), nan_to_null=True), columns.get("counts")
    if counts is not None and np.array_equal(counts, np.rint(counts), equal_nan=True):
        table = table.with_columns(pl.col("counts").cast(pl.Int64))
    with path.open("wb") as file:
        file.write(note.encode())
        table.write_csv(file)


def _contents(tests: VirtualTests) -> tuple[str, str]:
    """TOML of the campaign file, and of the truth: instruments, seed and versions."""
    from tomlkit import dumps

    instruments, drop = (
        tests.instruments,
        {"missing": "drop"} if tests.instruments.empty_cells else {},
    )
    entries: dict[str, Any] = {"kind": "voltage", "column": "voltage", "unit": "V", **drop}
    entries["accuracy"] = _accuracy("voltage", instruments)
    axis: dict[str, Any] = {"drive": tests.preset or DRIVE_FILE}
    axis |= {"time": {"column": "time", "unit": "s"}, "start": "rest", "input": entries}
    channels = axis["channels"] = dict[str, dict[str, object]]()
    for kind in tests.channels:
        column = COLUMNS.get(kind, kind)
        entry = channels[column] = {"kind": kind, "column": column, **drop}
        if kind != "encoder_counts":
            entry["unit"] = KINDS[kind].units[0]
            entry["accuracy"] = _accuracy(kind, instruments)
            continue
        entry["counts_per_turn"] = tests.counts_per_turn
        if instruments.counter_bits:
            entry["rolls_over_at"] = 2**instruments.counter_bits
    runs = [{"file": f"{run.stem}.csv", "role": run.role} for run in tests.runs.values()]
    content = {"schema": SCHEMA, "title": f"Virtual tests, {tests.axis}", "virtual": True}
    truth = {"virtual": True, "axis": tests.axis, "drive": DRIVE_FILE}
    truth |= {key: getattr(tests, key) for key in ("severity", "seed", "counts_per_turn")}
    truth |= {"runs": list(tests.runs), "instruments": asdict(instruments)}
    versions = {package: version(package) for package in ("numpy", "llvmlite")}
    truth["versions"] = {"swashplate": __version__, "python": python_version(), **versions}
    return dumps(content | {"axes": {tests.axis: axis}, "runs": runs}), dumps(truth)


def _accuracy(kind: ChannelKind | Literal["voltage"], instruments: Instruments) -> InlineTable:
    """Accuracy of an instrument for the campaign file, which the rig knows."""
    from tomlkit import inline_table

    limits = {"gain": 0.0, "zero": 0.0, "time": 0.0}
    if kind == "voltage":
        limits["zero"] = abs(instruments.voltage_offset)
    elif kind == "rectified_current":
        limits["gain"], limits["zero"] = (
            abs(instruments.current_gain_error),
            abs(instruments.current_zero),
        )
    table = inline_table()
    table.update(limits)
    return table
