"""Judgment of control over seaways: does it work on the drives, and if not, what would do?"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import reduce
from math import pi, sqrt
from operator import or_
from typing import TYPE_CHECKING, Any, NamedTuple, Unpack

import numpy as np
from numpy.typing import NDArray

from swashplate.analysis.whatif import pulled
from swashplate.crane.control import Clip, Control, PositionLoop
from swashplate.crane.crane import Crane
from swashplate.crane.following import follow
from swashplate.crane.result import CraneRun
from swashplate.crane.rope import GRAVITY
from swashplate.crane.stick import AXES
from swashplate.crane.study import COUNTED, IDEAL, NONE, PUMPS, Case, Study, StudySetup
from swashplate.errors import InputError
from swashplate.results import Tabular
from swashplate.simulation.result import Limit
from swashplate.tables import Column, Table, count, listed

if TYPE_CHECKING:
    import polars

Array = NDArray[np.float64]

FACTORS = (1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0)
"""Factors on the luff's orifice that are tried, the smallest first."""
SHARES = (0.8, 0.6, 0.4)
"""Shares of what the luff can follow at which control is clipped on trial, the largest first."""
BLOCK = 20
"""Seaways of a trial after which it is given up if it has failed already."""
LEVEL = 0.95
LOOP = PositionLoop()
"""What a clip is tried with: a stiffer loop brings back what the clip takes."""


class Estimate(NamedTuple):
    """A number with its 95 % confidence interval."""

    value: float
    low: float
    high: float


def mean_of(values: Array) -> Estimate:
    """Mean of independent values with Student's interval; NaN are left out.

    Notes
    -----
    Seaways are drawn independently, so that differences within each are, too. Near the limit of a
    drive they are skewed: with few seaways Student's interval is too narrow on the long side, but
    a bootstrap of few values is narrower still; with 200 both agree.
    """
    from scipy.special import stdtrit

    known = values[np.isfinite(values)]
    if not known.size:
        return Estimate(np.nan, np.nan, np.nan)
    mean = float(known.mean())
    if known.size < 2:
        return Estimate(mean, np.nan, np.nan)
    t = float(stdtrit(known.size - 1, 0.5 + 0.5 * LEVEL))
    half = t * float(known.std(ddof=1)) / sqrt(known.size)
    return Estimate(mean, mean - half, mean + half)


class Remedy(NamedTuple):
    """A change with which control passes."""

    what: str
    """In words: ``"luff orifice ×1.5"``."""
    size: float
    """Factor on the orifice, or size of the clip. [m]"""
    worse: float
    """Share of seaways in which control is then worse than none."""
    swing: Estimate
    """Root mean square swing then. [rad]"""


