"""Studies of a crane over many seaways, and sweeps of a quantity.

Every variant of control and drives goes through the same seeded seaways, so that differences are
paired. Of a run only what is counted is kept.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple, Unpack, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.crane.axes import AXES, RATE, check_names
from swashplate.crane.changed_drives import upgraded
from swashplate.crane.control import Control
from swashplate.crane.crane import Crane
from swashplate.crane.result import PUMPS, CraneRun
from swashplate.crane.rope import swing_of
from swashplate.crane.sea import HIGHEST, Seaway, Spectrum
from swashplate.crane.simulating import begun, simulate
from swashplate.crane.stepper import Actuation, Setup
from swashplate.crane.stick import Stick
from swashplate.errors import DomainError, InputError
from swashplate.executors import Executor, Threads
from swashplate.progress import counted
from swashplate.results import Result, figures
from swashplate.tables import Column, Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
Laws = Control | Mapping[str, Control | None]
Drives = Sequence[str] | Mapping[str, str | Crane | Sequence[Crane]]
"""Controllers and drives of a study, by words or names; no controller is None."""

COUNTED = (
    *("rms_swing", "largest_swing", "slew"),
    *(f"{axis}_{str(limit.name).lower()}" for axis in AXES for limit in PUMPS),
)
"""What is kept of a run: swing and slew at the end [rad], shares of time for which limits act."""
BITS = np.arange(2 ** len(PUMPS))[:, None] >> np.arange(len(PUMPS)) & 1
"""Which of `PUMPS` act, a row for each sum of the loop's bits."""
IDEAL, BUILT = "ideal", "identified"
ACTUATED: Mapping[str, Actuation] = {IDEAL: "ideal", BUILT: "inverse", "volts": "volts"}
"""Drives that follow at once; the crane's own behind their inverse maps; the same, 10 V for full
speed."""
NONE = "no control"
"""The crane as it is built, under the operator's stick alone."""


# --- many runs ------------------------------------------------------------------------------------


class Case(NamedTuple):
    """A crane with its control, as it goes through every seaway."""

    cranes: tuple[Crane, ...]
    """One, or cranes of which each seaway takes the next."""
    setup: Setup
    stick: Stick
    height: float = 1.0
    """Factor on the height of the waves."""

    @property
    def driven(self) -> bool:
        """Whether it has drives that have limits, not ideal ones."""
        return self.setup["actuation"] != IDEAL

    def run(self, number: int, motion: Array | None, lean: Array | float = 0.0) -> CraneRun:
        """Its run in a seaway by the seaway's number, in that motion of the ship.

        The constant part of the motion, the ship's lean, does not grow with the waves' height.
        """
        sea = motion
        if motion is not None and self.height != 1.0:
            sea = lean + self.height * (motion - lean)
        crane = self.cranes[number % len(self.cranes)]
        return simulate(crane, self.stick, sea=sea, **self.setup)

    def moved(self, **setup: Unpack[Setup]) -> Case:
        """The case set up in another way."""
        return self._replace(setup=self.setup | setup)


