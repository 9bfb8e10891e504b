"""Parameters of a published drive as the models take them."""

import pytest

from swashplate import Drive
from swashplate.models.card import Card
from swashplate.models.channel import Channel
from swashplate.models.displacement_control import Pump


def card_of(drive: Drive) -> Card:
    numbers = drive.parameters.numbers
    plus, minus = (
        Channel(*(numbers[f"{name}_{side}"] for name in Channel._fields))
        for side in ("plus", "minus")
    )
    return Card(plus, minus, numbers["tau"])


def pump_of(drive: Drive) -> Pump:
    numbers = drive.parameters.numbers
    return Pump(**{name: numbers[name] for name in Pump._fields if name in numbers})


@pytest.fixture(scope="session")
def pump(hoist: Drive) -> Pump:
    """The hoist's pump."""
    return pump_of(hoist)


@pytest.fixture(scope="session")
def channel(hoist: Drive) -> Channel:
    """The positive channel of the hoist's card."""
    return card_of(hoist).plus
