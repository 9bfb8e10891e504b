"""Amplifier of the solenoids, the control card: voltage to currents (Kruse 2001, eqs. 3.1-3.9).

The card has two channels, one for each solenoid. Each sees the command times its direction (+1 or
-1) and returns a current magnitude, never negative. A channel is, in this order,

1. a delay τ: the command is read at t - τ by linear interpolation,
2. a static map with dead zone and jump,
3. a second-order filter with a Coulomb-like term,
4. a limiter of the output's rate with a decay at its end.

The filter has two forms. Kruse's recursion (eq. 3.6) belongs to its sample rate of 512 Hz: at
another rate the same ζ and ω describe another response. With the option `exact` the equation behind
it, I*'' + 2ζω I*' + C sign(I*') + ω² I* = ω² I_ss, is solved over each step instead, so that ζ, ω
and C mean the same at every rate.
"""

from math import cos, exp, inf, pi, sin, sqrt
from typing import Annotated, NamedTuple

from swashplate.machine import Definition, Flag, Model, Tap, Window, declared, equation
from swashplate.machine.fields import OFF
from swashplate.machine.library import faded, interpolated, soft_threshold

COULOMB_WIDTH = 0.01
"""Rate of current below which the smooth Coulomb sign is proportional to it. [A/s]"""
LONGEST_STEP = 1.0 / 512.0
"""A sample of Kruse's logs, at which the card and the pump are marched. [s]"""
MOST_SUBSTEPS = 1000
"""Steps a sample that anyone would wait for."""
BEYOND = "a command beyond the dead zone"
CHANGING = "a current that changes"


class CardChannel(NamedTuple):
    """Parameters of one channel.

    Plausible are currents of up to 100 A, alone or by each term of the gain at 10 V: solenoids take
    0.1 to 3 A. Times are those of electronics and ramps, from 1 µs to hours.
    """

    # fmt: off
    V_dz: Annotated[float, Definition("dead zone of the card", "V", lower=0.0, upper=10.0,
        source="3.3", needs=BEYOND, plausible=(0.0, 10.0))]
    J: Annotated[float, Definition("current jump at the edge of the dead zone", "A", lower=0.0,
        source="3.3", needs=BEYOND, plausible=(0.0, 100.0))]
    G1: Annotated[float, Definition("linear gain", "A/V", source="3.3", needs=BEYOND,
        plausible=(0.0, 10.0))]
    G2: Annotated[float, Definition("quadratic gain", "A/V^2", source="3.3", needs=BEYOND,
        plausible=(0.0, 1.0))]
    G3: Annotated[float, Definition("cubic gain", "A/V^3", source="3.3", needs=BEYOND,
        plausible=(0.0, 0.1))]
    zeta: Annotated[float, Definition("damping ratio of the current filter", "1", above=0.0,
        source="3.6", needs=CHANGING, plausible=(1e-3, 1e3))]
    omega: Annotated[float, Definition("natural frequency of the current filter", "rad/s",
        above=0.0, source="3.6", needs=CHANGING, plausible=(0.1, 1e6))]
    C: Annotated[float, Definition("Coulomb-like term of the current filter", "A/s^2", lower=0.0,
        source="3.6", needs=CHANGING, plausible=(0.0, 1e6))]
    lim1: Annotated[float, Definition("rate limit away from zero", "A/s", above=0.0,
        can_be_off=True, source="3.8", needs="a current rising at its limit",
        plausible=(1e-4, 1e5))]
    lim2: Annotated[float, Definition("rate limit towards zero", "A/s", above=0.0, can_be_off=True,
        source="3.9", needs="a current falling at its limit", plausible=(1e-4, 1e5))]
    I_t1: Annotated[float, Definition("current above which lim1 acts", "A", lower=0.0,
        can_be_off=True, source="3.8", needs="a current held back at I_t1",
        plausible=(0.0, 100.0))]
    I_t2: Annotated[float, Definition("current below which the decay acts", "A", lower=0.0,
        source="3.9", needs="a current that decays from I_t2", plausible=(0.0, 100.0))]
    a: Annotated[float, Definition("rate of the final decay", "1/s", lower=0.0, can_be_off=True,
        source="3.9", needs="a current that decays to its end", plausible=(0.0, 1e6))]
    # fmt: on


