"""Profiles of a linear model are its intervals."""

import numpy as np
import pytest
from tests.identification.given import TIME, Backwards, bench_run, model_of

from swashplate.identification import (
    FitSetup,
    Optimum,
    Problem,
    Unknown,
    Unknowns,
    profiles_of,
    solve,
    uncertainty_of,
)
from swashplate.identification.estimation.setup import Free
from swashplate.parameters import load_preset


@pytest.fixture
def assessed() -> Optimum:
    """A line fitted to four runs with white noise of 0.1."""
    rng = np.random.default_rng(7)
    runs = tuple(
        bench_run(f"run {k}", 1.0, 2.0 * TIME + 1.0 + 0.1 * rng.normal(size=81)) for k in range(4)
    )
    unknowns = Unknowns((Unknown("slope", 1.5, 0.0, 4.0), Unknown("level", 0.5, -3.0, 3.0)))
    line = model_of(lambda values, time, _: values["slope"] * time + values["level"])
    problem = Problem(line, runs, unknowns, ("y",), {"y": 0.1})
    neutral = load_preset("neutral")
    return Optimum(
        setup=FitSetup(free={"J": Free(relative=(0.5, 2.0))}),
        nominal=neutral,
        runs=runs,
        problem=problem,
        solution=solve(problem),
        parameters=neutral,
    )


def test_profiles_of_a_linear_model_are_its_intervals(assessed: Optimum) -> None:
    found = profiles_of(assessed, executor=Backwards())
    assert list(found) == ["slope", "level"]
    variables = uncertainty_of(assessed).own.variables
    for k, (name, each) in enumerate(found.items()):
        estimate = uncertainty_of(assessed).estimates[k]
        assert (estimate.name, each.index) == (name, k)
        ends = variables.to_values(np.array([[each.lower] * 2, [each.upper] * 2]))[:, k]
        np.testing.assert_allclose(ends, [estimate.lower, estimate.upper], rtol=2e-3)
