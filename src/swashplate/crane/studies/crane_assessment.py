"""Assessment of control over many seaways: does it harm, does it suffice, and what would?

Two questions have two answers. *Harm*: in which share of seaways is the swing larger than without
control? *Sufficiency*: does all that has a limit stay within it in a sea of three hours?
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, nan, radians
from typing import TYPE_CHECKING, ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.crane.axes import AXES, check_names
from swashplate.crane.closed_loop.result import (
    FARTHEST_SWING,
    PUMPS,
    CraneRun,
    limit_table,
)
from swashplate.crane.control import PositionLoop
from swashplate.crane.limits import LIMITED
from swashplate.crane.sea.confidence import (
    ConfidenceInterval,
    mean_of,
    more_seaways,
    rms_of,
    share_in_seaways,
    share_of,
)
from swashplate.crane.sea.transfer_functions import CRANE_SHIP, Hull
from swashplate.crane.studies.assumptions import TippingPoint
from swashplate.crane.studies.judging import (
    AssessedQuantity,
    Decision,
    Judgement,
    assessed_limits,
    judge,
    largest_of,
)
from swashplate.crane.studies.run_outcome import RunOutcome
from swashplate.crane.studies.spectral import LinearResponse
from swashplate.crane.studies.study import (
    CALM,
    CREW_ASSUMED,
    CREW_NOT_MODELLED,
    NO_CONTROL,
    Study,
    assumed_sentences,
)
from swashplate.drive import Limit
from swashplate.results import Drawn, Tabular
from swashplate.tables import Column, Table, count, listed

if TYPE_CHECKING:
    import polars

Array = NDArray[np.float64]
Question = Literal["harm", "sufficiency"]
QUESTIONS: tuple[Question, ...] = ("harm", "sufficiency")

LOOP = PositionLoop()
"""Position loop with which clips are tried: a stiff one compensates for the motion clipped."""
NO_TIPPING_POINT = (
    "In short runs, no other value tried for damping, roll period, height, period, peak factor, "
    "heading or drum, each alone, clearly changes the answer."
)
IDLE = 1e-3
"""Relative difference of the swing below which control changes nothing."""


class Remedy(NamedTuple):
    """A change that was tried on the crane's own drives."""

    change: str
    """Its description: ``"luff orifice ×1.5"``."""
    size: float
    """Factor on the orifice [1], or size of the clip [m]."""
    harmless: Decision
    """Whether control with the change is worse than none at most as often as allowed."""
    sufficient: Decision | None
    """Whether all quantities stay within their limits; None if that is not a question."""
    share_worse: ConfidenceInterval
    """Share of seaways in which control with the change is worse than none."""
    swing: ConfidenceInterval
    """Root mean square swing with the change. [rad]"""
    beyond: tuple[str, ...]
    """Descriptions of the quantities that exceed their limits."""

    @property
    def passes(self) -> bool:
        """Whether it surely does all that was asked."""
        return self.harmless == "yes" and self.sufficient in ("yes", None)


