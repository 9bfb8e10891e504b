"""The same chain with its derivatives: exact sensitivities marched beside the states.

Columns are numbered as the parameters are stored: the pump's in the order of
`PUMP_PARAMETERS`, then the plus channel's in the order of `CHANNEL_PARAMETERS`, the minus
channel's, and the delay τ last.
"""

import numpy as np
from numpy.typing import NDArray

from swashplate.physics.card_dynamics import (
    decay_partials,
    filter_partials,
    limiter_partials,
    rate_limit_active,
)
from swashplate.physics.component import component
from swashplate.physics.control_card import jump_share_partials, steady_partials
from swashplate.physics.motor import load_leakage_partials, shaft_speed_partials
from swashplate.physics.solenoid import solenoid_partials
from swashplate.physics.spool import arm_sine_partials, opening_partials, spool_partials
from swashplate.physics.stroker import (
    leaky_step_partials,
    pressure_limit_partials,
    pressure_rate_partials,
    tight_step_partials,
)
from swashplate.physics.swash import (
    swash_angle_partials,
    swash_rate_partials,
    swash_tangent_partials,
)
from swashplate.simulation.chain import plate_motion
from swashplate.simulation.constants import (
    CHANNEL_PARAMETERS,
    PUMP_PARAMETERS,
    Channel,
    Delay,
    Pump,
)

Array = NDArray[np.float64]
ForcePartials = tuple[float, float, float, float, float, float, float, float, float, float, float]
ArmPartials = tuple[float, float, float, float, float]
SpoolPartials = tuple[float, float, float, float, float, float]
OpeningPartials = tuple[float, float, float, float, float]

N_PUMP = len(PUMP_PARAMETERS)
N_CHANNEL = len(CHANNEL_PARAMETERS)
TAU = N_CHANNEL
"""Column of the delay within a channel's N_CHANNEL + 1 columns."""
N_ALL = N_PUMP + 2 * N_CHANNEL + 1

(Z1, Z2, Z3, Z4, Z5, Z6, Z7, Z8, Z9, Z10, Z11, Z12) = range(12)
(Z13_PLUS, Z13_MINUS, Z14, Z15, Z16_PLUS, Z16_MINUS, Z17, Z18) = range(12, 20)
(Z19_PLUS, Z19_MINUS, Z20_PLUS, Z20_MINUS) = range(20, 24)
(Z21_PLUS, Z21_MINUS, Z22_PLUS, Z22_MINUS) = range(24, 28)
(V_DZ, J, G1, G2, G3, ZETA, OMEGA, C, LIM1, LIM2, I_T1, I_T2, A) = range(N_CHANNEL)


@component
def channel_tangent(
    direction: float,
    command: float,
    slope: float,
    newest: float,
    middle: float,
    oldest: float,
    delay: Delay,
    state: float,
    previous: float,
    output: float,
    channel: Channel,
    step: float,
    d_state: Array,
    d_previous: Array,
    d_output: Array,
) -> tuple[float, float, bool]:
    """One sample of a channel with its derivatives.

    Parameters
    ----------
    command, slope : float
        Delayed command [V] and its derivative by the delay in samples.
    newest, middle, oldest : float
        Command around the interval of the jump's share. [V]
    d_state, d_previous, d_output : (N_CHANNEL + 1,) arrays
        Derivatives of I*, the I* before it and I; advanced in place with the states.

    Returns
    -------
    output, following : float
        I at this sample, I* at the next. [A]
    limited : bool
        Whether a rate limit sets the output.
    """
    share, s_fraction, s_threshold = jump_share_partials(
        direction * newest,
        direction * middle,
        direction * oldest,
        delay.share_fraction,
        channel.V_dz,
    )
    steady, by_command, by_share, by_V_dz, by_J, by_G1, by_G2, by_G3 = steady_partials(
        direction * command, share, channel.V_dz, channel.J, channel.G1, channel.G2, channel.G3
    )
    current, by_target, by_output, by_lim1, by_lim2, by_I_t1, by_I_t2, by_decay = limiter_partials(
        state,
        output,
        steady,
        channel.lim1,
        channel.lim2,
        channel.I_t1,
        channel.I_t2,
        channel.decay,
        step,
    )
    limited = rate_limit_active(current, state, output, channel.I_t2)
    _, decay_by_a = decay_partials(channel.a, step)
    for k in range(N_CHANNEL + 1):
        d_output[k] = by_target * d_state[k] + by_output * d_output[k]
    d_output[LIM1] += by_lim1
    d_output[LIM2] += by_lim2
    d_output[I_T1] += by_I_t1
    d_output[I_T2] += by_I_t2
    d_output[A] += by_decay * decay_by_a

    following, f_state, f_previous, f_steady, f_zeta, f_omega, f_C = filter_partials(
        state, previous, steady, channel.zeta, channel.omega, channel.C, step, channel.literal
    )
    for k in range(N_CHANNEL + 1):
        ahead = f_state * d_state[k] + f_previous * d_previous[k]
        d_previous[k] = d_state[k]
        d_state[k] = ahead
    d_state[V_DZ] += f_steady * (by_V_dz + by_share * s_threshold)
    d_state[J] += f_steady * by_J
    d_state[G1] += f_steady * by_G1
    d_state[G2] += f_steady * by_G2
    d_state[G3] += f_steady * by_G3
    d_state[ZETA] += f_zeta
    d_state[OMEGA] += f_omega
    d_state[C] += f_C
    by_samples = by_command * direction * slope + by_share * s_fraction * delay.share_moves
    d_state[TAU] += f_steady * by_samples / step
    return current, following, limited


