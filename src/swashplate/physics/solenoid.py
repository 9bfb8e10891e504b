"""Solenoids: signed current to force (Kruse 2001, eq. 6.61)."""

from swashplate.physics.component import component


@component
def effective_current(current: float, Z17: float) -> float:
    """Current beyond the symmetric dead zone, i_e = sign(i) max(|i| - Z17, 0). [A]"""
    return max(current - Z17, 0.0) + min(current + Z17, 0.0)


@component
def solenoid_force(
    current: float,
    Z17: float,
    Z19_plus: float,
    Z19_minus: float,
    Z20_plus: float,
    Z20_minus: float,
    Z21_plus: float,
    Z21_minus: float,
    Z22_plus: float,
    Z22_minus: float,
) -> float:
    """Net force of both solenoids on the spool.

    Parameters
    ----------
    current : float
        Signed current, that of the positive channel less that of the negative one. [A]
    Z17 : float
        Dead zone, the same both ways. [A]
    Z19_plus ... Z22_minus : float
        Polynomial coefficients of each direction, degrees 1 to 4. [N/A ... N/A⁴]

    Returns
    -------
    float
        F = Z19 i_e + Z20 i_e² + Z21 i_e³ + Z22 i_e⁴, positive towards more speed; Kruse eq. 6.61
        on the *signed* i_e: even powers keep their own sign (erratum 1). [N]
    """
    e = effective_current(current, Z17)
    plus = e > 0.0
    c1 = Z19_plus if plus else Z19_minus
    c2 = Z20_plus if plus else Z20_minus
    c3 = Z21_plus if plus else Z21_minus
    c4 = Z22_plus if plus else Z22_minus
    return e * (c1 + e * (c2 + e * (c3 + e * c4)))


@component
def solenoid_partials(
    current: float,
    Z17: float,
    Z19_plus: float,
    Z19_minus: float,
    Z20_plus: float,
    Z20_minus: float,
    Z21_plus: float,
    Z21_minus: float,
    Z22_plus: float,
    Z22_minus: float,
) -> tuple[float, float, float, float, float, float, float, float, float, float, float]:
    """F with its derivatives by current and, in the order of the arguments, each parameter.

    At the edge of the dead zone the derivative is that of the dead side. Without a dead zone
    (Z17 = 0) the derivative at zero current is that of the positive side.
    """
    force = solenoid_force(
        current,
        Z17,
        Z19_plus,
        Z19_minus,
        Z20_plus,
        Z20_minus,
        Z21_plus,
        Z21_minus,
        Z22_plus,
        Z22_minus,
    )
    e = effective_current(current, Z17)
    plus = e > 0.0 or (e == 0.0 and Z17 == 0.0)
    minus = e < 0.0
    c1 = Z19_plus if plus else Z19_minus
    c2 = Z20_plus if plus else Z20_minus
    c3 = Z21_plus if plus else Z21_minus
    c4 = Z22_plus if plus else Z22_minus
    slope = c1 + e * (2.0 * c2 + e * (3.0 * c3 + e * 4.0 * c4))
    slope = slope if plus or minus else 0.0
    e2 = e * e
    p = 1.0 if plus else 0.0
    m = 1.0 if minus else 0.0
    return (
        force,
        slope,
        -slope if plus else slope,
        p * e,
        m * e,
        p * e2,
        m * e2,
        p * e2 * e,
        m * e2 * e,
        p * e2 * e2,
        m * e2 * e2,
    )
