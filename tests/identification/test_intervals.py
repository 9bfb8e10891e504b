"""Intervals in the unknowns' own units, what leaves an unknown without one, and profiles."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq, least_squares
from tests.identification.given import (
    TIME,
    bench_run,
    determined_of,
    first_order,
    linear_fit,
    model_of,
    run_of,
    unknowns_of,
    virtual,
)
from tests.identification.test_own_model import NOISE, RANGES, RUNS, servo

from swashplate import Campaign, DomainError, Drive, InputError, ParameterError
from swashplate.identification import (
    Fit,
    FitSetup,
    ModelSetup,
    Prior,
    Problem,
    Unknown,
    Unknowns,
    fit,
    linearised_fit,
    load_setup,
    solve,
    uncertainty,
    uncertainty_of,
)
from swashplate.identification.estimation.problem import LinearisedRun, Loss, influence
from swashplate.identification.estimation.setup import setup_text
from swashplate.identification.noise import Covariance
from swashplate.identification.statistics.interval_ends import checked_ends
from swashplate.identification.statistics.intervals import (
    estimates,
    prior_sentences,
    reach,
    weighed,
    with_effects,
)
from swashplate.identification.statistics.profiles import profile
from swashplate.maneuvers import source_tests


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
    assert (plain.standard_error, plain.lower, plain.upper) == (None, None, None)


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
    run = LinearisedRun("a", "speed", np.arange(50.0), noise)
    found = uncertainty(linear_fit([run], [jacobian], unknowns_of("ab", np.ones(2), **more)))
    assert all(each.standard_error is None for each in found.estimates)
    at_bounds = ["at its upper bound", "at its lower bound"]
    expected = at_bounds if more else ["undetermined"] * 2
    assert [each.status for each in found.estimates] == expected


def test_an_undetermined_unknown_does_not_spoil_the_others() -> None:
    rng = np.random.default_rng(1)
    jacobian = rng.normal(size=(40, 3))
    jacobian[:, 1] = -2.0 * jacobian[:, 0]
    run = LinearisedRun("a", "speed", np.arange(40.0), rng.normal(size=40))
    made = linear_fit([run], [jacobian], unknowns_of("abc", np.ones(3)))
    assert made.determined.tolist() == [False, False, True]
    # the third beside the one combination of the others that is determined
    pair = jacobian[:, [0, 2]]
    found = (made.whitening @ made.whitening.T)[2, 2]
    assert found == pytest.approx(np.linalg.inv(pair.T @ pair)[1, 1], rel=1e-10)


def test_one_sample_is_refused() -> None:
    run = LinearisedRun("a", "speed", np.zeros(1), np.ones(1))
    with pytest.raises(InputError, match="1 sample .* 1 parameter"):
        uncertainty(linear_fit([run], [np.ones((1, 1))], unknowns_of(["p"], [1.0])))


def test_an_estimate_at_its_bound_is_released_in_its_partners_intervals() -> None:
    # only the sum of both is known well; their difference a hundred times less
    time, noise = np.arange(400) / 100.0, np.random.default_rng(3).normal(0.0, 1.0, 400)
    jacobian = np.column_stack([np.ones(400), 1.0 + 0.01 * np.sin(time)])

    def half(rows: np.ndarray, names: str, at_bound: list[int]) -> float:
        run = LinearisedRun("run", "y", time, noise)
        variables = unknowns_of(names, np.ones(len(names)), at_bound=at_bound)
        *others, found = uncertainty(linear_fit([run], [rows], variables)).estimates
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
    assert "found a better optimum" in found.sentences()[0]


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
    # an end is looked for to 3 % of its distance
    assert (scale * ends[True], scale * ends[False]) == pytest.approx(distances, rel=0.03)


# --- priors and robust losses ---------------------------------------------------------------------


COUNT, MEMORY = 40_000, 0.95


LEVEL = model_of(lambda values, time, _: np.full(time.size, values["level"]))


def problem(prior: Prior | None, *, memory: float, scale: float = 1.0) -> Problem:
    """A level of 2 under noise of variance 1 with this correlation from sample to sample."""
    noise = first_order(memory, np.random.default_rng(5), (COUNT,))
    unknowns = Unknowns((Unknown("level", 1.0, 0.1, 9.0, prior=prior),))
    time, ones = 0.01 * np.arange(COUNT), np.ones(COUNT)
    run = run_of("run", ones, {"y": 2.0 + noise}, time=time, kind="other", hold="previous")
    return Problem(LEVEL, (run,), unknowns, ("y",), {"y": scale})


def posterior(found: Problem, prior: Prior, memory: float) -> tuple[float, float]:
    """Mean and deviation by hand: a mean has (1 + a)/(1 - a)/n of the noise's variance."""
    mean = float(found.experiments[0]["y"].values.mean())
    data = COUNT * (1.0 - memory) / (1.0 + memory)
    known = 1.0 / prior.deviation**2
    return (data * mean + known * prior.mean) / (data + known), (data + known) ** -0.5


