"""Stroking piston: valve opening to pressure (Kruse 2001, eqs. 6.65-6.68).

    δP' = (Z8 √((Z9 - σ δP)/2) x_eff - Z7 δP) / (1 + Z6)

σ is 1 in the published form and the sign of x_eff in the physically right one (erratum 13). The
term Z6, the plate's own motion, is absent while the plate rests on a stop.
"""

from math import sqrt, tan

from swashplate.physics.component import component


@component
def pressure_limits(
    Z1: float, Z2: float, Z13_plus: float, Z13_minus: float, Z15: float
) -> tuple[float, float, float, float]:
    """Pressures at which the swash plate stops and the relief valve opens.

    Parameters
    ----------
    Z1, Z2 : float
        Pressure to tangent [1/Pa], offset [1].
    Z13_plus, Z13_minus, Z15 : float
        Swash plate stops, magnitudes [rad]; largest pressure either way [Pa].

    Returns
    -------
    lower_stop, upper_stop : float
        (∓tan Z13 + Z2)/Z1. [Pa]
    lower, upper : float
        The same within ±Z15: δP never leaves them, so nothing winds up at a stop. [Pa]
    """
    lower_stop = (Z2 - tan(Z13_minus)) / Z1
    upper_stop = (Z2 + tan(Z13_plus)) / Z1
    return lower_stop, upper_stop, max(lower_stop, -Z15), min(upper_stop, Z15)


@component
def pressure_limit_partials(
    Z1: float, Z2: float, Z13: float, Z15: float, direction: float
) -> tuple[float, float, float, float, float]:
    """One limit with its derivatives by Z1, Z2, the Z13 of that side, Z15.

    `direction` is +1.0 for the upper limit, -1.0 for the lower. Where the stop and Z15 coincide
    the stop counts.
    """
    slope = tan(Z13)
    stop = (Z2 + direction * slope) / Z1
    if direction * stop > Z15:
        return direction * Z15, 0.0, 0.0, 0.0, direction
    return stop, -stop / Z1, 1.0 / Z1, direction * (1.0 + slope * slope) / Z1, 0.0


@component
def flow_head(
    pressure: float, opening: float, Z9: float, symmetric: bool | None
) -> tuple[float, float]:
    """Pressure head over the valve, (Z9 - σ δP)/2 [Pa], and σ.

    A pressure outside the supply has no head left and gives zero, not an imaginary flow.
    """
    sign = 1.0
    if symmetric is not None:
        sign = -1.0 if opening < 0.0 else 1.0
    return max((Z9 - sign * pressure) * 0.5, 0.0), sign


@component
def pressure_rate(
    pressure: float,
    opening: float,
    Z6: float,
    Z7: float,
    Z8: float,
    Z9: float,
    symmetric: bool | None,
) -> float:
    """Rate of the stroking pressure.

    Parameters
    ----------
    pressure : float
        δP. [Pa]
    opening : float
        x_eff. [m]
    Z6, Z7, Z8, Z9 : float
        Plate motion [1] (0 at a stop), leakage [1/s], valve gain [√Pa/(m s)], supply [Pa].
    symmetric : None or True
        True takes the root √((Z9 - sgn(x)δP)/2), None the published √((Z9 - δP)/2).

    Returns
    -------
    float
        δP'; Kruse eq. 6.67 with the leakage of eq. 6.64. [Pa/s]
    """
    head, _ = flow_head(pressure, opening, Z9, symmetric)
    return (Z8 * sqrt(head) * opening - Z7 * pressure) / (1.0 + Z6)


@component
def pressure_rate_partials(
    pressure: float,
    opening: float,
    Z6: float,
    Z7: float,
    Z8: float,
    Z9: float,
    symmetric: bool | None,
) -> tuple[float, float, float, float, float, float, float]:
    """δP' with its derivatives by pressure, opening, Z6, Z7, Z8, Z9.

    Without head (δP beyond the supply) the flow's derivative is taken as zero.
    """
    head, sign = flow_head(pressure, opening, Z9, symmetric)
    root = sqrt(head)
    inverse = 1.0 / (1.0 + Z6)
    rate = pressure_rate(pressure, opening, Z6, Z7, Z8, Z9, symmetric)
    root_head = 0.5 / root if head > 0.0 else 0.0
    d_head = root_head * (Z8 * inverse) * opening
    return (
        rate,
        -0.5 * sign * d_head - Z7 * inverse,
        Z8 * root * inverse,
        -rate * inverse,
        -pressure * inverse,
        root * opening * inverse,
        0.5 * d_head,
    )


