"""Many starts: drawn over the bounds, each solved and kept on disk as it ends."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from swashplate.documents import read_json
from swashplate.errors import DomainError, FileError, InputError, SwashplateError
from swashplate.executors import Executor, Serial
from swashplate.identification.solving import Objective, Solution, solve
from swashplate.results import Result
from swashplate.tables import write_text

Array = NDArray[np.float64]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Cost = Annotated[float, Field(ge=0.0)]
"""Half a sum of squares; infinite where the model does not hold."""

TRIES = 200
"""Points that are tried for each start."""


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
class StartResult(Result):
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
        solution = solve(
            objective, start, tolerance=task.tolerance, max_evaluations=task.max_evaluations
        )
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
