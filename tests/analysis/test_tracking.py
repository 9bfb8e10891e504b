"""Errors by hand, and controllers compared in simulation."""

import numpy as np
import pytest

from swashplate import Drive, InputError, maneuvers
from swashplate.analysis.compensation import inverse_map
from swashplate.analysis.tracking import (
    improvement,
    proportional_command,
    wanted_of_stick,
)


def test_stick_and_straight_line(hoist: Drive) -> None:
    """Full stick is full speed, which the straight line commands with the saturation voltage."""
    inverse = inverse_map(hoist)
    wanted = wanted_of_stick(inverse, [-10.0, -5.0, 0.0, 5.0, 10.0])
    assert np.degrees(wanted) == pytest.approx([-185.0, -92.5, 0.0, 98.0, 196.0], abs=0.05)
    volts = proportional_command(inverse, wanted)
    assert volts == pytest.approx([-7.41, -3.705, 0.0, 3.935, 7.87], abs=0.006)


@pytest.mark.parametrize("name", ["hoist", "slew", "luff"])
def test_the_map_makes_it_better_and_the_lead_again(name: str) -> None:
    drive = Drive.preset(name)
    inverse = inverse_map(drive)
    wanted = wanted_of_stick(inverse, maneuvers.sine(2.0, 0.1).sample())
    found = improvement(drive, wanted)
    assert [way.name for way in found.ways] == [
        "straight line",
        "inverse map",
        "inverse map and lead",
    ]
    plain, mapped, led = (way.error.rms for way in found.ways)
    assert plain > mapped > led
    if name != "luff":  # whose slowest speed of 31 deg/s leaves nothing to gain near standstill
        assert led < 0.25 * mapped
    np.testing.assert_allclose(found.ways[1].run.voltage, inverse.voltage(wanted))
    off = drive.simulate(inverse.voltage(wanted)).shaft_speed - wanted
    assert found.ways[1].error == pytest.approx((np.sqrt(np.mean(off**2)), np.abs(off).max()))
    table = found.to_polars()
    assert table.columns[:2] == ["time", "wanted_speed"]
    assert "voltage_inverse_map_and_lead" in table.columns


def test_the_map_of_another_drive(hoist: Drive) -> None:
    other = inverse_map(hoist.scale(Z10=0.8))
    wanted = np.radians(50.0) * np.sin(np.arange(5120) * 0.2 * np.pi / 512.0)
    right, wrong = improvement(hoist, wanted), improvement(hoist, wanted, inverse=other)
    assert wrong.ways[1].error.rms > right.ways[1].error.rms


def test_a_speed_beyond_the_limit_is_refused(hoist: Drive) -> None:
    with pytest.raises(InputError, match="cannot settle at 200 deg/s"):
        improvement(hoist, np.radians([0.0, 200.0, 0.0]))
