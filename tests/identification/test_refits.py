"""Bootstraps by fitting again, and profiles, of a model that can be followed by hand."""

from collections.abc import Callable, Mapping

import numpy as np
import pytest

from swashplate import Experiment
from swashplate.errors import InputError
from swashplate.executors import Serial
from swashplate.identification.assessment import Assessment
from swashplate.identification.bootstrap import bootstraps_of, profiles_of
from swashplate.identification.fitting import StageFit
from swashplate.identification.problem import Problem
from swashplate.identification.setup import Free, Stage
from swashplate.identification.solving import solve
from swashplate.identification.unknowns import Unknown, Unknowns
from swashplate.parameters.files import load_preset

TIME = np.linspace(0.0, 4.0, 81)


class Line:
    """y = slope · t + level."""

    def simulate(
        self, values: Mapping[str, float], experiment: Experiment
    ) -> Mapping[str, np.ndarray]:
        return {"y": values["slope"] * experiment["y"].time + values["level"]}


class Backwards(Serial):
    """Results in another order than asked for, as from several processes."""

    def run(self, function, shared, items):  # type: ignore[no-untyped-def]
        yield from reversed(list(super().run(function, shared, items)))


@pytest.fixture
def assessed(experiment: Callable[..., Experiment]) -> Assessment:
    """A line fitted to four runs with white noise of 0.1."""
    rng = np.random.default_rng(7)
    runs = tuple(
        experiment(f"run {k}", 1.0, 2.0 * TIME + 1.0 + 0.1 * rng.normal(size=TIME.size))
        for k in range(4)
    )
    unknowns = Unknowns((Unknown("slope", 1.5, 0.0, 4.0), Unknown("level", 0.5, -3.0, 3.0)))
    problem = Problem(Line(), runs, unknowns, ("y",), {"y": 0.1})
    stage = Stage(name="line", part="chain", free={"J": Free(relative=(0.5, 2.0))})
    return Assessment(StageFit(stage, problem, solve(problem), load_preset("neutral")))


def textbook() -> np.ndarray:
    """Standard errors of slope and level from 4 times 81 samples with noise 0.1."""
    design = np.column_stack([TIME, np.ones(TIME.size)])
    return 0.1 * np.sqrt(np.diag(np.linalg.inv(4.0 * design.T @ design)))


def test_draws_scatter_as_the_textbook_says(assessed: Assessment) -> None:
    found = bootstraps_of([assessed], 200, seed=3)["line"]
    assert found.failed == 0
    # 200 draws tell a standard deviation to 5 %, and the noise itself is known to 4 %
    np.testing.assert_allclose(found.values.std(axis=0), textbook(), rtol=0.2)
    np.testing.assert_allclose(
        found.values.mean(axis=0),
        list(assessed.stage.values.values()),
        atol=float(4.0 * textbook().max() / np.sqrt(200.0)),
    )


def test_draws_do_not_depend_on_the_order_in_which_they_are_done(assessed: Assessment) -> None:
    counts: list[int] = []
    forwards = bootstraps_of([assessed], 40, seed=3)["line"]
    backwards = bootstraps_of([assessed], 40, seed=3, executor=Backwards(), watch=counts.append)
    np.testing.assert_array_equal(forwards.vectors, backwards["line"].vectors)
    assert counts == list(range(1, 41))
    other = bootstraps_of([assessed], 40, seed=4)["line"]
    assert not np.array_equal(forwards.vectors, other.vectors)


def test_profiles_of_a_linear_model_are_its_intervals(assessed: Assessment) -> None:
    found = profiles_of(assessed, executor=Backwards())
    assert list(found) == ["slope", "level"]
    variables = assessed.uncertainty.own.variables
    for k, (name, each) in enumerate(found.items()):
        estimate = assessed.uncertainty.estimates[k]
        assert (estimate.name, each.index) == (name, k)
        ends = variables.to_values(np.array([[each.lower] * 2, [each.upper] * 2]))[:, k]
        np.testing.assert_allclose(ends, [estimate.lower, estimate.upper], rtol=2e-3)


def test_a_profile_of_nothing_is_refused(assessed: Assessment) -> None:
    assert list(profiles_of(assessed, ["level"])) == ["level"]
    with pytest.raises(InputError, match="There is no unknown Z99; there are slope, level"):
        profiles_of(assessed, ["Z99"])