@component
def write_direct(
    weight: float,
    force_by: ForcePartials,
    arm_by: ArmPartials,
    spool_by: SpoolPartials,
    opening_by: OpeningPartials,
    into: Array,
) -> None:
    """Direct derivatives of the opening by the parameters that shape it, times a weight.

    The tuples are what the components' twins return: the value, then the derivatives.
    """
    w_x = weight * opening_by[1]
    w_f = w_x * spool_by[1]
    w_s = w_x * spool_by[2]
    into[Z1] = w_s * arm_by[2]
    into[Z2] = w_s * arm_by[3]
    into[Z3] = w_s * arm_by[4]
    into[Z4] = w_x * spool_by[3]
    into[Z5] = w_x * spool_by[4]
    into[Z18] = w_x * spool_by[5]
    into[Z14] = weight * opening_by[2]
    into[Z16_PLUS] = weight * opening_by[3]
    into[Z16_MINUS] = weight * opening_by[4]
    into[Z17] = w_f * force_by[2]
    into[Z19_PLUS] = w_f * force_by[3]
    into[Z19_MINUS] = w_f * force_by[4]
    into[Z20_PLUS] = w_f * force_by[5]
    into[Z20_MINUS] = w_f * force_by[6]
    into[Z21_PLUS] = w_f * force_by[7]
    into[Z21_MINUS] = w_f * force_by[8]
    into[Z22_PLUS] = w_f * force_by[9]
    into[Z22_MINUS] = w_f * force_by[10]


@component
def pump_tangent(
    pressure: float, current: float, pump: Pump, step: float, opening_by: Array, next_by: Array
) -> tuple[float, float, float, float, float, float]:
    """Pressure one step later with its derivatives.

    Parameters
    ----------
    opening_by, next_by : (N_PUMP,) arrays
        Filled with the direct derivatives of opening (only where Z12 makes the speed depend on
        it) and next pressure by each parameter; columns that no step sets must come as zeros.

    Returns
    -------
    following : float
        δP one step later. [Pa]
    by_pressure, by_current : float
        Its derivatives by δP and current at this sample.
    opening : float
        x_eff. [m]
    opening_by_pressure, opening_by_current : float
        Derivatives of x_eff.
    """
    force_by = solenoid_partials(
        current,
        pump.Z17,
        pump.Z19_plus,
        pump.Z19_minus,
        pump.Z20_plus,
        pump.Z20_minus,
        pump.Z21_plus,
        pump.Z21_minus,
        pump.Z22_plus,
        pump.Z22_minus,
    )
    arm_by = arm_sine_partials(pressure, pump.Z1, pump.Z2, pump.Z3)
    spool_by = spool_partials(force_by[0], arm_by[0], pump.Z4, pump.Z5, pump.Z18)
    orifice_by = opening_partials(spool_by[0], pump.Z14, pump.Z16_plus, pump.Z16_minus)
    opening = orifice_by[0]
    y_p = orifice_by[1] * spool_by[2] * arm_by[1]
    y_i = orifice_by[1] * spool_by[1] * force_by[1]
    if pump.loaded is not None:
        opening_by[:] = 0.0
        write_direct(1.0, force_by, arm_by, spool_by, orifice_by, opening_by)

    motion = plate_motion(pressure, pump)
    if pump.leaky is None:
        free, q_p, q_y, q_6, q_7, q_8, q_9 = tight_step_partials(
            pressure, opening, motion, pump.Z8, pump.Z9, step, pump.symmetric
        )
    else:
        free, q_p, q_y, q_6, q_7, q_8, q_9 = leaky_step_partials(
            pressure, opening, motion, pump.Z7, pump.Z8, pump.Z9, step, pump.symmetric
        )
    following = min(max(free, pump.lower), pump.upper)
    if free >= pump.upper:
        next_by[:] = 0.0
        _, next_by[Z1], next_by[Z2], next_by[Z13_PLUS], next_by[Z15] = pressure_limit_partials(
            pump.Z1, pump.Z2, pump.Z13_plus, pump.Z15, 1.0
        )
        return following, 0.0, 0.0, opening, y_p, y_i
    if free <= pump.lower:
        next_by[:] = 0.0
        _, next_by[Z1], next_by[Z2], next_by[Z13_MINUS], next_by[Z15] = pressure_limit_partials(
            pump.Z1, pump.Z2, pump.Z13_minus, pump.Z15, -1.0
        )
        return following, 0.0, 0.0, opening, y_p, y_i
    write_direct(q_y, force_by, arm_by, spool_by, orifice_by, next_by)
    at_stop = pressure >= pump.upper_stop or pressure <= pump.lower_stop
    next_by[Z6] = 0.0 if at_stop else q_6
    next_by[Z7] = q_7
    next_by[Z8] = q_8
    next_by[Z9] = q_9
    next_by[Z13_PLUS] = 0.0
    next_by[Z13_MINUS] = 0.0
    next_by[Z15] = 0.0
    return following, q_p + q_y * y_p, q_y * y_i, opening, y_p, y_i