@dataclass(frozen=True, eq=False)
class Study(Result):
    """A study as it is asked for: variants of control and drives in seaways."""

    crane: Crane
    cases: Mapping[str, Case]
    """By name: no control, then each controller on each set of drives."""
    sea: Seaway | None
    """None for a calm sea, in which the residual swing counts."""
    seeds: tuple[int, ...]
    start: float
    """From when on swing counts. [s]"""
    executor: Executor
    progress: Callable[[int, int], None] | None

    @classmethod
    def of(
        cls,
        crane: Crane,
        control: Laws,
        *,
        seeds: Sequence[int],
        sea: str | Spectrum | Seaway = "ss3",
        drives: Drives = (IDEAL, BUILT),
        stick: Stick | None = None,
        length: float = 120.0,
        start: float = 40.0,
        executor: Executor | None = None,
        progress: Callable[[int, int], None] | None = None,
        **setup: Any,
    ) -> Study:
        """A study; these are the keywords of `judge` and `sweep`.

        Parameters
        ----------
        control : Control or mapping of str to Control or None
            One controller, or several by name.
        seeds : sequence of int
            A seaway for each.
        sea : str, Spectrum or Seaway
            Sea state; a seaway gives heading, ship and spreading as well.
        drives : sequence of str, or mapping of str to str, Crane or sequence of Crane
            ``"ideal"``, which follow at once within their limits of speed; ``"identified"``, the
            crane's own; ``"volts"``, these without their inverse maps; by name also other cranes,
            or several of which each seaway takes the next, see `drawn_cranes`.
        stick : Stick, optional
            What the operator does; by default nothing, the crane keeps its load in place.
        length : float
            Of each run if there is no stick. [s]
        start : float
            From when on swing counts. [s]
        executor : Executor, optional
            Of `swashplate.executors`; threads by default. The numbers do not depend on it.
        progress : callable, optional
            Called with seaways done and their number.
        **setup
            Where each run begins, what hangs on it: see `Setup`, whose control and actuation follow
            from controllers and drives. By default the load hangs abeam on 27 m of rope.
        """
        laws = control if isinstance(control, Mapping) else {"": control}
        named = [drives] if isinstance(drives, str) else drives
        if not isinstance(named, Iterable):
            raise InputError(f"drives is {drives!r}, but must be a list of names, or a mapping.")
        sets = named if isinstance(named, Mapping) else {each: each for each in named}
        if isinstance(seeds, int):
            raise InputError(f"seeds is {seeds}, but must be a sequence, as range({seeds}).")
        if not (laws and sets and seeds):
            raise InputError("A study needs a controller, a set of drives and a seed at least.")
        poses = [each for each in Setup.__annotations__ if each not in ("control", "actuation")]
        words = ("seeds", "sea", "drives", "stick", "length", "start", *poses)
        check_names("A study has no", setup, words, "it has")
        stick = stick or Stick.rest(length)
        if not 0.0 <= start < stick.length:
            raise InputError(
                f"Swing counts from {start:g} s on, but a run is {stick.length:g} s long: begin "
                "earlier or take a longer one."
            )
        own: Any = {"slew_deg": 90.0, "boom_deg": 45.0, "rope_m": 27.0, **setup}
        none = Case((crane,), own | {"control": None, "actuation": "inverse"}, stick)
        cases = {NONE: none}
        for law, stages in laws.items():
            for name, given in sets.items():
                if isinstance(given, str):
                    check_names("There are no drives", [given], ACTUATED)
                    case = none.moved(control=stages, actuation=ACTUATED[given])
                else:
                    cranes: tuple[Any, ...] = (given,)
                    if isinstance(given, Sequence):
                        cranes = tuple(given)
                    if not cranes or not all(isinstance(each, Crane) for each in cranes):
                        raise InputError(
                            f"The drives '{name}' are {given!r}, but must be a name, a crane or a "
                            "list of cranes."
                        )
                    case = none.moved(control=stages)._replace(cranes=cranes)
                cases[f"{law}, {name}" if law else name] = case
        seaway = sea if isinstance(sea, Seaway) else Seaway(sea)
        return cls(crane, cases, seaway, tuple(seeds), start, executor or Threads(), progress)

    def provenance(self) -> tuple[str, ...]:
        """Sentences on the drives of all its cranes, each once: `Crane.provenance`."""
        cranes = [self.crane, *(crane for case in self.cases.values() for crane in case.cranes)]
        return tuple(dict.fromkeys(words for crane in cranes for words in crane.provenance()))

    def outcomes(self, cases: Sequence[Case], numbers: range | None = None) -> Array:
        """`COUNTED` of all cases in the seaways, or in some of them by their numbers, (n, m, 18).

        NaN where a run met a limit of the crane's travel or left the model's domain. An
        `InputError` or `ParameterError` if a case cannot begin as it is asked to.
        """
        for case in cases:  # said here, once, and not by a worker
            begun(case.cranes[0], case.stick, case.setup)
        chosen = range(len(self.seeds)) if numbers is None else numbers
        made = np.full((len(chosen), len(cases), len(COUNTED)), np.nan)
        items = [(n, self.seeds[n]) for n in chosen]
        work = (tuple(cases), self.sea, self.start)
        runs = self.executor.run(_of_seaway, work, items)
        seaways = counted(runs, len(chosen), "seaways", f"Simulating {self.crane.name}")
        for done, (k, values) in enumerate(seaways, 1):
            made[k] = values
            if self.progress is not None and numbers is None:
                self.progress(done, len(chosen))
        return made


