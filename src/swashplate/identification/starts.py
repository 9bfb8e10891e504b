"""Many starts: drawn over the bounds, each solved and kept on disk as it ends."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from swashplate.documents import read_json
from swashplate.errors import DomainError, FileError, InputError, SwashplateError
from swashplate.executors import Executor, Serial
from swashplate.identification.solving import LEG, Evaluation, Objective, Solution, solve
from swashplate.tables import write_text

Array = NDArray[np.float64]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Cost = Annotated[float, Field(ge=0.0)]
"""Half a sum of squares; infinite where the model does not hold."""

REACH = 1e-9
"""What a start may lie beyond the increments' bounds by rounding."""


@runtime_checkable
class Ordered(Protocol):
    """An objective that knows which of its unknowns rise, such as forces with the current."""

    @property
    def rising(self) -> Sequence[Sequence[int]]:
        """Places in the vector, in rising order, of numbers that are logarithms."""
        ...


@dataclass(frozen=True)
class Increments:
    """An objective by the logarithms of increments, in place of those of rising values.

    Values a < b < c of a group become a, b - a, c - b, and bounds that are factors on a, b, c the
    same factors on these. Each point within the increments' bounds lies within those of the values,
    but not the other way round: what crosses, or nearly does, is left out.
    """

    objective: Objective
    groups: tuple[tuple[int, ...], ...]
    """Places of the values, rising at the objective's start."""

    @property
    def start(self) -> Array:
        """(K,) where the objective starts."""
        return self.to_search(self.objective.start)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """(K,) lower and upper bounds."""
        low, high = (each.copy() for each in self.objective.bounds)
        values, increments = self.objective.start, self.start
        for group in self.groups:
            places = list(group)
            # factors that hold for all values of the group keep sums of increments within bounds
            low[places] = increments[places] + (low[places] - values[places]).max()
            high[places] = increments[places] + (high[places] - values[places]).min()
        return low, high

    def to_search(self, vector: Array) -> Array:
        """(K,) vector by increments; NaN where the values do not rise."""
        made = vector.copy()
        for group in self.groups:
            places = list(group)
            steps = np.diff(np.exp(vector[places]), prepend=0.0)
            made[places] = np.log(np.where(steps > 0.0, steps, np.nan))
        return made

    def to_vector(self, search: Array) -> Array:
        """(K,) the objective's vector for one by increments."""
        made = search.copy()
        for group in self.groups:
            places = list(group)
            made[places] = np.log(np.cumsum(np.exp(search[places])))
        # a sum of increments at their bounds misses those of the values by rounding
        return np.clip(made, *self.objective.bounds)

    def evaluate(self, vector: Array, *, compressed: bool = True) -> Evaluation:
        """Residuals and Jacobian by increments, see `solving.Objective`."""
        values = self.to_vector(vector)
        found = self.objective.evaluate(values, compressed=compressed)
        jacobian = found.jacobian.copy()
        for group in self.groups:
            places = list(group)
            # of ln(d1 + ... + dk) by ln dj: dj over the sum
            by = np.tril(np.exp(vector[places] - values[places][:, None]))
            jacobian[:, places] = found.jacobian[:, places] @ by
        return Evaluation(found.residuals, jacobian)

    def cost(self, vector: Array) -> float:
        """Half the sum of squares."""
        return self.objective.cost(self.to_vector(vector))


def by_increments(objective: Objective, start: Array | None = None) -> Increments:
    """An objective by increments of what is known to rise; as it is where nothing is.

    Parameters
    ----------
    objective : Objective
        Best one that is `Ordered`.
    start : (K,) array, optional
        A point that must be expressible: groups that do not rise there stay as they are.
    """
    groups = []
    for group in objective.rising if isinstance(objective, Ordered) else ():
        points = [objective.start] if start is None else [objective.start, start]
        if all((np.diff(point[list(group)]) > 0.0).all() for point in points):
            groups.append(tuple(group))
    made = Increments(objective, tuple(groups))
    if start is not None and groups:
        low, high = made.bounds
        search = made.to_search(start)
        if ((search < low - REACH) | (search > high + REACH)).any():
            return Increments(objective, ())
    return made


