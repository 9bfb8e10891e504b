"""Dead zone, jump, gain and delay of both cards from a noise-free current record."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from swashplate import Drive, maneuvers

NAMES = ["V_dz", "J", "G1", "tau"]


@pytest.mark.parametrize("name", ["hoist", "slew"])
@pytest.mark.parametrize("off", [0.9, pytest.param(1.1, marks=pytest.mark.slow)])
def test_static_curve_and_delay_are_recovered(name: str, off: float) -> None:
    """Started 10 % off; possible only because the jump's share and the sign are continuous."""
    truth = Drive.preset(name)
    voltage = (
        maneuvers.sine(6.5, 0.3, length=8.0) + maneuvers.step(4.0, start=0.5, stop=2.0, length=3.0)
    ).sample(512.0)
    measured = truth.simulate(voltage).current
    columns = truth.sensitivities(voltage[:2], parameters=NAMES).names
    exact = np.array([truth.parameters.numbers[column] for column in columns])

    def drive(scaled: np.ndarray) -> Drive:
        return truth.replace(**dict(zip(columns, map(float, scaled * exact), strict=True)))

    def residual(scaled: np.ndarray) -> np.ndarray:
        return drive(scaled).simulate(voltage).current - measured

    def jacobian(scaled: np.ndarray) -> np.ndarray:
        return drive(scaled).sensitivities(voltage, parameters=NAMES).current * exact

    start = np.full(exact.size, off)
    fit = least_squares(residual, start, jacobian, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    np.testing.assert_allclose(fit.x, 1.0, rtol=0.0, atol=1e-10)
    assert fit.nfev < 20
