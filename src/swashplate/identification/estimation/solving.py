"""Solver: from one start to the nearest optimum by SciPy's trust region, and from many."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from swashplate.documents import read_json
from swashplate.errors import DomainError, FileError, InputError, SwashplateError
from swashplate.executors import Executor, Serial
from swashplate.identification.estimation.problem import Evaluation, Loss, Problem
from swashplate.identification.estimation.unknowns import Vector
from swashplate.progress import counted
from swashplate.results import Result
from swashplate.tables import count, made_folder, write_text

Array = NDArray[np.float64]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Cost = Annotated[float, Field(ge=0.0)]
"""Half a sum of squares; infinite where the model does not hold."""

REFUSED = 1e6
"""A point outside the model's domain costs this many times the start: the step is taken back."""
LEG = 30
"""Evaluations after which the region is made as wide as at first. Where the cost has an edge, such
as a step that just reaches the swash plate's stop, it shrinks to nothing."""
GAINED = 1e-6
"""Relative gain of a leg from which another one is worth it."""
RETURNS = 3
"""How often a search is taken back from where it lost an unknown."""
NO_EFFECT = 1e-12
"""Share of its nominal effect that rounding may leave of none."""
SOME_EFFECT = 0.05
"""Share of its nominal effect at which an unknown counts as having one again."""
VALUES = 25
"""Within its bounds that are tried for one."""
UNCHANGED, INTERRUPTED, GIVEN_UP = 2, -1, -2
_ENDINGS = {
    GIVEN_UP: "given up: it explains too little of what was measured",
    INTERRUPTED: "interrupted: the best so far",
    0: "stopped at the largest number of evaluations; allow more with --evaluations",
    1: "the gradient vanished",
    UNCHANGED: "the cost no longer changed",
    3: "the parameters no longer changed",
    4: "neither cost nor parameters changed any more",
}
TRIES = 200
"""Points that are tried for each start."""


class Progress(NamedTuple):
    """Where a solver is."""

    iteration: int
    cost: float
    evaluations: int


@dataclass(frozen=True, eq=False)
class Solution(Result):
    """The optimum that a solver reached."""

    vector: Vector
    cost: Cost
    """Half the weighted sum of squares; with a robust loss, of the loss."""
    evaluations: int
    """Of the residuals, each with its Jacobian."""
    converged: bool
    interrupted: bool
    message: str
    """Why it stopped, in words."""
    loss: Loss = "linear"
    """What of each residual was summed."""
    number: int = 0
    """Of the start, where there were several: 0 is the nominal one, others are Sobol points."""

    @property
    def given_up(self) -> bool:
        """Whether it was hopeless to go on."""
        return self.message == _ENDINGS[GIVEN_UP]


class _Memory:
    """Evaluates, remembers the last point and the best one, and refuses what is out of domain."""

    def __init__(self, problem: Problem, fixed: Mapping[int, float], compressed: bool) -> None:
        self.problem, self.compressed, self.evaluations = problem, compressed, 0
        self.places, self.numbers = list(fixed), list(fixed.values())
        self.bounds = tuple(np.delete(bound, self.places) for bound in problem.bounds)
        self.best: tuple[float, Array] | None = None
        self._last: tuple[bytes, Evaluation] | None = None
        self._refused = 0.0

    def whole(self, vector: Array) -> Array:
        """(K,) vector with the fixed numbers in their places."""
        made = np.empty(vector.size + len(self.places))
        made[self.places] = self.numbers
        made[np.delete(np.arange(made.size), self.places)] = vector
        return made

    def __call__(self, vector: Array) -> Evaluation:
        key = vector.tobytes()
        if self._last is not None and self._last[0] == key:
            return self._last[1]
        self.evaluations += 1
        try:
            residuals, jacobian = self.problem.evaluate(
                self.whole(vector), compressed=self.compressed
            )
        except DomainError:
            if self._last is None:
                raise  # the start itself: there is nothing to go back to
            residuals, jacobian = self._last[1]
            made = Evaluation(np.full_like(residuals, self._refused), jacobian)
        else:
            made = Evaluation(residuals, np.delete(jacobian, self.places, axis=1))
            cost = 0.5 * float(residuals @ residuals)
            if self.best is None:
                self._refused = float(np.sqrt(REFUSED * (2.0 * cost + 1e-300)))
            if self.best is None or cost < self.best[0]:
                self.best = (cost, vector.copy())
        self._last = (key, made)
        return made


