"""Solenoids on the bench (chapter 5)."""

import numpy as np
import pytest

from swashplate import Drive

BENCH = {1.0: 0.2537, 4.0: 0.4090, 7.0: 0.5635, 10.0: 0.7185}
"""Currents at the voltages of the bench, [V] to [A]."""


def test_bench_currents_lie_on_a_line() -> None:
    """0.0516 A/V through all four, to half a milliampere: a card without G2 and G3, as 3.2."""
    volts, current = np.array(list(BENCH)), np.array(list(BENCH.values()))
    gain, offset = np.polyfit(volts, current, 1)
    assert gain == pytest.approx(0.0516, abs=5e-5)
    assert np.abs(current - offset - gain * volts).max() < 5e-4


def test_erratum_28_bench_card_was_set_otherwise() -> None:
    """Chapter 5 names the slew's card, MDSD-1K-2x/4; its fit gives 0.20 to 0.55 A."""
    slew = Drive.preset("slew")
    off = [current - slew.steady_current(volts) for volts, current in BENCH.items()]
    assert off == pytest.approx([0.049, 0.090, 0.131, 0.173], abs=0.0006)
    assert 0.0516 / slew["G1"].value.plus == pytest.approx(1.36, abs=0.005)


def test_force_is_a_polynomial_of_fourth_order_without_constant(hoist: Drive) -> None:
    """Five force differences of equal currents vanish; beyond the dead zone force starts at 0."""
    step = 0.05
    currents = hoist["Z17"].value + step * np.arange(7)
    force = hoist.simulate_current(-currents).solenoid_force
    assert force[0] == 0.0
    assert np.abs(np.diff(force, 5)).max() < 1e-12
    assert np.diff(force, 4) == pytest.approx(24.0 * -54.153 * step**4, rel=1e-6)


def test_published_force_is_close_to_a_line_upwards(hoist: Drive) -> None:
    """Chapter 5 finds a first-order polynomial enough on average; so does the hoist's fit."""
    e = 0.45
    parts = [hoist[f"Z{18 + n}"].value.plus * e**n for n in (1, 2, 3, 4)]
    assert sum(parts[1:]) / parts[0] < 0.02
