"""The chain of components at one sample: what every march, plain or not, has in its loop.

A new component is one file in `swashplate.physics` and one entry here (and in `tangent.py`, which
carries the derivatives along the same chain).
"""

from swashplate.physics.card_dynamics import filtered_current, limited_current, rate_limit_active
from swashplate.physics.component import component
from swashplate.physics.control_card import jump_share, steady_current
from swashplate.physics.motor import load_leakage, shaft_speed
from swashplate.physics.solenoid import solenoid_force
from swashplate.physics.spool import arm_sine, moment_sine, orifice_opening, spool_position
from swashplate.physics.stroker import leaky_step, pressure_rate, tight_step
from swashplate.physics.swash import swash_angle, swash_rate, swash_tangent
from swashplate.simulation.constants import Channel, Pump


@component
def channel_steady(
    direction: float,
    command: float,
    newest: float,
    middle: float,
    oldest: float,
    fraction: float,
    channel: Channel,
) -> float:
    """I_ss of one channel from the delayed command and the samples around its interval. [A]"""
    share = jump_share(
        direction * newest, direction * middle, direction * oldest, fraction, channel.V_dz
    )
    return steady_current(
        direction * command, share, channel.V_dz, channel.J, channel.G1, channel.G2, channel.G3
    )


@component
def channel_sample(
    steady: float, state: float, previous: float, output: float, channel: Channel, step: float
) -> tuple[float, float, bool]:
    """One sample of a channel.

    Parameters
    ----------
    steady : float
        I_ss at this sample. [A]
    state, previous : float
        I* at this sample and the one before. [A]
    output : float
        I one sample earlier. [A]

    Returns
    -------
    output : float
        I at this sample. [A]
    state : float
        I* at the next sample. [A]
    limited : bool
        Whether a rate limit sets the output.
    """
    current = limited_current(
        state,
        output,
        steady,
        channel.lim1,
        channel.lim2,
        channel.I_t1,
        channel.I_t2,
        channel.decay,
        step,
        channel.split,
    )
    limited = rate_limit_active(current, state, output, channel.I_t2)
    following = filtered_current(
        state, previous, steady, channel.zeta, channel.omega, channel.C, step, channel.literal
    )
    return current, following, limited


@component
def pump_force(current: float, pump: Pump) -> float:
    """Net solenoid force. [N]"""
    return solenoid_force(
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
def pump_spool(force: float, pressure: float, pump: Pump) -> float:
    """Spool displacement before its stop. [m]"""
    arm = arm_sine(pressure, pump.Z1, pump.Z2, pump.Z3)
    return spool_position(force, arm, pump.Z4, pump.Z5, pump.Z18)


@component
def plate_motion(pressure: float, pump: Pump) -> float:
    """Z6 while the swash plate can move, 0 while it rests on a stop."""
    return 0.0 if pressure >= pump.upper_stop or pressure <= pump.lower_stop else pump.Z6


@component
def pump_step(pressure: float, current: float, pump: Pump, step: float) -> float:
    """Stroking pressure one step later, from δP and the signed current at this sample. [Pa]"""
    position = pump_spool(pump_force(current, pump), pressure, pump)
    opening = orifice_opening(position, pump.Z14, pump.Z16_plus, pump.Z16_minus)
    Z6 = plate_motion(pressure, pump)
    if pump.leaky is None:
        free = tight_step(pressure, opening, Z6, pump.Z8, pump.Z9, step, pump.symmetric)
    else:
        free = leaky_step(pressure, opening, Z6, pump.Z7, pump.Z8, pump.Z9, step, pump.symmetric)
    return min(max(free, pump.lower), pump.upper)


@component
def pump_swash_rate(pressure: float, opening: float, pump: Pump) -> float:
    """Rate of the swash plate, zero while a stop or the relief valve holds it. [rad/s]"""
    rate = pressure_rate(pressure, opening, pump.Z6, pump.Z7, pump.Z8, pump.Z9, pump.symmetric)
    held = pressure >= pump.upper or pressure <= pump.lower
    return 0.0 if held else swash_rate(swash_tangent(pressure, pump.Z1, pump.Z2), rate, pump.Z1)


@component
def pump_speed(pressure: float, current: float, pump: Pump) -> float:
    """Shaft speed from δP and, where Z12 counts, the current at the same sample. [rad/s]"""
    tangent = swash_tangent(pressure, pump.Z1, pump.Z2)
    angle = swash_angle(tangent, pump.Z13_plus, pump.Z13_minus, pump.steep)
    leakage = 0.0
    if pump.loaded is not None:
        position = pump_spool(pump_force(current, pump), pressure, pump)
        opening = orifice_opening(position, pump.Z14, pump.Z16_plus, pump.Z16_minus)
        leakage = load_leakage(tangent, pump_swash_rate(pressure, opening, pump), pump.Z12)
    return shaft_speed(angle, leakage, pump.Z10, pump.Z11)


@component
def moment_squared(current: float, pump: Pump) -> float:
    """sin²φ, which must stay below 1: beyond, the solenoid overpowers the feedback spring."""
    a = moment_sine(pump_force(current, pump), pump.Z4, pump.Z5)
    return a * a
