"""Judgment of control over seaways: does it work on the drives, and if not, what would do?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf, pi, sqrt
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, cast, overload

import numpy as np
from numpy.typing import NDArray

from swashplate.crane.axes import AXES, RATE, check_names
from swashplate.crane.control import Chain, Clip, PositionLoop
from swashplate.crane.crane import Crane
from swashplate.crane.following import follow
from swashplate.crane.result import PUMPS, CraneRun, limit_table
from swashplate.crane.rope import GRAVITY
from swashplate.crane.study import COUNTED, NONE, Case, Laws, Study, with_orifice
from swashplate.errors import InputError
from swashplate.results import GivenAxes, Tabular, figures
from swashplate.simulation.result import Limit
from swashplate.tables import Column, Table, count, listed

if TYPE_CHECKING:
    import polars
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

FACTORS = (1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0)
"""Factors on the luff's orifice that are tried, the smallest first."""
SHARES = (0.8, 0.6, 0.4)
"""Shares of what the luff can follow at which control is clipped on trial, the largest first."""
ENOUGH = (10, 20, 30, 50, 75, 100, 150, 200, 300, 500, 700, 1000, 1500, 2000, 3000, 5000, 10_000)
"""Numbers of seaways that are advised where fewer do not decide."""
BLOCK = 20
"""Seaways of a trial after which it is given up if it has failed already."""
LOOP = PositionLoop()
"""What a clip is tried with: a stiffer loop brings back what the clip takes."""


class Estimate(NamedTuple):
    """A number with its 95 % confidence interval."""

    value: float
    low: float
    high: float


def mean_of(values: Array, least: float = -inf) -> Estimate:
    """Mean of independent values with Student's interval; NaN are left out.

    Values that cannot be below `least`, as a swing not below 0, have no interval that reaches
    below it.

    Notes
    -----
    Seaways are drawn independently, so that differences within each are, too. Near the limit of a
    drive they are skewed: with few seaways Student's interval is too narrow on the long side, but
    a bootstrap of few values is narrower still; with 200 both agree.
    """
    from scipy.special import stdtrit

    known = values[np.isfinite(values)]
    mean = float(known.mean()) if known.size else np.nan
    if known.size < 2:
        return Estimate(mean, np.nan, np.nan)
    t = float(stdtrit(known.size - 1, 0.975))
    half = t * float(known.std(ddof=1)) / sqrt(known.size)
    return Estimate(mean, max(mean - half, least), mean + half)


def share_of(hits: int, seaways: int) -> Estimate:
    """Share of independent seaways with its exact interval (Clopper and Pearson 1934)."""
    from scipy.special import betaincinv

    low = float(betaincinv(hits, seaways - hits + 1, 0.025)) if hits > 0 else 0.0
    high = float(betaincinv(hits + 1, seaways - hits, 0.975)) if hits < seaways else 1.0
    return Estimate(hits / seaways, low, high)


def counted_words(share: Estimate, seaways: int) -> str:
    """A share of seaways in words: ``"2 of 37 seaways (95 % interval 0.7 to 18.2 %)"``."""
    low, high = 100.0 * share.low, 100.0 * share.high
    of = f"{round(share.value * seaways)} of {count(seaways, 'seaway')}"
    return f"{of} (95 % interval {low:.1f} to {high:.1f} %)"


def more_seaways(share: float, seaways: int, allowed: float) -> str:
    """How many more seaways than so many tell a share from the one allowed, if the share stays."""
    for more in ENOUGH:
        found = share_of(round(share * more), more)
        if more > seaways and not found.low <= allowed <= found.high:
            return f"about {more}"
    # a share as large as the one allowed: more seaways will first tell whether it stays so
    return f"{10 * seaways} to begin with"


class Remedy(NamedTuple):
    """A change with which control passes, or with which it is not decided whether it does."""

    what: str
    """In words: ``"luff orifice ×1.5"``."""
    size: float
    """Factor on the orifice, or size of the clip. [m]"""
    worse: Estimate
    """Share of seaways in which control is then worse than none."""
    swing: Estimate
    """Root mean square swing then. [rad]"""