Command = Annotated[
    Window,
    Definition(
        "command of the card, positive towards positive speed", "V", lower=-10.0, upper=10.0
    ),
]
"""Beyond its range the card takes no voltage."""
SignedCurrent = Annotated[
    float, Definition("signed current, positive solenoid's less the negative one's", "A")
]
PositiveCurrent = Annotated[
    float, Definition("current of the solenoid towards positive speed, never negative", "A")
]
NegativeCurrent = Annotated[float, Definition("current of the other solenoid, never negative", "A")]


class CardInputs(NamedTuple):
    """The command as the card looks at it. [V]"""

    at: Command  # Three samples around t - τ, two from there and one before.
    span: Command  # Three samples around the end of the sample interval about t - τ, t - τ + h/2.


class Filter(NamedTuple):
    """State of one channel."""

    now: float  # I* at this sample; with `exact`, one sample earlier. [A]
    before: float  # I* one sample before `now` [A]; with `exact`, its rate at `now` [A/s].
    out: float  # I one sample earlier. [A]


class ChannelSignals(NamedTuple):
    """What is known of one channel at a sample."""

    current: float
    steady: float
    filtered: float
    rate: float


class CardOptions(NamedTuple):
    """Forms of the card."""

    literal: Flag = OFF  # Literal sign of the Coulomb term in the recursion, not the smooth one.
    split: Flag = OFF  # lim1 and the decay take over within a step, at I_t1 and I_t2.
    exact: Flag = OFF  # The filter's differential equation, in place of the recursion for 512 Hz.


class Card(NamedTuple):
    """Parameters of the card: two channels and the delay that both share."""

    # fmt: off
    plus: CardChannel
    minus: CardChannel
    tau: Annotated[float, Definition("delay", "s", lower=0.0, upper=10.0, source="3.4",
        needs=BEYOND, plausible=(0.0, 10.0))]
    # fmt: on


class CardState(NamedTuple):
    """State of both channels."""

    plus: Filter
    minus: Filter


class CardSignals(NamedTuple):
    """What is known of the card at a sample."""

    current: SignedCurrent
    current_positive: PositiveCurrent
    current_negative: NegativeCurrent
    steady_positive: float  # I_ss of the positive channel. [A]
    steady_negative: float  # I_ss of the negative channel. [A]
    filtered_positive: float  # I* of the positive channel. [A]
    filtered_negative: float  # I* of the negative channel. [A]
    rate_positive: float  # Rate of I* of the positive channel. [A/s]
    rate_negative: float  # Rate of I* of the negative channel. [A/s]


class Currents(NamedTuple):
    """A signed current as the channels of a card would have it. [A]"""

    current: SignedCurrent
    current_positive: PositiveCurrent
    current_negative: NegativeCurrent


class CardLimits(NamedTuple):
    """Limits of the card that can act at a sample."""

    current_rate: bool  # A rate limit sets the current.


# --- command to settled current ------------------------------------------------------------------


@equation
def share_above(first: float, last: float, threshold: float) -> float:
    """Share of a straight segment that lies above a threshold, 0 to 1."""
    a = first - threshold
    b = last - threshold
    if a > 0.0 and b > 0.0:
        return 1.0
    if a <= 0.0 and b <= 0.0:
        return 0.0
    return max(a, b) / abs(a - b)


@declared(share_above)
def _share_above(first: float, last: float, threshold: float) -> tuple[float, float, float]:
    # the crossing moves with both ends, each by how near it lies; at the threshold nothing moves
    crosses = (first > threshold) != (last > threshold)
    per_volt = 1.0 / abs(last - first) if crosses else 0.0
    at = (threshold - first) / (last - first) if crosses else 0.0
    return per_volt * (1.0 - at), per_volt * at, -per_volt


@equation
def jump_share(
    newest: float, middle: float, oldest: float, fraction: float, threshold: float
) -> float:
    """Share s of one sample interval in which the command exceeds the dead zone, 0 to 1.

    Of three neighbouring samples of the channel's command [V]; the interval's end lies `fraction`
    of a sample behind `newest`. Switched by whole samples instead, the current would jump with V_dz
    and τ, and no fit could move either.
    """
    first = interpolated(middle, oldest, fraction)
    last = interpolated(newest, middle, fraction)
    return fraction * share_above(first, middle, threshold) + (1.0 - fraction) * share_above(
        middle, last, threshold
    )


@equation
def steady_current(command: float, share: float, p: CardChannel) -> float:
    """Current that a channel settles at, of the delayed command in its direction [V].

    Parameters
    ----------
    command : float
        Delayed command V in the channel's direction. [V]
    share : float
        Share s of the current jump, see `jump_share`. [1]
    p : Channel
        Parameters of the channel.

    Returns
    -------
    float
        I_ss = J s + G1 d + G2 d² + G3 d³ with d = max(V - V_dz, 0); Kruse eq. 3.3. [A]
    """
    d = max(command - p.V_dz, 0.0)
    return p.J * share + d * (p.G1 + d * (p.G2 + d * p.G3))


