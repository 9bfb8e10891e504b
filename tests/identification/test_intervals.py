"""Intervals in the unknowns' own units, what leaves an unknown without one, and profiles."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq, least_squares
from tests.identification.given import TIME, bench_run, linear_fit, model_of, unknowns_of

from swashplate import DomainError, InputError
from swashplate.identification.intervals import estimates, reach, uncertainty
from swashplate.identification.noise import Covariance
from swashplate.identification.problem import LinearisedRun, Problem, linearised_fit
from swashplate.identification.profile import checked_ends, profile
from swashplate.identification.solving import solve
from swashplate.identification.unknowns import Unknown, Unknowns


def covariance(freedom: float = np.inf, **more: object) -> Covariance:
    variables = unknowns_of(
        ["plain", "positive"], [3.0, 2.0], scales=[10.0, 1.0], logarithmic=[False, True], **more
    )
    matrix = np.diag([0.01, 0.04])
    return Covariance(variables, matrix, np.ones(2, bool), np.full(2, freedom))


def test_intervals_by_hand() -> None:
    plain, positive = estimates(covariance())
    assert plain.standard_error == pytest.approx(1.0)  # 0.1 of the scale 10
    assert (plain.lower, plain.upper) == pytest.approx((3.0 - 1.959964, 3.0 + 1.959964))
    # Student's quantile for 5 degrees of freedom, 2.570582
    assert estimates(covariance(5.0))[0].upper == pytest.approx(3.0 + 2.570582)
    # 20 % in the logarithm: 2 exp(±0.392)
    assert positive.standard_error == pytest.approx(0.4)
    assert (positive.lower, positive.upper) == pytest.approx((1.351418, 2.959854), rel=1e-6)
    plain, positive = estimates(covariance(at_bound=[-1, 1]))
    assert (plain.status, positive.status) == ("at its lower bound", "at its upper bound")
    assert plain[3:] == (None, None, None)


def test_an_interval_beyond_a_hundredfold_is_none() -> None:
    """A standard error of 4 of the logarithm: its 95 % interval spans a factor of 2540 each way."""
    base = covariance()
    vast = np.diag([base.matrix[0, 0], 4.0**2])
    plain, positive = estimates(replace(base, matrix=vast))
    assert plain.status == "estimated"
    assert (positive.status, positive.lower, positive.upper) == ("undetermined", None, None)


@pytest.mark.parametrize(
    ("jacobian", "more"),
    [(np.zeros((50, 2)), {}), (np.ones((50, 2)), {}), (np.ones((50, 2)), {"at_bound": [1, -1]})],
)
def test_what_is_not_determined_has_no_number(jacobian: np.ndarray, more: dict) -> None:
    noise = np.random.default_rng(15).normal(size=50)
    run = LinearisedRun("a", "speed", np.arange(50.0), noise, jacobian)
    found = uncertainty(linear_fit([run], unknowns_of("ab", np.ones(2), **more)))
    assert all(each.standard_error is None for each in found.estimates)
    at_bounds = ["at its upper bound", "at its lower bound"]
    expected = at_bounds if more else ["undetermined"] * 2
    assert [each.status for each in found.estimates] == expected


def test_an_undetermined_unknown_does_not_spoil_the_others() -> None:
    rng = np.random.default_rng(1)
    jacobian = rng.normal(size=(40, 3))
    jacobian[:, 1] = -2.0 * jacobian[:, 0]
    run = LinearisedRun("a", "speed", np.arange(40.0), rng.normal(size=40), jacobian)
    made = linear_fit([run], unknowns_of("abc", np.ones(3)))
    assert made.determined.tolist() == [False, False, True]
    # the third beside the one combination of the others that is determined
    pair = jacobian[:, [0, 2]]
    found = (made.whitening @ made.whitening.T)[2, 2]
    assert found == pytest.approx(np.linalg.inv(pair.T @ pair)[1, 1], rel=1e-10)


def test_one_sample_is_refused() -> None:
    run = LinearisedRun("a", "speed", np.zeros(1), np.ones(1), np.ones((1, 1)))
    with pytest.raises(InputError, match="1 sample for 1 parameter leave nothing"):
        uncertainty(linear_fit([run], unknowns_of(["p"], [1.0])))


def test_an_estimate_at_its_bound_is_released_in_its_partners_intervals() -> None:
    # only the sum of both is known well; their difference a hundred times less
    time, noise = np.arange(400) / 100.0, np.random.default_rng(3).normal(0.0, 1.0, 400)
    jacobian = np.column_stack([np.ones(400), 1.0 + 0.01 * np.sin(time)])

    def half(rows: np.ndarray, names: str, at_bound: list[int]) -> float:
        run = LinearisedRun("run", "y", time, noise, rows)
        variables = unknowns_of(names, np.ones(len(names)), at_bound=at_bound)
        *others, found = uncertainty(linear_fit([run], variables)).estimates
        assert any(each.status == "at its upper bound" for each in others) == any(at_bound)
        return found.upper - found.lower

    assert half(jacobian, "ab", [1, 0]) == pytest.approx(half(jacobian, "ab", [0, 0]))
    # conditioned on the bound it would be far narrower
    assert half(jacobian, "ab", [1, 0]) > 10.0 * half(jacobian[:, 1:], "b", [0])


def test_a_nonlinear_model_agrees_with_a_root_search() -> None:
    time = np.linspace(0.0, 3.0, 40)
    measured = 2.0 * np.exp(-1.5 * time) + 0.1 * np.random.default_rng(0).normal(size=40)

    def minimise(index: int, value: float, start: np.ndarray) -> tuple[float, np.ndarray]:
        def residual(free: np.ndarray) -> np.ndarray:
            gain, rate = np.insert(free, index, value)
            return gain * np.exp(-rate * time) - measured

        found = least_squares(residual, np.delete(start, index))
        return float(found.cost), np.insert(found.x, index, value)

    best = least_squares(lambda v: v[0] * np.exp(-v[1] * time) - measured, [1.0, 1.0])
    limit = 2.0 * best.cost / 38.0
    found = profile(minimise, best.x, best.cost, 1, limit, 0.1)
    assert found.endings == ("crossed", "crossed")

    def over(rate: float) -> float:
        shape = np.exp(-rate * time)
        gain = shape @ measured / (shape @ shape)
        return 0.5 * float(np.sum((gain * shape - measured) ** 2)) - best.cost - limit

    assert found.lower == pytest.approx(brentq(over, 0.5, best.x[1]), rel=1e-3)
    assert found.upper == pytest.approx(brentq(over, best.x[1], 4.0), rel=1e-3)
    # the interval is not symmetric
    assert found.upper - best.x[1] > 1.05 * (best.x[1] - found.lower)


def bowl(index: int, value: float, start: np.ndarray) -> tuple[float, np.ndarray]:
    """One unknown, cost ½ u² beside a noise cost of 1."""
    return 1.0 + 0.5 * value**2, np.array([value])


LIMIT = 0.5
ZERO = np.zeros(1)


def test_a_bound_leaves_a_side_open() -> None:
    found = profile(bowl, ZERO, 1.0, 0, LIMIT, 1.0, (-0.4, np.inf))
    assert found.endings == ("bound", "crossed")
    assert found.lower is None
    assert found.upper == pytest.approx(1.0, rel=2e-3)
    assert found.points[0].number == -0.4
    assert "Z17 reaches its bound" in replace(found, name="Z17").sentences()[0]


def test_the_domains_edge_ends_a_side() -> None:
    def edged(index: int, value: float, start: np.ndarray) -> tuple[float, np.ndarray]:
        if value > 0.5:
            raise DomainError("|sin φ| reaches 1.")
        return bowl(index, value, start)

    found = profile(edged, ZERO, 1.0, 0, LIMIT, 1.0)
    assert found.endings == ("crossed", "domain")
    assert found.points[-1].number == pytest.approx(0.5, abs=0.05)


def test_a_better_optimum_stops_it() -> None:
    def two(index: int, value: float, start: np.ndarray) -> tuple[float, np.ndarray]:
        return 1.0 + min(0.5 * value**2, 0.5 * (value - 0.8) ** 2 - 0.3), np.array([value, 7.0])

    found = profile(two, np.zeros(2), 1.0, 0, LIMIT, 1.0)
    assert found.better is not None
    assert found.better.cost < 1.0
    assert found.better.vector[1] == 7.0
    assert (found.lower, found.upper) == (None, None)
    assert "met a better optimum" in found.sentences()[0]


def test_a_cost_that_is_lower_by_next_to_nothing_does_not_stop_it() -> None:
    """Less than 2 % of the rise at an interval's end: it moves that end by less than 1 %."""

    def dented(index: int, value: float, start: np.ndarray) -> tuple[float, np.ndarray]:
        dent = 0.015 if abs(value - 0.35) < 0.2 else 0.0
        return 1.0 + max(0.5 * value**2 - 5.0 * dent, -dent) * LIMIT, np.array([value])

    found = profile(dented, ZERO, 1.0, 0, LIMIT, 1.0)
    assert found.better is None
    assert found.upper == pytest.approx(2.0**0.5, rel=0.02)


