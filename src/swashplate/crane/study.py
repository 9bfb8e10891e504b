"""Studies of a crane: swing over many seaways, over bearing, wave height, orifice and stick.

Every variant of control and drives goes through the same seeded seaways, so that differences are
paired. Of a run only what is counted is kept.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import atan2, radians, sqrt
from typing import Any, NamedTuple, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.analysis.whatif import pulled
from swashplate.crane.control import Control
from swashplate.crane.crane import Crane
from swashplate.crane.loop import ROWS
from swashplate.crane.sea import Seaway, Spectrum
from swashplate.crane.stepper import RATE, Actuation, Start, pose_of
from swashplate.crane.stick import AXES, Stick
from swashplate.equations import kernel
from swashplate.errors import DomainError, InputError
from swashplate.executors import Executor, Threads
from swashplate.results import Result
from swashplate.simulation.result import Limit
from swashplate.tables import Column, Table

Array = NDArray[np.float64]
Drives = Sequence[str] | Mapping[str, str | Crane | Sequence[Crane]]
"""Drives of a study, by words or names."""

PUMPS = (Limit.DEAD_ZONE, Limit.ORIFICE, Limit.SPOOL, Limit.SWASH_STOP, Limit.RELIEF)
"""Limits that the loop leaves of each drive, in the order of its bits."""
COUNTED = (
    *("rms_swing", "largest_swing"),
    *(f"{axis}_{str(limit.name).lower()}" for axis in AXES for limit in PUMPS),
)
"""What is kept of a run: swing [rad], shares of time for which limits act."""
IDEAL, BUILT = "ideal", "identified"
"""Drives that follow at once, and the crane's own."""
NONE = "no control"
"""The crane as it is built, under the operator's stick alone."""

# --- many runs ------------------------------------------------------------------------------------


class StudySetup(Start, total=False):
    """How a study is set up: keywords of `judge`, `sectors`, `operability` and `orifices`.

    Those of `Start` say where each run begins; by default the load hangs abeam, boom at 45 deg,
    rope 27 m.

    Attributes
    ----------
    sea : str, Spectrum or Seaway
        Sea state, by default "ss3"; a seaway gives heading, ship and spreading as well.
    seeds : sequence of int
        A seaway for each.
    drives : sequence of str, or mapping of str to str, Crane or sequence of Crane
        ``"ideal"``, which follow at once within their limits of speed, ``"identified"``, the
        crane's own; by name also other cranes, or several of which each seaway takes the next, see
        `Crane.drawn`. By default the first two.
    stick : Stick, optional
        What the operator does; by default nothing, the crane keeps its load in place.
    length : float
        Of each run if there is no stick, 120 s. [s]
    start : float
        From when on swing counts, 40 s. [s]
    executor : Executor, optional
        Of `swashplate.executors`; threads by default. The numbers do not depend on it.
    progress : callable, optional
        Called with seaways done and their number.
    """

    sea: str | Spectrum | Seaway
    seeds: Sequence[int]
    drives: Drives
    stick: Stick | None
    length: float
    start: float
    executor: Executor | None
    progress: Callable[[int, int], None] | None


class Case(NamedTuple):
    """A crane with its control, as it goes through every seaway."""

    cranes: tuple[Crane, ...]
    """One, or cranes of which each seaway takes the next."""
    control: Control | None
    actuation: Actuation
    where: Start
    """Where it begins, load, brake."""
    height: float = 1.0
    """Factor on the height of the waves."""

    def stepper(self, number: int) -> Any:
        """The crane of a seaway by its number."""
        crane = self.cranes[number % len(self.cranes)]
        return crane.stepper(control=self.control, actuation=self.actuation, **self.where)


class _Runs(NamedTuple):
    """What a worker needs to know of a study."""

    cases: tuple[Case, ...]
    sea: Seaway
    commands: Array
    first: int
    """Sample from which on swing counts."""


