"""Control card: voltage to solenoid currents (Kruse 2001, eqs. 3.1-3.9).

The card has two channels, one for each solenoid; `swashplate.models.channel` has their equations.
Each sees the command times its direction (+1 or -1) and returns a current magnitude, never
negative.
"""

from typing import Annotated, NamedTuple

from swashplate.equations.declaration import equation
from swashplate.equations.fields import Definition
from swashplate.equations.model import Model, Tap
from swashplate.models.channel import (
    BEYOND,
    CardInputs,
    CardOptions,
    Channel,
    ChannelSignals,
    Filter,
    channel_level,
    channel_rates,
    channel_sample,
    channel_settled,
    channel_step,
    rate_limit_active,
    step_limit,
)


class Card(NamedTuple):
    """Parameters of the card: two channels and the delay that both share."""

    # fmt: off
    plus: Channel
    minus: Channel
    tau: Annotated[float, Definition("delay", "s", lower=0.0, upper=10.0, source="3.4",
        needs=BEYOND, plausible=(0.0, 10.0))]
    # fmt: on


class CardState(NamedTuple):
    """State of both channels."""

    plus: Filter
    minus: Filter


class CardSignals(NamedTuple):
    """What is known of the card at a sample."""

    current: float  # Signed, that of the positive channel less that of the negative one. [A]
    current_positive: float
    current_negative: float  # I of each channel, never negative. [A]
    steady_positive: float
    steady_negative: float  # I_ss of each channel. [A]
    filtered_positive: float
    filtered_negative: float  # I* of each channel. [A]
    rate_positive: float
    rate_negative: float  # Rate of I* of each channel. [A/s]


class Currents(NamedTuple):
    """A signed current as the channels of a card would have it. [A]"""

    current: float
    current_positive: float
    current_negative: float


class CardLimits(NamedTuple):
    """Limits of the card that can act at a sample."""

    current_rate: bool  # A rate limit sets the current.


# --- the card ------------------------------------------------------------------------------------


@equation
def stable_step(p: Card, h: float, options: CardOptions) -> float:
    """Share of the step that the filters would still bear, above 0 where they are stable. [1]"""
    plus = p.plus.omega * h / step_limit(p.plus.zeta, options.exact)
    minus = p.minus.omega * h / step_limit(p.minus.zeta, options.exact)
    return 1.0 - max(plus, minus)


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