@equation
def channel_level(voltage: float, p: CardChannel) -> float:
    """Current at which a channel settles under a constant `voltage` in its direction. [A]"""
    return steady_current(voltage, 1.0 if voltage > p.V_dz else 0.0, p)


# --- Kruse's recursion ----------------------------------------------------------------------


@equation
def coulomb_sign(change: float, h: float, literal: Flag) -> float:
    """Sign of the filter's rate: smooth within ±0.01 A/s, or the literal sign on request."""
    if literal is None:
        return min(max(change / (COULOMB_WIDTH * h), -1.0), 1.0)
    return (1.0 if change > 0.0 else 0.0) - (1.0 if change < 0.0 else 0.0)


@equation
def filtered_current(
    now: float, before: float, steady: float, p: CardChannel, h: float, literal: Flag
) -> float:
    """I* at the next sample by Kruse's recursion, eq. 3.6. [A]

    Of I* at this sample and the one before and of I_ss [A]; `literal` takes the literal sign of the
    rate. Stable for ωh < 2ζ and ζωh < 1 + ω²h²/4 only (Jury).
    """
    w = p.omega * h
    friction = p.C * h * h * coulomb_sign(now - before, h, literal)
    following = (
        2.0 * (1.0 - p.zeta * w) * now
        + (2.0 * p.zeta * w - w * w - 1.0) * before
        - friction
        + w * w * steady
    )
    return faded(following)


@equation
def step_limit(zeta: float, exact: Flag) -> float:
    """Largest ωh, itself excluded, that a channel's filter bears.

    Recursion: Jury's criterion for z² - 2(1 - ζωh) z + 1 - 2ζωh + ω²h² is ωh < 2ζ and
    ζωh < 1 + ω²h²/4. The first condition is the stricter one where damping is small: an explicit
    step adds to a swing what the damping has to take away. From ζ = 1 on the second gives
    ωh < 2(ζ - √(ζ² - 1)), here written without cancellation. Differential equation (`exact`): half
    a swing, ωh √(1 - ζ²) < π, within which its Coulomb term may count as constant.
    """
    if exact is None:
        over = max(zeta, 1.0)
        slow = 2.0 / (over + sqrt(over - 1.0) * sqrt(over + 1.0))
        return min(2.0 * zeta, slow)
    share = sqrt(max(1.0 - zeta * zeta, 0.0))
    return pi / share if share > 0.0 else inf


@equation
def current_acceleration(
    current: float, rate: float, steady: float, p: CardChannel, literal: Flag
) -> float:
    """Second derivative of I*, of which the recursion is the discrete form.

    I*'' = ω² (I_ss - I*) - 2ζω I*' - C sgn I*'; Kruse eq. 3.7 (erratum 3). [A/s²]
    """
    friction = p.C * coulomb_sign(rate, 1.0, literal)
    return p.omega * p.omega * (steady - current) - 2.0 * p.zeta * p.omega * rate - friction


# --- the filter's differential equation ----------------------------------------------------------


@equation
def damped_waves(zeta: float, w: float) -> tuple[float, float]:
    """The two functions of a damped oscillator at w = ω t, e^(-ζw) cosh r and e^(-ζw) sinh r/r.

    r² = (ζ² - 1) w² is negative where the oscillator swings: cosh r and sinh r/r are then cos |r|
    and sin |r|/|r|. Both are entire functions of r², smooth at critical damping, where the power
    series computes them, to below rounding up to |r| = 1.
    """
    q = (zeta * zeta - 1.0) * w * w
    if q > 1.0:
        r = sqrt(q)
        rises = exp(r - zeta * w)
        falls = exp(-r - zeta * w)
        return 0.5 * (rises + falls), 0.5 * (rises - falls) / r
    e = exp(-zeta * w)
    if q < -1.0:
        r = sqrt(-q)
        return e * cos(r), e * sin(r) / r
    even = 1.0 + q / 240.0 * (1.0 + q / 306.0 * (1.0 + q / 380.0))
    even = 1.0 + q / 90.0 * (1.0 + q / 132.0 * (1.0 + q / 182.0 * even))
    even = 1.0 + q / 2.0 * (1.0 + q / 12.0 * (1.0 + q / 30.0 * (1.0 + q / 56.0 * even)))
    odd = 1.0 + q / 272.0 * (1.0 + q / 342.0 * (1.0 + q / 420.0))
    odd = 1.0 + q / 110.0 * (1.0 + q / 156.0 * (1.0 + q / 210.0 * odd))
    odd = 1.0 + q / 6.0 * (1.0 + q / 20.0 * (1.0 + q / 42.0 * (1.0 + q / 72.0 * odd)))
    return e * even, e * odd


