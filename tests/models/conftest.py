"""Parameters of a published drive as the models take them."""

import pytest

from swashplate import Drive
from swashplate.models.amplifier import CardChannel
from swashplate.models.displacement_control import Pump


@pytest.fixture(scope="session")
def pump(hoist: Drive) -> Pump:
    """The hoist's pump."""
    return hoist.parts[1].p


@pytest.fixture(scope="session")
def channel(hoist: Drive) -> CardChannel:
    """The positive channel of the hoist's card."""
    return hoist.parts[0].p.plus
