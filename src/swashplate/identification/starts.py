"""Many starts: drawn over the bounds, each solved and kept on disk as it ends."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from swashplate.documents import read_json
from swashplate.errors import DomainError, FileError, InputError, SwashplateError
from swashplate.executors import Executor, Serial
from swashplate.identification.solving import GAINED, LEG, Objective, Solution, solve
from swashplate.tables import write_text

Array = NDArray[np.float64]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Cost = Annotated[float, Field(ge=0.0)]
"""Half a sum of squares; infinite where the model does not hold."""

TRIES = 200
"""Points that are tried for each start."""
WAKINGS = 3
"""How often a search is taken back from where it lost an unknown."""
NO_EFFECT = 1e-12
"""Share of its nominal effect that rounding may leave of none."""
AWAKE = 0.05
"""Share of its nominal effect at which an unknown counts as awake again."""
STEPS = 24
"""Trials on the way to its nominal value."""
SHARES = (1.0, 0.5, 0.25, 0.12, 0.06, 0.03, 0.015)
"""Of the Gauss-Newton step past an edge."""
SINGULAR = 1e-10
"""Singular values below this share of the largest make no step."""
NOTHING = 1e-20
"""Share of the cost at the start that is left of it by rounding alone."""


def sobol_starts(objective: Objective, count: int, seed: int) -> Iterator[Array]:
    """Points spread evenly over the bounds; where the model does not hold, others are drawn.

    Parameters
    ----------
    objective : Objective
        Whose bounds and domain.
    count : int
        How many points.
    seed : int
        Of the scrambling: the same seed, the same points, however many are asked for.

    Raises
    ------
    InputError
        If hardly any point can be used.
    """
    from scipy.stats.qmc import Sobol

    low, high = objective.bounds
    sequence = Sobol(low.size, scramble=True, rng=np.random.default_rng(seed))
    found, tried = 0, 0
    while found < count:
        for point in sequence.random(8):
            tried += 1
            vector = low + point * (high - low)
            try:
                objective.cost(vector)
            except DomainError:
                continue
            yield vector
            found += 1
            if found == count:
                return
        if tried > TRIES * (found + 1):
            raise InputError(
                f"Of {tried} starts within the bounds only {found} lie in the model's domain; "
                "narrow the bounds."
            )


@dataclass(frozen=True)
class StartResult:
    """How one start ended."""

    number: int
    """0 is the nominal start, others are Sobol points."""
    start: tuple[Finite, ...]
    """The solver's vector at the start."""
    vector: tuple[Finite, ...]
    """And at the end."""
    start_cost: Cost
    cost: Cost
    evaluations: int
    converged: bool
    message: str
    seconds: Finite


class _StartFile(BaseModel):
    """A result on disk, and what it depends on."""

    model_config = ConfigDict(extra="forbid")

    origin: dict[str, str]
    result: StartResult


class _Task(NamedTuple):
    number: int
    start: tuple[float, ...]
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
    origin: Mapping[str, str] | None = None,
    resume: bool = False,
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
    origin : mapping of str to str, optional
        A fingerprint of each thing that a result depends on, by its name in words. Results of
        another one are not resumed.
    resume : bool
        Take what `store` holds instead of computing it again.
    tolerance, max_evaluations :
        As of `solve`.
    watch : callable, optional
        Told of each result and how many there are by now. Ctrl-C ends the search; what was done
        is returned, fewer results than starts, if there is anything.

    Raises
    ------
    FileError
        If the store belongs to another problem, or is there already and `resume` is not said.
    """
    origin = dict(origin or {})
    done = _stored(store, origin, starts, resume) if store is not None else {}
    tasks = [
        _Task(number, tuple(float(x) for x in start), tolerance, max_evaluations)
        for number, start in enumerate(starts)
        if number not in done
    ]
    running = (executor or Serial()).run(_solve_one, objective, tasks)
    try:
        for _, result in running:
            done[result.number] = result
            if store is not None:
                _keep(store, origin, result)
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
    nominal = _nominal_effects(objective)
    best = leg = _solved(objective, start, task, LEG)
    spent, seconds, wakings = 1 + leg.evaluations, leg.seconds, 0
    while not leg.interrupted and spent < task.max_evaluations:
        point, trials = None, 0
        if wakings < WAKINGS:
            point, trials = _woken(objective, leg.vector, nominal)
            wakings += point is not None
        if point is None:
            point, more = _past_edge(objective, leg.vector, best.start_cost)
            trials += more
        spent += trials
        left = task.max_evaluations - spent
        if left <= 0 or (point is None and leg.converged):
            break
        try:
            leg = _solved(objective, leg.vector if point is None else point, task, left)
        except DomainError:  # a point that was woken outside the domain
            break
        spent, seconds = spent + leg.evaluations, seconds + leg.seconds
        if leg.cost < best.cost:
            best = replace(leg, start_cost=best.start_cost)
    return replace(best, evaluations=spent, seconds=seconds, interrupted=leg.interrupted)


def _solved(objective: Objective, start: Array, task: _Task, left: int) -> Solution:
    most = min(LEG, left, task.max_evaluations)
    return solve(objective, start, tolerance=task.tolerance, max_evaluations=most)


def _effects(objective: Objective, vector: Array) -> Array:
    """(K,) length of the change of all residuals for a unit of each number of the vector."""
    return np.asarray(np.linalg.norm(objective.evaluate(vector).jacobian, axis=0))


def _nominal_effects(objective: Objective) -> Array:
    """(K,) those at the objective's start; zeros, which demand nothing, if it holds not there."""
    try:
        return _effects(objective, objective.start)
    except DomainError:
        return np.zeros(objective.start.size)


