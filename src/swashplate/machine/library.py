"""Equations that many machines need: interpolation, fading, arctangent."""

from math import pi

from swashplate.machine.code_generation.derivatives import declared
from swashplate.machine.declaration import equation

FADED = 1e-30
"""Value that counts as none: fading on into denormal numbers makes a march at rest 2.5 times as
long."""
TAN_22_5 = 0.41421356237309503
TAN_67_5 = 2.414213562373095


@equation
def interpolated(newer: float, older: float, fraction: float) -> float:
    """Value between two samples, `fraction` of the way back from the newer one."""
    return newer + fraction * (older - newer)


@equation
def faded(value: float) -> float:
    """A value, or zero if its size is below 1e-30, so that no subnormal number slows a march.

    Its derivative is 1 throughout.
    """
    return 0.0 if abs(value) < FADED else value


@declared(faded)
def _faded(value: float) -> float:
    return 1.0


@equation
def clipped(value: float, lower: float, upper: float) -> float:
    """A value within bounds; beyond one it is that bound, and at it the bound counts."""
    return min(max(value, lower), upper)


@declared(clipped)
def _clipped(value: float, lower: float, upper: float) -> tuple[float, float, float]:
    # once for all that follows, in place of a decision on each way back
    above = value >= upper
    below = not above and value <= lower
    return (
        0.0 if above or below else 1.0,
        1.0 if below else 0.0,
        1.0 if above else 0.0,
    )


@equation
def soft_threshold(value: float, width: float) -> float:
    """What of a value lies beyond a symmetric dead zone, sign(v) max(abs(v) - w, 0).

    Parameters
    ----------
    value : float
        v.
    width : float
        w ≥ 0, in the unit of v.

    Notes
    -----
    It is the implicit step of Coulomb friction, too: with v the speed that a mass would reach
    without friction in a step h and w = h F_c/m, the result is the speed it reaches. It sticks at
    exactly zero.
    """
    return max(0.0, value - width) + min(0.0, value + width)


@declared(soft_threshold)
def _soft_threshold(value: float, width: float) -> tuple[float, float]:
    # an edge of the dead zone belongs to it; without one, zero belongs to the positive side
    above = value > width or (value == 0.0 and width == 0.0)
    below = value < -width
    return (
        1.0 if above or below else 0.0,
        -1.0 if above else (1.0 if below else 0.0),
    )


@equation
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


@declared(small_arctangent)
def _small_arctangent(t: float) -> float:
    return 1.0 / (1.0 + t * t)


@equation
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


@declared(arctangent)
def _arctangent(tangent: float) -> float:
    return 1.0 / (1.0 + tangent * tangent)