@equation
def piece(
    first: float, last: float, length: float, centre: float, p: CardChannel
) -> tuple[float, float]:
    """Integral of I_ss over a straight piece of the command, and its moment, in steps. [A]

    The piece goes from `first` to `last` [V]; its length and its centre, counted from the middle of
    the step, are in steps. The part beyond the dead zone lies at the end of a rise, at the
    beginning of a fall. Over it the polynomial counts as straight.
    """
    on = length * share_above(first, last, p.V_dz)
    shift = 0.5 * (length - on)
    at = centre + (shift if last > first else -shift)
    begins = steady_current(first, 1.0, p)
    ends = steady_current(last, 1.0, p)
    integral = 0.5 * (begins + ends) * on
    return integral, integral * at + (ends - begins) * on * on / 12.0


@equation
def steady_course(direction: float, at: Window, p: CardChannel) -> tuple[float, float]:
    """I_ss at both ends of the step that ends at this sample, if it went straight between them. [A]

    The straight line has the integral and the moment of I_ss over the step: the command goes
    straight between samples, one of which lies within the step; a jump happens where it passes
    V_dz. A line through the two ends alone would come too early or too late by up to half a step,
    and smear a jump over two. Nothing is seen of the command after t - τ.
    """
    middle = direction * at.s[1]
    first = direction * interpolated(at.s[1], at.s[2], at.f)
    last = direction * interpolated(at.s[0], at.s[1], at.f)
    older, older_moment = piece(first, middle, at.f, 0.5 * (at.f - 1.0), p)
    newer, newer_moment = piece(middle, last, 1.0 - at.f, 0.5 * at.f, p)
    mean = older + newer
    half_rise = 6.0 * (older_moment + newer_moment)
    return mean - half_rise, mean + half_rise


@equation
def exact_filter(
    s: Filter, begins: float, ends: float, p: CardChannel, h: float
) -> tuple[float, float]:
    """I* [A] and its rate [A/s] at this sample, from the state and I_ss of the step between.

    With C = e^(-ζw) cosh r and S = e^(-ζw) sinh r/r of `damped_waves` at w = ωh, the solution of
    I'' + 2ζω I' + ω² I = ω² I_ss is I = (C + ζwS) I_0 + hS I_0', I' = -ω²hS I_0 + (C - ζwS) I_0'
    without I_ss; under an I_ss that rises by 1 A, straight over the step,
    I = 1 - 2ζ/w (1 - C - ζwS) - S and I' = (1 - C - ζwS)/h.

    The Coulomb term is a constant between ±C, as large as it must be: it takes C e^(-ζw) h sinh r/r
    of the rate, but stops at zero, where it holds the current. So it sticks exactly, at any step.
    """
    w = p.omega * h
    even, odd = damped_waves(p.zeta, w)
    stays = even + p.zeta * w * odd  # I* one step after 1 A, at rest, without I_ss. [1]
    gone = 1.0 - stays
    swings = h * odd  # I* one step after 1 A/s, without I_ss. [s]
    pull = p.omega * p.omega * swings  # Rate one step after I_ss came up to 1 A, at rest. [1/s]
    slows = even - p.zeta * w * odd  # Rate one step after 1 A/s, without I_ss. [1]
    ramp = 1.0 - 2.0 * p.zeta / w * gone - odd  # I* after I_ss rose from 0 to 1 A in a step. [1]
    ramp_rate = gone / h  # Rate of I* after that step. [1/s]

    off = s.now - begins
    rise = ends - begins
    rate = slows * s.before - pull * off + ramp_rate * rise
    width = p.C * swings  # Rate that the Coulomb term can take in a step. [A/s]
    left = soft_threshold(rate, width)
    filtered = begins + stays * off + swings * s.before + ramp * rise
    lost = gone / pull  # I* lost for each rate that the Coulomb term takes. [s]
    return faded(filtered - lost * (rate - left)), faded(left)


# --- filter to output ----------------------------------------------------------------------------