@dataclass(frozen=True, eq=False)
class Assessment(Tabular, Drawn):
    """Variants of control and drives in the same seaways, and what follows."""

    drawn_by: ClassVar[str] = "plot_assessment"

    study: Study
    """Crane, variants, seaways, and for how long each counts."""
    outcomes: tuple[tuple[RunOutcome, ...], ...]
    """Of every seaway, in the order of the variants."""
    allowed_share_worse: float
    """Share of seaways in which control may be worse than none."""
    questions: tuple[Question, ...]
    """Questions that `passed` answers."""
    linear: LinearResponse | None
    """The crane without control in the frequency domain; None if its swing is not damped."""
    remedies: tuple[Remedy, ...] = ()
    tried: tuple[str, ...] = ()
    """Other changes that were tried, and that do not meet all requirements."""
    tipping_points: tuple[TippingPoint, ...] | None = None
    """Assumed or given numbers that would turn the answer, if they were others; None if none were
    looked for."""

    def __repr__(self) -> str:
        return f"Assessment({count(len(self.study.seeds), 'seaway')}, {', '.join(self.names)})"

    # --- numbers of variants ----------------------------------------------------------------------

    @property
    def names(self) -> tuple[str, ...]:
        """Variants, the crane without control first."""
        return tuple(self.study.cases)

    @property
    def assessed_variant(self) -> str:
        """The variant that the verdict is on: the last one."""
        return self.names[-1]

    def of(self, name: str) -> list[RunOutcome]:
        """Outcomes of a variant in each seaway."""
        check_names("There is no variant", [name], self.names)
        return [outcomes[self.names.index(name)] for outcomes in self.outcomes]

    def swing(self, name: str) -> Array:
        """(n,) root mean square swing in each seaway [rad]; NaN if it left the model there."""
        return np.array([outcome.rms_swing for outcome in self.of(name)])

    def departures(self, name: str) -> dict[str, int]:
        """Number of seaways in which a variant is not an operation any more, by reason."""
        reasons = [
            outcome.departure_reason for outcome in self.of(name) if outcome.departure_reason
        ]
        return {reason: reasons.count(reason) for reason in dict.fromkeys(reasons)}

    def difference(self, name: str, other: str = NO_CONTROL) -> ConfidenceInterval:
        """Mean paired difference of the root mean square swing to another variant. [rad]"""
        return mean_of(self.swing(name) - self.swing(other))

    def share_worse(self, name: str) -> ConfidenceInterval:
        """Share of seaways in which a variant swings more than no control.

        One that leaves the model, or is stopped, is worse than one that does not; if both do, that
        seaway is not decided.
        """
        return share_worse_of(self.of(name), self.of(NO_CONTROL))

    def limited(self, name: str) -> tuple[AssessedQuantity, ...]:
        """Quantities of a variant that have a limit."""
        return assessed_limits(self.of(name), self.study.crane.limits_si)

    def acting(self, name: str, axis: str, limit: Limit) -> float:
        """Mean share of time for which a limit of a drive acts; NaN if every run was stopped."""
        shares = [outcome.limits[AXES.index(axis), PUMPS.index(limit)] for outcome in self.of(name)]
        return mean_of(np.array(shares)).value

    # --- answers ----------------------------------------------------------------------------------

    @property
    def harmless(self) -> Decision:
        """Whether the assessed variant is worse than none at most as often as allowed."""
        share = self.share_worse(self.assessed_variant)
        if share.low > self.allowed_share_worse:
            return "no"
        return "yes" if share.high <= self.allowed_share_worse else "not decided"

    @property
    def judgement(self) -> Judgement:
        """The assessed variant held against its limits, and against leaving the model."""
        return judge(
            self.of(self.assessed_variant),
            self.study.crane.limits_si,
            length=self.study.length,
            allowed=self.allowed_share_worse,
        )

    @property
    def sufficient(self) -> Decision | None:
        """Whether all stays within its limits in three hours; None if the crane has no limits.

        With a run that left the model it is never yes; see `Judgement.stays`.
        """
        return self.judgement.sufficient if self.study.crane.limits else None

    @property
    def stays(self) -> Decision:
        """Whether the assessed variant stays in the model: `Judgement.stays`."""
        return self.judgement.stays

    @property
    def share_of_failed_starts(self) -> ConfidenceInterval:
        """Share of switchings-on after which the assessed variant leaves the model."""
        return self.judgement.share_of_failed_starts

    @property
    def idle(self) -> bool:
        """Whether the assessed variant swings as no control does, in every seaway."""
        controlled = self.swing(self.assessed_variant)
        same = np.allclose(controlled, self.swing(NO_CONTROL), rtol=IDLE, equal_nan=True)
        return bool(same and np.isfinite(controlled).any())

    @property
    def passed(self) -> bool:
        """Whether all questions asked are answered with yes, and control has an effect."""
        answers: dict[Question, Decision | None] = {
            "harm": self.harmless,
            "sufficiency": self.sufficient,
        }
        return not self.idle and all(answers[question] == "yes" for question in self.questions)

    @property
    def outcome(self) -> Literal["passes", "fails", "not decided"]:
        """Passes if `passed`; not decided if more seaways could decide; else fails."""
        if self.passed:
            return "passes"
        answers = [self.harmless] if "harm" in self.questions else []
        if "sufficiency" in self.questions and self.sufficient is not None:
            answers.append(self.sufficient)
        return "fails" if "no" in answers or self.idle else "not decided"

    @property
    def headline(self) -> str:
        """The outcome, both answers, and whether they rest on a drive that is not usable."""
        outcome_and_verdict = f"{self.outcome.capitalize()}: {self.verdict()}"
        return " ".join(filter(None, [outcome_and_verdict, self.unusable_sentence()]))

    def unusable_sentence(self) -> str:
        """Name unusable fits of the assessed variant's drives; empty if there are none."""
        case = self.study.cases[self.assessed_variant]
        unusable = set[str]()
        for crane in case.cranes:
            unusable.update(axis for axis, source in crane.sources.items() if not source.usable)
        if not unusable:
            return ""
        axes = listed([axis for axis in AXES if axis in unusable])
        return f"It is based on the fit of the {axes}, which is not usable."

    def verdict(self) -> str:
        """Both answers on the assessed variant, and what would do if it fails."""
        sentences = [self.harm_sentence(), self.sufficiency_sentence(), *self.remedy_sentences()]
        return " ".join(filter(None, sentences))

    def harm_sentence(self) -> str:
        """Say whether the assessed variant harms, and by how much it changes the swing."""
        share = self.share_worse(self.assessed_variant)
        seaways = len(self.study.seeds)
        without = np.degrees(rms_of(self.swing(NO_CONTROL)).value)
        controlled = np.degrees(rms_of(self.swing(self.assessed_variant)).value)
        drives = f"With the drives '{self.assessed_variant}' the controller"
        if self.idle:
            return (
                f"{drives} changes nothing: {without:.2f} deg RMS without it, {controlled:.2f} "
                f"with it, in {count(seaways, 'seaway')}."
            )
        worse = f"swing worse than none in {share_in_seaways(share, seaways)}"
        rms = _rms_clause(without, controlled)
        if self.harmless == "yes":
            return f"{drives} does no harm: it makes {worse}{rms}."
        if self.harmless == "no":
            return f"{drives} harms: it makes {worse}{rms}{self._cause()}."
        pairs = zip(self.of(self.assessed_variant), self.of(NO_CONTROL), strict=True)
        undecided = sum(bool(run.departure_reason and none.departure_reason) for run, none in pairs)
        if undecided:
            return (
                f"{drives} makes {worse}; in {undecided} both leave the model, so whether control "
                "harms is not decided: use a smaller sea."
            )
        return (
            f"{drives} makes {worse}: too few to decide whether it is more than the "
            f"{100.0 * self.allowed_share_worse:g} % allowed. Run more seaways "
            f"({more_seaways(share.value, seaways, self.allowed_share_worse)})."
        )

    def sufficiency_sentence(self) -> str:
        """Say whether the assessed variant stays within all limits; empty without limits."""
        if self.sufficient is None:
            return ""
        limited = self.limited(self.assessed_variant)
        beyond = [quantity.description() for quantity in limited if quantity.within == "no"]
        undecided = [
            quantity.description() for quantity in limited if quantity.within == "not decided"
        ]
        if self.sufficient == "yes":
            return "It suffices: in 3 h all quantities stay within their limits."
        departed = self._departure_clause()
        if self.sufficient == "no":
            causes = beyond + ([departed] if self.stays == "no" else [])
            return f"It does not suffice: in 3 h {'; '.join(causes)}."
        if departed:
            return f"Whether it suffices is not decided: {departed}. Run more seaways."
        return (
            f"Whether it suffices is not decided: in 3 h {'; '.join(undecided)}. Run more seaways."
        )

    def _departure_clause(self) -> str:
        """Say how often the assessed variant leaves the model; empty if it never does."""
        departures = sum(self.departures(self.assessed_variant).values())
        share = self.share_of_failed_starts
        seaways = len(self.study.seeds)
        failed = round(share.value * seaways)
        clauses = []
        if failed:
            in_seaways = share_in_seaways(share, seaways)
            clauses.append(f"it leaves the model after it is switched on in {in_seaways}")
        if departures > failed:
            clauses.append(f"it leaves the model later in {count(departures - failed, 'seaway')}")
        return "; ".join(clauses)

    def remedy_sentences(self) -> list[str]:
        """A sentence for each remedy, or that no tried one suffices; empty if none was tried."""
        if self.tried and not self.remedies:
            return [f"None of these is sufficient: {listed(self.tried)}."]
        sentences = [self._remedy_sentence(remedy) for remedy in self.remedies]
        if self.remedies and not any(remedy.passes for remedy in self.remedies):
            sentences.append("No change that was tried certainly meets all requirements.")
        return sentences

    def _remedy_sentence(self, remedy: Remedy) -> str:
        change = remedy.change.capitalize()
        if remedy.harmless == "not decided":
            seaways = len(self.study.seeds)
            more = more_seaways(remedy.share_worse.value, seaways, self.allowed_share_worse)
            if remedy.sufficient == "no":
                beyond = "; ".join(remedy.beyond)
                return f"{change} may do no harm, but would not suffice: in 3 h {beyond}."
            return f"{change} may be sufficient: run more seaways ({more})."
        if remedy.passes:
            return f"{change} would do."
        if remedy.sufficient == "not decided":
            return f"{change} would do no harm, and may suffice: run more seaways."
        return f"{change} would do no harm, but not suffice: in 3 h {'; '.join(remedy.beyond)}."

    def _cause(self) -> str:
        """The limit that acts for the longest time."""
        if not self.study.cases[self.assessed_variant].driven:
            return ""
        names = {Limit.ORIFICE: "acceleration limit", Limit.SWASH_STOP: "speed limit"}
        shares = [
            (self.acting(self.assessed_variant, axis, limit), axis, limit)
            for axis in AXES
            for limit in names
        ]
        share, axis, limit = max(shares, key=lambda entry: float(np.nan_to_num(entry[0])))
        if np.isnan(share):
            return "; it was stopped in all of them"
        return f", {axis} at its {names[limit]} {100.0 * share:.0f} % of the time"

    # --- runs, tables -----------------------------------------------------------------------------

    def run(self, name: str, seed: int) -> CraneRun:
        """The whole run of a variant in one seaway; a `DomainError` if it is stopped."""
        return self.study.run(name, seed)

    @property
    def typical(self) -> int:
        """Seed of the seaway in which the assessed variant swings as in half of them."""
        order = np.argsort(self.swing(self.assessed_variant))
        return self.study.seeds[int(order[len(order) // 2])]

    def tables(self) -> list[Table]:
        """Swing, how often it is worse, what has a limit, differences, drives' limits, remedies."""
        driven = [name for name in self.names[1:] if self.study.cases[name].driven]
        acting = [
            (name, axis, [self.acting(name, axis, limit) for limit in PUMPS])
            for name in driven
            for axis in AXES
        ]
        tables = [self._swing_table(), self._worse_table()]
        if self.study.crane.limits:
            tables.append(self._limit_table())
        tables += [self._difference_table(), limit_table(acting)]
        if self.remedies:
            tables.append(self._remedy_table())
        return tables

    def _swing_table(self) -> Table:
        seaways = len(self.study.seeds)
        minutes = self.study.length / 60.0
        interval = [Column(heading, ".2f", "rad", none="–") for heading in ("rms", "from", "to")]
        table = Table(
            f"Swing in {count(seaways, 'seaway')} of {minutes:g} min, 95 % intervals",
            (
                Column("variant", wrap=True),
                *interval,
                Column("in 3 h", ".2f", "rad", none="–"),
                Column("left the model", "d"),
            ),
            f"in 3 h: most probable largest swing; – if a run left the model, more than "
            f"{FARTHEST_SWING:g} deg. Runs that left the model are not in the RMS",
        )
        for name in self.names:
            rms = rms_of(self.swing(name))
            table.add(
                name,
                rms.value,
                rms.low,
                rms.high,
                largest_of(self.of(name), "swing").value,
                sum(self.departures(name).values()),
                look=name != NO_CONTROL and self.share_worse(name).value > self.allowed_share_worse,
            )
            if name == NO_CONTROL and self.linear is not None:
                swing = self.linear.values["swing"]
                table.add(
                    f"{NO_CONTROL}, by its spectrum",
                    swing.rms,
                    nan,
                    nan,
                    _in_model(swing.largest),
                    0,
                )
        return table

    def _worse_table(self) -> Table:
        shares = [Column("worse than none", ".1%"), Column("from", ".1%"), Column("to", ".1%")]
        columns = (Column("variant", wrap=True), Column("seaways", "d"), *shares)
        table = Table("More swing than without control, 95 % intervals", columns)
        seaways = len(self.study.seeds)
        for name in self.names[1:]:
            share_worse = self.share_worse(name)
            table.add(
                name,
                round(share_worse.value * seaways),
                share_worse.value,
                share_worse.low,
                share_worse.high,
                look=share_worse.value > self.allowed_share_worse,
            )
        return table

    def _limit_table(self) -> Table:
        """Limited quantities of the assessed variant, with their values without control."""
        columns = (
            Column("quantity"),
            Column("unit"),
            Column("limit", ".3g", none="–"),
            Column("in 3 h", ".3g", none="–"),
            Column("from", ".3g", none="–"),
            Column("to", ".3g", none="–"),
            Column("within"),
            Column(NO_CONTROL, ".3g", none="–"),
        )
        table = Table(
            f"Limits, '{self.assessed_variant}'",
            columns,
            "in 3 h: most probable largest value; – if a run left the model",
        )
        uncontrolled = {
            quantity.name: quantity.largest.value for quantity in self.limited(NO_CONTROL)
        }
        for quantity in self.limited(self.assessed_variant):
            unit, factor = quantity.shown_unit
            without_control = uncontrolled.get(quantity.name, nan)
            known = (nan,) * 3 if quantity.largest.high == inf else quantity.largest
            numbers = (quantity.limit, *known, without_control)
            # a side-lead without waves across the boom is 0, not a millionth of a degree
            limit, largest, low, high, without = (round(factor * value, 3) for value in numbers)
            table.add(
                LIMITED[quantity.name].label,
                unit,
                limit,
                largest,
                low,
                high,
                quantity.within,
                without,
                look=quantity.within != "yes",
            )
        return table

    def _difference_table(self) -> Table:
        columns = (
            Column("variant", wrap=True),
            Column("less", wrap=True),
            Column("difference", "+.2f", "rad", none="–"),
            Column("from", "+.2f", "rad", none="–"),
            Column("to", "+.2f", "rad", none="–"),
        )
        table = Table("Differences of RMS swing within each seaway", columns)
        for index, subtracted in enumerate(self.names):
            for name in self.names[index + 1 :]:
                table.add(name, subtracted, *self.difference(name, subtracted))
        return table

    def _remedy_table(self) -> Table:
        share = [Column("worse than none", ".1%"), Column("from", ".1%"), Column("to", ".1%")]
        interval = [Column(heading, ".2f", "rad", none="–") for heading in ("rms", "from", "to")]
        note = f"tried on the crane's own drives; a clip with a position loop of {LOOP.gain:g} /s"
        table = Table("Remedies", (Column("remedy"), *share, *interval), note)
        for remedy in self.remedies:
            table.add(remedy.change, *remedy.share_worse, *remedy.swing)
        return table

    def to_polars(self) -> polars.DataFrame:
        """Numbers of every variant in every seaway, SI, shares of time of limits."""
        import polars as pl

        limits = [f"{axis}_{str(limit.name).lower()}" for axis in AXES for limit in PUMPS]
        rows = []
        for seed, outcomes in zip(self.study.seeds, self.outcomes, strict=True):
            for name, outcome in zip(self.names, outcomes, strict=True):
                row = {"seed": seed, "variant": name, "rms_swing": outcome.rms_swing}
                row |= {
                    "largest_swing": outcome.largest_swing,
                    "departure": outcome.departure_reason,
                }
                row |= dict(zip(limits, outcome.limits.ravel().tolist(), strict=True))
                rows.append(row)
        return pl.DataFrame(rows)

    def _sentences(self) -> list[str]:
        return list(self.sentences()[1:])  # the first one is the headline

    def sentences(self) -> tuple[str, ...]:
        """The verdict, its basis, and what would change it."""
        study = self.study
        sentences = [self.verdict(), *self._basis()]
        for name in self.names:
            for reason, seaways in self.departures(name).items():
                of = count(len(study.seeds), "seaway")
                sentences.append(
                    f"'{name}' is not a valid operation in {seaways} of {of}: {reason}."
                )
        if self.tipping_points is not None:
            tipping_points = [point.sentence() for point in self.tipping_points]
            sentences += tipping_points or [NO_TIPPING_POINT]
        sentences += study.seaway.sentences()
        return (*sentences, *study.provenance())

    def _basis(self) -> list[str]:
        """State the basis of the answers, in sentences."""
        study = self.study
        crane = study.crane
        none = study.cases[NO_CONTROL]
        start = "a stationary swing" if none.swing_damping > 0.0 else "rest, as it is undamped"
        rule = (
            f"Each seaway is evaluated for {study.length:g} s after {study.run_in:g} s from "
            f"{start}. Control harms if it is worse than none in more than "
            f"{100.0 * self.allowed_share_worse:g} % of them; the 95 % interval of that share "
            "decides."
        )
        seaway = study.seaway
        spectrum = seaway.spectrum
        waves = (
            f"Waves of {spectrum.height:g} m with a peak at {spectrum.period:g} s and a peak "
            f"factor of {spectrum.peak_factor:g}, at a heading of {seaway.heading_deg:g} deg."
        )
        damping_assumed = (
            "swing_damping" not in none.hangs
            and crane.quantities["swing_damping"].status == "assumed"
        )
        damping = f"The load's swing has a damping of {100.0 * none.swing_damping:g} %"
        case = study.cases[self.assessed_variant].sentence()
        sentences = [
            case,
            rule,
            waves,
            f"{damping}, assumed." if damping_assumed else f"{damping}.",
        ]
        ship = seaway.ship
        if isinstance(ship, Hull):
            roll = f"The ship's roll period is {ship.roll_period:g} s"
            sentences.append(f"{roll}, assumed." if ship == CRANE_SHIP else f"{roll}.")
        peak = 1.0 / spectrum.period
        for axis, source in crane.sources.items():
            if 0.0 < source.fastest_sine < peak:
                sentences.append(
                    f"The waves' peak is at {peak:.3g} Hz, but the {axis}'s drive was tested with "
                    f"sines of up to {source.fastest_sine:.3g} Hz: test it faster."
                )
        unworkable = any(quantity.within == "no" for quantity in self.limited(NO_CONTROL))
        if self.study.crewed:
            sentences.append(CREW_ASSUMED)
        elif unworkable and spectrum.height <= CALM:
            sentences.append(CREW_NOT_MODELLED)
        return [*sentences, *assumed_sentences(crane)]


def _rms_clause(without: float, controlled: float) -> str:
    """Swing without control and with it [deg], as far as either is known."""
    without_it = "not an operation" if np.isnan(without) else f"{without:.2f} deg RMS"
    with_it = "not an operation" if np.isnan(controlled) else f"{controlled:.2f}"
    return f": {without_it} without it, {with_it} with it"


def share_worse_of(
    controlled: Sequence[RunOutcome], uncontrolled: Sequence[RunOutcome]
) -> ConfidenceInterval:
    """Share of seaways in which control swings more than none; see `Assessment.share_worse`."""
    worse = 0
    undecided = 0
    for with_control, without in zip(controlled, uncontrolled, strict=True):
        if with_control.departure_reason and without.departure_reason:
            undecided += 1
        elif _is_worse(with_control, without):
            worse += 1
    return share_of(worse, len(controlled), undecided)


def _is_worse(run: RunOutcome, uncontrolled: RunOutcome) -> bool:
    """Whether a run with control is worse than one without; one of them at least was complete."""
    if run.departure_reason or uncontrolled.departure_reason:
        return bool(run.departure_reason)
    return run.rms_swing > uncontrolled.rms_swing


def _in_model(swing: float) -> float:
    """A swing [rad], NaN beyond the model's edge."""
    return swing if swing <= radians(FARTHEST_SWING) else nan
