"""The card with its decay, found again by triangular factors alone."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from swashplate import Drive
from swashplate.equations.marching.observation import Observation, ObservedRecord
from swashplate.equations.marching.record import record_of
from swashplate.maneuvers import source_tests
from swashplate.simulation.residuals import ALL_COLUMNS, PUMP_COLUMNS, made_ready

CARD = tuple(name for name in ALL_COLUMNS if name not in PUMP_COLUMNS and not name.startswith("C_"))


@pytest.mark.parametrize("seed", range(3))
def test_all_of_the_card_is_found_if_its_decay_may_begin_within_a_step(seed: int) -> None:
    truth = replace(Drive.preset("hoist").parameters, card_switch="split")
    tests = []
    for test in source_tests("hoist").values():
        voltage = test.sample(512.0)
        run = Drive(truth).simulate(voltage)
        read = Observation("current_sum", run.time, run.current_positive + run.current_negative)
        tests.append(ObservedRecord(record_of(voltage, 512.0, what="voltage"), [read]))
    size = np.array([truth.numbers[name] for name in CARD])

    def rows(multiples: np.ndarray) -> np.ndarray:
        at = truth.replace(dict(zip(CARD, (multiples * size).tolist(), strict=True)))
        return np.vstack([made_ready(at, each, CARD).triangle(each).factor for each in tests])

    # I_t2 has a mirror image about lim2/a, 14 % away: the start must not lie beyond
    rng = np.random.default_rng(seed)
    reach = np.where([name.startswith(("I_t2", "lim2", "a_")) for name in CARD], 0.03, 0.1)
    found = least_squares(
        lambda multiples: rows(multiples)[:, -1],
        1.0 + reach * rng.uniform(-1.0, 1.0, size.size),
        jac=lambda multiples: rows(multiples)[:, :-1] * size,
        bounds=(0.5, 2.0),
        x_scale="jac",
        ftol=1e-14,
        xtol=1e-14,
        gtol=1e-14,
    )
    np.testing.assert_allclose(found.x, 1.0, rtol=0.0, atol=1e-9)
