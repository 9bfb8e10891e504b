"""The plain march: current, pressure and from them everything else, sample by sample."""

import numpy as np
from numpy.typing import NDArray

from swashplate.physics.component import component
from swashplate.physics.control_card import interpolated
from swashplate.physics.spool import orifice_opening, stopped_spool
from swashplate.physics.swash import swash_angle, swash_tangent
from swashplate.simulation.chain import (
    channel_sample,
    channel_steady,
    moment_squared,
    pump_force,
    pump_speed,
    pump_spool,
    pump_step,
)
from swashplate.simulation.compilation import kernel
from swashplate.simulation.constants import Channel, Delay, Pump
from swashplate.simulation.limits import (
    CURRENT_RATE,
    DEAD_ZONE,
    ORIFICE,
    RELIEF,
    SPOOL,
    SWASH_STOP,
)

Array = NDArray[np.float64]
Flags = NDArray[np.uint8]


@component
def sample_at(command: Array, index: int, before: float) -> float:
    """Command at a sample, or what it was before the record began. [V]"""
    return command[index] if index >= 0 else before


@component
def samples_around(
    command: Array, n: int, delay: Delay, before: float
) -> tuple[float, float, float, float, float]:
    """Samples that a card looks at: two around t - τ, three around the share's interval. [V]"""
    at = n - delay.whole
    end = n - delay.share_whole
    return (
        sample_at(command, at, before),
        sample_at(command, at - 1, before),
        sample_at(command, end, before),
        sample_at(command, end - 1, before),
        sample_at(command, end - 2, before),
    )


@kernel
def march_drive(
    command: Array,
    before: float,
    delay: Delay,
    plus: Channel,
    minus: Channel,
    pump: Pump,
    step: float,
    start: tuple[float, float, float],
    current_plus: Array,
    current_minus: Array,
    pressure: Array,
    rate_limited: Flags,
) -> float:
    """March card and pump over a command on the grid.

    Parameters
    ----------
    command : (n,) array
        Command at the samples. [V]
    before : float
        Command before the first sample, 0 at rest. [V]
    delay, plus, minus, pump : Delay, Channel, Channel, Pump
        The drive.
    step : float
        h. [s]
    start : (float, float, float)
        Current of each channel [A] and stroking pressure [Pa] at the first sample.
    current_plus, current_minus, pressure, rate_limited : (n,) arrays
        Outputs: channel currents [A], δP [Pa], 1 where a rate limit sets a current.

    Returns
    -------
    float
        Largest sin²φ met. From 1 on the outputs mean nothing, and the caller must say so.
    """
    state_p, previous_p, output_p = start[0], start[0], start[0]
    state_m, previous_m, output_m = start[1], start[1], start[1]
    p = start[2]
    worst = 0.0
    for n in range(command.size):
        newer, older, newest, middle, oldest = samples_around(command, n, delay, before)
        delayed = interpolated(newer, older, delay.fraction)
        f = delay.share_fraction
        steady_p = channel_steady(1.0, delayed, newest, middle, oldest, f, plus)
        steady_m = channel_steady(-1.0, delayed, newest, middle, oldest, f, minus)
        output_p, next_p, limited_p = channel_sample(
            steady_p, state_p, previous_p, output_p, plus, step
        )
        output_m, next_m, limited_m = channel_sample(
            steady_m, state_m, previous_m, output_m, minus, step
        )
        previous_p, state_p = state_p, next_p
        previous_m, state_m = state_m, next_m
        current_plus[n] = output_p
        current_minus[n] = output_m
        pressure[n] = p
        rate_limited[n] = 1 if limited_p or limited_m else 0
        current = output_p - output_m
        worst = max(worst, moment_squared(current, pump))
        p = pump_step(p, current, pump, step)
    return worst


@kernel
def march_pump(current: Array, pump: Pump, step: float, start: float, pressure: Array) -> float:
    """March the pump alone over a signed current; arguments as in `march_drive`."""
    p = start
    worst = 0.0
    for n in range(current.size):
        pressure[n] = p
        worst = max(worst, moment_squared(current[n], pump))
        p = pump_step(p, current[n], pump, step)
    return worst


@kernel
def observe_speed(current: Array, pressure: Array, pump: Pump, speed: Array) -> None:
    """Shaft speed from current and pressure, each sample for itself. [rad/s]"""
    for n in range(pressure.size):
        speed[n] = pump_speed(pressure[n], current[n], pump)


@kernel
def observe_inside(
    current: Array,
    pressure: Array,
    pump: Pump,
    force: Array,
    spool: Array,
    opening: Array,
    angle: Array,
) -> None:
    """Force [N], spool displacement [m], orifice opening [m], swash angle [rad] at each sample."""
    for n in range(pressure.size):
        force[n] = pump_force(current[n], pump)
        free = pump_spool(force[n], pressure[n], pump)
        spool[n] = stopped_spool(free, pump.Z14)
        opening[n] = orifice_opening(free, pump.Z14, pump.Z16_plus, pump.Z16_minus)
        tangent = swash_tangent(pressure[n], pump.Z1, pump.Z2)
        angle[n] = swash_angle(tangent, pump.Z13_plus, pump.Z13_minus, pump.steep)


@kernel
def observe_limits(
    current: Array, pressure: Array, rate_limited: Flags, pump: Pump, flags: Flags
) -> None:
    """Which limits act at each sample, as the bits of `swashplate.simulation.limits.Limit`."""
    for n in range(pressure.size):
        p = pressure[n]
        free = pump_spool(pump_force(current[n], pump), p, pump)
        orifice = pump.Z16_plus if free > 0.0 else pump.Z16_minus
        # against a stop nothing accelerates, however wide the spool is open
        held = (p >= pump.upper and free > 0.0) or (p <= pump.lower and free < 0.0)
        bits = CURRENT_RATE if rate_limited[n] else 0
        bits |= DEAD_ZONE if abs(current[n]) <= pump.Z17 else 0
        bits |= ORIFICE if min(abs(free), pump.Z14) > orifice and not held else 0
        bits |= SPOOL if abs(free) > pump.Z14 else 0
        bits |= SWASH_STOP if p >= pump.upper_stop or p <= pump.lower_stop else 0
        bits |= (
            RELIEF
            if (p >= pump.upper < pump.upper_stop) or (p <= pump.lower > pump.lower_stop)
            else 0
        )
        flags[n] = bits


@kernel
def integrate(rate: Array, step: float, start: float, integral: Array) -> None:
    """Trapezoidal integral of a rate, from `start`."""
    total = start
    integral[0] = total
    for n in range(1, rate.size):
        total = total + 0.5 * step * (rate[n - 1] + rate[n])
        integral[n] = total
