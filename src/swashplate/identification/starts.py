"""Many starts, each solved, kept on disk as it ends."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import DomainError, FileError
from swashplate.executors import Executor, Serial
from swashplate.identification.dormant import nominal_effects, woken
from swashplate.identification.drawing import sobol_starts as sobol_starts
from swashplate.identification.edges import past_edge
from swashplate.identification.rising import by_increments
from swashplate.identification.solving import Method, Objective, Solution, solve
from swashplate.identification.trust_region import LEG
from swashplate.tables import write_text

Array = NDArray[np.float64]
WAKINGS = 3
"""How often a search is taken back from where it lost an unknown."""


@dataclass(frozen=True)
class StartResult:
    """How one start ended."""

    number: int
    """0 is the nominal start, others are Sobol points."""
    start: tuple[float, ...]
    """The solver's vector at the start."""
    vector: tuple[float, ...]
    """And at the end."""
    start_cost: float
    cost: float
    evaluations: int
    converged: bool
    message: str
    seconds: float


class _Task(NamedTuple):
    number: int
    start: tuple[float, ...]
    method: Method
    tolerance: float
    max_evaluations: int


def time_left(finished: int, left: int, seconds: float) -> float | None:
    """Time that the remaining starts are likely to take. [s]

    Parameters
    ----------
    finished : int
        Starts that were solved since the search began; not those that were there already.
    left : int
        Starts that are not finished.
    seconds : float
        Since the search began. [s]

    Returns
    -------
    float or None
        At the pace so far, however many run side by side. None before the first is finished. Short
        searches end first, so that early values are somewhat low.
    """
    if finished <= 0:
        return None
    return seconds / finished * max(left, 0)


def solve_from(
    objective: Objective,
    starts: Sequence[Array],
    *,
    executor: Executor | None = None,
    store: Path | None = None,
    fingerprint: str = "",
    resume: bool = False,
    method: Method = "trf",
    tolerance: float = 1e-10,
    max_evaluations: int = 300,
    watch: Callable[[StartResult, int], None] | None = None,
) -> tuple[StartResult, ...]:
    """Solve from each start; results in the order of the starts, whoever computed them.

    Parameters
    ----------
    objective : Objective
        What to minimise.
    starts : sequence of (K,) arrays
        Where from.
    executor : Executor, optional
        Where; here, one after another, by default.
    store : Path, optional
        Folder in which each result is written as it is ready.
    fingerprint : str
        Of problem and settings: results of another one are not resumed.
    resume : bool
        Take what `store` holds instead of computing it again.
    method, tolerance, max_evaluations :
        As of `solve`.
    watch : callable, optional
        Told of each result and how many there are by now. Ctrl-C ends the search; what was done
        is returned, if there is anything.

    Raises
    ------
    FileError
        If the store belongs to another problem, or is there already and `resume` is not said.
    """
    done = _stored(store, fingerprint, resume) if store is not None else {}
    tasks = [
        _Task(number, tuple(float(x) for x in start), method, tolerance, max_evaluations)
        for number, start in enumerate(starts)
        if number not in done
    ]
    running = (executor or Serial()).run(_solve_one, objective, tasks)
    try:
        for _, result in running:
            done[result.number] = result
            if store is not None:
                _keep(store, fingerprint, result)
            if watch is not None:
                watch(result, len(done))
    except KeyboardInterrupt:
        if not done:
            raise
    return tuple(done[number] for number in sorted(done) if number < len(starts))


def _solve_one(objective: Objective, task: _Task) -> StartResult:
    start = np.array(task.start)
    try:
        solution = _search(objective, start, task)
    except DomainError as error:
        solution = Solution(start, np.inf, np.inf, 1, False, False, str(error), 0.0)
    if solution.interrupted:
        raise KeyboardInterrupt
    return StartResult(
        task.number,
        task.start,
        tuple(float(x) for x in solution.vector),
        solution.start_cost,
        solution.cost,
        solution.evaluations,
        solution.converged,
        solution.message,
        solution.seconds,
    )


def _search(objective: Objective, start: Array, task: _Task) -> Solution:
    """Leg after leg, past edges of the cost and back from where an unknown has lost its effect."""
    if task.method != "trf":
        return _solved(objective, start, task, task.max_evaluations)
    nominal = nominal_effects(objective)
    best = leg = _solved(objective, start, task, min(LEG, task.max_evaluations))
    spent, seconds, wakings = 1 + leg.evaluations, leg.seconds, 0
    while not leg.interrupted and spent < task.max_evaluations:
        point, trials = None, 0
        if wakings < WAKINGS:
            point, trials = woken(objective, leg.vector, nominal)
            wakings += point is not None
        if point is None:
            form = by_increments(objective, leg.vector)
            search, more = past_edge(form, form.to_search(leg.vector), best.start_cost)
            point, trials = None if search is None else form.to_vector(search), trials + more
        spent += trials
        if point is None and leg.converged:
            break
        left = task.max_evaluations - spent
        if left <= 0:
            break
        try:
            leg = _solved(objective, leg.vector if point is None else point, task, min(LEG, left))
        except DomainError:  # a point that was woken outside the domain
            break
        spent, seconds = spent + leg.evaluations, seconds + leg.seconds
        if leg.cost < best.cost:
            best = replace(leg, start_cost=best.start_cost)
    return replace(best, evaluations=spent, seconds=seconds, interrupted=leg.interrupted)


def _solved(objective: Objective, start: Array, task: _Task, most: int) -> Solution:
    form = by_increments(objective, start)
    solution = solve(
        form,
        form.to_search(start),
        method=task.method,
        tolerance=task.tolerance,
        max_evaluations=most,
    )
    return replace(solution, vector=form.to_vector(solution.vector))


def _keep(store: Path, fingerprint: str, result: StartResult) -> None:
    content = {"fingerprint": fingerprint, **asdict(result)}
    write_text(json.dumps(content, indent=1) + "\n", store / f"start-{result.number:05d}.json")


def _stored(store: Path, fingerprint: str, resume: bool) -> dict[int, StartResult]:
    """Results that a folder holds; the folder is made if there is none."""
    try:
        store.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"{store} cannot be made: {error.strerror or error}.") from None
    done = {}
    for path in sorted(store.glob("start-*.json")):
        if not resume:
            raise FileError(
                f"{store} holds the starts of an earlier fit: resume it, or remove the folder."
            )
        try:
            content = json.loads(path.read_text("utf-8"))
            theirs = content.pop("fingerprint")
            start, vector = (tuple(content.pop(key)) for key in ("start", "vector"))
            result = StartResult(start=start, vector=vector, **content)
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            raise FileError(f"{path} is no result of a start; remove it.") from None
        if theirs != fingerprint:
            raise FileError(
                f"{path} belongs to another campaign, set-up or version; remove the folder {store}."
            )
        done[result.number] = result
    return done