def _of_seaway(work: tuple[tuple[Case, ...], Seaway | None, float], item: tuple[int, int]) -> Array:
    """Outcomes of all cases in one seaway."""
    (cases, sea, start), (number, seed) = work, item
    longest = max(case.stick.length for case in cases)
    motion, lean = None, np.zeros(6)
    if sea is not None:
        lean = sea.lean
        motion = replace(sea, seed=seed).motion(round(longest * RATE) + 1, RATE)
    made = np.full((len(cases), len(COUNTED)), np.nan)
    for row, case in zip(made, cases, strict=True):
        try:
            run = case.run(number, motion, lean)
        except (DomainError, InputError):  # stopped: by the travel's limits, or the tip too fast
            continue
        counts = run.settling if sea is None else slice(round(start * RATE), None)
        swing = swing_of(run.load[counts], run.tip[counts])
        slew = run.fixed.home.slew + run["shaft_slew"][-1]
        row[:3] = np.sqrt(np.mean(swing**2)), swing.max(), slew
        for share, axis in zip(row[3:].reshape(3, -1), AXES, strict=True):
            bits = run[f"limits_{axis}"][counts].astype(np.uint8)
            share[:] = np.bincount(bits, minlength=len(BITS)) @ BITS / len(bits)
    return made


# --- sweeps ---------------------------------------------------------------------------------------


class Swept(NamedTuple):
    """A quantity that a sweep goes over."""

    points: tuple[float, ...]
    low: float
    high: float
    """Range of plausible points."""
    study: Mapping[str, Any]
    """Keywords of a study unless the user says otherwise."""
    unit: str
    """In which points are given and shown."""
    fixed: tuple[str, ...] = ()
    """Keywords of a study that it does not take."""


TURN, PERIOD = 45.0, 7.5
"""Slew of a sweep over the stick [deg]; peak period of a sweep over the waves' height [s]."""
SWEPT: Mapping[str, Swept] = {
    "bearing": Swept(
        tuple(range(0, 360, 15)), -720.0, 720.0, {"seeds": range(4)}, "deg", ("slew_deg",)
    ),
    "height": Swept(
        (0.1, 0.2, 0.3, 0.45, 0.6, 0.9, 1.2), 0.001, HIGHEST, {"seeds": range(40)}, "m"
    ),
    "orifice": Swept(
        (0.5, 0.75, 1.0, 1.25, 1.5, 2.0, 3.0, 5.0), 0.01, 100.0, {"seeds": range(20)}, ""
    ),
    "stick": Swept(
        tuple(k / 10.0 for k in range(1, 11)),
        0.001,
        1.0,
        {"seeds": (0,), "slew_deg": 0.0, "rope_m": 20.0, "drives": (IDEAL, "volts", BUILT)},
        "",
        ("seeds", "sea", "stick", "start", "length"),
    ),
}
"""Bearing of the boom, from the bow to starboard; significant height of the waves; factor on the
luff drive's in-line orifice; the operator's stick in a slew by `TURN`, in a calm sea."""


@dataclass(frozen=True, eq=False)
class Sweep(Result):
    """Swing of several variants over a quantity, in the same seaways."""

    over: str
    points: Array
    """(n,) bearings [rad], heights [m], factors on the orifice, parts of the full speed."""
    names: tuple[str, ...]
    values: Array = field(repr=False)
    """(seaways, n, variants, 3) root mean square and largest swing, slew at the end [rad]; NaN:
    stopped. Over the stick the residual swing, of 25 s."""
    crane: Crane = field(repr=False)
    sea: Seaway | None = field(repr=False)

    def mean(self) -> Array:
        """(n, variants, 3) means over the seaways. [rad]"""
        return np.asarray(np.mean(self.values, axis=0))

    def below(self, limit_deg: float) -> Array:
        """(n, variants) share of seaways whose largest swing is below a limit."""
        return np.asarray(np.mean(np.degrees(self.values[..., 1]) < limit_deg, axis=0))

    def plot(self, *, limit_deg: float = 3.0, title: str = "") -> Figure:
        """Figure of the swing over the quantity; `swashplate.report.figures.plot_sweep`."""
        return cast("Figure", figures().plot_sweep(self, limit_deg=limit_deg, title=title))

    def tables(self) -> list[Table]:
        """Root mean square swing; over the stick the residual swing, and where the slew ends."""
        shown = {"Swing, RMS, mean over seaways": (0, ".2f")}
        if self.over == "stick":
            shown = {"Residual swing": (1, ".3f"), "Slew at the end": (2, ".1f")}
        made = []
        unit = SWEPT[self.over].unit.replace("deg", "rad")
        for title, (kept, spec) in shown.items():
            columns = [Column(self.over, ".0f" if unit == "rad" else ".2f", unit)]
            columns += [Column(each, spec, "rad", none="stopped") for each in self.names]
            made.append(Table(title, columns))
            for x, row in zip(self.points.tolist(), self.mean()[..., kept].tolist(), strict=True):
                made[-1].add(x, *row)
        return made


