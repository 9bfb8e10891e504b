"""The march with sensitivities: every state carried with its derivatives by the parameters."""

import numpy as np
from numpy.typing import NDArray

from swashplate.physics.component import component
from swashplate.physics.control_card import interpolated_partials, steady_partials
from swashplate.simulation.card_tangent import channel_tangent
from swashplate.simulation.chain import moment_squared
from swashplate.simulation.compilation import kernel
from swashplate.simulation.constants import Channel, Delay, Pump
from swashplate.simulation.march import samples_around
from swashplate.simulation.tangent import (
    N_CHANNEL,
    N_PUMP,
    TAU,
    limits_by_parameters,
    pump_partials,
    speed_tangent,
)

Array = NDArray[np.float64]
Flags = NDArray[np.uint8]


@component
def advance(
    by_pressure: float, by_current: float, direct: Array, d_current: Array, d_pressure: Array
) -> None:
    """Carry the derivatives of δP one step on."""
    for k in range(N_PUMP):
        d_pressure[k] = by_pressure * d_pressure[k] + direct[k]
    for k in range(d_current.size):
        d_pressure[N_PUMP + k] = by_pressure * d_pressure[N_PUMP + k] + by_current * d_current[k]


@kernel
def march_drive_sensitivities(
    command: Array,
    before: float,
    delay: Delay,
    plus: Channel,
    minus: Channel,
    pump: Pump,
    step: float,
    start: tuple[float, float, float],
    d_plus: Array,
    d_minus: Array,
    d_pressure: Array,
    current_plus: Array,
    current_minus: Array,
    pressure: Array,
    speed: Array,
    rate_limited: Flags,
    d_current_plus: Array,
    d_current_minus: Array,
    d_speed: Array,
) -> float:
    """March card and pump with the derivatives of all their parameters.

    Parameters
    ----------
    command ... start :
        As in `march_drive`.
    d_plus, d_minus : (N_CHANNEL + 1,) arrays
        Derivatives of the channels' currents at the start; used up.
    d_pressure : (N_ALL,) array
        Derivatives of δP at the start; used up.
    current_plus, current_minus, pressure, speed, rate_limited : (n,) arrays
        Outputs as in the plain march, to the last bit. [A, A, Pa, rad/s]
    d_current_plus, d_current_minus : (n, N_CHANNEL + 1) arrays
        Derivatives of each channel's current by its own parameters and τ.
    d_speed : (n, N_ALL) array
        Derivatives of the speed, columns as numbered in `swashplate.simulation.tangent`.

    Returns
    -------
    float
        Largest sin²φ met, see `march_drive`.
    """
    state_p, previous_p, output_p = start[0], start[0], start[0]
    state_m, previous_m, output_m = start[1], start[1], start[1]
    d_state_p, d_previous_p, d_output_p = d_plus.copy(), d_plus.copy(), d_plus
    d_state_m, d_previous_m, d_output_m = d_minus.copy(), d_minus.copy(), d_minus
    direct_p, direct_m = np.zeros(N_CHANNEL + 1), np.zeros(N_CHANNEL + 1)
    d_current = np.zeros(2 * N_CHANNEL + 1)
    direct = np.zeros(2 * N_PUMP)
    limits_by = limits_by_parameters(pump)
    p = start[2]
    worst = 0.0
    for n in range(command.size):
        newer, older, newest, middle, oldest = samples_around(command, n, delay, before)
        delayed, _, _, slope = interpolated_partials(newer, older, delay.fraction)
        output_p, following, limited_p = channel_tangent(
            1.0,
            delayed,
            slope,
            newest,
            middle,
            oldest,
            delay,
            state_p,
            previous_p,
            output_p,
            plus,
            step,
            direct_p,
            d_state_p,
            d_previous_p,
            d_output_p,
        )
        previous_p, state_p = state_p, following
        output_m, following, limited_m = channel_tangent(
            -1.0,
            delayed,
            slope,
            newest,
            middle,
            oldest,
            delay,
            state_m,
            previous_m,
            output_m,
            minus,
            step,
            direct_m,
            d_state_m,
            d_previous_m,
            d_output_m,
        )
        previous_m, state_m = state_m, following
        for k in range(N_CHANNEL):
            d_current[k] = d_output_p[k]
            d_current[N_CHANNEL + k] = -d_output_m[k]
        d_current[2 * N_CHANNEL] = d_output_p[TAU] - d_output_m[TAU]
        current_plus[n] = output_p
        current_minus[n] = output_m
        pressure[n] = p
        rate_limited[n] = 1 if limited_p or limited_m else 0
        d_current_plus[n] = d_output_p
        d_current_minus[n] = d_output_m
        current = output_p - output_m
        worst = max(worst, moment_squared(current, pump))
        following, by_p, by_i, opening, opening_by_p, opening_by_i = pump_partials(
            p, current, pump, limits_by, step, direct, 0, N_PUMP, 1
        )
        speed[n] = speed_tangent(
            p,
            opening,
            opening_by_p,
            opening_by_i,
            pump,
            direct[N_PUMP:],
            d_pressure,
            d_current,
            d_speed[n],
        )
        advance(by_p, by_i, direct, d_current, d_pressure)
        p = following
    return worst


