"""Stroking piston: flow through the valve and oil under pressure (Kruse 2001, eqs. 6.31-6.35)."""

from math import sqrt

from swashplate.physics.component import component
from swashplate.physics.stroker import flow_head


@component
def valve_flow(
    pressure: float,
    opening: float,
    flow_gain: float,
    supply_pressure: float,
    symmetric: bool | None,
) -> float:
    """Flow through the valve towards the stroking piston.

    Parameters
    ----------
    pressure : float
        Stroker pressure P. [Pa]
    opening : float
        x_eff. [m]
    flow_gain : float
        C_o. [m²/(s √Pa)]
    supply_pressure : float
        ΔP, supply less reservoir. [Pa]
    symmetric : None or True
        True takes the root √((ΔP - sgn(x)P)/2), None the published √((ΔP - P)/2) (erratum 13).

    Returns
    -------
    float
        q = C_o √((ΔP - σP)/2) x_eff; Kruse eq. 6.31 with the constant gain of eq. 6.37. [m³/s]
    """
    head, _ = flow_head(pressure, opening, supply_pressure, symmetric)
    return flow_gain * sqrt(head) * opening


@component
def valve_flow_partials(
    pressure: float,
    opening: float,
    flow_gain: float,
    supply_pressure: float,
    symmetric: bool | None,
) -> tuple[float, float, float]:
    """q with its derivatives by pressure, opening; without head that by pressure is zero."""
    head, sign = flow_head(pressure, opening, supply_pressure, symmetric)
    root = sqrt(head)
    by_pressure = -0.25 * sign * flow_gain * opening / root if head > 0.0 else 0.0
    return flow_gain * root * opening, by_pressure, flow_gain * root


@component
def oil_pressure_rate(
    pressure: float,
    flow: float,
    piston_speed: float,
    piston_area: float,
    leakage: float,
    volume: float,
    bulk_modulus: float,
) -> float:
    """Rate of the stroker pressure.

    Parameters
    ----------
    pressure : float
        P. [Pa]
    flow : float
        Flow through the valve. [m³/s]
    piston_speed : float
        x_st'. [m/s]
    piston_area, leakage : float
        A_s [m²], K_L around the piston [m³/(s Pa)].
    volume, bulk_modulus : float
        V [m³], B [Pa].

    Returns
    -------
    float
        (q - K_L P - A_s x_st') B/V; Kruse eqs. 6.32, 6.33, 6.35. [Pa/s]
    """
    return (flow - leakage * pressure - piston_area * piston_speed) * (bulk_modulus / volume)