def sweep(
    crane: Crane, over: str, control: Laws, *, points: ArrayLike | None = None, **study: Any
) -> Sweep:
    """Swing over a quantity at some points of it, in the same seaways.

    Parameters
    ----------
    over : {"bearing", "height", "orifice", "stick"}
        Bearing of the boom from the bow to starboard [deg], in 4 seaways; significant height of
        waves [m] with a peak at 7.5 s, in 40, where of `sea` ship and heading count; factor on the
        luff drive's in-line orifice under control, in 20; the stick, part of the full speed, in a
        slew of 45 degrees from forward on 20 m of rope in a calm sea, of which the residual swing
        counts.
    control, **study
        Controllers, seaways, drives, where each run begins: see `Study.of`.
    """
    check_names("There is no sweep over", [over], SWEPT)
    swept = SWEPT[over]
    taken = [each for each in study if each in swept.fixed]
    if taken:
        raise InputError(f"A sweep over the {over} sets {taken[0]} itself: leave it out.")
    grid = np.atleast_1d(np.asarray(swept.points if points is None else points, dtype=np.float64))
    if not (grid.size and (swept.low <= grid).all() and (grid <= swept.high).all()):
        raise InputError(
            f"Points of the {over} must be one or more numbers from {swept.low:g} to "
            f"{swept.high:g} {swept.unit}".rstrip()
            + "."
        )
    asked = Study.of(crane, control, **{**swept.study, **study})
    if over == "stick":
        asked = replace(asked, sea=None)
    elif over == "height" and asked.sea is not None:
        asked = replace(asked, sea=replace(asked.sea, sea=Spectrum(1.0, PERIOD)))
    none = asked.cases[NONE]
    variants = {name: case for name, case in asked.cases.items() if name == NONE or case != none}
    cases = [_at(over, float(x), case) for x in grid for case in variants.values()]
    # what does not depend on the point is simulated once
    single = [case for k, case in enumerate(cases) if case not in cases[:k]]
    every = asked.outcomes(single)[:, [single.index(each) for each in cases], :3]
    values = every.reshape(-1, grid.size, len(variants), 3)
    if over == "bearing":
        grid = np.radians(grid)
    return Sweep(over, grid, tuple(variants), values, crane, asked.sea)


def _at(over: str, x: float, case: Case) -> Case:
    """A case at a point of a sweep; no control and ideal drives do not know the orifice."""
    if over == "bearing":
        return case.moved(slew_deg=x)
    if over == "height":
        return case._replace(height=x)
    if over == "orifice":
        if case.setup["control"] is None or not case.driven:
            return case
        return case._replace(cranes=with_orifice(case.cranes, x))
    full = min(map(abs, case.cranes[0].inverse("slew").limits))
    length = float(np.ceil(np.radians(TURN) / (x * full) + 60.0))
    until = {"slew_deg": case.setup["slew_deg"] + TURN}
    return case._replace(stick=Stick.trapezoid(slew=x, until=until, length=length))


def with_orifice(cranes: tuple[Crane, ...], factor: float) -> tuple[Crane, ...]:
    """Cranes with another in-line orifice of their luff drives; the same ones for a factor of 1."""
    if factor == 1.0:
        return cranes
    return tuple(upgraded(crane, "luff", {"orifice": factor}) for crane in cranes)
