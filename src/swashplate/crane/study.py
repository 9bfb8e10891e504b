"""Studies of a crane: swing over many seaways, over bearing, wave height, orifice and stick.

Every variant of control and drives goes through the same seeded seaways, so that differences are
paired. Of a run only what is counted is kept.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import atan2, radians, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.analysis.whatif import pulled
from swashplate.crane.control import Control
from swashplate.crane.crane import RATE, Actuation, Crane, Pose
from swashplate.crane.loop import ROWS
from swashplate.crane.sea import Seaway, Spectrum
from swashplate.crane.stick import AXES, Stick
from swashplate.equations import kernel
from swashplate.errors import DomainError, InputError
from swashplate.executors import Executor, Threads
from swashplate.results import Result
from swashplate.simulation.result import Limit
from swashplate.tables import Column, Table

Array = NDArray[np.float64]
Sea = str | Spectrum | Seaway
Progress = Callable[[int, int], None]
"""Called with the number of seaways that are done, and of all."""

PUMPS = (Limit.DEAD_ZONE, Limit.ORIFICE, Limit.SPOOL, Limit.SWASH_STOP, Limit.RELIEF)
"""Limits that the loop leaves of each drive, in the order of its bits."""
IDEAL, BUILT = "ideal", "identified"
"""Drives that follow at once, and the crane's own."""

# --- many runs ------------------------------------------------------------------------------------


class Case(NamedTuple):
    """A crane with its control, as it goes through every seaway."""

    cranes: tuple[Crane, ...]
    """One, or cranes of which each seaway takes the next."""
    control: Control | None
    actuation: Actuation
    how: Mapping[str, Any]
    """Keywords of `Crane.stepper`: where it begins, load, brake."""
    height: float = 1.0
    """Factor on the height of the waves."""


class Study(NamedTuple):
    """What all seaways of a study share."""

    cases: tuple[Case, ...]
    sea: Seaway
    commands: Array
    first: int
    """Sample from which on swing counts."""


def outcomes(
    study: Study,
    seeds: Sequence[int],
    executor: Executor | None = None,
    progress: Progress | None = None,
    *,
    number: int = 0,
) -> Array:
    """Swing and limits of all cases in all seaways.

    Parameters
    ----------
    study : Study
    seeds : sequence of int
        Of the seaways.
    executor : Executor, optional
        Where they run, by default in threads; the numbers do not depend on it.
    progress : callable, optional
    number : int
        Of the first seaway, by which those of several cranes are taken.

    Returns
    -------
    (n, m, 17) array
        Of seaways and cases: root mean square and largest swing [rad], then for hoist, slew and
        luff the share of time for which each of `PUMPS` acts; NaN where a run met a limit of the
        crane's travel or left the model's domain.

    Raises
    ------
    InputError, ParameterError
        If a case cannot begin as it is asked to.
    """
    if not len(seeds):
        raise InputError("A study of seaways needs at least one seed.")
    for case in study.cases:  # said here, once, and not by a worker
        _stepper(case, 0)
    made = np.full((len(seeds), len(study.cases), 2 + len(AXES) * len(PUMPS)), np.nan)
    items = list(enumerate(seeds, number))
    for done, (k, values) in enumerate((executor or Threads()).run(_of_seaway, study, items), 1):
        made[k] = values
        if progress is not None:
            progress(done, len(seeds))
    return made


def _stepper(case: Case, number: int) -> Any:
    crane = case.cranes[number % len(case.cranes)]
    return crane.stepper(control=case.control, actuation=case.actuation, **case.how)


def _of_seaway(study: Study, item: tuple[int, int]) -> Array:
    """Outcomes of all cases in one seaway."""
    number, seed = item
    motion = replace(study.sea, seed=seed).motion(len(study.commands), RATE)
    made = np.full((len(study.cases), 2 + len(AXES) * len(PUMPS)), np.nan)
    for row, case in zip(made, study.cases, strict=True):
        stepper = _stepper(case, number)
        try:
            out = stepper.take(
                study.commands, motion if case.height == 1.0 else case.height * motion
            )
        except (DomainError, InputError):  # stopped: by the travel's limits, or the tip too fast
            continue
        _counted(out, study.first, row)
    return made


_TIP, _LOAD, _BITS = ROWS.index("tip_x"), ROWS.index("load_x"), ROWS.index("limits_hoist")


