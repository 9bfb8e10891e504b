"""Parameters beyond all measure end in a sentence, not in numbers that are none."""

import numpy as np
import pytest

from swashplate import DomainError, Drive

LARGE = {"Z7": 1e150}
REFINED = {"line_stiffness": 1e3, "motor_leakage": 1e-3, "load_inertia": 1.0}


@pytest.mark.traced
@pytest.mark.parametrize(
    "refinements",
    [{}, pytest.param(REFINED, marks=pytest.mark.slow)],
    ids=["plain", "refined"],
)
def test_numbers_that_overflow_are_refused(hoist: Drive, refinements: dict[str, float]) -> None:
    drive = hoist.replace(**LARGE, **refinements)
    with pytest.raises(DomainError, match="overflow under this voltage"):
        drive.simulate(np.full(600, 5.0))
    with pytest.raises(DomainError, match="overflow under this current"):
        drive.simulate_current(np.full(600, 0.5))
    stepper = drive.stepper()

    def go_on() -> None:
        for _ in range(600):
            assert np.isfinite(stepper.step(5.0)).all()

    with pytest.raises(DomainError, match="overflow"):
        go_on()
