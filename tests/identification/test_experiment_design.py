"""Which run tells of which unknown, and which further test would tell most."""

from collections.abc import Mapping
from functools import cache

import numpy as np
import pytest
from tests.identification.given import determined_of, run_of, unknowns_of, virtual

from swashplate import Campaign, Drive, Experiment, InputError, maneuvers
from swashplate.identification import (
    FitSetup,
    Identifiability,
    Prior,
    RunInformation,
    advise,
    fit,
    prior_information,
    run_information,
    uncertainty_of,
)
from swashplate.identification.estimation import Forces, smooth
from swashplate.identification.estimation.setup import Free
from swashplate.identification.statistics import advice_table, best_tests_table, sequential_plan
from swashplate.identification.statistics.determination import identifiability
from swashplate.identification.statistics.experiment_design import (
    MEMORY,
    CandidateTest,
    Sensor,
    default_maneuvers,
    default_sensors,
)
from swashplate.maneuvers import sine, step

AB = unknowns_of("ab", np.ones(2))


def diagonal(*errors: float) -> np.ndarray:
    """Rows that leave standard errors as given."""
    return np.diag([0.0 if np.isinf(each) else 1.0 / each for each in errors])


@pytest.mark.parametrize("largest", [(10.0, 10.0), (5.0, 5.0), (5.0, 4.2), (0.8, 9.3), (9.0, 9.0)])
def test_no_usual_test_goes_beyond_the_largest_command(largest) -> None:
    """A stick that ends at 5 V cannot make a step of 9 V."""
    usual = default_maneuvers(largest)
    assert len({test.name for test in usual}) == len(usual) == 18
    ends = [(float(v.max()), float(v.min())) for v in (test.sample(100.0) for test in usual)]
    assert max(high for high, _ in ends) == pytest.approx(largest[0], rel=0.11)
    assert max(high for high, _ in ends) <= largest[0] + 1e-9
    assert min(low for _, low in ends) >= -largest[1] - 1e-9


def test_a_candidate_that_mixes_known_and_unknown_tells_of_the_unknown_alone() -> None:
    """It measures a + b: b becomes known as well as a, a no better than before."""
    (found,) = advise(diagonal(0.1, np.inf), [CandidateTest("sum", np.array([[1e3, 1e3]]))], AB)
    assert found.newly_determined == ("b",)
    assert found.after[0] == pytest.approx(0.1)
    assert found.after[1] == pytest.approx(0.1, rel=1e-3)
    assert found.d_gain == pytest.approx(1.0)
    # what was not known before has no error to come from
    assert "b to 10 %" in str(advice_table("", [found]))
    (sharper,) = advise(diagonal(0.1, 0.2), [CandidateTest("b", np.array([[0.0, 1e3]]))], AB)
    assert "b 20 % to 0.1 %" in str(advice_table("", [sharper]))


def test_the_order_is_that_of_determinants_computed_apart() -> None:
    rng = np.random.default_rng(8)
    variables = unknowns_of("abcd", np.ones(4))
    present = rng.normal(size=(30, 4))
    candidates = [CandidateTest(f"c{k}", rng.normal(size=(20, 4)) * (k + 1)) for k in range(5)]
    gains = {
        each.name: np.linalg.slogdet(
            np.eye(4) + np.linalg.solve(present.T @ present, each.derivatives.T @ each.derivatives)
        )[1]
        for each in candidates
    }
    found = advise(present, candidates, variables)
    assert [each.candidate for each in found] == sorted(gains, key=lambda name: -gains[name])
    for each in found:
        assert np.log(each.d_gain) * 8.0 == pytest.approx(gains[each.candidate])


def test_an_unknown_at_its_bound_counts_as_known() -> None:
    variables = unknowns_of("ab", np.ones(2), at_bound=[1, 0])
    (found,) = advise(np.zeros((0, 2)), [CandidateTest("sum", np.array([[1.0, 4.0]]))], variables)
    assert found.names == ("b",)
    assert found.after[0] == pytest.approx(0.25)


# --- tests of a drive -----------------------------------------------------------------------------


HOIST = Drive(smooth(Drive.preset("hoist").parameters))
FACTOR = Free(relative=(0.5, 2.0), log=True)
SPEED = Sensor("shaft_speed", 0.01)