@component
def tight_step(
    pressure: float,
    opening: float,
    Z6: float,
    Z8: float,
    Z9: float,
    step: float,
    symmetric: bool | None,
) -> float:
    """Pressure one step later without leakage, integrated exactly at constant opening.

    With r = √((Z9 - σδP)/2) the equation reads r' = -σ Z8 x_eff / (4 (1 + Z6)), so that δP is a
    parabola in time until the head is used up. [Pa]
    """
    head, sign = flow_head(pressure, opening, Z9, symmetric)
    gain = 0.25 * Z8 * step / (1.0 + Z6)
    r = sqrt(head)
    # σ (Z9 - 2 (r - σ gain x)²), multiplied out: no cancellation, and fewer operations in line
    parabola = (pressure + (4.0 * gain * r) * opening) - (2.0 * sign * gain * gain) * (
        opening * opening
    )
    return sign * Z9 if sign * gain * opening > r else parabola


@component
def tight_step_partials(
    pressure: float,
    opening: float,
    Z6: float,
    Z8: float,
    Z9: float,
    step: float,
    symmetric: bool | None,
) -> tuple[float, float, float, float, float, float, float]:
    """Next δP with its derivatives by pressure, opening, Z6, Z7, Z8, Z9.

    That by Z7 is the one at Z7 = 0: the leakage's rate along the parabola, carried to the end of
    the step and integrated by the trapezoidal rule.
    """
    value = tight_step(pressure, opening, Z6, Z8, Z9, step, symmetric)
    head, sign = flow_head(pressure, opening, Z9, symmetric)
    r = sqrt(head)
    inverse = 1.0 / (1.0 + Z6)
    gain = 0.25 * Z8 * step / (1.0 + Z6)
    if sign * gain * opening > r:
        return value, 0.0, 0.0, 0.0, 0.0, 0.0, sign
    half_inverse = 0.5 / r if head > 0.0 else 0.0
    r_end = r - sign * gain * opening
    d_gain = 4.0 * opening * r_end
    d_r = 4.0 * gain * opening
    leaked = pressure * (r_end * (2.0 * half_inverse)) + value
    return (
        value,
        1.0 - sign * d_r * (0.5 * half_inverse),
        4.0 * gain * r_end,
        -d_gain * (0.25 * Z8 * step * (inverse * inverse)),
        -0.5 * step * inverse * leaked,
        d_gain * (0.25 * step * inverse),
        d_r * (0.5 * half_inverse),
    )


@component
def leaky_step(
    pressure: float,
    opening: float,
    Z6: float,
    Z7: float,
    Z8: float,
    Z9: float,
    step: float,
    symmetric: bool | None,
) -> float:
    """Pressure one step later with leakage: Runge-Kutta of fourth order, opening constant. [Pa]"""
    half = 0.5 * step
    k1 = pressure_rate(pressure, opening, Z6, Z7, Z8, Z9, symmetric)
    k2 = pressure_rate(pressure + half * k1, opening, Z6, Z7, Z8, Z9, symmetric)
    k3 = pressure_rate(pressure + half * k2, opening, Z6, Z7, Z8, Z9, symmetric)
    k4 = pressure_rate(pressure + step * k3, opening, Z6, Z7, Z8, Z9, symmetric)
    return pressure + step / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)


@component
def leaky_step_partials(
    pressure: float,
    opening: float,
    Z6: float,
    Z7: float,
    Z8: float,
    Z9: float,
    step: float,
    symmetric: bool | None,
) -> tuple[float, float, float, float, float, float, float]:
    """Next δP with its derivatives by pressure, opening, Z6, Z7, Z8, Z9.

    Each stage's slope depends on the inputs directly and through the stage before.
    """
    value = leaky_step(pressure, opening, Z6, Z7, Z8, Z9, step, symmetric)
    sum_p, sum_x, sum_6, sum_7, sum_8, sum_9 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    rate, k_p, k_x, k_6, k_7, k_8, k_9 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for stage in range(4):
        reach = 0.0 if stage == 0 else (step if stage == 3 else 0.5 * step)
        weight = step / 6.0 if stage in (0, 3) else step / 3.0
        inner = pressure + reach * rate
        i_p = 1.0 + reach * k_p
        i_x, i_6, i_7 = reach * k_x, reach * k_6, reach * k_7
        i_8, i_9 = reach * k_8, reach * k_9
        rate, f_p, f_x, f_6, f_7, f_8, f_9 = pressure_rate_partials(
            inner, opening, Z6, Z7, Z8, Z9, symmetric
        )
        k_p, k_x, k_6 = f_p * i_p, f_x + f_p * i_x, f_6 + f_p * i_6
        k_7, k_8, k_9 = f_7 + f_p * i_7, f_8 + f_p * i_8, f_9 + f_p * i_9
        sum_p, sum_x, sum_6 = sum_p + weight * k_p, sum_x + weight * k_x, sum_6 + weight * k_6
        sum_7, sum_8, sum_9 = sum_7 + weight * k_7, sum_8 + weight * k_8, sum_9 + weight * k_9
    return value, 1.0 + sum_p, sum_x, sum_6, sum_7, sum_8, sum_9