@dataclass(frozen=True, eq=False)
class Judgment(Tabular):
    """Variants of control and drives in the same seaways, and what follows."""

    study: Study
    """Crane, variants, seaways, and from when on swing counts."""
    values: Array
    """(n, m, 18) of seaways and cases, `study.COUNTED`."""
    allowed: float
    """Share of seaways in which control may be worse than none."""
    remedies: tuple[Remedy, ...] = ()
    tried: tuple[str, ...] = ()
    """What was tried and is worse than none in more of the seaways than allowed."""

    def __repr__(self) -> str:
        return f"Judgment({count(len(self.study.seeds), 'seaway')}, {', '.join(self.names)})"

    @overload
    def plot(self, *, ax: None = None, title: str = "") -> Figure: ...

    @overload
    def plot(self, *, ax: GivenAxes, title: str = "") -> GivenAxes: ...

    def plot(
        self, *, ax: Axes | Sequence[Axes] | None = None, title: str = ""
    ) -> Figure | Axes | Sequence[Axes]:
        """Figure of the swing of every variant in every seaway, its mean and interval.

        By default a new figure; with `ax` it is drawn there, and `ax` returned.
        """
        return cast("Figure", figures().plot_judgment(self, ax=ax, title=title))

    @property
    def names(self) -> tuple[str, ...]:
        """Variants, the crane without control first."""
        return tuple(self.study.cases)

    @property
    def judged(self) -> str:
        """The variant that the verdict is on: the last one."""
        return self.names[-1]

    def counted(self, name: str, what: str = "rms_swing") -> Array:
        """(n,) number of a variant in each seaway, of `COUNTED`; NaN where it was stopped."""
        check_names("There is no variant", [name], self.names)
        return np.asarray(self.values[:, self.names.index(name), COUNTED.index(what)])

    def difference(self, name: str, other: str = NONE) -> Estimate:
        """Mean paired difference of the root mean square swing to another variant. [rad]"""
        return mean_of(self.counted(name) - self.counted(other))

    def worse(self, name: str) -> Estimate:
        """Share of seaways in which a variant swings more than no control, or was stopped."""
        worse = _worse(self.counted(name), self.counted(NONE))
        return share_of(int(worse.sum()), worse.size)

    def acting(self, name: str, axis: str, limit: Limit) -> float:
        """Mean share of time for which a limit of a drive acts; NaN if every run was stopped."""
        return mean_of(self.counted(name, f"{axis}_{str(limit.name).lower()}")).value

    @property
    def outcome(self) -> Literal["works", "fails", "not decided"]:
        """Whether the judged variant is worse than none as seldom as allowed, and has an effect.

        Not decided where the interval of the share in which it is worse holds the one allowed.
        """
        share = self.worse(self.judged)
        if share.low > self.allowed or self._idle:
            return "fails"
        return "works" if share.high <= self.allowed else "not decided"

    @property
    def passed(self) -> bool:
        """Whether the judged variant works."""
        return self.outcome == "works"

    @property
    def _idle(self) -> bool:
        """Whether the judged variant swings as no control does, in every seaway."""
        return np.allclose(self.counted(self.judged), self.counted(NONE), rtol=1e-3)

    @property
    def headline(self) -> str:
        """The outcome, the verdict, and whether they rest on a drive whose fit is not usable."""
        words = f"{self.outcome.capitalize()}: {self.verdict()}"
        case = self.study.cases[self.judged]
        unusable = {
            axis
            for crane in case.cranes
            for axis, source in crane.sources.items()
            if not source.usable
        }
        if not unusable:
            return words
        axes = listed([axis for axis in AXES if axis in unusable])
        return f"{words} It rests on the fit of the {axes}, which is not usable."

    def verdict(self) -> str:
        """What the judged variant amounts to, and what would do if it fails."""
        share, seaways, outcome = self.worse(self.judged), len(self.study.seeds), self.outcome
        worse = f"swing worse than none in {counted_words(share, seaways)}"
        none, own = (np.degrees(mean_of(self.counted(each)).value) for each in (NONE, self.judged))
        if outcome == "works":
            return (
                f"With the drives '{self.judged}' the controller brings the swing from {none:.2f} "
                f"to {own:.2f} deg RMS and makes {worse}."
            )
        if self._idle:
            return (
                f"With the drives '{self.judged}' the controller changes nothing: {none:.2f} deg "
                f"RMS without it, {own:.2f} with it, in {count(seaways, 'seaway')}."
            )
        if outcome == "not decided":
            return (
                f"With the drives '{self.judged}' the controller makes {worse}: that does not say "
                f"whether it is more than the {100.0 * self.allowed:g} % allowed. Run more seaways "
                f"({more_seaways(share.value, seaways, self.allowed)})."
            )
        said = (
            f"The controller makes {worse}: {none:.2f} deg RMS without it, {own:.2f} with it"
            f"{self._cause()}."
        )
        for each in self.remedies:
            more = more_seaways(each.worse.value, seaways, self.allowed)
            sure = each.worse.high <= self.allowed
            what = "would do" if sure else f"may do: run more seaways ({more})"
            said += f" {each.what.capitalize()} {what}."
        if self.tried and not self.remedies:
            said += f" None of these would do: {listed(self.tried)}."
        return said

    def _cause(self) -> str:
        """The limit that acts for the longest time."""
        if not self.study.cases[self.judged].driven:
            return ""
        names = {Limit.ORIFICE: "acceleration limit", Limit.SWASH_STOP: "speed limit"}
        shares = [(self.acting(self.judged, a, each), a, each) for a in AXES for each in names]
        share, axis, limit = max(shares, key=lambda each: np.nan_to_num(each[0]))
        if np.isnan(share):
            return "; it was stopped in all of them"
        return f", {axis} at its {names[limit]} {100.0 * share:.0f} % of the time"

    def run(self, name: str, seed: int) -> CraneRun:
        """The whole run of a variant in one seaway; a `DomainError` if it was stopped."""
        study = self.study
        if seed not in study.seeds or name not in self.names or study.sea is None:
            raise InputError(f"There is no seaway {seed} of a variant '{name}' in this judgment.")
        case = study.cases[name]
        motion = replace(study.sea, seed=seed).motion(round(case.stick.length * RATE) + 1)
        return case.run(study.seeds.index(seed), motion)

    @property
    def typical(self) -> int:
        """Seed of the seaway in which the judged variant swings as in half of them."""
        order = np.argsort(self.counted(self.judged))
        return self.study.seeds[int(order[len(order) // 2])]

    def tables(self) -> list[Table]:
        """Swing of each variant, how often it is worse, paired differences, limits, remedies."""
        seaways = len(self.study.seeds)
        interval = [Column(each, ".2f", "rad", none="–") for each in ("rms", "from", "to")]
        swings = Table(
            f"Swing in {count(seaways, 'seaway')}, means with 95 % intervals",
            (
                *(Column("variant", wrap=True), *interval),
                Column("largest", ".2f", "rad", none="–"),
                Column("stopped", "d"),
            ),
            "largest: median over the seaways of the largest swing",
        )
        share = [Column("worse than none", ".1%"), Column("from", ".1%"), Column("to", ".1%")]
        worse = Table(
            "More swing than without control, 95 % intervals",
            (Column("variant", wrap=True), Column("seaways", "d"), *share),
        )
        for name in self.names:
            rms, largest = self.counted(name), self.counted(name, "largest_swing")
            known = largest[np.isfinite(largest)]
            median = float(np.median(known)) if known.size else np.nan
            found = self.worse(name)
            look = found.value > self.allowed
            swings.add(name, *mean_of(rms, 0.0), median, int(np.isnan(rms).sum()), look=look)
            if name != NONE:
                worse.add(name, round(found.value * seaways), *found, look=look)
        spec = [Column(each, "+.2f", "rad", none="–") for each in ("difference", "from", "to")]
        heads = (Column("variant", wrap=True), Column("less", wrap=True), *spec)
        paired = Table("Differences of RMS swing within each seaway", heads)
        for i, other in enumerate(self.names):
            for name in self.names[i + 1 :]:
                paired.add(name, other, *self.difference(name, other))
        acting = [
            (name, axis, [self.acting(name, axis, each) for each in PUMPS])
            for name in self.names[1:]
            if self.study.cases[name].driven
            for axis in AXES
        ]
        columns = (Column("remedy"), *share, *interval)
        said = f"tried on the crane's own drives; a clip with a position loop of {LOOP.gain:g} /s"
        remedies = Table("Remedies", columns, said)
        for each in self.remedies:
            remedies.add(each.what, *each.worse, *each.swing)
        return [swings, worse, paired, limit_table(acting), *([remedies] if self.remedies else [])]

    def to_polars(self) -> polars.DataFrame:
        """Numbers of every variant in every seaway, SI, shares of time of limits."""
        import polars as pl

        rows = [
            {"seed": seed, "variant": name} | dict(zip(COUNTED, values.tolist(), strict=True))
            for seed, found in zip(self.study.seeds, self.values, strict=True)
            for name, values in zip(self.names, found, strict=True)
        ]
        return pl.DataFrame(rows)

    def _sentences(self) -> list[str]:
        return list(self.sentences()[1:])  # the first one is the headline

    def sentences(self) -> tuple[str, ...]:
        """The verdict, and what it rests on."""
        study, assumed = self.study, self.study.crane.assumed
        rests = (
            f"Swing counts from {study.start:g} s to {study.cases[NONE].stick.length:g} s of each "
            "seaway. Control works if it is worse than none in at most "
            f"{100.0 * self.allowed:g} % of them; the 95 % interval of that share decides."
        )
        crane = (f"{assumed} of the crane are assumed.",) if assumed else ()
        return (self.verdict(), rests, *crane, *study.provenance())


def _worse(own: Array, none: Array) -> NDArray[np.bool_]:
    """Seaways in which a variant swings more than no control, or was stopped where that was not."""
    return np.asarray((own > none) | (np.isnan(own) & np.isfinite(none)))


def judge(
    crane: Crane,
    control: Laws,
    *,
    allowed: float = 0.05,
    remedies: bool = True,
    **study: Any,
) -> Judgment:
    """Judge control on several sets of drives over seeded seaways, by default 200.

    Parameters
    ----------
    control : Control or mapping of str to Control
        One controller, or several by name.
    allowed : float
        Share of seaways in which control may be worse than none.
    remedies : bool
        Whether to look for a larger orifice of the luff and for a clip that would do on the crane's
        own drives, if control fails: the least of each that surely does, else the least that may.
    **study
        Seaways, drives, stick, where each run begins: see `Study.of`. The verdict is on the last of
        the drives.
    """
    if not 0.0 <= allowed < 1.0:
        raise InputError(
            f"allowed is {allowed:g}, but is a share of seaways: 0 to below 1, or below 100 %."
        )
    asked = Study.of(crane, control, **{"seeds": range(200), **study})
    made = Judgment(asked, asked.outcomes(list(asked.cases.values())), allowed)
    case = asked.cases[made.judged]
    law = case.setup["control"]
    if made.outcome != "fails" or not remedies or not case.driven or law is None:
        return made
    # factors are of the crane as it is built, whatever was judged
    cranes = (crane,) if len(case.cranes) == 1 else case.cranes
    stages = [each for each in law.stages if not isinstance(each, Clip | PositionLoop)]
    pose: dict[str, Any] = {name: case.setup[name] for name in ("slew_deg", "boom_deg", "rope_m")}
    period = 2.0 * pi * sqrt(pose["rope_m"] / GRAVITY)
    reach = float(follow(cranes[0], [period], seas=(), **pose).amplitude[0, 2])
    larger = [(f"luff orifice ×{x:g}", x, with_orifice(cranes, x), law) for x in FACTORS]
    clipped = [
        (f"a clip of {x * reach:.2g} m", x * reach, cranes, Chain((*stages, Clip(share=x), LOOP)))
        for x in SHARES
    ]
    found: list[Remedy] = []
    tried: list[str] = []
    for trials in (larger, clipped):
        may: list[Remedy] = []
        for what, size, built, control in trials:
            values = _trial(made, case.moved(control=control)._replace(cranes=built))
            if values is None:
                tried.append(what)
                continue
            worse = share_of(int(_worse(values, made.counted(NONE)).sum()), values.size)
            may.append(Remedy(what, size, worse, mean_of(values, 0.0)))
            if worse.high <= allowed:
                break
        # the last one if that surely does, else the least
        found += may[-1:] if may and may[-1].worse.high <= allowed else may[:1]
    return replace(made, remedies=tuple(found), tried=tuple(tried))


def _trial(judged: Judgment, case: Case) -> Array | None:
    """Root mean square swing of a trial in all seaways [rad]; None as soon as it has failed."""
    none, seaways = judged.counted(NONE), len(judged.study.seeds)
    made = np.zeros(0)
    for first in range(0, seaways, BLOCK):
        some = range(first, min(first + BLOCK, seaways))
        made = np.concatenate([made, judged.study.outcomes([case], some)[:, 0, 0]])
        if _worse(made, none[: made.size]).sum() > judged.allowed * seaways:
            return None
    return made
