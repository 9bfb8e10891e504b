"""Instruments of a campaign, every error one number, 0 for none, and what they make of a run.

Every reading is a pure function of the true signal, the instruments and chance.

What a test campaign of this kind had is known in words: a 12-bit command, one true-RMS ammeter
around both leads, a 100 Hz dither that beats in 512 Hz samples, an encoder. The sizes of the errors
are assumed, as is usual for such instruments.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from hashlib import blake2b
from math import inf, isfinite
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.schema import SIGNALS, ChannelKind
from swashplate.errors import InputError
from swashplate.simulation.result import Simulation

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Generator = np.random.Generator

Severity = Literal["clean", "realistic", "harsh"]


@dataclass(frozen=True)
class Instruments:
    """What lies between the signals and the log. As it is made without arguments, nothing does.

    `dataclasses.replace` switches one error on or off.

    Raises
    ------
    InputError
        If a number is negative (offset and zero error may be) or not finite, or a share above 1.
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
    """Zero error of the readback: a command of 0 V reads as this. [V]"""

    current_noise: float = 0.0
    """White noise of the ammeter's output, after the rectifier: around zero it may turn the reading
    negative, but not its mean positive. [A]"""
    current_resolution: float = 0.0
    """Step of the converter that reads the ammeter. [A]"""
    current_gain_error: float = 0.0
    """Share by which the ammeter reads too much. [1]"""
    current_zero: float = 0.0
    """Reading without a current. [A]"""

    dither: float = 0.0
    """Half the height of the current's ripple at half of the full current. [A]"""
    dither_frequency: float = 100.0
    """Frequency of the card's pulse width modulation. [Hz]"""
    full_current: float = 1.2
    """Current at which the pulses would be as long as their period: 24 V on 20 Ω. [A]"""

    encoder_step: int = 0
    """Counts by which the counter moves at once; 0 is a position without steps. [1]"""
    counter_bits: int = 0
    """Bits of a signed counter that rolls over; 0 is one that is wide enough. [1]"""
    backlash: float = 0.0
    """Play between the shaft and the encoder, or another instrument of its position. [rad]"""
    transducer_noise: float = 0.0
    """White noise of every other channel, as a share of its largest value in the run. [1]"""

    jitter: float = 0.0
    """Standard deviation of the instants sampled about the grid; the stamps tell it. [s]"""
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
        for each in fields(self):
            name, value = each.name, getattr(self, each.name)
            low = -inf if name in _EITHER_SIGN else 1e-300 if name in _POSITIVE else 0.0
            high, what = (1.0, "a share, at most 1") if name in _SHARES else (inf, "finite")
            if value < low:
                what = "positive" if name in _POSITIVE else "0 or more"
            if not (isfinite(value) and low <= value <= high):
                raise InputError(f"{name} must be {what}, not {value:g}.")


_EITHER_SIGN = ("voltage_offset", "current_gain_error", "current_zero")
_SHARES = ("lost_rows", "empty_cells")
_POSITIVE = ("dither_frequency", "full_current", "longest_loss", "longest_gap")

SEVERITIES: Mapping[Severity, Instruments] = MappingProxyType(
    {
        "clean": Instruments(),
        "realistic": Instruments(
            command_bits=12,
            voltage_bits=12,
            voltage_noise=0.0008,
            current_noise=0.002,
            current_resolution=0.0005,
            dither=0.015,
            encoder_step=1,
            transducer_noise=0.002,
            jitter=2e-6,
            stamp_resolution=1e-6,
            lost_rows=0.0005,
        ),
        "harsh": Instruments(
            voltage_bits=12,
            voltage_noise=0.01,
            voltage_offset=0.02,
            current_noise=0.005,
            current_resolution=0.0005,
            current_gain_error=0.01,
            current_zero=0.004,
            dither=0.03,
            encoder_step=1,
            counter_bits=16,
            transducer_noise=0.01,
            jitter=200e-6,
            stamp_resolution=1e-6,
            lost_rows=0.01,
            longest_loss=20,
            empty_cells=0.002,
            longest_gap=10,
        ),
    }
)
"""Instruments by how bad they are.

clean: none. The log holds the model's own numbers at k/512 s, so that a fit can find the parameters
to as many digits as it likes. realistic: noise of mean zero and nothing systematic (no zero or gain
error, no lag; jitter as of a clock in hardware, which never lets a sample beside a step pass the
card's dead zone), so that a fit of the right model is unbiased and its confidence intervals can be
held against the truth. harsh: zero and gain errors, jitter that moves steps by a part of a sample,
gaps and a counter that rolls over.
"""


