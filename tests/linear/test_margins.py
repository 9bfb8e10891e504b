"""Bandwidth and margins against closed forms and against the eigenvalues of closed loops."""

from dataclasses import replace
from math import atan, inf, pi

import numpy as np
import pytest

from swashplate import DomainError, Drive, InputError
from swashplate.linear import LinearDrive, loop_margins


def radius(model: LinearDrive, gain: float, late: int = 0) -> float:
    """Largest |eigenvalue| of a sampled loop u = -K y, which the controller closes `late` samples
    after the drive's own delay."""
    assert model.sample_time is not None
    whole = round(model.delay / model.sample_time) + late
    n = model.A.shape[0]
    loop = np.zeros((n + whole, n + whole))
    loop[:n, :n] = model.A
    loop[:n, -1:] = model.B
    loop[n, :n] = -gain * model.C[0]
    loop[n + 1 :, n:-1] = np.eye(whole - 1)
    return float(np.abs(np.linalg.eigvals(loop)).max())


@pytest.mark.parametrize("rate", [512.0, 2000.0])
def test_the_largest_gain_brings_the_loop_to_its_edge(axis: Drive, rate: float) -> None:
    model = axis.linearize(2.0).discrete(1.0 / rate)
    largest = model.largest_gain
    assert radius(model, largest) == pytest.approx(1.0, abs=1e-9)
    assert radius(model, 0.99 * largest) < 1.0 < radius(model, 1.01 * largest)
    assert model.margins(0.5 * largest).gain_margin == pytest.approx(2.0)


def test_the_delay_margin_brings_the_loop_to_its_edge(hoist: Drive) -> None:
    h = 1.0 / 2048.0
    model = hoist.linearize(4.0).discrete(h)
    gain = 0.5 * model.largest_gain
    whole = int(model.margins(gain).delay_margin / h)
    assert whole > 50
    assert radius(model, gain, whole) < 1.0 < radius(model, gain, whole + 1)


def test_a_first_order_lag(hoist: Drive) -> None:
    # G = g/(1 + s τ): |K G| = 1 at ω τ = √((K g)² - 1), phase margin π - atan(ω τ)
    model = hoist.linearize(current=0.45)
    tau, factor = model.time_constant, 3.0
    assert model.bandwidth == pytest.approx(1.0 / (2.0 * pi * tau), rel=1e-9)
    assert model.largest_gain == inf
    margins = model.margins(factor / model.gain)
    wt = np.sqrt(factor**2 - 1.0)
    assert margins.crossover == pytest.approx(wt / tau / (2.0 * pi))
    assert margins.phase_margin == pytest.approx(pi - atan(wt))
    assert margins.delay_margin == pytest.approx((pi - atan(wt)) * tau / wt)
    assert margins.gain_margin == inf
    # below 1 everywhere: no crossover, no limit
    assert model.margins(0.5 / model.gain) == (0.0, inf, inf, inf)


@pytest.mark.parametrize("delay", [0.0, 0.05, 0.4])
def test_an_integrator_with_delay(delay: float) -> None:
    # L = K/(jω) e^(-jω delay): crossover ω = K, phase margin π/2 - K delay; edge at K delay = π/2
    gain = 3.0

    def loop(f: np.ndarray) -> np.ndarray:
        s = 2j * pi * f
        return gain / s * np.exp(-s * delay)

    crossover, phase, late, factor = loop_margins(loop, delay, 1e4, "a tank")
    assert crossover == pytest.approx(gain / (2.0 * pi))
    assert phase == pytest.approx(0.5 * pi - gain * delay)
    assert late == pytest.approx(0.5 * pi / gain - delay)
    assert factor == pytest.approx(0.5 * pi / (gain * delay) if delay else inf)


def test_a_controller_with_an_integral_part(hoist: Drive) -> None:
    model = hoist.linearize(4.0)

    def pi_controller(f: np.ndarray) -> np.ndarray:
        # its zero cancels the pump's lag
        return 5.0 * (1.0 + 1.0 / (2j * pi * f * model.time_constant))

    proportional, integral = model.margins(5.0), model.margins(pi_controller)
    assert 0.0 < integral.delay_margin < proportional.delay_margin
    # loop transfer K g/(s τ) beside the card's filter and delay: crossover near K g/τ
    crossover = 5.0 * model.gain / model.time_constant / (2.0 * pi)
    assert integral.crossover == pytest.approx(crossover, rel=0.02)


def test_unstable_loops_have_no_margins(hoist: Drive) -> None:
    model = hoist.linearize(4.0)
    for gain in (1.001 * model.largest_gain, 1e3 * model.largest_gain, -1.5 / model.gain):
        with pytest.raises(DomainError, match="closed loop is unstable"):
            model.margins(gain)
    with pytest.raises(DomainError, match="closed loop is unstable"):
        model.margins(lambda f: -0.1 / (2j * pi * f))
    with pytest.raises(DomainError, match="closed loop is unstable"):
        model.discrete(1.0 / 512.0).margins(1.01 * model.discrete(1.0 / 512.0).largest_gain)


def test_loops_without_sense(hoist: Drive) -> None:
    model = hoist.linearize(4.0)
    with pytest.raises(InputError, match="is not finite"):
        model.margins(float("nan"))
    closed = hoist.linearize(4.0, outputs=["spool_position"])
    for value in ("bandwidth", "largest_gain"):
        with pytest.raises(DomainError, match="does not follow a steady input"):
            getattr(closed, value)
    unstable = replace(hoist.linearize(current=0.45), A=np.array([[1.0]]))
    with pytest.raises(DomainError, match="linear model is unstable"):
        print(unstable.bandwidth)


def test_frequencies_out_of_range(hoist: Drive) -> None:
    model = hoist.linearize(4.0)
    for bad in (-1.0, float("nan"), [[1.0]]):
        with pytest.raises(InputError, match="from 0 on"):
            model.response(bad)
    with pytest.raises(InputError, match="to 1/\\(2 h\\) = 256 Hz"):
        model.discrete(1.0 / 512.0).response(257.0)