@pytest.mark.parametrize("scale", [1.0, 0.1], ids=["noise as stated", "noise ten times as stated"])
@pytest.mark.parametrize("memory", [0.0, MEMORY], ids=["white", "coloured"])
def test_estimate_and_interval_are_those_of_bayes(memory: float, scale: float) -> None:
    data = COUNT * (1.0 - memory) / (1.0 + memory)
    prior = Prior(2.0 + 3.0 * data**-0.5, data**-0.5)  # as sharp as the data, and beside them
    given = problem(prior, memory=memory, scale=scale)
    first = solve(given).vector
    found = weighed(given, first)
    best = solve(found, first).vector
    mean, deviation = posterior(given, prior, memory)
    assert float(best[0]) == pytest.approx(mean, abs=0.1 * deviation)
    told = uncertainty(linearised_fit(found, best))
    (estimate,) = estimates(told.quoted)
    half = 0.5 * (estimate.upper - estimate.lower)
    assert half == pytest.approx(1.96 * deviation, rel=0.1)
    if (memory, scale) != (0.0, 1.0):
        # unweighed the data would have swept the prior aside
        assert abs(first[0] - mean) > abs(best[0] - mean) + 0.3 * deviation
    (said,) = prior_sentences(found.unknowns, best, told.quoted.standard_errors)
    assert "contributes 5" in said or "contributes 4" in said  # half of what is known
    assert "below its mean" in said


def test_what_the_data_leave_open_is_the_prior() -> None:
    given = problem(Prior(2.0, 1.0), memory=MEMORY)
    # the model uses neither; a prior in the logarithm is a share of its mean
    known = {"low": 0.1, "high": 9.0, "prior": Prior(3.0, 0.2)}
    spare = Unknown("spare", 5.0, **known), Unknown("other", 5.0, **known, log=True)
    given = replace(given, unknowns=Unknowns((*given.unknowns, *spare)))
    found = weighed(given, solve(given).vector)
    best = solve(found).vector
    _, plain, log = estimates(uncertainty(linearised_fit(found, best)).quoted)
    assert (plain.value, log.value) == pytest.approx((3.0, 3.0), abs=1e-6)
    assert plain.upper - plain.lower == pytest.approx(2.0 * 1.959964 * 0.2, rel=1e-3)
    assert log.upper / log.lower == pytest.approx(np.exp(2.0 * 1.959964 * 0.2), rel=1e-3)


def level(seed: int, *, count: int = 500, outliers: float = 0.1) -> Problem:
    """A level of 2 under white noise of variance 1, one sample in ten of ten times that."""
    random = np.random.default_rng(seed)
    noise = random.normal(size=count) * np.where(random.random(count) < outliers, 10.0, 1.0)
    made = problem(None, memory=0.0)
    (run,) = made.experiments
    y = run["y"]
    y = replace(y, time=y.time[:count], values=2.0 + noise, weight=np.ones(count))
    unknowns = Unknowns((Unknown("level", 1.0, -9.0, 9.0),))
    return replace(made, experiments=(replace(run, channels={"y": y}),), unknowns=unknowns)