# --- readings ----------------------------------------------------------------------------------

COLUMNS: Mapping[str, str] = {"rectified_current": "current", "encoder_counts": "counts"}
"""Columns that are not called as the kind of their channel."""
FULL_SCALE = 10.0
"""Range of the command's converters, either way. [V]"""
FARTHEST = 0.4
"""Of the way to the next grid point a sample strays at most, so that the stamps increase. [1]"""


def stream(seed: int, *names: str) -> Generator:
    """Random numbers that depend on the seed and on names, on nothing else.

    So a run is the same whatever runs before it, and an instrument that is switched off takes no
    numbers from the others.
    """
    words = [
        int.from_bytes(blake2b(name.encode(), digest_size=8).digest(), "little") for name in names
    ]
    return np.random.default_rng(np.random.SeedSequence([seed, *words]))


def logged(
    truth: Simulation,
    kinds: tuple[ChannelKind, ...],
    instruments: Instruments,
    counts_per_turn: float,
    seed: int,
    name: str,
) -> dict[str, Array]:
    """What the instruments make of a run; each has its own stream of chance."""
    tools, grid = instruments, truth.time
    # the stamps are those of the instants sampled, which stay in order however large the jitter is
    strayed = tools.jitter * stream(seed, name, "time").standard_normal(grid.size)
    bound = FARTHEST * (grid[1] - grid[0] if grid.size > 1 else 0.0)
    instants = np.clip(grid + np.clip(strayed, -bound, bound), grid[0], grid[-1])

    def at_instants(signal: Array | None) -> Array:
        # the drive is marched on the grid: what lies between is not known better than by lines
        assert signal is not None
        return signal if not tools.jitter else np.interp(instants, grid, signal)

    def read(kind: ChannelKind | Literal["voltage"]) -> Array:
        chance = stream(seed, name, kind)
        if kind == "rectified_current":
            both = at_instants(truth.current_positive), at_instants(truth.current_negative)
            return read_current(instants, both, tools, chance)
        signal: Array = getattr(truth, "voltage" if kind == "voltage" else SIGNALS[kind])
        if kind in ("position", "encoder_counts") and tools.backlash:
            signal = play(signal, tools.backlash)
        signal = at_instants(signal)
        if kind == "voltage":
            noise = tools.voltage_noise * chance.standard_normal(grid.size)
            return converted(signal + tools.voltage_offset + noise, tools.voltage_bits)
        if kind == "encoder_counts":
            return read_counts(signal * (counts_per_turn / (2.0 * np.pi)), tools, chance)
        noise = tools.transducer_noise * np.abs(signal).max() * chance.standard_normal(grid.size)
        return np.asarray(signal + noise)

    columns = {"voltage": read("voltage"), **{COLUMNS.get(k, k): read(k) for k in kinds}}
    for column, values in columns.items():
        chance = stream(seed, name, "empty", column)
        gaps = lost(grid.size, tools.empty_cells, tools.longest_gap, chance)
        columns[column] = np.where(gaps, np.nan, values) if tools.empty_cells else values
    kept = ~lost(grid.size, tools.lost_rows, tools.longest_loss, stream(seed, name, "rows"))
    if not kept.any():
        raise InputError(f"{name}: lost_rows leaves no row; take a smaller share.")
    columns = {"time": rounded(instants, tools.stamp_resolution), **columns}
    return {column: values[kept] for column, values in columns.items()}


def rounded(values: Array, step: float) -> Array:
    """Values rounded to whole steps, as the nearest decimals where the step is one; 0 is none."""
    if not step:
        return values
    per_unit = 1.0 / step
    if abs(per_unit - round(per_unit)) < 1e-6 * per_unit:
        # division by a whole number gives the float that the decimal number is read as
        return np.asarray(np.rint(values * round(per_unit)) / round(per_unit) + 0.0)
    return np.asarray(np.rint(values / step) * step + 0.0)