@kernel
def march_pump_sensitivities(
    current: Array,
    pump: Pump,
    step: float,
    start: float,
    d_pressure: Array,
    pressure: Array,
    speed: Array,
    d_speed: Array,
) -> float:
    """March the pump alone with the derivatives of its N_PUMP parameters; see above."""
    none = np.zeros(0)
    direct = np.zeros(2 * N_PUMP)
    limits_by = limits_by_parameters(pump)
    p = start
    worst = 0.0
    for n in range(current.size):
        pressure[n] = p
        worst = max(worst, moment_squared(current[n], pump))
        following, by_p, by_i, opening, opening_by_p, opening_by_i = pump_partials(
            p, current[n], pump, limits_by, step, direct, 0, N_PUMP, 1
        )
        speed[n] = speed_tangent(
            p,
            opening,
            opening_by_p,
            opening_by_i,
            pump,
            direct[N_PUMP:],
            d_pressure,
            none,
            d_speed[n],
        )
        advance(by_p, by_i, direct, none, d_pressure)
        p = following
    return worst


@component
def level_tangent(direction: float, voltage: float, channel: Channel, d_current: Array) -> None:
    """Derivatives of the current that a channel settles at."""
    v = direction * voltage
    share = 1.0 if v > channel.V_dz else 0.0
    by = steady_partials(v, share, channel.V_dz, channel.J, channel.G1, channel.G2, channel.G3)
    d_current[:] = 0.0
    for k in range(5):
        d_current[k] = by[3 + k]


@component
def fill_fixed_point(
    pressure: float, current: float, pump: Pump, step: float, d_pressure: Array
) -> tuple[float, float]:
    """Derivatives of a steady δP by the pump's parameters; returns those of one step."""
    direct = np.zeros(2 * N_PUMP)
    limits_by = limits_by_parameters(pump)
    _, by_p, by_i, _, _, _ = pump_partials(
        pressure, current, pump, limits_by, step, direct, 0, N_PUMP, 1
    )
    for k in range(N_PUMP):
        d_pressure[k] = direct[k] / (1.0 - by_p)
    return by_p, by_i


@kernel
def steady_tangent(
    voltage: float,
    plus: Channel,
    minus: Channel,
    pump: Pump,
    step: float,
    start: tuple[float, float, float],
    d_plus: Array,
    d_minus: Array,
    d_pressure: Array,
) -> None:
    """Derivatives of a steady start: the fixed point of one step's derivatives.

    Arguments as in `march_drive_sensitivities`; the arrays are filled.
    """
    level_tangent(1.0, voltage, plus, d_plus)
    level_tangent(-1.0, voltage, minus, d_minus)
    by_p, by_i = fill_fixed_point(start[2], start[0] - start[1], pump, step, d_pressure)
    for k in range(N_CHANNEL):
        d_pressure[N_PUMP + k] = by_i * d_plus[k] / (1.0 - by_p)
        d_pressure[N_PUMP + N_CHANNEL + k] = -by_i * d_minus[k] / (1.0 - by_p)


@kernel
def steady_pump_tangent(
    current: float, pump: Pump, step: float, start: float, d_pressure: Array
) -> None:
    """The same for the pump alone."""
    fill_fixed_point(start, current, pump, step, d_pressure)


@kernel
def integrate_rows(rate: Array, step: float, integral: Array) -> None:
    """Trapezoidal integral of each column, from the first row that the caller has set."""
    for n in range(1, rate.shape[0]):
        for k in range(rate.shape[1]):
            integral[n, k] = integral[n - 1, k] + 0.5 * step * (rate[n - 1, k] + rate[n, k])