def solve(
    problem: Problem,
    start: Array | None = None,
    *,
    fixed: Mapping[int, float] | None = None,
    loss: Loss = "linear",
    tolerance: float = 1e-10,
    max_evaluations: int = 300,
    watch: Callable[[Progress], None] | None = None,
    hopeless: Callable[[Array], bool] | None = None,
) -> Solution:
    """The optimum next to a start: half the sum of squares minimised within the bounds.

    Parameters
    ----------
    problem : Problem
        What to minimise.
    start : (K,) array, optional
        Where to begin instead of at the nominal values; a `DomainError` if the model does not hold.
    fixed : mapping of int to float, optional
        Places and numbers of the vector that stay where they are.
    loss : Loss
        Robust loss on each residual.
    tolerance : float
        Relative change of cost and vector at which to stop.
    max_evaluations : int
        Of the residuals.
    watch : callable, optional
        Called at each iteration. Ctrl-C ends the search with the best point so far.
    hopeless : callable, optional
        Asked of the best point after each `LEG` evaluations; the search is given up if it says so.
    """
    from scipy.optimize import least_squares

    # a robust loss looks at each residual, which the triangular factor has mixed
    memory = _Memory(problem, fixed or {}, compressed=loss == "linear")
    begin = np.delete(problem.start if start is None else start, memory.places)
    best = begin = np.clip(begin, *memory.bounds)
    iteration = 0

    def seen(intermediate_result) -> None:  # type: ignore[no-untyped-def]
        nonlocal iteration
        iteration += 1
        if watch is not None:
            watch(Progress(iteration, float(intermediate_result.cost), memory.evaluations))

    lowest, spent, before, returns = np.inf, 0, np.inf, 0
    # an unknown that got its effect back is fixed for a leg, in which the others follow
    still = np.zeros(begin.size, dtype=bool)
    try:
        while True:
            found = least_squares(
                lambda vector: memory(vector).residuals.copy(),
                begin,
                jac=lambda vector, still=still: np.where(still, 0.0, memory(vector).jacobian),
                bounds=memory.bounds,
                x_scale="jac",
                loss=loss,
                ftol=tolerance,
                xtol=tolerance,
                gtol=1e-14,
                max_nfev=min(LEG, max_evaluations - spent),
                callback=seen,
            )
            gained = lowest - found.cost > GAINED * found.cost
            ending = int(found.status)
            if found.cost < lowest:
                best, lowest = found.x, float(found.cost)
            # steps that round to nothing are counted by SciPy alone
            spent = max(spent + int(found.nfev), memory.evaluations)
            if hopeless is not None and ending == 0 and hopeless(memory.whole(best)):
                ending = GIVEN_UP
                break
            if spent >= max_evaluations:
                break
            released, point = still.any(), None
            if not released and returns < RETURNS and lowest < before * (1.0 - GAINED):
                point, still = _returned(memory, best)
                before, returns = lowest, returns + (point is not None)
            else:
                still = np.zeros_like(still)
            if point is None and not (released or (ending == 0 and gained)):
                ending = ending or UNCHANGED
                break
            begin = found.x if point is None else point
    except KeyboardInterrupt:
        if memory.best is None:
            raise
        (lowest, best), ending = memory.best, INTERRUPTED
    how = memory.evaluations, ending > 0, ending == INTERRUPTED, _ENDINGS[ending], loss
    return Solution(memory.whole(best), lowest, *how)


def _returned(memory: _Memory, vector: Array) -> tuple[Array | None, NDArray[np.bool_]]:
    """A point where unknowns that had lost their effect have one, and which those are.

    A stop that the swash plate no longer reaches has no derivative, and no descent finds back to
    it. Such an unknown goes to the nearest value within its bounds that has an effect.
    """

    def effects(vector: Array) -> Array:
        memory.evaluations += 1
        try:
            jacobian = memory.problem.evaluate(memory.whole(vector)).jacobian
        except DomainError:
            return np.zeros(vector.size)
        return np.asarray(np.linalg.norm(np.delete(jacobian, memory.places, axis=1), axis=0))

    present = np.linalg.norm(memory(vector).jacobian, axis=0)
    lost, point = np.zeros(present.size, dtype=bool), vector.copy()
    if present.min(initial=np.inf) > NO_EFFECT * present.max(initial=0.0):
        return None, lost
    start, (low, high) = np.delete(memory.problem.start, memory.places), memory.bounds
    nominal = effects(start)
    for k in np.flatnonzero(present < NO_EFFECT * nominal):
        values = np.linspace(low[k], high[k], VALUES)
        far = (values - vector[k]) * (start[k] - vector[k]) < 0.0
        for value in values[np.lexsort((np.abs(values - vector[k]), far))]:
            trial = np.where(np.arange(point.size) == k, value, point)
            if effects(trial)[k] > SOME_EFFECT * nominal[k]:
                point, lost[k] = trial, True
                break
    return (point if lost.any() else None), lost


# --- from many starts -----------------------------------------------------------------------------


