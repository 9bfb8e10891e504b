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
from swashplate.stopping import as_a_whole
from swashplate.tables import count, made_folder, write_text

Array = NDArray[np.float64]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Cost = Annotated[float, Field(ge=0.0)]
"""Half a sum of squares; infinite if the model does not hold."""

REFUSED = 1e6
"""A point outside the model's domain costs this many times the start: the step is taken back."""
LEG = 30
"""Evaluations after which the region is made as wide as at first. Where the cost has an edge, such
as a step that just reaches the swash plate's stop, it shrinks to nothing."""
GAINED = 1e-6
"""Relative gain of a leg from which another one is worth it."""
CLIFF, JUMP = 1e-4, 1e-6
"""Change of one of the solver's numbers by which it is tried whether the cost jumps there, and the
relative jump that counts."""
RCOND = 1e-10
"""Relative singular value below which a direction is left alone."""
REVIVALS = 3
"""How often unknowns that lost their effect are given one again."""
NO_EFFECT = 1e-12
"""Share of its nominal effect up to which an effect is mere rounding."""
SOME_EFFECT = 0.05
"""Share of its nominal effect from which an unknown has an effect again."""
VALUES = 25
"""Values of such an unknown, evenly over its bounds, that are tried."""
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
APPROACH = (30.0, 10.0, 3.0)
"""Factors on the unit of the residuals, one after another."""
COARSE = 1e-4
"""Tolerance of these searches."""
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
    """Of the start, if there were several: 0 is the nominal one, others are Sobol points."""

    @property
    def given_up(self) -> bool:
        """Whether it was hopeless to go on."""
        return self.message == _ENDINGS[GIVEN_UP]


