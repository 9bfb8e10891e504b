"""Sine sweeps: the drive marched over whole cycles of each frequency until it repeats itself."""

from __future__ import annotations

from math import ceil
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.errors import DomainError, InputError
from swashplate.linear.frequency_response import FrequencyResponse
from swashplate.linear.slopes import PumpSlopes, pump_slopes
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.physics.card_dynamics import COULOMB_WIDTH
from swashplate.simulation.build import build, build_pump
from swashplate.simulation.constants import Pump
from swashplate.simulation.march import march_drive, march_pump, observe_inside, observe_speed
from swashplate.simulation.record import FASTEST, SOURCE_RATE
from swashplate.simulation.run import check_domain, rest_pressure
from swashplate.simulation.steady import steady_pump_start, steady_start

Array = NDArray[np.float64]
SweptInput = Literal["voltage", "current"]
SweptOutput = Literal[
    "shaft_speed",
    "swash_angle",
    "stroker_pressure",
    "orifice_opening",
    "spool_position",
    "solenoid_force",
    "current",
]

SWEPT_OUTPUTS: tuple[SweptOutput, ...] = get_args(SweptOutput)

SLOWEST_CYCLE = 1e-3
"""Lowest frequency. [Hz]"""
FEWEST_STEPS, MOST_STEPS = 8, 1_000_000
"""Steps of a cycle, which bound the frequencies from both sides."""
MOST_BLOCKS = 96
"""Blocks of cycles after which an answer that still changes is given up."""
STILL = 1e-12
"""Answers below this part of the output's size are none."""


class Cycle(NamedTuple):
    """The last cycle of a march."""

    current: Array
    pressure: Array


def frequency_response(
    parameters: ParameterSet,
    frequencies: ArrayLike,
    amplitudes: ArrayLike,
    *,
    bias: float = 0.0,
    input: SweptInput = "voltage",
    output: SweptOutput = "shaft_speed",
    rate: float = SOURCE_RATE,
    tolerance: float = 1e-4,
) -> FrequencyResponse:
    """Describing function by sine sweep; see `Drive.frequency_response`."""
    f, a = _checked(frequencies, "frequencies"), _checked(amplitudes, "amplitudes")
    if not SOURCE_RATE <= rate <= FASTEST:
        raise InputError(
            f"The rate is {rate:g} Hz, but must be between {SOURCE_RATE:g} and {FASTEST:g} Hz."
        )
    lowest, highest = max(SLOWEST_CYCLE, rate / MOST_STEPS), rate / FEWEST_STEPS
    if (np.diff(f) <= 0.0).any() or f[0] < lowest or f[-1] > highest:
        raise InputError(
            f"The frequencies must rise from {lowest:g} Hz or above to at most {highest:g} Hz, an "
            "eighth of the rate."
        )
    if not 0.0 < tolerance < 1.0:
        raise InputError(f"The tolerance is {tolerance:g}, but must be between 0 and 1.")
    if input not in ("voltage", "current"):
        raise InputError(f"The input is '{input}'; it is 'voltage' or 'current'.")
    if output not in SWEPT_OUTPUTS or output == input:
        raise InputError(
            f"'{output}' is no output of a sweep of the {input}; there are "
            f"{', '.join(name for name in SWEPT_OUTPUTS if name != input)}."
        )
    largest = abs(bias) + float(a.max())
    if not np.isfinite(bias) or (input == "voltage" and largest > FULL_VOLTAGE):
        raise InputError(
            f"Bias and amplitude reach {largest:g} V, but the card takes ±10 V."
            if np.isfinite(bias)
            else f"The bias is {bias}, but must be a finite number."
        )
    shape = (a.size, f.size)
    ratio = np.zeros(shape, dtype=np.complex128)
    distortion, mean, cycles = np.zeros(shape), np.zeros(shape), np.zeros(shape, dtype=np.int64)
    block = 3.0 * slowest_lag(parameters)
    for j, frequency in enumerate(f.tolist()):
        steps = ceil(rate / frequency * (1.0 - 1e-12))
        wave = np.sin(2.0 * np.pi * np.arange(steps) / steps)
        for i, amplitude in enumerate(a.tolist()):
            command = bias + amplitude * wave
            found = _settled(parameters, command, bias, frequency, block, input, output, tolerance)
            ratio[i, j], distortion[i, j], mean[i, j], cycles[i, j] = found
            ratio[i, j] /= amplitude
    if not ratio.any():
        raise DomainError(
            f"{parameters.name}: nothing moves about {bias:g} {'V' if input == 'voltage' else 'A'} "
            f"with amplitudes up to {a.max():g}: all stay in a dead zone or at a stop; take larger "
            "ones or another bias."
        )
    return FrequencyResponse(
        parameters.name, input, output, float(bias), f, a, ratio, distortion, mean, cycles
    )