def sobol_starts(problem: Problem, count: int, seed: int) -> Iterator[Array]:
    """So many points (K,) spread evenly over the bounds; others where the model does not hold.

    The same seed gives the same points, however many are asked for. If hardly any point can be
    used, an `InputError` says so.
    """
    from scipy.stats.qmc import Sobol

    low, high = problem.bounds
    sequence = Sobol(low.size, scramble=True, rng=np.random.default_rng(seed))
    found, tried = 0, 0
    while found < count:
        if tried > TRIES * (found + 1):
            raise InputError(
                f"Of {tried} starts within the bounds only {found} lie in the model's domain; "
                "narrow the bounds."
            )
        tried += 1
        vector = low + sequence.random(1)[0] * (high - low)
        try:
            problem.cost(vector)
        except DomainError:
            continue
        found += 1
        yield vector


class _StartFile(BaseModel):
    """A result on disk, and what it depends on."""

    model_config = ConfigDict(extra="forbid")

    origin: dict[str, str]
    start: tuple[Finite, ...]
    result: Solution


def solve_from(
    problem: Problem,
    starts: Sequence[Array],
    *,
    executor: Executor | None = None,
    store: Path | None = None,
    origin: Mapping[str, str] | None = None,
    resume: bool = False,
    watch: Callable[[Solution, int], None] | None = None,
    enough: Callable[[Solution], bool] | None = None,
    **settings: float,
) -> tuple[Solution, ...]:
    """Solve from each start; results in the order of the starts, whoever computed them.

    Parameters
    ----------
    problem, starts : Problem, sequence of (K,) arrays
        What to minimise, and where from.
    executor : Executor, optional
        Where; here, one after another, by default.
    store : Path, optional
        Folder in which each result is written as it is ready.
    origin : mapping of str to str, optional
        A fingerprint of each thing that a result depends on, by its name in words. Results of
        another one are not resumed.
    resume : bool
        Take what `store` holds instead of computing it again.
    watch : callable, optional
        Called with each result and how many there are by now. Ctrl-C ends it; what was done
        is returned, fewer results than starts, if there is anything.
    enough : callable, optional
        Called with each result; the first for which it is true ends the search.
    **settings :
        `tolerance` and `max_evaluations`, as of `solve`.

    Raises
    ------
    FileError
        If the store belongs to another problem, or is there already and `resume` is not said.
    """
    origin = dict(origin or {})
    done = {} if store is None else _stored(store, origin, starts, resume)
    tasks = [task for task in enumerate(starts) if task[0] not in done]
    shared = problem, partial(solve, **settings)  # type: ignore[arg-type]
    try:
        results = (executor or Serial()).run(_solve_one, shared, tasks)
        words = f"Searching from {count(len(tasks), 'start')}"
        for _, result in counted(results, len(tasks), "starts", words):
            done[result.number] = result
            if store is not None:
                begun = tuple(starts[result.number].tolist())
                kept = _StartFile(origin=origin, start=begun, result=result)
                name = f"start-{result.number:05d}.json"
                write_text(kept.model_dump_json(indent=1) + "\n", store / name)
            if watch is not None:
                watch(result, len(done))
            if enough is not None and enough(result):
                break
    except KeyboardInterrupt:
        if not done:
            raise
    return tuple(done[number] for number in sorted(done) if number < len(starts))


def _solve_one(
    shared: tuple[Problem, Callable[..., Solution]], task: tuple[int, Array]
) -> Solution:
    (problem, solved), (number, start) = shared, task
    try:
        solution = solved(problem, start)
    except DomainError as error:
        return Solution(start, np.inf, 1, False, False, str(error), number=number)
    if solution.interrupted:
        raise KeyboardInterrupt
    return replace(solution, number=number)


def _stored(
    store: Path, origin: dict[str, str], starts: Sequence[Array], resume: bool
) -> dict[int, Solution]:
    """Results that a folder holds; the folder is made if there is none."""
    done, files = {}, sorted(made_folder(store).glob("start-*.json"))
    if files and not resume:
        raise FileError(
            f"{store} holds the starts of an earlier fit: resume it, or remove the folder."
        )
    for path in files:
        try:
            file = read_json(path, _StartFile)
        except SwashplateError as error:
            said = str(error).rstrip(".")
            raise FileError(f"{said}: it is no result of a start, remove it.") from None
        differing = [name for name, mark in origin.items() if file.origin.get(name) != mark]
        result = file.result
        if not differing and result.number < len(starts):
            start = tuple(starts[result.number].tolist())
            differing = ["starts"] * (file.start != start or result.vector.size != len(start))
        if differing:
            raise FileError(
                f"{path} belongs to another fit: its {' and '.join(differing)} differ. Resume with "
                f"what it began with, or remove the folder {store}."
            )
        done[result.number] = result
    return done
