"""Many starts: Sobol points over the bounds, each solved, kept on disk as it ends."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import DomainError, FileError, InputError
from swashplate.identification.executors import Executor, Serial
from swashplate.identification.solving import Method, Objective, Solution, solve
from swashplate.tables import write_text

Array = NDArray[np.float64]


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


def sobol_starts(objective: Objective, count: int, seed: int) -> Iterator[Array]:
    """Points spread evenly over the bounds, those outside the model's domain left out.

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
        If hardly any point lies in the domain.
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
        if tried > 200 * (found + 1):
            raise InputError(
                f"Of {tried} starts within the bounds only {found} lie in the model's domain; "
                "narrow the bounds of the solenoids' forces."
            )


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
        solution = solve(
            objective,
            start,
            method=task.method,
            tolerance=task.tolerance,
            max_evaluations=task.max_evaluations,
        )
    except DomainError as error:
        solution = Solution(start, np.inf, np.inf, 1, False, False, str(error), 0.0)
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