def _woken(objective: Objective, vector: Array, nominal: Array) -> tuple[Array | None, int]:
    """A point where no unknown is without effect, None if there is none, and the evaluations spent.

    A stop that the swash plate no longer reaches has no derivative, and no descent finds back to
    it: each such unknown is moved towards its nominal value until it has an effect again.
    """
    point, evaluations = vector.copy(), 1
    asleep = (_effects(objective, vector) <= NO_EFFECT * nominal) & (nominal > 0.0)
    for k in np.flatnonzero(asleep):
        for share in np.arange(1, STEPS + 1) / STEPS:
            point[k] = vector[k] + share * (objective.start[k] - vector[k])
            evaluations += 1
            try:
                present = _effects(objective, point)
            except DomainError:
                continue
            if present[k] > AWAKE * nominal[k]:
                break
    return (point if asleep.any() else None), evaluations


def _past_edge(objective: Objective, vector: Array, start_cost: float) -> tuple[Array | None, int]:
    """The lowest of some shares of the Gauss-Newton step, None if none gains, and the evaluations.

    Where a step just reaches the swash plate's stop, the derivatives of both sides differ: a region
    that looks no further than this edge of the cost shrinks to nothing, a longer step passes it.
    """
    residuals, jacobian = objective.evaluate(vector)
    lowest = 0.5 * float(residuals @ residuals)
    if lowest <= NOTHING * start_cost:
        return None, 1
    step = np.linalg.lstsq(jacobian, -residuals, rcond=SINGULAR)[0]
    point, enough = None, lowest * (1.0 - GAINED)
    for share in SHARES:
        trial = np.clip(vector + share * step, *objective.bounds)
        try:
            cost = objective.cost(trial)
        except DomainError:
            continue
        if cost < enough:
            point, enough = trial, cost
    return point, 1 + len(SHARES)


def _keep(store: Path, origin: dict[str, str], result: StartResult) -> None:
    content = _StartFile(origin=origin, result=result).model_dump_json(indent=1)
    write_text(content + "\n", store / f"start-{result.number:05d}.json")


def _stored(
    store: Path, origin: dict[str, str], starts: Sequence[Array], resume: bool
) -> dict[int, StartResult]:
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
            file = read_json(path, _StartFile)
        except SwashplateError as error:
            raise FileError(
                f"{str(error).rstrip('.')}: it is no result of a start, remove it."
            ) from None
        differing = [name for name, mark in origin.items() if file.origin.get(name) != mark]
        result = file.result
        if not differing and result.number < len(starts):
            start = tuple(map(float, starts[result.number]))
            if result.start != start or len(result.vector) != len(start):
                differing = ["starts"]
        if differing:
            raise FileError(
                f"{path} belongs to another fit: its {' and '.join(differing)} differ. Resume with "
                f"what it began with, or remove the folder {store}."
            )
        done[result.number] = result
    return done