@pytest.mark.parametrize("loss", ["linear", "soft_l1", "cauchy"])
def test_the_influence_is_the_gradient_that_scipy_searches_with(loss: Loss) -> None:
    residuals = np.random.default_rng(3).standard_cauchy(40)
    found = least_squares(lambda x: residuals + x, np.zeros(1), loss=loss, max_nfev=1)
    bounded, slopes = influence(residuals + found.x, loss)
    assert float(found.grad[0]) == pytest.approx(bounded.sum(), rel=1e-12)
    step = 1e-6
    above, below = (influence(residuals + found.x + d, loss)[0] for d in (step, -step))
    smooth = np.abs(np.abs(residuals + found.x) - 1.0) > 2.0 * step
    np.testing.assert_allclose(((above - below) / (2 * step))[smooth], slopes[smooth], atol=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("loss", ["soft_l1", "cauchy"])
def test_intervals_hold_the_truth_among_outliers(loss: Loss) -> None:
    held, widths = 0, []
    for seed in range(1000, 1100):
        made = level(seed)
        vector = solve(made, loss=loss).vector
        (estimate,) = uncertainty(linearised_fit(made, vector, loss)).estimates
        held += estimate.lower <= 2.0 <= estimate.upper
        widths.append(estimate.upper - estimate.lower)
    # 100 campaigns tell a coverage of 95 % to 2.2 %
    assert held / 100 >= 0.88
    # the mean's own: 1.96 √(0.9 + 0.1·100)/√500 each way
    assert np.median(widths) < 0.5 * 2.0 * 1.96 * np.sqrt(10.9 / 500)


def test_a_loss_that_takes_all_for_outliers_is_refused() -> None:
    made = problem(None, memory=0.0, scale=1e-3)
    with pytest.raises(InputError, match="larger noise"):
        linearised_fit(made, np.array([2.0]), "cauchy")


# --- fixed parameters -----------------------------------------------------------------------------


DOUBTS = {"Z9": "3 %", "tau": 1e-3}
ONE = {"lag": RANGES["lag"], "start.place": RANGES["start.place"]}


def stated(**doubts: float | str) -> FitSetup:
    return determined_of("hoist", standard_uncertainty=doubts)


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    tests = source_tests("hoist")
    names = ("step +4 V", "step -4 V", "step +9 V", "step -9 V", "sine 9 V 0.1 Hz")
    chosen = {name: tests[name] for name in names}
    return virtual(tmp_path_factory.mktemp("t"), "hoist", chosen, seed=3, perturb=0.05)


@pytest.fixture(scope="module")
def doubted(campaign: Campaign) -> Fit:
    return fit(Drive.preset("hoist"), campaign, stated(**DOUBTS))


@pytest.mark.slow
@pytest.mark.parametrize(("name", "deviation"), [("Z9", 0.03), ("tau", 1e-3)])
def test_estimates_follow_a_fixed_number_as_in_a_fit_with_another(
    campaign: Campaign, doubted: Fit, name: str, deviation: float
) -> None:
    """tau acts on the card's estimates, and on the pump's by itself and through the card's."""
    published, found = Drive.preset("hoist"), doubted
    value = published.parameters.numbers[name]
    deviation *= value if name == "Z9" else 1.0
    step, ends = 0.5 * deviation, []
    for sign in (1.0, -1.0):
        moved = published.replace(**{name: value + sign * step})
        ends.append(fit(moved, campaign, stated()).solution.vector)
    known = uncertainty_of(found)
    told = known.own.determined
    expected = ((ends[0] - ends[1]) * (deviation / (2.0 * step)))[told]
    changes = known.systematic[f"uncertainty of {name}"][told]
    # Gauss and Newton leave out the residuals' curvature, and where the filter sticks in its
    # Coulomb band: the least cost jumps by 2 % within 50 µs of tau, and weak estimates with it, by
    # up to two of their own standard errors from one fit to the next
    errors = known.own.standard_errors[told]
    allowed = 0.1 * np.abs(expected) + (3.0 if name == "tau" else 1.0) * errors
    assert (np.abs(changes - expected) < allowed).all()
    assert (np.abs(changes) > 2.0 * errors).any()
    assert (known.quoted.standard_errors[told] >= errors).all()
    assert any("fixed parameters" in words for words in known.sentences())


def test_what_is_added_to_a_model_of_ones_own_is_that_of_other_fits() -> None:
    bare, doubted = (
        fit(ModelSetup(servo, ONE, noise=NOISE, fixed={"gain": 1.5}, **more), RUNS)
        for more in ({}, {"standard_uncertainty": {"gain": "4 %"}})
    )
    up, down = (
        fit(ModelSetup(servo, ONE, noise=NOISE, fixed={"gain": gain}), RUNS)
        for gain in (1.506, 1.494)
    )
    (plain, *_), (wide, *_) = uncertainty_of(bare).estimates, uncertainty_of(doubted).estimates
    # 4 % of the gain are ten times the change that was tried
    added = 10.0 * (up.values["lag"] - down.values["lag"]) / 2.0
    assert wide.value == plain.value
    assert wide.standard_error**2 == pytest.approx(plain.standard_error**2 + added**2, rel=0.05)
    assert wide.standard_error > 2.0 * plain.standard_error
    (sentence,) = (s for s in uncertainty_of(doubted).sentences() if "uncertainty of gain" in s)
    assert "widens them by a factor of" in sentence


@pytest.mark.parametrize(
    ("name", "doubt", "words"),
    [
        ("Z16_plus", "5 %", "Z16_plus is free: only what stays fixed"),
        ("Z20", 0.1, "Z20 is free: only what stays fixed"),
        ("Z9", "5", "standard_uncertainty.Z9"),
        ("Z9", -1.0, "standard_uncertainty.Z9"),
    ],
)
def test_it_is_written_and_read_and_refused_where_it_is_wrong(tmp_path, name, doubt, words) -> None:
    path = tmp_path / "own.toml"
    path.write_text(setup_text(stated(**DOUBTS)), "utf-8")
    assert load_setup(path).standard_uncertainty == DOUBTS
    said = f'"{doubt}"' if isinstance(doubt, str) else doubt
    text = f"standard_uncertainty = {{ {name} = {said} }}\n" + setup_text(stated())
    path.write_text(text, "utf-8")
    with pytest.raises(ParameterError, match=words):
        load_setup(path)


def test_variances_add_up_and_so_do_degrees_of_freedom() -> None:
    """By hand: 4 with 8 degrees of freedom, and 1.5² + 1² that were stated: 7.25."""
    known = np.ones(1, dtype=bool)
    own = Covariance(unknowns_of(["p"], [1.0]), np.array([[4.0]]), known, np.array([8.0]))
    both = with_effects(own, {"gain": np.array([1.5]), "zero": np.array([-1.0])})
    assert both.matrix[0, 0] == pytest.approx(7.25)
    assert both.degrees_of_freedom[0] == pytest.approx(7.25**2 / (4.0**2 / 8.0))
    assert with_effects(own, {}) is own