@equation
def limited_current(
    target: float, previous: float, steady: float, p: CardChannel, h: float, split: Flag
) -> float:
    """Channel output: the filter's state `target` behind rate limits and the final decay. [A]

    Kruse eqs. 3.8 and 3.9 as a limiter of position, because the printed rate form does not keep the
    steady level. `previous` is the output one sample earlier; I_ss = 0 means that the command has
    gone. Without `split` lim1 takes over from the filter, and the decay from lim2, at a step's end;
    with it where the output passes I_t1 or I_t2: then it follows both thresholds, and anything
    before them, without flat stretches or jumps.
    """
    decay = exp(-p.a * h)  # What the final decay leaves of the current after a step. [1]
    rising = target >= previous
    above_I_t2 = previous > p.I_t2
    if rising:
        if target <= p.I_t1:
            return target
        if split is None or previous >= p.I_t1:
            return min(max(previous, p.I_t1) + p.lim1 * h, target)
        # the way to I_t1 counts as straight, what is left of the step is lim1's
        return min(p.I_t1 + p.lim1 * h * (target - p.I_t1) / (target - previous), target)
    if above_I_t2:
        fallen = max(previous - p.lim2 * h, 0.0, target)
        if split is None or fallen >= p.I_t2:
            return fallen
        # both the way to I_t2 and the decay that is left of the step count as straight
        left = p.I_t2 * (decay + (previous - p.I_t2) / (previous - fallen) * (1.0 - decay))
        return left if steady == 0.0 else max(left, target)
    left = faded(previous * decay)
    return left if steady == 0.0 else max(left, target)


@equation
def rate_limit_active(output: float, target: float, previous: float, I_t2: float) -> bool:
    """Whether a rate limit, rather than the filter or the decay, sets the output."""
    if target >= previous:
        return output < target
    return previous > I_t2 and output > max(target, 0.0)


# --- one channel ----------------------------------------------------------------------------------


@equation
def channel_sample(
    state: Filter,
    inputs: CardInputs,
    direction: float,
    p: CardChannel,
    h: float,
    options: CardOptions,
) -> ChannelSignals:
    """One channel at a sample; `direction` is +1.0 or -1.0."""
    span = inputs.span
    share = jump_share(
        direction * span.s[0], direction * span.s[1], direction * span.s[2], span.f, p.V_dz
    )
    command = interpolated(inputs.at.s[0], inputs.at.s[1], inputs.at.f)
    steady = steady_current(direction * command, share, p)
    if options.exact is None:
        filtered = state.now
        rate = (state.now - state.before) / h
    else:
        begins, ends = steady_course(direction, inputs.at, p)
        filtered, rate = exact_filter(state, begins, ends, p, h)
    current = limited_current(filtered, state.out, steady, p, h, options.split)
    return ChannelSignals(current, steady, filtered, rate)


@equation
def channel_step(
    state: Filter, at: ChannelSignals, p: CardChannel, h: float, options: CardOptions
) -> Filter:
    """One channel from a sample to the next."""
    if options.exact is None:
        following = filtered_current(state.now, state.before, at.steady, p, h, options.literal)
        return Filter(following, state.now, at.current)
    return Filter(at.filtered, at.rate, at.current)


@equation
def channel_rates(state: Filter, command: float, p: CardChannel, options: CardOptions) -> Filter:
    """Rates of I* and of its rate, which is `before` here, in continuous time."""
    steady = steady_current(command, 1.0, p)
    faster = current_acceleration(state.now, state.before, steady, p, options.literal)
    return Filter(state.before, faster, 0.0)


@equation
def channel_settled(level: float, options: CardOptions) -> Filter:
    """State of a channel that has settled at a current. [A]"""
    return Filter(level, level if options.exact is None else 0.0, level)


# --- the card ------------------------------------------------------------------------------------


@equation
def stable_step(p: Card, h: float, options: CardOptions) -> float:
    """Share of the step that the filters would still bear, above 0 where they are stable. [1]"""
    plus = p.plus.omega * h / step_limit(p.plus.zeta, options.exact)
    minus = p.minus.omega * h / step_limit(p.minus.zeta, options.exact)
    return 1.0 - max(plus, minus)