@pytest.fixture(scope="module")
def hoist_tests(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    """Kruse's tests of a hoist near the published one, with instruments."""
    return virtual(tmp_path_factory.mktemp("rig"), "hoist", seed=4, perturb=0.02)


def setup(*names: str) -> FitSetup:
    return FitSetup(part="pump", free=dict.fromkeys(names, FACTOR))


def run(name: str, volts: float, noise: float = 0.0) -> Experiment:
    command = maneuvers.step(volts, start=0.5, stop=2.5, length=4.0).sample(512.0)
    speed = HOIST.simulate(command).shaft_speed
    speed = speed + noise * np.random.default_rng(1).normal(size=speed.size)
    return run_of(name, command, {"shaft_speed": speed}, noise=0.01)


def test_a_plan_by_hand() -> None:
    """After the first choice its like is worth little: the plan turns to the other unknown."""
    variables = unknowns_of("ab", np.ones(2))
    rows = {"a": [[10.0, 0.0]], "a again": [[9.0, 0.0]], "b": [[0.0, 1.0]], "rest": [[0.0, 0.0]]}
    candidates = [CandidateTest(name, np.array(row)) for name, row in rows.items()]
    plan = sequential_plan(np.diag([1.0, 1.0]), candidates, variables, 4)
    assert [each.candidate for each in plan] == ["a", "b", "a again"]
    # 1/√(1 + 100), and 1/√(1 + 100 + 81)
    assert plan[0].after[0] == pytest.approx(101.0**-0.5)
    assert plan[2].before[0] == pytest.approx(101.0**-0.5)
    assert plan[2].after[0] == pytest.approx(182.0**-0.5)
    best = best_tests_table(advise(np.diag([1.0, 1.0]), candidates, variables))
    assert [(row.cells[0], row.cells[-1]) for row in best.rows] == [("a", "a"), ("b", "b")]


def test_errors_are_those_of_least_squares_by_hand() -> None:
    """The speed is Z10 times an angle: the error of ln Z10 is noise over the speed's length."""
    known = prior_information(HOIST.parameters, setup("Z10"))
    test = maneuvers.step(4.0, start=0.5, stop=2.5, length=4.0)
    (found,) = advise(known.present, [known.candidate(test, [SPEED])], known.variables)
    speed = HOIST.simulate(test.sample(512.0)).shaft_speed
    independent = MEMORY * 512.0
    expected = 0.01 * np.sqrt(independent) / np.linalg.norm(speed)
    assert found.before[0] == np.inf
    assert found.after[0] == pytest.approx(expected)


def test_the_free_zero_of_an_encoder_costs_what_it_must() -> None:
    """Position is Z10 times the angle's integral, from an unknown zero: only its scatter counts."""
    known = prior_information(HOIST.parameters, setup("Z10"))
    test = maneuvers.step(4.0, start=0.5, stop=2.5, length=4.0)
    encoder = Sensor("encoder_counts", 0.001, memory=1.0 / 512.0)
    (found,) = advise(known.present, [known.candidate(test, [encoder])], known.variables)
    position = HOIST.simulate(test.sample(512.0)).shaft_position
    assert found.after[0] == pytest.approx(0.001 / np.linalg.norm(position - position.mean()))


def test_what_is_known_counts_once() -> None:
    prior = Free(relative=(0.5, 2.0), log=True, prior=Prior(mean=11.4, deviation=0.2))
    plan = FitSetup(part="pump", free={"Z10": prior})
    known = prior_information(HOIST.parameters, plan)
    np.testing.assert_allclose(np.abs(known.present), [[5.0]])
    rest = known.candidate(maneuvers.step(4.0), [Sensor("shaft_speed", 1e6)])
    (found,) = advise(known.present, [rest], known.variables)
    assert found.after[0] == pytest.approx(0.2, rel=1e-6)


def test_residuals_of_a_fit_tell_the_noise() -> None:
    noisy = [run("up", 5.0, 0.04), run("down", -5.0, 0.04)]
    stated = prior_information(HOIST.parameters, setup("Z10"), noisy)
    fitted = prior_information(HOIST.parameters, setup("Z10"), noisy, fitted=True)
    assert stated.sensors[0].noise == 0.01
    assert fitted.sensors[0].noise == pytest.approx(0.04, rel=0.05)
    # white: each sample counts, or nearly, as the larger of two estimates of the error is quoted
    assert 1.0 / 512.0 <= fitted.sensors[0].memory < 2.0 / 512.0
    with pytest.raises(InputError, match="'shaft_speed' .* % of its range"):
        prior_information(HOIST.parameters, setup("Z10"), [run("exact", 5.0)], fitted=True)


@pytest.mark.slow
def test_what_is_known_is_what_a_fit_of_the_same_tests_knows(hoist_tests: Campaign) -> None:
    """Coloured residuals and free zeros of the encoder: neither makes the errors another story."""
    setup = determined_of("hoist")
    runs = hoist_tests.select(role="fit")
    found = fit(Drive.preset("hoist").parameters, runs, setup)
    known = prior_information(found.parameters, setup, runs, fitted=True)
    now = np.sqrt(np.diag(np.linalg.inv(known.present.T @ known.present)))
    noise = uncertainty_of(found).own
    errors = dict(zip(noise.variables.names, noise.standard_errors, strict=True))
    ratio = np.array([now[k] / errors[name] for k, name in enumerate(known.variables.names)])
    assert 0.5 < np.median(ratio) < 2.0
    assert (np.abs(np.log(ratio)) < np.log(4.0)).all(), ratio


def test_sensors_of_a_fresh_plan() -> None:
    current, encoder = default_sensors(HOIST)
    assert (current.kind, encoder.kind) == ("rectified_current", "encoder_counts")
    # 2526.3 counts a turn, rounded to whole ones
    assert encoder.noise == pytest.approx(2.0 * np.pi / 2526.3 / np.sqrt(12.0), rel=1e-4)
    # half a per cent of the current at 10 V
    full = max(abs(HOIST.steady_current(10.0)), abs(HOIST.steady_current(-10.0)))
    assert current.noise == pytest.approx(0.005 * full, rel=1e-3)
    own = default_sensors(HOIST.renamed("mine"))
    assert [each.kind for each in own] == ["rectified_current", "shaft_speed"]


def test_runs_driven_by_a_current_are_counted() -> None:
    current, channels = np.full(2049, 0.5), {"shaft_speed": np.zeros(2049)}
    driven = run_of("by current", current, channels, kind="current", noise=0.01)
    known = prior_information(HOIST.parameters, setup("Z10"), [driven])
    speed = HOIST.simulate_current(current).shaft_speed
    expected = np.linalg.norm(speed) / (0.01 * np.sqrt(MEMORY * 512.0))
    np.testing.assert_allclose(np.abs(known.present), [[expected]])
    current = Sensor("rectified_current", 0.01)
    with pytest.raises(InputError, match="pump .* rectified_current"):
        prior_information(HOIST.parameters, setup("Z10"), sensors=[current])


# --- what the runs tell, before a fit -------------------------------------------------------------


def looked(free: Mapping[str, Free], *runs: Experiment, **more: object) -> RunInformation:
    return run_information(FitSetup(part="pump", free=free, **more), HOIST.parameters, runs)


def test_before_a_fit_each_run_is_marked() -> None:
    found = looked({"Z13": FACTOR, "Z10": FACTOR}, run("low", 3.0), run("high", 9.0))
    assert found.shares["Z13_plus"] == {"low": 0.0, "high": 1.0}
    assert found.shares["Z13_minus"] == {"low": 0.0, "high": 0.0}
    assert [row.cells[3] for row in found.table().rows] == [".#", "..", "+#"]
    assert found.effects["Z13_minus"] == 0.0
    # the speed is Z10 times an angle: 1 % of it is 1 % of all speeds, over their noise
    speeds = np.concatenate([HOIST.simulate(each.input.values).shaft_speed for each in RUNS])
    assert found.effects["Z10"] == pytest.approx(np.linalg.norm(0.01 * speeds) / 0.01)
    determined, lacking, alone = found.sentences()
    assert determined == "The tests determine 2 combinations of 3 free parameters."
    assert "Z13_minus needs the swash plate at its stop" in lacking
    assert "Z13_plus: 90 % of the information or more is from high alone" in alone


RUNS = (run("low", 3.0), run("high", 9.0))


def test_forces_that_no_current_reaches_are_named_together() -> None:
    currents = (0.06, 0.16, 0.28, 0.38)
    found = looked({"Z10": FACTOR}, run("up", 4.0), forces=Forces(plus=currents, minus=currents))
    assert found.identifiability.unexcited == tuple(f"force_minus_{k}" for k in (1, 2, 3, 4))
    assert any(
        "force_minus_3 and force_minus_4 need currents" in said for said in found.sentences()
    )


# --- identifiability ------------------------------------------------------------------------------


RNG = np.random.default_rng(4)
PUMP = [f"Z{k}" for k in range(1, 23)]


def columns(*null: tuple[float, ...], rows: int = 50) -> np.ndarray:
    """Derivatives that vanish along given directions."""
    count = len(null[0])
    basis = np.linalg.qr(np.array(null).T, mode="complete")[0][:, len(null) :]
    return RNG.normal(size=(rows, count - len(null))) @ basis.T


def judged(derivatives: np.ndarray, names: str | list[str], **more: object) -> Identifiability:
    return identifiability(derivatives, unknowns_of(list(names), np.ones(len(names))), **more)


@cache
def pump_columns(axis: str) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Names and values of a pump's parameters, and how the speed depends on them."""
    drive = Drive.preset(axis)
    voltages = [step(9.0), step(-6.5), sine(9.0, 0.1, length=20.0)]
    found = [drive.sensitivities(each.sample(128.0), 128.0, parameters=PUMP) for each in voltages]
    names = list(found[0].names)
    values = np.array([drive.parameters.numbers[name] for name in names])
    return names, values, np.vstack([each["shaft_speed"] for each in found])


def pump(axis: str, leave: set[str] = frozenset()) -> Identifiability:
    """What the tests of a pump tell, without some of its parameters."""
    names, values, derivatives = pump_columns(axis)
    kept = [k for k, name in enumerate(names) if name not in leave]
    scales = np.where(values == 0.0, 1.0, np.abs(values))[kept]
    variables = unknowns_of([names[k] for k in kept], values[kept], scales=scales)
    return identifiability(derivatives[:, kept] * scales, variables)


def test_a_null_direction_is_written_by_name() -> None:
    found = judged(columns((0.0, -0.7, 0.0, 0.7)), ["Z1", "Z3", "Z8", "Z9"])
    (direction,) = found.null
    assert direction.changes["Z3"] == pytest.approx(-direction.changes["Z9"])
    assert set(direction.changes) == {"Z3", "Z9"}
    assert "together change nothing. Fix Z" in direction.sentence
    assert direction.gauge is None
    assert found.rank == 3


def test_two_null_directions_come_apart() -> None:
    """Any mixture of two null directions is null too: the sparse ones are wanted."""
    found = judged(columns((1.0, 1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0, -2.0)), "abcde")
    assert {frozenset(each.changes) for each in found.null} == {frozenset("ab"), frozenset("de")}
    assert len({each.fix for each in found.null}) == 2


def test_a_weak_unknown_is_named_with_what_follows_it() -> None:
    """b differs from a by little: both are known to ±20 % only, their sum well."""
    base = np.linalg.qr(RNG.normal(size=(100, 3)))[0] * 1e3
    base[:, 1] = base[:, 0] + 1e-2 * base[:, 1]
    found = judged(base, "abc")
    assert found.complete
    (direction,) = found.weak
    # along (1, -1) only 1e-2 of the second column of length 1e3 is seen
    assert direction.half_width == pytest.approx(1.96 / 10.0, rel=1e-3)
    assert set(direction.changes) == {"a", "b"}
    assert direction.changes["a"] == pytest.approx(-direction.changes["b"], rel=1e-3)
    assert f"{direction.fix} is known to ±19.6 % only" in direction.sentence


def test_weak_is_what_the_given_covariance_says() -> None:
    given = np.diag([0.06**2, 0.01**2, 0.04**2])
    (direction,) = judged(RNG.normal(size=(10, 3)), "abc", covariance=given).weak
    assert direction.fix == "a"
    assert "a is known to ±11.8 % only" in direction.sentence
    wider = judged(RNG.normal(size=(10, 3)), "abc", covariance=9.0 * given).sentences()
    assert sum("Weak" in each for each in wider) == 1
    assert "Weak, each with those before it fixed: a to ±35.3 % and c to ±23.5 %." in wider[-1]
    assert "all 3 free parameters, 2 of them weakly" in wider[0]
    widest = judged(RNG.normal(size=(10, 3)), "abc", covariance=1e4 * given).sentences()
    assert "a to no better than ±100 %" in widest[-1]


def test_an_unknown_that_is_hardly_known_is_not_called_determined() -> None:
    given = np.diag([900.0**2, 0.01**2, 0.04**2])
    first, last = judged(RNG.normal(size=(10, 3)), "abc", covariance=given).sentences()
    assert "all 3" not in first
    assert first.endswith("hardly a.")
    assert "±176400 %" not in last
    assert "±1.76e+05 %" not in last


EXACT = ["scale of pressure", "zero of pressure", "scale of spool travel", "scale of force"]
FIXED = ["Z1", "Z2", "Z5", "Z4"]


@pytest.mark.parametrize("axis", ["hoist", "slew", "luff"])
def test_no_speed_tells_the_gauges_of_a_pump(axis: str) -> None:
    found = pump(axis)
    stop = ["Z13_plus", "Z13_minus"] if axis == "luff" else []
    assert {*found.unexcited} == {*stop, "Z14", "Z15"}
    # away from the swash plate's stops one more
    names = EXACT + ["piston motion against flow gain"] * bool(stop)
    assert [each.gauge.name for each in found.null if each.gauge] == names
    assert len(found.null) == len(names)
    assert [*found.to_fix] == [*found.unexcited, *FIXED] + ["Z6"] * bool(stop)


def test_two_gauges_tied_by_a_held_member_are_one_direction() -> None:
    """With Z8 held, pressure and spool travel can only scale together."""
    found = pump("hoist", {"Z14", "Z15", "Z2", "Z7", "Z11", "Z12", "Z8", "Z4"})
    (direction,) = [each for each in found.null if each.gauge is None]
    assert {"Z1", "Z5", "Z9", "Z16_plus", "Z16_minus", "Z18"} <= set(direction.changes)
    assert direction.changes["Z1"] / direction.changes["Z5"] == pytest.approx(-2.0, rel=1e-6)
