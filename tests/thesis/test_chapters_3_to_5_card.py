"""Control card, its cost and tables (chapters 3 and 4), solenoids on the bench (chapter 5)."""

import numpy as np
import pytest

from swashplate import Drive, maneuvers
from swashplate.machine.batch import SquaredError
from swashplate.machine.model import tap_delay
from swashplate.models.amplifier import card

H = 1.0 / 512.0

HOIST = {
    "V_dz": 0.12663, "J": 0.27473, "G1": 0.049315, "G2": 0.00081975, "G3": -4.5317e-05,
    "zeta": 0.71887, "omega": 56.253, "lim1": 2.2841, "lim2": 2.2615, "I_t1": 0.33628,
    "I_t2": 0.13724, "a": 19.131, "tau": 0.014,
}  # fmt: skip
"""Positive channel of tables 4.1 and 4.2."""


def settled(volts: float, p: dict[str, float]) -> float:
    """Eq. 3.3 beyond the dead zone."""
    d = volts - p["V_dz"]
    return p["J"] + p["G1"] * d + p["G2"] * d**2 + p["G3"] * d**3


def test_eq_3_4_delay_is_no_whole_number_of_samples(hoist: Drive) -> None:
    """14 ms are 7.168 samples; a delay longer by three samples moves the current by three."""
    delay = tap_delay(card.tap("at"), 0.014, H)
    assert delay.samples + delay.fraction == pytest.approx(0.014 * 512.0, rel=1e-12)
    voltage = maneuvers.sine(6.0, 0.3, length=8.0).sample(512.0)
    early, late = (hoist.replace(tau=0.014 + k * H).simulate(voltage).current for k in (0, 3))
    np.testing.assert_allclose(late[3:], early[:-3], atol=1e-12)
    assert np.all(early[: 512 + 7] == 0.0)


def test_erratum_02_and_erratum_03_steady_level(hoist: Drive) -> None:
    """3.8 as printed, a rate integrated: a 9 V step stays at 0.37 A instead of 0.745 A.

    3.7, with ω on the right in place of ω², would settle at 1/ω of it.
    """
    voltage = np.where(np.arange(1024) < 51, 0.0, 9.0)
    limited = hoist.simulate(voltage).current
    free = hoist.replace(I_t1=np.inf, lim1=np.inf).simulate(voltage).current
    output, rate = 0.0, 0.0
    for n in range(1, free.size):
        slope = (free[n] - free[n - 1]) / H
        rate = min(slope, HOIST["lim1"]) if free[n] > HOIST["I_t1"] else slope
        output += rate * H
    assert output == pytest.approx(0.37, abs=0.01)
    assert settled(9.0, HOIST) == pytest.approx(0.7452, abs=5e-5)
    for ends in (limited[-1], free[-1]):
        assert ends == pytest.approx(settled(9.0, HOIST), rel=1e-6)


def test_erratum_07_slew_card_does_not_overshoot() -> None:
    """ζ = 1.4157: both roots of its filter are real, and no step passes its settled current."""
    slew = Drive.preset("slew")
    assert min(slew["zeta"].values) > 1.0
    for volts in (2.0, 4.0, 6.5, 9.0):
        run = slew.simulate(maneuvers.step(volts).sample(512.0))
        assert run.current.max() <= slew.steady_current(volts) + 1e-9
    hoist = Drive.preset("hoist").replace(lim1=np.inf, I_t1=np.inf)
    run = hoist.simulate(maneuvers.step(4.0).sample(512.0))
    assert run.current.max() > 1.02 * hoist.steady_current(4.0)


HOIST_MINUS = {"V_dz": 0.097857, "J": 0.2951, "G1": 0.054706, "G2": 0.00042879, "G3": -9.7369e-05}


@pytest.mark.parametrize(
    ("output", "fixed"), [("current", {"J_plus": [0.27473]}), ("shaft_speed", {"Z10": [12.396]})]
)
def test_eq_4_10_and_7_1_cost_is_a_sum_of_squares_over_the_tests(
    hoist: Drive, output: str, fixed: dict
) -> None:
    """J = Σ J_i, each the squared error of one test: 1 mA (or mrad/s) and 2 mA off, by hand."""
    total = 0.0
    for volts, off in ((4.0, 1e-3), (-6.5, 2e-3)):
        voltage = maneuvers.step(volts).sample(512.0)
        cost = SquaredError(hoist.simulate(voltage)[output] + off, output=output)
        total += float(hoist.simulate_many(fixed, voltage=voltage, cost=cost).cost[0])
    assert total == pytest.approx(5121 * (1e-6 + 4e-6), rel=1e-9)


def test_ammeter_reads_the_sum_of_both_magnitudes(hoist: Drive) -> None:
    """Chapter 4: both leads go through one ammeter, which rectifies what the pump model keeps."""
    run = hoist.simulate(maneuvers.sine(6.0, 0.3, length=8.0).sample(512.0))
    reading = run.current_positive + run.current_negative
    assert reading.min() >= 0.0
    alone = np.minimum(run.current_positive, run.current_negative) == 0.0
    np.testing.assert_array_equal(reading[alone], np.abs(run.current[alone]))


@pytest.mark.parametrize("volts", [1.0, 4.0, 6.5, 9.0])
def test_erratum_05_negative_channel_takes_magnitudes(hoist: Drive, volts: float) -> None:
    """3.3 with table 4.3's own signs would keep the even power's: 13 mA off at -4 V."""
    magnitude = settled(volts, HOIST_MINUS)
    assert hoist.steady_current(-volts) == pytest.approx(-magnitude, rel=1e-12)
    turned = {each: -HOIST_MINUS[each] for each in ("J", "G1", "G3")}
    if volts == 4.0:
        literal = settled(volts, HOIST_MINUS | turned)
        assert literal + magnitude == pytest.approx(0.013, abs=0.0005)


def test_erratum_32_multiples_of_zero_do_not_move(hoist: Drive) -> None:
    for symbol in ("C", "Z2", "Z7", "Z11", "Z12"):
        assert set(hoist[symbol].values) == {0.0}
        assert set(hoist.scale(**{symbol: 2.0})[symbol].values) == {0.0}


def test_section_1_2_counts_14_and_22_parameters(hoist: Drive) -> None:
    """Of the card, each channel counted once, and of pump and motor."""
    symbols = list(hoist.parameters)
    assert len([each for each in symbols if each[0] != "Z"]) == 14
    assert [each for each in symbols if each[0] == "Z"] == [f"Z{n}" for n in range(1, 23)]


def test_erratum_06_slew_and_luff_have_one_card() -> None:
    """Table 1.1 and section 7.5: MDSD-1K-2x/4; 8.2 and 8.3 print its limits with opposite signs."""
    slew, luff, hoist = (Drive.preset(name) for name in ("slew", "luff", "hoist"))
    assert slew.parameters.card == luff.parameters.card != hoist.parameters.card
    for symbol in ("V_dz", "J", "G1", "zeta", "omega", "C", "lim1", "lim2", "I_t1", "I_t2", "a"):
        assert slew[symbol].values == luff[symbol].values
        assert min(luff[symbol].values) >= 0.0


BENCH = {1.0: 0.2537, 4.0: 0.4090, 7.0: 0.5635, 10.0: 0.7185}
"""Currents at the voltages of the bench, [V] to [A]."""


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
