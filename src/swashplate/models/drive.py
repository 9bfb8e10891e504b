"""The drive: card and pump in series, and the pump alone behind a given current."""

from dataclasses import replace
from math import inf
from typing import Annotated, NamedTuple

from swashplate.machine import Definition, Model, equation, join
from swashplate.models.amplifier import (
    Card,
    CardOptions,
    Currents,
    SignedCurrent,
    card,
    channel_level,
    flowing_card,
)
from swashplate.models.displacement_control import Pump, PumpOptions
from swashplate.models.pump import (
    PumpInputs,
    PumpSignals,
    pump,
    pump_rates,
    pump_sample,
    pump_settled,
)

Ammeter = Annotated[float, Definition("sum of both currents, as an ammeter reads it", "A")]


@equation
def current_sum(current_positive: float, current_negative: float) -> Ammeter:
    """What an ammeter around both leads reads. [A]"""
    return current_positive + current_negative


AMMETER = {"current_sum": current_sum}
POSITION = {"shaft_position": "shaft_speed"}

drive = join("drive", card, pump, links=AMMETER, integrals=POSITION)


class Source(NamedTuple):
    """A given current has no parameters."""


class Nothing(NamedTuple):
    """State of what remembers nothing, as a given current."""


@equation
def current_sample(
    current: SignedCurrent,
) -> Currents:
    """A given signed current, and its positive and negative part."""
    return Currents(current, max(0.0, current), max(0.0, -current))


@equation
def forgotten(state: Nothing) -> Nothing:
    """Nothing to remember."""
    return state


source = Model("source", parameters=Source, state=Nothing, step=forgotten, sample=current_sample)

pump_drive = join("pump_drive", source, pump, links=AMMETER, integrals=POSITION)
"""Pump and motor behind a signed current."""


NOW = {"delayed_current": "current"}
"""Where no sample is late, the delayed current is the current."""

flowing_pump = replace(pump, step=pump_rates, parts=(), longest_step=inf, taps={}, wired=NOW)
flowing_drive, flowing_pump_drive = (
    join(name, before, flowing_pump, links=AMMETER)
    for name, before in (("drive", flowing_card), ("pump_drive", source))
)
"""Both in continuous time: rates in place of the step, and no delays."""


@equation
def settled_currents(voltage: float, p: Card) -> Currents:
    """Currents that the card settles at under a constant command. [V]"""
    plus, minus = channel_level(voltage, p.plus), channel_level(-voltage, p.minus)
    return Currents(plus - minus, plus, minus)


@equation
def settled_sample(inputs: PumpInputs, p: Pump, h: float, options: PumpOptions) -> PumpSignals:
    """What is known of the pump where it has settled under a constant current."""
    return pump_sample(pump_settled(inputs, p, options), inputs, p, h, options)


settled_drive = join(
    "settled_drive",
    Model("card", Card, Nothing, forgotten, settled_currents, options=CardOptions),
    Model(
        "pump",
        Pump,
        Nothing,
        forgotten,
        settled_sample,
        inputs=PumpInputs,
        wired=NOW,
        defaults=pump.defaults,
        options=PumpOptions,
    ),
)
"""The steady map: to each sample of a voltage what the drive settles at under it."""