class _Memory:
    """Evaluates, remembers the last point and the best one, and refuses what is out of domain."""

    def __init__(self, problem: Problem, fixed: Mapping[int, float], compressed: bool) -> None:
        self.problem = problem
        self.compressed = compressed
        self.evaluations = 0
        self.fixed_indices = list(fixed)
        self.fixed_numbers = list(fixed.values())
        self.bounds = tuple(np.delete(bound, self.fixed_indices) for bound in problem.bounds)
        self.best: tuple[float, Array] | None = None
        self._last: tuple[bytes, Evaluation] | None = None
        self._refused = 0.0

    def full(self, vector: Array) -> Array:
        """(K,) vector of free and fixed numbers."""
        full = np.empty(vector.size + len(self.fixed_indices))
        full[self.fixed_indices] = self.fixed_numbers
        full[np.delete(np.arange(full.size), self.fixed_indices)] = vector
        return full

    def __call__(self, vector: Array) -> Evaluation:
        key = vector.tobytes()
        if self._last is not None and self._last[0] == key:
            return self._last[1]
        self.evaluations += 1
        try:
            residuals, jacobian = self.problem.evaluate(
                self.full(vector), compressed=self.compressed
            )
        except DomainError:
            if self._last is None:
                raise  # the start itself: there is nothing to go back to
            residuals, jacobian = self._last[1]
            evaluation = Evaluation(np.full_like(residuals, self._refused), jacobian)
        else:
            evaluation = Evaluation(residuals, np.delete(jacobian, self.fixed_indices, axis=1))
            cost = 0.5 * float(residuals @ residuals)
            if self.best is None:
                self._refused = float(np.sqrt(REFUSED * (2.0 * cost + 1e-300)))
            if self.best is None or cost < self.best[0]:
                self.best = (cost, vector.copy())
        self._last = (key, evaluation)
        return evaluation


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
    keep_best: bool = False,
    cliffs: int = 0,
) -> Solution:
    """The optimum next to a start: half the sum of squares minimised within the bounds.

    Parameters
    ----------
    problem : Problem
        What to minimise.
    start : (K,) array, optional
        Where to begin instead of at the nominal values; a `DomainError` if the model does not hold.
    fixed : mapping of int to float, optional
        Numbers of the vector that are not free, by their index.
    loss : Loss
        Robust loss on each residual.
    tolerance : float
        Relative change of cost and vector at which to stop.
    max_evaluations : int
        Of the residuals.
    watch : callable, optional
        Called at each iteration.
    hopeless : callable, optional
        Called with the best point after each `LEG` evaluations; true gives the search up.
    keep_best : bool
        At Ctrl-C return the best point so far, a `Solution` that is `interrupted`, instead of
        passing it on. Whoever asks for it must look: taken for an optimum, the Ctrl-C is lost.
    cliffs : int
        How often a search that stands before a jump of the cost goes on without the unknowns that
        would cross it.

    Returns
    -------
    Solution
        The (K,) vector of the optimum, or of the best point so far, with its cost.

    Raises
    ------
    DomainError
        If the model does not hold at the start.

    Examples
    --------
    >>> import numpy as np
    >>> from swashplate import Campaign, maneuvers, rig
    >>> from swashplate.identification import Problem, Unknown, Unknowns, solve
    >>> class Gain:
    ...     def simulate(self, values, experiment):
    ...         command, speed = experiment.input, experiment["shaft_speed"]
    ...         volts = np.interp(speed.time, command.time, command.values)
    ...         return {"shaft_speed": values["gain"] * volts}
    >>> sine = {"sine": maneuvers.sine(9.0, 0.1)}
    >>> tests = rig.run("hoist", sine, channels=("shaft_speed",))
    >>> campaign = Campaign.from_toml(rig.write(tests, "sine"))
    >>> problem = Problem(
    ...     Gain(),
    ...     campaign.experiments,
    ...     Unknowns((Unknown("gain", 0.3, 0.01, 1.0, "rad/(s V)"),)),
    ...     channels=("shaft_speed",),
    ...     scales={"shaft_speed": 0.01},
    ... )
    >>> solution = solve(problem)
    >>> round(problem.unknowns.values(solution.vector)["gain"], 2)
    0.4
    """
    from scipy.optimize import least_squares

    # a robust loss looks at each residual, which the triangular factor has mixed
    memory = _Memory(problem, fixed or {}, compressed=loss == "linear")
    begin = np.delete(problem.start if start is None else start, memory.fixed_indices)
    best = begin = np.clip(begin, *memory.bounds)
    iteration = 0

    def report(intermediate_result) -> None:  # type: ignore[no-untyped-def]
        nonlocal iteration
        iteration += 1
        if watch is not None:
            watch(Progress(iteration, float(intermediate_result.cost), memory.evaluations))

    lowest = np.inf
    spent = 0
    revivals = 0
    lowest_at_revival = np.inf
    # After an unknown without effect was moved to where it has one, it is paused for one leg, while
    # the others adapt; so is one that stands at a cliff of the cost.
    paused = np.zeros(begin.size, dtype=bool)
    try:
        while True:
            leg = least_squares(
                lambda vector: memory(vector).residuals.copy(),
                begin,
                jac=lambda vector, fixed=paused: np.where(fixed, 0.0, memory(vector).jacobian),
                bounds=memory.bounds,
                x_scale="jac",
                loss=loss,
                ftol=tolerance,
                xtol=tolerance,
                gtol=1e-14,
                max_nfev=min(LEG, max_evaluations - spent),
                callback=report,
            )
            gained = lowest - leg.cost > GAINED * leg.cost
            ending = int(leg.status)
            if leg.cost < lowest:
                best = leg.x
                lowest = float(leg.cost)
            # steps that round to nothing are counted only by SciPy
            spent = max(spent + int(leg.nfev), memory.evaluations)
            if hopeless is not None and ending == 0 and hopeless(memory.full(best)):
                ending = GIVEN_UP
                break
            if spent >= max_evaluations:
                break
            released = paused.any()
            point = None
            paused = np.zeros_like(paused)
            may_revive = not released and revivals < REVIVALS
            if may_revive and lowest < lowest_at_revival * (1.0 - GAINED):
                point, paused = _with_effect_again(memory, best)
                lowest_at_revival = lowest
                if point is not None:
                    revivals += 1
            if point is None and ending > 0 and cliffs > 0:
                cliffs -= 1
                paused = _at_cliffs(memory, best)
                point = best if paused.any() else None
            if point is None and not (released or (ending == 0 and gained)):
                ending = ending or UNCHANGED
                break
            begin = leg.x if point is None else point
    except KeyboardInterrupt:
        if memory.best is None or not keep_best:
            raise
        lowest, best = memory.best
        ending = INTERRUPTED
    return Solution(
        vector=memory.full(best),
        cost=lowest,
        evaluations=memory.evaluations,
        converged=ending > 0,
        interrupted=ending == INTERRUPTED,
        message=_ENDINGS[ending],
        loss=loss,
    )


def _at_cliffs(memory: _Memory, vector: Array) -> NDArray[np.bool_]:
    """Unknowns along which the cost jumps up right where a search stopped, though it ought to fall.

    A dead zone that moves past a level of a staircase, or a rule between two numbers, is such a
    cliff: the region that the search trusts shrinks to nothing before it, for all unknowns alike.
    None if the others have little to gain.
    """
    residuals, jacobian = memory(vector)
    step = np.linalg.lstsq(jacobian, -residuals, rcond=RCOND)[0]
    squares = float(residuals @ residuals)
    at_cliff = np.zeros(vector.size, np.bool_)
    if squares - float(np.sum((residuals + jacobian @ step) ** 2)) < GAINED * squares:
        return at_cliff
    gradient = jacobian.T @ residuals
    low, high = memory.bounds
    for k, slope in enumerate(gradient.tolist()):
        trial = vector.copy()
        trial[k] = min(max(vector[k] - CLIFF * np.sign(slope), low[k]), high[k])
        expected = 0.5 * squares + slope * (trial[k] - vector[k])
        try:
            cost = memory.problem.cost(memory.full(trial))
        except DomainError:
            cost = np.inf
        at_cliff[k] = cost > max(expected, 0.5 * squares) * (1.0 + JUMP)
    return at_cliff


