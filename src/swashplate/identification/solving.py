"""Solver: from one start to the nearest optimum by SciPy's trust region, and from many."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Annotated, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from swashplate.documents import read_json
from swashplate.errors import DomainError, FileError, InputError, SwashplateError
from swashplate.executors import Executor, Serial
from swashplate.identification.unknowns import Vector
from swashplate.results import Result, short
from swashplate.tables import write_text

Array = NDArray[np.float64]
Loss = Literal["linear", "soft_l1", "huber", "cauchy", "arctan"]

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
UNCHANGED = 2
_ENDINGS = {
    0: "stopped at the largest number of evaluations; allow more with --evaluations",
    1: "the gradient vanished",
    UNCHANGED: "the cost no longer changed",
    3: "the parameters no longer changed",
    4: "neither cost nor parameters changed any more",
}


def influence(residuals: Array, loss: Loss) -> tuple[Array, Array]:
    """ψ of each residual, half the derivative of its loss, and the derivative of that.

    The losses are SciPy's, of residuals in units of their noise (Huber 1981, chapter 4).
    """
    z = residuals**2
    if loss == "soft_l1":
        return residuals / np.sqrt(1.0 + z), (1.0 + z) ** -1.5
    if loss == "huber":
        return np.clip(residuals, -1.0, 1.0), np.where(z <= 1.0, 1.0, 0.0)
    if loss == "cauchy":
        return residuals / (1.0 + z), (1.0 - z) / (1.0 + z) ** 2
    if loss == "arctan":
        return residuals / (1.0 + z**2), (1.0 - 3.0 * z**2) / (1.0 + z**2) ** 2
    return residuals, np.ones_like(residuals)


class Evaluation(NamedTuple):
    """Residuals and their derivatives by the solver's vector at one point."""

    def __repr__(self) -> str:
        return short(self)

    residuals: Array
    """(m,) residuals, or any vector of which sum of squares and gradient are the same."""
    jacobian: Array
    """(m, K)"""


class Objective(Protocol):
    """What a solver minimises: half the sum of squares."""

    @property
    def start(self) -> Array:
        """(K,) where to begin."""
        ...

    @property
    def bounds(self) -> tuple[Array, Array]:
        """(K,) lower and upper bounds."""
        ...

    def evaluate(self, vector: Array, *, compressed: bool = True) -> Evaluation:
        """Residuals and Jacobian; compressed, as a triangular factor of a few rows.

        Raises
        ------
        DomainError
            If the model does not hold there.
        """
        ...

    def cost(self, vector: Array) -> float:
        """Half the sum of squares alone, which is quicker."""
        ...


class Progress(NamedTuple):
    """Where a solver is."""

    iteration: int
    cost: float
    vector: Array
    seconds: float
    evaluations: int = 0


@dataclass(frozen=True, eq=False)
class Solution(Result):
    """The optimum that a solver reached."""

    vector: Vector
    cost: float
    """Half the weighted sum of squares; with a robust loss, of the loss."""
    start_cost: float
    evaluations: int
    """Of the residuals, each with its Jacobian."""
    converged: bool
    interrupted: bool
    message: str
    """Why it stopped, in words."""
    seconds: float
    loss: Loss = "linear"
    """What of each residual was summed."""


class _Memory:
    """Evaluates, remembers the last point and the best one, and refuses what is out of domain."""

    def __init__(self, objective: Objective, compressed: bool) -> None:
        self.objective, self.compressed = objective, compressed
        self.evaluations = 0
        self.best: tuple[float, Array] | None = None
        self._vector: Array | None = None
        self._evaluation: Evaluation | None = None
        self._scale = 1.0

    def __call__(self, vector: Array) -> Evaluation:
        if self._vector is not None and np.array_equal(vector, self._vector):
            assert self._evaluation is not None
            return self._evaluation
        self.evaluations += 1
        try:
            evaluation = self.objective.evaluate(vector, compressed=self.compressed)
        except DomainError:
            if self._evaluation is None:
                raise  # the start itself: there is nothing to go back to
            evaluation = Evaluation(
                np.full_like(self._evaluation.residuals, self._scale), self._evaluation.jacobian
            )
        else:
            cost = 0.5 * float(evaluation.residuals @ evaluation.residuals)
            if self.best is None:
                self._scale = float(np.sqrt(REFUSED * (2.0 * cost + 1e-300)))
            if self.best is None or cost < self.best[0]:
                self.best = (cost, vector.copy())
        self._vector, self._evaluation = vector.copy(), evaluation
        return evaluation