@kernel
def _counted(out: Array, first: int, made: Array) -> None:
    """Root mean square and largest swing [rad], and shares of time of the limits' bits."""
    count, square, largest = out.shape[0] - first, 0.0, 0.0
    made[2:] = 0.0
    for m in range(first, out.shape[0]):
        x, y, z = (
            out[m, _LOAD] - out[m, _TIP],
            out[m, _LOAD + 1] - out[m, _TIP + 1],
            out[m, _LOAD + 2] - out[m, _TIP + 2],
        )
        swing = atan2(sqrt(x * x + y * y), -z)
        square += swing * swing
        largest = max(largest, swing)
        for axis in range(3):
            bits = int(out[m, _BITS + axis])
            for bit in range(5):
                made[2 + 5 * axis + bit] += (bits >> bit) & 1
    made[0], made[1] = sqrt(square / count), largest
    made[2:] /= count


def cases_of(
    crane: Crane,
    control: Control | Mapping[str, Control],
    drives: Sequence[str] | Mapping[str, str | Crane | Sequence[Crane]],
    how: Mapping[str, Any],
) -> dict[str, Case]:
    """Cases by name: controllers by drives, in this order.

    Raises
    ------
    InputError
        For drives that are neither ``"ideal"``, ``"identified"`` nor cranes.
    """
    laws = dict(control) if isinstance(control, Mapping) else {"": control}
    sets = dict(drives) if isinstance(drives, Mapping) else {each: each for each in drives}
    if not laws or not sets:
        raise InputError("A study needs at least one controller and one set of drives.")
    made = {}
    for law, stages in laws.items():
        for name, given in sets.items():
            if isinstance(given, str) and given not in (IDEAL, BUILT):
                raise InputError(
                    f"There are no drives '{given}'; there are {IDEAL}, {BUILT}, or cranes by name."
                )
            if isinstance(given, str):
                cranes: tuple[Crane, ...] = (crane,)
            else:
                cranes = (given,) if isinstance(given, Crane) else tuple(given)
            if not cranes:
                raise InputError(f"The drives '{name}' are an empty list of cranes.")
            actuation: Actuation = "ideal" if given == IDEAL else "inverse"
            made[f"{law}, {name}" if law else name] = Case(cranes, stages, actuation, how)
    return made


def seaway_of(sea: Sea) -> Seaway:
    """A seaway, by default abeam and of the crane ship's hull."""
    return sea if isinstance(sea, Seaway) else Seaway(sea)


def commands_of(
    crane: Crane, stick: Stick, how: Mapping[str, Any], start: float
) -> tuple[Array, int]:
    """Commands of a study, and the sample from which on swing counts."""
    if not 0.0 <= start < stick.length:
        raise InputError(
            f"Swing counts from {start:g} s on, but a run is {stick.length:g} s long: begin "
            "earlier or take a longer one."
        )
    commands, _ = stick.sample(crane, pose_of(how), RATE)
    return commands, round(start * RATE)


def station(
    slew_deg: float, boom_deg: float, rope_m: float, more: Mapping[str, Any]
) -> dict[str, Any]:
    """Keywords of `Crane.stepper` for where a crane begins, and others."""
    return {"slew_deg": slew_deg, "boom_deg": boom_deg, "rope_m": rope_m, **more}


def pose_of(how: Mapping[str, Any]) -> Pose:
    """The pose of these keywords."""
    return Pose(radians(how["slew_deg"]), radians(how["boom_deg"]), how["rope_m"])


# --- over bearing, wave height and the luff's orifice ---------------------------------------------


@dataclass(frozen=True, eq=False)
class Sweep(Result):
    """Swing of several variants over a quantity, in the same seaways."""

    what: str
    """``"bearing"``, ``"height"`` or ``"orifice"``."""
    grid: Array
    """(n,) bearing of the boom [rad], significant height of the waves [m], factor on the orifice of
    the luff drive."""
    names: tuple[str, ...]
    values: Array = field(repr=False)
    """(seaways, n, variants, 2) root mean square and largest swing [rad]; NaN: stopped."""
    crane: Crane = field(repr=False)
    sea: Seaway = field(repr=False)

    @property
    def figure(self) -> str:  # type: ignore[override]
        """The figure that shows it."""
        return {"bearing": "plot_sectors", "height": "plot_operability"}.get(
            self.what, "plot_orifice"
        )

    def mean(self) -> Array:
        """(n, variants) mean over the seaways of the root mean square swing. [rad]"""
        return np.asarray(np.mean(self.values[..., 0], axis=0))

    def below(self, limit_deg: float) -> Array:
        """(n, variants) share of seaways whose largest swing is below a limit."""
        return np.asarray(np.mean(self.values[..., 1] < radians(limit_deg), axis=0))

    def table(self) -> Table:
        """Mean of the root mean square swing, a row for each point."""
        first = {"bearing": (".0f", "rad"), "height": (".2f", "m")}.get(self.what, (".2f", ""))
        columns = [Column(self.what, *first)]
        columns += [Column(each, ".2f", "rad", none="stopped") for each in self.names]
        made = Table("Swing, RMS, mean over seaways", columns)
        for x, row in zip(self.grid, self.mean(), strict=True):
            made.add(float(x), *map(float, row))
        return made


