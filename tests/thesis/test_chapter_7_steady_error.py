"""Why a model can be right on steps and wrong on ramps (eqs. 7.8-7.14)."""

from collections.abc import Callable

import numpy as np
import pytest
import sympy as sp

s = sp.symbols("s")
k, k_s, a, a_s = sp.symbols("k k_s a a_s", positive=True)

ERROR = k / (s + a) - k_s / (s + a_s)
APART = {a: (0.2, 0.3), a_s: (0.8, 1.4)}


def final_value(transfer: sp.Expr, command: sp.Expr) -> sp.Expr:
    return sp.limit(sp.together(s * transfer * command), s, 0)


def test_eq_7_8_to_7_10_error_of_two_lags(gap: Callable) -> None:
    printed = (k * s + k * a_s - k_s * s - a * k_s) / ((s + a) * (s + a_s))
    assert gap(ERROR, printed).largest < 1e-30


def test_eq_7_11_error_under_a_step(gap: Callable) -> None:
    used = (k * a_s - k_s * a) / (a * a_s)
    assert gap(final_value(ERROR, 1 / s), used).largest < 1e-30


def test_erratum_26_eq_7_11_has_a_product_below(gap: Callable) -> None:
    printed = (k * a_s - k_s * a) / (a - a_s)
    assert gap(final_value(ERROR, 1 / s), printed, APART).smallest > 1e-2


def test_eq_7_12_and_7_13_error_under_a_ramp(gap: Callable) -> None:
    """Equal steady gains, k a_s = k_s a, leave 7.13 of 7.12."""
    equal = ERROR.subs(k_s, k * a_s / a)
    printed = (k * s - k * a_s / a * s) / ((s + a) * (s + a_s)) / s
    assert gap(sp.together(equal / s), printed).largest < 1e-30


def test_eq_7_14_constant_error_under_a_ramp(gap: Callable) -> None:
    equal = ERROR.subs(k_s, k * a_s / a)
    printed = ((k - k_s) / (a * a_s)).subs(k_s, k * a_s / a)
    assert gap(final_value(equal, 1 / s**2), printed).largest < 1e-30


def test_eq_7_14_in_time() -> None:
    """Gain 25 (deg/s)/V, lags 0.12 and 0.15 s, 1 V/s: 25 · 0.03 = 0.75 deg/s behind."""
    gain, lag, other = 25.0, 0.12, 0.15
    time = 20.0

    def ramp(T: float) -> float:
        return gain * (time - T * (1.0 - np.exp(-time / T)))

    numbers = {k: gain / lag, k_s: gain / other, a: 1 / lag, a_s: 1 / other}
    formula = float(((k - k_s) / (a * a_s)).subs(numbers))
    assert ramp(lag) - ramp(other) == pytest.approx(formula, rel=1e-9)
    assert formula == pytest.approx(0.75)
