"""What the sampled model says of a loop is what the stepper does in one."""

import numpy as np
import pytest

from swashplate import Drive

STEP = 1.0 / 512.0


@pytest.mark.parametrize(("part", "grows"), [(0.985, False), (1.015, True)])
def test_largest_gain_of_a_loop_that_acts_a_sample_late(
    hoist: Drive, part: float, grows: bool
) -> None:
    model = hoist.linearize(4.0).discrete(STEP, "previous")
    late = model.margins(lambda f: np.exp(-2j * np.pi * f * STEP)).gain_margin
    stepper = hoist.stepper(STEP, interpolation="previous", start="steady")
    sample, change = stepper.step(4.0), np.radians(0.02)
    begun, errors = sample.shaft_speed, []
    for _ in range(12 * 512):
        errors.append(begun + change - sample.shaft_speed)
        sample = stepper.step(4.0 + part * late * errors[-1])
    early, last = np.ptp(errors[1024:1536]), np.ptp(errors[-512:])
    assert (last > early) == grows
