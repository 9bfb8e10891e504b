"""Spool valve: force and swash plate to valve opening (Kruse 2001, eqs. 6.57, 6.59, 6.71)."""

from math import sqrt

from swashplate.physics.component import component

WELL_CONDITIONED = 0.25
"""cos(φ+α) cos(φ-α) / cos²φ above which the form without a root in its denominator is used."""


@component
def moment_sine(force: float, Z4: float, Z5: float) -> float:
    """sin φ = Z5 F/√Z4: solenoid moment over the feedback spring's; must lie within ±1."""
    return force * (Z5 / sqrt(Z4))


@component
def arm_sine(pressure: float, Z1: float, Z2: float, Z3: float) -> float:
    """sin α of the feedback arm, which follows the swash plate.

    sin α = Z3 tan α_sw with tan α_sw = Z1 δP - Z2 (Kruse eqs. 6.55, 6.59), multiplied out so that
    the products of parameters are constants of the march. Must lie within ±1.
    """
    return (Z3 * Z1) * pressure - Z3 * Z2


@component
def arm_sine_partials(
    pressure: float, Z1: float, Z2: float, Z3: float
) -> tuple[float, float, float, float, float]:
    """sin α with its derivatives by pressure, Z1, Z2, Z3."""
    return arm_sine(pressure, Z1, Z2, Z3), Z3 * Z1, Z3 * pressure, -Z3, Z1 * pressure - Z2


@component
def spool_position(force: float, arm_sine: float, Z4: float, Z5: float, Z18: float) -> float:
    """Spool displacement at which solenoid and feedback spring balance.

    Parameters
    ----------
    force : float
        Net force F of both solenoids, positive towards more speed. [N]
    arm_sine : float
        sin α of the feedback arm, see `arm_sine`.
    Z4, Z5 : float
        Squared spring moment k_f² d3⁴ [N² m²], arm d1 [m].
    Z18 : float
        Plussing: displacement without force, plate upright. [m]

    Returns
    -------
    float
        x = Z5 tan(φ - α) + Z18 with sin φ = Z5 F/√Z4; Kruse eq. 6.57 in closed form (erratum 21),
        before any stop. [m]

    Notes
    -----
    Valid for |sin φ| < 1 and |sin α| < 1; the caller checks. The first of the two equal forms
    keeps the square root out of the denominator, so that root and division overlap: it makes a
    whole march 14 % faster. It is singular where φ + α = 90°, far from any real spool; there the
    second form takes over.
    """
    a = moment_sine(force, Z4, Z5)
    s = arm_sine
    t = a / sqrt(1.0 - a * a)
    cos_arm = sqrt(1.0 - s * s)
    w = 1.0 + t * t
    spread = 1.0 - w * (s * s)
    if spread > WELL_CONDITIONED:
        return (Z5 * t - (Z5 * w * s) * cos_arm) * (1.0 / spread) + Z18
    return Z5 * (t * cos_arm - s) / (cos_arm + t * s) + Z18


@component
def spool_partials(
    force: float, arm_sine: float, Z4: float, Z5: float, Z18: float
) -> tuple[float, float, float, float, float, float]:
    """x with its derivatives by force, arm_sine, Z4, Z5, Z18."""
    x = spool_position(force, arm_sine, Z4, Z5, Z18)
    a = moment_sine(force, Z4, Z5)
    s = arm_sine
    cos_force = sqrt(1.0 - a * a)
    cos_arm = sqrt(1.0 - s * s)
    # both roots with one division, and no division by a parameter that is not a constant of the
    # march: divisions are what this function spends its time on
    inverse = 1.0 / (cos_force * cos_arm)
    tangent = (x - Z18) * (1.0 / Z5)
    stretch = Z5 * (1.0 + tangent * tangent)
    x_a = stretch * (cos_arm * inverse)
    return (
        x,
        x_a * (Z5 / sqrt(Z4)),
        -stretch * (cos_force * inverse),
        x_a * (a * (-0.5 / Z4)),
        tangent + x_a * (force * (1.0 / sqrt(Z4))),
        1.0,
    )


@component
def stopped_spool(position: float, Z14: float) -> float:
    """Spool displacement within its stroke ±Z14. [m]"""
    return min(max(position, -Z14), Z14)


@component
def orifice_opening(position: float, Z14: float, Z16_plus: float, Z16_minus: float) -> float:
    """Effective opening towards the stroking piston.

    Parameters
    ----------
    position : float
        Spool displacement before its stop. [m]
    Z14 : float
        Stroke of the spool, both ways. [m]
    Z16_plus, Z16_minus : float
        Opening beyond which the in-line orifice, not the spool, limits the flow. [m]

    Returns
    -------
    float
        x_eff = clip(clip(x, ±Z14), -Z16₋, +Z16₊); Kruse eqs. 6.36 and 6.71. [m]
    """
    return min(max(position, -min(Z14, Z16_minus)), min(Z14, Z16_plus))


@component
def opening_partials(
    position: float, Z14: float, Z16_plus: float, Z16_minus: float
) -> tuple[float, float, float, float, float]:
    """x_eff with its derivatives by position, Z14, Z16_plus, Z16_minus.

    On a limit the limited side counts; where stroke and orifice coincide, the orifice.
    """
    y = orifice_opening(position, Z14, Z16_plus, Z16_minus)
    if position >= min(Z14, Z16_plus):
        if Z16_plus <= Z14:
            return y, 0.0, 0.0, 1.0, 0.0
        return y, 0.0, 1.0, 0.0, 0.0
    if position <= -min(Z14, Z16_minus):
        if Z16_minus <= Z14:
            return y, 0.0, 0.0, 0.0, -1.0
        return y, 0.0, -1.0, 0.0, 0.0
    return y, 1.0, 0.0, 0.0, 0.0
