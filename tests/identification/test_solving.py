"""Problems, solvers and starts on a model whose optimum is known."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from swashplate import Channel, DomainError, Experiment, FileError, InputError, maneuvers
from swashplate.campaign import rig
from swashplate.campaign.experiment import InputSignal, Source
from swashplate.executors import Processes, Serial, Threads
from swashplate.identification.drive_model import stage_problem
from swashplate.identification.model import Linearised
from swashplate.identification.problem import Problem, noise_scales
from swashplate.identification.setup import Free, Stage
from swashplate.identification.solving import Progress, Solution, sobol_starts, solve, solve_from
from swashplate.identification.unknowns import Unknown, Unknowns, bounded

GAIN, LAG = 3.0, 0.7
Make = Callable[..., Experiment]
UNKNOWNS = Unknowns(
    (
        bounded("gain", 1.0, absolute=(0.1, 20.0), log=True),
        bounded("lag", 2.0, absolute=(0.05, 5.0), log=True),
    )
)


@pytest.fixture
def problem(rise, experiment: Make, measured) -> Problem:
    runs = tuple(
        experiment(f"run {level}", level, measured(level, GAIN, LAG)) for level in (1.0, -2.0)
    )
    return Problem(rise, runs, UNKNOWNS, ("y",), {"y": 0.1})


def test_residuals_are_weighted_and_scaled(rise, experiment: Make, measured) -> None:
    run = experiment("run", 1.0, measured(1.0, GAIN, LAG) + 0.2, weight=4.0)
    made = Problem(rise, (run,), UNKNOWNS, ("y",), {"y": 0.1})
    vector = UNKNOWNS.vector_of({"gain": GAIN, "lag": LAG})
    residuals = made.evaluate(vector, compressed=False).residuals
    assert residuals == pytest.approx(np.full(81, -0.2 * 2.0 / 0.1))
    assert made.cost(UNKNOWNS.vector_of({"gain": GAIN, "lag": LAG})) == pytest.approx(
        0.5 * 81 * 16.0
    )


def test_differences_stand_in_for_missing_derivatives(problem: Problem) -> None:
    vector = UNKNOWNS.vector_of({"gain": 2.0, "lag": 0.5})
    found = problem.linearised(vector, 0)["y"].by
    time = problem.experiments[0]["y"].time
    decay = np.exp(-time / 0.5)
    by_gain = (1.0 - decay) * 2.0 / 0.1  # by ln gain
    by_lag = -2.0 * decay * time / 0.5**2 * 0.5 / 0.1  # by ln lag
    np.testing.assert_allclose(found, np.column_stack([by_gain, by_lag]), rtol=1e-7, atol=1e-7)


def test_the_truth_is_found(problem: Problem) -> None:
    seen: list[Progress] = []
    solution = solve(problem, tolerance=1e-14, watch=seen.append)
    assert UNKNOWNS.values(solution.vector) == pytest.approx({"gain": GAIN, "lag": LAG}, rel=1e-9)
    assert solution.converged
    assert solution.cost < 1e-4 * problem.cost(problem.start)
    assert [each.iteration for each in seen] == list(range(1, len(seen) + 1))


def test_offsets_belong_to_their_run(rise, experiment: Make, measured) -> None:
    runs = (
        experiment("a", 1.0, measured(1.0, GAIN, LAG) + 0.4),
        experiment("b", 2.0, measured(2.0, GAIN, LAG) - 0.9),
    )
    free = Unknowns(
        (*UNKNOWNS, *(Unknown("offset y", 0.0, -5.0, 5.0, run=each.name) for each in runs))
    )
    made = Problem(rise, runs, free, ("y",), {"y": 0.1})
    values = free.values(solve(made, tolerance=1e-14).vector)
    assert values == pytest.approx(
        {"gain": GAIN, "lag": LAG, "offset y (a)": 0.4, "offset y (b)": -0.9}, rel=1e-7
    )


class Fragile:
    """Holds only below a gain of 4."""

    def simulate(self, values, experiment):
        if values["gain"] > 4.0:
            raise DomainError("The gain must stay below 4.")
        return {"y": values["gain"] ** 2 * experiment.input.values}


def test_a_step_out_of_the_domain_is_taken_back(experiment: Make) -> None:
    run = experiment("run", 1.0, np.full(81, 15.9))
    alone = Unknowns((UNKNOWNS.items[0],))
    made = Problem(Fragile(), (run,), alone, ("y",), {"y": 0.1})
    # the first step leads to e^7.45: far out of the domain
    solution = solve(made)
    assert alone.values(solution.vector)["gain"] == pytest.approx(np.sqrt(15.9), rel=1e-9)
    with pytest.raises(DomainError, match="below 4"):
        solve(made, alone.vector_of({"gain": 5.0}))


WRONG = {
    "nothing": (lambda y: None, "a mapping of channel names to an array of floats.* not None"),
    "no mapping": (lambda y: y, "a mapping of channel names .*'y'.* not an array of float64"),
    "complex": (lambda y: {"y": y + 1j}, "real numbers for y, not an array of complex128"),
    "text": (lambda y: {"y": "fast"}, "real numbers for y, not a str"),
    "texts": (lambda y: {"y": y.astype(str)}, "real numbers for y, not an array of str"),
    "none": (lambda y: {"y": None}, "real numbers for y, not None"),
    "a list": (lambda y: {"y": y.tolist()}, "real numbers for y, not a list"),
    "objects": (lambda y: {"y": y.astype(object)}, "real numbers for y, not an array of object"),
    "too few": (lambda y: {"y": y[1:]}, r"shape \(80,\) for y, but must return \(81,\)"),
}


@pytest.mark.parametrize(("change", "sentence"), WRONG.values(), ids=WRONG)
def test_what_a_model_must_return_is_said(rise, experiment: Make, change, sentence: str) -> None:
    class Wrong:
        def simulate(self, values, experiment):
            return change(rise.simulate(values, experiment)["y"])

    made = Problem(Wrong(), (experiment("run", 1.0, np.ones(81)),), UNKNOWNS, ("y",), {"y": 0.1})
    with pytest.raises(InputError, match=f"run: simulate .*{sentence}"):
        solve(made)


WRONG_LINEARISED = {
    "nothing": (lambda y, by: None, "a mapping of channel names to a Linearised.* not None"),
    "values alone": (lambda y, by: {"y": y}, "a Linearised for y, not an array"),
    "complex": (lambda y, by: {"y": Linearised(y, by + 0j)}, "real numbers for y"),
    "a list": (lambda y, by: {"y": Linearised(y.tolist(), by)}, "real numbers for y, not a list"),
    "turned": (lambda y, by: {"y": Linearised(y, by.T)}, r"\(81, 2\): a row .* a column for each"),
}


@pytest.mark.parametrize(("change", "sentence"), WRONG_LINEARISED.values(), ids=WRONG_LINEARISED)
def test_what_linearise_must_return_is_said(rise, experiment: Make, change, sentence: str) -> None:
    class Wrong(type(rise)):
        def linearise(self, values, experiment, names):
            y = self.simulate(values, experiment)["y"]
            return change(y, np.ones((y.size, len(names))))

    made = Problem(Wrong(), (experiment("run", 1.0, np.ones(81)),), UNKNOWNS, ("y",), {"y": 0.1})
    with pytest.raises(InputError, match=f"run: linearise .*{sentence}"):
        solve(made)


def test_interrupted_with_the_best_so_far(problem: Problem) -> None:
    def stop(progress: Progress) -> None:
        if progress.iteration == 2:
            raise KeyboardInterrupt

    solution = solve(problem, watch=stop)
    assert solution.interrupted
    assert not solution.converged
    assert solution.cost < problem.cost(problem.start)
    spent = solve(problem, max_evaluations=2)
    assert not spent.converged
    assert "allow more with --evaluations" in spent.message


def test_impossible_problems(rise, experiment: Make, measured) -> None:
    run = experiment("run", 1.0, measured(1.0, GAIN, LAG))
    with pytest.raises(InputError, match="at least one parameter"):
        Problem(rise, (run,), Unknowns(()), ("y",), {"y": 0.1})
    with pytest.raises(InputError, match="at least one experiment"):
        Problem(rise, (), UNKNOWNS, ("y",), {"y": 0.1})
    ignored = experiment("run", 1.0, measured(1.0, GAIN, LAG), weight=0.0)
    with pytest.raises(InputError, match="No sample of y counts"):
        Problem(rise, (ignored,), UNKNOWNS, ("y",), {"y": 0.1})
    with pytest.raises(InputError, match="No experiment has a channel 'x'; there are y"):
        noise_scales((run,), ("x",))
    with pytest.raises(InputError, match="'y' never changes"):
        noise_scales((experiment("flat", 1.0, np.zeros(81)),), ("y",))


def test_starts_are_spread_seeded_and_inside(problem: Problem) -> None:
    starts = list(sobol_starts(problem, 12, seed=5))
    low, high = problem.bounds
    assert all(((low <= each) & (each <= high)).all() for each in starts)
    again = list(sobol_starts(problem, 20, seed=5))
    np.testing.assert_array_equal(starts, again[:12])
    assert not np.array_equal(starts[0], next(iter(sobol_starts(problem, 1, seed=6))))


def card_problem(tests: rig.VirtualTests) -> Problem:
    (run,) = tests.runs.values()
    source = Source(Path(run.stem), "")
    time, volts, amperes = (run.columns[name] for name in ("time", "voltage", "current"))
    drive = InputSignal("voltage", "V", time, volts, "linear", source)
    current = Channel(
        "current", "rectified_current", "A", time, amperes, np.ones(time.size), source
    )
    experiment = Experiment(
        run.name, "hoist", run.name, "fit", "rest", None, drive, {"current": current}
    )
    free = {"J_plus": Free(relative=(0.5, 2.0)), "G1_plus": Free(relative=(0.5, 2.0))}
    stage = Stage(name="card", part="card", free=free)
    return stage_problem(stage, tests.nominal.parameters, [experiment], threads=1)


def test_threads_and_processes_give_the_same_as_one_after_another() -> None:
    tests = rig.run("hoist", [maneuvers.step(4.0, stop=2.0, length=3.0)], seed=1)
    problem = card_problem(tests)
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

    first = solve_from(problem, starts, store=store, origin={"data": "x"}, watch=stop)
    assert [each.number for each in first] == [0, 1]
    assert len(list(store.glob("start-*.json"))) == 2
    seen: list[int] = []
    full = solve_from(
        problem,
        starts,
        store=store,
        origin={"data": "x"},
        resume=True,
        watch=lambda result, done: seen.append(result.number),
    )
    assert seen == [2, 3, 4]
    whole = solve_from(problem, starts)
    np.testing.assert_array_equal([e.vector for e in full], [e.vector for e in whole])


def test_results_of_another_fit_are_not_resumed(problem: Problem, tmp_path: Path) -> None:
    starts = list(sobol_starts(problem, 2, seed=2))
    solve_from(problem, starts, store=tmp_path, origin={"data": "x"})
    with pytest.raises(FileError, match="resume it, or remove the folder"):
        solve_from(problem, starts, store=tmp_path, origin={"data": "x"})
    with pytest.raises(FileError, match="its data differ"):
        solve_from(problem, starts, store=tmp_path, origin={"data": "y"}, resume=True)


POISON = {
    "cut": (lambda text: text[:40], "not JSON"),
    "empty": (lambda text: "", "not JSON"),
    "nested": (lambda text: "[" * 100_000, "not JSON: recursion limit"),
    "text for a number": (lambda text: re.sub(r'"cost": [^,]+', '"cost": "low"', text), "cost"),
    "no number": (lambda text: re.sub(r'"cost": [^,]+', '"cost": NaN', text), "cost"),
    "text for a vector": (
        lambda text: re.sub(r'"vector": \[[^]]+\]', '"vector": "abc"', text),
        "vector",
    ),
    "nested vector": (
        lambda text: re.sub(r'"vector": \[[^]]+\]', '"vector": [[1.0, 2.0]]', text),
        "vector",
    ),
    "wrong length": (
        lambda text: re.sub(r'"vector": \[[^]]+\]', '"vector": [1.0]', text),
        "starts differ",
    ),
    "other start": (
        lambda text: re.sub(r'"start": \[[^]]+\]', '"start": [0.0, 1.0]', text),
        "starts differ",
    ),
    "a key more": (lambda text: text.replace('"cost"', '"more": 1, "cost"'), "more"),
    "no object": (lambda text: "[1]", "no result of a start"),
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
