"""Control card: settled current to solenoid current (Kruse 2001, eqs. 3.5-3.9).

The dynamics of one channel: a second-order filter with a Coulomb-like term, then a limiter of the
output's rate with a decay at its end. All currents are magnitudes.
"""

from math import exp

from swashplate.physics.component import component

COULOMB_WIDTH = 0.01
"""Rate of current below which the smooth Coulomb sign is proportional to it. [A/s]"""
FADED = 1e-30
"""Current that counts as none: fading on into denormal numbers makes a march at rest 2.5 times as
long. The derivatives take no notice. [A]"""


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
        I* at the next sample; Kruse eq. 3.6. Stable for ωh < 2ζ and ζωh < 1 + ω²h²/4 only. [A]
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
def remaining_decay(previous: float, fallen: float, I_t2: float, decay: float) -> float:
    """What the rest of a step leaves of I_t2, where the output passes it on the way to `fallen`.

    Both the way there and the decay count as straight within the step. [1]
    """
    return decay + (previous - I_t2) / (previous - fallen) * (1.0 - decay)


@component
def taken_over(target: float, previous: float, I_t1: float, lim1: float, step: float) -> float:
    """Output after a step in which it passes I_t1 on the way to `target` and then rises by lim1.

    The way to I_t1 counts as straight, as steep as from `previous` to `target` in one step. [A]
    """
    return I_t1 + lim1 * step * (target - I_t1) / (target - previous)


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
    split: bool | None = None,
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
    split : None or True
        Where within a step lim1 takes over from the filter, and the decay from lim2: None at the
        step's end, True where the output passes I_t1 or I_t2. Then it follows both thresholds,
        and anything before them, without flat stretches or jumps.

    Returns
    -------
    float
        I, never negative; Kruse eqs. 3.8 and 3.9 as a limiter of position, because the printed
        rate form does not keep the steady level. [A]
    """
    if target >= previous:
        if target <= I_t1:
            return target
        if split is None or previous >= I_t1:
            return min(target, max(previous, I_t1) + lim1 * step)
        return min(target, taken_over(target, previous, I_t1, lim1, step))
    if previous > I_t2:
        fallen = max(target, previous - lim2 * step, 0.0)
        if split is None or fallen >= I_t2:
            return fallen
        left = I_t2 * remaining_decay(previous, fallen, I_t2, decay)
        return left if steady == 0.0 else max(target, left)
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
    split: bool | None = None,
) -> tuple[float, float, float, float, float, float, float, float]:
    """I with its derivatives by target, previous, lim1, lim2, I_t1, I_t2, decay.

    At a switch the unlimited side counts. Unless the step is split, I_t2 only chooses a branch, so
    its derivative is zero; it is returned so that every parameter has one. I_t1 then counts only
    where the filter rises by more than lim1 h beyond it in the very step that passes it.
    """
    value = limited_current(target, previous, steady, lim1, lim2, I_t1, I_t2, decay, step, split)
    if target >= previous:
        if target <= I_t1 or value == target:
            return value, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        if previous > I_t1:
            return value, 0.0, 1.0, step, 0.0, 0.0, 0.0, 0.0
        if split is not None:
            way = 1.0 / (target - previous)
            share = (target - I_t1) * way
            steep = lim1 * step * way
            return (
                value,
                steep * (1.0 - share),
                steep * share,
                step * share,
                0.0,
                1.0 - steep,
                0.0,
                0.0,
            )
        return value, 0.0, 0.0, step, 0.0, 1.0, 0.0, 0.0
    if previous > I_t2:
        fallen = max(target, previous - lim2 * step, 0.0)
        if split is not None and fallen < I_t2:
            if steady != 0.0 and value == target:
                return value, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            # I_t2 (decay + share (1 - decay)), and the share by both ends of the way down
            way = 1.0 / (previous - fallen)
            share = (previous - I_t2) * way
            by_share = I_t2 * (1.0 - decay)
            by_fallen = by_share * share * way
            target_falls = 1.0 if fallen == target else 0.0
            limit_falls = 0.0 if fallen == target or fallen == 0.0 else 1.0
            by_previous = by_share * way * (1.0 - share) + by_fallen * limit_falls
            return (
                value,
                by_fallen * target_falls,
                by_previous,
                0.0,
                -step * by_fallen * limit_falls,
                0.0,
                decay + share * (1.0 - decay) - by_share * way,
                I_t2 * (1.0 - share),
            )
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
