"""Control card: delayed voltage to settled current (Kruse 2001, eqs. 3.1-3.4).

The card has two channels, one for each solenoid. Each sees the command times its direction
(+1 or -1) and returns a current magnitude, never negative. A channel is, in this order, a delay and
a static map with dead zone and jump, which are here, and the dynamics of `card_dynamics`.
"""

from swashplate.physics.component import component


@component
def interpolated(newer: float, older: float, fraction: float) -> float:
    """Command between two samples, `fraction` of the way back from the newer one."""
    return newer + fraction * (older - newer)


@component
def interpolated_partials(
    newer: float, older: float, fraction: float
) -> tuple[float, float, float, float]:
    """Command with its derivatives by newer, older, fraction (a delay τ = fraction · h + ...)."""
    return interpolated(newer, older, fraction), 1.0 - fraction, fraction, older - newer


@component
def share_above(first: float, last: float, threshold: float) -> float:
    """Share of a straight segment that lies above a threshold, 0 to 1."""
    a = first - threshold
    b = last - threshold
    if a > 0.0 and b > 0.0:
        return 1.0
    if a <= 0.0 and b <= 0.0:
        return 0.0
    return max(a, b) / abs(a - b)


@component
def jump_share(
    newest: float, middle: float, oldest: float, fraction: float, threshold: float
) -> float:
    """Share of one sample interval in which the command exceeds the dead zone.

    Parameters
    ----------
    newest, middle, oldest : float
        Three neighbouring samples of the channel's command. [V]
    fraction : float
        How far the interval's end lies behind `newest`, in samples, 0 to 1.
    threshold : float
        Dead zone V_dz. [V]

    Returns
    -------
    float
        s, 0 to 1. Switched by whole samples instead, the current would jump with V_dz and τ, and
        no fit could move either.
    """
    first = interpolated(middle, oldest, fraction)
    last = interpolated(newest, middle, fraction)
    return fraction * share_above(first, middle, threshold) + (1.0 - fraction) * share_above(
        middle, last, threshold
    )


@component
def jump_share_partials(
    newest: float, middle: float, oldest: float, fraction: float, threshold: float
) -> tuple[float, float, float]:
    """Share s with ∂s/∂fraction and ∂s/∂threshold (1/V).

    The interval slides back as `fraction` grows: it gains what its old end sees and loses what
    its new end sees. Where the command rests exactly at the threshold both derivatives are zero.
    """
    first = interpolated(middle, oldest, fraction)
    last = interpolated(newest, middle, fraction)
    s = jump_share(newest, middle, oldest, fraction, threshold)
    s_fraction = (1.0 if first > threshold else 0.0) - (1.0 if last > threshold else 0.0)
    s_threshold = 0.0
    if (first > threshold) != (middle > threshold):
        s_threshold -= fraction / abs(middle - first)
    if (middle > threshold) != (last > threshold):
        s_threshold -= (1.0 - fraction) / abs(last - middle)
    return s, s_fraction, s_threshold


@component
def steady_current(
    command: float, share: float, V_dz: float, J: float, G1: float, G2: float, G3: float
) -> float:
    """Current that a channel settles at.

    Parameters
    ----------
    command : float
        Delayed command in the channel's direction. [V]
    share : float
        Share of the present interval in which the command exceeds V_dz, see `jump_share`.
    V_dz, J, G1, G2, G3 : float
        Dead zone [V], jump [A] and polynomial gains [A/V, A/V², A/V³].

    Returns
    -------
    float
        I_ss = J s + G1 d + G2 d² + G3 d³ with d = max(V - V_dz, 0); Kruse eq. 3.3. [A]
    """
    d = max(command - V_dz, 0.0)
    return J * share + d * (G1 + d * (G2 + d * G3))


@component
def steady_partials(
    command: float, share: float, V_dz: float, J: float, G1: float, G2: float, G3: float
) -> tuple[float, float, float, float, float, float, float, float]:
    """I_ss with its derivatives by command, share, V_dz, J, G1, G2, G3.

    At V = V_dz the derivative is that of the dead side.
    """
    value = steady_current(command, share, V_dz, J, G1, G2, G3)
    d = max(command - V_dz, 0.0)
    slope = G1 + d * (2.0 * G2 + d * 3.0 * G3) if d > 0.0 else 0.0
    return value, slope, J, -slope, share, d, d * d, d * d * d