def solve(
    objective: Objective,
    start: Array | None = None,
    *,
    loss: Loss = "linear",
    tolerance: float = 1e-10,
    max_evaluations: int = 300,
    watch: Callable[[Progress], None] | None = None,
) -> Solution:
    """The optimum next to a start: half the sum of squares minimised within the bounds.

    Parameters
    ----------
    objective : Objective
        What to minimise.
    start : (K,) array, optional
        Where to begin instead of at the objective's start.
    loss : Loss
        Robust loss on each residual.
    tolerance : float
        Relative change of cost and vector at which to stop.
    max_evaluations : int
        Of the residuals.
    watch : callable, optional
        Told of each iteration. Ctrl-C ends the search with the best point so far.

    Raises
    ------
    DomainError
        If the model does not hold at the start.
    """
    from scipy.optimize import least_squares

    begun = perf_counter()
    # a robust loss looks at each residual, which the triangular factor has mixed
    memory = _Memory(objective, compressed=loss == "linear")
    vector = np.clip(objective.start if start is None else start, *objective.bounds)
    at_start = memory(vector).residuals
    start_cost = 0.5 * float(at_start @ at_start)
    iteration = 0

    def told(intermediate_result) -> None:  # type: ignore[no-untyped-def]
        nonlocal iteration
        iteration += 1
        if watch is not None:
            now, seconds = intermediate_result, perf_counter() - begun
            cost, spent = float(now.cost), memory.evaluations
            watch(Progress(iteration, cost, now.x.copy(), seconds, spent))

    def ended(vector: Array, cost: float, message: str, ending: int) -> Solution:
        how = memory.evaluations, ending > 0, ending < 0, message, perf_counter() - begun, loss
        return Solution(np.asarray(vector, dtype=np.float64), float(cost), start_cost, *how)

    best = begin = vector
    lowest, spent, before, returns = np.inf, 0, np.inf, 0
    # an unknown that got its effect back is fixed for a leg, in which the others follow
    fixed = np.zeros(vector.size, dtype=bool)
    try:
        while True:
            found = least_squares(
                lambda vector: memory(vector).residuals.copy(),
                begin,
                jac=lambda vector, fixed=fixed: np.where(fixed, 0.0, memory(vector).jacobian),
                bounds=objective.bounds,
                x_scale="jac",
                loss=loss,
                ftol=tolerance,
                xtol=tolerance,
                gtol=1e-14,
                max_nfev=min(LEG, max_evaluations - spent),
                callback=told,
            )
            gained = lowest - found.cost > GAINED * found.cost
            # steps that round to nothing are counted by SciPy alone
            spent += int(found.nfev)
            ending = int(found.status)
            if found.cost < lowest:
                best, lowest, message = found.x, float(found.cost), str(found.message)
            spent = max(spent, memory.evaluations)
            if spent >= max_evaluations:
                break
            point, released = None, fixed.any()
            fixed = np.zeros_like(fixed)
            if not released and returns < RETURNS and lowest < before * (1.0 - GAINED):
                point, fixed = _returned(memory, best)
                before, returns = lowest, returns + int(fixed.any())
            if point is None and (released or (ending == 0 and gained)):
                begin = found.x
                continue
            ending = ending or UNCHANGED
            spent = max(spent, memory.evaluations)
            if point is None or spent >= max_evaluations:
                break
            begin = point
    except KeyboardInterrupt:
        if memory.best is None:
            raise
        cost, best = memory.best
        return ended(best, cost, "interrupted: the best so far", -1)
    return ended(best, lowest, _ENDINGS.get(ending, message), ending)


def _returned(memory: _Memory, vector: Array) -> tuple[Array | None, NDArray[np.bool_]]:
    """A point where unknowns that had lost their effect have one, and (K,) which those are.

    A stop that the swash plate no longer reaches has no derivative, and no descent finds back to
    it. Such an unknown goes to the nearest value within its bounds that has an effect.
    """
    low, high = memory.objective.bounds

    def effects(vector: Array) -> Array:
        memory.evaluations += 1
        try:
            jacobian = memory.objective.evaluate(vector).jacobian
        except DomainError:
            return np.zeros(vector.size)
        return np.asarray(np.linalg.norm(jacobian, axis=0))

    present = np.linalg.norm(memory(vector).jacobian, axis=0)
    lost, point = np.zeros(present.size, dtype=bool), vector.copy()
    if present.min(initial=np.inf) > NO_EFFECT * present.max(initial=0.0):
        return None, lost
    nominal = effects(memory.objective.start)
    for k in np.flatnonzero(present < NO_EFFECT * nominal):
        values = np.linspace(low[k], high[k], VALUES)
        away = np.abs(values - vector[k])
        far = (values - vector[k]) * (memory.objective.start[k] - vector[k]) < 0.0
        for value in values[np.lexsort((away, far))]:
            trial = point.copy()
            trial[k] = value
            if effects(trial)[k] > SOME_EFFECT * nominal[k]:
                point, lost[k] = trial, True
                break
    return (point if lost.any() else None), lost


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

    @classmethod
    def of(cls, number: int, start: Array, found: Solution) -> StartResult:
        """What a solver found from a start."""
        spent = found.evaluations, found.converged, found.message, found.seconds
        begun, ended = tuple(map(float, start)), tuple(map(float, found.vector))
        return cls(number, begun, ended, found.start_cost, found.cost, *spent)


class _StartFile(BaseModel):
    """A result on disk, and what it depends on."""

    model_config = ConfigDict(extra="forbid")

    origin: dict[str, str]
    result: StartResult


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
    solved = partial(solve, tolerance=tolerance, max_evaluations=max_evaluations)
    tasks = [(number, start) for number, start in enumerate(starts) if number not in done]
    running = (executor or Serial()).run(_solve_one, (objective, solved), tasks)
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


def _solve_one(
    shared: tuple[Objective, Callable[..., Solution]], task: tuple[int, Array]
) -> StartResult:
    (objective, solved), (number, start) = shared, task
    try:
        solution = solved(objective, start)
    except DomainError as error:
        solution = Solution(start, np.inf, np.inf, 1, False, False, str(error), 0.0)
    if solution.interrupted:
        raise KeyboardInterrupt
    return StartResult.of(number, start, solution)


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