# --- where the cost does not rise as derivatives say ----------------------------------------------


LIMITED = model_of(lambda values, time, _: np.minimum(values["gain"] * time, values["stop"]))
"""The stop is told only where it is reached."""


def limited_problem(y: np.ndarray) -> Problem:
    unknowns = Unknowns((Unknown("gain", 1.0, 0.1, 3.0), Unknown("stop", 3.0, 0.5, 20.0)))
    return Problem(LIMITED, (bench_run("run", 1.0, y),), unknowns, ("y",), {"y": 0.1})


def test_a_stop_that_is_reached_has_both_ends() -> None:
    noise = 0.1 * np.random.default_rng(1).normal(size=TIME.size)
    found = limited_problem(np.minimum(TIME, 2.5) + noise)
    best = solve(found).vector
    linearised = linearised_fit(found, best)
    assert not [*checked_ends(found, best, linearised, reach(uncertainty(linearised).own))]


def test_a_stop_that_is_just_touched_has_no_upper_end() -> None:
    """The truth never reaches it; the last sample happens to lie low, so that the fit touches."""
    noise = 0.02 * np.random.default_rng(2).normal(size=TIME.size)
    noise[-2:] = -0.012  # less than one standard deviation
    found = limited_problem(TIME + noise)
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


def test_an_end_beyond_its_bound_is_looked_for_where_the_cost_tells_more() -> None:
    """The square of what bends the line: next to nothing moves there, and very much farther off."""
    bent = model_of(lambda values, time, _: values["gain"] * time + values["bend"] ** 2 * time**2)
    noise = 0.02 * np.random.default_rng(3).normal(size=TIME.size)
    unknowns = Unknowns((Unknown("gain", 1.0, 0.1, 3.0), Unknown("bend", 0.05, -1.0, 1.0)))
    run = bench_run("run", 1.0, TIME + 0.02**2 * TIME**2 + noise)
    found = Problem(bent, (run,), unknowns, ("y",), {"y": 0.02})
    best = solve(found).vector
    linearised = linearised_fit(found, best)
    half = reach(uncertainty(linearised).own)
    assert half[1] > 1.0  # beyond both bounds

    def risen(bend: float) -> float:
        """Of the cost, with the gain that is then best, over that of the interval's end."""
        left = (run["y"].values - bend**2 * TIME**2) / 0.02
        left -= TIME * (TIME @ left) / (TIME @ TIME)
        inverse = linearised.whitening @ linearised.whitening.T
        return (0.5 * left @ left - found.cost(best)) / (0.5 * half[1] ** 2 / inverse[1, 1]) - 1.0

    ends = {end.upper: end.distance for end in checked_ends(found, best, linearised, half)}
    scale = found.unknowns.items[1].scale
    distances = (
        brentq(risen, 0.0, 1.0) - scale * best[1],
        scale * best[1] - brentq(risen, -1.0, 0.0),
    )
    assert (scale * ends[True], scale * ends[False]) == pytest.approx(distances, rel=5e-3)
