"""Unknowns, problems, solvers and starts on a model whose optimum is known."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from tests.identification.given import RISE, TIME, bench_run, put, risen, run_of

from swashplate import (
    Campaign,
    DomainError,
    Drive,
    Experiment,
    FileError,
    InputError,
    ParameterError,
)
from swashplate.executors import Processes, Serial, Threads
from swashplate.identification import (
    FitSetup,
    Linearised,
    Prior,
    Problem,
    Solution,
    Unknown,
    Unknowns,
    sobol_starts,
    solve,
    solve_from,
)
from swashplate.identification.estimation.fit_problem import problem_of
from swashplate.identification.estimation.problem import Evaluation, noise_scales
from swashplate.identification.estimation.setup import Free
from swashplate.identification.estimation.solving import Progress
from swashplate.identification.estimation.unknowns import bounded


def test_tied_directions_and_unknowns_of_one_experiment() -> None:
    unknowns = Unknowns(
        (
            bounded("Z16", 2.0, factors=(0.5, 2.0), sets=("Z16_plus", "Z16_minus")),
            Unknown("offset", 1.0, -9.0, 9.0, run="lift"),
            Unknown("offset", 3.0, -9.0, 9.0, run="lower"),
        )
    )
    assert unknowns.names == ("Z16", "offset (lift)", "offset (lower)")
    vector = unknowns.start
    assert unknowns.targets(vector, "lower") == {"Z16_plus": 2.0, "Z16_minus": 2.0, "offset": 3.0}
    chain = unknowns.chain(vector, ["Z16_minus", "offset", "Z16_plus"], "lift")
    # by the run's own unknown and by that of the machine; none by another run's
    assert unknowns.columns("lift").tolist() == [1, 0]
    np.testing.assert_allclose(chain, [[0.0, 2.0], [1.0, 0.0], [0.0, 2.0]])


GAIN, LAG = 3.0, 0.7
UNKNOWNS = Unknowns(
    (
        bounded("gain", 1.0, bounds=(0.1, 20.0), log=True),
        bounded("lag", 2.0, bounds=(0.05, 5.0), log=True),
    )
)


@pytest.fixture
def problem() -> Problem:
    return made(*(bench_run(f"run {u}", u, risen(u, GAIN, LAG)) for u in (1.0, -2.0)))


def test_residuals_are_weighted_and_scaled() -> None:
    found = made(bench_run("run", 1.0, risen(1.0, GAIN, LAG) + 0.2, weight=4.0))
    vector = UNKNOWNS.vector_of({"gain": GAIN, "lag": LAG})
    residuals = found.evaluate(vector, compressed=False).residuals
    assert residuals == pytest.approx(np.full(81, -0.2 * 2.0 / 0.1))
    assert found.cost(vector) == pytest.approx(0.5 * 81 * 16.0)


def test_the_truth_is_found(problem: Problem) -> None:
    seen: list[Progress] = []
    solution = solve(problem, tolerance=1e-14, watch=seen.append)
    assert UNKNOWNS.values(solution.vector) == pytest.approx({"gain": GAIN, "lag": LAG}, rel=1e-9)
    assert solution.converged
    assert solution.cost < 1e-4 * problem.cost(problem.start)
    assert [each.iteration for each in seen] == list(range(1, len(seen) + 1))


WRONG = {
    "nothing": ("simulate", lambda y, by: None, "mapping of channel names .* None"),
    "no mapping": ("simulate", lambda y, by: y, "mapping of channel names .*'y'.* array"),
    "complex": ("simulate", lambda y, by: {"y": y + 1j}, "real numbers for y, .* complex128"),
    "text": ("simulate", lambda y, by: {"y": "fast"}, "real numbers for y, .* str"),
    "a list": ("simulate", lambda y, by: {"y": y.tolist()}, "real numbers for y, .* list"),
    "objects": ("simulate", lambda y, by: {"y": y.astype(object)}, "for y, .* object"),
    "too few": ("simulate", lambda y, by: {"y": y[1:]}, r"shape \(80,\) for y, .* \(81,\)"),
    "values alone": ("linearise", lambda y, by: {"y": y}, "Linearised for y, .* array"),
    "complex slopes": ("linearise", lambda y, by: {"y": Linearised(y, by + 0j)}, "real numbers"),
    "turned": ("linearise", lambda y, by: {"y": Linearised(y, by.T)}, r"\(81, 2\)"),
}


@pytest.mark.parametrize(("method", "change", "sentence"), WRONG.values(), ids=WRONG)
def test_what_a_model_must_return_is_said(method: str, change, sentence: str) -> None:
    def wrong(values, experiment, *names):
        return change(RISE.simulate(values, experiment)["y"], np.zeros((81, 2)))

    model = SimpleNamespace(**{"simulate": RISE.simulate, method: wrong})
    made = Problem(model, (bench_run("run", 1.0, np.ones(81)),), UNKNOWNS, ("y",), {"y": 0.1})
    with pytest.raises(InputError, match=f"run: {method} .*{sentence}"):
        solve(made)


def test_interrupted_with_the_best_so_far(problem: Problem) -> None:
    def stop(progress: Progress) -> None:
        if progress.iteration == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):  # who does not ask for it might take it for an optimum
        solve(problem, watch=stop)
    solution = solve(problem, watch=stop, keep_best=True)
    assert solution.interrupted
    assert not solution.converged
    assert solution.cost < problem.cost(problem.start)
    spent = solve(problem, max_evaluations=2)
    assert not spent.converged
    assert "allow more with --evaluations" in spent.message


RUN = bench_run("run", 1.0, risen(1.0, GAIN, LAG))
LOW = {"bounds": (0.0, 2.0)}


def made(*runs: Experiment, unknowns: Unknowns = UNKNOWNS) -> Problem:
    return Problem(RISE, runs, unknowns, ("y",), {"y": 0.1})


ZERO = Unknown("offset y", 0.0, -1.0, 1.0, run="lift", kind="zero", channel="y")
REFUSED = {
    "Z2 .* 0.*absolute bounds": lambda: bounded("Z2", 0.0, factors=(0.5, 2.0)),
    "a .* 5, .* bounds 0 and 2": lambda: bounded("a", 5.0, **LOW),
    "a .*'swashplate guess'": lambda: Unknown("a", np.nan, 0.0, 2.0),
    "a .* 2.* 0; .* lower one first": lambda: bounded("a", 1.0, bounds=(2.0, 0.0)),
    "a .* above 0": lambda: bounded("a", 1.0, **LOW, log=True),
    "prior of a .* positive": lambda: bounded("a", 1.0, **LOW, prior=Prior(1.0, 0.0)),
    "zero of a sensor, .* channel": lambda: Unknown("offset y", 0.0, -1.0, 1.0, kind="zero"),
    "offset y .* two": lambda: Unknowns((ZERO, ZERO)),
    "a .* set by two parameters": lambda: Unknowns(
        (Unknown("a", 1, 0, 2), Unknown("b", 1, 0, 2, sets=("a",)))
    ),
    "one parameter": lambda: made(RUN, unknowns=Unknowns(())),
    "one experiment": lambda: made(),
    "sample of y": lambda: made(bench_run("run", 1.0, TIME, weight=0.0)),
    "channel 'x'; .* y": lambda: noise_scales((RUN,), ("x",)),
    "'y' .*changes": lambda: noise_scales((bench_run("flat", 1.0, np.zeros(81)),), ("y",)),
}


@pytest.mark.parametrize(("sentence", "make"), REFUSED.items(), ids=REFUSED)
def test_unknowns_and_problems_that_are_refused(sentence: str, make: Callable) -> None:
    with pytest.raises((ParameterError, InputError), match=sentence):
        make()


def test_starts_are_spread_seeded_and_inside(problem: Problem) -> None:
    starts = list(sobol_starts(problem, 12, seed=5))
    low, high = problem.bounds
    assert all(((low <= each) & (each <= high)).all() for each in starts)
    again = list(sobol_starts(problem, 20, seed=5))
    np.testing.assert_array_equal(starts, again[:12])
    assert not np.array_equal(starts[0], next(iter(sobol_starts(problem, 1, seed=6))))


@pytest.mark.slow
def test_threads_and_processes_give_the_same_as_one_after_another(short_campaign: Campaign) -> None:
    free = {name: Free(relative=(0.5, 2.0)) for name in ("J_plus", "G1_plus")}
    setup = FitSetup(part="card", free=free)
    nominal = Drive.preset("hoist").parameters
    problem = problem_of(setup, nominal, short_campaign.experiments[:1], threads=1)
    starts = list(sobol_starts(problem, 3, seed=2))
    here = solve_from(problem, starts, executor=Serial())
    for executor in (Threads(2), Processes(2)):
        there = solve_from(problem, starts, executor=executor)
        for one, other in zip(here, there, strict=True):
            assert (one.number, one.cost) == (other.number, other.cost)
            np.testing.assert_array_equal(one.vector, other.vector)


def test_what_is_done_is_on_disk_and_is_not_done_again(problem: Problem, tmp_path: Path) -> None:
    starts = list(sobol_starts(problem, 5, seed=2))
    store = tmp_path / "starts"

    def stop(result: Solution, done: int) -> None:
        if done == 2:
            raise KeyboardInterrupt

    kept = {"store": store, "origin": {"data": "x"}}
    first = solve_from(problem, starts, **kept, watch=stop)
    assert [each.number for each in first] == [0, 1]
    assert len(list(store.glob("start-*.json"))) == 2
    seen: list[int] = []
    again = {**kept, "resume": True, "watch": lambda result, done: seen.append(result.number)}
    full = solve_from(problem, starts, **again)
    assert seen == [2, 3, 4]
    whole = solve_from(problem, starts)
    np.testing.assert_array_equal([e.vector for e in full], [e.vector for e in whole])


def test_results_of_another_fit_are_not_resumed(problem: Problem, tmp_path: Path) -> None:
    starts = list(sobol_starts(problem, 2, seed=2))
    solve_from(problem, starts, store=tmp_path, origin={"data": "x"})
    with pytest.raises(FileError, match="resume .*remove"):
        solve_from(problem, starts, store=tmp_path, origin={"data": "x"})
    with pytest.raises(FileError, match="data differ"):
        solve_from(problem, starts, store=tmp_path, origin={"data": "y"}, resume=True)


POISON = {
    "no object": (lambda text: "[1]", "result of a start"),
    "a key more": (put('"cost"', '"more": 1, "cost"'), "more"),
    "no number": (put(r'"cost": [^,]+', '"cost": NaN'), "cost"),
    "text for a vector": (put(r'"vector": \[[^]]+\]', '"vector": "abc"'), "vector"),
    "nested vector": (put(r'"vector": \[[^]]+\]', '"vector": [[1.0, 2.0]]'), "vector"),
    "wrong length": (put(r'"vector": \[[^]]+\]', '"vector": [1.0]'), "starts differ"),
    "other start": (put(r'"start": \[[^]]+\]', '"start": [0.0, 1.0]'), "starts differ"),
}


@pytest.mark.parametrize(("poison", "sentence"), POISON.values(), ids=POISON)
def test_a_damaged_start_is_refused(problem: Problem, tmp_path: Path, poison, sentence) -> None:
    starts = list(sobol_starts(problem, 1, seed=2))
    solve_from(problem, starts, store=tmp_path, origin={"data": "x"})
    path = tmp_path / "start-00000.json"
    path.write_text(poison(path.read_text("utf-8")), "utf-8")
    with pytest.raises(FileError, match=f"start-00000.json.*{sentence}") as caught:
        solve_from(problem, starts, store=tmp_path, origin={"data": "x"}, resume=True)
    assert len(str(caught.value)) < 500


@dataclass(frozen=True)
class Forbidden:
    """Four unknowns within ±1 of 0, quadratic about it; the last may not exceed a limit."""

    limit: float
    start = np.full(4, -0.5)
    bounds = (np.full(4, -1.0), np.full(4, 1.0))

    def evaluate(self, vector: np.ndarray, *, compressed: bool = True) -> Evaluation:
        if vector[3] > self.limit:
            raise DomainError("too much")
        return Evaluation(vector, np.eye(4))

    def cost(self, vector: np.ndarray) -> float:
        return 0.5 * float(np.sum(self.evaluate(vector).residuals ** 2))


def test_points_outside_the_domain_are_drawn_again() -> None:
    starts = np.array(list(sobol_starts(Forbidden(0.25), 32, seed=0)))
    assert starts.shape == (32, 4)
    assert (starts[:, 3] <= 0.25).all()
    with pytest.raises(InputError, match="narrow the bounds"):
        list(sobol_starts(Forbidden(-0.9999), 8, seed=0))


@dataclass(frozen=True)
class Stop:
    """A speed of 2 that a stop at x cuts off where x is below it; 1.5 was measured."""

    bounds: tuple[np.ndarray, np.ndarray] = (np.array([0.5]), np.array([6.0]))
    start = np.ones(1)

    def evaluate(self, vector: np.ndarray, *, compressed: bool = True) -> Evaluation:
        x = float(vector[0])
        return Evaluation(np.array([min(2.0, x) - 1.5]), np.array([[1.0 if x < 2.0 else 0.0]]))

    def cost(self, vector: np.ndarray) -> float:
        return 0.5 * float(self.evaluate(vector).residuals[0] ** 2)


def test_a_search_that_lost_the_stop_finds_it_again() -> None:
    (result,) = solve_from(Stop(), [np.full(1, 5.0)])
    np.testing.assert_allclose(result.vector, [1.5])


class Thresholded:
    """A command passes from a threshold on; its gain and a lag act on what passes."""

    def simulate(self, values: Mapping[str, float], experiment: Experiment) -> dict:
        passed, _ = self._passed(values, experiment)
        return {"speed": values["gain"] * passed + values["zero"]}

    def linearise(self, values: Mapping[str, float], experiment: Experiment, names) -> dict:
        passed, slope = self._passed(values, experiment)
        by = {
            "threshold": values["gain"] * slope,
            "gain": passed,
            "zero": np.ones(passed.size),
        }
        speed = values["gain"] * passed + values["zero"]
        return {"speed": Linearised(speed, np.column_stack([by[name] for name in names]))}

    def _passed(self, values: Mapping[str, float], experiment: Experiment) -> tuple:
        command = experiment.input.at(experiment["speed"].time)
        moves = command > values["threshold"]
        # beyond the threshold it jumps by 1: a level that falls short of it costs a jump
        return np.where(moves, 1.0 + command - values["threshold"], 0.0), -1.0 * moves


def test_a_search_goes_on_past_a_jump_of_the_cost() -> None:
    levels = np.repeat([0.0, 0.5, 1.0, 2.0, 4.0], 20)
    time = 0.1 * np.arange(levels.size)
    true = {"threshold": 0.45, "gain": 3.0, "zero": 0.2}
    run = run_of("stair", levels, {"speed": np.zeros(levels.size)}, time=time, noise=0.01)
    measured = Thresholded().simulate(true, run)["speed"]
    # an offset that only a threshold beyond the level of 0.5 would mend drives the search there
    measured[levels > 0.5] -= 1.5
    run = run_of("stair", levels, {"speed": measured}, time=time, noise=0.01)
    unknowns = Unknowns(
        (
            Unknown("threshold", 0.49, 0.01, 3.0),
            Unknown("gain", 1.0, 0.1, 10.0),
            Unknown("zero", 0.0, -5.0, 5.0),
        )
    )
    problem = Problem(Thresholded(), (run,), unknowns, ("speed",), {"speed": 0.01})
    stopped, gone_on = solve(problem), solve(problem, cliffs=2)
    # what is possible on this side of the jump, by linear least squares
    least = min(_least_cost(run, threshold) for threshold in np.linspace(0.4, 0.499999, 400))
    assert gone_on.cost == pytest.approx(least, rel=1e-5)
    assert stopped.cost > 1.005 * least


def _least_cost(run: Experiment, threshold: float) -> float:
    """Half the least sum of squares with a threshold, over gain and zero."""
    passed, _ = Thresholded()._passed({"threshold": threshold}, run)
    columns = np.column_stack([passed, np.ones(passed.size)])
    measured = run["speed"].values
    best = np.linalg.lstsq(columns, measured, rcond=None)[0]
    return 0.5 * float(np.sum((columns @ best - measured) ** 2)) / 0.01**2