@component
def speed_tangent(
    pressure: float,
    opening: float,
    opening_by_pressure: float,
    opening_by_current: float,
    pump: Pump,
    opening_by: Array,
    d_pressure: Array,
    d_current: Array,
    d_speed: Array,
) -> float:
    """Shaft speed with its total derivatives.

    Parameters
    ----------
    opening_by : (N_PUMP,) array
        Direct derivatives of the opening, from `pump_tangent`.
    d_pressure : (N_PUMP + m,) array
        Total derivatives of δP by the pump's parameters and m others that act through the current.
    d_current : (m,) array
        Derivatives of the signed current by those m.
    d_speed : (N_PUMP + m,) array
        Filled with the derivatives of the speed.
    """
    tangent, t_p, t_1, t_2 = swash_tangent_partials(pressure, pump.Z1, pump.Z2)
    angle, a_t, a_13p, a_13m = swash_angle_partials(
        tangent, pump.Z13_plus, pump.Z13_minus, pump.steep
    )
    rate, r_p, r_y, r_6, r_7, r_8, r_9 = pressure_rate_partials(
        pressure, opening, pump.Z6, pump.Z7, pump.Z8, pump.Z9, pump.symmetric
    )
    held = pressure >= pump.upper or pressure <= pump.lower
    moves = 0.0 if held else 1.0
    omega, o_t, o_r, o_1 = swash_rate_partials(tangent, rate, pump.Z1)
    leakage, l_t, l_o, l_12 = load_leakage_partials(tangent, moves * omega, pump.Z12)
    if pump.loaded is None:
        leakage = 0.0
    speed, w_a, w_l, w_10, w_11 = shaft_speed_partials(angle, leakage, pump.Z10, pump.Z11)

    by_tangent = w_a * a_t
    by_rate = 0.0
    if pump.loaded is not None:
        by_tangent += w_l * (l_t + moves * l_o * o_t)
        by_rate = moves * w_l * l_o * o_r
    by_pressure = by_tangent * t_p + by_rate * (r_p + r_y * opening_by_pressure)
    for k in range(d_speed.size):
        d_speed[k] = by_pressure * d_pressure[k]
    if pump.loaded is not None:
        for k in range(N_PUMP):
            d_speed[k] += by_rate * r_y * opening_by[k]
        for k in range(d_current.size):
            d_speed[N_PUMP + k] += by_rate * r_y * opening_by_current * d_current[k]
        d_speed[Z1] += moves * w_l * l_o * o_1
        d_speed[Z6] += by_rate * r_6
        d_speed[Z7] += by_rate * r_7
        d_speed[Z8] += by_rate * r_8
        d_speed[Z9] += by_rate * r_9
    d_speed[Z1] += by_tangent * t_1
    d_speed[Z2] += by_tangent * t_2
    d_speed[Z10] += w_10
    d_speed[Z11] += w_11
    d_speed[Z12] += w_l * l_12
    d_speed[Z13_PLUS] += w_a * a_13p
    d_speed[Z13_MINUS] += w_a * a_13m
    return speed