NOTHING = 1e-12
"""Share of its nominal effect that rounding may leave of none."""
AWAKE = 0.05
"""Share of its nominal effect at which an unknown counts as awake again."""
STEPS = 24
"""Trials on the way to its nominal value."""


def effects(objective: Objective, vector: Array) -> Array:
    """(K,) length of the change of all residuals for a unit of each number of the vector."""
    return np.asarray(np.linalg.norm(objective.evaluate(vector).jacobian, axis=0))


def nominal_effects(objective: Objective) -> Array:
    """(K,) those at the objective's start; zeros, which demand nothing, if it holds not there."""
    try:
        return effects(objective, objective.start)
    except DomainError:
        return np.zeros(objective.start.size)


def dormant(present: Array, nominal: Array) -> NDArray[np.bool_]:
    """(K,) which unknowns have no effect at all, but have one nominally."""
    asleep: NDArray[np.bool_] = (present <= NOTHING * nominal) & (nominal > 0.0)
    return asleep


def woken(objective: Objective, vector: Array, nominal: Array) -> tuple[Array | None, int]:
    """A point where no unknown is without effect.

    Parameters
    ----------
    objective : Objective
        What is minimised.
    vector : (K,) array
        Where a search ended.
    nominal : (K,) array
        As of `nominal_effects`.

    Returns
    -------
    point : (K,) array or None
        The vector, each unknown without effect moved towards its nominal value until it has one
        again; None if there is no such unknown.
    evaluations : int
        Of the residuals.
    """
    point = vector.copy()
    asleep = dormant(effects(objective, vector), nominal)
    evaluations = 1
    for k in np.flatnonzero(asleep):
        for share in np.arange(1, STEPS + 1) / STEPS:
            point[k] = vector[k] + share * (objective.start[k] - vector[k])
            evaluations += 1
            try:
                present = effects(objective, point)
            except DomainError:
                continue
            if present[k] > AWAKE * nominal[k]:
                break
    return (point if asleep.any() else None), evaluations


SHARES = (1.0, 0.5, 0.25, 0.12, 0.06, 0.03, 0.015)
"""Of the Gauss-Newton step."""
SINGULAR = 1e-10
"""Singular values below this share of the largest make no step."""
GAINED = 1e-6
"""Relative gain from which a search goes on."""
NOTHING = 1e-20
"""Share of the cost at the start that is left of it by rounding alone."""


def past_edge(objective: Objective, vector: Array, start_cost: float) -> tuple[Array | None, int]:
    """A lower point along the Gauss-Newton step.

    Parameters
    ----------
    objective : Objective
        What is minimised.
    vector : (K,) array
        Where a search ended.
    start_cost : float
        Where it began.

    Returns
    -------
    point : (K,) array or None
        The lowest of some shares of the step, cut at the bounds; None if none of them gains.
    evaluations : int
        Of the residuals.
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


TRIES = 200
"""Points that are tried for each start."""


def sobol_starts(objective: Objective, count: int, seed: int) -> Iterator[Array]:
    """Points spread evenly over the bounds; some are left out and drawn again.

    Those are left out where the model does not hold, or where an unknown has no effect although it
    has one nominally: a stop that is not reached, for example, to which no descent finds back. What
    is known to rise (`rising.Ordered`) is drawn by its increments, so that it does.

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

    form = by_increments(objective)
    nominal = nominal_effects(objective)
    low, high = form.bounds
    sequence = Sobol(low.size, scramble=True, rng=np.random.default_rng(seed))
    found, tried = 0, 0
    while found < count:
        for point in sequence.random(8):
            tried += 1
            vector = form.to_vector(low + point * (high - low))
            try:
                present = effects(objective, vector)
            except DomainError:
                continue
            if dormant(present, nominal).any():
                continue
            yield vector
            found += 1
            if found == count:
                return
        if tried > TRIES * (found + 1):
            raise InputError(
                f"Of {tried} starts within the bounds only {found} lie in the model's domain and "
                "let every unknown have an effect; narrow the bounds, those of the solenoids' "
                "forces first."
            )


WAKINGS = 3
"""How often a search is taken back from where it lost an unknown."""


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
        tolerance=task.tolerance,
        max_evaluations=most,
    )
    return replace(solution, vector=form.to_vector(solution.vector))


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
