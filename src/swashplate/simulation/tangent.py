"""The same chain with its derivatives: exact sensitivities marched beside the states.

Columns are numbered as the parameters are stored: the pump's in the order of
`PUMP_PARAMETERS`, then the plus channel's in the order of `CHANNEL_PARAMETERS`, the minus
channel's, and the delay τ last.
"""

import numpy as np
from numpy.typing import NDArray

from swashplate.physics.component import component
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
    Pump,
)

Array = NDArray[np.float64]
ForcePartials = tuple[float, float, float, float, float, float, float, float, float, float, float]
ArmPartials = tuple[float, float, float, float, float]
SpoolPartials = tuple[float, float, float, float, float, float]
OpeningPartials = tuple[float, float, float, float, float]
LimitPartials = tuple[float, float, float, float, float, float, float, float]
SpeedPartials = tuple[
    float, float, float, float, float, float, float, float, float, float, float, float
]

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
def write_direct(
    weight: float,
    force_by: ForcePartials,
    arm_by: ArmPartials,
    spool_by: SpoolPartials,
    opening_by: OpeningPartials,
    direct: Array,
    at: int,
    stride: int,
) -> None:
    """Direct derivatives of the opening by the parameters that shape it, times a weight.

    The tuples are what the components' twins return: the value, then the derivatives. Written to
    `direct` from `at` on, `stride` apart.
    """
    w_x = weight * opening_by[1]
    w_f = w_x * spool_by[1]
    w_s = w_x * spool_by[2]
    direct[at + Z1 * stride] = w_s * arm_by[2]
    direct[at + Z2 * stride] = w_s * arm_by[3]
    direct[at + Z3 * stride] = w_s * arm_by[4]
    direct[at + Z4 * stride] = w_x * spool_by[3]
    direct[at + Z5 * stride] = w_x * spool_by[4]
    direct[at + Z18 * stride] = w_x * spool_by[5]
    direct[at + Z14 * stride] = weight * opening_by[2]
    direct[at + Z16_PLUS * stride] = weight * opening_by[3]
    direct[at + Z16_MINUS * stride] = weight * opening_by[4]
    direct[at + Z17 * stride] = w_f * force_by[2]
    direct[at + Z19_PLUS * stride] = w_f * force_by[3]
    direct[at + Z19_MINUS * stride] = w_f * force_by[4]
    direct[at + Z20_PLUS * stride] = w_f * force_by[5]
    direct[at + Z20_MINUS * stride] = w_f * force_by[6]
    direct[at + Z21_PLUS * stride] = w_f * force_by[7]
    direct[at + Z21_MINUS * stride] = w_f * force_by[8]
    direct[at + Z22_PLUS * stride] = w_f * force_by[9]
    direct[at + Z22_MINUS * stride] = w_f * force_by[10]


@component
def limits_by_parameters(pump: Pump) -> LimitPartials:
    """Derivatives of the pressure's limits: the upper one's by Z1, Z2, Z13₊, Z15, then the lower's.

    They are constants of a march, which works them out once.
    """
    _, u_1, u_2, u_13, u_15 = pressure_limit_partials(
        pump.Z1, pump.Z2, pump.Z13_plus, pump.Z15, 1.0
    )
    _, l_1, l_2, l_13, l_15 = pressure_limit_partials(
        pump.Z1, pump.Z2, pump.Z13_minus, pump.Z15, -1.0
    )
    return u_1, u_2, u_13, u_15, l_1, l_2, l_13, l_15


