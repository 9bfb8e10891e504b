"""Slopes of the chain at one point, from the twins of the components."""

from typing import NamedTuple

from swashplate.physics.card_dynamics import filter_partials
from swashplate.physics.control_card import steady_partials
from swashplate.physics.spool import arm_sine_partials, opening_partials, spool_partials
from swashplate.physics.stroker import (
    leaky_step_partials,
    pressure_rate_partials,
    tight_step_partials,
)
from swashplate.physics.swash import swash_angle_partials, swash_tangent_partials
from swashplate.simulation.chain import plate_motion
from swashplate.simulation.compilation import kernel
from swashplate.simulation.constants import Channel, Pump
from swashplate.simulation.tangent import pump_force_partials, speed_partials


class PumpSlopes(NamedTuple):
    """Derivatives by stroking pressure and solenoid force, SI."""

    rate_by_pressure: float
    rate_by_force: float
    """Of δP'."""
    next_by_pressure: float
    next_by_force: float
    """Of δP one step later."""
    spool_by_pressure: float
    spool_by_force: float
    opening_by_pressure: float
    opening_by_force: float
    angle_by_pressure: float
    speed_by_pressure: float
    speed_by_force: float
    """Zero unless Z12 makes the speed depend on the plate's rate."""


class CardSlopes(NamedTuple):
    """Derivatives along one channel of the card, SI."""

    steady_by_voltage: float
    """Of I_ss by the delayed command."""
    next_by_current: float
    next_by_before: float
    next_by_steady: float
    """Of I* one step later, by I* now and one step before and by I_ss."""


@kernel
def solenoid_slope(current: float, pump: Pump) -> tuple[float, float]:
    """Net force [N] and its derivative by the signed current [N/A]."""
    force_by = pump_force_partials(current, pump)
    return force_by[0], force_by[1]


@kernel
def pump_slopes(
    pressure: float, force: float, opening: float, pump: Pump, step: float
) -> tuple[float, float, float, float, float, float, float, float, float, float, float]:
    """The numbers of `PumpSlopes`.

    Parameters
    ----------
    pressure, force : float
        δP [Pa] and net solenoid force [N], away from the stops.
    opening : float
        x_eff at the point: zero where it is steady without leakage, which the equations give only
        up to rounding, so that with the root of sgn(x) the side would be left to chance. [m]
    step : float
        h of the step ahead. [s]
    """
    arm_by = arm_sine_partials(pressure, pump.Z1, pump.Z2, pump.Z3)
    spool_by = spool_partials(force, arm_by[0], pump.Z4, pump.Z5, pump.Z18)
    orifice_by = opening_partials(spool_by[0], pump.Z14, pump.Z16_plus, pump.Z16_minus)
    x_p, x_f = spool_by[2] * arm_by[1], spool_by[1]
    y_p, y_f = orifice_by[1] * x_p, orifice_by[1] * x_f
    motion = plate_motion(pressure, pump)
    _, r_p, r_y, _, _, _, _ = pressure_rate_partials(
        pressure, opening, motion, pump.Z7, pump.Z8, pump.Z9, pump.symmetric
    )
    if pump.leaky is None:
        _, q_p, q_y, _, _, _, _ = tight_step_partials(
            pressure, opening, motion, pump.Z8, pump.Z9, step, pump.symmetric
        )
    else:
        _, q_p, q_y, _, _, _, _ = leaky_step_partials(
            pressure, opening, motion, pump.Z7, pump.Z8, pump.Z9, step, pump.symmetric
        )
    tangent, t_p, _, _ = swash_tangent_partials(pressure, pump.Z1, pump.Z2)
    _, a_t, _, _ = swash_angle_partials(tangent, pump.Z13_plus, pump.Z13_minus, pump.steep)
    _, w_p, w_y, _ = speed_partials(pressure, opening, y_p, pump)
    return (
        r_p + r_y * y_p,
        r_y * y_f,
        q_p + q_y * y_p,
        q_y * y_f,
        x_p,
        x_f,
        y_p,
        y_f,
        a_t * t_p,
        w_p,
        w_y * y_f,
    )


@kernel
def card_slopes(
    command: float, level: float, channel: Channel, step: float
) -> tuple[float, float, float, float]:
    """The numbers of `CardSlopes` at rest on a level.

    Parameters
    ----------
    command, level : float
        Command in the channel's direction, beyond V_dz [V], and the current that it settles at [A].
    step : float
        h. [s]

    Notes
    -----
    The limiter behind the filter is left out: a slow enough motion passes it unchanged.
    """
    _, by_command, _, _, _, _, _, _ = steady_partials(
        command, 1.0, channel.V_dz, channel.J, channel.G1, channel.G2, channel.G3
    )
    _, by_current, by_before, by_steady, _, _, _ = filter_partials(
        level, level, level, channel.zeta, channel.omega, channel.C, step, channel.literal
    )
    return by_command, by_current, by_before, by_steady
