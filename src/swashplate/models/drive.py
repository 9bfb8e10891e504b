"""The drive: card and pump in series, and the pump alone behind a given current."""

from dataclasses import replace
from math import sqrt
from typing import NamedTuple

from swashplate.equations.equation import equation
from swashplate.equations.model import Model, Tap, join
from swashplate.models.card import (
    Card,
    CardInputs,
    CardOptions,
    CardState,
    Filter,
    card_constants,
    card_limits,
    card_rates,
    card_rest,
    card_sample,
    card_settled,
    card_step,
    channel_level,
)
from swashplate.models.pump import (
    Pump,
    PumpInputs,
    PumpOptions,
    PumpState,
    pump_constants,
    pump_domain,
    pump_limits,
    pump_rates,
    pump_rest,
    pump_sample,
    pump_settled,
    pump_step,
)


def overpowered(margin: float, cause: str) -> str:
    """What has happened where sin²φ is not below 1, for a sentence."""
    return (
        f"Z5·F/√Z4 reaches {sqrt(1.0 - margin):.4g} under this {cause}, but must stay below 1, "
        "where the solenoid overpowers the feedback spring; check Z19 to Z22, Z4, Z5 and the "
        f"{cause}'s size."
    )


card = Model(
    "card",
    parameters=Card,
    state=CardState,
    step=card_step,
    sample=card_sample,
    constants=card_constants,
    rest=card_rest,
    settled=card_settled,
    inputs=CardInputs,
    taps={
        "at": Tap("voltage", delay="tau", width=3),
        "span": Tap("voltage", delay="tau", ahead=0.5, width=3),
    },
    options=CardOptions,
    limits=card_limits,
)

pump = Model(
    "pump",
    parameters=Pump,
    state=PumpState,
    step=pump_step,
    sample=pump_sample,
    constants=pump_constants,
    rest=pump_rest,
    settled=pump_settled,
    inputs=PumpInputs,
    defaults={"pump_speed": "pump_speed", "load_torque": "load_torque", "supply_pressure": "Z9"},
    options=PumpOptions,
    limits=pump_limits,
    domain=pump_domain,
    integrals={"shaft_position": "shaft_speed"},
    free_start={"pressure": ("pressure", "plate_pressure")},
    outside=overpowered,
)


@equation
def signed_current(current_positive: float, current_negative: float) -> float:
    """Current of the positive channel less that of the negative one. [A]"""
    return current_positive - current_negative


@equation
def current_sum(current_positive: float, current_negative: float) -> float:
    """What an ammeter around both leads reads. [A]"""
    return current_positive + current_negative


drive = join(
    "drive",
    card,
    pump,
    links={"current": signed_current, "current_sum": current_sum},
    integrals={"shaft_position": "shaft_speed"},
)


class Source(NamedTuple):
    """A given current has no parameters."""


class SourceState(NamedTuple):
    """A given current remembers nothing."""


class Currents(NamedTuple):
    """A signed current as the channels of a card would have it. [A]"""

    current: float
    current_positive: float
    current_negative: float


@equation
def current_sample(current: float) -> Currents:
    """A given signed current, and its positive and negative part."""
    return Currents(current, max(0.0, current), max(0.0, -current))


@equation
def current_step(state: SourceState) -> SourceState:
    """Nothing to remember."""
    return state


source = Model(
    "source", parameters=Source, state=SourceState, step=current_step, sample=current_sample
)

pump_drive = join(
    "pump_drive",
    source,
    pump,
    links={"current_sum": current_sum},
    integrals={"shaft_position": "shaft_speed"},
)
"""Pump and motor behind a signed current."""


@equation
def flowing_currents(state: CardState) -> Currents:
    """Currents of a card while no rate limit acts."""
    return Currents(state.plus.now - state.minus.now, state.plus.now, state.minus.now)


@equation
def flowing_rest(voltage: float, p: Card) -> CardState:
    """State of a card in continuous time under a constant command. [V]"""
    plus, minus = channel_level(voltage, p.plus), channel_level(-voltage, p.minus)
    return CardState(Filter(plus, 0.0, plus), Filter(minus, 0.0, minus))


flowing_card = Model(
    "card",
    parameters=Card,
    state=CardState,
    step=card_rates,
    sample=flowing_currents,
    settled=flowing_rest,
    options=CardOptions,
)
flowing_pump = replace(pump, step=pump_rates, parts=())
flowing_drive, flowing_pump_drive = (
    join(name, before, flowing_pump, links={"current_sum": current_sum})
    for name, before in (("drive", flowing_card), ("pump_drive", source))
)
"""Both in continuous time: rates in place of the step, and no delay."""