@dataclass(frozen=True, eq=False)
class Study:
    """A study as it is asked for: controllers, drives, seaways, stick, where each run begins."""

    crane: Crane
    laws: Mapping[str, Control]
    drives: Mapping[str, str | Crane | Sequence[Crane]]
    sea: Seaway
    seeds: tuple[int, ...]
    stick: Stick
    start: float
    where: Start
    executor: Executor
    progress: Callable[[int, int], None] | None

    @classmethod
    def of(
        cls,
        crane: Crane,
        control: Control | Mapping[str, Control],
        setup: StudySetup,
        *,
        seeds: Sequence[int],
        fixed: tuple[str, ...] = (),
    ) -> Study:
        """A study from keywords of a user.

        Parameters
        ----------
        crane : Crane
        control : Control or mapping of str to Control
        setup : StudySetup
        seeds : sequence of int
            Taken by default.
        fixed : tuple of str
            Keywords that this kind of study does not take.

        Raises
        ------
        InputError
            For unknown keywords, seeds, drives or a start that make no study.
        """
        known = [each for each in StudySetup.__annotations__ if each not in fixed]
        strange = [each for each in setup if each not in known]
        if strange:
            raise InputError(f"This study has no {strange[0]}; it has {', '.join(known)}.")
        own: dict[str, Any] = dict(setup)
        laws = dict(control) if isinstance(control, Mapping) else {"": control}
        drives = own.pop("drives", (IDEAL, BUILT))
        sets = dict(drives) if isinstance(drives, Mapping) else {each: each for each in drives}
        if not laws or not sets:
            raise InputError("A study needs at least one controller and one set of drives.")
        chosen = tuple(own.pop("seeds", seeds))
        if not chosen:
            raise InputError("A study of seaways needs at least one seed.")
        sea = own.pop("sea", "ss3")
        length, start = own.pop("length", 120.0), own.pop("start", 40.0)
        stick = own.pop("stick", None) or Stick.rest(length)
        if not 0.0 <= start < stick.length:
            raise InputError(
                f"Swing counts from {start:g} s on, but a run is {stick.length:g} s long: begin "
                "earlier or take a longer one."
            )
        executor, progress = own.pop("executor", None) or Threads(), own.pop("progress", None)
        where: Any = {"slew_deg": 90.0, "boom_deg": 45.0, "rope_m": 27.0} | own
        seaway = sea if isinstance(sea, Seaway) else Seaway(sea)
        return cls(
            crane, laws, sets, seaway, chosen, stick, start, where, executor, progress
        )  # fmt: skip

    def cases(self, **moved: Unpack[Start]) -> dict[str, Case]:
        """Cases by name, with other keywords of where they begin: none, controllers by drives.

        Raises
        ------
        InputError
            For drives that are neither ``"ideal"``, ``"identified"`` nor cranes.
        """
        where: Start = {**self.where, **moved}
        made = {NONE: Case((self.crane,), None, "inverse", where)}
        for law, stages in self.laws.items():
            for name, given in self.drives.items():
                cranes: tuple[Crane, ...] = (self.crane,)
                if isinstance(given, str) and given not in (IDEAL, BUILT):
                    raise InputError(
                        f"There are no drives '{given}'; there are {IDEAL}, {BUILT}, or cranes by "
                        "name."
                    )
                if not isinstance(given, str):
                    cranes = (given,) if isinstance(given, Crane) else tuple(given)
                if not cranes:
                    raise InputError(f"The drives '{name}' are an empty list of cranes.")
                actuation: Actuation = "ideal" if given == IDEAL else "inverse"
                made[f"{law}, {name}" if law else name] = Case(cranes, stages, actuation, where)
        return made

    def outcomes(self, cases: Sequence[Case], seeds: range | None = None) -> Array:
        """Swing and limits of all cases in the seaways, or in some of them by their numbers.

        Returns
        -------
        (n, m, 17) array
            Of seaways and cases, `COUNTED`; NaN where a run met a limit of the crane's travel or
            left the model's domain.

        Raises
        ------
        InputError, ParameterError
            If a case cannot begin as it is asked to.
        """
        for case in cases:  # said here, once, and not by a worker
            case.stepper(0)
        pose = pose_of(cases[0].where)
        commands, _ = self.stick.sample(self.crane, pose, RATE)
        runs = _Runs(tuple(cases), self.sea, commands, round(self.start * RATE))
        numbers = range(len(self.seeds)) if seeds is None else seeds
        made = np.full((len(numbers), len(cases), len(COUNTED)), np.nan)
        items = [(n, self.seeds[n]) for n in numbers]
        for done, (k, values) in enumerate(self.executor.run(_of_seaway, runs, items), 1):
            made[k] = values
            if self.progress is not None and seeds is None:
                self.progress(done, len(numbers))
        return made


def _of_seaway(runs: _Runs, item: tuple[int, int]) -> Array:
    """Outcomes of all cases in one seaway."""
    number, seed = item
    motion = replace(runs.sea, seed=seed).motion(len(runs.commands), RATE)
    made = np.full((len(runs.cases), len(COUNTED)), np.nan)
    for row, case in zip(made, runs.cases, strict=True):
        waves = motion if case.height == 1.0 else case.height * motion
        try:
            out = case.stepper(number).take(runs.commands, waves)
        except (DomainError, InputError):  # stopped: by the travel's limits, or the tip too fast
            continue
        _counted(out, runs.first, row)
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