NONE = "no control"
"""The crane as it is built, under the operator's stick alone."""
Drives = Sequence[str] | Mapping[str, str | Crane | Sequence[Crane]]
"""Drives of a study, by words or names."""


def _swept(
    what: str,
    grid: Array,
    points: Sequence[Mapping[str, Case]],
    crane: Crane,
    sea: Seaway,
    *,
    seeds: Sequence[int],
    spans: tuple[float, float],
    executor: Executor | None,
    progress: Progress | None,
) -> Sweep:
    """Swing of the cases of all points, in the same seaways."""
    cases = [each for point in points for each in point.values()]
    length, start = spans
    commands, first = commands_of(crane, Stick.rest(length), cases[0].how, start)
    # what does not depend on the point is simulated once
    single = list(dict.fromkeys(map(id, cases)))
    by_id = {id(each): each for each in cases}
    study = Study(tuple(by_id[each] for each in single), sea, commands, first)
    found = outcomes(study, seeds, executor, progress)[..., :2]
    values = found[:, [single.index(id(each)) for each in cases]]
    names = tuple(points[0])
    shaped = values.reshape(len(seeds), grid.size, len(names), 2)
    return Sweep(what, grid, names, shaped, crane, sea)


def sectors(
    crane: Crane,
    control: Control | Mapping[str, Control],
    *,
    sea: Sea = "ss3",
    bearings: ArrayLike = tuple(range(0, 360, 15)),
    seeds: Sequence[int] = range(4),
    drives: Drives = (IDEAL, BUILT),
    length: float = 120.0,
    start: float = 40.0,
    boom_deg: float = 45.0,
    rope_m: float = 27.0,
    executor: Executor | None = None,
    progress: Progress | None = None,
    **more: Any,
) -> Sweep:
    """Swing over the bearing of the boom, at rest there, without control and with it.

    Parameters are those of `judge`; `bearings` [deg] from the bow to starboard.
    """
    grid = _rising("Bearings", bearings)
    points = []
    for bearing in grid:
        how = station(float(bearing), boom_deg, rope_m, more)
        none = Case((crane,), None, "inverse", how)
        points.append({NONE: none, **cases_of(crane, control, drives, how)})
    spans = length, start
    return _swept(
        "bearing",
        np.radians(grid),
        points,
        crane,
        seaway_of(sea),
        seeds=seeds,
        spans=spans,
        executor=executor,
        progress=progress,
    )


def operability(
    crane: Crane,
    control: Control | Mapping[str, Control],
    *,
    heights: ArrayLike = (0.1, 0.2, 0.3, 0.45, 0.6, 0.9, 1.2),
    period: float = 7.5,
    sea: Sea = "ss3",
    seeds: Sequence[int] = range(40),
    drives: Drives = (IDEAL, BUILT),
    length: float = 120.0,
    start: float = 40.0,
    slew_deg: float = 90.0,
    boom_deg: float = 45.0,
    rope_m: float = 27.0,
    executor: Executor | None = None,
    progress: Progress | None = None,
    **more: Any,
) -> Sweep:
    """Swing over the significant height of waves of one peak period.

    Parameters are those of `judge`; `heights` [m], `period` [s]; of `sea` ship and heading count.
    """
    grid = _rising("Heights of waves", heights, 0.0)
    how = station(slew_deg, boom_deg, rope_m, more)
    found = {NONE: Case((crane,), None, "inverse", how), **cases_of(crane, control, drives, how)}
    points = [
        {name: each._replace(height=float(height)) for name, each in found.items()}
        for height in grid
    ]
    base = replace(seaway_of(sea), sea=Spectrum(1.0, period))
    spans = length, start
    return _swept(
        "height",
        grid,
        points,
        crane,
        base,
        seeds=seeds,
        spans=spans,
        executor=executor,
        progress=progress,
    )