def slowest_lag(parameters: ParameterSet) -> float:
    """Time within which a drive at rest forgets most: pump's and card's lags and the delay. [s]"""
    pump, numbers = build_pump(parameters), parameters.numbers
    found = pump_slopes(rest_pressure(pump), 0.0, 0.0, pump, 1.0 / SOURCE_RATE)
    total = numbers["tau"] - 1.0 / PumpSlopes._make(found).rate_by_pressure
    cards = []
    for side in ("plus", "minus"):
        zeta, omega, C = (numbers[f"{name}_{side}"] for name in ("zeta", "omega", "C"))
        cards.append((2.0 * zeta * omega + C / COULOMB_WIDTH) / omega**2)
    return float(total + max(cards))


def _settled(
    parameters: ParameterSet,
    command: Array,
    bias: float,
    frequency: float,
    block: float,
    input: SweptInput,
    output: SweptOutput,
    tolerance: float,
) -> tuple[complex, float, float, int]:
    """First harmonic as a multiple of the sine, distortion, mean and cycles.

    The cycles come in blocks that last long enough for most of a transient to die out. The last
    cycles of the last two blocks must agree, or else the march starts again, twice as long.
    """
    a_block = max(1, ceil(frequency * block))
    blocks = 3
    while True:
        count = blocks * a_block
        before, last = _march(parameters, command, bias, frequency, count, a_block, input)
        pump = build_pump(parameters)
        earlier, _, _ = _harmonic(*_observed(before, pump, output))
        harmonic, distortion, mean = _harmonic(*_observed(last, pump, output))
        if abs(harmonic - earlier) <= tolerance * abs(harmonic):
            return harmonic, distortion, mean, count
        if blocks >= MOST_BLOCKS:
            raise DomainError(
                f"{parameters.name}: at {frequency:g} Hz and an amplitude of "
                f"{command.max() - bias:g} the answer has not settled to {tolerance:g} within "
                f"{count} cycles; allow a larger tolerance, or look at it with a simulation."
            )
        blocks *= 2


def _march(
    parameters: ParameterSet,
    cycle: Array,
    bias: float,
    frequency: float,
    count: int,
    apart: int,
    input: SweptInput,
) -> tuple[Cycle, Cycle]:
    """The last cycle of several, from the steady state at the bias on, and one some cycles before.

    A cycle has a whole number of steps, so that its first harmonic is exact.
    """
    n = cycle.size
    step = 1.0 / (frequency * n)
    whole = np.tile(cycle, count)
    pressure = np.empty_like(whole)
    if input == "voltage":
        delay, plus, minus, pump, step = build(parameters, step)
        current_plus, current_minus = np.empty_like(whole), np.empty_like(whole)
        flags = np.empty(whole.size, dtype=np.uint8)
        start = steady_start(bias, plus, minus, pump)
        worst = march_drive(
            whole,
            bias,
            delay,
            plus,
            minus,
            pump,
            step,
            start,
            current_plus,
            current_minus,
            pressure,
            flags,
        )
        current = current_plus - current_minus
    else:
        pump, current = build_pump(parameters), whole
        worst = march_pump(whole, pump, step, steady_pump_start(bias, pump), pressure)
    check_domain(parameters.name, worst, input)
    ends = whole.size - apart * n, whole.size
    before, last = (Cycle(current[end - n : end], pressure[end - n : end]) for end in ends)
    return before, last


def _observed(cycle: Cycle, pump: Pump, output: SweptOutput) -> tuple[Array, float]:
    """A signal over a cycle, and its natural size, beside which rounding is told from motion."""
    if output == "current":
        return cycle.current, 1.0
    if output == "stroker_pressure":
        return cycle.pressure, 1.0 / pump.Z1
    if output == "shaft_speed":
        speed = np.empty_like(cycle.pressure)
        observe_speed(cycle.current, cycle.pressure, pump, speed)
        return speed, pump.Z10
    force, spool, opening, angle = (np.empty_like(cycle.pressure) for _ in range(4))
    observe_inside(cycle.current, cycle.pressure, pump, force, spool, opening, angle)
    return {
        "solenoid_force": (force, pump.Z4**0.5 / pump.Z5),
        "spool_position": (spool, pump.Z5),
        "orifice_opening": (opening, pump.Z5),
        "swash_angle": (angle, 1.0),
    }[output]


def _harmonic(signal: Array, size: float) -> tuple[complex, float, float]:
    """First harmonic by that of a unit sine, distortion and mean of one whole cycle."""
    n = signal.size
    mean = float(signal.mean())
    turn = np.exp(-2j * np.pi * np.arange(n) / n)
    first = complex(2.0 / n * ((signal - mean) @ turn))
    if abs(first) <= STILL * size:
        return 0j, 0.0, mean
    rest = signal - mean - np.real(first * np.conj(turn))
    distortion = float(np.sqrt(2.0 * np.mean(rest * rest))) / abs(first)
    return 1j * first, distortion, mean


def _checked(values: ArrayLike, what: str) -> Array:
    try:
        data = np.atleast_1d(np.array(values, dtype=np.float64))
    except (TypeError, ValueError):
        raise InputError(f"The {what} must be a sequence of numbers.") from None
    if data.ndim != 1 or data.size == 0 or not (np.isfinite(data) & (data > 0.0)).all():
        raise InputError(f"The {what} must be one or more finite numbers above 0, in one row.")
    return data