@dataclass(frozen=True, eq=False)
class Judgment(Tabular):
    """Variants of control and drives in the same seaways, and what follows."""

    study: Study
    """Crane, seaways, stick, and from when on swing counts."""
    cases: Mapping[str, Case]
    """By name, the crane without control first."""
    values: Array
    """(n, m, 17) of seaways and cases, `study.COUNTED`."""
    allowed: float
    """Share of seaways in which control may be worse than none."""
    remedies: tuple[Remedy, ...] = ()
    tried: tuple[str, ...] = ()
    """What was tried and does not do."""

    figure = "plot_judgment"

    def __repr__(self) -> str:
        return f"Judgment({count(len(self.study.seeds), 'seaway')}, {', '.join(self.names)})"

    @property
    def names(self) -> tuple[str, ...]:
        """Variants, the crane without control first."""
        return tuple(self.cases)

    @property
    def judged(self) -> str:
        """The variant that the verdict is on: the last one."""
        return self.names[-1]

    def rms(self, name: str) -> Array:
        """(n,) root mean square swing of a variant in each seaway, NaN where it was stopped. [rad]

        Raises
        ------
        InputError
            If there is no such variant.
        """
        return np.asarray(self.values[:, self._place(name), 0])

    def largest(self, name: str) -> Array:
        """(n,) largest swing of a variant in each seaway. [rad]"""
        return np.asarray(self.values[:, self._place(name), 1])

    def _place(self, name: str) -> int:
        if name not in self.cases:
            raise InputError(f"There is no variant '{name}'; there are {', '.join(self.names)}.")
        return self.names.index(name)

    def difference(self, name: str, other: str = NONE) -> Estimate:
        """Mean paired difference of the root mean square swing to another variant. [rad]"""
        return mean_of(self.rms(name) - self.rms(other))

    def worse(self, name: str) -> float:
        """Share of seaways in which a variant swings more than no control, or was stopped."""
        return float(_worse(self.rms(name), self.rms(NONE)).mean())

    def acting(self, name: str, axis: str, limit: Limit) -> float:
        """Mean share of time for which a limit of a drive acts; NaN if every run was stopped."""
        column = COUNTED.index(f"{axis}_{str(limit.name).lower()}")
        return mean_of(self.values[:, self._place(name), column]).value

    @property
    def passed(self) -> bool:
        """Whether the judged variant is worse than none in no more seaways than allowed."""
        return self.worse(self.judged) <= self.allowed

    def verdict(self) -> str:
        """What the judged variant amounts to, and what would do if it fails."""
        share, n = self.worse(self.judged), len(self.study.seeds)
        none, own = (np.degrees(mean_of(self.rms(each)).value) for each in (NONE, self.judged))
        if self.passed:
            return (
                f"With the drives '{self.judged}' the controller brings the swing from {none:.2f} "
                f"to {own:.2f} deg RMS and makes it worse than none in {_percent(share)} of "
                f"{count(n, 'seaway')}."
            )
        said = (
            f"The controller makes swing worse than none in {_percent(share)} of "
            f"{count(n, 'seaway')} ({none:.2f} deg RMS without, {own:.2f} with it)"
        )
        said += f"{self._cause()}."
        if self.remedies:
            said += f" {' or '.join(each.what for each in self.remedies).capitalize()} would do."
        elif self.tried:
            said += f" None of these would do: {listed(self.tried)}."
        return said

    def _cause(self) -> str:
        """The limit that acts for the longest time."""
        if self.cases[self.judged].actuation == IDEAL:
            return ""
        names = {Limit.ORIFICE: "acceleration limit", Limit.SWASH_STOP: "speed limit"}
        shares = {
            (axis, limit): self.acting(self.judged, axis, limit) for axis in AXES for limit in names
        }
        (axis, limit), share = max(shares.items(), key=lambda each: np.nan_to_num(each[1]))
        if np.isnan(share):
            return ", and was stopped in all of them"
        return f": {axis} at its {names[limit]} {_percent(share)} of the time"

    def run(self, name: str, seed: int) -> CraneRun:
        """The whole run of a variant in one seaway, with all signals.

        Raises
        ------
        InputError
            If there is no such variant, or the seaway was not of the judgment.
        DomainError
            If the run was stopped.
        """
        if seed not in self.study.seeds:
            raise InputError(f"There is no seaway {seed} in this judgment.")
        case = self.cases[self.names[self._place(name)]]
        crane = case.cranes[self.study.seeds.index(seed) % len(case.cranes)]
        sea, law = replace(self.study.sea, seed=seed), case.control
        how: dict[str, Any] = {"actuation": case.actuation, **case.where}
        return crane.simulate(self.study.stick, sea=sea, control=law, **how)

    @property
    def typical(self) -> int:
        """Seed of the seaway in which the judged variant swings as in half of them."""
        order = np.argsort(self.rms(self.judged))
        return self.study.seeds[int(order[len(order) // 2])]

    def tables(self) -> list[Table]:
        """Swing of each variant, paired differences, limits, and what was tried."""
        return [self._swings(), self._differences(), self._limits(), *self._remedies()]

    def _swings(self) -> Table:
        title = f"Swing in {count(len(self.study.seeds), 'seaway')}, means with 95 % intervals"
        columns = (
            *(Column("variant"), *_interval(".2f", "rms")),
            Column("largest", ".2f", "rad", none="–"),
            *(Column("worse than none", ".0%", none="–"), Column("stopped", "d")),
        )
        made = Table(title, columns, "largest: median over the seaways of the largest swing")
        for name in self.names:
            rms, largest = self.rms(name), self.largest(name)
            worse = None if name == NONE else self.worse(name)
            look = worse is not None and worse > self.allowed
            middle = float(np.nanmedian(largest)) if np.isfinite(largest).any() else np.nan
            stopped = int(np.isnan(rms).sum())
            made.add(name, *mean_of(rms), middle, worse, stopped, look=look)
        return made

    def _differences(self) -> Table:
        columns = (*(Column("variant"), Column("less"), *_interval("+.2f", "difference")),)
        made = Table("Differences of RMS swing within each seaway", columns)
        names = self.names
        for i, other in enumerate(names):
            for name in names[i + 1 :]:
                made.add(name, other, *self.difference(name, other))
        return made

    def _limits(self) -> Table:
        heads = [str(each.name).lower().replace("_", " ") for each in PUMPS]
        shares = (Column(each, ".1%", none="–") for each in heads)
        columns = (Column("variant"), Column("axis"), *shares)
        made = Table("Share of time for which limits act", columns)
        for name in self.names[1:]:
            for axis in AXES if self.cases[name].actuation != IDEAL else ():
                made.add(name, axis, *(self.acting(name, axis, each) for each in PUMPS))
        return made

    def _remedies(self) -> list[Table]:
        if not self.remedies:
            return []
        columns = (*(Column("remedy"), Column("worse than none", ".0%"), *_interval(".2f", "rms")),)
        said = f"tried on the crane's own drives; a clip with a position loop of {LOOP.gain:g} /s"
        made = Table("What would do", columns, said)
        for each in self.remedies:
            made.add(each.what, each.worse, *each.swing)
        return [made]

    def to_polars(self) -> polars.DataFrame:
        """Numbers of every variant in every seaway, SI, shares of time of limits."""
        import polars as pl

        rows = [
            {"seed": seed, "variant": name} | dict(zip(COUNTED, values.tolist(), strict=True))
            for seed, found in zip(self.study.seeds, self.values, strict=True)
            for name, values in zip(self.names, found, strict=True)
        ]
        return pl.DataFrame(rows)

    def sentences(self) -> tuple[str, ...]:
        """The verdict, and what it rests on."""
        study, assumed = self.study, self.study.crane.assumed
        rests = (
            f"Swing counts from {study.start:g} s to {study.stick.length:g} s of each seaway. "
            f"Control fails if it is worse than none in more than {_percent(self.allowed)} of them."
        )
        crane = (f"{assumed} of the crane are assumed.",) if assumed else ()
        return (self.verdict(), rests, *crane)


def _interval(spec: str, name: str) -> tuple[Column, ...]:
    """Columns of an `Estimate` of swing."""
    return tuple(Column(each, spec, "rad", none="–") for each in (name, "from", "to"))


def _percent(share: float) -> str:
    return f"{100.0 * share:.0f} %"


def _worse(own: Array, none: Array) -> NDArray[np.bool_]:
    """Seaways in which a variant is worse than none."""
    stopped = np.isnan(own) & np.isfinite(none)
    return np.asarray((own > none) | stopped)


def judge(
    crane: Crane,
    control: Control | Mapping[str, Control],
    *,
    allowed: float = 0.05,
    remedies: bool = True,
    **setup: Unpack[StudySetup],
) -> Judgment:
    """Judge control on several sets of drives over seeded seaways, by default 200.

    Parameters
    ----------
    crane : Crane
    control : Control or mapping of str to Control
        One controller, or several by name.
    allowed : float
        Share of seaways in which control may be worse than none.
    remedies : bool
        Whether to look for a larger orifice of the luff and for a clip that would do on the crane's
        own drives, if control fails.
    **setup
        Seaways, drives, stick, where each run begins: see `StudySetup`. The verdict is on the last
        of the drives.

    Raises
    ------
    InputError
        For seeds, drives or a start that make no study, or a pose beyond the crane's limits.
    """
    if not 0.0 <= allowed < 1.0:
        raise InputError(f"allowed is {allowed:g}, but is a share of seaways: 0 to below 1.")
    study = Study.of(crane, control, setup, seeds=range(200))
    cases = study.cases()
    made = Judgment(study, cases, study.outcomes(list(cases.values())), allowed)
    if made.passed or not remedies or cases[made.judged].actuation == IDEAL:
        return made
    found, tried = _search(made)
    return replace(made, remedies=found, tried=tried)


def _search(judged: Judgment) -> tuple[tuple[Remedy, ...], tuple[str, ...]]:
    """The smallest factor on the luff's orifice and the largest clip with which control passes."""
    case = judged.cases[judged.judged]
    law, where = case.control, case.where
    assert law is not None
    if len(case.cranes) == 1:  # factors are of the crane as it is built, whatever was judged
        case = case._replace(cranes=(judged.study.crane,))
    stages = [each for each in law.stages if not isinstance(each, Clip | PositionLoop)]
    period = 2.0 * pi * sqrt(where["rope_m"] / GRAVITY)
    boom, rope = where["boom_deg"], where["rope_m"]
    reach = follow(case.cranes[0], [period], seas=(), boom_deg=boom, rope_m=rope).amplitude[0, 2]

    def larger(factor: float) -> tuple[str, float, Case]:
        cranes = tuple(
            each.with_drive(luff=pulled(each.luff, {"orifice": factor})) for each in case.cranes
        )
        return f"luff orifice ×{factor:g}", factor, case._replace(cranes=cranes)

    def clipped(share: float) -> tuple[str, float, Case]:
        law = reduce(or_, [*stages, Clip(share=share)])
        what = f"a clip of {share * reach:.2g} m"
        return what, share * reach, case._replace(control=law | LOOP)

    found: list[Remedy] = []
    tried: list[str] = []
    for trials in (map(larger, FACTORS), map(clipped, SHARES)):
        for what, size, trial in trials:
            values = _trial(judged, trial)
            if values is None:
                tried.append(what)
                continue
            worse = float(_worse(values, judged.rms(NONE)).mean())
            found.append(Remedy(what, float(size), worse, mean_of(values)))
            break
    return tuple(found), tuple(tried)


def _trial(judged: Judgment, case: Case) -> Array | None:
    """Root mean square swing of a trial in all seaways [rad]; None as soon as it has failed."""
    none, count = judged.rms(NONE), len(judged.study.seeds)
    made = np.zeros(0)
    for first in range(0, count, BLOCK):
        some = range(first, min(first + BLOCK, count))
        made = np.concatenate([made, judged.study.outcomes([case], some)[:, 0, 0]])
        if _worse(made, none[: made.size]).sum() > judged.allowed * count:
            return None
    return made
