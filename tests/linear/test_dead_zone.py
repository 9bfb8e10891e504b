"""A point in a dead zone is refused with one that is not."""

import re

import numpy as np
import pytest

from swashplate import Drive
from swashplate.linear import DeadZoneError


def proposed(drive: Drive, voltage: float) -> float:
    with pytest.raises(DeadZoneError) as refused:
        drive.linearize(voltage)
    (volts,) = re.findall(r"linearise at ([+-][0-9.]+) V or beyond", refused.value.instead)
    return float(volts)


@pytest.mark.parametrize("name", ["hoist", "slew", "luff"])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_what_is_proposed_is_the_first_that_has_a_model(name: str, way: float) -> None:
    drive = Drive.preset(name)
    volts = proposed(drive, way * 0.05)
    assert np.sign(volts) == way
    assert drive.linearize(volts).gain > 0.0
    with pytest.raises(DeadZoneError):
        drive.linearize(volts - way * 2e-4)


def test_it_is_where_the_current_leaves_the_solenoids_dead_zone() -> None:
    hoist = Drive.preset("hoist")
    volts = proposed(hoist, 0.15)
    assert hoist.steady_current(volts) > hoist["Z17"].value > hoist.steady_current(volts - 2e-4)


def test_a_side_that_nothing_leaves() -> None:
    dead = Drive.preset("hoist").replace(Z17=5.0)
    with pytest.raises(DeadZoneError, match=r"no voltage up to \+10 V leaves it"):
        dead.linearize(1.0)


def test_a_current() -> None:
    with pytest.raises(DeadZoneError, match="linearise beyond ±0.27867 A, or the pump alone with"):
        Drive.preset("hoist").linearize(current=0.2)