def unstable_filter(p: Card, h: float, options: CardOptions) -> str:
    """What is wrong with a step [s] at which a filter is unstable, for a sentence."""
    channels = {"plus": p.plus, "minus": p.minus}
    steps_of = {
        side: channel.omega * h / step_limit(channel.zeta, options.exact)
        for side, channel in channels.items()
    }
    side = max(steps_of, key=steps_of.__getitem__)
    channel, steps = channels[side], steps_of[side]
    enough = f"substeps={steps // 1.0 + 1.0:.0f} or more, a higher rate"
    if not steps < MOST_SUBSTEPS:
        enough = "a zeta nearer to 1"
    wrong = "is unstable at" if options.exact is None else "swings too fast for"
    return (
        f"the current filter of the {side} channel (zeta = {channel.zeta:g}, omega = "
        f"{channel.omega:g} rad/s) {wrong} a step of 1/{1.0 / h:g} s; simulate with {enough} or a "
        "lower omega."
    )


@equation
def card_sample(
    state: CardState, inputs: CardInputs, p: Card, h: float, options: CardOptions
) -> CardSignals:
    """Currents of the card at a sample."""
    plus = channel_sample(state.plus, inputs, 1.0, p.plus, h, options)
    minus = channel_sample(state.minus, inputs, -1.0, p.minus, h, options)
    return CardSignals(
        current=plus.current - minus.current,
        current_positive=plus.current,
        current_negative=minus.current,
        steady_positive=plus.steady,
        steady_negative=minus.steady,
        filtered_positive=plus.filtered,
        filtered_negative=minus.filtered,
        rate_positive=plus.rate,
        rate_negative=minus.rate,
    )


@equation
def card_step(
    state: CardState,
    signals: CardSignals,
    inputs: CardInputs,
    p: Card,
    h: float,
    options: CardOptions,
) -> CardState:
    """The card from a sample to the next."""
    plus = ChannelSignals(
        signals.current_positive,
        signals.steady_positive,
        signals.filtered_positive,
        signals.rate_positive,
    )
    minus = ChannelSignals(
        signals.current_negative,
        signals.steady_negative,
        signals.filtered_negative,
        signals.rate_negative,
    )
    return CardState(
        channel_step(state.plus, plus, p.plus, h, options),
        channel_step(state.minus, minus, p.minus, h, options),
    )


@equation
def card_rates(state: CardState, voltage: float, p: Card, options: CardOptions) -> CardState:
    """Rates of the card's state under the delayed command, while no rate limit acts. [1/s]"""
    plus = channel_rates(state.plus, voltage, p.plus, options)
    return CardState(plus, channel_rates(state.minus, -voltage, p.minus, options))


@equation
def card_settled(inputs: CardInputs, p: Card, options: CardOptions) -> CardState:
    """State that a card settles at under a constant command, the newest that it sees."""
    voltage = inputs.at.s[0]
    return CardState(
        channel_settled(channel_level(voltage, p.plus), options),
        channel_settled(channel_level(-voltage, p.minus), options),
    )


@equation
def card_limits(
    state: CardState,
    signals: CardSignals,
    inputs: CardInputs,
    p: Card,
    options: CardOptions,
) -> CardLimits:
    """Limits that act at a sample."""
    return CardLimits(
        rate_limit_active(
            signals.current_positive, signals.filtered_positive, state.plus.out, p.plus.I_t2
        )
        or rate_limit_active(
            signals.current_negative, signals.filtered_negative, state.minus.out, p.minus.I_t2
        )
    )


@equation
def flowing_currents(state: CardState) -> Currents:
    """Currents of a card while no rate limit acts."""
    return Currents(state.plus.now - state.minus.now, state.plus.now, state.minus.now)


@equation
def flowing_rest(voltage: float, p: Card) -> CardState:
    """State of a card in continuous time under a constant command. [V]"""
    plus, minus = channel_level(voltage, p.plus), channel_level(-voltage, p.minus)
    return CardState(Filter(plus, 0.0, plus), Filter(minus, 0.0, minus))


# --- the models -----------------------------------------------------------------------------------

card = Model(
    "card",
    parameters=Card,
    state=CardState,
    step=card_step,
    sample=card_sample,
    settled=card_settled,
    inputs=CardInputs,
    taps={
        "at": Tap("voltage", delay="tau", width=3),
        "span": Tap("voltage", delay="tau", ahead=0.5, width=3),
    },
    options=CardOptions,
    limits=card_limits,
    stable=stable_step,
    unstable=unstable_filter,
    longest_step=LONGEST_STEP,
    any_step="exact",
)

flowing_card = Model(
    "card",
    parameters=Card,
    state=CardState,
    step=card_rates,
    sample=flowing_currents,
    settled=flowing_rest,
    options=CardOptions,
)
"""The card in continuous time: rates in place of the step, and no delay."""
