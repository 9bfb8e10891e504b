"""Swash plate: stroking pressure to angle (Kruse 2001, eqs. 6.55, 6.63, 8.9)."""

from math import pi

from swashplate.physics.component import component

TAN_22_5 = 0.41421356237309503
TAN_67_5 = 2.414213562373095


@component
def small_arctangent(t: float) -> float:
    """Arctangent for |t| ≤ tan 22.5°, within one unit in the last place of `math.atan`.

    An odd polynomial (Chebyshev fit of (atan t/t - 1)/t², error 1.2e-18): `math.atan` is a library
    call, which would keep the compiler from marching several parameter sets side by side.
    """
    z = t * t
    p = -0.03456931506332609 + z * 0.016284375050043393
    p = -0.05230443640686948 + z * (0.045515447340221615 + z * p)
    p = -0.0666642476020052 + z * (0.05878927554473807 + z * p)
    p = -0.09090908753259112 + z * (0.07692296368042296 + z * p)
    p = -0.14285714285659779 + z * (0.11111111105150588 + z * p)
    p = -0.3333333333333333 + z * (0.19999999999999804 + z * p)
    return t + t * (z * p)


@component
def arctangent(tangent: float) -> float:
    """Arctangent of any number, reduced to `small_arctangent` by turning through 45° or 90°."""
    m = abs(tangent)
    steep = m > TAN_67_5
    middle = m > TAN_22_5
    numerator = -1.0 if steep else (m - 1.0 if middle else m)
    denominator = m if steep else (m + 1.0 if middle else 1.0)
    turn = 0.5 * pi if steep else (0.25 * pi if middle else 0.0)
    angle = turn + small_arctangent(numerator / denominator)
    return angle if tangent >= 0.0 else -angle


@component
def swash_tangent(pressure: float, Z1: float, Z2: float) -> float:
    """tan α_sw = Z1 δP - Z2; Kruse eq. 6.55, before the stops."""
    return Z1 * pressure - Z2


@component
def swash_tangent_partials(
    pressure: float, Z1: float, Z2: float
) -> tuple[float, float, float, float]:
    """tan α_sw with its derivatives by pressure, Z1, Z2."""
    return swash_tangent(pressure, Z1, Z2), Z1, pressure, -1.0


@component
def swash_angle(tangent: float, Z13_plus: float, Z13_minus: float, steep: bool | None) -> float:
    """Swash plate angle between its stops.

    Parameters
    ----------
    tangent : float
        tan α_sw = Z1 δP - Z2.
    Z13_plus, Z13_minus : float
        Stops, both as magnitudes. [rad]
    steep : None or True
        None where both stops lie within 22.5°, which spares the arctangent its reduction.

    Returns
    -------
    float
        α_sw = clip(atan(tan α_sw), -Z13₋, +Z13₊); Kruse eqs. 6.55 and 8.9. [rad]
    """
    angle = small_arctangent(tangent) if steep is None else arctangent(tangent)
    return min(max(angle, -Z13_minus), Z13_plus)


@component
def swash_angle_partials(
    tangent: float, Z13_plus: float, Z13_minus: float, steep: bool | None
) -> tuple[float, float, float, float]:
    """α_sw with its derivatives by tangent, Z13_plus, Z13_minus; on a stop, those of the stop."""
    angle = swash_angle(tangent, Z13_plus, Z13_minus, steep)
    if angle >= Z13_plus:
        return angle, 0.0, 1.0, 0.0
    if angle <= -Z13_minus:
        return angle, 0.0, 0.0, -1.0
    return angle, 1.0 / (1.0 + tangent * tangent), 0.0, 0.0


@component
def swash_rate(tangent: float, pressure_rate: float, Z1: float) -> float:
    """Rate of the swash plate between its stops, Z1 cos²α_sw δP'; Kruse eq. 6.63. [rad/s]"""
    return Z1 * pressure_rate / (1.0 + tangent * tangent)


@component
def swash_rate_partials(
    tangent: float, pressure_rate: float, Z1: float
) -> tuple[float, float, float, float]:
    """Rate with its derivatives by tangent, pressure_rate, Z1."""
    cos2 = 1.0 / (1.0 + tangent * tangent)
    rate = swash_rate(tangent, pressure_rate, Z1)
    return rate, -2.0 * tangent * cos2 * rate, Z1 * cos2, pressure_rate * cos2