def _with_effect_again(memory: _Memory, vector: Array) -> tuple[Array | None, NDArray[np.bool_]]:
    """A point where unknowns that had lost their effect have one, and which those are.

    No descent finds back from a derivative of 0, such as that of a stop that the swash plate no
    longer reaches. Such an unknown is set to the nearest value within its bounds that has an
    effect. None if there is no such unknown.
    """

    def effects(vector: Array) -> Array:
        memory.evaluations += 1
        try:
            jacobian = memory.problem.evaluate(memory.full(vector)).jacobian
        except DomainError:
            return np.zeros(vector.size)
        free = np.delete(jacobian, memory.fixed_indices, axis=1)
        return np.asarray(np.linalg.norm(free, axis=0))

    present = np.linalg.norm(memory(vector).jacobian, axis=0)
    lost = np.zeros(present.size, dtype=bool)
    if present.min(initial=np.inf) > NO_EFFECT * present.max(initial=0.0):
        return None, lost
    point = vector.copy()
    start = np.delete(memory.problem.start, memory.fixed_indices)
    low, high = memory.bounds
    nominal = effects(start)
    for k in np.flatnonzero(present < NO_EFFECT * nominal):
        values = np.linspace(low[k], high[k], VALUES)
        far = (values - vector[k]) * (start[k] - vector[k]) < 0.0
        for value in values[np.lexsort((np.abs(values - vector[k]), far))]:
            trial = np.where(np.arange(point.size) == k, value, point)
            if effects(trial)[k] > SOME_EFFECT * nominal[k]:
                point = trial
                lost[k] = True
                break
    return (point if lost.any() else None), lost


# --- from many starts -----------------------------------------------------------------------------


def sobol_starts(problem: Problem, count: int, seed: int) -> Iterator[Array]:
    """Starting points spread evenly over the bounds, all in the model's domain.

    Parameters
    ----------
    problem : Problem
        Its bounds and its model's domain count.
    count : int
        Number of points.
    seed : int
        The same seed gives the same points, whatever their number.

    Yields
    ------
    (K,) array
        A point of the scrambled Sobol sequence, for `solve_from`.

    Raises
    ------
    InputError
        If hardly any point within the bounds lies in the model's domain.
    """
    from scipy.stats.qmc import Sobol

    low, high = problem.bounds
    # its numbers are read within a callback of C, which would drop what a signal raises
    with as_a_whole():
        sequence = Sobol(low.size, scramble=True, rng=np.random.default_rng(seed))
    usable = 0
    tried = 0
    while usable < count:
        if tried > TRIES * (usable + 1):
            raise InputError(
                f"Of {tried} starts within the bounds only {usable} lie in the model's domain; "
                "narrow the bounds."
            )
        tried += 1
        vector = low + sequence.random(1)[0] * (high - low)
        try:
            problem.cost(vector)
        except DomainError:
            continue
        usable += 1
        yield vector


def approached(problem: Problem, *, loss: Loss = "linear") -> Array:
    """A start for a problem of which every number has a prior: near the optimum next to the priors.

    The unit of the residuals is first 30 times what it is, then 10 and 3 times (`APPROACH`): as
    long as curves are far apart the priors lead, so that no number is driven to the far side of a
    limit or a dead zone to mend the first misfit. It is the continuation in the weight of the data
    by which regularised inverse problems are solved.

    Parameters
    ----------
    problem : Problem
    loss : Loss
        Robust loss on each residual.

    Returns
    -------
    (K,) array
        For `solve`.

    Raises
    ------
    DomainError
        If the model does not hold at the nominal values.
    """
    vector = problem.start
    for factor in APPROACH:
        scales = {name: factor * scale for name, scale in problem.scales.items()}
        coarse = replace(problem, scales=scales)
        vector = solve(coarse, vector, loss=loss, tolerance=COARSE).vector
    return vector


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
                start = tuple(starts[result.number].tolist())
                file = _StartFile(origin=origin, start=start, result=result)
                name = f"start-{result.number:05d}.json"
                write_text(file.model_dump_json(indent=1) + "\n", store / name)
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
    return replace(solution, number=number)


def _stored(
    store: Path, origin: dict[str, str], starts: Sequence[Array], resume: bool
) -> dict[int, Solution]:
    """Results that a folder holds; the folder is made if there is none."""
    done = {}
    files = sorted(made_folder(store).glob("start-*.json"))
    if files and not resume:
        raise FileError(
            f"{store} holds the starts of an earlier fit: resume it, or remove the folder."
        )
    for path in files:
        try:
            file = read_json(path, _StartFile)
        except SwashplateError as error:
            reason = str(error).rstrip(".")
            raise FileError(f"{reason}: it is not the result of a start, remove it.") from None
        differing = [name for name, mark in origin.items() if file.origin.get(name) != mark]
        result = file.result
        if not differing and result.number < len(starts):
            start = tuple(starts[result.number].tolist())
            if file.start != start or result.vector.size != len(start):
                differing = ["starts"]
        if differing:
            raise FileError(
                f"{path} belongs to another fit: its {' and '.join(differing)} differ. Resume with "
                f"the original ones, or remove the folder {store}."
            )
        done[result.number] = result
    return done
