"""What the conclusions state and wish for (chapter 9)."""

import numpy as np
import pytest

from swashplate import Drive, maneuvers
from swashplate.campaign import CHANNEL_KINDS
from swashplate.full_order import FullOrderDrive


def test_figure_9_1_speed_and_acceleration_limits_grow_by_half(hoist: Drive) -> None:
    """Orifice and pump flow 50 % up; the acceleration grows by both, as each multiplies it."""
    larger = hoist.scale(Z16=1.5, Z10=1.5)
    current = np.full(4, 1.0)
    before, after = (each.simulate_current(current).shaft_speed[1] for each in (hoist, larger))
    assert after / before == pytest.approx(1.5 * 1.5, rel=1e-3)
    for volts in (10.0, -10.0):
        assert larger.steady_speed(volts) == pytest.approx(1.5 * hoist.steady_speed(volts))


def test_cam_ring_has_five_and_a_half_cycles_a_turn(hoist: Drive) -> None:
    assert hoist["cam_cycles"].value == 5.5


def test_wanted_signals_have_a_channel_or_an_output() -> None:
    """Stroker pressure, swash angle, spool position, separate currents, motor pressure drop."""
    kinds = set(CHANNEL_KINDS)
    wanted = {"stroker_pressure", "swash_angle", "spool_position", "current_plus", "current_minus"}
    assert wanted <= kinds
    voltage = maneuvers.step(4.0, start=0.1, stop=0.2, length=0.3125).sample(512.0)
    run = FullOrderDrive.preset("hoist").simulate(voltage)
    assert np.isfinite(run.motor_pressure_drop).all()


def test_wanted_stair_steps_can_be_made() -> None:
    stairs = maneuvers.stairs([2.0, 4.0, -2.0], dwell=1.0)
    assert stairs([1.5, 2.5, 3.5]) == pytest.approx([2.0, 4.0, -2.0])