def lost(size: int, share: float, longest: int, generator: Generator) -> Mask:
    """Which of `size` rows are lost: in runs of 1 to `longest`, together about a share of all."""
    mask = np.zeros(size, dtype=np.bool_)
    begins = np.flatnonzero(generator.random(size) < share / (0.5 * (1 + longest)))
    lengths = generator.integers(1, longest, size=begins.size, endpoint=True)
    for begin, length in zip(begins.tolist(), lengths.tolist(), strict=True):
        mask[begin : begin + length] = True
    return mask


def converted(voltage: Array, bits: int) -> Array:
    """Codes of b bits over ±10 V: whole multiples of 20/2ᵇ V, up to one below 10 V. [V]"""
    if not bits:
        return voltage
    half = 2.0 ** (bits - 1)
    codes = np.clip(np.rint(voltage / FULL_SCALE * half), -half, half - 1.0)
    # 0.0 turns -0.0 into 0.0, which reads better in a log
    return np.asarray(codes * (FULL_SCALE / half) + 0.0)


def read_current(
    instants: Array, both: tuple[Array, Array], tools: Instruments, chance: Generator
) -> Array:
    """The ammeter around both leads, from their currents (m,), magnitudes, at instants (m,). [A]

    The reading is (1 + gain error) (|I₊ + ripple| + |I₋ + ripple|) + zero error + noise. Pulses of
    the length D T, D = I / I_full, raise the current of an inductive coil along a straight line and
    let it fall along another: a triangle of mean zero whose height goes with D (1 − D). It has all
    multiples of the frequency; at 512 Hz the fifth of 100 Hz shows at 12 Hz.
    """
    passed = np.mod(tools.dither_frequency * instants + float(chance.random()), 1.0)
    reading = np.zeros(instants.size)
    for mean in both:
        duty = np.clip(mean / tools.full_current, 0.0, 1.0)
        rising = 2.0 * passed / np.maximum(duty, 1e-9) - 1.0
        falling = 1.0 - 2.0 * (passed - duty) / np.maximum(1.0 - duty, 1e-9)
        height = 4.0 * tools.dither * duty * (1.0 - duty)
        reading += np.abs(mean + height * np.where(passed < duty, rising, falling))
    noise = tools.current_noise * chance.standard_normal(instants.size)
    reading = (1.0 + tools.current_gain_error) * reading + tools.current_zero + noise
    return rounded(reading, tools.current_resolution)


def read_counts(counts: Array, tools: Instruments, chance: Generator) -> Array:
    """The encoder's counter, 0 at the first sample, from positions (n,). [count]

    It shows how many edges were passed. Where between two edges the shaft stands at first is
    chance, so that on average the steps are no error. A counter of b bits counts from −2ᵇ⁻¹ to
    2ᵇ⁻¹ − 1 and begins anew.
    """
    first = float(chance.random())
    if tools.encoder_step:
        step = float(tools.encoder_step)
        counts = step * (np.floor(counts / step + first) - np.floor(counts[:1] / step + first))
    if tools.counter_bits:
        half = 2.0 ** (tools.counter_bits - 1)
        counts = np.mod(counts + half, 2.0 * half) - half
    return np.asarray(counts)


def play(position: Array, width: float) -> Array:
    """Position (n,) behind a gear with backlash of a width: the play operator. [rad]

    yₙ = max(xₙ − b/2, min(xₙ + b/2, yₙ₋₁)), in the middle of the gap at first. Between two
    reversals of x it is one maximum or minimum, which is how it is computed.
    """
    half, behind = 0.5 * width, float(position[0])
    driven = np.empty_like(position)
    driven[0] = behind
    rising = np.diff(position) >= 0.0
    turns = np.flatnonzero(rising[1:] != rising[:-1]) + 1
    for begin, end in zip([0, *turns.tolist()], [*turns.tolist(), rising.size], strict=True):
        way = position[begin + 1 : end + 1]
        if end > begin and rising[begin]:
            driven[begin + 1 : end + 1] = np.maximum(way - half, behind)
        else:
            driven[begin + 1 : end + 1] = np.minimum(way + half, behind)
        behind = float(driven[end])
    return driven