@component
def pump_force_partials(current: float, pump: Pump) -> ForcePartials:
    """Solenoid force with its derivatives by the current and the solenoids' parameters."""
    return solenoid_partials(
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


@component
def pump_partials(
    pressure: float,
    current: float,
    pump: Pump,
    limits_by: LimitPartials,
    step: float,
    direct: Array,
    next_at: int,
    opening_at: int,
    stride: int,
) -> tuple[float, float, float, float, float, float]:
    """Pressure one step later with its partial derivatives.

    No branch of it leaves early, so that a march over many samples at known pressures can be made
    of vector instructions.

    Parameters
    ----------
    limits_by :
        What `limits_by_parameters` says.
    direct : array
        Filled from `next_at` on, `stride` apart: direct derivatives of the next pressure by the
        N_PUMP parameters; and from `opening_at` on those of the opening, but only where Z12 makes
        the speed depend on it. Places that no step sets must come as zeros.

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
    force_by = pump_force_partials(current, pump)
    arm_by = arm_sine_partials(pressure, pump.Z1, pump.Z2, pump.Z3)
    spool_by = spool_partials(force_by[0], arm_by[0], pump.Z4, pump.Z5, pump.Z18)
    orifice_by = opening_partials(spool_by[0], pump.Z14, pump.Z16_plus, pump.Z16_minus)
    opening = orifice_by[0]
    y_p = orifice_by[1] * spool_by[2] * arm_by[1]
    y_i = orifice_by[1] * spool_by[1] * force_by[1]
    if pump.loaded is not None:
        write_direct(1.0, force_by, arm_by, spool_by, orifice_by, direct, opening_at, stride)

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
    # at a limit the limit alone counts, and what the parameters of that limit do to it
    above = 1.0 if free >= pump.upper else 0.0
    below = 1.0 if free <= pump.lower else 0.0
    below = below * (1.0 - above)
    within = 1.0 - above - below
    write_direct(within * q_y, force_by, arm_by, spool_by, orifice_by, direct, next_at, stride)
    u_1, u_2, u_13, u_15, l_1, l_2, l_13, l_15 = limits_by
    direct[next_at + Z1 * stride] += above * u_1 + below * l_1
    direct[next_at + Z2 * stride] += above * u_2 + below * l_2
    at_stop = pressure >= pump.upper_stop or pressure <= pump.lower_stop
    direct[next_at + Z6 * stride] = 0.0 if at_stop else within * q_6
    direct[next_at + Z7 * stride] = within * q_7
    direct[next_at + Z8 * stride] = within * q_8
    direct[next_at + Z9 * stride] = within * q_9
    direct[next_at + Z13_PLUS * stride] = above * u_13
    direct[next_at + Z13_MINUS * stride] = below * l_13
    direct[next_at + Z15 * stride] = above * u_15 + below * l_15
    by_pressure = within * (q_p + q_y * y_p)
    return following, by_pressure, within * (q_y * y_i), opening, y_p, y_i


@component
def speed_partials(
    pressure: float, opening: float, opening_by_pressure: float, pump: Pump
) -> tuple[float, float, float, SpeedPartials]:
    """Shaft speed with its partial derivatives.

    Returns
    -------
    speed : float
        Ω. [rad/s]
    by_pressure : float
        Its derivative by δP, also by way of the opening where Z12 makes it count.
    by_opening : float
        Its derivative by the opening, 0 unless Z12 makes it count.
    direct : tuple of float
        Direct derivatives by Z1 through the plate's rate, then by Z6, Z7, Z8, Z9 (all zero unless
        Z12 makes the rate count), Z1 through the angle, Z2, Z10, Z11, Z12, Z13₊ and Z13₋.
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
    direct = (
        moves * w_l * l_o * o_1,
        by_rate * r_6,
        by_rate * r_7,
        by_rate * r_8,
        by_rate * r_9,
        by_tangent * t_1,
        by_tangent * t_2,
        w_10,
        w_11,
        w_l * l_12,
        w_a * a_13p,
        w_a * a_13m,
    )
    return speed, by_pressure, by_rate * r_y, direct


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
        Direct derivatives of the opening, from `pump_partials`.
    d_pressure : (N_PUMP + m,) array
        Total derivatives of δP by the pump's parameters and m others that act through the current.
    d_current : (m,) array
        Derivatives of the signed current by those m.
    d_speed : (N_PUMP + m,) array
        Filled with the derivatives of the speed.
    """
    speed, by_pressure, by_opening, direct = speed_partials(
        pressure, opening, opening_by_pressure, pump
    )
    for k in range(d_speed.size):
        d_speed[k] = by_pressure * d_pressure[k]
    if pump.loaded is not None:
        for k in range(N_PUMP):
            d_speed[k] += by_opening * opening_by[k]
        for k in range(d_current.size):
            d_speed[N_PUMP + k] += by_opening * opening_by_current * d_current[k]
        d_speed[Z1] += direct[0]
        d_speed[Z6] += direct[1]
        d_speed[Z7] += direct[2]
        d_speed[Z8] += direct[3]
        d_speed[Z9] += direct[4]
    d_speed[Z1] += direct[5]
    d_speed[Z2] += direct[6]
    d_speed[Z10] += direct[7]
    d_speed[Z11] += direct[8]
    d_speed[Z12] += direct[9]
    d_speed[Z13_PLUS] += direct[10]
    d_speed[Z13_MINUS] += direct[11]
    return speed