# --- over bearing, wave height and the luff's orifice ---------------------------------------------

SHOWN = {
    "bearing": ("plot_sectors", ".0f", "rad"),
    "height": ("plot_operability", ".2f", "m"),
    "orifice": ("plot_orifice", ".2f", ""),
}
"""Figure of each quantity that is swept, and its column."""


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
        return SHOWN[self.what][0]

    def mean(self) -> Array:
        """(n, variants) mean over the seaways of the root mean square swing. [rad]"""
        return np.asarray(np.mean(self.values[..., 0], axis=0))

    def below(self, limit_deg: float) -> Array:
        """(n, variants) share of seaways whose largest swing is below a limit."""
        return np.asarray(np.mean(self.values[..., 1] < radians(limit_deg), axis=0))

    def table(self) -> Table:
        """Mean of the root mean square swing, a row for each point."""
        columns = [Column(self.what, *SHOWN[self.what][1:])]
        columns += [Column(each, ".2f", "rad", none="stopped") for each in self.names]
        made = Table("Swing, RMS, mean over seaways", columns)
        for x, row in zip(self.grid, self.mean(), strict=True):
            made.add(float(x), *map(float, row))
        return made


def _swept(study: Study, what: str, grid: Array, points: Sequence[Mapping[str, Case]]) -> Sweep:
    """Swing of the cases of all points, in the same seaways."""
    cases = [each for point in points for each in point.values()]
    # what does not depend on the point is simulated once
    single = {id(each): each for each in cases}
    found = study.outcomes(list(single.values()))[..., :2]
    values = found[:, [list(single).index(id(each)) for each in cases]]
    names = tuple(points[0])
    shaped = values.reshape(len(values), grid.size, len(names), 2)
    return Sweep(what, grid, names, shaped, study.crane, study.sea)


def sectors(
    crane: Crane,
    control: Control | Mapping[str, Control],
    *,
    bearings: ArrayLike = tuple(range(0, 360, 15)),
    **setup: Unpack[StudySetup],
) -> Sweep:
    """Swing over the bearing of the boom [deg], from the bow to starboard, in 4 seaways."""
    study = Study.of(crane, control, setup, seeds=range(4), fixed=("slew_deg",))
    grid = _rising("Bearings", bearings)
    points = [study.cases(slew_deg=float(each)) for each in grid]
    return _swept(study, "bearing", np.radians(grid), points)


def operability(
    crane: Crane,
    control: Control | Mapping[str, Control],
    *,
    heights: ArrayLike = (0.1, 0.2, 0.3, 0.45, 0.6, 0.9, 1.2),
    period: float = 7.5,
    **setup: Unpack[StudySetup],
) -> Sweep:
    """Swing over the significant height of waves [m] of one peak period [s], in 40 seaways.

    Of `sea` ship and heading count.
    """
    study = Study.of(crane, control, setup, seeds=range(40))
    grid = _rising("Heights of waves", heights, 0.0)
    found = study.cases().items()
    points = [{name: case._replace(height=float(h)) for name, case in found} for h in grid]
    unit = replace(study, sea=replace(study.sea, sea=Spectrum(1.0, period)))
    return _swept(unit, "height", grid, points)


def orifices(
    crane: Crane,
    control: Control | Mapping[str, Control],
    *,
    factors: ArrayLike = (0.5, 0.75, 1.0, 1.25, 1.5, 2.0, 3.0, 5.0),
    **setup: Unpack[StudySetup],
) -> Sweep:
    """Swing over factors on the luff drive's in-line orifice, in 20 seaways.

    Beside the crane's own drives there are ideal ones, under the first controller, and no control.
    """
    study = Study.of(crane, control, setup, seeds=range(20), fixed=("drives",))
    grid = _rising("Factors on the orifice", factors, 0.0)
    laws = {name or "control": law for name, law in study.laws.items()}
    ideal = Case((crane,), next(iter(laws.values())), "ideal", study.where)
    common = {NONE: study.cases()[NONE], "ideal drives": ideal}
    points = []
    for factor in grid:
        changed = crane.with_drive(luff=pulled(crane.luff, {"orifice": float(factor)}))
        own = {name: Case((changed,), law, "inverse", study.where) for name, law in laws.items()}
        points.append({**common, **own})
    return _swept(study, "orifice", grid, points)


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
