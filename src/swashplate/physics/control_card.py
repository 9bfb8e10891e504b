"""Control card: joystick voltage to solenoid current (Kruse 2001, eqs. 3.1-3.9).

The card has two channels, one for each solenoid. Each sees the command times its direction
(+1 or -1) and returns a current magnitude, never negative. A channel is, in this order, a delay,
a static map with dead zone and jump, a second-order filter and a limiter of the output's rate.
"""

from math import exp

from swashplate.physics.component import component

COULOMB_WIDTH = 0.01
"""Rate of current below which the smooth Coulomb sign is proportional to it. [A/s]"""
FADED = 1e-30
"""Current that counts as none: fading on into denormal numbers makes a march at rest 2.5 times as
long. The derivatives take no notice. [A]"""


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


@component
def coulomb_sign(change: float, step: float, literal: bool | None) -> float:
    """Sign of the filter's rate: smooth within ±0.01 A/s, or the literal sign on request."""
    if literal is None:
        return min(max(change / (COULOMB_WIDTH * step), -1.0), 1.0)
    return (1.0 if change > 0.0 else 0.0) - (1.0 if change < 0.0 else 0.0)


@component
def filtered_current(
    current: float,
    previous: float,
    steady: float,
    zeta: float,
    omega: float,
    C: float,
    step: float,
    literal: bool | None,
) -> float:
    """Next state of the second-order filter with its Coulomb-like term.

    Parameters
    ----------
    current, previous : float
        Filter state I* at this sample and the one before. [A]
    steady : float
        I_ss at this sample. [A]
    zeta, omega, C : float
        Damping [1], natural frequency [rad/s] and Coulomb term [A/s²].
    step : float
        h. [s]
    literal : None or True
        True takes the literal sign of the rate, None the smooth one.

    Returns
    -------
    float
        I* at the next sample; Kruse eq. 3.6. Stable for ωh < 2 and ζωh < 1 + ω²h²/4 only. [A]
    """
    w = omega * step
    friction = C * step * step * coulomb_sign(current - previous, step, literal)
    following = (
        2.0 * (1.0 - zeta * w) * current
        + (2.0 * zeta * w - w * w - 1.0) * previous
        - friction
        + w * w * steady
    )
    return 0.0 if abs(following) < FADED else following


@component
def filter_partials(
    current: float,
    previous: float,
    steady: float,
    zeta: float,
    omega: float,
    C: float,
    step: float,
    literal: bool | None,
) -> tuple[float, float, float, float, float, float, float]:
    """Next I* with its derivatives by current, previous, steady, zeta, omega, C.

    Where the smooth sign saturates its slope is zero, the ends included; the literal sign has no
    slope anywhere.
    """
    value = filtered_current(current, previous, steady, zeta, omega, C, step, literal)
    w = omega * step
    sign = coulomb_sign(current - previous, step, literal)
    stiffness = 0.0
    if literal is None and abs(sign) < 1.0:
        stiffness = C * step / COULOMB_WIDTH
    d_current = 2.0 * (1.0 - zeta * w) - stiffness
    d_previous = 2.0 * zeta * w - w * w - 1.0 + stiffness
    d_zeta = 2.0 * w * (previous - current)
    d_omega = 2.0 * step * (zeta * (previous - current) + w * (steady - previous))
    return value, d_current, d_previous, w * w, d_zeta, d_omega, -step * step * sign


@component
def decay_factor(a: float, step: float) -> float:
    """What one step of the final decay leaves of the current, exp(-a h)."""
    return exp(-a * step)


@component
def decay_partials(a: float, step: float) -> tuple[float, float]:
    """exp(-a h) with its derivative by a."""
    decay = decay_factor(a, step)
    return decay, -step * decay


@component
def limited_current(
    target: float,
    previous: float,
    steady: float,
    lim1: float,
    lim2: float,
    I_t1: float,
    I_t2: float,
    decay: float,
    step: float,
) -> float:
    """Channel output: the filter's state behind rate limits and the final decay.

    Parameters
    ----------
    target : float
        Filter state I*. [A]
    previous : float
        Output one sample earlier. [A]
    steady : float
        I_ss; zero means that the command has gone. [A]
    lim1, lim2 : float
        Rate limits away from and towards zero, magnitudes, `inf` for none. [A/s]
    I_t1, I_t2 : float
        Output current above which lim1 acts, and below which lim2 gives way to the decay. [A]
    decay : float
        exp(-a h), see `decay_factor`.
    step : float
        h. [s]

    Returns
    -------
    float
        I, never negative; Kruse eqs. 3.8 and 3.9 as a limiter of position, because the printed
        rate form does not keep the steady level. [A]
    """
    if target >= previous:
        if target <= I_t1:
            return target
        return min(target, max(previous, I_t1) + lim1 * step)
    if previous > I_t2:
        return max(target, previous - lim2 * step, 0.0)
    left = previous * decay
    if left < FADED:
        left = 0.0
    return left if steady == 0.0 else max(target, left)


@component
def limiter_partials(
    target: float,
    previous: float,
    steady: float,
    lim1: float,
    lim2: float,
    I_t1: float,
    I_t2: float,
    decay: float,
    step: float,
) -> tuple[float, float, float, float, float, float, float, float]:
    """I with its derivatives by target, previous, lim1, lim2, I_t1, I_t2, decay.

    At a switch the unlimited side counts. I_t2 only chooses a branch, so its derivative is zero;
    it is returned so that every parameter has one.
    """
    value = limited_current(target, previous, steady, lim1, lim2, I_t1, I_t2, decay, step)
    if target >= previous:
        if target <= I_t1 or value == target:
            return value, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        if previous > I_t1:
            return value, 0.0, 1.0, step, 0.0, 0.0, 0.0, 0.0
        return value, 0.0, 0.0, step, 0.0, 1.0, 0.0, 0.0
    if previous > I_t2:
        if value == target:
            return value, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        if value == 0.0:
            return value, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        return value, 0.0, 1.0, 0.0, -step, 0.0, 0.0, 0.0
    if steady != 0.0 and value == target:
        return value, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    return value, 0.0, decay, 0.0, 0.0, 0.0, 0.0, previous


@component
def rate_limit_active(output: float, target: float, previous: float, I_t2: float) -> bool:
    """Whether a rate limit, rather than the filter or the decay, sets the output."""
    if target >= previous:
        return output < target
    return previous > I_t2 and output > max(target, 0.0)
