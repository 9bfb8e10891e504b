"""The drive: card and pump in series, and the pump alone behind a given current."""

from dataclasses import replace
from typing import NamedTuple

from swashplate.equations.equation import equation
from swashplate.equations.model import Model, join
from swashplate.models.card import Currents, card, flowing_card
from swashplate.models.pump import pump, pump_rates


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


flowing_pump = replace(pump, step=pump_rates, parts=())
flowing_drive, flowing_pump_drive = (
    join(name, before, flowing_pump, links={"current_sum": current_sum})
    for name, before in (("drive", flowing_card), ("pump_drive", source))
)
"""Both in continuous time: rates in place of the step, and no delay."""
