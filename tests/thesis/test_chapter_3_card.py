"""Control card (eqs. 3.1-3.9)."""

from collections.abc import Callable

import numpy as np
import pytest
import sympy as sp

from swashplate import Drive, maneuvers
from swashplate.equations.model import place
from swashplate.models.card import card

H = 1.0 / 512.0
NOW, BEFORE, NEXT, STEADY = sp.symbols("I_n I_before I_next I_ss", real=True)
h, zeta, omega, C, sign = sp.symbols("h zeta omega C sign", positive=True)

HOIST = {
    "V_dz": 0.12663, "J": 0.27473, "G1": 0.049315, "G2": 0.00081975, "G3": -4.5317e-05,
    "zeta": 0.71887, "omega": 56.253, "lim1": 2.2841, "lim2": 2.2615, "I_t1": 0.33628,
    "I_t2": 0.13724, "a": 19.131, "tau": 0.014,
}  # fmt: skip
"""Positive channel of tables 4.1 and 4.2."""


def settled(volts: float) -> float:
    """Eq. 3.3 with the hoist's table."""
    d = volts - HOIST["V_dz"]
    return HOIST["J"] + HOIST["G1"] * d + HOIST["G2"] * d**2 + HOIST["G3"] * d**3


def printed_3_6() -> sp.Expr:
    w = omega * h
    return (
        2 * (1 - zeta * w) * NOW + (2 * zeta * w - w**2 - 1) * BEFORE - C * h**2 * sign
        + w**2 * STEADY
    )  # fmt: skip


def test_eq_3_4_delay_is_no_whole_number_of_samples(hoist: Drive) -> None:
    """14 ms are 7.168 samples; a delay longer by three samples moves the current by three."""
    delay = place(card.tap("at"), 0.014, H)
    assert delay.whole + delay.fraction == pytest.approx(0.014 * 512.0, rel=1e-12)
    voltage = maneuvers.sine(6.0, 0.3, length=8.0).sample(512.0)
    early, late = (hoist.replace(tau=0.014 + k * H).simulate(voltage).current for k in (0, 3))
    np.testing.assert_allclose(late[3:], early[:-3], atol=1e-12)
    assert np.all(early[: 512 + 7] == 0.0)


def test_eq_3_5_and_3_6_explicit_differences(gap: Callable) -> None:
    """Ï by the second difference, İ by the one before, the position one sample earlier."""
    rate = (NOW - BEFORE) / h
    forces = omega**2 * (STEADY - BEFORE) - 2 * zeta * omega * rate - C * sign
    (derived,) = sp.solve((NEXT - 2 * NOW + BEFORE) / h**2 - forces, NEXT)
    assert gap(derived, printed_3_6()).largest < 1e-30


def test_erratum_03_eq_3_7_needs_a_second_derivative_and_omega_squared(gap: Callable) -> None:
    """The filter settles at I_ss; 3.7 as printed would settle at I_ss/ω."""
    rest = printed_3_6().subs({NOW: NEXT, BEFORE: NEXT, sign: 0}) - NEXT
    (level,) = sp.solve(rest, NEXT)
    assert sp.simplify(level - STEADY) == 0
    (printed,) = sp.solve(omega**2 * NEXT - omega * STEADY, NEXT)
    assert gap(printed, STEADY / omega, {omega: (50.0, 60.0)}).largest < 1e-30
    assert gap(printed, level, {omega: (50.0, 60.0)}).smallest > 0.9


def test_erratum_02_rates_alone_lose_the_steady_level(hoist: Drive) -> None:
    """3.8 as printed, a rate integrated: a 9 V step stays at 0.37 A instead of 0.745 A."""
    voltage = np.where(np.arange(1024) < 51, 0.0, 9.0)
    limited = hoist.simulate(voltage).current
    free = hoist.replace(I_t1=np.inf, lim1=np.inf).simulate(voltage).current
    output, rate = 0.0, 0.0
    for n in range(1, free.size):
        slope = (free[n] - free[n - 1]) / H
        rate = min(slope, HOIST["lim1"]) if free[n] > HOIST["I_t1"] else slope
        output += rate * H
    assert output == pytest.approx(0.37, abs=0.01)
    assert limited[-1] == pytest.approx(settled(9.0), rel=1e-6)
    assert settled(9.0) == pytest.approx(0.7452, abs=5e-5)


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
