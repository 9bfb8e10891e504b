"""What a guess from a motion does not see: a ramp, what lies behind it, gains that bend."""

from dataclasses import replace
from math import isinf

import pytest

from swashplate import Drive
from swashplate.identification import whole_drive
from swashplate.identification.unseen import BEND, RAMP, is_guessed, with_unseen
from swashplate.parameters import ParameterSet

READ_OFF = ("V_dz", "J", "G1", "tau", "Z8", "Z10", "Z13", "Z16")


def guessed(*symbols: str) -> ParameterSet:
    """The drive "neutral" with numbers as if a guess had read them off tests of up to ±5 V."""
    drive = Drive.preset("neutral").replace(V_dz=(0.5, 1.0), G1=(0.1, 0.2), tau=0.05)
    parameters = {
        symbol: replace(parameter, status="approximate") if symbol in symbols else parameter
        for symbol, parameter in drive.parameters.items()
    }
    return replace(drive.parameters, name="winch", parameters=parameters, tested=(5.0, 5.0))


def test_a_guess_from_a_motion_has_a_ramp() -> None:
    start = guessed(*READ_OFF)
    assert isinf(start.numbers["lim1_plus"])
    nominal, setup = with_unseen(start, whole_drive(start))
    # 0.2 A/V beyond 1 V at 5 V is the larger current
    assert nominal.numbers["lim1_plus"] == pytest.approx(0.8 / RAMP)
    assert nominal.numbers["lim2_minus"] == pytest.approx(0.8 / RAMP)
    assert nominal.numbers["I_t1_plus"] == 0.0
    free = setup.free
    assert free["lim1"].tied
    assert free["lim2"].tied
    # 5 % of 0.45 A at 4.5 V beyond the dead zone; a search begins beside its bound
    assert free["J_plus"].prior.deviation == pytest.approx(0.05 * 0.45)
    assert nominal.numbers["J_plus"] == pytest.approx(0.01 * 0.45)
    # a dead zone of the solenoids behind the ramp, 15 % of 0.8 A
    assert free["Z17"].prior.deviation == pytest.approx(0.15 * 0.8)
    assert nominal.numbers["Z17"] == pytest.approx(0.03 * 0.8)
    # a quadratic part that is 15 % of the linear one at 4.5 V beyond the dead zone
    bend = free["G2_plus"].prior
    assert (bend.mean, bend.deviation) == (0.0, pytest.approx(BEND * 0.1 / 4.5))


def test_what_was_read_off_is_known_less() -> None:
    free = whole_drive(guessed(*READ_OFF)).free
    assert free["V_dz"].spread == free["Z8"].spread == 0.7
    assert free["Z1"].spread == 0.3


def test_other_drives_are_left_as_they_are() -> None:
    hoist = Drive.preset("hoist").parameters
    of_current = guessed(*READ_OFF, "lim1")
    assert with_unseen(hoist, whole_drive(hoist)) == (hoist, whole_drive(hoist))
    _, setup = with_unseen(of_current, whole_drive(of_current))
    assert "lim1" not in setup.free or not setup.free["lim1"].tied  # read off the current
    assert {"G2_plus", "J_plus"} <= setup.free.keys()
    assert not setup.free.keys() & {"Z17"}
    assert not is_guessed(hoist)
    assert is_guessed(of_current)