def orifices(
    crane: Crane,
    control: Control | Mapping[str, Control],
    *,
    factors: ArrayLike = (0.5, 0.75, 1.0, 1.25, 1.5, 2.0, 3.0, 5.0),
    sea: Sea = "ss3",
    seeds: Sequence[int] = range(20),
    length: float = 120.0,
    start: float = 40.0,
    slew_deg: float = 90.0,
    boom_deg: float = 45.0,
    rope_m: float = 27.0,
    executor: Executor | None = None,
    progress: Progress | None = None,
    **more: Any,
) -> Sweep:
    """Swing over the size of the luff drive's in-line orifice, beside ideal drives and no control.

    Parameters are those of `judge`; `factors` on the orifice of the crane's luff drive. Ideal
    drives have the first controller.
    """
    grid = _rising("Factors on the orifice", factors, 0.0)
    how = station(slew_deg, boom_deg, rope_m, more)
    laws = control if isinstance(control, Mapping) else {"control": control}
    common = {
        NONE: Case((crane,), None, "inverse", how),
        "ideal drives": Case((crane,), next(iter(laws.values())), "ideal", how),
    }
    points = []
    for factor in grid:
        changed = crane.with_drive(luff=pulled(crane.luff, {"orifice": float(factor)}))
        own = {name: Case((changed,), law, "inverse", how) for name, law in laws.items()}
        points.append({**common, **own})
    spans = length, start
    return _swept(
        "orifice",
        grid,
        points,
        crane,
        seaway_of(sea),
        seeds=seeds,
        spans=spans,
        executor=executor,
        progress=progress,
    )


def _rising(what: str, given: ArrayLike, above: float = -np.inf) -> Array:
    grid = np.atleast_1d(np.asarray(given, dtype=np.float64))
    if not (np.isfinite(grid).all() and (grid > above).all() and grid.size):
        limit = f" above {above:g}" if np.isfinite(above) else ""
        raise InputError(f"{what} must be one or more finite numbers{limit}.")
    return grid


# --- residual swing over the stick ----------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Residuals(Result):
    """Residual swing after a maneuver over the stick, for several controllers and actuations."""

    sticks: Array
    """(n,) part of the full speed."""
    names: tuple[str, ...]
    values: Array
    """(n, m) [rad]"""
    reached: Array
    """(n, m) slew at the end. [rad]"""
    target: float
    """[rad]"""
    crane: Crane = field(repr=False)

    figure = "plot_residuals"

    def tables(self) -> list[Table]:
        """Residual swing, and where the slew ends."""
        heads = [Column("stick", ".2f"), *(Column(each, ".3f", "rad") for each in self.names)]
        swing = Table("Residual swing", heads)
        ends = Table("Slew at the end", [heads[0], *(replace(c, spec=".1f") for c in heads[1:])])
        for stick, values, reached in zip(self.sticks, self.values, self.reached, strict=True):
            swing.add(float(stick), *map(float, values))
            ends.add(float(stick), *map(float, reached))
        return [swing, ends]


def residuals(
    crane: Crane,
    variants: Mapping[str, tuple[str, Control | None]],
    *,
    sticks: ArrayLike = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0),
    slew_deg: float = 45.0,
    boom_deg: float = 45.0,
    rope_m: float = 20.0,
) -> Residuals:
    """Residual swing after a slew from forward, over the stick, in a calm sea.

    Parameters
    ----------
    crane : Crane
    variants : mapping of str to (str, Control or None)
        Actuation, as of `Crane.simulate`, and controller by name.
    sticks : (n,) array_like
        Parts of the full speed.
    slew_deg : float
        Target of the slew.
    boom_deg, rope_m : float
        Pose.
    """
    grid = _rising("Sticks", sticks, 0.0)
    values, reached = np.zeros((2, grid.size, len(variants)))
    for i, part in enumerate(grid):
        full = min(abs(each) for each in crane.inverse("slew").limits)
        length = np.ceil(radians(slew_deg) / (part * full) + 60.0)
        stick = Stick.trapezoid(
            slew=float(part), until={"slew_deg": slew_deg}, length=float(length)
        )
        for k, (actuation, law) in enumerate(variants.values()):
            how: dict[str, Any] = {"actuation": actuation, "control": law}
            run = crane.simulate(stick, boom_deg=boom_deg, rope_m=rope_m, **how)
            values[i, k], reached[i, k] = radians(run.residual_deg), radians(run.slew_deg[-1])
    return Residuals(grid, tuple(variants), values, reached, radians(slew_deg), crane)
