"""Ends of intervals where the cost does not rise as derivatives say."""

from collections.abc import Callable, Mapping

import numpy as np
import pytest

from swashplate import Experiment
from swashplate.identification.linearised import linearised_fit
from swashplate.identification.problem import Problem
from swashplate.identification.profile import checked_ends, minimiser
from swashplate.identification.solving import solve
from swashplate.identification.uncertainty import estimates, reach, uncertainty
from swashplate.identification.unknowns import Unknown, Unknowns

TIME = np.linspace(0.0, 4.0, 81)


class Limited:
    """y = min(gain · t, stop): the stop is told only where it is reached."""

    def simulate(
        self, values: Mapping[str, float], experiment: Experiment
    ) -> Mapping[str, np.ndarray]:
        return {"y": np.minimum(values["gain"] * experiment["y"].time, values["stop"])}


def problem(experiment: Callable[..., Experiment], y: np.ndarray) -> Problem:
    unknowns = Unknowns((Unknown("gain", 1.0, 0.1, 3.0), Unknown("stop", 3.0, 0.5, 20.0)))
    return Problem(Limited(), (experiment("run", 1.0, y),), unknowns, ("y",), {"y": 0.1})


def test_a_stop_that_is_reached_has_both_ends(experiment: Callable[..., Experiment]) -> None:
    noise = 0.1 * np.random.default_rng(1).normal(size=TIME.size)
    found = problem(experiment, np.minimum(TIME, 2.5) + noise)
    best = solve(found).vector
    linearised = linearised_fit(found, best)
    assert checked_ends(found, best, linearised, reach(uncertainty(linearised).own)) == ()


def test_a_stop_that_is_just_touched_has_no_upper_end(
    experiment: Callable[..., Experiment],
) -> None:
    """The truth never reaches it; the last sample happens to lie low, so that the fit touches."""
    noise = 0.02 * np.random.default_rng(2).normal(size=TIME.size)
    noise[-2:] = -0.012  # less than one standard deviation
    found = problem(experiment, TIME + noise)
    best = solve(found, found.unknowns.vector_of({"stop": 3.9})).vector
    values = found.unknowns.values(best)
    assert 3.9 < values["stop"] < 4.0
    linearised = linearised_fit(found, best)
    told = uncertainty(linearised)
    ends = checked_ends(found, best, linearised, reach(told.own))
    assert [(end.number, end.upper, end.distance) for end in ends] == [(1, True, np.inf)]
    gain, stop = estimates(told.own, ends={(1, True): np.inf})
    assert gain.status == "estimated"
    assert stop.status == "no upper end"
    assert stop.upper is None
    assert stop.lower is not None
    assert stop.lower < values["stop"]


def test_the_least_cost_with_one_unknown_held(experiment: Callable[..., Experiment]) -> None:
    """By hand: with the stop out of reach, the gain that fits best is the regression's."""
    y = 0.8 * TIME + 0.05 * np.sin(7.0 * TIME)
    found = problem(experiment, y)
    cost, vector = minimiser(found)(1, 20.0 / 3.0, found.start)
    gain = float(TIME @ y / (TIME @ TIME))
    assert found.unknowns.values(vector)["gain"] == pytest.approx(gain, rel=1e-6)
    assert cost == pytest.approx(0.5 * np.sum((gain * TIME - y) ** 2) / 0.01, rel=1e-9)
