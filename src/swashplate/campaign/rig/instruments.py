"""The instruments of a campaign: every error one number, 0 for none, so that each can be chosen.

What a test campaign of this kind had is known in words: a 12-bit command, one true-RMS ammeter
around both leads, a 100 Hz dither that beats in 512 Hz samples, an encoder. The sizes of the errors
are assumed, as is usual for such instruments.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from math import isfinite
from types import MappingProxyType
from typing import Literal

from swashplate.errors import InputError

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
    current_floor: float = 0.0
    """Noise within the ammeter's bandwidth, which a true-RMS meter squares, adds and so never reads
    below: its error around zero crossings. [A]"""
    averaging_time: float = 0.0
    """Time constant of the mean under the RMS: the reading lags, and the ripple counts into it. 0
    is a meter that follows every instant. [s]"""

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
    hidden_jitter: float = 0.0
    """The same, but the stamps do not tell it. [s]"""
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
            value = getattr(self, each.name)
            if not isfinite(value):
                raise InputError(f"{each.name} must be finite, not {value}.")
            if value < 0 and each.name not in _EITHER_SIGN:
                raise InputError(f"{each.name} must not be negative, not {value:g}.")
            if value > 1.0 and each.name in _SHARES:
                raise InputError(f"{each.name} is a share, at most 1, not {value:g}.")
            if value == 0 and each.name in _POSITIVE:
                raise InputError(f"{each.name} must be positive, not 0.")


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
            current_floor=0.01,
            averaging_time=0.002,
            dither=0.03,
            encoder_step=1,
            counter_bits=16,
            transducer_noise=0.01,
            jitter=200e-6,
            hidden_jitter=100e-6,
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
held against the truth. harsh: zero and gain errors, a lagging ammeter with a floor, jitter that
moves steps by a part of a sample, gaps and a counter that rolls over.
"""
