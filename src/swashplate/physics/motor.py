"""Hydraulic motor: swash plate angle to shaft speed (Kruse 2001, eqs. 6.69 and 6.70)."""

from math import sqrt

from swashplate.physics.component import component


@component
def load_leakage(tangent: float, swash_rate: float, Z12: float) -> float:
    """Speed lost to leakage while the load accelerates.

    Parameters
    ----------
    tangent : float
        tan α_sw.
    swash_rate : float
        dα_sw/dt, zero at a stop. [rad/s]
    Z12 : float
        Leakage by acceleration. [1]

    Returns
    -------
    float
        Z12 cos α_sw dα_sw/dt, the form that the source's own derivation gives in place of the
        printed one (erratum 22). [rad/s]
    """
    return Z12 * (swash_rate / sqrt(1.0 + tangent * tangent))


@component
def load_leakage_partials(
    tangent: float, swash_rate: float, Z12: float
) -> tuple[float, float, float, float]:
    """Leakage with its derivatives by tangent, swash_rate, Z12."""
    cos = 1.0 / sqrt(1.0 + tangent * tangent)
    value = load_leakage(tangent, swash_rate, Z12)
    return value, -Z12 * swash_rate * tangent * cos * cos * cos, Z12 * cos, swash_rate * cos


@component
def shaft_speed(swash_angle: float, leakage: float, Z10: float, Z11: float) -> float:
    """Speed of the shaft that the drive turns.

    Parameters
    ----------
    swash_angle : float
        α_sw. [rad]
    leakage : float
        Speed lost while the load accelerates, see `load_leakage`. [rad/s]
    Z10, Z11 : float
        Displacement ratio [1/s], static leakage [rad/s].

    Returns
    -------
    float
        Ω = Z10 α_sw - Z11 - leakage; Kruse eq. 6.69. Positive hoists, slews right, lifts the
        boom. [rad/s]
    """
    return Z10 * swash_angle - Z11 - leakage


@component
def shaft_speed_partials(
    swash_angle: float, leakage: float, Z10: float, Z11: float
) -> tuple[float, float, float, float, float]:
    """Ω with its derivatives by swash_angle, leakage, Z10, Z11."""
    return shaft_speed(swash_angle, leakage, Z10, Z11), Z10, -1.0, swash_angle, -1.0
