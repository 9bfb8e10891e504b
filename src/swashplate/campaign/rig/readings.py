"""What each instrument reads: pure functions of the true signal, the instruments and chance."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.rig.instruments import Instruments
from swashplate.campaign.rig.sampling import rounded
from swashplate.errors import InputError

Array = NDArray[np.float64]
Generator = np.random.Generator

FULL_SCALE = 10.0
"""Range of the command's converters, either way. [V]"""
OVERSAMPLING = 32
"""Points from one sample to the next at which a lagging ammeter is followed: 160 a period of a
100 Hz dither at 512 Hz."""


def put_out(voltage: Array, instruments: Instruments) -> Array:
    """The command as the converter that puts it out makes it. [V]

    Raises
    ------
    InputError
        If it goes beyond ±10 V, which a converter would clip. At 10 V it stays one step below.
    """
    largest = float(np.abs(voltage).max())
    if largest > FULL_SCALE:
        raise InputError(f"The command reaches {largest:g} V, but the card takes ±10 V; scale it.")
    return _converted(voltage, instruments.command_bits)


def read_voltage(voltage: Array, instruments: Instruments, generator: Generator) -> Array:
    """The command as it is read back. [V]

    Parameters
    ----------
    voltage : (n,) array
        Command at the instants sampled. [V]
    """
    reading = voltage + instruments.voltage_offset
    reading = reading + instruments.voltage_noise * generator.standard_normal(voltage.size)
    return _converted(reading, instruments.voltage_bits)


def _converted(voltage: Array, bits: int) -> Array:
    """Codes of b bits over ±10 V: whole multiples of 20/2ᵇ V, up to one below 10 V. [V]"""
    if not bits:
        return voltage
    half = 2.0 ** (bits - 1)
    codes = np.clip(np.rint(voltage / FULL_SCALE * half), -half, half - 1.0)
    # 0.0 turns -0.0 into 0.0, which reads better in a log
    return np.asarray(codes * (FULL_SCALE / half) + 0.0)


def dither_ripple(time: Array, current: Array, phase: float, instruments: Instruments) -> Array:
    """What pulse width modulation adds to the mean of a channel's current. [A]

    Parameters
    ----------
    time : (n,) array
        Instants. [s]
    current : (n,) array
        Mean current of the channel, not negative. [A]
    phase : float
        Share of a period that has passed at 0 s. [1]

    Notes
    -----
    Pulses of the length D T, D = I / I_full, raise the current of an inductive coil along a
    straight line and let it fall along another: a triangle of mean zero whose height goes with
    D (1 − D). It has all multiples of the frequency; at 512 Hz the fifth of 100 Hz shows at 12 Hz.
    """
    duty = np.clip(current / instruments.full_current, 0.0, 1.0)
    height = 4.0 * instruments.dither * duty * (1.0 - duty)
    passed = np.mod(instruments.dither_frequency * time + phase, 1.0)
    rising = 2.0 * passed / np.maximum(duty, 1e-9) - 1.0
    falling = 1.0 - 2.0 * (passed - duty) / np.maximum(1.0 - duty, 1e-9)
    return np.asarray(height * np.where(passed < duty, rising, falling))


def read_current(
    time: Array,
    plus: Array,
    minus: Array,
    instants: Array,
    instruments: Instruments,
    generator: Generator,
) -> Array:
    """The ammeter around both leads. [A]

    Parameters
    ----------
    time, plus, minus : (n,) arrays
        Even grid [s] and currents of both channels on it, magnitudes. [A]
    instants : (m,) array
        When it is read. [s]

    Notes
    -----
    With i = |I₊ + ripple| + |I₋ + ripple| the meter shows y = √(p + floor²), T p' + p = i², and
    p = i² where the averaging time T is 0. The reading is (1 + gain error) y + zero error + noise.
    """
    phase = float(generator.random())
    noise = instruments.current_noise * generator.standard_normal(instants.size)
    if instruments.averaging_time and time.size > 1:
        fine = np.linspace(time[0], time[-1], (time.size - 1) * OVERSAMPLING + 1)
        square = _followed(_sum(time, plus, minus, fine, phase, instruments), fine, instruments)
        mean = np.sqrt(np.interp(instants, fine, square))
    else:
        mean = _sum(time, plus, minus, instants, phase, instruments)
    reading = np.hypot(mean, instruments.current_floor)
    reading = (1.0 + instruments.current_gain_error) * reading + instruments.current_zero + noise
    if instruments.current_resolution:
        return rounded(reading, instruments.current_resolution)
    return np.asarray(reading)


def _sum(
    time: Array, plus: Array, minus: Array, at: Array, phase: float, instruments: Instruments
) -> Array:
    """|I₊| + |I₋| with the ripple of both. [A]"""
    total = np.zeros(at.size)
    for channel in (plus, minus):
        mean = interpolated(at, time, channel)
        ripple = dither_ripple(at, mean, phase, instruments) if instruments.dither else 0.0
        total += np.abs(mean + ripple)
    return total


def _followed(current: Array, fine: Array, instruments: Instruments) -> Array:
    """Mean of the square with an exponential memory, exact for a square that is held."""
    from scipy.signal import lfilter

    keep = float(np.exp(-(fine[1] - fine[0]) / instruments.averaging_time))
    square = current**2
    followed, _ = lfilter([1.0 - keep], [1.0, -keep], square, zi=[keep * square[0]])
    return np.asarray(followed)


def read_counts(
    position: Array, counts_per_turn: float, instruments: Instruments, generator: Generator
) -> Array:
    """The encoder's counter, 0 at the first sample. [count]

    Parameters
    ----------
    position : (n,) array
        Angle of the shaft at the instants sampled. [rad]
    counts_per_turn : float
        Counts in a turn of the shaft.

    Notes
    -----
    The counter shows how many edges were passed. Where between two edges the shaft stands at first
    is chance, so that on average the steps are no error. A counter of b bits counts from −2ᵇ⁻¹ to
    2ᵇ⁻¹ − 1 and begins anew.
    """
    counts = position * (counts_per_turn / (2.0 * np.pi))
    first = float(generator.random())
    if instruments.encoder_step:
        step = float(instruments.encoder_step)
        counts = step * (np.floor(counts / step + first) - np.floor(counts[:1] / step + first))
    if instruments.counter_bits:
        half = 2.0 ** (instruments.counter_bits - 1)
        counts = np.mod(counts + half, 2.0 * half) - half
    return np.asarray(counts)


def read_transducer(signal: Array, instruments: Instruments, generator: Generator) -> Array:
    """Any other signal: itself and white noise in proportion to its largest magnitude."""
    noise = generator.standard_normal(signal.size)
    return np.asarray(signal + instruments.transducer_noise * np.abs(signal).max() * noise)


def interpolated(instants: Array, time: Array, signal: Array) -> Array:
    """A signal of the grid at other instants, on straight lines; on the grid itself, its samples.

    The drive is marched on the grid, so what lies between is not known better. At an instant that
    strays by a hundredth of a sample the line is off by 4 % of what it is half way between two.
    """
    if instants is time or np.array_equal(instants, time):
        return signal
    return np.interp(instants, time, signal)
